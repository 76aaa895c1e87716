"""How many rays a batch holds."""

from __future__ import annotations

from ..base.memory import available_bytes
from ..features.features import Features
from ..gpu import records
from ..gpu.context import Context
from ..passes.trace import RAY_ROOM, queue_bytes
from .light_plan import SMALLEST_BATCH

DEFAULT_BATCH = 1 << 16
QUEUE_BYTES = 64 << 20
"""What the queue of a batch that nobody asked for may take; more on a GPU. Less where memory is short."""


def batch_size(context: Context, features: Features, asked: int | None) -> int:
    """Lattice points in flight at once: `asked`, or what the device and its memory have room for."""
    batch = asked or DEFAULT_BATCH * context.traits.batch_scale
    if asked is None:
        batch = _batch_that_fits(features, batch, QUEUE_BYTES * context.traits.batch_scale)
    return min(batch, _largest_batch(context, features))


def _batch_that_fits(features: Features, batch: int, most_bytes: int) -> int:
    """`batch`, halved until its queue takes no more than that, nor more than an eighth of the memory there is."""
    while batch > SMALLEST_BATCH and queue_bytes(features, batch) > min(most_bytes, available_bytes() // 8):
        batch >>= 1
    return batch


def _largest_batch(context: Context, features: Features) -> int:
    """Lattice points whose queue fits the device's largest storage buffer."""
    ray = records.ray_record_of(features).stride
    limit = context.limits.storage_block_bytes
    return max(64, int(limit // (2 * RAY_ROOM * ray)) // 64 * 64)
