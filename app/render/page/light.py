"""The light of a page: stored photons and beams' polygons of one flat receiver, in coordinates of its plane.

Both own intervals of one spectral coordinate x, 0 to 1. Where one glass disperses, x is affine in its index: what lands
where depends on the index alone, and another dispersion moves wavelengths along x (docs/pages.md).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.errors import UserError
from ...gpu.records import EDGE_BIT, LATTICE_BIT
from ...gpu.spectral_groups import samples_of
from ...model.optics.colorimetry import VISIBLE_NM
from ...passes.plane_frame import PlaneFrame, plane_frame

if TYPE_CHECKING:
    from ..viewer.live_light import LiveLight
    from .spectra import Glasses

_LIT = 0.8
"""Share along either axis of what views from above and all round begin with."""
_MOST = 6e4
"""Of columns: what half floats hold. Longer ones are shortened; where one is no number, light falls on a point."""
_FINER_BEAMS = 4.0
"""Times as many photons whose time beams may take where they carry all light."""
_MOST_EDGES = 140_000
"""Of polygons: 8 MB on a page, about."""


@dataclass(frozen=True)
class PageLight:
    """What lands on one receiver."""

    arrays: dict[str, np.ndarray]
    """By the names of docs/pages.md."""
    head: dict[str, Any]
    frame: PlaneFrame
    """Of the receiver's plane, GPU space."""
    item: int
    """The receiver in the scene's objects."""


def page_light(light: LiveLight, receiver: int, glasses: Glasses) -> PageLight:
    """The light of `light`, traced through `glasses.traced`, on receiver number `receiver`. Raises `UserError` where
    there is none."""
    buffers = light.buffers
    item = buffers.receivers[receiver]
    frame = plane_frame(buffers.space.to_gpu(buffers.world_meshes[item].vertices))
    nm, samples = samples_of(buffers.axis)
    arrays: dict[str, np.ndarray] = {"nm": nm.astype("f4"), "variable": buffers.variables.astype("f4")}
    head: dict[str, Any] = {"mode": "wavelength"}
    page_x = samples
    if glasses.traced is not None:
        first, last = glasses.traced.index(VISIBLE_NM[[0, -1]])
        head = {"mode": "index", "n_at_0": float(first), "n_at_1": float(last)}
        page_x = (buffers.variables[0] - first) / (last - first)

    def to_page(x: np.ndarray) -> np.ndarray:
        return np.interp(x, samples, page_x)

    photons = _photons(light, receiver, frame, to_page)
    beams, flux = _beams(light, receiver, frame, to_page)
    if not len(photons["x"]) and not len(beams["x"]):
        name = light.light_pass.scene.objects[item].name
        raise UserError(f"no caustic falls on '{name}': choose another receiver, or aim a light at glass near it")
    head["lit"] = _lit(photons, beams, flux)
    unit = float(photons["throughput"].max(initial=0.0)) or 1.0
    photons["throughput"] = (photons["throughput"] / unit).astype("f2")
    photons["x"] = np.rint(np.clip(photons["x"], 0.0, 1.0) * 65535.0).astype("u2")
    head["photons"] = {"unit": unit, "smoothing": light.light_pass.smoothing}
    arrays |= {f"photons.{name}": values for name, values in photons.items()}
    if len(beams["x"]):
        arrays |= {f"beams.{name}": values for name, values in beams.items()}
    head["plane"] = {
        "origin": buffers.space.to_world(frame.origin).tolist(),
        "u": frame.axes[0].tolist(),
        "v": frame.axes[1].tolist(),
    }
    return PageLight(arrays, head, frame, item)


def beams_alone(light: LiveLight, photons: int) -> Iterator[None]:
    """Find the beams again: all of them, as weak ones that photons carried on are not stored; more where no photons
    are, but no more than a page has room for."""
    found, finer = light.light_pass.survey, _FINER_BEAMS if light.only_beams else 1.0
    while found.beams is not None:
        yield from light.light_pass.beam_steps_again(finer * photons)
        polygons = found.beams.found.polygons if found.beams.found is not None else None
        if finer <= 1.0 or polygons is None or len(polygons.edges) <= _MOST_EDGES:
            return
        finer *= 0.5


def landed(light: LiveLight, receiver: int) -> float:
    """Light that lands on a receiver, about, by photons and polygons."""
    beams, weights = light.light_pass.survey.beams, light.buffers.light_power
    watts = np.array([float(power.band(0.0, 1.0)[3]) for power in weights])
    total = 0.0
    if (stored := light.stored.fullest) is not None:
        records = stored.store.read(1 << 16, light.light_pass.trace.photon)
        mine = records[records["receiver"] == receiver]
        total += float(mine["flux_w"].sum()) / max(stored.pass_photons * stored.store.some(1 << 16)[2], 1e-300)
    if beams is not None and beams.found is not None and beams.found.polygons is not None:
        polygons = beams.found.polygons
        total += float((polygons.flux * watts[polygons.light])[polygons.receiver == receiver].sum())
    return total


def _photons(light: LiveLight, receiver: int, frame: PlaneFrame, to_page: Any) -> dict[str, np.ndarray]:
    stored, photon = light.stored.fullest, light.light_pass.trace.photon
    records = photon.zeros(0) if stored is None else stored.store.read(1 << 30, photon)
    records = records[records["receiver"] == receiver]
    scale, groups = light.buffers.space.scale, light.buffers.groups.count
    weight = 1.0 if stored is None else stored.pass_photons * stored.store.rounds / stored.store.rounds_of_pass

    names = ["dposition_ds", "dposition_dt", *(f"dposition_dvar{g}" for g in range(groups))]
    columns = np.stack([records[name][:, :3].astype(float) @ frame.axes.T / scale for name in names], axis=1)
    columns[~np.isfinite(columns).all(axis=(1, 2))] = 0.0
    columns *= _MOST / np.maximum(np.abs(columns).max(axis=2, keepdims=True), _MOST)
    return {
        "position": (frame.project(records["position"].astype(float)) / scale).astype("f4"),
        "axis_s": columns[:, 0].astype("f2"),
        "axis_t": columns[:, 1].astype("f2"),
        "dposition_dn": columns[:, 2:].astype("f2"),
        "x": to_page(np.stack([records[name] for name in ("x_lo", "x_anchor", "x_hi")], axis=1)),
        "throughput": records["throughput"].astype(float) / max(weight, 1e-300),
        "light": (records["light_and_source"] & 255).astype("u1"),
        "lattice": (records["flags"] >> LATTICE_BIT).astype("u4"),
        "edge": (records["depth"] >> EDGE_BIT).astype("u4"),
        "fan": np.ascontiguousarray(records["fan"]).view("f2").reshape(-1, 2),
    }


def _beams(
    light: LiveLight, receiver: int, frame: PlaneFrame, to_page: Any
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Polygons, and the light that each holds, relative."""
    beams = light.light_pass.survey.beams
    polygons = None if beams is None or beams.found is None else beams.found.polygons
    if polygons is None:
        return {"x": np.zeros((0, 2))}, np.zeros(0)
    assert beams is not None
    own, scale = beams.frames[receiver], light.buffers.space.scale
    assert np.allclose(own.axes, frame.axes), "beams lie in the frame of their receiver"
    polygons = polygons.where(polygons.receiver == receiver)
    shift = (own.origin - frame.origin) @ frame.axes.T
    edges = polygons.edges.copy().reshape(-1, 2, 4)
    edges[..., 2] -= edges[..., :2] @ shift
    edges[..., 2:] /= scale
    found = {
        "x": to_page(np.stack([polygons.x_lo, polygons.x_hi], axis=1)).astype("f4"),
        "density": polygons.density.astype("f4"),
        "slope": (polygons.slope * scale).astype("f4"),
        "centre": ((polygons.centre + shift) / scale).astype("f4"),
        "light": polygons.light.astype("u1"),
        "first": polygons.edge_start.astype("u4"),
        "edge": edges.reshape(-1, 8).astype("f4"),
        "hull_first": polygons.hull_start.astype("u4"),
        "hull": ((polygons.hulls + shift) / scale).astype("f4"),
    }
    return found, polygons.flux


def _lit(photons: dict[str, np.ndarray], beams: dict[str, np.ndarray], flux: np.ndarray) -> dict[str, Any]:
    """`centre` of where most light falls, and how far it is `across`, somewhat more; `flux`: of each polygon."""
    places = [photons["position"].astype(float)]
    weights = [photons["throughput"][:, 1] * (photons["x"][:, 2] - photons["x"][:, 0])]
    if len(flux):
        counts = np.diff(beams["hull_first"].astype(int))
        places.append(beams["hull"].astype(float))
        weights.append(np.repeat(flux / np.maximum(counts, 1), counts))
    place, weight = np.concatenate(places), np.concatenate([w / max(float(w.sum()), 1e-300) for w in weights])
    ends = np.zeros((2, 2))
    for k, along in enumerate(place.T):
        order = np.argsort(along)
        running = np.cumsum(weight[order])
        ends[:, k] = np.interp(running[-1] * np.array([0.5 - 0.5 * _LIT, 0.5 + 0.5 * _LIT]), running, along[order])
    across = max(float(np.ptp(ends, axis=0).max()), 0.02 * float(np.ptp(place, axis=0).max()), 1e-9)
    return {"centre": ends.mean(axis=0).tolist(), "across": 1.5 * across}
