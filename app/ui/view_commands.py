"""Commands about what is seen: camera, numbered views, panels, display. Functions of state and view model, see
`commands`."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from ..edit.requests import FrameSelection, Notice
from ..edit.state import Panels, Selection, State
from .view_model import ViewModel

_NOT_HIDDEN = ("start_page", "shortcuts", "about")
"""Windows that "Hide panels" leaves alone."""

_hidden: list[Panels] = []
"""What the last "Hide panels" closed: memory of the interface, like a scroll position, so no part of the state."""


def frame_all(state: State, _view_model: ViewModel) -> State:
    """Fit the whole scene: framing with nothing selected."""
    return replace(state, selection=Selection()).asking(FrameSelection())


def scene_view(state: State, _view_model: ViewModel) -> State:
    """Back to the saved camera."""
    return replace(state, camera=state.scene.camera)


def keep_as_scene_view(state: State, _view_model: ViewModel) -> State:
    """Save the present camera with the scene (an edit like others)."""
    return state.edited(replace(state.scene, camera=state.camera), "Keep view")


def go_to_view(number: int, state: State, _view_model: ViewModel) -> State:
    """Go to numbered view `number` (0 to 8); a notice where none is stored."""
    camera = state.views[number]
    if camera is None:
        return state.asking(Notice(f"View {number + 1} is empty. Ctrl+{number + 1} stores the present view there."))
    return replace(state, camera=camera)


def store_view(number: int, state: State, _view_model: ViewModel) -> State:
    """Store the camera as numbered view `number` (0 to 8)."""
    views = (*state.views[:number], state.camera, *state.views[number + 1 :])
    return replace(state, views=views).asking(
        Notice(f"Stored as view {number + 1}. Key {number + 1} comes back to it.")
    )


def hide_panels(state: State, _view_model: ViewModel) -> State:
    """Close all panels, or open those again that the last call closed."""
    panels = state.preferences.panels
    names = [f.name for f in fields(Panels) if f.name not in _NOT_HIDDEN]
    is_open = [name for name in names if getattr(panels, name)]
    if is_open:
        _hidden[:] = [panels]
        return state.with_panels(**dict.fromkeys(is_open, False))
    before = _hidden.pop() if _hidden else Panels()
    return state.with_panels(**{name: getattr(before, name) for name in names})


def expose(stops: float, state: State, view_model: ViewModel) -> State:
    """Change the exposure by `stops` from the one in use; it is the user's from then on."""
    in_use = view_model.exposure_ev if state.display.auto_exposure else state.display.exposure_ev
    return replace(state, display=replace(state.display, exposure_ev=in_use + stops, auto_exposure=False))


def toggle_auto(state: State, view_model: ViewModel) -> State:
    """Automatic exposure on, or off at the present value."""
    if state.display.auto_exposure:
        return expose(0.0, state, view_model)
    return replace(state, display=replace(state.display, auto_exposure=True))


def toggle_display(name: str, state: State, _view_model: ViewModel) -> State:
    """Turn the switch `Display.<name>`."""
    changed: Any = {name: not getattr(state.display, name)}
    return replace(state, display=replace(state.display, **changed))


def toggle_solo(state: State, _view_model: ViewModel) -> State:
    """One wavelength only, or all light again."""
    return replace(state, solo_nm=None if state.solo_nm is not None else SOLO_START_NM)


SOLO_START_NM = 550.0
"""Where single-wavelength display starts: green, which every white light has."""
