"""The known answers T2, T3, T4, T13, T14, T15, and whole paths, through the real emit and trace shaders
(T1, T8, T12, T16: `test_known_answers_flat_gpu.py`; T5 to T7, T9 to T11: `test_known_answers_curved_gpu.py`).

Directions and their derivatives come from the same photons on two screens at different
distances. Float32: 1e-4 relative, mostly much better.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from reference.far_field import outgoing
from reference.surfaces import Plane, sphere
from reference.tracer import (
    AIR,
    RECEIVER,
    Index,
    TriangleList,
    make_ray,
    onto,
    through,
    trace,
)
from spectrasplat.gpu.context import Context
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.geometry.primitives import slab
from spectrasplat.model.geometry.primitives_round import sphere as sphere_mesh
from spectrasplat.passes.emission_domain import orthonormal_frame
from spectrasplat.reference import glasses
from spectrasplat.reference.glasses import C_NM, D_NM, F_NM
from spectrasplat.reference.optics import dot, unit
from spectrasplat.stress.case import FLUX_CLOSURE
from spectrasplat.stress.rigs.gpu_paths import Photons, extruded, glass, screen, trace_beam

from tests.gpu.mutants import mutate

pytestmark = pytest.mark.core

APEX = np.pi / 3


@cache
def ball_mesh(triangles: int) -> Mesh:
    return sphere_mesh(1.0, triangles)


def tilted_section(apex_rad: float) -> np.ndarray:
    """An isosceles triangle with its apex up, sides of length 1."""
    return np.array([[-np.sin(apex_rad / 2), 0], [np.sin(apex_rad / 2), 0], [0, np.cos(apex_rad / 2)]])


def in_plane(angle_rad: float) -> np.ndarray:
    """Unit vector at an angle from +x in the x-y plane."""
    return np.array([np.cos(angle_rad), np.sin(angle_rad), 0.0])


def across_prism(gl: Context, name: str, incidence: float, nm: float, around: float) -> tuple[np.ndarray, np.ndarray]:
    """(headings, d(heading)/dn) of all photons that go straight through the prism of T2; screens face `around`."""
    middle = np.array([-np.sin(APEX / 2) / 2, np.cos(APEX / 2) / 2, 0])
    direction = in_plane(incidence - APEX / 2)
    prism = extruded("prism", tilted_section(APEX))

    def traced_onto(target: Mesh) -> Photons:
        return trace_beam(gl, prism, glass(name), target, middle - direction, direction, 0.04, nm).of_depth(2)

    rays = outgoing(traced_onto, in_plane(around), 1.5, 5.5)
    assert len(rays.heading) > 100
    return rays.heading, rays.dheading_dn[:, 0]


@pytest.mark.parametrize(
    ("name", "deviations_deg", "slope_rad_um"),
    [
        ("N-BK7", (39.13905, 38.64670, 38.42932), -0.064130),
        ("F2", (49.38809, 48.19578, 47.70902), -0.147498),
        ("N-SF11", (69.25084, 66.34263, 65.24956), -0.338731),
    ],
)
def test_t2_prism_at_minimum_deviation(gl, name: str, deviations_deg: tuple[float, ...], slope_rad_um: float) -> None:
    incidence = float(np.arcsin(glasses.index(name, D_NM) / 2))
    start = incidence - APEX / 2
    for nm, expected_deg in zip((F_NM, D_NM, C_NM), deviations_deg, strict=True):
        heading, dheading_dn = across_prism(gl, name, incidence, nm, around=start - np.radians(deviations_deg[1]))
        assert np.degrees(start - heading) == pytest.approx(expected_deg, rel=1e-5)
        if nm == D_NM:
            assert -dheading_dn * glasses.slope(name, nm) == pytest.approx(slope_rad_um, rel=1e-4)


def slab_agrees(gl: Context, name: str) -> None:
    """T3 with every photon of a beam, on two screens; AssertionError where it is off."""
    block = slab(8.0, 8.0, 1.0)  # thickness along z
    bottom = float(block.bounds()[0][2])
    n, slope, s = float(glasses.index(name, D_NM)), float(glasses.slope(name, D_NM)), np.sin(np.pi / 4)
    x, dx_dum = s / np.sqrt(n * n - s * s), -s * n * slope / (n * n - s * s) ** 1.5
    columns = []
    for gap in (1.0, 21.0):
        below = screen(np.array([0, 0, bottom - gap]), [0, 0, 1])
        photons = trace_beam(gl, block, glass(name), below, [-2, 0, bottom + 3], [1, 0, -1], 0.3, D_NM).of_depth(2)
        assert len(photons.records) > 100
        # Straight at 45° but for the unit of thickness, which is crossed at a steeper angle.
        drop = photons.start[:, 2] - bottom - 1 + gap
        inside = photons.position[:, 0] - photons.start[:, 0] - drop
        assert inside == pytest.approx(x, abs=1e-4 * x + 1e-6 * gap)
        columns.append(photons.dposition_dn * slope)
        assert columns[-1][:, 0] == pytest.approx(dx_dum, rel=1e-4), "column"
    # Twenty units further down the column is the same: the direction does not disperse.
    assert np.abs(columns[1].mean(0) - columns[0].mean(0)).max() / 20 < 1e-6, "column"


@pytest.mark.parametrize(
    ("name", "x", "dx_dum"), [("N-BK7", 0.526946, 0.018554), ("F2", None, None), ("N-SF11", 0.431514, 0.043846)]
)
def test_t3_slab_leaves_direction_without_dispersion(gl, name: str, x: float | None, dx_dum: float | None) -> None:
    slab_agrees(gl, name)
    if x is not None:
        n, s = float(glasses.index(name, D_NM)), np.sin(np.pi / 4)
        assert s / np.sqrt(n * n - s * s) == pytest.approx(x, abs=6e-7)
        assert -s * n * glasses.slope(name, D_NM) / (n * n - s * s) ** 1.5 == pytest.approx(dx_dum, abs=6e-7)


@pytest.mark.parametrize(
    ("old", "new"),
    [("derivative -= n_i", "derivative += n_i"), ("derivative += medium_slope", "derivative -= medium_slope")],
    ids=["entering", "leaving"],
)
def test_t3_catches_one_sign_at_both_faces(
    gl, old: str, new: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mutate(monkeypatch, tmp_path, "lib/medium.glsl", old, new)
    with pytest.raises(AssertionError, match="^column"):
        slab_agrees(gl, "N-BK7")


def through_ball(height: float, index: Index) -> np.ndarray:
    """Exact ball: (position, ∂/∂n, ∂/∂h) on the plane x = 1.2, as rows."""
    ball = sphere((0, 0, 0), 1)
    index = Index(index.n, np.array([1.0, 0.0]))
    inside = through(make_ray([-2, height, 0], [1, 0, 0], [[0, 0, 0], [0, 1, 0]]), ball, AIR, index)
    landed = onto(through(inside, ball, index, AIR, root=1), Plane((1.2, 0, 0), (1, 0, 0)))
    return np.array([landed.position, *landed.dposition])


@pytest.mark.parametrize("nm", [F_NM, D_NM, C_NM])
def test_t4_ball_lens(gl, nm: float) -> None:
    ball = ball_mesh(327_680)
    photons = trace_beam(
        gl, ball, glass("N-BK7"), screen([1.2, 0, 0], [1, 0, 0]), [-3, 0, 0], [1, 0, 0], 0.85, nm, count=600
    ).of_depth(2)
    index = Index(float(glasses.index("N-BK7", nm)))
    height = np.linalg.norm(photons.start[:, 1:], axis=1)
    radial = photons.start / height[:, None]
    radial[:, 0] = 0
    exact = np.array([through_ball(h, index) for h in height])
    assert len(height) > 400 and height.max() > 0.84
    # The facets of 330k triangles are 0.005 wide: second order leaves 5e-5.
    assert np.abs(dot(photons.position, radial) - exact[:, 0, 1]).max() < 1e-4
    assert np.median(np.abs(dot(photons.position, radial) - exact[:, 0, 1])) < 5e-5
    spectral = np.abs(dot(photons.dposition_dn, radial) - exact[:, 1, 1])
    assert np.median(spectral / np.abs(exact[:, 1, 1])) < 2e-3 and spectral.max() < 0.02
    # Effective focal length from the innermost rays: y = h (1 - (x - principal plane)/f), principal plane in the
    # centre.
    inner = height < 0.12
    focal_length = 1.2 / (1 - dot(photons.position, radial) / height)[inner]
    assert np.median(focal_length) == pytest.approx(index.n / (2 * (index.n - 1)), rel=1e-2)


def test_t13_band_split_by_total_reflection(gl) -> None:
    # Straight into one face of a prism, so that the other is met at the apex angle.
    apex = np.radians(41.10)
    solid = extruded("splitter", tilted_section(apex))
    direction = in_plane(-apex / 2)
    entry = np.array([-np.sin(apex / 2) * 0.6, np.cos(apex / 2) * 0.4, 0])
    photons = trace_beam(
        gl, solid, glass("N-BK7"), screen([2, 0, 0], [1, 0, 0]), entry - direction, direction, 0.03, (400.0, 700.0)
    ).of_depth(2)
    passed = photons.where(photons.records["x_hi"] > photons.axis.x_of_nm(699.0))
    assert len(passed.records) > 50
    split_nm = photons.axis.nm_of_x(passed.records["x_lo"])
    # x is stored in 24 bits and n in 1e-7: dλ = dn/n' is about 2e-3 nm.
    assert split_nm == pytest.approx(503.239, abs=0.05)
    assert photons.tally.fallbacks["band_cut"] >= len(passed.records)
    assert (photons.axis.nm_of_x(photons.records["x_lo"]) > 503.1).all()  # nothing shorter got out here
    assert photons.tally.imbalance < FLUX_CLOSURE


@pytest.mark.parametrize(
    ("name", "x_mm", "dnm_dmm"),
    [
        ("N-BK7", (19.1320, 4.4542, -3.4169, -8.3520), (4.788, 9.743, 16.545, 24.675)),
        ("N-SF11", (143.1368, 26.3026, -18.2710, -41.9603), None),
    ],
)
def test_t14_prism_spectrum_on_a_screen(
    gl, name: str, x_mm: tuple[float, ...], dnm_dmm: tuple[float, ...] | None
) -> None:
    incidence = float(np.arcsin(glasses.index(name, 550.0) / 2))
    straight = incidence - APEX / 2 - (2 * incidence - APEX)
    for i, nm in enumerate((400.0, 500.0, 600.0, 700.0)):
        heading, dheading_dn = across_prism(gl, name, incidence, nm, around=straight)
        off = straight - heading
        # Near the axis 1e-4 of so small an angle is below what float32 holds: 1e-6 rad.
        assert 1000 * np.median(np.tan(off)) == pytest.approx(x_mm[i], rel=1e-4, abs=1e-3)
        assert np.abs(1000 * np.tan(off) - x_mm[i]).max() < 5e-3  # each photon's angle to 5e-6 rad
        if dnm_dmm:
            dmm_dnm = -dheading_dn * glasses.slope(name, nm) / np.cos(off) ** 2
            assert -1 / dmm_dnm == pytest.approx(dnm_dmm[i], rel=1e-4)


def test_t15_energy_near_the_fold_of_a_ball(gl) -> None:
    # One photon a lattice point, all of the same weight before Fresnel: counting them leaves Fresnel out.
    photons = trace_beam(
        gl,
        ball_mesh(81_920),
        glass("N-BK7"),
        screen([1.2, 0, 0], [1, 0, 0]),
        [-3, 0, 0],
        [1, 0, 0],
        1.0,
        D_NM,
        count=60_000,
    )
    emitted = photons.lattice_in_disc
    straight = photons.of_depth(2)
    radius = np.linalg.norm(straight.position[:, 1:], axis=1)
    assert len(radius) / emitted == pytest.approx(0.99505, abs=1e-3)  # above h = 0.99752 the ball turns light back
    fold = 0.06458174
    rings = [np.count_nonzero((radius >= s * fold) & (radius <= fold)) / emitted for s in (0.9, 0.99)]
    assert rings[0] == pytest.approx(0.237054, rel=2e-3)
    # The narrow ring is 6e-4 wide and the facets blur it by a tenth of that: it loses at the outer edge what sqrt says.
    assert rings[1] == pytest.approx(0.0740836, rel=3e-2)
    assert np.count_nonzero(radius <= fold) / emitted == pytest.approx(0.717808, rel=1e-3)
    # On the fold itself the footprint collapses: dr/dh changes sign with h.
    height = np.linalg.norm(straight.start[:, 1:], axis=1)
    near = np.abs(height - 0.5028279) < 0.004
    assert radius[near].max() == pytest.approx(fold, rel=2e-3)


def test_t15_fold_of_each_line(gl) -> None:
    photons = trace_beam(
        gl,
        ball_mesh(81_920),
        glass("N-BK7"),
        screen([1.2, 0, 0], [1, 0, 0]),
        [-3, 0, 0],
        [1, 0, 0],
        0.55,
        [(nm, nm) for nm in (F_NM, D_NM, C_NM)],
        count=3000,
    ).of_depth(2)
    radius = np.linalg.norm(photons.position[:, 1:], axis=1)
    height = np.linalg.norm(photons.start[:, 1:], axis=1)
    for band, fold in enumerate((0.0615807, 0.06458174, 0.0659364)):
        near = (photons.band == band) & (np.abs(height - 0.5) < 0.05)
        # The largest radius of a parabola through them; facets leave 1e-5.
        c, b, a = np.polynomial.polynomial.polyfit(height[near] - 0.5, radius[near], 2)
        assert c - b * b / (4 * a) == pytest.approx(fold, rel=1e-3)


@pytest.mark.parametrize(
    ("kind", "mirrored_at"),
    [("ball", ()), ("prism", ()), ("ball", (1,)), ("ball", (0,))],
    ids=["ball", "prism", "rainbow", "gloss"],
)
def test_whole_paths_against_the_reference_over_the_same_triangles(gl, kind: str, mirrored_at: tuple[int, ...]) -> None:
    """Position, every column and the flux with exact Fresnel of each photon on one kind of path."""
    ball = kind == "ball"
    solid = ball_mesh(320) if ball else extruded("prism", tilted_section(APEX))
    direction = unit(np.array([1.0, 0.1, -0.2])) if ball else in_plane(0.4)
    middle = solid.corners().reshape(-1, 3).mean(0)
    target = screen(middle + (-4 if mirrored_at else 3) * direction, direction)
    # Gloss goes back from the front of the ball, a rainbow from its middle heights.
    radius = 0.25 if not ball else 0.4 if mirrored_at == (0,) else 0.7
    events = 1 if mirrored_at == (0,) else 2 + len(mirrored_at)
    photons = trace_beam(
        gl, solid, glass("F2"), target, middle - 3 * direction, direction, radius, D_NM, count=120
    ).of_depth(events)
    scene = TriangleList(
        np.concatenate([solid.corners(), target.corners()]),
        np.array([0] * len(solid.triangles) + [RECEIVER] * 2),
        np.concatenate([solid.corner_normals, np.zeros((2, 3, 3))]) if ball else None,
    )
    seeds = [*orthonormal_frame(direction), np.zeros(3)]
    index = Index(float(glasses.index("F2", D_NM)), np.array([0.0, 0.0, 1.0]))
    flux_w = photons.flux_w
    agreeing = 0
    for i, record in enumerate(photons.records):
        path = trace(make_ray(photons.start[i], direction, seeds), scene, [index], mirrored_at)
        scale = np.abs(path.ray.dposition).max()
        if len(path.triangles) != events + 1 or np.abs(photons.position[i] - path.ray.position).max() > 2e-5 * scale:
            continue  # float32 chose the neighbouring triangle at an edge
        agreeing += 1
        got = np.array([photons.dposition_ds[i], photons.dposition_dt[i], photons.dposition_dn[i]])
        np.testing.assert_allclose(got, path.ray.dposition, atol=1e-4 * scale)
        assert record["flux_w"] == pytest.approx(flux_w * path.transmittance, rel=1e-4)
    assert len(photons.records) > 60
    assert agreeing >= 0.97 * len(photons.records)


@pytest.mark.parametrize(("scale", "offset"), [(1e-4, 0.0), (1e4, 0.0), (1.0, 1e4), (1e-2, -300.0)])
def test_the_same_scene_elsewhere_and_in_other_units(gl, scale: float, offset: float) -> None:
    """A ball's photons do not depend on the unit of length or on where the origin lies."""
    centre = np.array([offset, -0.7 * offset, 0.3 * offset])
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = centre
    plain, moved = (
        trace_beam(
            gl,
            ball_mesh(1280).transformed(m),
            glass("N-BK7"),
            screen([1.2, 0, 0], [1, 0, 0]).transformed(m),
            m[:3] @ [-3, 0, 0, 1],
            [1, 0, 0],
            0.8 * m[0, 0],
            D_NM,
            count=300,
        ).of_depth(2)
        for m in (np.eye(4), matrix)
    )
    plain, moved = (photons.where(np.argsort(photons.records["photon_id"])) for photons in (plain, moved))
    assert np.array_equal(plain.records["photon_id"], moved.records["photon_id"])
    assert len(plain.records) > 200
    assert np.abs((moved.start - centre) / scale - plain.start).max() < 1e-10
    # Corners rounded elsewhere turn facets of width 0.05 by 1e-6.
    assert np.abs((moved.position - centre) / scale - plain.position).max() < 4e-5
    assert np.abs(moved.dposition_dn / scale - plain.dposition_dn).max() < 4e-6
    assert moved.records["flux_w"] / scale**2 == pytest.approx(plain.records["flux_w"], rel=2e-6)
