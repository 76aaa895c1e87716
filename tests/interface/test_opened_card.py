"""What is asked on the picture of a freshly opened file, with a synthetic mouse; and what a session remembers of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.edit import requests
from spectrasplat.edit.document import Document
from spectrasplat.edit.preferences import MAX_UP, Settings, load_settings
from spectrasplat.edit.state import Selection, State
from spectrasplat.gpu.context import Context
from spectrasplat.model.io.mesh_io import save_ply
from spectrasplat.model.scene import Dielectric, Diffuse
from spectrasplat.model.scene_objects import make_shape
from spectrasplat.ui.frame import run_frame, view_model_of
from spectrasplat.ui.panels import opened_card
from spectrasplat.ui.session import Session
from spectrasplat.ui.view_model import ViewModel

from tests.interface.fake_engine import FakeEngine
from tests.interface.panel_rig import scene_state
from tests.interface.shell_rig import ShellRig


@pytest.fixture(autouse=True)
def nothing_closed() -> None:
    opened_card._memory |= {"closed": "", "part": "0", "glass": "N-BK7", "selected": ""}


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPECTRASPLAT_CONFIG", str(tmp_path / "config"))


@pytest.fixture
def torus(tmp_path: Path) -> Path:
    save_ply(make_shape("torus"), tmp_path / "own.ply")
    return tmp_path / "own.ply"


def opaque() -> State:
    state = scene_state()
    objects = tuple(
        replace(o, material=Diffuse()) if isinstance(o.material, Dielectric) else o for o in state.scene.objects
    )
    return replace(state, scene=replace(state.scene, objects=objects))


def test_a_scene_of_glass_whose_file_says_what_is_up_is_asked_nothing(gl: Context) -> None:
    rig = ShellRig(gl)
    assert "Window: opened" not in rig.items.items


def test_what_is_not_glass_is_made_glass_by_a_click(gl: Context) -> None:
    rig = ShellRig(gl, opaque())
    before = rig.state.scene
    assert not any(o.material.transmits for o in before.objects)
    rig.click("Glass")
    rig.frame(2)
    rig.click("diamond")
    rig.frame(2)
    rig.click("Make glass")
    rig.frame(2)
    made = rig.state.scene.objects[0].material
    assert isinstance(made, Dielectric) and made.dispersion.n_d == pytest.approx(2.4175, abs=1e-3)
    assert rig.state.edit_label == f"Make {before.objects[0].name} glass"
    assert "Window: opened" not in rig.items.items


def test_the_part_is_what_is_selected_until_another_is_chosen(gl: Context) -> None:
    rig = ShellRig(gl, opaque())
    rig.state = replace(rig.state, selection=Selection("object", 1))
    rig.frame(2)
    rig.click("Make glass")
    rig.frame(2)
    objects = rig.state.scene.objects
    assert [isinstance(o.material, Dielectric) for o in objects[:2]] == [False, True]


def test_the_question_can_be_closed_and_comes_back_with_another_file(gl: Context) -> None:
    rig = ShellRig(gl, opaque())
    rig.click("Close")
    rig.frame(2)
    assert "Window: opened" not in rig.items.items
    rig.view_model = replace(rig.view_model, title="another")
    rig.frame(2)
    assert "Window: opened" in rig.items.items


def test_the_other_axis_is_asked_for(gl: Context) -> None:
    rig = ShellRig(gl, view_model=ViewModel(title="own.ply", up="y"))
    rig.click("z is up")
    rig.frame()
    assert rig.asked == [requests.StandUp("z")]


def heights(session: Session) -> np.ndarray:
    item = session.state.scene.objects[0]
    return np.ptp(item.mesh.vertices @ item.object_to_world[:3, :3].T, axis=0)


@pytest.fixture
def session(gl: Context, config: None, torus: Path) -> Iterator[Session]:
    session = Session(gl, torus, make_engine=FakeEngine)
    yield session
    session.autosave.close()
    session.release()


def test_a_file_is_stood_up_and_that_is_remembered(session: Session, gl: Context, torus: Path) -> None:
    assert view_model_of(session).up == "z" and int(np.argmin(heights(session))) == 2
    asked = [requests.StandUp("y")]

    def draw(state: State, view_model: ViewModel) -> State:
        return replace(state, viewport_size=(64, 36)).asking(*[asked.pop()] if asked else [])

    for _ in range(2):
        session.prepare()
        run_frame(session, draw)
        session.finished()
    assert view_model_of(session).up == "y" and int(np.argmin(heights(session))) == 1
    session.close()
    again, _ = load_settings()
    assert again.up_of(torus) == "y"
    # Another day the file stands as it was said to.
    later = Session(gl, torus, make_engine=FakeEngine)
    assert int(np.argmin(heights(later))) == 1
    later.autosave.close()
    later.release()


def test_an_edited_file_is_not_opened_anew(torus: Path) -> None:
    document = Document.open(torus)
    document.history.push("Rename", replace(document.scene, name="mine"))
    assert document.up is None
    with pytest.raises(Exception, match="not edited yet"):
        document.stood_up("y")


def test_only_the_last_files_are_remembered() -> None:
    settings = Settings()
    for number in range(MAX_UP + 5):
        settings = settings.said_up(Path(f"/a/{number}.obj"), "y")
    settings = settings.said_up(Path("/a/50.obj"), "z")
    assert len(settings.up) == MAX_UP and settings.up_of(Path("/a/50.obj")) == "z"
    assert settings.up_of(Path("/a/1.obj")) is None and settings.up_of(Path(f"/a/{MAX_UP + 4}.obj")) == "y"
