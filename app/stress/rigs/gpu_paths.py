"""Photons of the real emit and trace passes in scenes made for one question, in world coordinates.

A light falls on glass or mirrors before a diffuse screen; the photon records come back with the
float64 start of the lattice point each grew from and the choices of its path, so that every photon
can be compared with a closed form or the reference tracer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from ...features.features import Features
from ...gpu.context import Context
from ...gpu.records import specular_events
from ...gpu.scene_buffers import UNBOUNDED, SceneBuffers
from ...gpu.spectral_groups import Groups
from ...model.geometry import primitives
from ...model.geometry.mesh import Mesh, make_mesh
from ...model.lights import CollimatedLight
from ...model.optics.glass import sellmeier
from ...model.optics.spectral_tables import SpectralAxis
from ...model.optics.spectrum import constant
from ...model.scene import Camera, Dielectric, Diffuse, Light, Material, Mirror, RenderDefaults, Scene, SceneObject
from ...model.settings import RenderSettings
from ...model.vectors import frame_about, vec3
from ...passes.emission_domain import emission_domain
from ...passes.lattice_slice import Band, LatticeSlice
from ...passes.trace import FluxTally, TracePass
from ...reference.emission import Emitter
from ...reference.glasses import sellmeier_terms
from ...reference.optics import unit
from ...reference.random_numbers import hash_combine
from ...render.device_scene import spectral_axis
from ..case import FLUX_CLOSURE, Held, Measurement, judged, not_finite, not_finite_in

SHIFT = (123456789, 987654321)
SEED = 1
REFLECTED, REFRACTED, MIRRORED, CUT_LOW, CUT_HIGH = 1, 2, 3, 5, 6
"""Choices of a path as trace.comp names them in the branch key."""


@dataclass(frozen=True)
class Photons:
    """Landings, world units; N rows, G spectral groups."""

    records: np.ndarray
    """The photon buffer as it is."""
    emitter: Emitter
    q: np.ndarray
    """float64 (N, 2): the point of the emission domain."""
    start: np.ndarray
    """float64 (N, 3): where each ray left the light."""
    direction: np.ndarray
    """float64 (N, 3): in which direction."""
    position: np.ndarray
    dposition_ds: np.ndarray
    """(N, 3) per unit of q: world units across a beam, of the azimuthal plane for light that diverges."""
    dposition_dt: np.ndarray
    dposition_dvar: np.ndarray
    """(N, G, 3) per unit of each group's variable."""
    weight: np.ndarray
    """(N,): flux each photon's band starts with, float64."""
    nm: np.ndarray
    """(N, 3): wavelengths of the band's start, the anchor and the band's end."""
    axis: SpectralAxis
    groups: Groups
    lattice_in_disc: int
    """Lattice points inside the given disc (all of them, without one)."""
    flux_w: float
    """Flux of a lattice point of full weight."""
    tally: FluxTally

    @property
    def dposition_dn(self) -> np.ndarray:
        """(N, 3) per unit of the first group's variable; zero without dispersion."""
        return self.dposition_dvar[:, 0] if self.dposition_dvar.shape[1] else np.zeros_like(self.position)

    def of_depth(self, depth: int) -> Photons:
        """Those after `depth` specular events."""
        return self.where(specular_events(self.records) == depth)

    def of_choices(self, *choices: int) -> Photons:
        """Those whose path took these choices, one an event (`REFLECTED`, …)."""
        keys = {int(band): branch_key(choices, int(band)) for band in np.unique(self.band)}
        return self.where(self.records["branch_key"] == np.array([keys[int(band)] for band in self.band], np.uint32))

    def where(self, chosen: np.ndarray) -> Photons:
        names = ["records", "q", "start", "direction", "position", "weight", "nm"]
        names += ["dposition_ds", "dposition_dt", "dposition_dvar"]
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    @property
    def band(self) -> np.ndarray:
        """Number of each photon's band among those given (N,)."""
        return self.records["light_and_source"] >> 8 & 0xFF


def branch_key(choices: Sequence[int], band: int = 0) -> int:
    """The key that trace.comp gives a path of these choices, first light."""
    return int(reduce(hash_combine, choices, hash_combine(SEED, band)))


def glass(name: str) -> Dielectric:
    """A glass of the reference's own table."""
    return Dielectric(sellmeier(*sellmeier_terms(name), name=name))


def screen(centre: ArrayLike, normal: ArrayLike, half: float = 50.0) -> Mesh:
    """A square of side 2·half across `normal`."""
    side, up, _ = frame_about(unit(np.asarray(normal, float)))
    corners = [np.asarray(centre) + half * (s * side + t * up) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return make_mesh("screen", np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))


def extruded(name: str, section: np.ndarray, half: float = 0.5) -> Mesh:
    """A closed convex solid: a polygon (P, 2), counter-clockwise in x-y, drawn out along z by ±half."""
    return primitives.extruded(name, section, 2.0 * half)


def placed(name: str, mesh: Mesh, material: Material) -> SceneObject:
    """An object where its mesh is."""
    return SceneObject(name, mesh, material)


def trace_light(
    gl: Context,
    objects: Sequence[SceneObject],
    light: Light,
    bands_nm: Sequence[tuple[float, float]],
    count: int = 256,
    max_depth: int = 3,
    method: str = "srd",
    place: tuple[float, float] = (0.5, 0.5),
    polarisation: bool = False,
    lamp_step: float = 0.0,
) -> Photons:
    """All landings of `count` lattice points for each spectral band.

    Every interface splits and nothing plays roulette, so each path is there once and with its true flux (1 W
    per unit of the light's quantity and band). `place` is where on an extended light the rays start, `lamp_step`
    how much of it their footprints cover (`LatticeSlice.lamp_step`).
    """
    camera, render = Camera((0, 0, 9), (0, 0, 0), up=(0, 1, 0)), RenderDefaults(polarisation=polarisation)
    scene = Scene("question", camera, (light,), tuple(objects), render=render)
    # What a photon's weights hold is examined: all of a tint.
    features = replace(Features.of(scene, RenderSettings(method=method)), tint_levels=0)
    buffers = SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features))
    room = max(2 * count * len(bands_nm), 1 << 13)
    # Few rays, whose footprints are as wide as the light: columns are derivatives.
    trace = TracePass(gl, features, buffers, room, max_depth, split_threshold=0.0, widest_on_surface=UNBOUNDED)
    try:
        space = buffers.space
        specular = [o.mesh.corners() for o in objects if not o.material.receives]
        domain = emission_domain(light, scene, space, space.to_gpu(np.concatenate(specular)))
        assert domain is not None
        ends = [buffers.axis.x_of_nm(np.array(band)) for band in bands_nm]
        # The tally counts the light's own power; records are as if every band had 1 W.
        powers = [float(buffers.light_power[0].band(lo, hi)[3]) if hi > lo else 1.0 for lo, hi in ends]
        bands = tuple(
            Band(float(lo), float(hi), float(0.5 * (lo + hi)), watts)
            for (lo, hi), watts in zip(ends, powers, strict=True)
        )
        piece = LatticeSlice(
            0, bands, count, 0, 1, count, SHIFT, (0, 0), 0, SEED, light_place=place, lamp_step=lamp_step
        )
        batch = trace.run(piece, domain)
        assert batch.tally.fallbacks["queue_overflow"] == 0
        assert batch.tally.imbalance < FLUX_CLOSURE, f"flux does not close: {batch.tally.imbalance:.3g}"
        records = np.frombuffer(trace.photons.read(), trace.photon.dtype, batch.photons).copy()
        records["flux_w"] /= np.array(powers, np.float32)[records["light_and_source"] >> 8 & 255]
        emitter = Emitter(light, domain, space, place)
        # Only wavelengths that part have lattices of their own.
        lattices = [emitter.lattice(count, SHIFT, k if features.spectral_groups else 0) for k in range(len(bands))]
        q = np.stack(lattices, axis=1).reshape(-1, 2)[records["photon_id"]]
        start, direction = emitter.start(q)
        per_s, per_t = 1.0 / (domain.spacing(count) * space.scale * emitter.unit_length)
        groups = [records[f"dposition_dvar{g}"][:, :3] for g in range(features.spectral_groups)]
        return Photons(
            records,
            emitter,
            q,
            start,
            direction,
            space.to_world(records["position"]),
            records["dposition_ds"] * per_s,
            records["dposition_dt"] * per_t,
            np.stack(groups, axis=1) / space.scale if groups else np.zeros((len(records), 0, 3)),
            emitter.weight(q, count),
            buffers.axis.nm_of_x(np.column_stack([records[f"x_{end}"] for end in ("lo", "anchor", "hi")])),
            buffers.axis,
            buffers.groups,
            count * len(bands),
            domain.measure / count,
            batch.tally,
        )
    finally:
        trace.release()
        buffers.release()


def beam_light(start: ArrayLike, direction: ArrayLike, radius: float) -> Light:
    """Collimated white light from a disc."""
    return CollimatedLight(
        "beam",
        constant(1.0),
        position=vec3(np.asarray(start)),
        direction=tuple(unit(np.asarray(direction, float))),
        radius=radius,
    )


def trace_beam(
    gl: Context,
    solid: Mesh | Sequence[SceneObject],
    material: Dielectric | Mirror | None,
    screen_mesh: Mesh,
    start: ArrayLike,
    direction: ArrayLike,
    radius: float,
    nm: float | tuple[float, float] | Sequence[tuple[float, float]],
    count: int = 256,
    max_depth: int = 3,
    method: str = "srd",
    polarisation: bool = False,
) -> Photons:
    """Send about `count` lattice points of a disc beam through `solid` (a mesh of `material`, or several objects).

    `nm` is one wavelength, a band (lo, hi), or several bands. The real beam is wider, and what starts outside the
    disc is dropped: at the beam's own edge a lattice cell is covered in part only and its photon weaker.
    """
    wider = 1.0 + 3.0 / np.sqrt(count)
    if isinstance(solid, Mesh):
        assert material is not None
        solid = (placed("solid", solid, material),)
    bands = [(nm, nm)] if isinstance(nm, float) else [nm] if isinstance(nm, tuple) else list(nm)
    objects = (*solid, placed("screen", screen_mesh, Diffuse()))
    count = int(np.ceil(count * wider**2))
    light = beam_light(start, direction, radius * wider)
    everything = trace_light(gl, objects, light, bands, count, max_depth, method, polarisation=polarisation)

    def inside(points: np.ndarray) -> np.ndarray:
        from_axis = np.cross(points - np.asarray(start, float), everything.emitter.domain.axis)
        return np.linalg.norm(from_axis, axis=-1) <= radius

    own = range(len(bands) if everything.groups.count else 1)
    lattice = np.concatenate([everything.emitter.start(everything.emitter.lattice(count, SHIFT, k))[0] for k in own])
    chosen = everything.where(inside(everything.start))
    return replace(chosen, lattice_in_disc=int(np.count_nonzero(inside(lattice))))


def traced(
    severity: float,
    label: str,
    photons: Photons,
    held: Held,
    images: Sequence[np.ndarray] = (),
    dropped: int = 0,
    note: str = "",
) -> Measurement:
    """The measurement of one beam: its values, and those of `images`, are finite; its tally closes."""
    bad, tally = not_finite_in(photons.records) + not_finite(images), photons.tally
    errors, bounds = judged(held)
    return Measurement(severity, label, bad, errors, bounds, tally.imbalance, dict(tally.fallbacks), dropped, note)
