"""Formulas of the references judged by themselves: columns match differences, and an integral its closed form."""

from __future__ import annotations

import numpy as np
import pytest
from reference.splat import swept_gaussian
from reference.textbook_optics import refract_column_textbook
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
