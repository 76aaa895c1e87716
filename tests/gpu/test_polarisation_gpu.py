"""Polarised light of whole renderings against closed forms: by photons, by beams, from the camera.

A slab keeps its plane of incidence, so each polarisation has its own share R of every surface: (1 - R) / (1 + R)
passes, 2 R / (1 + R) is thrown back. At 70° on n = 2 means of both polarisations err by a twelfth.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.primitives_round import sphere
from spectrasplat.model.lights import CollimatedLight
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.optics.glass import from_abbe
from spectrasplat.model.optics.spectrum import constant as white
from spectrasplat.model.scene import Black, Camera, Dielectric, Diffuse, Material, RenderDefaults, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.model.texture import Environment
from spectrasplat.reference import glasses
from spectrasplat.reference.glasses import D_NM
from spectrasplat.render.still import RenderStats, render
from spectrasplat.stress.rigs.gpu_paths import REFLECTED, REFRACTED, extruded, glass, placed, trace_beam

INDEX, ANGLE = 2.0, np.radians(70.0)


def transmittance(incidence: float, eta: float) -> np.ndarray:
    """Of s and p by the sine and tangent laws."""
    refraction = np.arcsin(eta * np.sin(incidence))
    both, apart = incidence + refraction, incidence - refraction
    return 1.0 - np.array([np.sin(apart) / np.sin(both), np.tan(apart) / np.tan(both)]) ** 2


def passed(polarisation: bool) -> float:
    """Share of unpolarised light that the slab lets through."""
    each = transmittance(ANGLE, 1.0 / INDEX)
    each = each if polarisation else each.mean()
    return float(np.mean(each / (2.0 - each)))


def slab_scene(polarisation: bool, below: Material, lights: bool = True) -> Scene:
    """A slab over a floor, a pencil of light on it, and a camera that looks along that."""
    direction = np.array([np.sin(ANGLE), 0.0, -np.cos(ANGLE)])
    place = tuple(-9.0 * direction)
    light = CollimatedLight("pencil", white(1.0), place, tuple(direction), radius=0.05)
    lowered = np.eye(4)
    lowered[2, 3] = -6.0
    objects = (
        SceneObject("slab", primitives.box((40.0, 40.0, 1.0)), Dielectric(from_abbe(INDEX, np.inf))),
        SceneObject("floor", primitives.plane(400.0, 400.0), below, lowered),
    )
    camera = Camera(place, (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), kind="orthographic", vertical_extent=0.5)
    render_defaults = RenderDefaults(polarisation=polarisation)
    return Scene("slab", camera, (light,) if lights else (), objects, (1.0, 1.0, 1.0), render=render_defaults)


def deposited(stats: RenderStats) -> float:
    """Share of what was emitted, by photons and beams."""
    return float(next(line.split()[1] for line in stats.lines() if line.split()[:1] == ["deposited"]))


METHODS = {
    # Roulette of weak photons scatters by 1e-3.
    "srd-photons": 4e-3,
    "srd": 1e-5,
    "stochastic-even": 4e-3,
    "hero": 4e-3,
}


@pytest.mark.parametrize(
    "method", [pytest.param(m, marks=pytest.mark.slow) if m in ("stochastic-even", "hero") else m for m in METHODS]
)
def test_what_a_slab_lets_through(gl, method: str) -> None:
    for polarisation in (True, False):
        settings = RenderSettings(32, 32, photons=4000, spp=1, method=method, layer="caustic", tally=True)
        stats = render(slab_scene(polarisation, Diffuse()), settings, context=gl).stats
        assert deposited(stats) == pytest.approx(passed(polarisation), rel=METHODS[method])
    assert passed(True) / passed(False) > 1.08


def test_what_a_camera_sees_in_a_slab(gl) -> None:
    """Over a black floor: the sky that the slab reflects."""
    for polarisation in (True, False):
        scene = slab_scene(polarisation, Black(), lights=False)
        result = render(scene, RenderSettings(8, 8, photons=1000, spp=64), context=gl)
        assert result.rgb.mean() == pytest.approx(1.0 - passed(polarisation), rel=1e-3)


ROOM = primitives.box((40.0, 40.0, 40.0))
PRISM = np.array([[-0.5, 0.0], [0.5, 0.0], [0.0, np.sqrt(0.75)]])
FLINT = find("N-SF66")
FLINT_N = float(FLINT.index(np.array(D_NM)))
INCIDENCE = np.arcsin(0.5 * FLINT_N)
"""At minimum deviation of 60°."""


def frame_of(direction: np.ndarray, normal: np.ndarray) -> np.ndarray:
    return np.column_stack([direction, np.cross(normal, direction), normal])


def prisms(turns: tuple[float, ...], world: np.ndarray) -> tuple[list[SceneObject], np.ndarray, np.ndarray]:
    """Prisms of N-SF66 one behind the other at minimum deviation, the plane of each turned about the ray by an angle;
    all of it turned by `world`. Also where the light enters, and its direction."""
    solid = extruded("prism", PRISM, half=0.6)
    entry = np.array([-0.25, np.sqrt(0.75) / 2.0, 0.0])
    angle = INCIDENCE - np.radians(30.0)
    d_in, d_out = (np.array([np.cos(angle), sign * np.sin(angle), 0.0]) for sign in (1.0, -1.0))
    exit_place = entry * [-1.0, 1.0, 1.0]
    place, direction, normal = world @ entry, world @ d_in, world @ np.array([0.0, 0.0, 1.0])
    start, first = place, direction
    objects = []
    for k, turn in enumerate(turns):
        normal = np.cos(turn) * normal + np.sin(turn) * np.cross(normal, direction)
        rotation = frame_of(direction, normal) @ frame_of(d_in, np.array([0.0, 0.0, 1.0])).T
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotation, place - rotation @ entry
        objects.append(placed(f"prism {k}", solid.transformed(matrix), Dielectric(FLINT)))
        direction = rotation @ d_out
        place = rotation @ (exit_place - entry) + place + 3.0 * direction
    return objects, start - 3.0 * first, first


def turned(axis: tuple[float, float, float], angle: float) -> np.ndarray:
    """Rodrigues."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def through_prisms(gl, turns: tuple[float, ...], world: np.ndarray, polarisation: bool = True) -> float:
    objects, start, direction = prisms(turns, world)
    events = 2 * len(turns)
    photons = trace_beam(
        gl, objects, None, ROOM, start, direction, 0.01, D_NM, 20, events, polarisation=polarisation
    ).of_choices(*[REFRACTED] * events)
    assert len(photons.records) > 10
    return float((photons.records["flux_w"] / photons.weight).mean())


@pytest.mark.parametrize("angle", [0.0, 1.9], ids=["as it stands", "turned about"])
def test_a_prism_at_minimum_deviation(gl, angle: float) -> None:
    """60° of N-SF66: T_s² and T_p², and not the mean's square, which is 9.2 % less; whichever way it stands."""
    t_s, t_p = transmittance(INCIDENCE, 1.0 / FLINT_N)
    world = turned((0.3, -0.5, 0.8), angle)
    assert through_prisms(gl, (0.0,), world) == pytest.approx(0.5 * (t_s**2 + t_p**2), rel=1e-4)
    if angle == 0.0:
        means = through_prisms(gl, (0.0,), world, polarisation=False)
        assert means == pytest.approx((0.5 * (t_s + t_p)) ** 2, rel=1e-4)
        assert means / (0.5 * (t_s**2 + t_p**2)) - 1.0 == pytest.approx(-0.092, abs=5e-4)


@pytest.mark.parametrize("turn", [0.0, 0.7, 0.5 * np.pi])
def test_prisms_across_each_other(gl, turn: float) -> None:
    """What the first lets through is partly polarised: behind it the second takes s and p by Malus's law; across each
    other T_s² T_p²."""
    s, p = transmittance(INCIDENCE, 1.0 / FLINT_N) ** 2
    along, across = np.cos(turn) ** 2, np.sin(turn) ** 2
    wanted = 0.5 * (s * (along * s + across * p) + p * (across * s + along * p))
    assert through_prisms(gl, (0.0, turn), turned((1.0, 2.0, 0.5), 0.8)) == pytest.approx(wanted, rel=2e-4)


def test_the_rainbow(gl) -> None:
    """A drop of water at least deviation: T_s² R_s and T_p² R_p, 10 % less than by means. The ball is a mesh."""
    n = float(glasses.index("water", D_NM))
    incidence = np.arccos(np.sqrt((n * n - 1.0) / 3.0))
    t = transmittance(incidence, 1.0 / n)
    shares = []
    for polarisation in (True, False):
        start, path = (3.0, 0.0, np.sin(incidence)), (REFRACTED, REFLECTED, REFRACTED)
        ball, water = sphere(1.0, 20480), glass("water")
        photons = trace_beam(
            gl, ball, water, ROOM, start, (-1, 0, 0), 0.02, D_NM, 40, 3, polarisation=polarisation
        ).of_choices(*path)
        shares.append(float((photons.records["flux_w"] / photons.weight).mean()))
    assert shares[0] == pytest.approx(0.5 * float((t**2 * (1.0 - t)).sum()), rel=1e-2)
    assert shares[1] / shares[0] - 1.0 == pytest.approx(0.116, abs=5e-3)


ABOVE = Camera((0.0, 0.0, 20.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), kind="orthographic", vertical_extent=0.4)


# Beams of few photons leave up to a per cent of wide bands unaccounted (docs/beams.md).


def test_light_of_the_environment_through_a_slab(gl) -> None:
    """A bright ring of sky, 12° across and 70° from the zenith, lights a floor below a slab that hides all the sky: no
    ring becomes a light."""
    rows, columns = np.mgrid[0:180, 0:360] + 0.5
    zenith, azimuth = np.radians(rows), np.radians(columns - 180.0)
    cosine = np.cos(ANGLE) * np.cos(zenith) + np.sin(ANGLE) * np.sin(zenith) * np.cos(azimuth)
    ring = (cosine > np.cos(np.radians(6.0))) & (cosine < np.cos(np.radians(4.0)))
    sky = np.where(ring[..., None], np.ones(3), 0.0).astype(np.float32)
    raised = np.eye(4)
    raised[2, 3] = 3.0
    objects = (
        SceneObject("slab", primitives.box((60.0, 60.0, 0.5)), Dielectric(from_abbe(INDEX, np.inf)), raised),
        SceneObject("floor", primitives.plane(4.0, 4.0), Diffuse()),
    )
    camera = Camera((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), vertical_fov_deg=50.0)
    seen = []
    for polarisation in (True, False):
        scene = Scene("sky", camera, (), objects, environment=Environment(sky, lights=True))
        scene = replace(scene, render=RenderDefaults(polarisation=polarisation))
        seen.append(float(render(scene, RenderSettings(16, 16, photons=1000, spp=4), context=gl).rgb.mean()))
    assert seen[1] > 0.0
    # Each asks by chance, but the same directions: between them a per cent.
    assert seen[0] / seen[1] == pytest.approx(passed(True) / passed(False), rel=0.02)
