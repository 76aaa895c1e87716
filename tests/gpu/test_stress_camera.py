"""The camera's stress cases keep their promises, and break them where a shader is wrong; the sums they are held against
are right."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.gpu.gpu_space import GpuSpace
from spectrasplat.model.optics.glass import from_abbe
from spectrasplat.model.scene import Scene
from spectrasplat.stress.case import Case
from spectrasplat.stress.cases import (
    camera_cases,
    camera_glass_cases,
    camera_light_cases,
    camera_solid_cases,
    contact_cases,
)
from spectrasplat.stress.rigs import flat_glass
from spectrasplat.stress.rigs.camera_probe import daylight_mean, fresnel, sky

from tests.gpu.mutants import mutate

CASES = {case.name: case for case in camera_cases.CASES}
QUICK = (
    "eye-tir-margin",
    "eye-corner",
    "eye-guide",
    "eye-room",
    "eye-mirrors",
    "eye-shells",
    "eye-inside",
    "eye-poles",
    "eye-slanting",
    "eye-absorption",
)
"""Those that take a second or two; of the others one severity is looked at below, and all of it in the slow run."""


@pytest.mark.slow
@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in CASES])
def test_case_keeps_its_promises(gl, name: str) -> None:
    case = CASES[name]
    measured = list(case.measure(gl))
    assert len(measured) == case.steps
    assert [sentence for m in measured for sentence in m.broken()] == []
    assert len({m.severity for m in measured}) == case.steps


@pytest.mark.slow
def test_one_glass_agrees_with_the_reference(gl, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera_glass_cases, "glasses", lambda chosen=camera_glass_cases.glasses(): chosen[:1])
    (found,) = camera_glass_cases.measure_glasses(gl)
    assert found.broken() == []


@pytest.mark.slow
def test_a_stone_ten_thousand_extents_off_looks_the_same(gl, monkeypatch: pytest.MonkeyPatch) -> None:
    """And where GPU space is not fitted to the glass, the case says so."""
    monkeypatch.setattr(camera_solid_cases, "CHANGES", camera_solid_cases.CHANGES[-1:])
    (found,) = camera_solid_cases.measure_scale(gl)
    assert found.broken() == []
    monkeypatch.setattr(GpuSpace, "of", staticmethod(lambda scene: GpuSpace(np.zeros(3), 1.0)))
    (found,) = camera_solid_cases.measure_scale(gl)
    assert "error of picture" in "; ".join(found.broken())


@pytest.mark.slow
def test_a_sun_in_a_panorama_is_linear(gl, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera_light_cases, "SUNS", (1e2, 1e8))
    assert [m.broken() for m in camera_light_cases.measure_sun(gl)] == [[], []]


def broken(case: Case, gl) -> str:
    """The first promises to break, or nothing."""
    return next(("; ".join(m.broken()) for m in case.measure(gl) if m.broken()), "")


MUTANTS = {
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
        "        pending_path = mirrored;\n",
        "        pushes_path = false;\n",
        "energy",
    ),
    "leaving taken for entering": (
        "eye-inside",
        "camera/meet.glsl",
        "bool entering = dot(whole.direction, hit.normal_g) < 0.0,",
        "bool entering = true,",
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
        "? light_seen(lights[i], position, direction, far, width + sweep * part) :",
        "? lights[i].measure * sign(light_seen(lights[i], position, direction, far, width + sweep / float(taps))) :",
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
SLOW_MUTANTS = (
    "bands that are not cut",
    "lamps as bright as they are where they only graze a sample",
    "light that is not linear",
)


@pytest.mark.slow
@pytest.mark.parametrize(
    "mistake", [pytest.param(m, marks=pytest.mark.slow) if m in SLOW_MUTANTS else m for m in MUTANTS]
)
def test_case_notices_a_mistake_in_a_shader(gl, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, mistake: str) -> None:
    name, file, old, new, said = MUTANTS[mistake]
    mutate(monkeypatch, tmp_path, file, old, new)
    assert said in broken(CASES[name], gl)


@pytest.mark.slow
def test_glass_of_other_dispersion_is_noticed(gl, monkeypatch: pytest.MonkeyPatch) -> None:
    """V_d 20 seen, V_d 8 in the reference."""
    true_reference = camera_glass_cases.render_camera_reference
    wrong = from_abbe(1.6, 8.0)

    def reference(scene: Scene, *arguments, **options):
        objects = tuple(replace(item, material=replace(item.material, dispersion=wrong)) for item in scene.objects)
        return true_reference(replace(scene, objects=objects), *arguments, **options)

    monkeypatch.setattr(camera_glass_cases, "render_camera_reference", reference)
    monkeypatch.setattr(camera_glass_cases, "glasses", lambda chosen=camera_glass_cases.glasses(): chosen[:1])
    (found,) = camera_glass_cases.measure_glasses(gl)
    assert "error of colour" in "; ".join(found.broken())


def test_ways_through_flat_glass_add_up() -> None:
    """All light goes somewhere; a slab's ways sum up to the pile of plates; straight through a slab keeps the
    direction."""
    slab = flat_glass.rectangle(40.0, 0.1)
    out = flat_glass.ways(slab, 1.5, (0.0, 1.0), (0.0, -1.0))
    assert sum(way.weight for way in out) == pytest.approx(1.0, abs=1e-4)
    through = sum(way.weight for way in out if way.direction[1] < 0.0)
    assert through == pytest.approx(contact_cases.plates([1.5]), abs=1e-4)
    slanting = flat_glass.ways(slab, 1.5, (0.0, 1.0), (0.6, -0.8))
    assert np.allclose(max(slanting, key=lambda way: way.weight).direction, (0.6, -0.8, 0.0), atol=1e-12)


def test_ways_split_where_total_reflection_sets_in() -> None:
    critical = np.arcsin(1.0 / 1.5)
    for side in (-1.0, 1.0):
        out = flat_glass.ways(flat_glass.trapezium(critical + side * 1e-3), 1.5, (-1.0, 0.0), (1.0, 0.0))
        direct = [way for way in out if way.events == 2 and way.direction[0] > 0.0]
        assert len(direct) == (1 if side < 0.0 else 0)


def test_a_ray_past_a_polygon_meets_nothing() -> None:
    square = flat_glass.rectangle(1.0, 1.0)
    for start, direction in (
        ((-2.0, 0.7), (1.0, 0.0)),
        ((2.0, 0.0), (1.0, 0.0)),
        ((-2.0, -1.0), (np.sqrt(0.5), -np.sqrt(0.5))),
    ):
        (only,) = flat_glass.ways(square, 1.5, start, direction)
        assert only.weight == 1.0 and only.events == 0


def test_fresnel_and_daylight_are_those_of_the_books() -> None:
    """N-BK7 at 0, 45 and 75 degrees; a white that all arrives is white."""
    assert fresnel(np.cos(np.radians([0.0, 45.0, 75.0])), 1.5168) == pytest.approx(
        [0.042165, 0.052595, 0.256144], abs=1e-6
    )
    assert fresnel(0.5, 1.0 / 1.5168) == 1.0
    assert daylight_mean(np.ones(401)) == pytest.approx(np.ones(3), abs=1e-4)


def test_a_sky_is_where_it_is_said_to_be() -> None:
    """Straight up is the first row; the picture's middle column lies towards x."""
    rgb = sky(lambda d: d[..., 2] + 2.0, height=64).rgb
    assert rgb[0, 0, 0] == pytest.approx(3.0, abs=1e-3) and rgb[-1, 0, 0] == pytest.approx(1.0, abs=1e-3)
    ahead = sky(lambda d: d[..., 0] + 2.0, height=64).rgb
    assert np.unravel_index(ahead[..., 0].argmax(), ahead.shape[:2])[1] in (63, 64)
