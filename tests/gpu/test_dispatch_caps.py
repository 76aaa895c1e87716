"""Where a device queues work, no dispatch or draw takes long: its portions shrink, and the light stays the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.gpu import device_traits
from spectrasplat.gpu.context import create_context
from spectrasplat.gpu.device_traits import DeviceTraits
from spectrasplat.gpu.dispatch_budget import DispatchBudget
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.beam_splat import BeamSplatter
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.light_pass import LightPass

PHOTONS = 60_000
SLOW = 1e-9
"""Seconds that a dispatch may take: none does."""


@pytest.fixture(scope="module")
def queueing():
    """A device that behaves like a GPU as far as work goes; its programs are the software renderer's."""
    with create_context() as context:
        traits = replace(context.traits, work_is_queued=True)
    with device_traits.assumed(traits):
        context = create_context()
    yield context
    context.release()


def traced(context, name: str, seconds: float, method: str = "srd", photons: int = PHOTONS) -> LightPass:
    scene = load_scene(shipped_scenes()[name])
    settings = RenderSettings(width=96, height=54, photons=photons, method=method)
    buffers = scene_buffers(context, scene, settings)
    light = LightPass(context, scene, settings, buffers.features, buffers)
    light.batches.dispatch_seconds = light.batches.splatting.dispatch_seconds = seconds
    light.prepare()
    for splatter in _splatters(light):
        splatter.dispatch_seconds = seconds
    light.begin(photons, 1)
    sizes: list[int] = []
    steps, splat = light.trace.steps, light.maps.splatter.run
    light.trace.steps = lambda parts, *rest: (sizes.append(light.trace.rays_of(parts)), steps(parts, *rest))[1]  # type: ignore[method-assign]
    light.maps.splatter.run = lambda photons, *rest: (sizes.append(photons.count), splat(photons, *rest))[1]  # type: ignore[method-assign]
    for _ in range(2):
        for _ in light.pass_steps(0, photons):
            pass
    light.finish()
    light.sizes = sizes  # type: ignore[attr-defined]
    return light


def _splatters(light: LightPass) -> list[BeamSplatter]:
    beams = light.survey.beams
    if beams is None:
        return []
    maps = light._maps
    beams.draw_found(maps, 1.0)
    maps.clear()
    return list(beams.drawing.splatters.values())


@pytest.mark.slow
@pytest.mark.parametrize(("name", "method"), [("ball", "srd"), ("prism", "srd-photons"), ("prism", "srd")])
def test_slow_devices_get_small_portions_and_the_same_light(queueing, name: str, method: str) -> None:
    passes = [traced(queueing, name, seconds, method) for seconds in (1e3, SLOW)]
    try:
        freely, slowly = passes
        assert len(slowly.sizes) > 4 * len(freely.sizes) or slowly.survey.beams is not None
        if slowly.survey.beams is None:
            assert min(slowly.sizes) <= 1024 and max(slowly.sizes[-8:]) <= 1024
        if slowly.survey.beams is not None:
            (splatter,) = slowly.survey.beams.drawing.splatters.values()
            assert splatter._portion is not None and splatter._portion.units == 16
        assert slowly.stats.photons == freely.stats.photons
        for texture, other in zip(freely.atlas.total_textures, slowly.atlas.total_textures, strict=True):
            sums, found = (np.frombuffer(t.read(), "f4").astype(float) for t in (texture, other))
            assert np.abs(sums).max() > 0.0
            assert np.sqrt(((sums - found) ** 2).mean()) < 2e-5 * np.sqrt((sums**2).mean())
    finally:
        for light in passes:
            light.release()
            light.buffers.release()


def test_the_processor_has_no_caps(gl) -> None:
    """Sums in another order would be rounded otherwise from run to run."""
    light = traced(gl, "prism", SLOW, "srd-photons", 4_000)
    try:
        assert light.batches.splatting._part is None
        assert light.batches.budget.units == light.trace.batch
    finally:
        light.release()
        light.buffers.release()


def test_gpus_are_asked_for_short_camera_dispatches() -> None:
    assert DeviceTraits().dispatch_s <= 0.02
    budget = DispatchBudget(1 << 16, 1 << 10, 1 << 20)
    budget.learn(1 << 16, 2.0, 0.02)
    assert budget.units == 1 << 10
