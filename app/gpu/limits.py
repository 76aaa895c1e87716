"""What the OpenGL device allows, and the least of it that the programs were written for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..base.errors import UserError


@dataclass(frozen=True)
class Limits:
    """Limits of one OpenGL context, read once."""

    storage_block_bytes: int
    """Largest shader storage block; photon batches are cut to it."""
    storage_blocks: int
    """Storage blocks one compute shader may see …"""
    vertex_storage_blocks: int
    """… a vertex shader: OpenGL promises none, and splats are drawn from one …"""
    fragment_storage_blocks: int
    """… and a fragment shader."""
    storage_bindings: int
    """Binding points of storage blocks, for all shaders together."""
    uniform_blocks: int
    """Of a compute shader."""
    compute_textures: int
    """Texture units of a compute shader, …"""
    vertex_textures: int
    """… of a vertex shader …"""
    fragment_textures: int
    """… and of a fragment shader."""
    work_group_count: tuple[int, int, int]
    """Work groups a dispatch may have; past it nothing runs and only the error flag tells."""
    work_group_size: tuple[int, int, int]
    work_group_invocations: int
    draw_buffers: int
    color_attachments: int
    texture_px: int
    """Largest side of a 2D texture."""
    uniform_block_bytes: int

    @classmethod
    def read(cls, info: Mapping[str, Any]) -> Limits:
        """From `moderngl.Context.info`; a limit the driver does not tell counts as 0."""

        def one(name: str) -> int:
            return int(info.get(name, 0))

        def three(name: str) -> tuple[int, int, int]:
            x, y, z = info.get(name, (0, 0, 0))
            return int(x), int(y), int(z)

        return cls(
            storage_block_bytes=one("GL_MAX_SHADER_STORAGE_BLOCK_SIZE"),
            storage_blocks=one("GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS"),
            vertex_storage_blocks=one("GL_MAX_VERTEX_SHADER_STORAGE_BLOCKS"),
            fragment_storage_blocks=one("GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS"),
            storage_bindings=one("GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS"),
            uniform_blocks=one("GL_MAX_COMPUTE_UNIFORM_BLOCKS"),
            compute_textures=one("GL_MAX_COMPUTE_TEXTURE_IMAGE_UNITS"),
            vertex_textures=one("GL_MAX_VERTEX_TEXTURE_IMAGE_UNITS"),
            fragment_textures=one("GL_MAX_TEXTURE_IMAGE_UNITS"),
            work_group_count=three("GL_MAX_COMPUTE_WORK_GROUP_COUNT"),
            work_group_size=three("GL_MAX_COMPUTE_WORK_GROUP_SIZE"),
            work_group_invocations=one("GL_MAX_COMPUTE_WORK_GROUP_INVOCATIONS"),
            draw_buffers=one("GL_MAX_DRAW_BUFFERS"),
            color_attachments=one("GL_MAX_COLOR_ATTACHMENTS"),
            texture_px=one("GL_MAX_TEXTURE_SIZE"),
            uniform_block_bytes=one("GL_MAX_UNIFORM_BLOCK_SIZE"),
        )


# OpenGL 4.3 promises these (core specification, tables 23.55–23.74), and a driver that has less is not a 4.3 driver in
# fact, whatever it says; but for two. Splats are drawn by vertex shaders that fetch their records: 5 storage blocks,
# where none are promised. And the passes have binding points of their own, so that none is bound twice in a frame: 23,
# where 8 are promised. A test holds that no program of a shipped scene asks for more.
NEEDED = Limits(
    storage_block_bytes=1 << 24,
    storage_blocks=8,
    vertex_storage_blocks=5,
    fragment_storage_blocks=8,
    storage_bindings=23,
    uniform_blocks=12,
    compute_textures=16,
    vertex_textures=16,
    fragment_textures=16,
    work_group_count=(65535, 65535, 65535),
    work_group_size=(1024, 1024, 64),
    work_group_invocations=1024,
    draw_buffers=8,
    color_attachments=8,
    texture_px=16384,
    uniform_block_bytes=16384,
)
BRUSH_STORAGE_BLOCKS = 10
"""Storage blocks of footprint.comp where dispersion is brushed onto glass and shown by index."""
_BEYOND_PROMISE = {
    "storage_blocks": "storage blocks in a compute shader",
    "vertex_storage_blocks": "storage blocks in a vertex shader",
    "storage_bindings": "binding points of storage blocks",
}


def check_splats(limits: Limits) -> None:
    """Raise `UserError` where splats cannot be drawn, before a driver says so in words of its own."""
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
