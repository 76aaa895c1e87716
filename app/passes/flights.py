"""Paths of light outside glass, stretch by stretch: what haze shows of it.

Photons of their own are traced for that, on lattices like all others, whatever carries the light of surfaces: few are
enough, because each is drawn as a whole beam. Light that meets glass or a mirror first has the photons that its domain
has elsewhere, in narrow bands; all other light flies one stretch, in one band.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..features.features import Features
from ..gpu.context import Context
from ..gpu.gpu_space import GpuSpace
from ..gpu.records import FLIGHT, MAX_BANDS
from ..gpu.scene_buffers import SceneBuffers
from ..model.optics.spectral_tables import SpectralAxis, cumulative
from ..model.scene import Scene
from ..model.settings import RenderSettings
from .emission_domain import EmissionDomain, emission_domain
from .lattice_slice import Band, LatticeSlice, every
from .ray_queue import FLIGHT_ROOM
from .trace import Batch, TracePass

PHOTONS = 1 << 15
"""Photons of all lights together that meet glass or a mirror first."""
DIRECT_SHARE, DIRECT_SHARE_OF_EXTENT = 1 / 8, 1 / 32
"""Times as many that do not; of a light with extent, whose haze has soft borders anyway. Their beams are broad, and so
cost the more to draw."""
BANDS = MAX_BANDS
"""Where something disperses: neighbours in a prism's fan cannot be distinguished then."""
PLAIN_BANDS = 4
"""Elsewhere: tints differ over the spectrum."""
LIGHT_POINTS = 16
"""On a light with extent."""
MOST_EVENTS = 16
"""Events of a path: what comes after them is faint."""
SPLIT_THRESHOLD = 0.002
"""Share of a photon's power below which roulette decides, whose survivors would be seen as needles."""
FAINT, THINNED = 0.05, 8
"""Times the brightest of its band is what of a path is faint, and of so many such paths one is drawn; a Fibonacci
number, which leaves a golden lattice even."""
REACH = 4.0
"""How many radii of the scene light is followed that meets nothing more."""
_BATCH = 1 << 14
_SPECULAR_BIT = 1


@dataclass(frozen=True)
class Flights:
    """Stretches of light outside glass."""

    records: np.ndarray
    """FLIGHT (n,), in `space`; `light_and_source` is the row of `colours`."""
    colours: np.ndarray
    """float64 (rows, channels): what a watt of each light's bands adds to the channels of a picture."""
    space: GpuSpace


@dataclass(frozen=True)
class _Part:
    """Lattices of one light."""

    light: int
    domain: EmissionDomain
    bands: tuple[Band, ...]
    light_points: int
    photons: int
    max_depth: int
    """0: of paths that meet nothing specular; else of those that do."""


def trace_flights(
    context: Context, scene: Scene, observer: np.ndarray, photons: int = PHOTONS, max_depth: int = MOST_EVENTS
) -> Flights:
    """Trace about `photons`; `observer` (401, channels): what a watt at each nanometre adds to a picture."""
    features = replace(Features.of(scene, RenderSettings()), flights=True, beams=False)
    glasses = [glass for item in scene.objects for glass in item.material.dispersions]
    axis = SpectralAxis.build(glasses if features.spectral_groups and not features.merged_groups else [])
    buffers = SceneBuffers(context.ctx, scene, features, axis)
    trace = TracePass(context, features, buffers, _BATCH, max_depth, SPLIT_THRESHOLD)
    try:
        parts = _parts(scene, buffers, photons, max_depth)
        colours = np.zeros((len(parts) * MAX_BANDS, observer.shape[1]))
        found = [FLIGHT.zeros(0)]
        for number, part in enumerate(parts):
            power = cumulative(axis, scene.lights[part.light].spectral_power, observer)
            for row, band in enumerate(part.bands, number * MAX_BANDS):
                at_one = part.bands == (band,) and band.x_lo == band.x_hi
                seen = power.values[-1] if at_one else power.band(band.x_lo, band.x_hi)
                colours[row] = seen / max(band.power_w, 1e-300)
            for records in _traced(trace, part):
                records = _thinned(records, len(part.bands) * part.light_points)
                records["light_and_source"] = number * MAX_BANDS + (records["light_and_source"] >> 8 & 255)
                found.append(records)
        records = np.concatenate(found)
        reach = REACH * buffers.space.scale * _radius(scene)
        records["distance"] = np.minimum(records["distance"], reach)
        return Flights(records, colours, buffers.space)
    finally:
        trace.release()
        buffers.release()


def _parts(scene: Scene, buffers: SceneBuffers, photons: int, max_depth: int) -> list[_Part]:
    """Lattices of all lights: of what meets glass and mirrors first, and of the rest."""
    space = buffers.space
    specular = [
        space.to_gpu(mesh.corners())
        for mesh, item in zip(buffers.world_meshes, scene.objects, strict=True)
        if item.material.is_specular
    ]
    everything = space.to_gpu(_box(scene))
    parts = []
    for index, light in enumerate(scene.lights):
        power = float(buffers.light_power[index].band(0.0, 1.0)[3])
        if power <= 0.0:
            continue
        points = LIGHT_POINTS if light.has_extent else 1
        share = photons // len(scene.lights)
        domains = (
            (emission_domain(light, scene, space, np.concatenate(specular)) if specular else None, max_depth),
            (emission_domain(light, scene, space, everything), 0),
        )
        for domain, depth in domains:
            if domain is None:
                continue
            count = 1 if not depth else BANDS if buffers.features.spectral_groups else PLAIN_BANDS
            bands = _bands(buffers, index, max(count // (4 if points > 1 else 1), 1))
            direct = DIRECT_SHARE if points == 1 else DIRECT_SHARE_OF_EXTENT
            parts.append(_Part(index, domain, bands, points, share if depth else int(direct * share), depth))
    return parts


def _bands(buffers: SceneBuffers, light: int, count: int) -> tuple[Band, ...]:
    power = buffers.light_power[light]
    low_nm, high_nm = buffers.scene.lights[light].spectral_power.support_nm()
    low, high = (float(buffers.axis.x_of_nm(nm)) for nm in (low_nm, high_nm))
    if high_nm - low_nm < 1e-6:
        return (Band(low, low, low, float(power.values[-1, 3])),)
    low, high = (float(buffers.axis.x_of_nm(nm)) for nm in (max(low_nm - 0.5, 380.0), min(high_nm + 0.5, 780.0)))
    edges = np.linspace(low, high, count + 1).tolist()
    bands = (Band(a, b, 0.5 * (a + b), float(power.band(a, b)[3])) for a, b in pairwise(edges))
    return tuple(band for band in bands if band.power_w > 0.0)


def _traced(trace: TracePass, part: _Part) -> list[np.ndarray]:
    """FLIGHT records of one part, those outside glass."""
    lattices = len(part.bands) * part.light_points
    lattice = max(16, round(part.photons / lattices / part.domain.active_share))
    stride = -(-lattice * lattices // trace.batch)
    found = []

    def keep(batch: Batch, _: bool) -> None:
        assert trace.flights is not None
        count = min(batch.flights, FLIGHT_ROOM * trace.batch)
        records = np.frombuffer(trace.flights.read(count * FLIGHT.stride), FLIGHT.dtype)
        found.append(_kept(records, part.max_depth > 0))

    piece = LatticeSlice(part.light, part.bands, lattice, 0, 1, lattice, (0, 0), (0, 0), 0, 1, part.light_points)
    for i in range(stride):
        for _ in trace.whole(every(stride, i, [(piece, part.domain)]), keep, part.max_depth):
            pass
    return found


def _kept(records: np.ndarray, specular: bool) -> np.ndarray:
    """Stretches outside glass of paths that meet something specular first, or of the others."""
    depth, meets_specular = records["what"] >> 8, (records["what"] & _SPECULAR_BIT) != 0
    mine = (depth > 0) | meets_specular if specular else (depth == 0) & ~meets_specular
    return records[mine & (records["flux_w"] > 0.0)].copy()


def _thinned(records: np.ndarray, lattices: int) -> np.ndarray:
    """With one for `THINNED` of faint stretches, as much broader: they are many, and each is drawn at the same cost."""
    band = records["light_and_source"] >> 8 & 255
    brightest = np.zeros(MAX_BANDS)
    np.maximum.at(brightest, band, records["flux_w"])
    faint = records["flux_w"] < FAINT * brightest[band]
    kept = ~faint | (records["photon_id"] // lattices % THINNED == 0)
    records, faint = records[kept], faint[kept]
    records["flux_w"][faint] *= THINNED
    for name in ("dposition_ds", "dposition_dt", "ddirection_ds", "ddirection_dt"):
        records[name][faint] *= np.sqrt(THINNED)
    return records


def _bounds(scene: Scene) -> np.ndarray:
    """Lowest and highest corner (2, 3), world, of objects, lights and the camera."""
    places = [scene.camera.position, *(light.position for light in scene.lights if light.has_place)]
    points = np.concatenate([np.asarray(places, float), *(item.world_bounds for item in scene.objects)])
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _radius(scene: Scene) -> float:
    return float(np.linalg.norm(np.diff(_bounds(scene), axis=0)))


def _box(scene: Scene) -> np.ndarray:
    """Triangles (12, 3, 3), world, of a box about everything: every ray meets it."""
    low, high = _bounds(scene)
    middle, half = 0.5 * (low + high), 0.55 * (high - low) + 0.05 * _radius(scene) + 1e-9
    triangles = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            normal, first, second = (np.roll(np.eye(3), axis, axis=0)[i] for i in range(3))
            corners = [side * normal + a * first + b * second for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            triangles += [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]
    return middle + half * np.array(triangles)
