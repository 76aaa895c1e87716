"""Queries of the stored photons: what lands near a place, from where, and in which colours."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...edit.live_inputs import LiveInputs
from ...edit.stored_photons import StoredPhotons
from ...model.optics.spectrum import Spectrum
from ...passes.landings import faces_camera
from .invalidation import shown_glasses
from .live_light import LiveLight

NO_OBJECT = 0xFFFF
QUERIED_PHOTONS = 200_000
"""Stored photons by which it is found what lands under the cursor."""
FINEST_BINS = 40
"""Each of 10 nm."""
MOST_ERROR = 0.2
"""Largest error of a bin that is reported."""


def world_photons(light: LiveLight, inputs: LiveInputs, limit: int) -> StoredPhotons:
    """About `limit` stored records of `light`, as `inputs` shows them (without the brush's local gain): of flat
    receivers those on the side that its camera looks at."""
    records, buffers = light.stored_records(limit), light.buffers
    objects = light.light_pass.scene.objects
    shown = [
        not objects[i].mesh.is_flat or faces_camera(inputs.camera, buffers, r) for r, i in enumerate(buffers.receivers)
    ]
    records = records[np.array(shown, bool)[records["receiver"].astype(int)]]
    space, axis, groups = buffers.space, buffers.axis, buffers.groups
    glasses = shown_glasses(light.light_pass.scene, inputs.scene) or {}
    samples = np.linspace(0.0, 1.0, buffers.variable_table.shape[1]) if groups.count else np.zeros(0)
    # Where glasses share a group its variable is no index, and the glass that is shown is the one that was traced.
    alone = [
        glass
        for g in range(groups.count)
        for glass, owner in zip(groups.glasses, groups.group, strict=True)
        if owner == g
    ]
    is_index = len(alone) == groups.count and not groups.by_wavelength

    def variable_of(g: int) -> Callable[[np.ndarray], np.ndarray]:
        if is_index:
            return glasses.get(alone[g], alone[g]).index
        row = buffers.variable_table[g].astype(float)
        return lambda nm: np.interp(axis.x_of_nm(nm), samples, row)

    columns = [records[f"dposition_dvar{g}"][:, :3].astype(float) / space.scale for g in range(groups.count)]
    anchors = [np.interp(records["x_anchor"], samples, buffers.variable_table[g]) for g in range(groups.count)]
    source = (records["light_and_source"] >> 16).astype(int)
    owner = {
        i: groups.group[groups.glasses.index(item.material.dispersion)]
        for i, item in enumerate(light.light_pass.scene.objects)
        if item.material.transmits and groups.count and item.material.dispersion in groups.glasses
    }
    return StoredPhotons(
        space.to_world(records["position"].astype(float)),
        np.stack(columns, axis=1) if columns else np.zeros((len(records), 0, 3)),
        np.stack(anchors, axis=1) if anchors else np.zeros((len(records), 0)),
        records["flux_w"].astype(float),
        np.where(source == NO_OBJECT, -1, source),
        np.array(buffers.receivers, int)[records["receiver"].astype(int)],
        np.stack([axis.nm_of_x(records["x_lo"].astype(float)), axis.nm_of_x(records["x_hi"].astype(float))], axis=1),
        (records["light_and_source"] & 255).astype(int),
        tuple(variable_of(g) for g in range(groups.count)),
        owner,
    )


@dataclass(frozen=True)
class CausticSpectrum:
    """What the photons near a place say of the light there."""

    wavelength_nm: np.ndarray
    """(bins,) centres, evenly spaced."""
    irradiance: np.ndarray | None
    """(bins,) W/(unit² nm); None where too few photons landed to say. Zeros where next to none should have."""
    error: float
    """Standard error of one bin over its irradiance, the mean over the light; 0 without any."""

    @property
    def resolution_nm(self) -> float:
        """Width of a bin."""
        return float(self.wavelength_nm[1] - self.wavelength_nm[0])


def spectrum_at(light: LiveLight, shown: LiveInputs, receiver: int, position: np.ndarray) -> CausticSpectrum:
    """The caustic's spectral irradiance at a world `position` on object `receiver`, as `shown` shows the photons of
    `light`, which receives there."""
    then, now = ([each.spectral_power for each in s.lights] for s in (light.light_pass.scene, shown.scene))
    photons, weight = world_photons(light, shown, QUERIED_PHOTONS), light.stored_weight(QUERIED_PHOTONS)
    return caustic_spectrum(photons, weight, receiver, position, reach_of(light, receiver), then, now)


def caustic_spectrum(
    photons: StoredPhotons,
    weight: float,
    receiver: int,
    position: np.ndarray,
    radius: float,
    traced: Sequence[Spectrum],
    shown: Sequence[Spectrum],
) -> CausticSpectrum:
    """The spectral irradiance of the caustic at a world `position` on object `receiver`.

    Photons within `radius` count, or within up to four times as much where they are few; what is still too noisy in
    bins of 10 nm is given in bins of 20 or 40 nm, and what is too noisy in those is not given. `weight`: what the
    photons' `flux_w` is power times. `traced`, `shown`: each light's spectrum then and now.
    """
    found = None
    flux, distance = _around(photons, receiver, position, 4.0 * radius, traced, shown)
    for reach in (radius, 2.0 * radius, 4.0 * radius):
        counted = flux * (distance <= reach)
        sums = np.stack([counted.sum(axis=0), (counted**2).sum(axis=0)])
        area = math.pi * reach**2 * max(weight, 1e-300)
        for bins in (FINEST_BINS, FINEST_BINS // 2, FINEST_BINS // 4):
            merged = sums.reshape(2, bins, -1).sum(axis=2)
            edges = np.linspace(380.0, 780.0, bins + 1)
            centres, width = 0.5 * (edges[:-1] + edges[1:]), 400.0 / bins
            total = float(merged[0].sum())
            error = float(np.sqrt(merged[1]).sum()) / total if total > 0.0 else 0.0
            if total > 0.0 and error < MOST_ERROR:
                return CausticSpectrum(centres, merged[0] / (area * width), error)
        if total > 0.0:
            found = CausticSpectrum(centres, None, error)
    return found or CausticSpectrum(centres, np.zeros(len(centres)), 0.0)


def _around(
    photons: StoredPhotons,
    receiver: int,
    position: np.ndarray,
    radius: float,
    traced: Sequence[Spectrum],
    shown: Sequence[Spectrum],
) -> tuple[np.ndarray, np.ndarray]:
    """Photons that come within `radius`: flux in each of the finest bins and how far off, (n, FINEST_BINS) each."""
    edges = np.linspace(380.0, 780.0, FINEST_BINS + 1)
    centres = 0.5 * (edges[:-1] + edges[1:])
    mine = np.flatnonzero(photons.receiver == receiver)
    ends = np.array([380.0, 780.0])
    reach = (
        np.linalg.norm(np.diff(photons.chosen(mine).landing(ends), axis=1)[:, 0], axis=1)
        if photons.variables and len(mine)
        else np.zeros(len(mine))
    )
    near = mine[np.linalg.norm(photons.position[mine] - position, axis=1) <= radius + reach]
    if not len(near):
        return np.zeros((0, FINEST_BINS)), np.zeros((0, FINEST_BINS))
    distance = np.linalg.norm(photons.chosen(near).landing(centres) - position, axis=2)
    low, high = photons.band_nm.min(axis=1)[near, None], photons.band_nm.max(axis=1)[near, None]
    # Share of each bin that the photon's band covers; a band narrower than a bin represents a line.
    covered = np.clip(np.minimum(high, edges[1:]) - np.maximum(low, edges[:-1]), 0.0, None) / (edges[1] - edges[0])
    lines = (high - low)[:, 0] < 1e-6
    covered[lines] = (low[lines] >= edges[:-1]) & (low[lines] < edges[1:])
    light = photons.light[near]
    before, now = (np.array([each.binned(edges, False) for each in spectra])[light] for spectra in (traced, shown))
    brighter = np.array([_ratio(now.power_w(), then.power_w()) for now, then in zip(shown, traced, strict=True)])
    in_band = np.maximum((covered * before).sum(axis=1, keepdims=True), 1e-300)
    share = np.where(lines[:, None], covered * brighter[light, None], covered * now / in_band)
    return photons.flux_w[near, None] * share, distance


def _ratio(now: float, then: float) -> float:
    return now / then if then > 0.0 else 0.0


def reach_of(light: LiveLight, receiver: int) -> float:
    """Radius that still gathers a few footprints on object `receiver`: some texels of its finest map, world units."""
    layout, front = light.light_pass.layout, light.buffers.receivers.index(receiver)
    area = float(layout.placements["texel_area"][layout.receivers["placement"][front : front + 2]].min())
    return (4.0 if light.light_pass.scene.objects[receiver].mesh.is_flat else 6.0) * area**0.5
