"""Records of numpy in buffers of the device, which packs some of them: what a GPU waits for is memory."""

from __future__ import annotations

import moderngl
import numpy as np

from ..features.program_switches import switched
from . import shader
from .schema import Struct

_GROUP = 64


def read_records(struct: Struct, buffer: moderngl.Buffer, count: int) -> np.ndarray:
    """The first `count` records of a buffer, (n,) of `struct.dtype`."""
    if not struct.packs or not count:
        return np.frombuffer(buffer.read(count * struct.stride) if count else b"", struct.dtype)
    found = buffer.ctx.buffer(reserve=count * struct.dtype.itemsize)
    _move(struct, buffer, found, count, packs=False)
    records = np.frombuffer(found.read(), struct.dtype)
    found.release()
    return records


def write_records(struct: Struct, buffer: moderngl.Buffer, records: np.ndarray) -> None:
    """Write `records` (n,) to the beginning of a buffer."""
    if not struct.packs or not len(records):
        buffer.write(np.ascontiguousarray(records))
        return
    given = buffer.ctx.buffer(np.ascontiguousarray(records))
    _move(struct, buffer, given, len(records), packs=True)
    given.release()


def _move(struct: Struct, texels: moderngl.Buffer, records: moderngl.Buffer, count: int, *, packs: bool) -> None:
    defines = switched(PACKS=packs) | {"WORKGROUP": _GROUP, "RECORD": struct.name}
    defines |= {f"RECORD_{what}": f"{struct.name}_{what}" for what in ("TEXELS", "FROM", "TO")}
    program = shader.compute(texels.ctx, "scene/records.comp", defines, (struct,))
    texels.bind_to_storage_buffer(0)
    records.bind_to_storage_buffer(1)
    program["count"].value = count
    texels.ctx.memory_barrier()
    program.run(-(-count // _GROUP))
    texels.ctx.memory_barrier()
    shader.release(program)
