"""Photons near a receiver's border stand for those beyond it: an even light is even up to the border, and all there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.features import facts
from spectrasplat.features.features import Features
from spectrasplat.features.receivers import MOST_IMAGES
from spectrasplat.gpu.packed_records import read_records
from spectrasplat.model.geometry.primitives import box, plane
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.scene import Camera, Diffuse, Scene, SceneObject
from spectrasplat.model.scene_camera import camera_frame
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.footprint import Footprints
from spectrasplat.render.still import render
from spectrasplat.stress.rigs.probe import light_pass
from spectrasplat.stress.rigs.scene_parts import SUN, solid, stage, turn
from spectrasplat.stress.rigs.splat_rig import Rig, photons

NOON = replace(SUN, direction=(0.0, 0.0, -1.0))
SIDES = 2.0, 1.6
SIZE = 96, 64
VIEW = Camera((0.0, -4.0, 9.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), "orthographic", vertical_extent=3.0)
PHOTONS = 20_000
"""Of the lattice over a plate of 81 units²: 790 land on the table."""
SETTINGS = RenderSettings(
    width=SIZE[0], height=SIZE[1], photons=PHOTONS, spp=64, layer="caustic", method="srd-photons", tally=True
)


def table(degrees: float) -> Scene:
    """Noon's light comes evenly through a plate high above a small table."""
    place = np.eye(4)
    place[:3, :3] = turn((0.0, 0.0, 1.0), degrees)
    plate = solid("plate", box((9.0, 9.0, 0.2)), constant(1.5, "n 1.5"), (0.0, 0.0, 20.0))
    receiver = SceneObject("table", plane(*SIDES), Diffuse(), place)
    return stage(plate, lights=[NOON], camera=VIEW, table=receiver)


def coverage(scene: Scene, parts: int = 30) -> np.ndarray:
    """Share of each pixel that the table covers, (H, W)."""
    right, up, forward = camera_frame(VIEW)
    width, height = (parts * side for side in SIZE)
    x = (np.arange(width) + 0.5) / parts - 0.5 * SIZE[0]
    y = 0.5 * SIZE[1] - (np.arange(height) + 0.5) / parts
    side = VIEW.vertical_extent / SIZE[1]
    places = np.array(VIEW.position) + side * (x[None, :, None] * right + y[:, None, None] * up)
    places = (places - places[..., 2:] / forward[2] * forward) @ scene.objects[-1].object_to_world[:3, :3]
    within = (np.abs(places[..., :2]) < 0.5 * np.array(SIDES)).all(axis=-1)
    return within.reshape(SIZE[1], parts, SIZE[0], parts).mean(axis=(1, 3))


def errors(gl, degrees: float, photons: int = PHOTONS) -> tuple[float, float, float]:
    """Of the table's pixels by their share of it: root mean square, and excess of the sum; excess of what maps hold
    over what was drawn."""
    scene = table(degrees)
    share = coverage(scene)
    found = render(scene, replace(SETTINGS, photons=photons), context=gl)
    picture = found.rgb[..., 1]
    even = picture / np.median(picture[share == 1.0])
    seen = share > 0.0
    light = found.stats.light
    held = (found.stats.map_flux_w + light.outside_map_w) / light.drawn_w - 1.0
    return float(np.sqrt(np.mean((even - share)[seen] ** 2))), float(even.sum() / share.sum() - 1.0), held


@pytest.mark.parametrize("degrees", [17.0])
def test_an_evenly_lit_table_is_even_up_to_its_borders(gl, degrees: float) -> None:
    """Before, 2.5 % of root mean square and 0.9 % of all light were lost."""
    scatter, excess, held = errors(gl, degrees)
    assert scatter < 0.01 and abs(excess) < 2e-3
    # The lattice has half a row more or less on the table than its share of it.
    assert abs(held) < 0.01


def test_few_photons_do(gl) -> None:
    scatter, excess, _ = errors(gl, 17.0, 1_000)
    assert scatter < 0.02 and abs(excess) < 3e-3


def test_where_nothing_lands_near_a_border_no_program_asks(gl, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = table(0.0)
    large = replace(scene, objects=(scene.objects[0], SceneObject("table", plane(40.0, 40.0), Diffuse())))
    assert Features.of(scene, SETTINGS).border_images and Features.of(large, SETTINGS).border_images
    with light_pass(gl, scene, SETTINGS) as (light, _):
        assert light.features.border_images and len(light.layout.borders[0]) == 4
    with light_pass(gl, large, SETTINGS) as (light, _):
        assert not light.features.border_images and not light.layout.borders
    monkeypatch.setattr(facts, "has_borders", lambda item: False)
    assert not Features.of(scene, SETTINGS).border_images


# -- mirrored images: of photons that are on no lattice -----------------------------------

LOW, HIGH = 8.0, 56.0
SQUARE = ((1.0, 0.0, 0.0, -LOW), (-1.0, 0.0, 0.0, HIGH), (0.0, 1.0, 0.0, -LOW), (0.0, -1.0, 0.0, HIGH))
PLAIN = Features(spectral_groups=0, border_images=True)


def drawn(gl, borders: tuple[tuple[float, ...], ...], records: np.ndarray, chosen: Features = PLAIN) -> np.ndarray:
    """What a map of 64 × 64 texels holds of a receiver with these borders."""
    rig = Rig(gl.ctx, chosen)
    rows = np.zeros((1, len(borders) + 1, 4), np.float32)
    rows[0, : len(borders)] = borders
    rig.atlas.borders = gl.ctx.texture((rows.shape[1], 1), 4, rows, dtype="f4")
    return rig.draw(records)[..., 3]


def grid(spacing: float, low: float = LOW, high: float = HIGH) -> np.ndarray:
    along = np.arange(low + 0.5 * spacing, high, spacing)
    return np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("spacing", [0.5, 2.0, 6.0])
def test_mirrored_an_even_grid_is_even_up_to_borders_and_corners(gl, spacing: float) -> None:
    sides = {"axis_s": (0.5 * spacing, 0.0), "axis_t": (0.0, 0.5 * spacing)}
    records = photons(PLAIN, grid(spacing), **sides)
    found = drawn(gl, SQUARE, records)[8:56, 8:56]
    # A Gaussian of half a spacing leaves a ripple of 1.4 % along either axis; three deviations are drawn.
    assert np.abs(found / found.mean() - 1.0).max() < 0.05
    assert found.std() < 0.018 * found.mean()
    bare = drawn(gl, ((0.0, 0.0, 0.0, 0.0),), records)[8:56, 8:56]
    assert bare.min() < (0.6 if spacing > 1.0 else 0.95) * found.mean()
    # All of the light is there, of which some was lost.
    whole = drawn(gl, ((0.0, 0.0, 0.0, 0.0),), photons(PLAIN, np.array([[32.0, 32.0]]), **sides)).sum()
    assert found.sum() == pytest.approx(len(records) * whole, rel=2e-3)


def test_a_photon_far_from_borders_has_no_image(gl) -> None:
    records = photons(PLAIN, np.array([[20.0, 30.0]]), axis_s=(3.0, 0.0), axis_t=(0.0, 3.0))
    np.testing.assert_array_equal(drawn(gl, SQUARE, records), drawn(gl, ((0.0, 0.0, 0.0, 0.0),), records))


@pytest.mark.parametrize(("place", "lights_up"), [((10.0, 30.0), True), ((22.0, 30.0), False)])
def test_what_lands_beyond_a_border_is_not_mirrored(gl, place: tuple[float, float], lights_up: bool) -> None:
    """A band whose ends land inside has an image. One of which a third lands outside has none: that light was lost."""
    swept = Features(spectral_groups=1, border_images=True)
    chord = (3.0, 0.0) if lights_up else (-24.0, 0.0)
    records = photons(swept, np.array([place]), axis_s=(1.2, 0.0), axis_t=(0.0, 1.2), chord=chord, x_anchor=0.0)
    with_images, bare = drawn(gl, SQUARE, records, swept), drawn(gl, ((0.0, 0.0, 0.0, 0.0),), records, swept)
    assert (with_images[:, 8:56].sum() > 1.001 * bare[:, 8:56].sum()) == lights_up


def test_images_keep_to_their_photons_slots(gl, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where a receiver has three windows."""
    found: list[int] = []
    real = Footprints.run

    def run(self: Footprints, *arguments: object) -> None:
        real(self, *arguments)  # type: ignore[arg-type]
        splats = read_records(self.splat, self.splats, self.capacity)[:: self.slots_per_photon]
        found.append(int(splats["images"].max()))

    monkeypatch.setattr(Footprints, "run", run)
    render(
        load_scene(shipped_scenes()["lens_text"]), RenderSettings(width=64, height=36, photons=6000, spp=1), context=gl
    )
    assert 0 < max(found) <= MOST_IMAGES * 3
