"""The gem panel: figures and pictures of the selected stone once they are asked for, and why there are none."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest
from spectrasplat.edit.requests import JudgeStone
from spectrasplat.edit.state import Selection
from spectrasplat.gpu.context import Context
from spectrasplat.model.gems import report
from spectrasplat.ui.export import Exports
from spectrasplat.ui.panels.gem_panel import draw_gem_panel
from spectrasplat.ui.screenshot import Shown

from tests.interface.panel_rig import PanelRig, scene_state


def test_a_stone_is_judged_in_the_window(gl: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    """Asked for, not there yet, there with four (small) pictures, and old once the stone is of another glass."""
    for name, rays in (("SIDE", 64), ("_FACE_COUNT", 48), ("_TILT_COUNT", 24)):
        monkeypatch.setattr(report, name, rays)
    exports = Exports(gl)
    with PanelRig(gl, draw_gem_panel, scene_state("brilliant")) as rig:
        rig.click("Judge diamond")
        (asked,) = rig.state.requests
        assert asked == JudgeStone("diamond") and "ISO" not in rig.items.items
        exports.begin(asked, rig.state, Shown(None, None, 0.0, 0))  # type: ignore[arg-type]
        until, note = time.monotonic() + 300.0, None
        while note is None and time.monotonic() < until:
            note = exports.step(0.05)
        assert note is not None and "Gem panel" in note
        found = exports.found.entries().get("gem")
        assert found is not None and found.codes.shape == (128, 128, 3) and dict(found.rows)["leak"]
        rig.view_model = replace(rig.view_model, found={"gem": found})
        rig.frame(2)
        assert {"ISO", "Fire", "Scintillation"} <= set(rig.items.items)
        item = rig.state.scene.objects[rig.state.selection.index]
        other = scene_state("step_cut").scene.objects[0].material
        assert found.is_of(item) and not found.is_of(replace(item, material=other))
    exports.release()


def test_a_scene_without_a_stone_says_so(gl: Context) -> None:
    state = scene_state("brilliant")
    bare = replace(state, scene=replace(state.scene, objects=state.scene.objects[1:]), selection=Selection("object", 0))
    with PanelRig(gl, draw_gem_panel, bare) as rig:
        rig.frame(2)
        assert not any(name.startswith("Judge") for name in rig.items.items)
