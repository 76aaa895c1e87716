"""The panels that solve: what they ask for, and what becomes of it."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import spectrasplat as ss
from reference.caustic_plates import picture, plate
from spectrasplat.base.errors import UserError
from spectrasplat.base.image_io import write_image
from spectrasplat.edit.requests import CheckPlate, Derive, MatchGlass
from spectrasplat.edit.state import Selection, Solve, State
from spectrasplat.gpu.context import Context
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.scene import Camera, Dielectric, Scene, SceneObject
from spectrasplat.render.light_target import flat_receiver
from spectrasplat.ui.export import Exports
from spectrasplat.ui.panels.lens_panel import draw_lens_panel
from spectrasplat.ui.panels.solve_panel import draw_solve
from spectrasplat.ui.screenshot import Shown

from tests.interface.panel_rig import PanelRig, scene_state

CAMERA = Camera((0.0, -900.0, 300.0), (0.0, 0.0, 0.0))


def finished(exports: Exports) -> str:
    """The sentence at the job's end."""
    until = time.monotonic() + 300.0
    while time.monotonic() < until:
        note = exports.step(0.05)
        if note is not None:
            return note
    raise AssertionError("the job did not end")


def plate_state(tmp_path: Path) -> State:
    item = SceneObject("plate", plate(300.0, find("PMMA").n_d, resolution=61), Dielectric(find("PMMA")))
    write_image(tmp_path / "target.npy", picture().astype(np.float32))
    solve = Solve(plate_target=tmp_path / "target.npy", plate_distance=300.0)
    return State(Scene("plate", CAMERA, (), (item,)), CAMERA, selection=Selection("object", 0), solve=solve)


def test_what_is_wanted_is_asked_for(gl: Context) -> None:
    with PanelRig(gl, draw_solve, scene_state()) as rig:
        rig.click("Derive")
        assert rig.state.requests == (Derive("objects.prism.position.x"),)
        rig.state = replace(rig.state, requests=(), solve=Solve(wanted="width", width=0.2))
        rig.frame(2)
        rig.click("Find the glass of prism")
        assert not rig.state.requests  # where is that width?
        line = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
        rig.state = replace(rig.state, measured=line)
        rig.frame(2)
        rig.click("Find the glass of prism")
        assert rig.state.requests == (MatchGlass(0, None, 0.2, line),)
        rig.state = replace(rig.state, requests=(), solve=replace(rig.state.solve, parameter="objects.prism.V_d"))
        rig.frame(2)
        rig.click("Fit objects.prism.V_d")
        assert rig.state.requests == (MatchGlass(0, None, 0.2, line, ("objects.prism.V_d",)),)


def test_a_plate_is_checked_in_the_window(gl: Context, tmp_path: Path) -> None:
    """Asked for, not there yet, there, and old once the distance is another; what is no plate is refused at once."""
    state = plate_state(tmp_path)
    exports = Exports(gl)
    shown = Shown(None, None, 0.0, 0)  # type: ignore[arg-type]
    with PanelRig(gl, draw_lens_panel, state, (420, 1200)) as rig:
        rig.click("Check plate")
        asked = rig.state.requests[-1]
        assert asked == CheckPlate(0, tmp_path / "target.npy", 300.0)
        assert exports.found.entries().get("plate") is None
        exports.begin(asked, state, shown)
        assert "see the Lens panel" in finished(exports)
        found = exports.found.entries().get("plate")
        assert found is not None and found.codes.shape[1] > 2 * found.codes.shape[0] > 0
        assert "correlation 0.9" in dict(found.rows)["error"]
        rig.view_model = replace(rig.view_model, found={"plate": found})
        rig.frame(2)
        assert "Efficiency" in rig.items.items
        item = state.scene.objects[0]
        of = [item.mesh, item.object_to_world, item.material.dispersion, tmp_path / "target.npy"]
        assert found.is_of(*of, 300.0) and not found.is_of(*of, 310.0) and not found.is_of(*of, None)
    exports.begin(asked, state, shown)
    exports.step(0.05)
    assert exports.cancel() == "The plate was not checked." and exports.job is None
    with pytest.raises(UserError, match="no plate|is flat|both sides"):
        exports.begin(replace(asked, index=0), scene_state(), shown)
    exports.release()


def test_a_derivative_is_found_in_the_window(gl: Context) -> None:
    """As a picture of red and blue; a parameter that changes no light is refused."""
    exports, state = Exports(gl), replace(scene_state("spectrum"), viewport_size=(48, 27))
    shown = Shown(None, None, 0.0, 0)  # type: ignore[arg-type]
    exports.begin(Derive("objects.prism.n_d", 2048), state, shown)
    assert exports.found.entries().get("derivative") is None
    assert "Solve panel" in finished(exports)
    found = exports.found.entries().get("derivative")
    assert found is not None and found.texture and found.is_of(state.scene, state.camera, "objects.prism.n_d")
    red, blue = (found.codes[..., i].astype(int) - found.codes[..., 1] for i in (0, 2))
    assert red.max() > 100 and blue.max() > 100
    with pytest.raises(UserError, match="changes no light"):
        exports.begin(Derive("camera.position.x"), state, shown)
    exports.release()


def test_a_number_is_fitted_in_the_window(gl: Context, tmp_path: Path) -> None:
    """By the colours that a prism of a known V_d casts; one that changes no light is refused at once."""
    true = ss.load("spectrum")
    true.objects["prism"].update(glass=None, material={"n_d": 1.80, "V_d": 20.0})
    found = ss.caustic(true, "screen", size=(64, 64), photons=8192)
    corners = tuple(tuple(found.placement["corners_world"][at]) for at in ("top_left", "top_right", "bottom_left"))
    write_image(tmp_path / "wanted.npy", found.rgb)
    ask = MatchGlass(0, tmp_path / "wanted.npy", None, corners, ("objects.prism.V_d",), 8192)
    start = true.copy()
    start.objects["prism"].update(material={"n_d": 1.80, "V_d": 22.0})
    state = State(start._model, start._model.camera, viewport_size=(48, 27))
    exports = Exports(gl)
    shown = Shown(None, None, 0.0, 0)  # type: ignore[arg-type]
    exports.begin(ask, state, shown)
    assert "objects.prism.V_d: " in finished(exports)
    answer = exports.found.entries().get("answer")
    assert answer is not None and answer.is_of(state.scene) and not answer.is_of(scene_state("spectrum").scene)
    rows = dict(answer.rows)
    assert float(rows["objects.prism.V_d"].split()[0]) == pytest.approx(20.0, abs=0.5)
    assert rows["By"] == "wanted.npy, on 'screen'" and rows["what is left"].startswith("differs by")
    with PanelRig(gl, draw_solve, replace(state, selection=Selection("object", 0))) as rig:
        rig.view_model = replace(rig.view_model, found={"answer": answer})
        rig.frame(2)
        assert {"Asked", "objects.prism.V_d", "What is left"} <= set(rig.items.items)
    with pytest.raises(UserError, match="changes no light"):
        exports.begin(replace(ask, of=("camera.position.x",)), state, shown)
    exports.release()


def test_the_ruler_names_the_receiver() -> None:
    """The flat one that its points lie on; elsewhere it is refused."""
    scene = scene_state("spectrum").scene
    assert flat_receiver(scene, ((3.629, 0.0, -1.684),)) == "screen"
    with pytest.raises(UserError, match="does not lie on a flat receiver"):
        flat_receiver(scene, ((0.0, 0.0, 0.0),))
