"""Rays in flight where a dispatch follows each for several events: slots in a pool, taken and given back by the device.

Nothing is read while a batch is traced: a fixed number of dispatches follows, of which the last find no ray any more.
"""

from __future__ import annotations

from collections.abc import Callable, Generator

import moderngl
import numpy as np

from ..features.features import Features
from ..gpu import bindings, records, shader
from ..gpu.device_traits import DeviceTraits
from ..gpu.packed_records import write_records
from .ray_queue import Followed, QueueParts, strides

RAY_ROOM, PHOTON_ROOM = 1.5, 2.5
"""Slots for rays per lattice point of a batch, and room for photons: what finds no slot waits, a batch without room for
its photons is traced again in parts."""
_GROUP = 64
_LISTS = 4
"""Numbers of slots in lists and ring, per slot (lib/pool.glsl)."""
STRUCTS = (records.OUTCOME, records.POOL_TALLY, records.POOL_STATE)


def _slots(batch: int) -> int:
    return -(-int(RAY_ROOM * batch) // _GROUP) * _GROUP


class RayPool:
    """Owns the rays' buffer `rays`; `photons` is what they leave, in any order."""

    def __init__(self, parts: QueueParts) -> None:
        ctx, slots, (ray, photon) = (
            parts.context.ctx,
            _slots(parts.batch),
            strides(parts.features, parts.traits),
        )
        self._context = parts.context
        self._ray = records.ray_record_of(parts.features, parts.traits.packs_records)
        self._dispatches = len(parts.traits.ray_events)
        self._sum = shader.compute(ctx, "light/pool_tally.comp", parts.defines, parts.structs)
        self._state_zero = records.POOL_STATE.zeros(1)
        self._state_zero["capacity"] = self._state_zero["free_end"] = self._state_zero["returned"] = slots
        self._state_zero["photon_capacity"] = int(PHOTON_ROOM * parts.batch)
        self.rays = ctx.buffer(reserve=slots * ray)
        self._lists = ctx.buffer(reserve=4 * _LISTS * slots)
        self._tallies = ctx.buffer(bytes(slots // _GROUP * records.POOL_TALLY.stride))
        self.state = ctx.buffer(self._state_zero.tobytes())
        self.photons = ctx.buffer(reserve=int(PHOTON_ROOM * parts.batch) * photon)

    @staticmethod
    def bytes_of(features: Features, traits: DeviceTraits, batch: int) -> int:
        """Device memory of the pool for so many lattice points."""
        (ray, photon), slots = strides(features, traits), _slots(batch)
        return (
            slots * (ray + 4 * _LISTS) + slots // _GROUP * records.POOL_TALLY.stride + int(PHOTON_ROOM * batch) * photon
        )

    @staticmethod
    def most(features: Features, traits: DeviceTraits, block_bytes: int) -> int:
        """Lattice points whose pool fits storage blocks of so many bytes, and a dispatch."""
        ray, photon = strides(features, traits)
        per_point = max(RAY_ROOM * ray, PHOTON_ROOM * photon)
        return int(min(block_bytes // per_point, 65535 * _GROUP // RAY_ROOM))

    def begin(self, count: int, most_photons: int = 1 << 31) -> None:
        """Before about `count` rays are emitted, which leave `most_photons` or are traced again."""
        state = self._state_zero.copy()
        state["photon_capacity"] = min(most_photons, state["photon_capacity"][0])
        self.state.write(state.tobytes())
        self._bind()

    def emitted(self, count: int) -> None:
        """They have been."""
        self._context.ctx.memory_barrier()

    def load(self, rays: np.ndarray) -> None:
        """These rays are on their way already."""
        state, count = self._state_zero.copy(), len(rays)
        state["alive"] = state["taken"] = state["taken_before"] = state["emitted"] = count
        state["trace_groups"] = (-(-count // _GROUP), 1, 1, 0)
        self.state.write(state.tobytes())
        write_records(self._ray, self.rays, rays)

    def send(self, trace: moderngl.ComputeShader, bind: Callable[[], None]) -> None:
        """Follow the rays; the last dispatch follows all that is left. Nothing is waited for."""
        bind()
        self._bind()
        for _ in range(self._dispatches):
            trace.run_indirect(self.state, records.POOL_STATE.offset("trace_groups"))
            self._context.ctx.memory_barrier()
        self._sum.run(1)
        self._context.ctx.memory_barrier()

    def follow(
        self, trace: moderngl.ComputeShader, bind: Callable[[], None], limit: int, end_all: Callable[[], None]
    ) -> Generator[None, None, Followed]:
        """`OrderedQueue.follow`, with a single pause."""
        self.send(trace, bind)
        yield
        return self.counted(self.state)

    @staticmethod
    def counted(report: moderngl.Buffer) -> Followed:
        """What became of the rays, from `state` or a copy of it; waits for the device."""
        state = np.frombuffer(report.read(), records.POOL_STATE.dtype)[0]
        watts = state["watts"].astype(float).tolist()
        ended = len(records.CATEGORIES)
        absorbed_w, roulette_w, emitted_w = watts[ended:]
        overflow = int(state["overflow"])
        photons = int(state["photons"])
        emitted, steps, flights = (int(state[name]) for name in ("emitted", "dispatches", "flights"))
        fallbacks = state["fallbacks"].tolist()
        return Followed(
            emitted, photons, steps, flights, overflow, emitted_w, roulette_w, watts[:ended], absorbed_w, fallbacks
        )

    def _bind(self) -> None:
        for binding, buffer in (
            (bindings.RAYS_IN, self.rays),
            (bindings.RAYS_OUT, self.rays),
            (bindings.POOL_SLOTS, self._lists),
            (bindings.COUNTS, self._tallies),
            (bindings.STATE, self.state),
            (bindings.PHOTONS, self.photons),
        ):
            buffer.bind_to_storage_buffer(binding)

    def release_buffers(self) -> None:
        """Free what rays and photons lie in."""
        shader.release(self.rays, self._lists, self._tallies, self.photons)

    def release(self) -> None:
        """Free everything."""
        self.release_buffers()
        shader.release(self.state, self._sum)
