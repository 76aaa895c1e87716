"""Texels on receivers that something covers in part: a coin on a table, or a hair above it.

Beneath it is dark, beside it bright, and a texel across its rim holds the mean of both, which interpolation would carry
beyond the rim. So the light of such a texel is found twice, for what is covered and for what is open, and lookups
take the one or the other (`lib/receiver_light.glsl`). Parts that a rim crosses belong to neither.
"""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np

from ..gpu import bindings, shader
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.scene_records import SCENE_STRUCTS
from .environment_places import ALL_PARTS, PLACE, EnvironmentPlaces

_AT_ONCE = 4096
"""Places of one dispatch."""
_GROUP = 64
_BIND_PLACES, _BIND_PARTS, _UNIT_RECORDS = 8, 9, 0


def covered_places(buffers: SceneBuffers, places: EnvironmentPlaces) -> EnvironmentPlaces:
    """`places` with those of covered parts after them."""
    is_near = _near_things(buffers, places.places)
    is_open, is_covered = np.full(len(is_near), ALL_PARTS), np.zeros(len(is_near), int)
    if is_near.any():
        is_open[is_near], is_covered[is_near] = _parts(buffers, places, np.flatnonzero(is_near)).astype(int).T
    mixed = (is_open != ALL_PARTS) & (is_covered != ALL_PARTS)
    if not mixed.any():
        return places
    own = places.places.copy()
    own["step_u"][mixed], own["step_v"][mixed] = own["span_u"][mixed], own["span_v"][mixed]
    beneath = own[mixed]
    # A texel that has no part of one kind only takes what it has.
    own["parts"][mixed] = np.where(is_open, is_open, ALL_PARTS & ~is_covered)[mixed]
    beneath["parts"] = np.where(is_covered, is_covered, ALL_PARTS & ~is_open)[mixed]
    open_share, covered_share = (np.maximum(4 * np.bitwise_count(bits), mixed) for bits in (is_open, is_covered))
    no = np.zeros(len(beneath), bool)
    return replace(
        places,
        size=(places.size[0], 2 * places.size[1]),
        places=np.concatenate([own, beneath]),
        texel_xy=np.concatenate([places.texel_xy, places.texel_xy[mixed]]),
        on_top=np.append(places.on_top, no),
        is_window=np.append(places.is_window, no),
        covered=np.flatnonzero(mixed),
        shares=128.0 * open_share + covered_share,
    )


def _near_things(buffers: SceneBuffers, places: np.ndarray) -> np.ndarray:
    """bool (n,): the bounds of another object are within a texel's side."""
    found = np.zeros(len(places), bool)
    position, side = places["position"], np.linalg.norm(places["span_u"], axis=1)[:, None]
    for index, item in enumerate(buffers.scene.objects):
        low, high = buffers.space.to_gpu(item.world_bounds)
        found |= ((position > low - side) & (position < high + side)).all(axis=1) & (places["object"] != index)
    return found


def _parts(buffers: SceneBuffers, places: EnvironmentPlaces, chosen: np.ndarray) -> np.ndarray:
    """Open and covered parts of the `chosen` places as bits, uint32 (k, 2)."""
    ctx = buffers.ctx
    defines = buffers.features.defines() | bindings.SCENE_DEFINES | buffers.defines
    defines.pop("NORMAL_DERIVATIVES", None)
    defines |= {"BIND_PLACES": _BIND_PLACES, "BIND_PARTS": _BIND_PARTS, "UNIT_RECORDS": _UNIT_RECORDS}
    program = shader.compute(ctx, "light/covered.comp", defines, (*SCENE_STRUCTS, PLACE))
    image = places.image(np.zeros((len(places.places), 3)))
    records = ctx.texture(places.size, 4, image.tobytes(), dtype="f4")
    records.filter = (moderngl.NEAREST, moderngl.NEAREST)
    found = []
    for first in range(0, len(chosen), _AT_ONCE):
        part = chosen[first : first + _AT_ONCE]
        asked, answers = ctx.buffer(places.places[part].tobytes()), ctx.buffer(reserve=8 * len(part))
        buffers.bind()
        asked.bind_to_storage_buffer(_BIND_PLACES)
        answers.bind_to_storage_buffer(_BIND_PARTS)
        records.use(_UNIT_RECORDS)
        program.run(-(-len(part) // _GROUP))
        ctx.memory_barrier()
        found.append(np.frombuffer(answers.read(), np.uint32).reshape(-1, 2))
        shader.release(asked, answers)
    shader.release(records, program)
    return np.concatenate(found)
