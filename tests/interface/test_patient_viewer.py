"""How long a frame lasts: short ones while the mouse is used, longer ones for the light while it is not."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from spectrasplat.gpu.context import Context
from spectrasplat.ui import viewer as viewer_module
from spectrasplat.ui.headless import HeadlessInterface
from spectrasplat.ui.session import LAYOUT_FRAMES, Session
from spectrasplat.ui.viewer import SOFTWARE_FRAME_S, Viewer, headless_viewer

from tests.interface.fake_engine import FakeEngine


@pytest.fixture
def interface(gl: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[HeadlessInterface]:
    monkeypatch.setenv("SPECTRASPLAT_CONFIG", str(tmp_path / "config"))
    session = Session(gl, make_engine=FakeEngine)
    session.jobs.gallery.release()
    with headless_viewer(Viewer(session)) as interface:
        interface.put_mouse((300, 300))
        interface.frame(LAYOUT_FRAMES + 2)
        yield interface
    session.autosave.close()
    session.release()


def test_a_hand_gets_short_frames_and_stillness_long_ones_that_input_ends(
    interface: HeadlessInterface, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[float, ...]] = []
    run_frame = viewer_module.run_frame
    monkeypatch.setattr(
        viewer_module, "run_frame", lambda session, draw, *times: (asked.append(times), run_frame(session, draw))
    )
    interface.frame()
    budget_s, slice_s = asked[-1]
    assert slice_s == SOFTWARE_FRAME_S < budget_s
    interface.move((400, 300))
    assert asked[-1][0] <= SOFTWARE_FRAME_S and len(asked[-1]) == 1
    interface.press(2)
    assert len(asked[-1]) == 1
    interface.frame(2)  # held, without moving
    assert len(asked[-1]) == 1
    interface.let_go(2)
    interface.frame(2)
    assert len(asked[-1]) == 2
