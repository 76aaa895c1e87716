"""The gem panel: figures of the selected stone once they are found, 'not yet' until then, and why there are none."""

from __future__ import annotations

import time
from dataclasses import replace

from spectrasplat.base.not_yet import NOT_YET
from spectrasplat.edit.state import Selection, State
from spectrasplat.gpu.context import Context
from spectrasplat.ui.gem_thread import GemReading, GemThread
from spectrasplat.ui.panels.gem_panel import draw_gem_panel

from tests.interface.panel_rig import PanelRig, scene_state


def found(thread: GemThread, state: State) -> GemReading:
    reading = thread.reading(state)
    until = time.monotonic() + 300.0
    while reading is NOT_YET and time.monotonic() < until:
        time.sleep(0.02)
        reading = thread.reading(state)
    return reading


def test_a_stone_shows_its_figures_and_an_edited_one_those_of_its_new_glass(gl: Context) -> None:
    thread = GemThread()
    with PanelRig(gl, draw_gem_panel, scene_state("brilliant")) as rig:
        assert "Gem: ISO" not in rig.items.items  # not yet
        reading = found(thread, rig.state)
        rig.view_model = replace(rig.view_model, gem=reading)
        rig.frame(2)
        assert "Gem: ISO" in rig.items.items and "Gem: fire" in rig.items.items
        index = rig.state.selection.index
        item = rig.state.scene.objects[index]
        other = scene_state("step_cut").scene.objects[0].material
        objects = [*rig.state.scene.objects]
        objects[index] = replace(item, material=other)
        edited = replace(rig.state, scene=replace(rig.state.scene, objects=tuple(objects)))
        assert thread.reading(edited) is NOT_YET  # never the old stone's
        changed = found(thread, edited)
        assert isinstance(reading, tuple) and isinstance(changed, tuple)
        assert changed[1].glare < reading[1].glare
    thread.release()


def test_a_scene_without_a_stone_says_so(gl: Context) -> None:
    thread = GemThread()
    state = scene_state("brilliant")
    bare = replace(state, scene=replace(state.scene, objects=state.scene.objects[1:]), selection=Selection("object", 0))
    reading = thread.reading(bare)
    assert isinstance(reading, str) and "no solid of glass" in reading
    with PanelRig(gl, draw_gem_panel, bare) as rig:
        rig.view_model = replace(rig.view_model, gem=reading)
        rig.frame(2)
        assert "Gem: ISO" not in rig.items.items
    thread.release()
