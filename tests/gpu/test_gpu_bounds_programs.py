"""What the programs of a GPU hold and how large they are: drivers take steeply longer for large ones, and a GPU hides
its waiting for memory behind as many invocations as its registers have room for."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.bench.programs import compiled_programs
from spectrasplat.gpu import shader, strict_compilers
from spectrasplat.gpu.context import Context, create_context
from spectrasplat.gpu.device_traits import DeviceTraits, assumed
from spectrasplat.gpu.shader import Built
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings

SCENES = sorted((assets_dir() / "scenes").glob("*.toml"), key=lambda path: path.stem)
MOST_LIVE, MOST_ARRAY_WORDS, MOST_BYTES, MOST_SCENE_BYTES = 220, 64, 75_000, 500_000
LARGE = {"camera/camera.comp": (246, 76, 99_000), "light/trace.comp": (226, MOST_ARRAY_WORDS, 88_000)}
"""Programs that follow paths: more live words, array words or text than is wanted of any, which is not met since
27 November 2026. Live in the camera's at the most: a path, its event and a film's shares of both polarisations."""
OF_CRYSTALS = {"camera/camera.comp": (314, 76, 107_000), "light/trace.comp": (269, MOST_ARRAY_WORDS, 97_000)}
"""Likewise where there are crystals, since 28 November 2026: a polarised path, which glass takes 269 for by itself, and
before the camera what meets a crystal with waves of eight words each."""
_held: set[tuple[str, ...]] = set()
"""Texts that were looked at."""


@pytest.fixture(
    scope="module",
    params=[pytest.param(False, id="drawn splats", marks=pytest.mark.slow), pytest.param(True, id="added splats")],
)
def device(request: pytest.FixtureRequest) -> Iterator[Context]:
    with assumed(DeviceTraits(splats_by_compute=request.param)), create_context() as context:
        shader.keep_programs(context.ctx)
        yield context
        shader.forget_programs(context.ctx)


def programs_of(context: Context, path: Path) -> list[Built]:
    scene = load_scene(path)
    return compiled_programs(context, scene, RenderSettings(max_depth=scene.render.max_depth))


def check(programs: list[Built]) -> None:
    assert sum(len(text) for built in programs for text in built.texts) <= MOST_SCENE_BYTES
    for built in programs:
        if built.texts in _held:
            continue
        _held.add(built.texts)
        large = OF_CRYSTALS if "cross_interface(" in built.texts[0] else LARGE
        most_live, most_array_words, most_bytes = large.get(built.name, (MOST_LIVE, MOST_ARRAY_WORDS, MOST_BYTES))
        assert max(map(len, built.texts)) <= most_bytes, built.name
        if strict_compilers.missing():
            continue
        for state in strict_compilers.live_states(built):
            assert state.registers <= most_live, (built.name, state)
            assert state.scratch <= most_array_words, (built.name, state)


def test_a_scenes_programs_are_small(device: Context) -> None:
    check(programs_of(device, assets_dir() / "scenes" / "prism.toml"))


@pytest.mark.slow
@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_every_scenes_programs_are_small(device: Context, path: Path) -> None:
    check(programs_of(device, path))
