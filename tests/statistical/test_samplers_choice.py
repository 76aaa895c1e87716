"""Reflected or refracted: with every surface a gamble, paths through a slab are as many as Fresnel's law says.

With roulette from full power on, a ray that goes on always carries the same flux, so photons count: as those do that
beams hand on, for survivors on a lattice are whole coarser lattices (`test_samplers_numbers`). N starts at 60°
on N-BK7 leave by T² R^k after k reflections inside. At N = 262,144 the count for k = 0 is known to 0.1 %, for k = 1
to 0.7 %, so that an error of 5 % in R is seen with probability 0.99; the mutants (Schlick's formula, one polarisation)
are 20 % and more off.
"""

from __future__ import annotations

import numpy as np
import pytest
from reference.textbook_optics import fresnel_reflectance
from spectrasplat.features.features import Features
from spectrasplat.gpu import records as records_of_the_device
from spectrasplat.gpu.packed_records import read_records
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.lights import CollimatedLight
from spectrasplat.model.optics.spectrum import constant
from spectrasplat.model.scene import Camera, Diffuse, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.emission_domain import emission_domain
from spectrasplat.passes.lattice_slice import Band, LatticeSlice
from spectrasplat.passes.trace import TracePass
from spectrasplat.reference.glasses import index
from spectrasplat.render.device_scene import spectral_axis
from spectrasplat.stress.rigs.gpu_paths import glass, screen

from tests.statistical.emitted import BATCH, box

PASSES = 4
ANGLE = np.radians(60.0)
NM = 550.0
LIMIT = 4.5
"""Standard errors."""


@pytest.fixture(scope="module")
def landed(gl) -> tuple[np.ndarray, float]:
    """Photons by number of surfaces met, and the rays that started."""
    flat = box(1.0)
    slab = make_mesh("slab", flat.vertices * [8.0, 8.0, 0.5], flat.triangles)
    direction = np.array([np.sin(ANGLE), 0.0, -np.cos(ANGLE)])
    light = CollimatedLight(
        "beam", constant(1.0), position=tuple(-4.0 * direction), direction=tuple(direction), radius=0.2
    )
    objects = (
        SceneObject("slab", slab, glass("N-BK7")),
        SceneObject("above", screen((0, 0, 9), (0, 0, 1)), Diffuse()),
        SceneObject("below", screen((0, 0, -9), (0, 0, 1)), Diffuse()),
    )
    scene = Scene("slab", Camera((0, 0, 30), (0, 0, 0), up=(0, 1, 0)), (light,), objects)
    features = Features.of(scene, RenderSettings(method="stochastic-point"))
    buffers = SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features))
    trace = TracePass(gl, features, buffers, BATCH, max_depth=8, split_threshold=1.0)
    domain = emission_domain(light, scene, buffers.space, buffers.space.to_gpu(slab.corners()))
    assert domain is not None
    x = float(buffers.axis.x_of_nm(NM))
    rng = np.random.default_rng(5)
    depths, started = [], 0.0
    for number in range(PASSES):
        shift = [int(s) for s in rng.integers(0, 2**32, 5)]
        piece = LatticeSlice(
            0, (Band(x, x, x, 1.0),), BATCH, 0, 1, BATCH, (shift[0], shift[1]), (0, 0), shift[4], seed=number
        )
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(records_of_the_device, "LATTICE_BIT", 32)  # too few bits for any lattice's size
            batch = trace.run(piece, domain)
        assert batch.tally.imbalance < 1e-5
        records = read_records(trace.photon, trace.photons, batch.photons)
        # The beam's softened rim is left out: there a ray starts with less, and less is a smaller chance.
        whole = records["flux_w"] > 0.5 * domain.measure / BATCH
        events = records_of_the_device.specular_events(records)
        first = events == 1
        full = np.median(records["flux_w"][first])
        started += np.count_nonzero(first)
        depths.append(events[~first])
        assert np.median(records["flux_w"][~first]) == pytest.approx(full / float(reflectance()), rel=1e-3)
        assert whole[~first].mean() > 0.9
    trace.release()
    buffers.release()
    return np.bincount(np.concatenate(depths), minlength=8), started


def reflectance() -> float:
    direction, normal = np.array([np.sin(ANGLE), 0.0, -np.cos(ANGLE)]), np.array([0.0, 0.0, 1.0])
    return float(fresnel_reflectance(direction, normal, 1.0 / index("N-BK7", NM)))


def standard_errors(landed: tuple[np.ndarray, float], r: float) -> np.ndarray:
    """How far the counts of two to five surfaces are from T² R^k."""
    counts, started = landed
    chance = (1.0 - r) ** 2 * r ** np.arange(4)
    return (counts[2:6] - started * chance) / np.sqrt(started * chance * (1.0 - chance))


def test_paths_are_as_many_as_fresnel_says(landed: tuple[np.ndarray, float]) -> None:
    assert np.abs(standard_errors(landed, reflectance())).max() < LIMIT


def test_other_laws_are_refused(landed: tuple[np.ndarray, float]) -> None:
    n = float(index("N-BK7", NM))
    cosine, cosine_t = np.cos(ANGLE), np.sqrt(1.0 - (np.sin(ANGLE) / n) ** 2)
    at_normal = ((n - 1.0) / (n + 1.0)) ** 2
    schlick = at_normal + (1.0 - at_normal) * (1.0 - cosine) ** 5
    polarised = ((cosine - n * cosine_t) / (cosine + n * cosine_t)) ** 2
    for wrong in (schlick, polarised, 1.05 * reflectance()):
        assert np.abs(standard_errors(landed, wrong)).max() > 1.5 * LIMIT
