"""What a pass of more photons has besides more photons: bands, so that no error stays that they cannot cure, and weak
branches that are as narrow as strong ones where that costs little."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.gpu.context import Context
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Dielectric
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes import pilot
from spectrasplat.passes.trace import SPLIT_THRESHOLD
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.light_pass import LightPass
from spectrasplat.render.light_plan import Division

from tests.reference.beam_worlds import scene_of

SETTINGS = RenderSettings(120, 68, method="srd-photons", layer="caustic")


def prepared(gl: Context, name: str, division: Division | None = None, roughness: float = 0.0) -> LightPass:
    """`roughness`: of all glass in the scene."""
    scene = load_scene(shipped_scenes()[name])
    if roughness > 0.0:
        glass = [isinstance(thing.material, Dielectric) for thing in scene.objects]
        ground = [
            replace(thing, material=replace(thing.material, roughness=roughness)) if is_glass else thing
            for thing, is_glass in zip(scene.objects, glass, strict=True)
        ]
        scene = replace(scene, objects=tuple(ground))
    buffers = scene_buffers(gl, scene, SETTINGS)
    light = LightPass(gl, scene, SETTINGS, buffers.features, buffers, division=division)
    light.prepare()
    return light


def bands(light: LightPass, photons: int) -> int:
    light.begin(photons, 1)
    return max(light.stats.bands.values())


def test_bands_grow_with_the_fifth_root_of_the_photons_once_footprints_are_narrow(
    gl: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    light = prepared(gl, "prism_case")
    photons = [1_000 * 4**i for i in range(5)]
    rough = bands(light, photons[2])
    monkeypatch.setattr(pilot, "FEW_OF_A_BAND", 0.0)
    # Of bands of a few dozen photons the edges are rough: half as many are taken.
    assert bands(light, photons[2]) > 2 * rough
    slope = np.polyfit(np.log(photons), np.log([bands(light, n) for n in photons]), 1)[0]
    assert abs(slope - 0.2) < 0.04


def test_bands_grow_with_the_cube_root_of_the_photons_while_footprints_are_broad(
    gl: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pilot, "LEAST_BROAD", 0.0)
    light = prepared(gl, "spectrometer")
    photons = [10_000 * 4**i for i in range(4)]
    slope = np.polyfit(np.log(photons), np.log([bands(light, n) for n in photons]), 1)[0]
    assert abs(slope - 1.0 / 3.0) < 0.05


def test_each_photon_s_own_footprint_says_what_its_chord_may_miss(gl: Context) -> None:
    """A ball's reflected light is broad, and says nothing of what its focus needs; more photons get more bands."""
    counts = [bands(prepared(gl, "ball"), photons) for photons in (2_000, 30_000, 1_000_000)]
    assert counts[0] < counts[1] < counts[2] <= 5, counts


def test_ground_glass_gets_the_bands_that_its_lobes_can_tell_apart(
    gl: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No band widens a lobe's footprints: rougher glass needs fewer, more photons a few more."""
    fine, coarse = prepared(gl, "spectrum", roughness=0.05), prepared(gl, "spectrum", roughness=0.3)
    assert bands(fine, 60_000) > 2 * bands(coarse, 60_000)
    assert bands(fine, 60_000) < bands(fine, 1_000_000) < 2 * bands(fine, 60_000)
    told = bands(coarse, 60_000)
    # As one more polished photon's, footprints would seem to widen with every band.
    monkeypatch.setattr(pilot.PilotFit, "_ground", lambda fit, photons: np.zeros(len(photons), bool))
    assert bands(coarse, 60_000) < told


def test_weak_branches_keep_their_lattices_where_that_costs_little(gl: Context) -> None:
    """Most photons of `prism_case` end on its slit; every ray of the ball's has weak branches."""
    slit, ball = prepared(gl, "prism_case"), prepared(gl, "ball")
    for light, threshold in ((slit, pilot.KEPT_THRESHOLDS[0]), (ball, pilot.KEPT_THRESHOLDS[-1])):
        assert light.trace.split_threshold == threshold
    by_default, kept, *_ = next(iter(slit.survey.pilots.values())).flights
    assert by_default < kept <= pilot.MOST_MORE_FLIGHTS * by_default
    # Six pilots have traced the same rays, each of which flies once at least.
    assert by_default > slit.trace.rays_traced / 6


def test_weak_branches_that_the_queues_have_no_room_for_play_roulette(
    gl: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However much work may be: each of a grating's orders is a lattice of its own, all in flight at once."""
    monkeypatch.setattr(pilot, "MOST_MORE_FLIGHTS", 2.0)
    light = prepared(gl, "spectrometer")
    by_default, kept = (sum(pilot.flights[i] for pilot in light.survey.pilots.values()) for i in range(2))
    assert kept < pilot.MOST_MORE_FLIGHTS * by_default
    assert max(pilot.fullness[0] for pilot in light.survey.pilots.values()) > 1.0
    assert light.trace.split_threshold == SPLIT_THRESHOLD


def test_frames_that_share_their_lattices_play_roulette_alike(gl: Context) -> None:
    light = prepared(gl, "prism_case", Division({0: (6, 1)}))
    assert light.trace.split_threshold == SPLIT_THRESHOLD


STRIP = """
[[lights]]
kind = "area"
position = [0.0, 0.0, 2.0]
direction = [0.0, 0.0, -1.0]
tangent = [1.0, 0.0, 0.0]
size = [4.0, 0.02]
flux_w = 1.0

[[objects]]
shape = "slab"
width = 0.5
height = 0.5
thickness = 0.002
position = [0.0, 0.0, 1.0]
material = {{ n_d = 1.0 }}

[[objects]]
shape = "plane"
width = {shade}
height = 9.0
position = [0.0, 0.0, 1.5]
material = "diffuse"
"""


@pytest.mark.parametrize("shade", [0.001, 0.6], ids=["bare", "its middle hidden"])
def test_few_photons_of_a_lamp_much_wider_than_the_glass_hold_its_light(gl: Context, shade: float) -> None:
    """A strip 4 long and 0.02 wide, 1 above a pane of 0.5 that does not refract: Lambert's law for each point of the
    strip that sees a point of the pane past a shade halfway. Light from the middle alone would be 2.5 times as much,
    or none. Noticed are 5 % too much or too little."""
    scene = scene_of(STRIP.format(shade=shade), floor_z=0.9)
    buffers = scene_buffers(gl, scene, SETTINGS)
    light = LightPass(gl, scene, SETTINGS, buffers.features, buffers)
    light.prepare()
    strip, pane = np.linspace(-2.0, 2.0, 401)[:, None, None], np.linspace(-0.25, 0.25, 51)
    beside = np.hypot(strip - pane[:, None], pane)
    seen = np.abs(strip + pane[:, None]) > shade
    expected = 0.25 * (seen / (np.pi * (1.0 + beside**2) ** 2)).mean()
    photons, landed = 20_000, []
    for seed in range(12):
        light.begin(photons, seed)
        for _ in light.pass_steps(0, photons):
            pass
        landed.append(light.stats.tally.ended["deposited"] / photons)
    light.release()
    assert np.mean(landed) == pytest.approx(expected, rel=0.05)
