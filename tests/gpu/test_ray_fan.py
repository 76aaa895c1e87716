"""Single rays on the device against the float64 tracer, and the fan a teacher would draw."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from reference import tracer
from reference.tracer import Body, TriangleList
from spectrasplat.features.features import Features
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.geometry import primitives_round
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.lights import AreaLight, CollimatedLight, DirectionalLight, PointLight, SpotLight
from spectrasplat.model.optics import glass, spectrum
from spectrasplat.model.scene import (
    Black,
    Camera,
    Dielectric,
    Diffuse,
    Light,
    Mirror,
    Scene,
    SceneObject,
)
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.ray_fan import RayFan
from spectrasplat.passes.ray_paths import RayPaths
from spectrasplat.reference import optics
from spectrasplat.render.device_scene import spectral_axis

SCENES = Path(__file__).parents[2] / "assets" / "scenes"
LINES_NM = (440.0, 546.0, 640.0)
WHITE = spectrum.illuminant("D65").scaled_to_luminous(1000.0)


@contextmanager
def tracing(gl, scene: Scene) -> Iterator[RayPaths]:
    features = Features.of(scene, RenderSettings())
    buffers = SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features))
    paths = RayPaths(gl, buffers)
    try:
        yield paths
    finally:
        paths.release()
        buffers.release()


def reference_of(
    scene: Scene, origin: np.ndarray, direction: np.ndarray, nm: float
) -> tuple[tracer.Path, TriangleList]:
    """The same ray in float64."""
    corners, material, normals, bodies = [], [], [], []
    for item in scene.objects:
        mesh = item.mesh.transformed(item.object_to_world)
        corners.append(mesh.corners())
        smooth = mesh.corner_normals is not None and not isinstance(item.material, Diffuse)
        normals.append(mesh.corner_normals if smooth else np.zeros_like(corners[-1]))
        kind = {Mirror: -2, Dielectric: len(bodies)}.get(type(item.material), -1)
        material.append(np.full(len(corners[-1]), kind))
        if isinstance(item.material, Dielectric):
            bodies.append(Body(float(item.material.dispersion.index(nm)), priority=item.material.priority))
    world = TriangleList(np.concatenate(corners), np.concatenate(material), np.concatenate(normals))
    ends = [Body(kind="mirror"), Body(kind="receiver")]
    return tracer.follow(tracer.make_ray(origin, direction), world, [*bodies, *ends], max_depth=23), world


@pytest.mark.parametrize("name, rays", [("prism", 5), ("achromat", 2), ("default", 5)])
def test_rays_of_a_scene_follow_the_float64_path(gl, name: str, rays: int) -> None:
    scene = load_scene(SCENES / f"{name}.toml")
    with tracing(gl, scene) as paths:
        fan = RayFan(paths)
        glasses = [i for i, item in enumerate(scene.objects) if isinstance(item.material, Dielectric)]
        lines = fan.trace(None, glasses[0], rays, LINES_NM)
    assert len(lines) == 3 * rays
    assert [line.wavelength_nm for line in lines[:3]] == list(LINES_NM)
    compared = 0
    for line in lines:
        path, _ = reference_of(scene, line.points[0], line.points[1] - line.points[0], line.wavelength_nm)
        assert path.landed
        if path.margin < 0.02:
            continue  # so close to an edge or to total reflection float32 may choose otherwise
        compared += 1
        assert len(line.points) == len(path.triangles) + 1
        assert line.points[-1] == pytest.approx(path.ray.position, abs=2e-4)
    assert compared >= 2 * rays


def test_a_prism_opens_the_fan_by_wavelength(gl) -> None:
    scene = load_scene(SCENES / "prism.toml")
    with tracing(gl, scene) as paths:
        lines = RayFan(paths).trace(0, 0, 3, LINES_NM)
    assert all(len(line.points) == 4 for line in lines)  # in, out, onto the table
    by_ray = np.array([[line.points for line in lines[3 * i : 3 * i + 3]] for i in range(3)])
    assert np.ptp(by_ray[:, :, :2], axis=1) == pytest.approx(0.0, abs=1e-6)  # one ray up to the glass
    middle, ends = by_ray[1, 1], by_ray[1, :, -1]
    turned = optics.cross(middle[1] - middle[0], middle[-1] - middle[-2])[2]
    spread = optics.cross(ends[0] - middle[2], ends[2] - middle[2])[2]
    # Blue is bent more than red, to the side to which the prism bends all.
    assert np.sign(turned) == -np.sign(spread)
    assert np.linalg.norm(ends[0] - ends[2]) > 0.1


def ball(radius: float, material, centre=(0.0, 0.0, 0.0)) -> SceneObject:
    matrix = np.eye(4)
    matrix[:3, 3] = centre
    return SceneObject("ball", primitives_round.sphere(radius), material, matrix)


def quad(half: float, z: float, material, name: str = "floor") -> SceneObject:
    corners = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]])
    return SceneObject(name, make_mesh(name, corners, np.array([[0, 1, 2], [0, 2, 3]])), material)


CAMERA = Camera((0, -9, 3), (0, 0, 0))
GLASS = Dielectric(glass.from_abbe(1.6, 30.0, "flint"))


@pytest.mark.parametrize(
    "light",
    [
        PointLight("lamp", WHITE, position=(0.3, 0.2, 6.0)),
        DirectionalLight("sun", WHITE, direction=(0.2, 0.1, -0.97)),
        CollimatedLight("beam", WHITE, position=(0.1, 0.0, 6.0), direction=(0.0, 0.0, -1.0), radius=0.4),
        CollimatedLight(
            "slit",
            WHITE,
            position=(0.1, 0.0, 6.0),
            direction=(0.0, 0.0, -1.0),
            tangent=(1, 0, 0),
            shape="rectangle",
            width=0.1,
            height=3.0,
        ),
        SpotLight(
            "spot",
            WHITE,
            position=(0.0, 0.0, 6.0),
            direction=(0.0, 0.0, -1.0),
            inner_half_angle_deg=5.0,
            outer_half_angle_deg=6.0,
        ),
        AreaLight("panel", WHITE, position=(0.0, 0.0, 6.0), direction=(0.0, 0.0, -1.0), radius=0.3),
    ],
    ids=lambda light: light.name,
)
def test_every_kind_of_light_sends_its_rays_onto_the_object(gl, light: Light) -> None:
    scene = Scene("test", CAMERA, (light,), (ball(1.0, GLASS), quad(9.0, -2.0, Diffuse())))
    with tracing(gl, scene) as paths:
        lines = RayFan(paths).trace(0, 0, 7, [550.0])
    assert lines
    starts = np.array([line.points[0] for line in lines])
    first = np.array([line.points[1] for line in lines])
    # All meet the ball first, in one plane, and none twice the same way.
    assert np.linalg.norm(first, axis=1) == pytest.approx(1.0, abs=0.01)
    assert np.linalg.svd(first - first.mean(axis=0))[1][-1] < 1e-5
    assert len(np.unique(first.round(4), axis=0)) == len(lines)
    if light.kind == "collimated":
        across = starts - np.asarray(light.position)
        assert (
            np.abs(across @ [1.0, 0.0, 0.0]).max() <= 0.5 * light.width
            if light.shape == "rectangle"
            else np.linalg.norm(across, axis=1).max() <= light.radius
        )
    if light.kind == "spot":
        cosine = optics.unit(first - starts) @ np.array([0.0, 0.0, -1.0])
        assert np.degrees(np.arccos(cosine)).max() <= light.outer_half_angle_deg


def test_a_beam_that_passes_by_gives_nothing_and_the_brighter_light_is_taken(gl) -> None:
    aside = CollimatedLight("aside", WHITE.scaled(100.0), position=(5.0, 0.0, 6.0), direction=(0, 0, -1), radius=0.5)
    behind = CollimatedLight("behind", WHITE.scaled(100.0), position=(0.0, 0.0, -1.5), direction=(0, 0, -1), radius=0.5)
    dim, bright = (
        DirectionalLight(n, WHITE.scaled(s), direction=(0, 0, -1)) for n, s in (("dim", 1.0), ("bright", 3.0))
    )
    scene = Scene("test", CAMERA, (aside, behind, dim, bright), (ball(1.0, GLASS), quad(9.0, -2.0, Diffuse())))
    with tracing(gl, scene) as paths:
        fan = RayFan(paths)
        assert fan.trace(0, 0, 5, LINES_NM) == []
        assert fan.trace(1, 0, 5, LINES_NM) == []
        assert fan.brightest_light(0) == 3
        assert fan.trace(0, 0, 0, LINES_NM) == []


def test_paths_end_where_they_should(gl) -> None:
    """On black things, after a mirror, and a given way beyond the last surface."""
    scene = Scene(
        "test",
        CAMERA,
        (),
        (quad(2.0, 0.0, Mirror(), "mirror"), quad(0.5, 3.0, Black(), "stop"), ball(0.5, GLASS, (5.0, 0.0, 0.0))),
    )
    down, aslant = np.array([0.0, 0.0, -1.0]), optics.unit(np.array([0.6, 0.0, -0.8]))
    with tracing(gl, scene) as paths:
        bounced, missed = paths.trace(
            np.array([[0.2, 0.1, 2.0], [0.0, 0.0, 2.0]]), np.array([down, aslant]), np.full(2, 550.0), 4.0
        )
    assert bounced.points == pytest.approx(np.array([[0.2, 0.1, 2.0], [0.2, 0.1, 0.0], [0.2, 0.1, 3.0]]), abs=1e-5)
    assert missed.points == pytest.approx(np.array([[0, 0, 2.0], [1.5, 0, 0], [3.9, 0, 3.2]]), abs=1e-5)


def test_total_reflection_and_a_start_inside_glass(gl) -> None:
    cube = SceneObject("cube", make_mesh("cube", *_box(1.0)), GLASS)
    scene = Scene("test", CAMERA, (), (cube, quad(9.0, -4.0, Diffuse())))
    start, slanting = np.array([0.95, 0.1, 0.0]), optics.unit(np.array([0.5, 0.0, -0.87]))
    with tracing(gl, scene) as paths:
        path = paths.trace(start[None], slanting[None], np.array([550.0]), 4.0)[0]
    reference_image, _ = reference_of(scene, start, slanting, 550.0)
    assert reference_image.reflections == (True, False)
    assert path.points[-1] == pytest.approx(reference_image.ray.position, abs=1e-4)


def _box(half: float) -> tuple[np.ndarray, np.ndarray]:
    corners = half * np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])
