"""Caustic maps as the camera reads them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl

from ..gpu import shader
from ..gpu.records import NONE, PLACEMENT, RECEIVER


@dataclass(frozen=True)
class CausticMaps:
    """The light pass's result, as the camera reads it."""

    textures: Sequence[moderngl.Texture]
    """RGBA32F, energy per texel: XYZ and W with spectral tents after them, or four bins each."""
    receivers: moderngl.Buffer
    """RECEIVER records."""
    placements: moderngl.Buffer
    """PLACEMENT records."""
    scale: float = 1.0
    """Factor on every texel: one over the number of passes summed in it."""
    environment: moderngl.Texture | None = None
    """Light of the environment on receivers (`environment_light`), and what these give each other (`bounce_light`);
    None: nothing is known of it."""

    @classmethod
    def without_light(cls, ctx: moderngl.Context, receivers: int, targets: int) -> CausticMaps:
        """Maps of a scene whose so many receivers have none: `targets` textures of one texel."""
        records = RECEIVER.zeros(max(1, receivers))
        records["placement"] = NONE
        textures = [ctx.texture((1, 1), 4, bytes(16), dtype="f4") for _ in range(targets)]
        return cls(textures, ctx.buffer(records.tobytes()), ctx.buffer(reserve=PLACEMENT.stride))

    def release(self) -> None:
        """Free everything; for their owner."""
        shader.release(*self.textures, self.receivers, self.placements)
