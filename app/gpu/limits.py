"""What the OpenGL device allows, and the least of it that the programs were written for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from ..base.errors import UserError


def _limit(name: str, needed: int | tuple[int, int, int]) -> Any:
    """A limit that OpenGL calls `name`, of which at least `needed` is there."""
    return field(metadata={"name": name, "needed": needed})


@dataclass(frozen=True)
class Limits:
    """Limits of one OpenGL context, read once.

    What is needed of each is what OpenGL 4.3 promises (core specification, tables 23.55–23.74): a driver that has less
    is not a 4.3 driver, whatever it says. There are two exceptions: splats are drawn by vertex shaders that fetch their
    records (5 storage blocks, where none are promised), and passes have binding points of their own, so that none is
    bound twice in a frame (23, where 8 are promised). A test holds that no program of a shipped scene needs more."""

    storage_block_bytes: int = _limit("GL_MAX_SHADER_STORAGE_BLOCK_SIZE", 1 << 24)
    """Largest shader storage block; photon batches are cut to it."""
    storage_blocks: int = _limit("GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS", 8)
    """Storage blocks of a compute shader."""
    vertex_storage_blocks: int = _limit("GL_MAX_VERTEX_SHADER_STORAGE_BLOCKS", 5)
    """Storage blocks of a vertex shader."""
    fragment_storage_blocks: int = _limit("GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS", 8)
    """Storage blocks of a fragment shader."""
    storage_bindings: int = _limit("GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS", 23)
    """Binding points of storage blocks, for all shaders together."""
    uniform_blocks: int = _limit("GL_MAX_COMPUTE_UNIFORM_BLOCKS", 12)
    """Uniform blocks of a compute shader."""
    compute_textures: int = _limit("GL_MAX_COMPUTE_TEXTURE_IMAGE_UNITS", 16)
    """Texture units of a compute shader."""
    vertex_textures: int = _limit("GL_MAX_VERTEX_TEXTURE_IMAGE_UNITS", 16)
    """Texture units of a vertex shader."""
    fragment_textures: int = _limit("GL_MAX_TEXTURE_IMAGE_UNITS", 16)
    """Texture units of a fragment shader."""
    work_group_count: tuple[int, int, int] = _limit("GL_MAX_COMPUTE_WORK_GROUP_COUNT", (65535, 65535, 65535))
    """Work groups a dispatch may have; past it nothing runs and only the error flag reports it."""
    work_group_size: tuple[int, int, int] = _limit("GL_MAX_COMPUTE_WORK_GROUP_SIZE", (1024, 1024, 64))
    work_group_invocations: int = _limit("GL_MAX_COMPUTE_WORK_GROUP_INVOCATIONS", 1024)
    draw_buffers: int = _limit("GL_MAX_DRAW_BUFFERS", 8)
    color_attachments: int = _limit("GL_MAX_COLOR_ATTACHMENTS", 8)
    texture_px: int = _limit("GL_MAX_TEXTURE_SIZE", 16384)
    """Largest side of a 2D texture."""
    uniform_block_bytes: int = _limit("GL_MAX_UNIFORM_BLOCK_SIZE", 16384)

    @classmethod
    def read(cls, info: Mapping[str, Any]) -> Limits:
        """From `moderngl.Context.info`; a limit that the driver does not report counts as 0."""

        def value(name: str, needed: int | tuple[int, ...]) -> Any:
            if isinstance(needed, tuple):
                return tuple(int(v) for v in info.get(name, (0,) * len(needed)))
            return int(info.get(name, 0))

        return cls(**{limit.name: value(**limit.metadata) for limit in fields(cls)})


NEEDED = Limits(**{limit.name: limit.metadata["needed"] for limit in fields(Limits)})
BRUSH_STORAGE_BLOCKS = 10
"""Storage blocks of footprint.comp where dispersion is brushed onto glass and shown by index."""
_BEYOND_PROMISE = {
    "storage_blocks": "storage blocks in a compute shader",
    "vertex_storage_blocks": "storage blocks in a vertex shader",
    "storage_bindings": "binding points of storage blocks",
}


def check_splats(limits: Limits) -> None:
    """Raise `UserError` where splats cannot be drawn, before a driver says so in its own words."""
    for name, words in _BEYOND_PROMISE.items():
        found, needed = getattr(limits, name), getattr(NEEDED, name)
        if found < needed:
            raise UserError(
                f"the graphics driver has {found} {words}, and splats need {needed}: update it or use another GPU "
                "('spectrasplat doctor' lists its limits)"
            )


def check_brush(limits: Limits) -> None:
    """Raise `UserError` where dispersion that was brushed onto glass cannot be shown."""
    if limits.storage_blocks < BRUSH_STORAGE_BLOCKS:
        raise UserError(
            f"local dispersion takes {BRUSH_STORAGE_BLOCKS} storage blocks in a compute shader and the graphics driver "
            f"has {limits.storage_blocks}: update it, use another GPU, or take the scene's dabs away"
        )
