"""The queue between two trace steps (lib/queue.glsl and the four kernels over it) against its CPU reference in
app/reference."""

from __future__ import annotations

import numpy as np
import pytest
from reference import queue
from spectrasplat.gpu import bindings, records, shader
from spectrasplat.gpu.scene_records import SCENE_STRUCTS

CATEGORIES, FALLBACKS = len(records.CATEGORIES), len(records.FALLBACKS)
PHOTON = records.photon_record(1)
DEFINES = bindings.LIGHT_HALF_DEFINES | {"CATEGORY_COUNT": f"{CATEGORIES}u", "FALLBACK_COUNT": f"{FALLBACKS}u"}
GROUP = 64


class Queue:
    """The kernels with buffers for `count` rays."""

    def __init__(
        self,
        gl,
        outcomes: np.ndarray,
        ray_capacity: int,
        photon_capacity: int,
        photon_first: int = 0,
        photons_new: int = 0,
    ) -> None:
        self.ctx = gl.ctx
        structs = (*SCENE_STRUCTS, PHOTON, records.OUTCOME, records.CHUNK_COUNT, records.QUEUE_STATE)
        self.programs = {
            name: shader.compute(self.ctx, f"light/queue_{name}.comp", DEFINES, structs)
            for name in ("count", "scan", "scatter", "gather")
        }
        state = records.QUEUE_STATE.zeros(1)
        state["alive"] = state["dispatched"] = len(outcomes)
        state["ray_capacity"], state["photon_capacity"] = ray_capacity, photon_capacity
        state["photon_first"], state["photons_new"] = photon_first, photons_new
        slots = PHOTON.zeros(max(len(outcomes), 1))
        slots["photon_id"] = np.arange(len(slots)) + 1000
        self.chunks = -(-max(len(outcomes), 1) // queue.CHUNK)
        self.buffers = {
            bindings.OUTCOMES: self.ctx.buffer(outcomes if len(outcomes) else records.OUTCOME.zeros(1)),
            bindings.COUNTS: self.ctx.buffer(records.CHUNK_COUNT.zeros(self.chunks)),
            bindings.STATE: self.ctx.buffer(state),
            bindings.INDICES: self.ctx.buffer(np.full(ray_capacity + photon_capacity + 1, 0xFFFFFFFF, np.uint32)),
            bindings.PHOTON_SLOTS: self.ctx.buffer(slots),
            bindings.PHOTONS: self.ctx.buffer(PHOTON.zeros(photon_capacity + 1)),
        }
        self.ray_capacity = ray_capacity

    def step(self) -> None:
        for binding, buffer in self.buffers.items():
            buffer.bind_to_storage_buffer(binding)
        groups = -(-self.chunks // GROUP)
        for name, size in (
            ("count", groups),
            ("scan", 1),
            ("scatter", groups),
            ("gather", self.chunks),
        ):
            self.programs[name].run(size)
            self.ctx.memory_barrier()
        self.ctx.finish()

    def read(self, binding: int, dtype: np.dtype) -> np.ndarray:
        return np.frombuffer(self.buffers[binding].read(), dtype)

    def release(self) -> None:
        for owned in (*self.programs.values(), *self.buffers.values()):
            shader.release(owned)


def random_outcomes(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    outcomes = records.OUTCOME.zeros(count)
    outcomes["what"] = (
        rng.integers(0, 8, count)
        | rng.integers(0, 1 << FALLBACKS, count) << 8
        | rng.integers(0, CATEGORIES, count) << 16
    )
    for name in ("flux_w", "absorbed_w", "roulette_w"):
        outcomes[name] = rng.random(count)
    return outcomes


@pytest.mark.parametrize("count", [0, 1, 63, 64, 65, 1000, 40_000])
def test_children_and_photons_are_listed_in_order(gl, count: int) -> None:
    outcomes = random_outcomes(count, count)
    rig = Queue(gl, outcomes, ray_capacity=2 * count + 1, photon_capacity=count + 5, photon_first=2, photons_new=3)
    rig.step()
    children, photons = queue.children(outcomes["what"]), queue.photons(outcomes["what"])
    state = rig.read(bindings.STATE, records.QUEUE_STATE.dtype)[0]
    assert (state["alive"], state["photons_new"], state["photon_first"], state["overflow"]) == (
        len(children),
        len(photons),
        5,
        0,
    )
    listed = rig.read(bindings.INDICES, np.dtype(np.uint32))
    np.testing.assert_array_equal(listed[: len(children)], children)
    assert (listed[len(children) : rig.ray_capacity] == 0xFFFFFFFF).all()
    moved = rig.read(bindings.PHOTONS, PHOTON.dtype)["photon_id"]
    np.testing.assert_array_equal(moved[5 : 5 + len(photons)], 1000 + photons)
    assert not moved[:5].any()
    counts = rig.read(bindings.COUNTS, records.CHUNK_COUNT.dtype)
    np.testing.assert_allclose(
        counts["flux_w"].sum(axis=0, dtype=float), queue.ended_flux(outcomes, CATEGORIES), rtol=1e-5, atol=1e-9
    )
    np.testing.assert_array_equal(counts["fallbacks"].sum(axis=0), queue.fallbacks(outcomes, FALLBACKS))
    for name in ("absorbed_w", "roulette_w"):
        assert counts[name].sum(dtype=float) == pytest.approx(outcomes[name].sum(dtype=float), rel=1e-5)
    groups = -(-len(children) // GROUP)
    assert state["trace_groups"].tolist() == [groups, 1, 1, 0]
    assert state["next_chunk_groups"].tolist() == [-(-groups // GROUP), 1, 1, 0]
    rig.release()


def test_what_starts_does_not_end(gl) -> None:
    outcomes = random_outcomes(500, 1)
    outcomes["what"] |= np.uint32(8)
    rig = Queue(gl, outcomes, 1001, 501)
    rig.step()
    counts = rig.read(bindings.COUNTS, records.CHUNK_COUNT.dtype)
    assert not counts["flux_w"].any() and not queue.ended_flux(outcomes, CATEGORIES).any()
    assert counts["emitted_w"].sum(dtype=float) == pytest.approx(outcomes["flux_w"].sum(dtype=float), rel=1e-5)
    rig.release()


def test_what_finds_no_room_is_counted(gl) -> None:
    outcomes = random_outcomes(3000, 2)
    children, photons = queue.children(outcomes["what"]), queue.photons(outcomes["what"])
    rays, room = len(children) - 40, len(photons) - 7
    rig = Queue(gl, outcomes, ray_capacity=rays, photon_capacity=room)
    rig.step()
    state = rig.read(bindings.STATE, records.QUEUE_STATE.dtype)[0]
    assert (state["alive"], state["photons_new"], state["overflow"]) == (rays, room, 47)
    listed = rig.read(bindings.INDICES, np.dtype(np.uint32))
    # The last places go to whichever chunk writes first; all that are listed are children, none twice.
    assert len(np.unique(listed[:rays])) == rays and np.isin(listed[:rays], children).all()
    rig.release()
