"""Rays as the real emission pass leaves them, of any light, from several randomly shifted lattices."""

from __future__ import annotations

from dataclasses import dataclass, replace
from unittest import mock

import numpy as np
from spectrasplat.features.features import Features
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.geometry.mesh import Mesh, make_mesh
from spectrasplat.model.scene import (
    Camera,
    Dielectric,
    Diffuse,
    Light,
    Scene,
    SceneObject,
)
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.emission_domain import emission_domain
from spectrasplat.passes.lattice_slice import Band, LatticeSlice
from spectrasplat.passes.trace import TracePass
from spectrasplat.render.device_scene import spectral_axis
from spectrasplat.stress.rigs.gpu_paths import glass, screen

BATCH = 1 << 16


@dataclass(frozen=True)
class Emitted:
    """Living rays of all passes, world units; N rows."""

    position: np.ndarray
    direction: np.ndarray
    weight: np.ndarray
    """Flux per unit of the light's own quantity (and band), float64; passes average, so their sum is the whole
    measure."""
    x: np.ndarray
    """Spectral coordinate."""
    throughput: np.ndarray
    photon_id: np.ndarray


def box(half: float, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Mesh:
    """A cube of side 2·half with outward facets."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * half + centre
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])]
    return make_mesh("box", corners, np.array(triangles))


def emit(
    gl: Context,
    light: Light,
    solid: Mesh,
    passes: int,
    light_points: int = 1,
    band: tuple[float, float] = (0.2, 0.7),
    seed: int = 1,
    material: Dielectric | None = None,
) -> Emitted:
    """`passes` lattices of `BATCH` points towards `solid`, each with shifts of its own, under method
    `stochastic-point`."""
    objects = (
        SceneObject("solid", solid, material or glass("N-BK7")),
        SceneObject("floor", screen((0, 0, -60), (0, 0, 1)), Diffuse()),
    )
    scene = Scene("emission", Camera((0, 0, 9), (0, 0, 0), up=(0, 1, 0)), (light,), objects)
    features = Features.of(scene, RenderSettings(method="stochastic-point"))
    buffers = SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features))
    with mock.patch.object(gl, "traits", replace(gl.traits, packs_records=False)):
        trace = TracePass(gl, features, buffers, batch=BATCH, max_depth=1)
    rng = np.random.default_rng(seed)
    try:
        domain = emission_domain(light, scene, buffers.space, buffers.space.to_gpu(solid.corners()))
        assert domain is not None
        ray, rows = trace.ray, []
        for number in range(passes):
            shifts = [int(s) for s in rng.integers(0, 2**32, 5)]
            points = BATCH // light_points
            bands = (Band(band[0], band[1], 0.5 * sum(band), 1.0),)
            piece = LatticeSlice(
                0,
                bands,
                points,
                0,
                1,
                points,
                (shifts[0], shifts[1]),
                (shifts[2], shifts[3]),
                shifts[4],
                number,
                light_points,
            )
            # With no depth left every ray ends at its first surface, and what emission wrote stays where it is.
            trace.emitted_rays.clear()
            trace.run(piece, domain, max_depth=0)
            rays = np.frombuffer(trace.emitted_rays.read(size=2 * BATCH * ray.stride), ray.dtype)
            rows.append(rays[rays["flux_w"] > 0.0])
        rays = np.concatenate(rows)
        return Emitted(
            buffers.space.to_world(rays["position"]),
            rays["direction"].astype(float),
            rays["flux_w"].astype(float) / passes,
            rays["x_anchor"].astype(float),
            rays["throughput"][:, 1].astype(float),
            rays["photon_id"],
        )
    finally:
        trace.release()
        buffers.release()
