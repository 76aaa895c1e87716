"""Every stress case of single events, paths, splats and the camera keeps its promises, and breaks them where a shader
is wrong; the sums they are held against are right.

A mutant is one mistake in a copy of the shaders (or of the scene's packing); the case that is there for it must notice.
What each can see is its bound, printed by `spectrasplat stress`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.gpu import scene_geometry
from spectrasplat.gpu.records import FLAG_FOOTPRINT_DROPPED
from spectrasplat.model.geometry.primitives_round import ellipsoid
from spectrasplat.model.scene import Diffuse
from spectrasplat.reference import optics
from spectrasplat.stress import case as judging
from spectrasplat.stress.case import Case
from spectrasplat.stress.cases import (
    camera_lights,
    camera_solids,
    camera_surfaces,
    caustics,
    chains,
    contacts,
    materials,
    meshes,
    splats,
)
from spectrasplat.stress.cases import optics as optics_cases
from spectrasplat.stress.rigs import flat_glass
from spectrasplat.stress.rigs.gpu_paths import beam_light, glass, placed, screen, trace_light
from spectrasplat.stress.runner import cases_of

from tests.gpu.mutants import mutate

LIGHT = {c.name: c for file in (optics_cases, materials, caustics, chains, meshes, splats) for c in cases_of(file)}
CAMERA = {c.name: c for file in (camera_surfaces, camera_solids, camera_lights) for c in cases_of(file)}
RENDERED = ("grating-orders", "mesh-files")
"""Whole scenes, which `test_stress_scenes.py` takes."""
QUICK = ("tir-margin", "grazing", "index-matched", "polarised-chain", "gem-bands")
QUICK += ("long-chain", "collapse", "one-texel", "overflow")


def broken(case: Case, gl) -> str:
    """The first promises to break, or nothing."""
    return next(("; ".join(m.broken()) for m in case.measure(gl) if m.broken()), "")


@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in {**LIGHT, **CAMERA}]
)
def test_case_keeps_its_promises(gl, name: str) -> None:
    case = {**LIGHT, **CAMERA}[name]
    measured = list(case.measure(gl))
    assert len(measured) == case.steps
    assert [sentence for m in measured for sentence in m.broken()] == []
    assert len({m.severity for m in measured}) == case.steps
    assert all(m.errors.keys() == m.bounds.keys() for m in measured) or name in CAMERA or name in RENDERED


MUTANTS = {
    "wrong sign of the turning normal": (
        "tir-margin",
        "lib/optics.glsl",
        "- mu * dnormal",
        "+ mu * dnormal",
        "column s",
    ),
    "a reference axis turned the wrong way": (
        "polarised-chain",
        "lib/polarisation.glsl",
        "cosine * state.u - sine * q",
        "cosine * state.u + sine * q",
        "state",
    ),
    "the textbook's mu": (
        "index-matched",
        "lib/optics.glsl",
        "return (1.0 - eta_it) * (1.0 + eta_it) / (omega - eta_it * theta);",
        "return eta_it * theta + omega;",
        "bend mu",
    ),
    "the shading normal on a receiver": (
        "grazing",
        "lib/optics.glsl",
        "dot(direction, normal_g)) * direction",
        "dot(direction, normal_g)) * normal_g",
        "column on a receiver",
    ),
    "wrong sign of dispersion when leaving": (
        "gem-bands",
        "lib/medium.glsl",
        "return index_slope(boundary.before",
        "return -index_slope(boundary.before",
        "band ends",
    ),
    "light lost between microfacets": (
        "rough-mirror",
        "lib/rough_energy.glsl",
        "return reflected / (1.0 - thrown * reflected);",
        "return reflected;",
        "energy",
    ),
    "overflow not seen": ("overflow", "light/footprint.comp", "    if (held < 1.0) {", "    if (held < -1.0) {", ""),
    "lost footprints not counted": (
        "overflow",
        "light/footprint.comp",
        "sums[own].yz += vec2(power_w, 1.0);",
        "",
        "photons were degraded but only 0 fall-backs counted",
    ),
    "dropped columns not counted": (
        "far-screen",
        "light/trace.comp",
        "outcome.what |= FELL_FOOTPRINT;",
        "",
        "flags not counted",
    ),
    "brightness capped": (
        "collapse",
        "light/splat_small.frag",
        "share * splat_colour[g]",
        "min(share, 0.9) * splat_colour[g]",
        "energy",
    ),
    "rounding of the total lost": (
        "one-texel",
        "light/accumulate.comp",
        "imageStore(scratch, at, kept_out);",
        "imageStore(scratch, at, vec4(0.0));",
        "energy in the texel",
    ),
    "facets that do not overlap": (
        "slivers",
        "lib/intersect.glsl",
        "#define EDGE_ERROR 5e-7",
        "#define EDGE_ERROR -1e-4",
        "light leaked",
    ),
    "total reflection before its time": (
        "eye-tir-margin",
        "camera/meet.glsl",
        "bool total = !event.refracted.exists",
        "bool total = event.cosine2.y <= 0.01",
        "inside the edge",
    ),
    "a reflection that turns a little": (
        "eye-corner",
        "path/event.glsl",
        "path.direction = turned.direction;",
        "path.direction = normalize(turned.direction + vec3(5e-3, 0.0, 0.0));",
        "returned",
    ),
    "paths given up too early": (
        "eye-guide",
        "camera/camera.comp",
        "path.depth >= uint(MAX_DEPTH)",
        "path.depth >= 9u",
        "transmittance",
    ),
    "paths given up and not counted": (
        "eye-room",
        "camera/camera.comp",
        "atomicAdd(fallbacks[FELL_DEPTH], 1u);",
        "",
        "paths not counted",
    ),
    "branches that could not wait and are not counted": (
        "eye-shells",
        "camera/meet.glsl",
        "if (strong && !splits) atomicAdd(fallbacks[FELL_STACK], 1u);",
        "",
        "full stack not counted",
    ),
    "branches put away and forgotten": (
        "eye-shells",
        "camera/meet.glsl",
        "if (mirrored.walk.inverse_pdf > 0.0) push(mirrored);",
        "",
        "energy",
    ),
    "leaving taken for entering": (
        "eye-inside",
        "path/event.glsl",
        "cross_boundary(path.medium, hit.object, dot(path.direction, hit.normal_g) < 0.0)",
        "cross_boundary(path.medium, hit.object, true)",
        "wards",
    ),
    "a sky upside down": (
        "eye-poles",
        "camera/taps.glsl",
        "p.sky_z * direction.z",
        "p.sky_z * -direction.z",
        "radiance",
    ),
    "a texture looked up at a point": (
        "eye-slanting",
        "camera/receiver.glsl",
        "along)), ds, dt)",
        "along)), vec2(0.0), vec2(0.0))",
        "pixel",
    ),
    "a per cent of the way through glass lost": (
        "eye-absorption",
        "camera/meet.glsl",
        "path.walk.lengths[i] += length;",
        "path.walk.lengths[i] += 0.99 * length;",
        "radiance",
    ),
    "bands that are not cut": (
        "eye-cut",
        "camera/meet.glsl",
        "float onset = path.restricted != 0u",
        "float onset = false && path.restricted != 0u",
        "colour",
    ),
    "lamps as bright as they are where they only graze a sample": (
        "eye-lamps",
        "camera/taps.glsl",
        "? light_seen(light, position, direction, far, WIDTH_OF(light) + sweep * part) :",
        "? light.measure * sign(light_seen(light, position, direction, far, WIDTH_OF(light) + sweep * part)) :",
        "light in all",
    ),
    "light that is not linear": (
        "eye-sun",
        "camera/taps.glsl",
        "add_colour(path, interval, uint(WHITE_ROW), sky_colour(direction, columns));",
        "add_colour(path, interval, uint(WHITE_ROW), min(sky_colour(direction, columns), vec3(1e4)));",
        "not linear",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("mistake", MUTANTS)
def test_case_notices_a_mistake_in_a_shader(gl, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, mistake: str) -> None:
    name, file, old, new, said = MUTANTS[mistake]
    mutate(monkeypatch, tmp_path, file, old, new)
    sentences = broken({**LIGHT, **CAMERA}[name], gl)
    assert sentences and said in sentences


def test_needles_notice_triangles_begun_at_any_corner(gl, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        scene_geometry,
        "_best_corner_first",
        lambda corners: np.broadcast_to(np.arange(3)[None, :, None], (len(corners), 3, 1)),
    )
    assert "error of landing" in broken(meshes.needles, gl)


def test_a_wrong_reference_does_not_agree(gl, monkeypatch: pytest.MonkeyPatch) -> None:
    right = optics.refract_column_stable
    monkeypatch.setattr(optics, "refract_column_stable", lambda *arguments: right(*arguments) * (1.0 + 1e-5))
    assert "error of column n" in broken(optics_cases.grazing, gl)


def test_a_branch_that_carries_nothing_is_not_followed(gl) -> None:
    """Without a threshold for roulette its chance was 0 / 0, and its footprint grew by the root of 1e30."""
    gem = placed("gem", ellipsoid((1.0, 0.8, 0.6), 1280), glass("diamond"))
    below = placed("screen", screen([0, 0, -1.5], [0, 0, 1], 20.0), Diffuse())
    light = beam_light((0.25, 0.1, 3.0), (0.05, 0.03, -1.0), 0.5)
    photons = trace_light(gl, (gem, below), light, [(450.0, 650.0)], 100, 26)
    assert (photons.records["flux_w"] > 0.0).all()
    kept = (photons.records["flags"] & FLAG_FOOTPRINT_DROPPED) == 0
    assert np.linalg.norm(photons.records["dposition_ds"][kept], axis=-1).max() < 1e6


def test_triangles_begin_at_the_corner_nearest_to_a_right_angle() -> None:
    rng = np.random.default_rng(3)
    # A needle each way round, and a right-angled triangle.
    needle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1e-4, 0.0]])
    triangles = (
        np.array([np.roll(needle, k, axis=0) for k in range(3)] + [[[0, 1, 0], [0, 0, 0], [1, 0, 0]]])
        @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    )
    order = scene_geometry._best_corner_first(triangles)
    turned = np.take_along_axis(triangles, order, axis=1)
    edges = turned[:, 1:] - turned[:, :1]
    cosine = np.abs(np.sum(edges[:, 0] * edges[:, 1], axis=1)) / np.prod(np.linalg.norm(edges, axis=2), axis=1)
    assert cosine.max() < 2e-4
    # Only turned, never mirrored.
    assert np.allclose(
        np.cross(edges[:, 0], edges[:, 1]),
        np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]),
        atol=1e-12,
    )
    assert scene_geometry._best_corner_first(np.zeros((1, 3, 3))).shape == (1, 3, 1)


def test_what_is_not_finite_is_the_worst() -> None:
    assert judging.worst(np.array([1.0, np.nan, 2.0]), np.array([1.0, 7.0, 1.0])) == (np.inf, 7.0)
    assert judging.worst(np.array([1.0, 3.0]), np.array([0.1, 1.0])) == (1.0, 0.1)
    assert judging.not_finite([np.array([1.0, np.inf]), np.array([np.nan])]) == 2
    records = np.zeros(2, [("a", "f4", 3), ("b", "u4")])
    records["a"][1, 2] = np.nan
    assert judging.not_finite_in(records) == 1


def test_ways_through_flat_glass_add_up() -> None:
    """All light goes somewhere; a slab's ways sum up to the pile of plates; straight through a slab keeps the
    direction."""
    slab = flat_glass.rectangle(40.0, 0.1)
    out = flat_glass.ways(slab, 1.5, (0.0, 1.0), (0.0, -1.0))
    assert sum(way.weight for way in out) == pytest.approx(1.0, abs=1e-4)
    through = sum(way.weight for way in out if way.direction[1] < 0.0)
    assert through == pytest.approx(contacts.plates(1.5), abs=1e-4)
    slanting = flat_glass.ways(slab, 1.5, (0.0, 1.0), (0.6, -0.8))
    assert np.allclose(max(slanting, key=lambda way: way.weight).direction, (0.6, -0.8, 0.0), atol=1e-12)
