"""Thumbnails of the start page: rendered once by another process, kept, and never in the way."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest
from PIL import Image
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.gpu.context import Context
from spectrasplat.ui.gallery import BEST, Gallery, best_first

MAKE = "import sys; from PIL import Image; Image.new('RGB', (32, 18), (255, 0, 0)).save(sys.argv[1])"


class Renderer:
    """Plays the process that renders; counts its calls."""

    def __init__(self, code: str = MAKE) -> None:
        self.code, self.calls = code, 0

    def __call__(self, scene: Path, output: Path) -> subprocess.Popen[bytes]:
        self.calls += 1
        return subprocess.Popen([sys.executable, "-c", self.code, str(output)], stderr=subprocess.DEVNULL)


@pytest.fixture
def scenes(tmp_path: Path) -> dict[str, Path]:
    first, second = tmp_path / "one.toml", tmp_path / "two.toml"
    first.write_text('# White light through\n# a prism.\n\nname = "the prism"\n')
    second.write_text("name = ")
    return {"one": first, "two": second}


def finish(gallery: Gallery) -> None:
    deadline = time.monotonic() + 20
    while gallery.is_busy:
        gallery.step()
        assert time.monotonic() < deadline
        time.sleep(0.005)


def until_rendering(gallery: Gallery) -> None:
    """After a look at what is there, one scene a step."""
    for _ in range(len(gallery.entries) + 1):
        gallery.step()


def test_titles_and_descriptions_come_from_the_files(gl: Context, tmp_path: Path, scenes: dict[str, Path]) -> None:
    gallery = Gallery(gl, tmp_path, scenes, Renderer())
    assert [(e.title, e.description, e.thumbnail) for e in gallery.entries] == [
        ("The prism", "White light through a prism.", None),
        ("two", "", None),
    ]
    gallery.release()


def test_the_page_begins_with_the_best_scenes_and_loses_none() -> None:
    scenes = shipped_scenes()
    ordered = best_first(scenes)
    assert tuple(ordered)[: len(BEST)] == BEST
    assert ordered == scenes
    assert list(ordered)[len(BEST) :] == sorted(set(scenes) - set(BEST))


def test_thumbnails_are_rendered_once_and_again_when_the_scene_changes(
    gl: Context, tmp_path: Path, scenes: dict[str, Path]
) -> None:
    renderer = Renderer()
    for calls in (2, 2):
        gallery = Gallery(gl, tmp_path, scenes, renderer)
        finish(gallery)
        assert renderer.calls == calls
        assert all(e.thumbnail is not None and e.thumbnail_size == (32, 18) for e in gallery.entries)
        gallery.release()
    scenes["one"].write_text('name = "another"\n')
    gallery = Gallery(gl, tmp_path, scenes, renderer)
    finish(gallery)
    assert renderer.calls == 3
    gallery.release()


def test_a_scene_that_fails_has_no_thumbnail_and_leaves_nothing(
    gl: Context, tmp_path: Path, scenes: dict[str, Path]
) -> None:
    gallery = Gallery(gl, tmp_path, scenes, Renderer("raise SystemExit(2)"))
    finish(gallery)
    assert all(entry.thumbnail is None for entry in gallery.entries)
    assert list((tmp_path / "thumbnails").iterdir()) == []
    gallery.release()


def test_closing_ends_the_process(gl: Context, tmp_path: Path, scenes: dict[str, Path]) -> None:
    gallery = Gallery(gl, tmp_path, scenes, Renderer("import time; time.sleep(60)"))
    until_rendering(gallery)
    assert gallery._job is not None
    process = gallery._job.process
    gallery.release()
    assert process.poll() is not None


def test_a_pause_ends_the_process_and_begins_it_again_later(
    gl: Context, tmp_path: Path, scenes: dict[str, Path]
) -> None:
    renderer = Renderer("import time; time.sleep(60)")
    gallery = Gallery(gl, tmp_path, scenes, renderer)
    until_rendering(gallery)
    assert gallery._job is not None
    process = gallery._job.process
    gallery.pause()
    assert process.poll() is not None
    assert gallery.is_busy, "its thumbnail is still to be made"
    renderer.code = MAKE
    finish(gallery)
    assert all(entry.thumbnail is not None for entry in gallery.entries)
    gallery.release()


@pytest.mark.slow
def test_a_shipped_scene_really_gets_one(gl: Context, tmp_path: Path) -> None:

    gallery = Gallery(gl, tmp_path, {"prism": shipped_scenes()["prism"]})
    while gallery.is_busy:
        gallery.step()
        time.sleep(0.05)
    assert gallery.entries[0].thumbnail_size == (320, 180)
    path = next((tmp_path / "thumbnails").iterdir())
    assert Image.open(path).convert("L").getextrema()[1] > 200
    gallery.release()


def test_what_is_there_is_shown_before_anything_is_rendered(gl: Context, tmp_path: Path) -> None:
    """A picture that takes a minute to render held up those behind it; and one that is a JPEG was not found."""
    (tmp_path / "slow.toml").write_text('name = "slow"\n')
    shipped = shipped_scenes()
    scenes = {"slow": tmp_path / "slow.toml", "prism": shipped["prism"], "crystal_ball": shipped["crystal_ball"]}
    renderer = Renderer("import time; time.sleep(60)")
    gallery = Gallery(gl, tmp_path, scenes, renderer)
    for _ in scenes:
        gallery.step()
    assert renderer.calls == 0
    assert [entry.thumbnail is not None for entry in gallery.entries] == [False, True, True]
    gallery.step()
    assert renderer.calls == 1
    gallery.release()
