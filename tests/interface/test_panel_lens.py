"""The lens panel: figures of the selected lens and of what is on its axis, and why there are none."""

from __future__ import annotations

from dataclasses import replace

from spectrasplat.edit.state import Selection
from spectrasplat.gpu.context import Context
from spectrasplat.ui.panels.lens_panel import draw_lens_panel

from tests.interface.panel_rig import PanelRig, scene_state


def test_a_selected_lens_shows_its_figures(gl: Context) -> None:
    with PanelRig(gl, draw_lens_panel, scene_state("achromat")) as rig:
        for name in ("singlet", "flint", "table"):  # of a receiver: the scene's first lens
            index = [item.name for item in rig.state.scene.objects].index(name)
            rig.state = replace(rig.state, selection=Selection("object", index))
            rig.frame(2)
            assert "Lens: Back focus" in rig.items.items


def test_without_a_lens_it_says_so(gl: Context) -> None:
    with PanelRig(gl, draw_lens_panel, scene_state("prism")) as rig:
        rig.frame(2)
        assert "Lens: Back focus" not in rig.items.items
