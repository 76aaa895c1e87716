"""Frames of an animation: steady to the bit, traced once where only the camera moves, resumed and stopped without
loss."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.movie import Film, Frames
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.animation import Track, keyed, turntable
from spectrasplat.edit.parameters import Stage, apply
from spectrasplat.gpu import shader
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.animate import description, render_animation
from spectrasplat.render.frames import FrameRenderer
from spectrasplat.render.still import render

SMALL = RenderSettings(width=96, height=54, photons=20_000, spp=2)
GAIN = "objects.prism.dispersion_gain"


@pytest.fixture(scope="module")
def stage() -> Stage:
    scene = load_scene(assets_dir() / "scenes" / "prism.toml")
    return Stage(scene, scene.camera)


@pytest.fixture(scope="module", autouse=True)
def programs_kept(gl):
    """As the command does it."""
    shader.keep_programs(gl.ctx)
    yield
    shader.forget_programs(gl.ctx)


def frames_of(folder: Path) -> list[bytes]:
    return [path.read_bytes() for path in sorted(folder.glob("*.png"))]


def draw(gl, animation, sink, stop_after: float = 2.0) -> None:
    work = render_animation(gl, animation, SMALL, sink)
    for done in work:
        if done >= stop_after:
            break
    work.close()


@pytest.mark.slow
def test_a_turntable_traces_once_and_its_first_frame_is_the_picture(gl, stage: Stage) -> None:
    made = turntable(stage, 4, 24.0)
    renderer = FrameRenderer(gl, SMALL, [made.frame(i) for i in range(4)])
    pictures = [renderer.run(made.frame(i)) for i in (0, 1, 2, 0)]
    assert renderer.traces == 1
    renderer.release()
    assert np.array_equal(pictures[0], pictures[3])
    assert np.abs(pictures[1] - pictures[0]).max() > 0.1 * pictures[0].max()
    alone = render(stage.scene, SMALL, context=gl).rgb
    # Maps are fitted to all views, so texels differ a little: the light is the same.
    assert pictures[0].sum() == pytest.approx(alone.sum(), rel=0.02)


@pytest.mark.slow
def test_what_stands_still_stands_still(gl) -> None:
    """The dispersion of the prism grows: its fan changes, the diamond's sparks and the table do not."""
    scene = load_scene(assets_dir() / "scenes" / "default.toml")
    stage = Stage(scene, scene.camera)
    made = keyed(stage, [Track(GAIN, (0.0, 1.0), (0.8, 1.3), ("linear", "linear"))], 2, 2.0)
    stages = [made.frame(i) for i in range(2)]
    renderer = FrameRenderer(gl, SMALL, stages)
    first, second, again = (renderer.run(s) for s in (*stages, stages[0]))
    assert renderer.traces == 3
    renderer.release()
    assert np.array_equal(first, again)
    moved = np.abs(second - first).max(axis=-1)
    assert 0.05 < (moved > 1e-3 * first.max()).mean() < 0.4
    # The right of the picture: sparks of the diamond, and table. The room's light meets both: what its weak beams leave
    # to photons there changes by 8e-4 of the brightest, in maps of four texels a pixel.
    assert np.ptp(first[18:30, 72:]) > 0.1 * first.max()
    assert moved[18:30, 72:].max() <= 1.5e-3 * first.max()
    assert moved[18:30, 72:].mean() <= 5e-5 * first.max()


def test_a_frame_is_a_function_of_its_stage_alone(gl, stage: Stage) -> None:
    edited = apply(stage, GAIN, 2.0)
    alone = FrameRenderer(gl, SMALL, [edited])
    want = alone.run(edited)
    alone.release()
    after = FrameRenderer(gl, SMALL, [edited])
    after.run(apply(stage, "objects.prism.rotation.z", 3.0))
    got = after.run(edited)
    after.release()
    assert np.array_equal(got, want)


def test_dispersion_may_begin_at_nothing(gl, stage: Stage) -> None:
    """Photons of a glass without dispersion carry other columns, and such frames stand beside ordinary ones."""
    stages = [apply(stage, GAIN, gain) for gain in (0.0, 2.0)]
    renderer = FrameRenderer(gl, SMALL, stages)
    narrow, wide = (renderer.run(s) for s in stages)
    renderer.release()
    # Colour: how far the channels lie apart, as a share of all light.
    spread = [np.ptp(np.maximum(p, 0.0), axis=-1).sum() / p.sum() for p in (narrow[:, :70], wide[:, :70])]
    assert spread[1] > 1.5 * spread[0]


def test_solo_shows_one_colour(gl, stage: Stage) -> None:
    red = replace(stage, solo_nm=640.0)
    renderer = FrameRenderer(gl, SMALL, [red])
    rgb = renderer.run(red)
    renderer.release()
    total = rgb.sum(axis=(0, 1))
    assert total[0] > 3.0 * abs(total[1]) and total[0] > 3.0 * abs(total[2])


def test_a_folder_is_resumed_and_ends_as_if_never_stopped(gl, stage: Stage, tmp_path: Path) -> None:
    made = turntable(stage, 4, 24.0)
    told = description(made, SMALL, 24.0, 20_000)
    draw(gl, made, Frames(tmp_path / "whole", told))
    whole = frames_of(tmp_path / "whole")
    assert len(whole) == 4 and len(set(whole)) == 4
    draw(gl, made, Frames(tmp_path / "parts", told), stop_after=0.5)
    assert frames_of(tmp_path / "parts") == whole[:2]
    kept = whole[1]  # a frame that is there is not drawn again; one that is empty or cut is
    (tmp_path / "parts" / "0000.png").write_bytes(kept)
    (tmp_path / "parts" / "0001.png").write_bytes(b"")
    (tmp_path / "parts" / "0002.png").write_bytes(whole[2][:-20])
    draw(gl, made, Frames(tmp_path / "parts", told))
    assert frames_of(tmp_path / "parts") == [kept, *whole[1:]]
    other = description(turntable(stage, 5, 24.0), SMALL, 24.0, 20_000)
    with pytest.raises(UserError, match="another animation.*--overwrite"):
        Frames(tmp_path / "parts", other)
    assert len(frames_of(tmp_path / "parts")) == 4
    Frames(tmp_path / "parts", other, overwrite=True)
    assert frames_of(tmp_path / "parts") == []


def test_pictures_of_something_else_are_not_touched(stage: Stage, tmp_path: Path) -> None:
    (tmp_path / "0000.png").write_bytes(b"mine")
    told = description(turntable(stage, 2, 24.0), SMALL, 24.0, 20_000)
    for overwrite in (False, True):
        with pytest.raises(UserError, match="something else"):
            Frames(tmp_path, told, overwrite)
    assert (tmp_path / "0000.png").read_bytes() == b"mine"


def read_movie(path: Path, width: int, height: int) -> np.ndarray:
    """uint8 (frames, H, W, 3)."""
    command = [
        imageio_ffmpeg.get_ffmpeg_exe(),
        "-loglevel",
        "error",
        "-i",
        str(path),
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-",
    ]
    raw = subprocess.run(command, capture_output=True, check=True, timeout=30).stdout
    return np.frombuffer(raw, np.uint8).reshape(-1, height, width, 3)


def test_a_movie_stopped_early_plays(gl, stage: Stage, tmp_path: Path) -> None:
    made = turntable(stage, 6, 24.0)
    path = tmp_path / "out.mp4"
    draw(gl, made, Film(path, (96, 54), 24.0), stop_after=0.5)
    assert len(read_movie(path, 96, 54)) == 3
    draw(gl, made, Film(tmp_path / "none.mp4", (96, 54), 24.0), stop_after=0.0)
    assert [p.name for p in tmp_path.iterdir()] == ["out.mp4"]


def test_colours_survive_the_movie(tmp_path: Path) -> None:
    colours = np.array([(255, 0, 0), (0, 200, 0), (30, 30, 220), (128, 128, 128), (240, 240, 240)], np.uint8)
    frame = np.repeat(np.repeat(colours[None], 32, axis=0), 32, axis=1)
    movie = Film(tmp_path / "c.mp4", (160, 32), 10.0)
    for index in range(3):
        movie.write(index, frame)
    movie.close()
    shown = read_movie(tmp_path / "c.mp4", 160, 32)[1]
    middles = shown[16, 16::32].astype(int)
    assert np.abs(middles - colours).max() <= 6


def test_odd_sides_and_refusals(tmp_path: Path) -> None:
    movie = Film(tmp_path / "odd.mp4", (33, 17), 10.0)
    movie.write(0, np.full((17, 33, 3), 128, np.uint8))
    movie.close()
    assert read_movie(tmp_path / "odd.mp4", 34, 18).shape == (1, 18, 34, 3)
    with pytest.raises(UserError, match="does not exist"):
        Film(tmp_path / "gone" / "x.mp4", (32, 32), 10.0)
