"""The way through tinted glass, told in levels: one band has the colour that many bands have, and all of the light."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.features.features import Features
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.model.tint_levels import LEVELS
from spectrasplat.render.device_scene import spectral_axis
from spectrasplat.render.light_pass import LightPass

from tests.unit.scene_texts import load

SLAB = """
[camera]
position = [0.0, -4.0, 3.0]
target = [0.0, 0.0, 0.0]
[[lights]]
kind = "directional"
direction = [0.0, 0.0, -1.0]
illuminance_lx = 100.0
[[objects]]
name = "slab"
shape = "box"
size = [{side}, {side}, {thickness}]
position = [0.0, 0.0, 2.0]
material = {{ glass = "N-BK7", absorption = {{ colour = {colour}, distance = 1.0 }} }}
[[objects]]
name = "table"
shape = "plane"
width = 2.0
height = 2.0
material = "diffuse"
"""
WINE, GREEN, DARK = [0.85, 0.16, 0.20], [0.2, 0.7, 0.3], [0.02, 0.05, 0.01]


def scene_of(tmp_path: Path, colour: list[float], thickness: float, side: float = 2.2) -> Scene:
    return load(tmp_path, SLAB.format(colour=colour, thickness=thickness, side=side))


def settings_of(method: str = "srd-photons", bins: int | None = None) -> RenderSettings:
    return RenderSettings(width=64, height=64, photons=1, layer="map:table", method=method, batch=1 << 15, bins=bins)


def traced(gl: Context, scene: Scene, photons: int, *, told: bool = True) -> tuple[np.ndarray, LightPass]:
    """Middle of the table's map (rows, columns, 4), X, Y, Z in lx and W/unit²; `told`: in levels, else at three places
    of a band."""
    settings = settings_of()
    features = Features.of(scene, settings)
    features = features if told else replace(features, tint_levels=0)
    buffers = SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features))
    light = LightPass(gl, scene, settings, features, buffers)
    light.prepare()
    light.begin(photons, 1)
    for _ in light.pass_steps(0, photons):
        pass
    light.finish()
    found = light.maps.receiver(0) * light.maps.scale / float(light.layout.placements[0]["texel_area"])
    rows, columns = (slice(side // 4, side - side // 4) for side in found.shape[:2])
    return found[rows, columns], light


def let_through(scene: Scene, thickness: float) -> np.ndarray:
    """X, Y, Z in lx and W/unit² below the slab: a plate with all its reflections, by the nanometre."""
    glass, spectrum = scene.objects[0].material, scene.lights[0].spectral_power
    n = glass.dispersion.index(VISIBLE_NM)
    reflected, left = ((n - 1.0) / (n + 1.0)) ** 2, np.exp(-glass.absorption.coefficient * thickness)
    share = (1.0 - reflected) ** 2 * left / (1.0 - reflected**2 * left**2)
    weights = np.column_stack([K_M * cmf_xyz(), np.ones(401)])
    return (spectrum.density * share) @ weights * 100.0 / (K_M * spectrum.density @ cmf_xyz()[:, 1])


@pytest.mark.parametrize(("colour", "thickness"), [(WINE, 0.2), (GREEN, 1.0), (WINE, 2.5)])
def test_one_band_has_the_colour_of_a_plate(gl, tmp_path: Path, colour: list[float], thickness: float) -> None:
    scene = scene_of(tmp_path, colour, thickness)
    truth, shone = let_through(scene, thickness), let_through(scene, 0.0)
    found, light = traced(gl, scene, 20_000)
    assert [len(plan.bands) for plan in light.plans] == [1]
    # A thousandth or two of what shines on it: where a curve is steep, rounding up and down leaves a little too much.
    assert np.all(np.abs(found.mean(axis=(0, 1)) - truth) < 0.005 * truth + 0.003 * shone)
    # By turns: no place is a level off, which would be a tenth.
    assert np.all(found.std(axis=(0, 1)) < 0.02 * truth + 0.01 * shone)
    light.release()


@pytest.mark.parametrize("thickness", [0.7, 1.0, 1.3])
def test_what_deep_glass_lets_through_is_right_as_a_share(gl, tmp_path: Path, thickness: float) -> None:
    """A few per cent of the light: halfway between two levels less of it is left than their mean, by 4 %."""
    scene = scene_of(tmp_path, DARK, thickness)
    truth = let_through(scene, thickness)
    found, light = traced(gl, scene, 20_000)
    assert truth[1] < 0.12 * let_through(scene, 0.0)[1]
    assert found.mean(axis=(0, 1))[[1, 3]] == pytest.approx(truth[[1, 3]], rel=0.01)
    light.release()


def test_light_that_is_drawn_and_absorbed_is_all_there_is(gl, tmp_path: Path) -> None:
    light = traced(gl, scene_of(tmp_path, WINE, 1.0), 20_000)[1]
    tally = light.stats.tally
    assert tally.imbalance < 1e-5 and tally.ended["absorbed"] > 0.3 * tally.emitted
    assert light.stats.splats_w == pytest.approx(tally.ended["deposited"], rel=1e-3)
    light.release()


def test_bands_need_not_be_cut_for_a_tint(gl, tmp_path: Path) -> None:
    """What levels are for: the colour of many bands in one."""
    scene = scene_of(tmp_path, WINE, 1.0)
    told, with_levels = traced(gl, scene, 5_000)
    cut, without = traced(gl, scene, 5_000, told=False)
    assert len(with_levels.plans[0].bands) == 1 < len(without.plans[0].bands)
    assert told.mean(axis=(0, 1)) == pytest.approx(cut.mean(axis=(0, 1)), rel=0.1)
    for light in (with_levels, without):
        light.release()


def test_levels_are_not_made_where_another_tint_needs_many_bands(tmp_path: Path) -> None:
    """32 levels for each of 22 bands were more tables than a texture holds, and spared two bands of 24."""
    one = scene_of(tmp_path, WINE, 1.0)
    slab, table = one.objects

    def also(colour: list[float]) -> int:
        other = replace(slab, material=scene_of(tmp_path, colour, 1.0).objects[0].material)
        return Features.of(replace(one, objects=(slab, other, table)), settings_of()).tint_levels

    assert also([0.95, 0.96, 0.97]) == Features.of(one, settings_of()).tint_levels == LEVELS
    assert also([0.01, 0.6, 0.02]) == 0
