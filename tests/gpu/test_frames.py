"""A still is one frame: what an animation shows first is what `render` makes, whatever scene, method and layer; and
what chooses the sampling is the same for all."""

from __future__ import annotations

import time
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.animation import Track, keyed
from spectrasplat.edit.parameters import Stage
from spectrasplat.gpu import shader
from spectrasplat.gpu.context import Context
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import RenderDefaults
from spectrasplat.model.settings import CAMERA_METHODS, METHODS, RenderSettings
from spectrasplat.render.animate import render_animation
from spectrasplat.render.frames import FrameRenderer
from spectrasplat.render.sampling import CameraSampling, most_bands, whole_cycles
from spectrasplat.render.still import render

SCENES = sorted(path.stem for path in (assets_dir() / "scenes").glob("*.toml"))
SHAKY = 1e-6
EYES = [(method, None) for method in METHODS] + [("srd", method) for method in CAMERA_METHODS if method != "srd"]


@pytest.fixture(scope="module", autouse=True)
def programs_kept(gl: Context):
    """As the commands do it."""
    shader.keep_programs(gl.ctx)
    yield
    shader.forget_programs(gl.ctx)


class First:
    """A sink that keeps the linear picture of the first frame."""

    def __init__(self) -> None:
        self.rgb: np.ndarray | None = None

    def has(self, index: int) -> bool:
        return False

    def claimed(self, index: int) -> AbstractContextManager[bool]:
        return nullcontext(True)

    def develop(self, rgb: np.ndarray, exposure_ev: float, look: RenderDefaults) -> np.ndarray:
        self.rgb = rgb if self.rgb is None else self.rgb
        return np.zeros(rgb.shape, np.uint8)

    def write(self, index: int, codes: np.ndarray) -> None:
        pass

    def close(self) -> None:
        pass


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize(("method", "camera_method"), EYES)
def test_the_first_frame_is_the_picture(gl: Context, name: str, method: str, camera_method: str | None) -> None:
    scene = load_scene(assets_dir() / "scenes" / f"{name}.toml")
    settings = RenderSettings(
        width=48,
        height=27,
        photons=10_000,
        method=method,
        camera_method=camera_method,
        max_depth=scene.render.max_depth,
    )
    picture = render(scene, settings, context=gl).rgb
    made = keyed(
        Stage(scene, scene.camera), [Track("exposure_ev", (0.0, 1.0), (0.0, 1.0), ("linear", "linear"))], 2, 2.0
    )
    first = First()
    for _ in render_animation(gl, made, settings, first, 0.0, first.develop):
        pass
    assert first.rgb is not None and picture.shape == first.rgb.shape
    assert np.abs(first.rgb - picture).max() <= SHAKY * np.abs(picture).max()


def test_a_gem_of_an_animation_may_be_sampled_by_single_wavelengths(gl: Context) -> None:
    """Only stills were once."""
    scene = load_scene(assets_dir() / "scenes" / "brilliant_studio.toml")
    stage = Stage(scene, scene.camera)
    renderer = FrameRenderer(gl, RenderSettings(width=96, height=54, photons=1_000), [stage])
    try:
        renderer.run(stage)
        camera_pass = renderer.camera_pass
        assert camera_pass is not None and camera_pass.spectrum.single
        assert camera_pass.samples_taken == camera_pass.spectrum.samples(16)
    finally:
        renderer.release()


def test_a_stop_while_tracing_still_gives_a_picture(gl: Context) -> None:
    scene = load_scene(assets_dir() / "scenes" / "prism.toml")
    settings = RenderSettings(width=48, height=27, photons=400_000, batch=1 << 13, method="srd-photons")
    told: list[tuple[float, str]] = []
    result = render(
        scene,
        settings,
        progress=lambda share, text: told.append((share, text)),
        cancelled=lambda: (told[-1][1] == "tracing photons" and told[-1][0] > 0.2) or told[-1][0] >= 0.8,
        context=gl,
    )
    assert 50_000 < result.stats.photons < 200_000
    assert result.stats.camera_pass.samples == 1 and result.rgb.max() > 0.0
    assert [share for share, _ in told] == sorted(share for share, _ in told)


@pytest.mark.parametrize("name", ["prism", pytest.param("brilliant", marks=pytest.mark.slow)])
def test_a_stop_before_the_first_camera_sample_waits_for_it(gl: Context, name: str) -> None:
    """While a survey looks at the picture and while beams are drawn no pixel has a sample: what was written was
    black."""
    scene = load_scene(assets_dir() / "scenes" / f"{name}.toml")
    settings = RenderSettings(width=64, height=36, photons=20_000, spp=16)
    told: list[tuple[float, str]] = []
    result = render(
        scene,
        settings,
        progress=lambda share, text: told.append((share, text)),
        cancelled=lambda: told[-1][1] == "taking camera samples",
        context=gl,
    )
    camera = result.stats.camera_pass
    assert 1 <= camera.samples < 16
    assert camera.samples >= min(camera.spectrum.bands, 16)
    assert (result.rgb.max(axis=(1, 2)) > 0.0).mean() > 0.5


# Ten per cent is for a machine that has nothing else to do (slow: alone, without other tests beside it).
@pytest.mark.parametrize("within", [3.0, pytest.param(0.1, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("name", "layer"), [pytest.param("ball", "beauty", marks=pytest.mark.slow), ("prism", "map:table")]
)
def test_seconds_are_those_of_the_whole_picture(gl: Context, name: str, layer: str, within: float) -> None:
    scene = load_scene(assets_dir() / "scenes" / f"{name}.toml")
    if layer != "beauty":
        layer = f"map:{next(o.name for o in scene.objects if o.material.receives)}"
    told: list[float] = []
    seconds = 5.0 if within < 0.5 else 2.0
    settings = RenderSettings(width=96, height=54, seconds=seconds, layer=layer)
    # Programs are compiled before, as in a second rendering of a scene, those of splats that few photons lack too.
    render(scene, replace(settings, seconds=None, photons=100_000, spp=1), context=gl)
    started = time.perf_counter()
    result = render(scene, settings, progress=lambda share, text: told.append(share), context=gl)
    took = time.perf_counter() - started
    assert max(1.0 - within, 0.5) <= took / seconds <= 1.0 + within
    light = result.stats.light
    assert light.trace_seconds + light.splat_seconds > (1.5 if within < 0.5 else 0.1) and result.rgb.max() > 0.0
    assert told == sorted(told) and told[-1] > 0.85


@pytest.mark.slow
def test_samples_that_are_asked_for_are_taken_within_the_seconds(gl: Context) -> None:
    scene = load_scene(assets_dir() / "scenes" / "prism.toml")
    result = render(scene, RenderSettings(width=96, height=54, seconds=3.0, spp=3), context=gl)
    assert result.stats.camera_pass.samples == 3 and result.stats.seconds < 12.0


@pytest.mark.slow
def test_too_few_seconds_still_give_a_picture(gl: Context) -> None:
    scene = load_scene(assets_dir() / "scenes" / "prism.toml")
    told: list[float] = []
    settings = RenderSettings(width=48, height=27, seconds=0.01)
    result = render(scene, settings, progress=lambda share, text: told.append(share), context=gl)
    assert result.stats.camera_pass.samples >= 1 and result.rgb.max() > 0.0 and result.stats.photons > 0
    assert 0.98 < max(told) < 1.0  # over time, but not said to be done while it works


@pytest.mark.parametrize("samples", [1, 2, 7, 8, 15, 16, 17, 31, 32, 100, 256, 4096])
def test_all_frames_have_as_many_samples_however_many_bands_they_choose(samples: int) -> None:
    most = most_bands(samples)
    assert most & (most - 1) == 0
    whole = whole_cycles(samples, most)
    assert samples <= whole < samples + most
    for bands in (2**k for k in range(most.bit_length())):
        assert whole % bands == 0


def test_what_is_shown_while_it_is_made_compiles_no_second_program() -> None:
    assert CameraSampling.of(RenderSettings()).may_be_single
    assert not CameraSampling.live(256).may_be_single
    assert CameraSampling.live(256).bands_for == CameraSampling.live(16).bands_for


def test_no_driver_chooses_by_itself() -> None:
    """`may_be_single` and `choosing_spectrum` stand in the camera pass, in sampling.py and where stress measures it."""
    import spectrasplat

    root = Path(spectrasplat.__path__[0])
    users = {
        path.relative_to(root).as_posix()
        for path in root.rglob("*.py")
        if any(word in path.read_text(encoding="utf-8") for word in ("may_be_single", ".choosing_spectrum("))
    }
    measured = "stress/rigs/camera_probe.py"
    assert users == {"passes/camera.py", "passes/spectrum_choice.py", "render/sampling.py", measured}
