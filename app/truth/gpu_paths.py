"""Photons of the real emit and trace passes in scenes made for one question, in world coordinates.

A collimated disc of light falls on glass before one large diffuse screen; the photon records
come back with the float64 start of the lattice point each grew from, so that every photon can be
held against a closed form or the reference tracer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.gpu.context import Context
from app.gpu.scene_buffers import SceneBuffers
from app.light_half import spectral_axis
from app.model.features import Features
from app.model.glass import sellmeier
from app.model.mesh import Mesh, make_mesh
from app.model.scene import Camera, Dielectric, Diffuse, Light, Scene, SceneObject
from app.model.settings import RenderSettings
from app.model.spectral_tables import SpectralAxis
from app.model.spectrum import constant
from app.passes.emission_domain import (
    EmissionDomain,
    emission_domain,
    orthonormal_frame,
)
from app.passes.trace import Band, FluxTally, LatticeSlice, TracePass
from app.truth.glasses import sellmeier_terms
from app.truth.optics import unit

GOLDEN = 2654435769
WORD = 2**32
SHIFT = (123456789, 987654321)


@dataclass(frozen=True)
class Photons:
    """Landings of one band, world units; N rows."""

    records: np.ndarray
    """The photon buffer as it is."""
    start: np.ndarray
    """float64 (N, 3): where each ray left the light."""
    position: np.ndarray
    dposition_ds: np.ndarray
    """(N, 3) per world unit along the beam's first axis."""
    dposition_dt: np.ndarray
    dposition_dn: np.ndarray
    """(N, 3) per unit of refractive index."""
    axis: SpectralAxis
    lattice_in_disc: int
    """Lattice points inside the disc that was asked for."""
    flux_w: float
    """Flux that each of them starts with."""
    tally: FluxTally

    def of_depth(self, depth: int) -> Photons:
        """Those after `depth` specular events."""
        return self.where(self.records["depth"] == depth)

    def where(self, chosen: np.ndarray) -> Photons:
        names = ("records", "start", "position", "dposition_ds", "dposition_dt", "dposition_dn")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})


def glass(name: str) -> Dielectric:
    """A glass of the reference's own table."""
    return Dielectric(sellmeier(*sellmeier_terms(name), name=name))


def screen(centre: np.ndarray, normal: np.ndarray, half: float = 50.0) -> Mesh:
    """A square of side 2·half across `normal`."""
    side, up = orthonormal_frame(unit(np.asarray(normal, float)))
    corners = [np.asarray(centre) + half * (s * side + t * up) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return make_mesh("screen", np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))


def extruded(name: str, section: np.ndarray, half: float = 0.5) -> Mesh:
    """A closed convex solid: a polygon (P, 2), counter-clockwise in x-y, drawn out along z by ±half."""
    count = len(section)
    low, high = (np.column_stack([section, np.full(count, z)]) for z in (-half, half))
    caps = [[0, k + 1, k] for k in range(1, count - 1)] + [[count, count + k, count + k + 1] for k in range(1, count - 1)]
    sides = [t for k in range(count) for t in ([k, (k + 1) % count, count + k], [(k + 1) % count, count + (k + 1) % count, count + k])]
    return make_mesh(name, np.concatenate([low, high]), np.array(caps + sides))


def trace_beam(
    gl: Context,
    solid: Mesh,
    material: Dielectric,
    screen_mesh: Mesh,
    start: np.ndarray,
    direction: np.ndarray,
    radius: float,
    nm: float | tuple[float, float],
    count: int = 256,
    max_depth: int = 3,
) -> Photons:
    """Send about `count` lattice points of a disc beam at one wavelength, or over a band (lo, hi), through `solid`.

    The real beam is wider, and what starts outside the disc is dropped: at the beam's own edge a
    lattice cell is covered in part only and its photon weaker. Every interface splits and nothing plays roulette, so each path is there once and with its true flux.
    """
    wider = 1.0 + 3.0 / np.sqrt(count)
    count = int(np.ceil(count * wider**2))
    light = Light("beam", "collimated", constant(1.0), position=tuple(start), direction=tuple(unit(np.asarray(direction, float))), radius=radius * wider)
    objects = (SceneObject("solid", solid, material), SceneObject("screen", screen_mesh, Diffuse()))
    scene = Scene("question", Camera((0, 0, 9), (0, 0, 0), up=(0, 1, 0)), (light,), objects)
    features = Features.of(scene, RenderSettings())
    buffers = SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features))
    trace = TracePass(gl, features, buffers, batch=max(2 * count, 1024), max_depth=max_depth, split_threshold=0.0)
    try:
        domain = emission_domain(light, scene, buffers.space, buffers.space.to_gpu(solid.corners()))
        assert domain is not None
        lo, hi = buffers.axis.x_of_nm(np.array(nm if isinstance(nm, tuple) else (nm, nm)))
        band = Band(float(lo), float(hi), float(0.5 * (lo + hi)), 1.0)
        piece = LatticeSlice(0, (band,), count, 0, 1, count, SHIFT, (0, 0), 0, seed=1)
        batch = trace.run(piece, domain)
        assert batch.tally.fallbacks["queue_overflow"] == 0
        assert batch.tally.imbalance < 1e-4
        records = np.frombuffer(trace.photons.read(size=batch.photons * trace.photon.stride), trace.photon.dtype)
        scale = buffers.space.scale
        on_plane = _domain_points(domain, count)[records["photon_id"]]
        spacing = domain.spacing(count)
        from_axis = np.cross(_domain_points(domain, count) - buffers.space.to_gpu(np.asarray(start, float)), domain.axis)
        inside = np.linalg.norm(from_axis, axis=1) <= radius * scale
        everything = Photons(
            records,
            buffers.space.to_world(on_plane - domain.back * domain.axis),
            buffers.space.to_world(records["position"]),
            records["dposition_ds"] / spacing,
            records["dposition_dt"] / spacing,
            records["dposition_dvar0"][:, :3] / scale if features.spectral_groups else np.zeros((len(records), 3)),
            buffers.axis,
            int(np.count_nonzero(inside)),
            domain.measure / count,
            batch.tally,
        )
        return everything.where(inside[records["photon_id"]])
    finally:
        trace.release()
        buffers.release()


def _domain_points(domain: EmissionDomain, count: int) -> np.ndarray:
    """Every lattice point on the beam's plane, GPU space (count, 3)."""
    plane = _lattice(np.arange(count), count) * domain.rect[2:] + domain.rect[:2]
    return domain.origin + plane[:, :1] * domain.tangent + plane[:, 1:] * domain.bitangent


def _lattice(ids: np.ndarray, count: int) -> np.ndarray:
    """Points (N, 2) of the emission lattice in the unit square."""
    along = (ids + (SHIFT[0] >> 8) / 2**24) / count
    across = ((ids.astype(np.uint64) * GOLDEN + SHIFT[1]) % WORD >> np.uint64(8)) / 2**24
    return np.column_stack([along, across])
