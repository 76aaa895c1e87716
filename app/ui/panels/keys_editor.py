"""The keys of an animation: which parameter has which value at what time."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from ...edit.drawn import scrubbed
from ...edit.parameters import Parameter, Stage, parts, paths, value_of
from ...edit.state import Key, State
from ...model.scene import Scene
from .. import item_rects, theme
from ..view_model import ViewModel
from . import widgets

MAX_TIME_S = 3600.0
_VIEW = tuple(f"camera.{field}.{axis}" for field in ("position", "target") for axis in "xyz")
_DEFAULT_STEP_S = 2.0
_UNITS = re.compile(r"_(deg|ev|nm)$")


@dataclass
class _Memory:
    path: str = ""
    time_s: float = 0.0


_memory = _Memory()


def draw_keys(state: State, view_model: ViewModel) -> State:
    """Draw the chooser of parameters and the table of keys."""
    stage = Stage(state.scene, state.camera, view_model.exposure_ev, state.solo_nm)
    known = paths(stage.scene, stage.camera)
    if _memory.path not in known:
        _memory.path = next((path for path in known if path.endswith(".dispersion_gain")), next(iter(known)))
    tip = f"{known[_memory.path].meaning}."
    _memory.path = widgets.combo("Parameter", _names(state.scene, known), _memory.path, tip=tip)
    how: dict[str, Any] = {"unit": "s", "format": "%.2f", "reset": 0.0, "speed": 0.02}
    _memory.time_s = widgets.drag("At", _memory.time_s, 0.0, MAX_TIME_S, tip="Time of the next key.", **how)
    half = 0.5 * (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x)
    tip = "Add a key with the parameter's present value (turns: 0, power: 1)."
    if widgets.button("Add key", tip=tip, width=half):
        state = _with(state, [Key(_memory.time_s, _memory.path, value_of(stage, _memory.path))])
        _memory.time_s += _DEFAULT_STEP_S
    imgui.same_line()
    if widgets.button(
        "Key this view", tip="Add keys for the camera's position and target as they are now.", width=half
    ):
        state = _with(state, [Key(_memory.time_s, path, value_of(stage, path)) for path in _VIEW])
        _memory.time_s += _DEFAULT_STEP_S
    return _scrub(_table(state, known))


def _scrub(state: State) -> State:
    """A line to drag along: the picture shows the animation at that time."""
    times = [key.time_s for key in state.animation]
    if len(times) < 2 or max(times) <= min(times):
        return replace(state, preview_s=None) if state.preview_s is not None else state
    first, last = min(times), max(times)
    now = first if state.preview_s is None else min(max(state.preview_s, first), last)
    tip = "Drag to see the animation at that time. The scene itself stays as it is."
    time_s = widgets.slider("Preview", now, first, last, unit="s", format="%.2f", tip=tip)
    if time_s != now:
        state = scrubbed(state, time_s)
    if state.preview_s is not None and widgets.button("End preview", tip="Show the scene itself again.", width=-1):
        state = replace(state, preview_s=None)
    return state


def frame_count(keys: Sequence[Key], fps: float) -> int:
    """Frames from the first key to the last, both included; 0 without keys."""
    if not keys:
        return 0
    times = [key.time_s for key in keys]
    return max(1, round((max(times) - min(times)) * fps) + 1)


def _names(scene: Scene, known: dict[str, Parameter]) -> dict[str, str]:
    """Path -> what the chooser shows: `prism: dispersion gain`, `camera: orbit`."""
    names = {}
    for path in known:
        head, name, field = parts(scene, path)
        words = field if field in ("n_d", "V_d") else _UNITS.sub("", field).replace("_", " ").replace(".", " ")
        owner = name or head
        names[path] = f"{owner}: {words}" if owner else words.capitalize()
    return names


def _with(state: State, keys: Sequence[Key]) -> State:
    """With more keys; one of the same parameter at the same time gives way."""
    replaced = {(key.path, key.time_s) for key in keys}
    kept = [key for key in state.animation if (key.path, key.time_s) not in replaced]
    return replace(state, animation=tuple(sorted([*kept, *keys], key=lambda key: (key.path, key.time_s))))


def _table(state: State, known: dict[str, Parameter]) -> State:
    if not state.animation:
        widgets.hint("No keys yet. Two keys of one parameter make it move; between them it eases.")
        return state
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.sizing_fixed_fit
    if not imgui.begin_table("##keys", 4, flags):
        return state
    imgui.table_setup_column("Parameter", imgui.TableColumnFlags_.width_stretch)
    imgui.table_setup_column("Time", imgui.TableColumnFlags_.width_fixed, theme.em(4.2))
    imgui.table_setup_column("Value", imgui.TableColumnFlags_.width_fixed, theme.em(5.6))
    imgui.table_setup_column("##delete", imgui.TableColumnFlags_.width_fixed, theme.em(1.8))
    imgui.table_headers_row()
    names = _names(state.scene, known)
    keys: list[Key] = []
    for index, key in enumerate(state.animation):
        imgui.push_id(index)
        changed = _row(index, key, names, known)
        imgui.pop_id()
        if changed is not None:
            keys.append(changed)
    imgui.end_table()
    missing = sorted({key.path for key in keys} - set(known))
    if missing:
        widgets.note(f"Not in this scene any more: {', '.join(missing)}. Delete these keys to render.")
    return replace(state, animation=tuple(keys)) if tuple(keys) != state.animation else state


def _row(index: int, key: Key, names: dict[str, str], known: dict[str, Parameter]) -> Key | None:
    """The key as it was left; None: deleted."""
    parameter = known.get(key.path)
    imgui.table_next_row()
    imgui.table_next_column()
    imgui.align_text_to_frame_padding()
    with theme.coloured(theme.palette().text if parameter else theme.palette().warning):
        imgui.text_unformatted(names.get(key.path, key.path))
    widgets.tooltip(
        f"{key.path}: {parameter.meaning}." if parameter else "This parameter is not in the scene any more."
    )
    imgui.table_next_column()
    imgui.set_next_item_width(-1)
    moved, time_s = imgui.drag_float(
        "##time", key.time_s, 0.02, 0.0, MAX_TIME_S, "%.2f s", imgui.SliderFlags_.always_clamp
    )
    widgets.hold(imgui.is_item_active())
    item_rects.note(f"Key {index} time")
    widgets.tooltip("Time of this key.", "Unit: s", "Ctrl+click: type")
    imgui.table_next_column()
    imgui.set_next_item_width(-1)
    low, high = (parameter.low, parameter.high) if parameter else (-1e9, 1e9)
    changed, value = imgui.drag_float(
        "##value",
        key.value,
        max(abs(key.value) * 5e-3, 1e-3),
        low,
        high,
        "%.4g",
        imgui.SliderFlags_.always_clamp | imgui.SliderFlags_.no_round_to_format,
    )
    widgets.hold(imgui.is_item_active())
    item_rects.note(f"Key {index} value")
    unit = parameter.unit if parameter else ""
    widgets.tooltip("Value of the parameter at that time.", f"Unit: {unit}" if unit else "", "Ctrl+click: type")
    imgui.table_next_column()
    deleted = imgui.button(icons.ICON_FA_TRASH)
    item_rects.note(f"Key {index} delete")
    widgets.tooltip("Delete this key.")
    if deleted:
        return None
    moved, changed = moved and math.isfinite(time_s), changed and math.isfinite(value)  # "nan" can be typed
    return replace(
        key,
        time_s=float(f"{time_s:.7g}") if moved else key.time_s,
        value=float(f"{value:.7g}") if changed else key.value,
    )
