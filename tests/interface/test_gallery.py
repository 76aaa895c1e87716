"""The scenes of the start page and their pictures."""

from __future__ import annotations

from pathlib import Path

from spectrasplat.base.paths import shipped_scenes
from spectrasplat.gpu.context import Context
from spectrasplat.ui.gallery import BEST, Gallery, best_first, picture_of


def test_titles_and_descriptions_come_from_the_files(gl: Context, tmp_path: Path) -> None:
    first, second = tmp_path / "one.toml", tmp_path / "two.toml"
    first.write_text('# White light through\n# a prism.\n\nname = "the prism"\n')
    second.write_text("name = ")
    gallery = Gallery(gl, {"one": first, "two": second})
    while gallery.is_busy:
        gallery.step()
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


def test_every_shipped_scene_has_a_picture_and_one_is_read_a_frame(gl: Context) -> None:
    scenes = shipped_scenes()
    assert not [name for name, path in scenes.items() if not picture_of(path).is_file()]
    gallery = Gallery(gl, {name: scenes[name] for name in ("prism", "default")})
    gallery.step()
    assert [entry.thumbnail is not None for entry in gallery.entries] == [True, False]
    gallery.step()
    assert all(entry.thumbnail is not None for entry in gallery.entries) and not gallery.is_busy
    gallery.release()
