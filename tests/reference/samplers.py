"""Float64 references of the shaders' samplers: mirrored lattices, radical inverses, wavelengths by their density."""

from __future__ import annotations

import numpy as np
from spectrasplat.model.optics.colorimetry import VISIBLE_NM, cmf_xyz
from spectrasplat.model.optics.spectral_tables import SpectralAxis
from spectrasplat.model.optics.spectrum import Spectrum, cmf_at
from spectrasplat.reference.emission import Array, lattice_point
from spectrasplat.reference.random_numbers import unit_float


def mirrored_lattice_point(i: Array, count: int, shift: tuple[Array | int, Array | int]) -> Array:
    """Point i of `count`: even ones are a lattice in the left half of the unit square, each odd one is the mirror image
    in the square's middle of the one before it."""
    i = np.asarray(i)
    unit = lattice_point(i // 2, (count + 1) // 2, shift) * (0.5, 1.0)
    return np.where(i[..., None] % 2 == 0, unit, 1.0 - unit)


def radical_inverse(i: Array | int, shift: Array | int) -> Array:
    """The binary digits of i mirrored at the point, those of `shift` added without carry."""
    word = np.asarray(i).astype(np.uint64)
    mirrored = np.zeros_like(word)
    for bit in range(32):
        mirrored = mirrored | ((word >> np.uint64(bit) & np.uint64(1)) << np.uint64(31 - bit))
    return unit_float(mirrored ^ np.asarray(shift).astype(np.uint64))


def drawn_wavelengths(
    spectrum: Spectrum,
    axis: SpectralAxis,
    band: tuple[float, float],
    place: np.ndarray,
    cells: int = 1024,
    by_power: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Reference of lib/wavelength.glsl: random wavelengths in `band`, as (spectral coordinate x, one over its density).

    They are sampled by the random numbers `place` (...,) in [0, 1), with a density that is 0.6 of X + Y + Z, 0.2 of
    radiant power and 0.2 uniform over the light's support; with `by_power` 0.8 of radiant power and 0.2 uniform. The
    density is constant in each of `cells` equal cells of x."""
    borders = np.linspace(0.0, 1.0, cells + 1)
    nm = np.concatenate([[380.0], VISIBLE_NM[:-1] + 0.5, [780.0]])
    lo_nm, hi_nm = spectrum.support_nm()
    start, end = axis.x_of_nm(np.array([lo_nm - 0.5, hi_nm + 0.5]))
    even = np.maximum(np.minimum(borders[1:], end) - np.maximum(borders[:-1], start), 0.0)

    def in_cells(per_nm: np.ndarray, line_weights: np.ndarray) -> np.ndarray:
        mass = np.diff(np.interp(borders, axis.x_of_nm(nm), np.concatenate([[0.0], np.cumsum(per_nm)])))
        for (line_nm, power), weight in zip(spectrum.lines, line_weights, strict=True):
            at = np.clip(np.ceil(float(axis.x_of_nm(line_nm)) * cells) - 1, 0, cells - 1)
            mass[int(at)] += power * weight
        return mass / mass.sum() if mass.sum() > 0.0 else even / even.sum()

    line_nm = np.array([wavelength for wavelength, _ in spectrum.lines])
    watt = in_cells(spectrum.density, np.ones(len(line_nm)))
    seen = in_cells(spectrum.density * cmf_xyz().sum(axis=1), cmf_at(line_nm).reshape(-1, 3).sum(axis=1))
    share = (0.8 * watt if by_power else 0.6 * seen + 0.2 * watt) + 0.2 * even / even.sum()
    cumulative = np.concatenate([[0.0], np.cumsum(share)])
    below, above = np.interp(band, borders, cumulative)
    wanted = below + np.asarray(place, np.float64) * (above - below)
    cell = np.clip(np.searchsorted(cumulative, wanted, side="right") - 1, 0, cells - 1)
    x = borders[cell] + (wanted - cumulative[cell]) / (share[cell] * cells)
    return x, (above - below) / (share[cell] * cells)
