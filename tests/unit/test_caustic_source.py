"""A click on a caustic finds the glass that made it."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.ui.caustic_source import source_at

TABLE, LEFT_GLASS, RIGHT_GLASS, WALL = 0, 1, 2, 3


@pytest.fixture
def photons() -> dict[str, np.ndarray]:
    """Two spots on a table and one on a wall, each of its own glass; a little light of the left glass everywhere."""
    rng = np.random.default_rng(3)
    spots = [(-1.0, TABLE, LEFT_GLASS), (1.0, TABLE, RIGHT_GLASS), (0.0, WALL, RIGHT_GLASS)]
    places = [rng.normal(0, 0.05, (500, 3)) * [1, 1, 0] + [x, 0, -receiver] for x, receiver, _ in spots]
    stray = np.column_stack([rng.uniform(-2, 2, (300, 2)), np.zeros(300)])
    return {
        "position": np.concatenate([*places, stray]),
        "flux_w": np.concatenate([np.full(1500, 1.0), np.full(300, 0.05)]),
        "source": np.repeat([*(glass for *_, glass in spots), LEFT_GLASS], [500, 500, 500, 300]),
        "photon_receiver": np.repeat([*(receiver for _, receiver, _ in spots), TABLE], [500, 500, 500, 300]),
    }


@pytest.mark.parametrize(("x", "glass"), [(-1.0, LEFT_GLASS), (1.0, RIGHT_GLASS)])
def test_each_spot_belongs_to_its_glass(photons: dict[str, np.ndarray], x: float, glass: int) -> None:
    assert source_at(np.array([x, 0.02, 0.0]), TABLE, **photons) == glass


def test_photons_of_another_receiver_do_not_count(photons: dict[str, np.ndarray]) -> None:
    assert source_at(np.array([0.0, 0.0, -WALL]), WALL, **photons) == RIGHT_GLASS
    assert source_at(np.array([0.0, 5.0, -WALL]), WALL, **photons) is None


def test_light_straight_from_a_light_is_nobodys_caustic(photons: dict[str, np.ndarray]) -> None:
    photons["source"] = np.full_like(photons["source"], -1)
    assert source_at(np.array([1.0, 0.0, 0.0]), TABLE, **photons) is None


def test_stray_light_beside_a_caustic_is_none(photons: dict[str, np.ndarray]) -> None:
    assert source_at(np.array([0.0, -1.5, 0.0]), TABLE, **photons) is None


def test_no_photons() -> None:
    empty = np.zeros(0, int)
    assert source_at(np.zeros(3), TABLE, np.zeros((0, 3)), np.zeros(0), empty, empty) is None
