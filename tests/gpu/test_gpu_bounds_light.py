"""Rays that a GPU follows for several events in a dispatch: the photons of one event at a time, and what that takes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from gl_counts import counted
from spectrasplat.base.generators import finished
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.features.features import Features
from spectrasplat.gpu import device_traits
from spectrasplat.gpu.context import Context, create_context
from spectrasplat.gpu.device_traits import DeviceTraits
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes import ray_pool
from spectrasplat.passes import trace as trace_pass
from spectrasplat.passes.emission_domain import emission_domain
from spectrasplat.passes.lattice_slice import Band, LatticeSlice, Parts
from spectrasplat.passes.trace import Batch, TracePass
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.light_pass import LightPass

POINTS, PHOTONS = 2_000, 12_000
THRESHOLD = 0.01
"""Few rays play roulette: paths branch often."""
SCHEDULES: tuple[tuple[int, ...], ...] = ((), (1,) * 12 + (4096,), (4,) * 6 + (4096,), (8, 8, 8, 4096), (1, 24, 4096))
"""One event at a time, in order; then so many at once, and at last whatever is left."""
BYTES_A_PHOTON = 600


@contextmanager
def device(events: tuple[int, ...], packs: bool = False) -> Iterator[Context]:
    """This one, with rays followed like that."""
    with create_context() as context:
        traits = replace(context.traits, ray_events=events, packs_records=packs)
    with device_traits.assumed(traits), create_context() as context:
        yield context


def parts_of(buffers: SceneBuffers, points: int) -> Parts:
    """So many points of each light, of two bands."""
    scene, parts = buffers.scene, []
    meshes = zip(buffers.world_meshes, scene.objects, strict=True)
    specular = [buffers.space.to_gpu(mesh.corners()) for mesh, item in meshes if item.material.is_specular]
    for index, light in enumerate(scene.lights):
        domain = emission_domain(light, scene, buffers.space, np.concatenate(specular)) if specular else None
        if domain is not None:
            power, count = buffers.light_power[index], points // 2
            ends = ((0.0, 0.5), (0.5, 1.0))
            bands = tuple(Band(lo, hi, 0.5 * (lo + hi), float(power.band(lo, hi)[3])) for lo, hi in ends)
            parts.append((LatticeSlice(index, bands, count, 0, 1, count, (5, 7), (1, 2), 3, 11), domain))
    return parts


def traced(context: Context, scene: Scene, points: int, room: int = 4) -> Iterator[tuple[TracePass, Batch]]:
    """Their photons, in batches with room for so many times more; halves where a software renderer ended loops."""
    buffers = scene_buffers(context, scene, RenderSettings(photons=points, method="srd-photons"))
    trace = TracePass(context, buffers.features, buffers, room * points * max(len(scene.lights), 1), 64, THRESHOLD)
    parts, most = parts_of(buffers, points), trace.batch
    while parts:
        some, rest = trace.fill(parts, most)
        batch = finished(trace.steps(some))
        if batch.overflow and context.traits.loops_may_end and most > points // 8:
            most = trace.rays_of(some) // 2
            continue
        yield trace, batch
        parts = rest
    trace.release()
    buffers.release()


def photon_set(name: str, events: tuple[int, ...]) -> np.ndarray:
    """All bits of every photon, sorted: light by light in order, else of all lights together."""
    found = [np.zeros((0, 1), np.uint32)]
    with device(events) as context:
        for trace, batch in traced(context, load_scene(shipped_scenes()[name]), POINTS):
            assert batch.overflow == 0 and batch.tally.imbalance < 3e-5
            words = np.frombuffer(trace.photons.read(), np.uint32).reshape(-1, trace.photon.stride // 4)
            found.append(words[: batch.photons])
    words = np.concatenate(found[1:] or found)
    return words[np.lexsort(words.T)]


def compare(name: str, schedules: tuple[tuple[int, ...], ...]) -> np.ndarray:
    """The photons, to the bit, of all of them."""
    first = photon_set(name, schedules[0])
    for events in schedules[1:]:
        assert np.array_equal(first, photon_set(name, events))
    return first


def identities(photons: np.ndarray) -> np.ndarray:
    """Triangle, receiver, place on the lattice, light and branch of each, sorted."""
    words = photons[:, 16:21]
    return words[np.lexsort(words.T)]


def test_photons_are_the_same_however_many_events_are_followed_at_once() -> None:
    compare("prism", (SCHEDULES[0], SCHEDULES[2], SCHEDULES[-1]))


@pytest.mark.slow
@pytest.mark.parametrize("name", list(shipped_scenes()))
def test_photons_are_the_same_in_every_shipped_scene(name: str) -> None:
    """To the bit, whatever the schedule; of one event at a time, which is another program, drivers round some values
    otherwise, and a few in a thousand take another path over waves."""
    together = {bytes(photon) for photon in identities(compare(name, SCHEDULES[1:]))}
    one_at_a_time = {bytes(photon) for photon in identities(photon_set(name, SCHEDULES[0]))}
    assert len(together ^ one_at_a_time) <= 5e-3 * len(together)


def test_rays_without_room_wait_and_nothing_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer slots than rays that set out and their first children together: branching ones wait for those that end."""
    monkeypatch.setattr(ray_pool, "RAY_ROOM", 1.5 / 4.0)
    compare("prism", ((), (1,) * 60 + (4096,)))


@pytest.mark.parametrize(("name", "lights"), [("brilliant", 2), ("default", 10)])
def test_a_million_photons_ask_for_few_dispatches_and_wait_for_nothing(name: str, lights: int) -> None:
    """All lights' together: one for each light, and nine whatever their number."""
    scene = load_scene(shipped_scenes()[name])
    scene = replace(scene, lights=tuple(scene.lights[i % len(scene.lights)] for i in range(lights)))
    features = Features.of(scene, RenderSettings(method="srd-photons"))
    assert ray_pool.RayPool.bytes_of(features, DeviceTraits(), 1 << 20) <= BYTES_A_PHOTON << 20
    with device(DeviceTraits().ray_events, packs=True) as context, counted() as counts:
        ((trace, batch),) = traced(context, scene, POINTS)
    assert counts.dispatches <= lights + 9 and counts.waits <= 1 and batch.photons > 0
    trace.batch = DeviceTraits().photon_batch
    rays = 1e6 / lights
    parts = [(replace(s, points=int(rays / s.lattices / d.active_share)), d) for s, d in parts_of(trace.scene, 2)]
    assert trace.rounds(parts) == 1


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
