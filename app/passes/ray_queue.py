"""Rays in flight between two dispatches, in order: every ray meets one surface, then its children are listed.

Count, scan and scatter list them without atomics, so the order of the photons is a function of the lattice alone.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

import moderngl
import numpy as np

from ..features.features import Features
from ..features.program_switches import Defines
from ..gpu import bindings, records, shader
from ..gpu.context import Context
from ..gpu.device_traits import DeviceTraits
from ..gpu.schema import Struct

RAY_ROOM = 3
"""Rays in flight per lattice point of a batch: splitting rarely passes 1.5."""
PHOTON_ROOM = 4
FLIGHT_ROOM = 24
"""Flights per lattice point of a batch, where they are recorded; most of glass splits into ten."""
_GROUP = 64
_CHUNK = 64
STRUCTS = (records.OUTCOME, records.CHUNK_COUNT, records.QUEUE_STATE)


@dataclass(frozen=True)
class QueueParts:
    """What a queue is made for."""

    context: Context
    traits: DeviceTraits
    features: Features
    defines: Defines
    structs: tuple[Struct, ...]
    batch: int
    """Lattice points."""


def strides(features: Features, traits: DeviceTraits) -> tuple[int, int]:
    """Bytes of a ray's record and of a photon's."""
    packs = traits.packs_records
    return records.ray_record_of(features, packs).stride, records.photon_record_of(features, packs).stride


@dataclass(frozen=True)
class Followed:
    """What became of the rays of a batch, as it was counted."""

    emitted: int
    photons: int
    steps: int
    flights: int
    overflow: int
    emitted_w: float
    roulette_w: float
    ended_w: Sequence[float]
    """By CATEGORIES."""
    absorbed_w: float
    """On the way."""
    fallbacks: Sequence[int]
    """By FALLBACKS."""


class OrderedQueue:
    """Owns the rays' buffers, of which emission fills `rays`; `photons` is what they leave."""

    def __init__(self, parts: QueueParts) -> None:
        ctx, batch, (ray, photon) = parts.context.ctx, parts.batch, strides(parts.features, parts.traits)
        self._context = parts.context
        names = "count", "scan", "scatter", "gather"
        queue = [shader.compute(ctx, f"light/queue_{name}.comp", parts.defines, parts.structs) for name in names]
        self._count, self._scan, self._scatter, self._gather = queue
        capacity = RAY_ROOM * batch
        chunks = -(-capacity // _CHUNK)
        self._state_zero = records.QUEUE_STATE.zeros(1)
        self._state_zero["ray_capacity"] = capacity
        self._state_zero["photon_capacity"] = PHOTON_ROOM * batch
        self._rays = [ctx.buffer(reserve=2 * capacity * ray) for _ in range(2)]
        self.rays = self._rays[0]
        self._outcomes = ctx.buffer(reserve=capacity * records.OUTCOME.stride)
        self._slots = ctx.buffer(reserve=capacity * photon)
        self._indices = ctx.buffer(reserve=2 * capacity * 4)
        self._counts = ctx.buffer(reserve=chunks * records.CHUNK_COUNT.stride)
        self._counts_zero = bytes(chunks * records.CHUNK_COUNT.stride)
        self._state = ctx.buffer(self._state_zero.tobytes())
        self.photons = ctx.buffer(reserve=PHOTON_ROOM * batch * photon)
        self._emitted = 0

    @staticmethod
    def bytes_of(features: Features, traits: DeviceTraits, batch: int) -> int:
        """Device memory of the queue for so many lattice points."""
        (ray, photon), room = strides(features, traits), RAY_ROOM * batch
        return room * (4 * ray + records.OUTCOME.stride + photon + 8) + PHOTON_ROOM * batch * photon

    @staticmethod
    def most(features: Features, traits: DeviceTraits, block_bytes: int) -> int:
        """Lattice points whose queue fits storage blocks of so many bytes."""
        return block_bytes // (2 * RAY_ROOM * strides(features, traits)[0])

    def begin(self, count: int) -> None:
        """Before `count` lattice points are emitted."""
        state = self._state_zero.copy()
        state["alive"] = state["dispatched"] = count
        self._state.write(state.tobytes())
        self._counts.write(self._counts_zero)
        self._bind(0)

    def emitted(self, count: int) -> None:
        """They have been."""
        self._indices.bind_to_storage_buffer(bindings.INDICES)
        self._list_children(first=True, chunks=-(-count // _CHUNK))
        self._emitted = int(self._read_state()["alive"])

    def load(self, rays: np.ndarray) -> None:
        """These rays are on their way already."""
        count = self._emitted = len(rays)
        chunks = -(-count // _CHUNK)
        state = self._state_zero.copy()
        state["alive"] = state["flights"] = count
        state["trace_groups"] = (-(-count // _GROUP), 1, 1, 0)
        state["next_chunk_groups"] = (-(-chunks // _GROUP), 1, 1, 0)
        self._state.write(state.tobytes())
        self._counts.write(self._counts_zero)
        self._rays[0].write(np.ascontiguousarray(rays))
        self._indices.write(np.arange(count, dtype=np.uint32))

    def follow(
        self, trace: moderngl.ComputeShader, bind: Callable[[], None], limit: int, end_all: Callable[[], None]
    ) -> Generator[None, None, Followed]:
        """Event after event of the rays in flight, until none is left, pausing after each; `bind` binds what else
        `trace` wants, `end_all` makes the last of `limit` events end whatever is left."""
        alive, step = self._emitted, 0
        while alive and step < limit:
            bind()
            if step == limit - 1:
                end_all()
            self._bind(step + 1)
            self._indices.bind_to_storage_buffer(bindings.INDICES)
            trace.run_indirect(self._state, records.QUEUE_STATE.offset("trace_groups"))
            self._list_children(first=False)
            step += 1
            alive = int(self._read_state()["alive"])
            yield
        state = self._read_state()
        self._context.ctx.memory_barrier()
        photons = int(state["photon_first"]) + int(state["photons_new"])
        counts = np.frombuffer(self._counts.read(), records.CHUNK_COUNT.dtype)
        emitted_w, roulette_w, absorbed_w = (
            float(counts[name].sum(dtype=float)) for name in ("emitted_w", "roulette_w", "absorbed_w")
        )
        ended_w = counts["flux_w"].sum(axis=0, dtype=float).tolist()
        fallbacks = counts["fallbacks"].sum(axis=0, dtype=int).tolist()
        flights, overflow = int(state["flights"]), int(state["overflow"])
        return Followed(
            self._emitted, photons, step, flights, overflow, emitted_w, roulette_w, ended_w, absorbed_w, fallbacks
        )

    def _bind(self, step: int) -> None:
        # Step 0 (emission) writes rays[0]; step k reads rays[(k-1) % 2].
        self._rays[step % 2].bind_to_storage_buffer(bindings.RAYS_OUT)
        self._rays[(step + 1) % 2].bind_to_storage_buffer(bindings.RAYS_IN)
        self._outcomes.bind_to_storage_buffer(bindings.OUTCOMES)
        self._slots.bind_to_storage_buffer(bindings.PHOTON_SLOTS)
        self._counts.bind_to_storage_buffer(bindings.COUNTS)
        self._state.bind_to_storage_buffer(bindings.STATE)
        self.photons.bind_to_storage_buffer(bindings.PHOTONS)

    def _list_children(self, *, first: bool, chunks: int = 0) -> None:
        ctx = self._context.ctx
        offsets = {
            name: records.QUEUE_STATE.offset(name) for name in ("chunk_groups", "next_chunk_groups", "gather_groups")
        }
        ctx.memory_barrier()
        if first:
            self._count.run(-(-chunks // _GROUP))
        else:
            self._count.run_indirect(self._state, offsets["next_chunk_groups"])
        ctx.memory_barrier()
        self._scan.run(1)
        ctx.memory_barrier()
        self._scatter.run_indirect(self._state, offsets["chunk_groups"])
        ctx.memory_barrier()
        if not first:
            self._gather.run_indirect(self._state, offsets["gather_groups"])
            ctx.memory_barrier()

    def _read_state(self) -> np.void:
        return np.frombuffer(self._state.read(), records.QUEUE_STATE.dtype)[0]

    def release_buffers(self) -> None:
        """Free what rays and photons lie in."""
        shader.release(*self._rays, self._outcomes, self._slots, self._indices, self._counts, self.photons)

    def release(self) -> None:
        """Free everything."""
        self.release_buffers()
        shader.release(self._state, self._count, self._scan, self._scatter, self._gather)
