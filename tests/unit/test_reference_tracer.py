"""The reference judged by itself: two derivations agree, columns match differences, meshes converge."""

from __future__ import annotations

import numpy as np
import pytest
from reference.splat import swept_gaussian
from reference.textbook_optics import refract_column_textbook
from reference.tracer import (
    RECEIVER,
    Body,
    Index,
    Path,
    TriangleList,
    central_difference,
    follow,
    make_ray,
    trace,
)
from spectrasplat.reference import optics

RNG = np.random.default_rng


def random_events(count: int, seed: int = 1) -> dict[str, np.ndarray]:
    """Directions, facing normals and columns that keep to their spheres (d·∂d = 0, n̂·∂n̂ = 0)."""
    rng = RNG(seed)
    normal = optics.unit(rng.normal(size=(count, 3)))
    direction = optics.unit(rng.normal(size=(count, 3)))
    direction = direction - optics.times(np.maximum(2 * optics.dot(direction, normal), 0), normal)
    tangent = lambda v: optics.normalised_derivative(v, rng.normal(size=(count, 3)))  # noqa: E731
    return {"direction": direction, "normal": normal, "ddirection": tangent(direction), "dnormal": tangent(normal)}


def test_columns_are_derivatives() -> None:
    events = random_events(50)
    eta, deta, step = 0.7, 0.3, 1e-6

    def moved(x: float) -> tuple[np.ndarray, np.ndarray]:
        d = optics.unit(events["direction"] + x * events["ddirection"])
        n = optics.unit(events["normal"] + x * events["dnormal"])
        return optics.refract(d, n, np.float64(eta + x * deta)), optics.reflect(d, n)

    (hi_t, hi_r), (lo_t, lo_r) = moved(step), moved(-step)
    args = (events["direction"], events["ddirection"], events["normal"], events["dnormal"])
    np.testing.assert_allclose((hi_t - lo_t) / (2 * step), refract_column_textbook(*args, eta, deta), atol=1e-8)
    np.testing.assert_allclose((hi_r - lo_r) / (2 * step), optics.reflect_column(*args), atol=1e-8)


def prism(material: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A 60° prism, apex up, over a floor of two triangles: corners (T, 3, 3) and materials (T,)."""
    section = np.array([[-1, 0], [1, 0], [0, np.sqrt(3)]])
    near, far = (np.column_stack([section[:, 0], np.full(3, y), section[:, 1] + 1]) for y in (-1.0, 1.0))
    glass = [near[[0, 1, 2]], far[[0, 2, 1]]]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        glass += [np.array([near[i], far[j], near[j]]), np.array([near[i], far[i], far[j]])]
    a, b, c, d = np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], float)
    return np.array([*glass, [a, b, c], [a, c, d]]), np.array([material] * 8 + [RECEIVER] * 2)


def icosphere(level: int) -> np.ndarray:
    """Corners (20·4^level, 3, 3) of a subdivided icosahedron on the unit sphere."""
    g = (1 + 5**0.5) / 2
    v = [(s * a, t * b) for a, b in ((1, g),) for s in (-1, 1) for t in (-1, 1)]
    points = np.array([p for x, y in v for p in ((0, x, y), (x, y, 0), (y, 0, x))])
    faces = []
    for i in range(12):
        for j in range(i + 1, 12):
            for k in range(j + 1, 12):
                sides = [np.sum((points[p] - points[q]) ** 2) for p, q in ((i, j), (j, k), (k, i))]
                if max(sides) < 4.1:
                    faces.append(points[[i, j, k]])
    t = np.array(faces)
    turned = np.einsum("ti,ti->t", np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), t[:, 0]) < 0
    t[turned] = t[turned][:, ::-1]
    for _ in range(level):
        a, b, c = t[:, 0], t[:, 1], t[:, 2]
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        t = np.concatenate([np.stack(x, 1) for x in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return optics.unit(t)


def ball_over_floor(level: int) -> TriangleList:
    """A smooth unit ball about (0, 0, 2) over the floor z = 0."""
    ball = icosphere(level)
    floor = np.array([[[-50, -50, 0], [50, -50, 0], [0, 80, 0]]], float)
    return TriangleList(
        np.concatenate([ball + [0, 0, 2], floor]),
        np.append(np.zeros(len(ball), int), RECEIVER),
        np.concatenate([ball, np.zeros((1, 3, 3))]),
    )


def columns_against_differences(scene: TriangleList, position: list[float], direction: list[float], n: float) -> Path:
    """Trace with columns by two shifts of the start, a turn, and the index; check each by differences."""
    d = optics.unit(np.array(direction, float))
    side = optics.unit(np.cross(d, [0.3, 0.8, -0.5]))
    up = np.cross(side, d)
    dposition = np.array([side, up, np.zeros(3), np.zeros(3)])
    ddirection = np.array([np.zeros(3), np.zeros(3), side, np.zeros(3)])
    glass = Index(n, np.array([0.0, 0.0, 0.0, 1.0]))
    path = trace(make_ray(position, d, dposition, ddirection), scene, [glass])
    assert path.landed and len(path.triangles) >= 3

    def moved(column: int, x: float) -> Path:
        start = make_ray(np.array(position) + x * dposition[column], d + x * ddirection[column])
        return trace(start, scene, [Index(n + x * float(column == 3))], along=path.triangles)

    for column in range(4):
        dp, dd = central_difference(lambda x, c=column: moved(c, x), 1e-4)
        scale = np.linalg.norm(dp) + np.linalg.norm(dd)
        assert scale > 1e-3
        np.testing.assert_allclose(path.ray.dposition[column], dp, atol=1e-9 * scale)
        np.testing.assert_allclose(path.ray.ddirection[column], dd, atol=1e-9 * scale)
    return path


def test_columns_through_a_prism_match_differences() -> None:
    scene = TriangleList(*prism())
    path = columns_against_differences(scene, [-3, 0.1, 1], [1, 0.02, 0.35], 1.5168)
    assert [bool(r) for r in path.reflections] == [False, False]


def test_columns_through_total_reflection_match_differences() -> None:
    scene = TriangleList(*prism())
    path = columns_against_differences(scene, [-2.2, 0.1, 2.87], [0.87, 0.03, -0.45], 1.5168)
    assert [bool(r) for r in path.reflections] == [False, True, False]


@pytest.mark.parametrize("height", [0.0, 0.3, 0.6])
def test_columns_through_a_smooth_ball_match_differences(height: float) -> None:
    columns_against_differences(ball_over_floor(3), [0.11, height, 5], [0.02, 0.05, -1], 1.5168)


def closed_form(
    points: np.ndarray, p0: np.ndarray, v: np.ndarray, covariance: np.ndarray, band: tuple[float, float]
) -> np.ndarray:
    """The integral done by hand: along the sweep a difference of error functions, across it the Gaussian."""
    from math import erf

    lower = np.linalg.cholesky(covariance)
    u, q = np.linalg.solve(lower, (points - p0).T).T, np.linalg.solve(lower, v)
    speed = np.linalg.norm(q)
    tau = u @ q / speed
    across = np.exp(-0.5 * np.sum((u - np.outer(tau, q / speed)) ** 2, axis=1)) / (np.sqrt(2 * np.pi) * speed)
    sweep = [0.5 * (erf((t - band[0] * speed) / 2**0.5) - erf((t - band[1] * speed) / 2**0.5)) for t in tau]
    return across * sweep / np.abs(np.linalg.det(lower))


def test_swept_gaussian_equals_the_closed_form_and_keeps_the_flux() -> None:
    rng = RNG(5)
    axes = rng.normal(size=(2, 2))
    covariance = axes @ axes.T + 0.1 * np.eye(2)
    p0, v, band = np.array([0.2, -0.1]), np.array([1.5, 0.7]), (-1.0, 1.5)
    points = rng.uniform(-3, 3, (200, 2))
    swept = swept_gaussian(points, p0, v, covariance, band)
    np.testing.assert_allclose(swept, closed_form(points, p0, v, covariance, band), atol=1e-12)
    x = np.linspace(-14, 14, 281)
    grid = np.stack(np.meshgrid(x, x), -1)
    assert swept_gaussian(grid, p0, v, covariance, band, nodes=40, pieces=2).sum() * 0.01 == pytest.approx(
        2.5, rel=1e-6
    )


@pytest.mark.parametrize("throws_back", [False, True])
def test_columns_of_a_grating_behind_a_prism_are_derivatives(throws_back: bool) -> None:
    """By the emission's two coordinates, by the glass's index and by the wavelength."""
    corners, material = prism()
    sheet = np.array([[[2.0, -9.0, -9.0], [2.2, 9.0, -9.0], [2.0, 0.0, 18.0]]])
    room = np.array([[[x, -90.0, -90.0], [x, 90.0, -90.0], [x, 0.0, 180.0]] for x in (-6.0, 6.0)])
    scene = TriangleList(np.concatenate([corners, sheet, room]), np.concatenate([material, [-2, -1, -1]]))

    def path_of(place: np.ndarray) -> Path:
        ray = make_ray(
            [-3.0, 0.2 + place[0], 1.0 + place[1]], [1.0, 0.05, 0.3], [[0, 1, 0], [0, 0, 1], [0, 0, 0], [0, 0, 0]]
        )
        bodies = [
            Body(Index(1.6 + place[2], np.array([0, 0, 1, 0]))),
            Body(
                kind="grating",
                lines=np.array([0.1, 0.2, 1.0]),
                step=Index(0.6 * (0.55 + place[3]), np.array([0, 0, 0, 0.6])),
                throws_back=throws_back,
            ),
            Body(kind="receiver"),
        ]
        return follow(ray, scene, bodies)

    path = path_of(np.zeros(4))
    assert path.landed and path.reflections == (False, False, throws_back)
    for column in range(4):
        position, direction = central_difference(lambda x, c=column: path_of(x * np.eye(4)[c]), 1e-4)
        np.testing.assert_allclose(path.ray.dposition[column], position, atol=1e-6)
        np.testing.assert_allclose(path.ray.ddirection[column], direction, atol=1e-6)
