"""Crystals and polarisers through the photons' passes: known angles, shares and columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.gpu import device_traits
from spectrasplat.gpu.context import Context, create_context
from spectrasplat.gpu.device_traits import DeviceTraits
from spectrasplat.model.geometry.primitives import box, plane
from spectrasplat.model.geometry.primitives_gem import brilliant
from spectrasplat.model.optics import crystals
from spectrasplat.model.optics.colorimetry import VISIBLE_NM
from spectrasplat.model.optics.glass import Dispersion, cauchy, constant
from spectrasplat.model.scene import Camera, Dielectric, Polariser, Scene, SceneObject
from spectrasplat.reference.optics import unit
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.invalidation import dirty_level, shown_glasses
from spectrasplat.stress.rigs.camera_probe import (
    FEW,
    daylight_mean,
    render_probe,
    white_furnace,
)
from spectrasplat.stress.rigs.gpu_paths import Photons, extruded, placed, screen, trace_beam

from tests.gpu.camera_rig import at, in_the_sun, shares_of_the_sun

DOWN = np.array([0.0, 0.0, -1.0])
N_O, N_E = 1.6584, 1.4864
FLOOR = screen(np.array([0.0, 0.0, -1.5]), np.array([0.0, 0.0, 1.0]), 30.0)


def crystal(axis: Sequence[float], n_o: Dispersion | float = N_O, n_e: Dispersion | float = N_E) -> Dielectric:
    """Calcite at the D line, or other indices."""
    indices = [n if isinstance(n, Dispersion) else constant(n) for n in (n_o, n_e)]
    return Dielectric(indices[0], extraordinary=indices[1], axis=tuple(unit(np.array(axis, float)).tolist()))


def shone(gl: Context, objects: Sequence[SceneObject], nm: float | tuple[float, float] = 589.0, **more) -> Photons:
    """A thin beam of unpolarised light from above, onto a floor."""
    start, direction = more.pop("start", np.array([0.0, 0.0, 0.8])), more.pop("direction", DOWN)
    return trace_beam(gl, objects, None, FLOOR, start, direction, 1e-3, nm, count=16, **more)


def landings(found: Photons, depth: int) -> tuple[np.ndarray, np.ndarray]:
    """Places relative to the first ray's start (L, 2) and powers per power sent (L,) of what landed after so many
    surfaces, by place."""
    some = found.of_depth(depth)
    off = np.round((some.position - some.start)[:, :2], 3)
    places = np.unique(off, axis=0)
    of_place = [(off == place).all(axis=1) for place in places]
    exact = [(some.position - some.start)[chosen, :2].mean(axis=0) for chosen in of_place]
    return np.array(exact), np.array([(some.records["flux_w"] / some.weight)[chosen].mean() for chosen in of_place])


@pytest.mark.core
def test_a_rhomb_doubles_an_image(gl: Context) -> None:
    """Upright into a cleavage face of calcite, 44.6° to the axis: half of the light 6.2° aside, by the closed form, the
    other half straight on."""
    angle = np.radians(44.6)
    slab = placed("slab", box((1.0, 1.0, 0.5)), crystal((np.sin(angle), 0.0, np.cos(angle))))
    places, powers = landings(shone(gl, [slab]), 2)
    aside = (N_O**2 - N_E**2) * np.tan(angle) / (N_E**2 + N_O**2 * np.tan(angle) ** 2)
    assert np.degrees(np.arctan(aside)) == pytest.approx(6.2, abs=0.05)
    assert np.abs(places - [[0.0, 0.0], [0.5 * aside, 0.0]]).max() < 2e-6
    along = np.sqrt(1.0 / (np.sin(angle) ** 2 / N_E**2 + np.cos(angle) ** 2 / N_O**2))
    assert powers == pytest.approx([0.5 * (4.0 * n / (n + 1.0) ** 2) ** 2 for n in (N_O, along)], rel=2e-5)


def test_a_pool_of_rays_doubles_it_as_well() -> None:
    """As a GPU follows rays: packed, in slots of their own."""
    with device_traits.assumed(DeviceTraits(splats_by_compute=True)), create_context() as context:
        test_a_rhomb_doubles_an_image(context)


def halves(first: Sequence[float], second: Sequence[float], angle: float) -> list[SceneObject]:
    """A cube cut askew, its halves with these axes; light comes from above."""
    half, rise = 0.5, 0.5 * np.tan(angle)
    upper = np.array([[-half, 0.5], [-half, -rise], [half, rise], [half, 0.5]])
    lower = np.array([[half, rise], [-half, -rise], [-half, -0.5], [half, -0.5]])
    # Sections lie in x-y; upright they stand in x-z.
    upright = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
    meshes = [extruded(name, section).transformed(upright) for name, section in (("upper", upper), ("lower", lower))]
    return [placed(mesh.name, mesh, crystal(axis)) for mesh, axis in zip(meshes, (first, second), strict=True)]


def behind_a_cut(first: float, second: float, angle: float) -> float:
    """Where a wave arrives on the floor of these indices before and behind the cut."""
    turn = np.arcsin(first * np.sin(angle) / second) - angle
    out = np.arcsin(second * np.sin(turn))
    return -float(0.5 * np.tan(turn) + np.tan(out))


@pytest.mark.parametrize("name", ["wollaston", "rochon"])
def test_prisms_of_two_crystals_part_polarisations(gl: Context, name: str) -> None:
    """Closed forms: both waves of a Wollaston prism turn, to either side; of a Rochon prism one goes straight."""
    angle = np.radians(20.0)
    across = (1.0, 0.0, 0.0) if name == "wollaston" else (0.0, 0.0, 1.0)
    found = shone(gl, halves(across, (0.0, 1.0, 0.0), angle))
    places, powers = landings(found, 3)
    strong = places[powers > 0.3]
    other = behind_a_cut(N_E, N_O, angle) if name == "wollaston" else 0.0
    wanted = sorted([behind_a_cut(N_O, N_E, angle), other])
    assert len(strong) == 2
    assert np.abs(strong[:, 0] - wanted).max() < 5e-6
    assert np.abs(strong[:, 1]).max() < 2e-6


def sheet(z: float, axis_deg: float, **values: float) -> SceneObject:
    axis = float(np.cos(np.radians(axis_deg))), float(np.sin(np.radians(axis_deg))), 0.0
    return SceneObject(f"sheet {z}", plane(1.0, 1.0), Polariser(axis=axis, **values), at(0.0, 0.0, z))


@pytest.mark.parametrize("turn_deg", [0.0, 20.0, 45.0, 70.0])
@pytest.mark.parametrize("retardance_nm", [0.0, 147.25, 294.5, 1000.0])
def test_a_wave_plate_between_polarisers(gl: Context, turn_deg: float, retardance_nm: float) -> None:
    """Crossed: ½ sin²(2 θ) sin²(π Γ / λ); parallel: the rest of one half."""
    plate = sheet(0.3, turn_deg, transmittance=1.0, crossed_transmittance=1.0, retardance_nm=retardance_nm)
    crossed = 0.5 * np.sin(np.radians(2.0 * turn_deg)) ** 2 * np.sin(np.pi * retardance_nm / 589.0) ** 2
    for last, wanted in ((90.0, crossed), (0.0, 0.5 - crossed)):
        found = shone(gl, [sheet(0.6, 0.0), plate, sheet(0.0, last)])
        powers = found.of_depth(3).records["flux_w"] / found.of_depth(3).weight
        assert (powers.mean() if len(powers) else 0.0) == pytest.approx(wanted, abs=2e-6)
        assert np.abs((found.position - found.start)[:, :2]).max(initial=0.0) < 5e-6


def test_a_polariser_sees_what_a_crystal_sends(gl: Context) -> None:
    """Behind a rhomb a polariser along its section passes the extraordinary image alone."""
    slab = placed("slab", box((1.0, 1.0, 0.5)), crystal((1.0, 0.0, 1.0)))
    for axis_deg, seen in ((0.0, [True, False]), (90.0, [False, True]), (45.0, [True, True])):
        places, powers = landings(shone(gl, [slab, sheet(-0.6, axis_deg)]), 3)
        assert len(places) == sum(seen)
        assert (np.abs(places[:, 0]).max() > 0.04) == seen[0]
        assert powers == pytest.approx(0.44 / len(places), rel=0.06)


@pytest.mark.parametrize("axis", [(0.3, 0.5, 0.8), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)])
def test_energy_is_kept_in_a_stone(gl: Context, axis: tuple[float, float, float]) -> None:
    """Facets at every angle, total reflections, two waves into two: all that was sent is accounted for."""
    stone = placed("stone", brilliant(), crystal(axis, 1.9232, 1.9682))
    found = shone(gl, [stone], start=np.array([0.21, 0.13, 2.0]), max_depth=5)
    assert found.tally.imbalance < 1e-5
    assert found.tally.ended["lost_numeric"] == 0.0


def test_next_to_no_birefringence_is_glass(gl: Context) -> None:
    """Askew through a block, the axis in the plane of incidence: the landings of both waves together are those of
    glass."""
    direction = unit(np.array([0.7, 0.0, -1.0]))
    places, powers = {}, {}
    for name, material in (("glass", Dielectric(constant(1.6))), ("crystal", crystal((0.3, 0.0, 0.9), 1.6, 1.600001))):
        block = placed("block", box((3.0, 3.0, 0.5)), material)
        found = shone(gl, [block], start=-0.5 * direction, direction=direction, polarisation=True)
        some = found.of_depth(2)
        places[name] = (some.position - some.start).mean(axis=0)
        powers[name] = float((some.records["flux_w"] / some.weight).sum() / found.lattice_in_disc)
    assert np.abs(places["glass"] - places["crystal"]).max() < 2e-6
    assert powers["crystal"] == pytest.approx(powers["glass"], rel=1e-5)


@pytest.mark.parametrize("method", ["srd", "srd-lambda"])
def test_columns_follow_both_indices(gl: Context, method: str) -> None:
    """d(landing)/dλ by two columns, n_o's and n_e's, and by the shared one, against landings of other wavelengths."""
    n_o, n_e = cauchy([1.62, 0.012]), cauchy([1.46, 0.006])
    block = placed("block", box((3.0, 3.0, 0.5)), crystal((0.4, 0.3, 0.8), n_o, n_e))
    direction = unit(np.array([0.5, 0.2, -1.0]))

    def landed(nm: float) -> Photons:
        found = shone(gl, [block], nm, start=-0.6 * direction, direction=direction, method=method, max_depth=4)
        order = np.lexsort((found.records["photon_id"], found.records["branch_key"]))
        return found.where(order)

    ends_nm = np.array([540.0, 560.0])
    middle, low, high = (landed(nm) for nm in (550.0, *ends_nm))
    assert len(middle.records) >= 100
    assert np.array_equal(middle.records["branch_key"], high.records["branch_key"])
    slope = np.zeros_like(middle.position)
    for g in range(middle.groups.count):
        ends = middle.groups.variables(ends_nm, middle.axis.x_of_nm(ends_nm))[g]
        slope += middle.dposition_dvar[:, g] * (ends[1] - ends[0])
    wanted = high.position - low.position
    assert np.abs(wanted).max() > 5e-4
    assert np.abs(slope - wanted).max() < 1e-5


CALCITE = crystals.find_crystal("calcite", "here")
AWAY = Camera((0.6, 0.7, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), vertical_fov_deg=14.0)
UPRIGHT = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), "orthographic", vertical_extent=0.05)


def test_a_stone_of_calcite_is_not_seen_in_a_furnace(gl: Context) -> None:
    """Camera paths: whatever a facet does to them, their shares are one."""
    stone = placed("stone", brilliant(), crystal((0.6, 0.0, 0.8), CALCITE.ordinary, CALCITE.extraordinary))
    assert render_probe(gl, white_furnace(stone, camera=AWAY), FEW).mean == pytest.approx(1.0, abs=2e-3)


def test_sheets_before_white(gl: Context) -> None:
    """Crossed polarisers with a third between at 30°, or a wave plate: seen by the camera, also with few samples, and
    as the sun's light lies behind them."""
    turn, third = np.radians(30.0), sheet(2.0, 30.0)
    between, passed = [third], [np.full(401, 0.5 * np.cos(turn) ** 2 * np.sin(turn) ** 2)]
    for retardance_nm in (280.0, 1000.0):
        between.append(sheet(2.0, 30.0, crossed_transmittance=1.0, retardance_nm=retardance_nm))
        passed.append(0.5 * np.sin(2.0 * turn) ** 2 * np.sin(np.pi * retardance_nm / VISIBLE_NM) ** 2)
    stands = [(sheet(2.5, 0.0), middle, sheet(1.5, 90.0)) for middle in between]
    expected = daylight_mean(np.array(passed))
    for sheets, wanted in zip(stands, expected, strict=True):
        seen = render_probe(gl, white_furnace(*sheets, camera=UPRIGHT), replace(FEW, spp=4)).mean
        assert seen == pytest.approx(wanted, rel=0.01, abs=2e-3)
    assert shares_of_the_sun(gl, stands) == pytest.approx(expected, rel=0.015, abs=4e-3)


def test_what_edits_of_a_crystal_cost() -> None:
    """In the viewer photons follow both indices where n_d stays; for another axis they are traced anew, and glass takes
    other programs."""
    material = crystal((0.4, 0.3, 0.8), cauchy([1.62, 0.012]), cauchy([1.46, 0.006]))
    scene = in_the_sun(placed("block", box((1.0, 1.0, 0.2)), material))

    def edited(other: Dielectric) -> Scene:
        return replace(scene, objects=(scene.objects[0], replace(scene.objects[1], material=other)))

    def cost(other: Dielectric) -> DirtyLevel:
        old, new = (LiveInputs(s, s.camera, 64, 36) for s in (scene, edited(other)))
        return dirty_level(old, old, new)

    gained = material.with_gain(1.5)
    assert cost(gained) == DirtyLevel.SPLAT
    assert shown_glasses(scene, edited(gained)) == dict(zip(material.dispersions, gained.dispersions, strict=True))
    assert cost(material.changed(axis=(1.0, 0.0, 0.0))) == DirtyLevel.TRACE
    assert cost(material.changed(extraordinary=None)) == DirtyLevel.BUILD
