"""Paths that branch so often that the queues cannot hold them: fewer are traced at once, and no light is lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.materials.grating import Grating
from spectrasplat.model.scene import Scene
from spectrasplat.passes import pilot, ray_pool
from spectrasplat.passes.lattice_slice import Band, LatticeSlice
from spectrasplat.stress.rigs.probe import SMALL, light_pass

ORDERS = 161
FEW = 3
"""Surfaces that paths meet: the first grating fills the queue."""


@pytest.fixture(scope="module")
def crowded() -> Scene:
    """A spectrometer whose grating sends out so many orders that a beam's bands end between them."""
    scene = load_scene(assets_dir() / "scenes" / "spectrometer.toml")
    orders = tuple(range(-(ORDERS // 2), ORDERS // 2 + 1))
    grating = Grating(30.0, orders, (0.9 / ORDERS,) * ORDERS)
    return replace(scene, objects=(replace(scene.objects[0], material=grating), *scene.objects[1:]))


def test_a_slice_is_both_of_its_halves() -> None:
    whole = LatticeSlice(0, (Band(0.0, 1.0, 0.5, 1.0),), 100, 3, 4, 17, (0, 0), (0, 0), 0, 1)
    halves = [whole.every(2, i) for i in range(2)]

    def points(part: LatticeSlice) -> list[int]:
        return list(range(part.first, part.first + part.stride * part.points, part.stride))

    assert sorted(points(halves[0]) + points(halves[1])) == points(whole)
    assert [half.points for half in halves] == [9, 8]
    assert [*points(whole.split(5)[0]), *points(whole.split(5)[1])] == points(whole)


def test_a_slice_that_overflows_is_traced_again_in_parts(gl, crowded: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is lost of what the queue had no room for, which is half of the flux."""
    # Pilots of so many orders would take most of the time.
    monkeypatch.setattr(pilot, "MAX_DEPTH", FEW)
    monkeypatch.setattr(pilot, "PHOTONS", 64)
    # With more a pool has what waits for its turn.
    monkeypatch.setattr(ray_pool, "RAY_ROOM", 1.0)
    with light_pass(gl, crowded, replace(SMALL, photons=2_560, batch=2_048, max_depth=FEW)) as (light, _):
        light.begin(2_560, 1)
        plan = light.plans[0]
        whole = light.trace.run(*plan.part(1, 0, 2_560))
        assert whole.overflow > 0 and whole.tally.imbalance > 0.01
        for _ in light.pass_steps(0, 2_560):
            pass
        tally = light.stats.tally
        assert tally.imbalance < 1e-5 and np.isclose(tally.emitted, whole.tally.emitted + _others(light, 2_560))


def _others(light, photons: int) -> float:
    """W of the lights after the first."""
    return sum(light.trace.run(*plan.part(1, 0, photons)).tally.emitted for plan in light.plans[1:])
