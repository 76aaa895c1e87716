"""Questions about the stored photons: what lands near a place, from where, and in which colours."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ...edit.stored_photons import StoredPhotons
from ...model.features import is_flat
from .invalidation import shown_glasses

if TYPE_CHECKING:
    from ...edit.live_inputs import LiveInputs
    from .live_light import LiveLight

NO_OBJECT = 0xFFFF


def world_photons(light: LiveLight, inputs: LiveInputs, limit: int) -> StoredPhotons:
    """About `limit` stored records of `light`, as `inputs` shows them (without the brush's local gain)."""
    records = light.stored_records(limit)
    buffers = light.buffers
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


def caustic_spectrum(
    photons: StoredPhotons,
    receiver: int,
    position: np.ndarray,
    radius: float,
    spectra: list[np.ndarray],
    bins: int = 40,
) -> tuple[np.ndarray, np.ndarray]:
    """Shape of the spectrum that lands within `radius` of a world `position` on object `receiver`.

    `spectra`: each light's density (401,) on the visible grid. Returns bin centres (bins,) in nm and relative
    irradiance (bins,), its largest 1 (all 0 where nothing lands).
    """
    edges = np.linspace(380.0, 780.0, bins + 1)
    centres = 0.5 * (edges[:-1] + edges[1:])
    mine = np.flatnonzero(photons.receiver == receiver)
    power = np.zeros(bins)
    if not len(mine):
        return centres, power
    ends = np.array([380.0, 780.0])
    reach = (
        np.linalg.norm(np.diff(photons.chosen(mine).landing(ends), axis=1)[:, 0], axis=1)
        if photons.variables
        else np.zeros(len(mine))
    )
    near = mine[np.linalg.norm(photons.position[mine] - position, axis=1) <= radius + reach]
    if not len(near):
        return centres, power
    places = photons.chosen(near).landing(centres)
    inside = np.linalg.norm(places - position, axis=2) <= radius
    low, high = photons.band_nm.min(axis=1)[near, None], photons.band_nm.max(axis=1)[near, None]
    # Share of each bin that the photon's band covers; a band narrower than a bin stands for a line.
    covered = np.clip(np.minimum(high, edges[1:]) - np.maximum(low, edges[:-1]), 0.0, None) / (edges[1] - edges[0])
    lines = (high - low)[:, 0] < 1e-6
    covered[lines] = (low[lines] >= edges[:-1]) & (low[lines] < edges[1:])
    density = np.array([np.interp(centres, np.arange(380.0, 781.0), spectrum) for spectrum in spectra])[
        photons.light[near]
    ]
    in_band = np.maximum((covered * density).sum(axis=1, keepdims=True), 1e-300)
    share = np.where(lines[:, None], covered, covered * density / in_band)
    power = (photons.flux_w[near, None] * share * inside).sum(axis=0)
    return centres, power / max(power.max(), 1e-300)


def reach_of(light: LiveLight, receiver: int) -> float:
    """Radius that still gathers a few footprints on object `receiver`: some texels of its finest map, world units."""
    index = light.buffers.receivers.index(receiver)
    area = float(
        light.light_pass.layout.placements["texel_area"][light.light_pass.layout.receivers[index]["placement"]]
    )
    return (4.0 if is_flat(light.light_pass.scene.objects[receiver]) else 6.0) * area**0.5
