"""Undo and redo; opening, saving, autosaving and recovering: nothing is lost and nobody's file is harmed."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.autosave import Autosave, recoveries
from spectrasplat.edit.document import Document
from spectrasplat.edit.history import MAX_STEPS, History
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.primitives import sphere
from spectrasplat.model.io.mesh_io import save_ply
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Scene, SceneObject
from spectrasplat.model.scene_defaults import default_light

SCENE = '[[objects]]\nshape = "box"\nname = "block"\nglass = "N-SF11"\n'


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "work" / "glass.toml"
    path.parent.mkdir()
    path.write_text(SCENE, encoding="utf-8")
    return path


def edited(document: Document, grey: float = 0.5) -> Scene:
    scene = replace(document.scene, environment=None, background_rgb=(grey, grey, grey))
    document.history.push("Background", scene)
    return scene


# -- the document -------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".toml", ".glb"])
def test_save_as_and_reopen_gives_the_edited_scene(file: Path, suffix: str) -> None:
    document = Document.open(file)
    assert document.path == file and document.title == "glass.toml" and not document.unsaved
    edited(document)
    assert document.unsaved
    target = document.save(file.with_name(f"other{suffix}"))
    assert not document.unsaved and document.path == document.source == target and document.title == f"other{suffix}"
    again = Document.open(target)
    assert again.scene.background_rgb == (0.5, 0.5, 0.5)
    assert [o.name for o in again.scene.objects] == [o.name for o in document.scene.objects]
    assert again.scene.objects[0].material == document.scene.objects[0].material
    assert file.read_text(encoding="utf-8") == SCENE


def test_save_without_a_name_goes_back_and_undoing_it_is_unsaved(file: Path) -> None:
    document = Document.open(file)
    edited(document)
    assert document.save() == file
    assert Document.open(file).scene.background_rgb == (0.5, 0.5, 0.5)
    document.history.undo()
    assert document.unsaved


MINE = """# My own bench, in mm.
units  = "mm"

[[objects]]
name = "block"
shape = "box"
glass = "N-SF11"
rotation_deg = [-90.0, 0, 12.5]   # turned by an eighth
rests_at_z = 0.01

[[objects]]
name = "card"
shape = "plane"
material = { kind = "diffuse", colour = 0.8 }   # white
"""


def test_another_key_in_braces_keeps_their_blanks_and_words(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(MINE, encoding="utf-8")
    document = Document.open(file)
    card = document.scene.objects[1]
    glossy = replace(card, material=replace(card.material, roughness=0.25))
    document.history.push("Coat", replace(document.scene, objects=(document.scene.objects[0], glossy)))
    text = document.save().read_text(encoding="utf-8")
    assert text == MINE.replace("colour = 0.8 }", "colour = 0.8, roughness = 0.25 }")
    document.history.push("No coat", replace(document.scene, objects=(document.scene.objects[0], card)))
    assert document.save().read_text(encoding="utf-8") == MINE


@pytest.mark.parametrize("name", ["gone/scene.toml", "scene.png", "scene"])
def test_a_failed_save_leaves_the_document_unsaved_and_where_it_was(file: Path, name: str) -> None:
    document = Document.open(file)
    edited(document)
    with pytest.raises(UserError):
        document.save(file.parent / name)
    assert document.unsaved and document.path == file and file.read_text(encoding="utf-8") == SCENE


def test_a_save_that_breaks_halfway_keeps_the_old_file(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from spectrasplat.model.io import scene_save

    document = Document.open(file)
    edited(document)

    def full(values: object, before: str) -> str:
        raise UserError("the disk is full")

    monkeypatch.setattr(scene_save, "toml_text", full)
    with pytest.raises(UserError, match="full"):
        document.save()
    assert file.read_text(encoding="utf-8") == SCENE and document.unsaved
    assert list(file.parent.iterdir()) == [file]


def test_starting_points_are_never_written_back_to(tmp_path: Path) -> None:
    save_ply(sphere(0.5), tmp_path / "ball.ply")
    ball = Document.open(tmp_path / "ball.ply")
    shipped = Document.open(assets_dir() / "scenes" / "ball.toml")
    for document, title in ((ball, "ball"), (shipped, shipped.scene.name), (Document.new(), "untitled")):
        assert document.path is None and document.title == title and not document.unsaved
        with pytest.raises(UserError, match="no file yet"):
            document.save()
    assert ball.source == tmp_path / "ball.ply"
    assert isinstance(ball.scene.objects[0].material, Dielectric) and len(ball.scene.objects) == 2


def test_a_glb_keeps_what_is_not_ours(file: Path, tmp_path: Path) -> None:
    import json

    from spectrasplat.model.io.gltf_document import open_document, save_document

    glb = Document.open(file).save(tmp_path / "a.glb")
    document = open_document(glb)
    document.json["extras"] = {"studio": "somebody else's"}
    save_document(document, glb)
    opened = Document.open(glb)
    edited(opened)
    assert "somebody else's" in json.dumps(open_document(opened.save()).json)
    edited(opened, 0.25)
    assert "somebody else's" in json.dumps(open_document(opened.save(tmp_path / "b.glb")).json)


# -- autosave -----------------------------------------------------------------------------


class Clock:
    """Seconds that pass when told to."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def test_autosave_waits_writes_aside_and_is_gone_after_a_clean_exit(file: Path, tmp_path: Path) -> None:
    clock, config = Clock(), tmp_path / "config"
    autosave = Autosave(config, 30.0, clock)
    document = Document.open(file)

    def update() -> None:
        autosave.update(document.scene, document.title, document.source, document.unsaved)
        autosave.wait()

    update()
    scene = edited(document)
    clock.now = 29.0
    update()
    assert not autosave.path.exists()
    clock.now = 31.0
    update()
    assert autosave.problem is None and autosave.path.is_file() and file.read_text(encoding="utf-8") == SCENE
    assert recoveries(config) == ()  # this process lives
    first = autosave.path.stat().st_mtime_ns
    clock.now = 99.0
    update()
    assert autosave.path.stat().st_mtime_ns == first  # nothing changed since
    edited(document, 0.6)
    update()
    assert autosave.path.stat().st_mtime_ns != first and scene is not document.scene
    document.save()
    update()
    assert list((config / "autosave").iterdir()) == []
    edited(document, 0.7)
    clock.now = 200.0
    update()
    assert autosave.path.is_file()
    autosave.close()
    assert list((config / "autosave").iterdir()) == []


def test_a_crash_leaves_a_recovery_and_recovering_belongs_to_the_old_file(file: Path, tmp_path: Path) -> None:
    config = tmp_path / "config"
    crash = f"""
import os
from dataclasses import replace
from pathlib import Path
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.geometry.primitives import sphere
from spectrasplat.edit.autosave import Autosave
from spectrasplat.edit.document import Document
document = Document.open(Path({str(file)!r}))
ball = sphere(0.5)
bare = make_mesh("scan", ball.vertices, ball.triangles, ball.corner_normals)
item = replace(document.scene.objects[0], mesh=bare)
copy = replace(item, name="twin", object_to_world=item.object_to_world + 0.0)
scene = replace(document.scene, objects=(item, copy, *document.scene.objects[1:]))
Autosave(Path({str(config)!r})).write_now(scene, document.title, document.source)
os._exit(1)
"""
    assert subprocess.run([sys.executable, "-c", crash], check=False, cwd=assets_dir().parent).returncode == 1
    (recovery,) = recoveries(config)
    assert recovery.original == file and recovery.note.title == "glass.toml"
    document = Document.recovered(recovery.load(), recovery.original)
    assert document.unsaved and document.path == file
    mesh = document.scene.objects[0].mesh
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.5, rtol=1e-5)
    assert document.scene.objects[1].mesh is mesh
    recovery.discard()
    assert list((config / "autosave").iterdir()) == [] and recoveries(config) == ()
    # What was recovered does not live on files that are gone.
    saved = Document.open(document.save())
    np.testing.assert_array_equal(saved.scene.objects[0].mesh.vertices, mesh.vertices)
    assert Path(saved.scene.objects[0].mesh.source or "").is_relative_to(file.parent)


def test_autosave_that_cannot_write_says_so_and_goes_on(tmp_path: Path, file: Path) -> None:
    blocked = tmp_path / "config"
    blocked.write_text("a file where the folder should be", encoding="utf-8")
    autosave = Autosave(blocked)
    autosave.write_now(Document.open(file).scene, "x", None)
    assert autosave.problem is not None and "autosaved" in autosave.problem
    autosave.close()
    assert recoveries(blocked) == ()


def test_damaged_notes_are_passed_over(tmp_path: Path) -> None:
    folder = tmp_path / "autosave"
    folder.mkdir()
    (folder / "1_2.json").write_text("{", encoding="utf-8")
    (folder / "3_4.json").write_text('{"pid": 3, "title": "t", "original": null, "saved_at": 1.0}', encoding="utf-8")
    assert recoveries(tmp_path) == ()  # one is broken, the other has no scene


START = Scene(
    "s", Camera((0, -3, 1), (0, 0, 0)), (default_light(),), (SceneObject("floor", primitives.plane(), Diffuse()),)
)


def grey_scene(grey: float) -> Scene:
    return replace(START, background_rgb=(grey, grey, grey))


def labels(history: History) -> list[str]:
    return [entry.label for entry in history.entries]


def test_undo_and_redo_walk_the_steps_and_say_their_names() -> None:
    history = History(START)
    a, b = grey_scene(0.1), grey_scene(0.2)
    history.push("Move prism", a)
    history.push("Rename prism", b)
    assert (history.undo_label, history.redo_label) == ("Rename prism", None)
    assert history.undo() is a and history.redo_label == "Rename prism"
    assert history.undo() is START and history.undo_label is None
    assert history.undo() is START
    assert history.redo() is a and history.redo() is b and history.redo() is b
    assert [entry.is_present for entry in history.entries] == [False, False, True]


def test_an_edit_after_undo_forgets_what_was_undone() -> None:
    history = History(START)
    history.push("A", grey_scene(0.1))
    history.push("B", grey_scene(0.2))
    history.undo()
    history.push("C", grey_scene(0.3))
    assert labels(history) == ["Open", "A", "C"] and history.redo_label is None


def test_a_drag_is_one_step_and_two_drags_are_two() -> None:
    history = History(START)
    for grey in (0.1, 0.2, 0.3):
        history.push("Move prism", grey_scene(grey), merge=True)
    assert labels(history) == ["Open", "Move prism"]
    history.settle()
    second = grey_scene(0.5)
    history.push("Move prism", grey_scene(0.4), merge=True)
    history.push("Move prism", second, merge=True)
    history.push("Turn prism", grey_scene(0.6), merge=True)
    assert labels(history) == ["Open", "Move prism", "Move prism", "Turn prism"]
    assert history.undo() is second
    history.push("Move prism", grey_scene(0.7), merge=True)  # after undo, a new drag is a new step
    assert labels(history) == ["Open", "Move prism", "Move prism", "Move prism"]


def test_edits_without_drag_never_merge_and_the_same_scene_is_no_step() -> None:
    history = History(START)
    history.push("A", grey_scene(0.1))
    history.push("A", grey_scene(0.2))
    history.push("A", history.present)
    assert labels(history) == ["Open", "A", "A"]


def test_go_to_any_entry_and_no_other() -> None:
    history = History(START)
    scenes = [grey_scene(i / 10) for i in range(5)]
    for i, each in enumerate(scenes):
        history.push(str(i), each)
    assert history.go_to(2) is scenes[1] and history.redo_label == "2"
    assert history.go_to(5) is scenes[4]
    with pytest.raises(IndexError):
        history.go_to(6)
    with pytest.raises(IndexError):
        history.go_to(-1)


def test_unsaved_follows_the_saved_step() -> None:
    history = History(START)
    assert not history.unsaved
    history.push("A", grey_scene(0.1), merge=True)
    assert history.unsaved
    history.mark_saved()
    history.push("A", grey_scene(0.2), merge=True)  # saving ended the drag: the saved step is still there
    assert history.unsaved
    history.undo()
    assert not history.unsaved
    history.undo()
    assert history.unsaved
    history.mark_unsaved()
    history.redo()
    assert history.unsaved


def test_the_oldest_steps_go_when_there_are_too_many() -> None:
    history = History(START)
    for i in range(MAX_STEPS + 20):
        history.push(str(i), grey_scene(i / 1000))
    assert len(history.entries) == MAX_STEPS + 1 and history.entries[-1].is_present
    for _ in range(MAX_STEPS + 5):
        history.undo()
    assert history.entries[0].label == "19" and history.undo_label is None and history.unsaved
