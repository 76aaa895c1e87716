"""Rays that a GPU follows for several events in a dispatch: the photons of one event at a time, and what that takes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from gl_counts import counted
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.features.features import Features
from spectrasplat.gpu import device_traits
from spectrasplat.gpu.context import Context, create_context
from spectrasplat.gpu.device_traits import DeviceTraits
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes import ray_pool
from spectrasplat.passes import trace as trace_pass
from spectrasplat.passes.emission_domain import emission_domain
from spectrasplat.passes.trace import Band, Batch, LatticeSlice, TracePass
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.light_pass import LightPass

POINTS, PHOTONS = 2_000, 12_000
THRESHOLD = 0.003
"""Few rays play roulette: paths branch often."""
SCHEDULES: tuple[tuple[int, ...], ...] = ((), (1,) * 12 + (4096,), (4,) * 6 + (4096,), (8, 8, 8, 4096), (1, 4096))
"""One event at a time, in order; then so many at once, and at last whatever is left."""
FAST = ("prism", "spectrometer")
BYTES_A_PHOTON = 600


@contextmanager
def device(events: tuple[int, ...], packs: bool = False) -> Iterator[Context]:
    """This one, with rays followed like that."""
    with create_context() as context:
        traits = replace(context.traits, ray_events=events, packs_rays=packs)
    with device_traits.assumed(traits), create_context() as context:
        yield context


def traced(context: Context, name: str, points: int, room: int = 4) -> Iterator[tuple[TracePass, Batch]]:
    """Photons of each light, of two bands, in a batch with room for so many times more."""
    scene = load_scene(shipped_scenes()[name])
    buffers = scene_buffers(context, scene, RenderSettings(photons=points, method="srd-photons"))
    trace = TracePass(context, buffers.features, buffers, room * points, 64, THRESHOLD)
    meshes = zip(buffers.world_meshes, scene.objects, strict=True)
    specular = [buffers.space.to_gpu(mesh.corners()) for mesh, item in meshes if item.material.is_specular]
    for index, light in enumerate(scene.lights):
        domain = emission_domain(light, scene, buffers.space, np.concatenate(specular)) if specular else None
        if domain is None:
            continue
        power = buffers.light_power[index]
        bands = (
            Band(0.0, 0.5, 0.25, float(power.band(0.0, 0.5)[3])),
            Band(0.5, 1.0, 0.75, float(power.band(0.5, 1.0)[3])),
        )
        count = points // 2
        yield trace, trace.run(LatticeSlice(index, bands, count, 0, 1, count, (5, 7), (1, 2), 3, 11), domain)
    trace.release()
    buffers.release()


def photon_set(trace: TracePass, batch: Batch) -> np.ndarray:
    """All bits of every photon, sorted."""
    words = np.frombuffer(trace.photons.read(), np.uint32).reshape(-1, trace.photon.stride // 4)[: batch.photons]
    return words[np.lexsort(words.T)]


def photon_sets(name: str, events: tuple[int, ...]) -> list[np.ndarray]:
    """Of each light, sorted."""
    found = []
    with device(events) as context:
        for trace, batch in traced(context, name, POINTS):
            assert batch.overflow == 0 and batch.tally.imbalance < 3e-5
            found.append(photon_set(trace, batch))
    return found


def compare(name: str, schedules: tuple[tuple[int, ...], ...]) -> list[np.ndarray]:
    """The photons, to the bit, of all of them."""
    first = photon_sets(name, schedules[0])
    for events in schedules[1:]:
        for mine, theirs in zip(first, photon_sets(name, events), strict=True):
            assert np.array_equal(mine, theirs)
    return first


def identities(photons: np.ndarray) -> np.ndarray:
    """Triangle, receiver, place on the lattice, light and branch of each, sorted."""
    words = photons[:, 16:21]
    return words[np.lexsort(words.T)]


@pytest.mark.parametrize("name", FAST)
def test_photons_are_the_same_however_many_events_are_followed_at_once(name: str) -> None:
    compare(name, (SCHEDULES[0], SCHEDULES[2], SCHEDULES[-1]))


@pytest.mark.slow
@pytest.mark.parametrize("name", list(shipped_scenes()))
def test_photons_are_the_same_in_every_shipped_scene(name: str) -> None:
    """To the bit, whatever the schedule; of one event at a time, which is another program, drivers round some values
    otherwise."""
    for mine, theirs in zip(compare(name, SCHEDULES[1:]), photon_sets(name, SCHEDULES[0]), strict=True):
        assert np.array_equal(identities(mine), identities(theirs))


def test_rays_without_room_wait_and_nothing_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer slots than rays that set out and their first children together: branching ones wait for those that end."""
    monkeypatch.setattr(ray_pool, "RAY_ROOM", 1.5 / 4.0)
    compare("prism", ((), (1,) * 60 + (4096,)))


def test_a_batch_asks_for_few_dispatches_and_waits_for_nothing() -> None:
    for name in ("prism", "ball", "brilliant", "default"):
        features = Features.of(load_scene(shipped_scenes()[name]), RenderSettings(method="srd-photons"))
        assert ray_pool.RayPool.bytes_of(features, DeviceTraits(), 1 << 20) <= BYTES_A_PHOTON << 20
    with device(DeviceTraits().ray_events, packs=True) as context, counted() as counts:
        batches = len(list(traced(context, "prism", POINTS)))
    assert counts.dispatches <= 12 * batches and counts.finishes == 0 and counts.reads <= batches


@pytest.mark.parametrize("too_few", [False, True])
def test_what_is_counted_late_is_the_same_light(too_few: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Batches are drawn before anybody knows how many photons they left. One that found no room is traced again."""
    scene, settings = (
        load_scene(shipped_scenes()["prism"]),
        RenderSettings(width=64, height=36, photons=PHOTONS, method="srd-photons", batch=2_048),
    )
    monkeypatch.setattr(ray_pool, "PHOTON_ROOM", 5.0)
    found = []
    with device(DeviceTraits().ray_events) as context:
        buffers = scene_buffers(context, scene, settings)
        for keeps in (True, False):
            light = LightPass(context, scene, settings, buffers.features, buffers)
            light.batches.records.keeps = keeps
            light.prepare()
            light.begin(PHOTONS, 1)
            if too_few:
                monkeypatch.setattr(trace_pass, "MORE_PHOTONS", 0.5)
            for _ in light.pass_steps(0, PHOTONS):
                pass
            light.finish()
            sums = np.frombuffer(light.maps.atlas.total_textures[0].read(), np.float32).astype(float)
            found.append((sums, light.stats, light.trace.rays_traced))
            assert light.stats.tally.fallbacks["queue_overflow"] == 0 and light.stats.tally.imbalance < 1e-5
            light.release()
        buffers.release()
    (maps, stats, rays), (others, late, again) = found
    assert (again > rays) == too_few
    assert stats.splats == late.splats and stats.photons == late.photons > 0.0
    assert np.sqrt(((maps - others) ** 2).mean()) < 1e-5 * np.sqrt((maps**2).mean())
