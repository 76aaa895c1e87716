"""T1, T8, T12 and T16 through the real shaders: index tables, a plane's diacaustic, an Amici prism, Fresnel.

Flat faces: no tessellation, so float32 is all that separates the answers. 1e-4 relative, mostly much better.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from reference.far_field import outgoing
from spectrasplat.features.features import Features
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.gpu.scene_records import SCENE_STRUCTS
from spectrasplat.model.geometry.primitives import box, slab
from spectrasplat.model.lights import PointLight
from spectrasplat.model.optics.spectrum import constant
from spectrasplat.model.scene import Camera, Diffuse, Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.reference import glasses
from spectrasplat.reference.glasses import C_NM, D_NM, F_NM
from spectrasplat.reference.optics import dot
from spectrasplat.render.device_scene import spectral_axis
from spectrasplat.stress.rigs.glsl_function import evaluate
from spectrasplat.stress.rigs.gpu_paths import (
    REFLECTED,
    REFRACTED,
    extruded,
    glass,
    placed,
    screen,
    trace_beam,
    trace_light,
)

from tests.gpu.mutants import mutate

pytestmark = pytest.mark.core

N_BK7_D = float(glasses.index("N-BK7", D_NM))


@pytest.mark.parametrize(
    ("name", "n_fdc", "abbe", "slope_per_um"),
    [
        ("N-BK7", (1.522376, 1.516800, 1.514322), 64.167, -0.041799),
        ("F2", (1.632081, 1.620040, 1.615032), 36.366, -0.086493),
        ("N-SF11", (1.806513, 1.784720, 1.775955), 25.680, -0.152878),
        ("diamond", (2.435538, 2.417486, 2.409906), 55.301, -0.131002),
        ("water", (1.337492, 1.333403, 1.331513), 55.760, -0.031340),
        ("fused silica", (1.463126, 1.458464, 1.456367), 67.821, -0.035215),
    ],
)
def test_t1_index_tables(gl, name: str, n_fdc: tuple[float, ...], abbe: float, slope_per_um: float) -> None:
    light = PointLight("light", constant(1.0), position=(0, 0, 5))
    scene = Scene(
        "glass",
        Camera((0, 0, 9), (0, 0, 0), up=(0, 1, 0)),
        (light,),
        (placed("block", box(), glass(name)), placed("floor", screen((0, 0, -2), (0, 0, 1)), Diffuse())),
    )
    # By the λ-column, so that the table of slopes is dn/dλ.
    features = Features.of(scene, RenderSettings(method="srd-lambda"))
    axis = spectral_axis(scene, features)
    nm = np.concatenate([[F_NM, D_NM, C_NM], np.linspace(381.0, 779.0, 500)])
    # What float32 makes of x is a wavelength too: n is asked for there.
    x = axis.x_of_nm(nm).astype(np.float32)
    buffers = SceneBuffers(gl.ctx, scene, features, axis)
    try:
        got = evaluate(
            gl.ctx,
            ["lib/scene.glsl"],
            "n = spectral_row(uint(INDEX_ROW), x); slope = spectral_row(uint(SLOPE_ROW), x);",
            {"x": x},
            {"n": "float", "slope": "float"},
            features.defines() | buffers.defines,
            SCENE_STRUCTS,
            binders=[buffers.bind],
        )
    finally:
        buffers.release()
    exact_nm = axis.nm_of_x(x.astype(float))
    assert np.abs(got["n"] - glasses.index(name, exact_nm)).max() < 4e-7
    np.testing.assert_allclose(got["slope"], glasses.slope(name, exact_nm), rtol=2e-4)
    n_f, n_d, n_c = got["n"][:3]
    np.testing.assert_allclose((n_f, n_d, n_c), n_fdc, atol=1e-6)
    assert (n_d - 1) / (n_f - n_c) == pytest.approx(abbe, rel=1e-4)
    assert got["slope"][1] == pytest.approx(slope_per_um, rel=1e-4)


def plane_coordinates(vectors: np.ndarray, radial: np.ndarray) -> np.ndarray:
    """(N, 2): components along each ray's own radial direction and up."""
    return np.column_stack([dot(vectors, radial), vectors[:, 2]])


def cross2(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def test_t8_diacaustic_of_a_plane(gl) -> None:
    # A point one unit under the top of a block of glass.
    block = placed("block", box((8.0, 8.0, 3.0)), glass("N-BK7"))
    light = PointLight("light", constant(1.0), position=(0.0, 0.0, 0.5))

    def traced_onto(target):
        return trace_light(gl, (block, placed("screen", target, Diffuse())), light, [(D_NM, D_NM)], 2000, 1).of_choices(
            REFRACTED
        )

    rays = outgoing(traced_onto, (0, 0, 1), 1.6, 3.6)
    photons = rays.photons
    angle = np.arccos(photons.direction[:, 2])
    radial = photons.direction * [1, 1, 0] / np.sin(angle)[:, None]
    # The column that turns the ray in its own plane of incidence: along |q| of the emission domain.
    outward = photons.q / np.linalg.norm(photons.q, axis=1)[:, None]
    dposition = plane_coordinates(outward[:, :1] * photons.dposition_ds + outward[:, 1:] * photons.dposition_dt, radial)
    ddirection = plane_coordinates(outward[:, :1] * rays.ddirection_ds + outward[:, 1:] * rays.ddirection_dt, radial)
    direction = plane_coordinates(rays.direction, radial)
    place = plane_coordinates(photons.position - [0, 0, 1.5], radial)
    x, y = (place - (cross2(dposition, direction) / cross2(ddirection, direction))[:, None] * direction).T
    ordinary = (angle > np.radians(3)) & (angle < np.radians(38))
    assert np.count_nonzero(ordinary) > 120
    lame = (N_BK7_D * np.abs(y)) ** (2 / 3) + (np.sqrt(N_BK7_D**2 - 1) * np.abs(x)) ** (2 / 3)
    np.testing.assert_allclose(lame[ordinary], 1, atol=1e-4)
    # The table's own ray, from its neighbours.
    near = np.abs(angle - np.radians(25)) < np.radians(3)
    for got, expected in ((x, 0.131883), (y, -0.400415)):
        assert np.polyval(np.polyfit(angle[near] - np.radians(25), got[near], 3), 0.0) == pytest.approx(
            expected, rel=1e-4
        )


def amici_agrees(gl: Context) -> None:
    """The table's deviations, all photons of every line; AssertionError where one is off."""
    tilts = np.tan(np.radians([31.388079, -45.0, 45.0, -31.388079]))
    ends = [np.array([[x + 0.3 * tilt, -0.3], [x - 0.3 * tilt, 0.3]]) for x, tilt in enumerate(tilts)]
    solids = [
        placed(
            f"{k} {name}",
            extruded(name, np.array([ends[k][0], ends[k + 1][0], ends[k + 1][1], ends[k][1]])),
            glass(name),
        )
        for k, name in enumerate(("N-BK7", "N-SF11", "N-BK7"))
    ]
    lines = {F_NM: -2.21096, D_NM: 0.0, C_NM: 0.82305, 400.0: -6.65042}

    def traced_onto(target):
        bands = [(nm, nm) for nm in lines]
        photons = trace_beam(gl, solids, None, target, (-1, 0, 0), (1, 0, 0), 0.05, bands, count=60, max_depth=4)
        return photons.of_choices(*[REFRACTED] * 4)

    rays = outgoing(traced_onto, (1, 0, 0), 4.5, 9.5, half=3.0)
    for band, (nm, expected_deg) in enumerate(lines.items()):
        of_line = rays.photons.band == band
        assert np.count_nonzero(of_line) > 30, "paths"
        assert np.degrees(rays.heading[of_line]) == pytest.approx(expected_deg, rel=1e-4, abs=1e-4), (
            f"deviation at {nm}"
        )
        if nm == D_NM:
            slopes = [glasses.slope(name, nm) for name in ("N-BK7", "N-SF11")]
            assert rays.dheading_dn[of_line] @ slopes == pytest.approx(0.257201, rel=1e-4), "slope"


def test_t12_amici_prism_of_three_touching_solids(gl) -> None:
    amici_agrees(gl)


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        pytest.param("lib/medium.glsl", "derivative -= n_i", "derivative += n_i", marks=pytest.mark.slow),
        ("lib/intersect.glsl", "return facing > 0.0 ? distance + NEAR_DISTANCE : distance;", "return distance;"),
    ],
    ids=["sign of the slope", "a film of air"],
)
def test_t12_mutants_are_caught(
    gl, file: str, old: str, new: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mutate(monkeypatch, tmp_path, file, old, new)
    with pytest.raises(AssertionError):
        amici_agrees(gl)


FRESNEL = [(0.0, 0.042165), (45.0, 0.052595), (60.0, 0.091958), (75.0, 0.256144)]


def test_t16_fresnel_function(gl) -> None:
    brewster = np.arctan(N_BK7_D)
    cosine = np.cos(np.append(np.radians([angle for angle, _ in FRESNEL]), brewster))
    # From air, and out of the glass at the angle on the other side.
    inside = -np.sqrt(1 - (1 - cosine**2) / N_BK7_D**2)
    theta, eta = np.append(-cosine, inside), np.repeat([1 / N_BK7_D, N_BK7_D], len(cosine))
    got = evaluate(
        gl.ctx,
        ["lib/optics.glsl"],
        "r = fresnel_reflectance(theta, eta, transmitted_cosine2(theta, eta));",
        {"theta": theta, "eta": eta},
        {"r": "float"},
    )["r"].reshape(2, -1)
    for side in got:
        assert side[:-1] == pytest.approx([r for _, r in FRESNEL], rel=1e-4)
        s = (np.cos(brewster) ** 2 - np.sin(brewster) ** 2) ** 2
        assert side[-1] == pytest.approx(s / 2, rel=1e-4)  # no p-light: half of the other


@pytest.mark.parametrize(("angle_deg", "reflectance"), FRESNEL)
def test_t16_fresnel_of_a_slab(gl, angle_deg: float, reflectance: float) -> None:
    angle = np.radians(angle_deg)
    direction = np.array([np.sin(angle), 0, -np.cos(angle)])
    block = slab(12.0, 12.0, 1.0)
    below, above = screen((0, 0, -4), (0, 0, 1)), screen((0, 0, 9), (0, 0, 1))
    start = np.array([0, 0, 0.5]) - 3 * direction
    shares = {}
    for target in (below, above):
        photons = trace_beam(gl, block, glass("N-BK7"), target, start, direction, 0.2, D_NM, count=60, max_depth=5)
        for path in (
            (REFLECTED,),
            (REFRACTED, REFRACTED),
            (REFRACTED, REFLECTED, REFRACTED),
            (REFRACTED, REFLECTED, REFLECTED, REFRACTED),
        ):
            taken = photons.of_choices(*path)
            if len(taken.records):
                assert len(taken.records) == photons.lattice_in_disc
                shares[path] = taken.records["flux_w"] / taken.weight
    assert shares[(REFLECTED,)] == pytest.approx(reflectance, rel=1e-4)
    assert shares[(REFRACTED, REFRACTED)] == pytest.approx((1 - reflectance) ** 2, rel=1e-4)
    assert shares[(REFRACTED, REFLECTED, REFRACTED)] == pytest.approx((1 - reflectance) ** 2 * reflectance, rel=1e-4)
    assert shares[(REFRACTED, REFLECTED, REFLECTED, REFRACTED)] == pytest.approx(
        (1 - reflectance) ** 2 * reflectance**2, rel=1e-4
    )
