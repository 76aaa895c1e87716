"""The light of a page: stored photons and beams' polygons of one flat receiver, in coordinates of its plane.

Both own intervals of one spectral coordinate x, 0 to 1. Where one glass disperses, x is affine in its index: what lands
where depends on the index alone, and another dispersion moves wavelengths along x (docs/pages.md).
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np

from ...base.errors import UserError
from ...beams.polygons import BeamPolygons
from ...gpu.context import Context
from ...gpu.packed_records import read_records
from ...gpu.records import EDGE_BIT, LATTICE_BIT, photon_record_of
from ...gpu.schema import Struct
from ...gpu.spectral_groups import samples_of
from ...model.optics.colorimetry import VISIBLE_NM
from ...model.scene import Scene
from ...model.settings import RenderSettings
from ...passes.map_layout import LIVE
from ...passes.plane_frame import PlaneFrame, plane_frame
from ...passes.trace import Batch
from ..device_scene import scene_buffers
from ..light_pass import LightPass
from ..map_fit import MapFit
from ..photon_records import NoRecords, RoundOf
from .spectra import Glasses

_LIT = 0.8
"""Share along either axis of what views from above and all round begin with."""
_FINER_BEAMS = 4
"""Times as many photons whose time is taken where beams carry all but what is weak."""
_MOST = 6e4
"""Longest column: what half floats hold. Longer ones are shortened; where one is no number, light falls on a point."""


@dataclass(frozen=True)
class PageLight:
    """What lands on one receiver."""

    arrays: dict[str, np.ndarray]
    """By the names of docs/pages.md."""
    head: dict[str, Any]
    frame: PlaneFrame
    """The receiver's plane, GPU space."""
    item: int
    """The receiver in the scene's objects."""


class _Read(NoRecords):
    """`PhotonRecords` of a pass, read back. Photons that carry on weak beams are taken, since the same change of index
    moves them and the polygons of strong ones."""

    keeps = takes_tails = True

    def __init__(self, photon: Struct) -> None:
        super().__init__()
        self._photon = photon
        self._read = [photon.zeros(0)]

    def keep(self, photons: moderngl.Buffer, batch: Batch, stride: int, of: RoundOf) -> None:
        """Read the batch."""
        self._read.append(read_records(self._photon, photons, batch.photons))

    @property
    def records(self) -> np.ndarray:
        """All that were kept."""
        return np.concatenate(self._read)


class TracedLight:
    """The light of one pass: the photons and the polygons that it is made of. Owns the scene's buffers as well."""

    def __init__(self, context: Context, scene: Scene, settings: RenderSettings) -> None:
        """`settings` with a number of photons."""
        self.scene, self._seed, self.photons = scene, settings.seed, settings.photons or 1
        self.buffers = scene_buffers(context, scene, settings)
        features = self.buffers.features
        self._read = _Read(photon_record_of(features, context.traits.packs_records))
        fit = MapFit(scene.camera, settings.width, settings.height, LIVE)
        self.light_pass = LightPass(
            context, scene, settings, features, self.buffers, fit=fit, photon_records=self._read
        )

    def steps(self) -> Generator[float]:
        """Trace it, pausing with the share done."""
        for _ in self.light_pass.preparing():
            yield 0.0
        if self.light_pass.survey.only_beams:
            self.photons *= _FINER_BEAMS
        self.light_pass.begin(self.photons, self._seed)
        for step in self.light_pass.pass_steps(0, self.photons):
            yield step.fraction

    def photons_on(self, receiver: int) -> np.ndarray:
        """Records (`gpu.records.photon_record_of`) on a receiver; their flux is power times the pass's photons."""
        return self._read.records[self._read.records["receiver"] == receiver]

    def polygons_on(self, receiver: int) -> BeamPolygons | None:
        """Those of beams on a receiver; None without beams."""
        beams = self.light_pass.survey.beams
        if beams is None or beams.found is None or beams.found.polygons is None:
            return None
        return beams.found.polygons.where(beams.found.polygons.receiver == receiver)

    def landed(self, receiver: int) -> float:
        """W on a receiver."""
        total, polygons = float(self.photons_on(receiver)["flux_w"].sum()), self.polygons_on(receiver)
        total /= self.photons
        watts = np.array([float(power.band(0.0, 1.0)[3]) for power in self.buffers.light_power])
        return total + (0.0 if polygons is None else float((polygons.flux * watts[polygons.light]).sum()))

    def release(self) -> None:
        """Free everything."""
        self.light_pass.release()
        self.buffers.release()


def page_light(light: TracedLight, receiver: int, glasses: Glasses) -> PageLight:
    """What `light`, traced through `glasses.traced`, holds on receiver number `receiver`. Raises `UserError` where that
    is nothing."""
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
        name = light.scene.objects[item].name
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


def _photons(light: TracedLight, receiver: int, frame: PlaneFrame, to_page: Any) -> dict[str, np.ndarray]:
    records = light.photons_on(receiver)
    scale, groups = light.buffers.space.scale, light.buffers.groups.count
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
        "throughput": records["throughput"].astype(float) / light.photons,
        "light": (records["light_and_source"] & 255).astype("u1"),
        "lattice": (records["flags"] >> LATTICE_BIT).astype("u4"),
        "edge": (records["depth"] >> EDGE_BIT).astype("u4"),
        "fan": np.ascontiguousarray(records["fan"]).view("f2").reshape(-1, 2),
    }


def _beams(
    light: TracedLight, receiver: int, frame: PlaneFrame, to_page: Any
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Polygons, and the light that each holds, relative."""
    polygons, beams = light.polygons_on(receiver), light.light_pass.survey.beams
    if polygons is None or beams is None:
        return {"x": np.zeros((0, 2))}, np.zeros(0)
    own, scale = beams.frames[receiver], light.buffers.space.scale
    assert np.allclose(own.axes, frame.axes), "beams lie in the frame of their receiver"
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
