"""Spectral channels for maps that were splatted in colour only, so that a preview is as fast where the camera
sees through dispersive glass.

Such maps live for a moment. Each texel gets the smoothest spectrum that has its colour, in the channels that proper
maps hold.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from ...gpu import shader
from ...gpu.map_channels import MapChannels
from ...model.scene import Light

_GROUP = 8
_EVEN = 1e-4
"""How much less a spectrum far from the lights' own level costs than an uneven one: decides where evenness leaves
several."""


def guess_weights(channels: MapChannels, lights: Sequence[Light]) -> tuple[np.ndarray, np.ndarray]:
    """Watts in each spectral channel for one unit of X, Y and Z (lm), float64 (channels, 3); luminance of a watt in
    each (channels,).

    The share of the lights' own spectrum that each channel has varies as little as the colour allows; some may come out
    negative.
    """
    xyz = np.array([spectrum.xyz() for spectrum in channels.spectra(lights)]).T
    first = 4 * channels.first_target
    cells = channels.cell_weights()[:, first : first + channels.count]
    own = np.sum([light.spectral_power.density @ cells for light in lights], axis=0)
    for light in lights:
        if light.spectral_power.lines:
            nm, power = np.array(light.spectral_power.lines).T
            own = own + power @ channels.line_weights(nm)[:, first : first + channels.count]
    own = np.maximum(own / own.max(), 1e-6) if own.max() > 0.0 else np.ones(channels.count)
    steps = np.diff(np.eye(channels.count), axis=0)
    uneven = steps.T @ steps + _EVEN * np.eye(channels.count)
    colour = xyz * own
    # Least unevenness under the three conditions of the colour, by Lagrange's multipliers.
    half = np.linalg.solve(uneven, colour.T)
    return own[:, None] * (half @ np.linalg.pinv(colour @ half)), xyz[1]


class SpectrumGuess:
    """Owns the textures that it fills."""

    def __init__(
        self, ctx: moderngl.Context, channels: MapChannels, lights: Sequence[Light], size: tuple[int, int]
    ) -> None:
        """`channels`: with tents; `size` of the maps, texels."""
        self._ctx = ctx
        targets = channels.targets - channels.first_target
        weights, luminance = guess_weights(channels, lights)
        records = np.zeros((4 * targets, 4), np.float32)
        records[: channels.count, :3], records[: channels.count, 3] = weights, luminance
        # One record a target: X of its four channels, then Y, Z and luminance.
        self._weights = ctx.buffer(np.ascontiguousarray(records.reshape(targets, 4, 4).transpose(0, 2, 1)))
        self.textures = [ctx.texture(size, 4, dtype="f4") for _ in range(targets)]
        self._program = shader.compute(ctx, "light/spectrum_guess.comp", {"SPECTRAL_TARGETS": targets})

    def run(self, colours: moderngl.Texture) -> None:
        """Fill `textures` from XYZ."""
        self._ctx.memory_barrier()
        colours.bind_to_image(0, read=True, write=False)
        for unit, texture in enumerate(self.textures, start=1):
            texture.bind_to_image(unit, read=False, write=True)
        self._weights.bind_to_storage_buffer(0)
        self._program.run(-(-colours.width // _GROUP), -(-colours.height // _GROUP))
        self._ctx.memory_barrier()

    def release(self) -> None:
        """Free everything."""
        shader.release(self._program, self._weights, *self.textures)
