"""Pairs of boxes that meet: the sweep finds those that asking all pairs finds, in a part of the time and memory."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.features import facts
from spectrasplat.model import contacts
from spectrasplat.model.contacts import _meet, _meeting
from spectrasplat.model.geometry.primitives import box
from spectrasplat.stress.rigs.scene_parts import FLINT, SUN, solid, stage


def all_pairs(bounds: np.ndarray, slack: float) -> set[tuple[int, int]]:
    return {(j, i) for i in range(len(bounds)) for j in range(i) if _meet(bounds[i], bounds[j], slack).all()}


@pytest.mark.parametrize("stretch", [(1.0, 1.0, 1.0), (0.01, 5.0, 1.0), (1.0, 0.0, 30.0)])
@pytest.mark.parametrize("at_once", [1, 7, 1 << 20])
def test_the_sweep_finds_what_all_pairs_do(
    stretch: tuple[float, float, float], at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(contacts, "_PAIRS_AT_ONCE", at_once)
    rng = np.random.default_rng(5)
    low = rng.uniform(0.0, 4.0, (60, 3)) * stretch
    bounds = np.stack([low, low + rng.uniform(0.0, 1.0, (60, 3))], axis=1)
    bounds[7] = bounds[8]
    found = [tuple(pair) for pairs in _meeting(bounds, 0.05) for pair in pairs.tolist()]
    assert len(found) == len(set(found)) and set(found) == all_pairs(bounds, 0.05)
    assert len(found) > 5


def test_a_city_takes_no_more_than_seconds_and_memory_in_proportion() -> None:
    """Ten thousand boxes took 15 s, and 65,534 more memory than there is: all pairs were asked at once."""
    import tracemalloc

    at = np.stack(np.meshgrid(np.arange(100.0), np.arange(100.0), [0.0]), axis=-1).reshape(-1, 3)
    bounds = np.stack([at, at + 0.5], axis=1)
    tracemalloc.start()
    assert sum(len(pairs) for pairs in _meeting(bounds, 1e-3)) == 0
    touching = sum(len(pairs) for pairs in _meeting(bounds, 0.6))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert touching == 2 * 99 * 100 + 2 * 99 * 99 and peak < 400e6


def test_many_solids_are_left_to_the_tree() -> None:
    few = stage(*(solid(f"{i}", box(), FLINT, (2.0 * i, 0.0, 1.0)) for i in range(3)), lights=[SUN])
    assert list(facts.half_spaces(few)) == [0, 1, 2]
    many = facts.MOST_PLANES // 6 + 1
    assert not facts.half_spaces(stage(*(solid(f"{i}", box(), FLINT, (2.0 * i, 0.0, 1.0)) for i in range(many))))
