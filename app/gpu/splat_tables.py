"""Spectra as splats see them: a band of light, weighted per channel, blurred by the splat's width.

Along its sweep a splat is its band's spectrum convolved with a Gaussian, so a fragment's
colour is one lookup by (place xi, Gaussian's standard deviation / sweep length). Energies are exact in
float64: the integral of every small cell of the spectrum comes from its running integral, lines keep their
wavelength, and what the cut at three standard deviations leaves out is given back to each cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import moderngl
import numpy as np

from ..model.optics.colorimetry import VISIBLE_NM
from ..model.optics.spectral_tables import CumulativeSpectrum, SpectralAxis, cumulative
from ..model.optics.spectrum import Spectrum
from . import shader
from .growing import filled
from .map_channels import MapChannels

CUT = 3.0
"""Standard deviations that a splat reaches beyond its sweep (as in footprint.comp)."""
SIGMAS = np.concatenate([2.0 ** (np.arange(16) / 4.0 - 8.0), 2.0 ** (np.arange(73) / 8.0 - 4.0)])
"""Standard deviation / sweep length of each row: 2^-8 to 2^5, closer together from 2^-4 on (as in splat_shapes.glsl),
where it shapes the splat. The footprint pass makes every splat fit a row, so that the nearest texel serves; filtering
would cost a software renderer a fifth of its rate."""
WIDTH, WIDTH_WITH_LINES, LEAST_WIDTH = 512, 1024, 64
"""Samples along xi; a line needs more, since nothing but the splat's width blurs it."""
MOST_BYTES = 512 << 20
"""Bytes of all tables beyond which they have fewer samples along xi: narrow bands are many."""
MOST_LAYERS = 2048
"""Layers of a texture array: as many as OpenGL 4.3 promises."""
FINEST = 512
"""Cells of a band for the sharpest row."""
DENSITY_CELLS, CUMULATIVE_SAMPLES = 1024, 2049


@dataclass(frozen=True)
class SplatTables:
    """GPU tables of every (light, reflectance class, band). Layers: ((light · classes + class) · bands + band) ·
    targets + g; layer n is layer n mod `layers` of the texture, below n div `layers` others' rows."""

    texture: moderngl.TextureArray
    """RGBA32F (layers, stacked · rows, width): T(xi), whose integral over xi in [-1, 1] is the band's energy."""
    band_buffer: moderngl.Buffer
    """vec4 per (light, class, band): x_lo, x_hi, mean place of the energy in the band (0–1), its power (W). Behind
    them, from `first_power` on and four to a vec4, a float per (light, class) and sample of x: power below x, W."""
    integral_buffer: moderngl.Buffer
    """Three vec4 per layer: energy of the band, its mean place in the band (0–1) and its standard deviation there."""
    density_buffer: moderngl.Buffer
    """vec4 per (light, class, target) and cell of x: mean energy density over x."""
    cumulative_buffer: moderngl.Buffer
    """vec4 per (light, class, target) and sample of x: energy below x."""
    first_power: int
    """Index in `band_buffer` where powers begin, vec4."""
    classes: int
    bands: int
    targets: int
    rows: int
    width: int
    layers: int
    stacked: int

    @classmethod
    def build(
        cls,
        ctx: moderngl.Context,
        axis: SpectralAxis,
        lights: Sequence[Spectrum],
        reflectances: Sequence[np.ndarray | None],
        bands: Sequence[Sequence[tuple[float, float]]],
        channels: MapChannels = MapChannels(),
        width: int | None = None,
        into: SplatTables | None = None,
    ) -> SplatTables:
        """Tables for the lights' spectra under each reflectance (401,) or None.

        `bands[light]`: (x_lo, x_hi) of its bands; a band of no width stands for a line. Lights with fewer
        bands than others are padded with empty ones. `channels`: X, Y, Z (lm) and radiant W, what follows them, or bins
        (W), four a target.
        `width`: samples along xi, None for what a finished picture needs. `into`: tables that are of no use any more,
        whose textures and buffers become these'.
        """
        band_count = max(len(of_light) for of_light in bands)
        targets = channels.targets
        width = width or (WIDTH_WITH_LINES if any(light.lines for light in lights) else WIDTH)
        shape = (len(lights), len(reflectances), band_count)
        spectra = np.arange(np.prod(shape)).reshape(shape)
        while width > LEAST_WIDTH and 16 * width * len(SIGMAS) * targets * spectra.size > MOST_BYTES:
            width //= 2
        across = min(spectra.size, MOST_LAYERS // targets)
        stacked = -(-spectra.size // across)
        texels = np.zeros((across, targets, stacked, len(SIGMAS), width, 4), np.float32)
        integrals = np.zeros((*shape, targets, 3, 4), np.float32)
        spans = np.zeros((*shape, 4), np.float32)
        density = np.zeros((*shape[:2], targets, DENSITY_CELLS, 4), np.float32)
        running = np.zeros((*shape[:2], targets, CUMULATIVE_SAMPLES, 4), np.float32)
        power = np.zeros((*shape[:2], CUMULATIVE_SAMPLES), np.float32)
        for i, light in enumerate(lights):
            for j, reflectance in enumerate(reflectances):
                source = FoldedSpectrum.of(axis, light, reflectance, channels)
                density[i, j] = _by_target(source.density(), targets)
                below = source.cumulative(np.linspace(0.0, 1.0, CUMULATIVE_SAMPLES))
                running[i, j], power[i, j] = _by_target(below, targets), below[:, channels.power].sum(axis=-1)
                edges = np.array(bands[i], np.float64)
                count = len(edges)
                table, summary, place = source.blurred(edges, width)
                energy = summary[:, 0]
                table = table.reshape(len(SIGMAS), width, count, targets, 4).transpose(2, 3, 0, 1, 4)
                texels[spectra[i, j, :count] % across, :, spectra[i, j, :count] // across] = table
                integrals[i, j, :count] = summary.reshape(count, 3, targets, 4).swapaxes(1, 2)
                spans[i, j, :count] = np.column_stack([edges, place, energy[:, channels.power].sum(axis=-1)])
        size = width, stacked * len(SIGMAS), across * targets
        texture = None if into is None else into.texture
        if texture is None or (texture.width, texture.height, texture.layers) != size:
            shader.release(texture)
            texture = table_texture(ctx, size)
        texture.write(texels)
        before = into.buffers if into is not None else (None,) * 4
        bands_and_power = np.concatenate([spans.ravel(), power.ravel(), np.zeros(-power.size % 4, np.float32)])
        values = bands_and_power, integrals, density, running
        buffers = [filled(ctx, *pair) for pair in zip(before, values, strict=True)]
        return cls(
            texture,
            buffers[0],
            buffers[1],
            buffers[2],
            buffers[3],
            first_power=spectra.size,
            classes=shape[1],
            bands=band_count,
            targets=targets,
            rows=len(SIGMAS),
            width=width,
            layers=across * targets,
            stacked=stacked,
        )

    @property
    def buffers(self) -> tuple[moderngl.Buffer, ...]:
        """All of them."""
        return self.band_buffer, self.integral_buffer, self.density_buffer, self.cumulative_buffer

    def release(self) -> None:
        shader.release(self.texture, *self.buffers)


def table_texture(ctx: moderngl.Context, size: tuple[int, int, int]) -> moderngl.TextureArray:
    """A texture of tables (width, stacked rows, layers), read texel by texel."""
    texture = ctx.texture_array(size, 4, dtype="f4")
    texture.filter = (ctx.NEAREST, ctx.NEAREST)
    texture.repeat_x = texture.repeat_y = False
    return texture


def _by_target(values: np.ndarray, targets: int) -> np.ndarray:
    """(n, 4 targets) -> (targets, n, 4)."""
    return values.reshape(len(values), targets, 4).transpose(1, 0, 2)


_KEPT_BYTES = 24 << 20
"""Bytes of blurred spectra, at most, that are kept for the next plan with the same bands."""
_blurred: dict[tuple[object, ...], tuple[np.ndarray, np.ndarray, np.ndarray]] = {}


def forget_blurred() -> None:
    """Blur every spectrum anew, as a new process does."""
    _blurred.clear()
    _kernels.cache_clear()


@dataclass(frozen=True)
class FoldedSpectrum:
    """One light under one reflectance: a running integral without its lines, and the lines."""

    smooth: CumulativeSpectrum
    line_x: np.ndarray
    line_energy: np.ndarray
    """float64 (lines, columns)."""
    brightness: slice
    """Columns that say where in a band its light is: Y, or all bins."""

    @classmethod
    def of(
        cls, axis: SpectralAxis, light: Spectrum, reflectance: np.ndarray | None, channels: MapChannels
    ) -> FoldedSpectrum:
        folded = np.ones(401) if reflectance is None else np.asarray(reflectance, np.float64)
        smooth = cumulative(axis, Spectrum(light.density * folded), channels.cell_weights())
        line_nm, power = np.array(light.lines, np.float64).reshape(-1, 2).T
        weights = channels.line_weights(line_nm)
        energy = (power * np.interp(line_nm, VISIBLE_NM, folded))[:, None] * weights
        return cls(
            smooth,
            np.atleast_1d(axis.x_of_nm(line_nm)),
            energy,
            slice(1, 2) if channels.edges_nm is None else slice(None),
        )

    def cumulative(self, x: np.ndarray) -> np.ndarray:
        """Energy up to and with each x: (n, columns)."""
        steps = (self.line_x[None, :] <= x[:, None]).astype(np.float64) @ self.line_energy
        return self.smooth.at(x) + steps

    def density(self) -> np.ndarray:
        """Mean energy per unit of x in each cell: (cells, columns)."""
        edges = np.linspace(0.0, 1.0, DENSITY_CELLS + 1)
        cell = np.minimum((self.line_x * DENSITY_CELLS).astype(int), DENSITY_CELLS - 1)
        energy = np.diff(self.smooth.at(edges), axis=0)
        np.add.at(energy, cell, self.line_energy)
        return energy * DENSITY_CELLS

    def blurred(self, edges: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """T for each row: (rows, width, bands · columns); energies, their mean places and standard deviations (bands,
        3, columns); mean places of what is bright (bands,).

        The last few are kept: in a viewer the same light is cut into the same bands again and again."""
        parts = (self.smooth.at(np.linspace(0.0, 1.0, FINEST + 1)), self.line_x, self.line_energy, edges)
        key = (width, *(part.tobytes() for part in parts))
        if key not in _blurred:
            _blurred[key] = self._blur(edges, width)
            while len(_blurred) > 1 and sum(table.nbytes for table, *_ in _blurred.values()) > _KEPT_BYTES:
                _blurred.pop(next(iter(_blurred)))
        return _blurred[key]

    def _blur(self, edges: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        columns = self.line_energy.shape[1]
        lo, hi = edges[:, :1], edges[:, 1:]
        lines = self._lines_of_bands(edges)
        x = lo + (hi - lo) * np.linspace(0.0, 1.0, FINEST + 1)
        finest = np.diff(self.smooth.at(x), axis=1).transpose(1, 0, 2)
        masses = {
            n: finest.reshape(n, -1, finest[0].size).sum(axis=1).astype(np.float32)
            for n in {cells_of_row(s) for s in SIGMAS}
        }
        kernels = _kernels(width)
        rows = np.empty((len(SIGMAS), width, finest[0].size), np.float32)
        for row, sigma in zip(rows, SIGMAS, strict=True):
            cells = cells_of_row(sigma)
            np.matmul(kernels[cells, float(sigma)], masses[cells], out=row)
            for band, place, energy in lines:
                row[:, band * columns : (band + 1) * columns] += (
                    _kernel(width, sigma, np.array([place]), sigma) * energy
                )
        energies = finest.sum(axis=0)
        places = (np.arange(len(finest)) + 0.5) / len(finest)
        first, second = np.tensordot(places, finest, axes=1), np.tensordot(places**2, finest, axes=1)
        for band, place, energy in lines:
            energies[band] += energy
            first[band] += place * energy
            second[band] += place**2 * energy
        middles = _mean(first, energies, 0.5)
        spreads = np.sqrt(np.maximum(_mean(second, energies, 0.25) - middles**2, 0.0))
        bright = _mean(first[:, self.brightness].sum(axis=1), energies[:, self.brightness].sum(axis=1), 0.5)
        return rows, np.stack([energies, middles, spreads], axis=1), bright

    def _lines_of_bands(self, edges: np.ndarray) -> list[tuple[int, float, np.ndarray]]:
        """(band, place in it, energy) of each line in each band, ends (lo, hi] so that none counts twice."""
        found = []
        for band, (lo, hi) in enumerate(edges):
            for x, energy in zip(self.line_x, self.line_energy, strict=True):
                if hi - lo < 1e-9:
                    if abs(x - lo) < 1e-6:
                        found.append((band, 0.5, energy))
                elif lo < x <= hi or (x == 0.0 and lo == 0.0):
                    found.append((band, (x - lo) / (hi - lo), energy))
        return found


def _mean(moments: np.ndarray, energies: np.ndarray, dark: float) -> np.ndarray:
    """`dark` where there is no energy."""
    lit = energies > 0.0
    return np.where(lit, moments / np.where(lit, energies, 1.0), dark)


@lru_cache(maxsize=256)
def cells_of_row(sigma: float) -> int:
    """Cells of a band, a power of two, each at most a quarter of a standard deviation wide (then they add up to 1 % to
    the variance) unless the spectrum itself is no finer."""
    return int(min(FINEST, max(8, 2 ** np.ceil(np.log2(4.0 / sigma)))))


@lru_cache(maxsize=2)
def _kernels(width: int) -> dict[tuple[int, float], np.ndarray]:
    """(cells, sigma) -> (width, cells): what a unit of energy in each cell of a band gives at each xi.

    A cell represents a uniform density over it: a Gaussian at its middle with the cell's variance added.
    The same for all spectra.
    """
    kernels = {}
    for sigma in SIGMAS:
        cells = cells_of_row(sigma)
        places = (np.arange(cells) + 0.5) / cells
        kernels[cells, float(sigma)] = _kernel(
            width, sigma, places.astype(np.float32), np.sqrt(sigma**2 + 1.0 / (12.0 * cells**2))
        )
    return kernels


def _kernel(width: int, sigma: float, places: np.ndarray, blur: float) -> np.ndarray:
    """Gaussians of standard deviation `blur` about `places`, over xi of the row `sigma`, each of unit integral."""
    xi = ((2.0 * np.arange(width) + 1.0) / width - 1.0).astype(places.dtype)
    distance = (0.5 + float(0.5 + CUT * sigma) * xi[:, None] - places) / float(blur)
    kernel = np.exp(-0.5 * distance * distance)
    integral = kernel.sum(axis=0) * (2.0 / width)
    return kernel / integral
