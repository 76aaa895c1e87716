"""The controls every panel is made of, so that they look, align, explain and reset alike.

A row is a label in a column of fixed width and a field that fills the rest. Everywhere: hover
explains (with the unit), Ctrl+click types a value, a double click on field or label brings
back the default where there is one. Values come back as Python floats with seven digits, because
Dear ImGui itself works in float32. Each item is noted in `item_rects` by its label.

A control returns its value, as it was unless the user changed it. That something is held with the mouse or being typed
in is noted (`hold`) for the whole frame: the shell makes `State.interacting` of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np
from imgui_bundle import ImVec2, imgui
from imgui_bundle import icons_fontawesome_6 as icons

from ...base.tone_map import srgb_eotf, srgb_oetf
from ...edit import selecting
from ...edit.state import Selection, State
from ...model.io.scene_table import MAX_MAGNITUDE
from ...model.scene import Vec3
from .. import item_rects, theme
from . import slider_mark
from .numbers import named
from .rows import begin_row, double_clicked, explain, hold, how_to, is_typed_in, words
from .rows import beside as beside
from .rows import tooltip as tooltip

Choice = TypeVar("Choice", bound=str)

_PICKER_EM = 15.0
_WIDE_EM = 40.0
"""Width of a panel from which on it has two columns."""
_LARGEST = MAX_MAGNITUDE
"""Numbers beyond could not be saved either."""


def slider(
    label: str,
    value: float,
    low: float,
    high: float,
    *,
    unit: str,
    tip: str,
    reset: float | None = None,
    format: str = "%.3f",
    logarithmic: bool = False,
    mark: float | None = None,
    clamp: bool = True,
) -> float:
    """A slider from `low` to `high`.

    `unit` is shown after the number ("" for none), `reset` is what a double click brings, `mark`
    puts a notch on a linear slider, `clamp=False` lets typed values leave the range.
    """
    label_hit = begin_row(label)
    flags = _flags(logarithmic, clamp)
    with slider_mark.hidden_grab():
        changed, moved = imgui.slider_float(f"##{label}", value, low, high, _with_unit(format, unit), flags)
    smallest = slider_mark.smallest_shown(format) if logarithmic else None
    slider_mark.draw(slider_mark.share_of(value, low, high, smallest))
    if mark is not None and low < mark < high:
        slider_mark.notch((mark - low) / (high - low))
    explain(label, tip, unit, how_to(None if reset is None else (format % reset).strip()))
    return _settled(changed, value, _tidy(moved), reset, label_hit)


def whole(
    label: str,
    value: int,
    low: int,
    high: int,
    *,
    tip: str,
    reset: int | None = None,
    unit: str = "",
    clamp: bool = True,
) -> int:
    """A slider over whole numbers."""
    return round(slider(label, value, low, high, unit=unit, tip=tip, reset=reset, format="%.0f", clamp=clamp))


def reciprocal_slider(
    label: str, value: float, low: float, *, unit: str, tip: str, reset: float | None = None
) -> float:
    """A slider over `low` to infinity that is even in 1/value, as an Abbe number feels even.

    Any number can be typed, negative ones too; the caller judges it. Infinity is shown as "none".
    """
    label_hit = begin_row(label)
    reverse = 0.0 if math.isinf(value) else 1.0 / value
    if is_typed_in(label):
        changed, moved = imgui.slider_float(f"##{label}", value if math.isfinite(value) else 0.0, low, 100.0, "%.2f")
        after = _tidy(moved)
    else:
        shown = "none" if math.isinf(value) else _with_unit(f"{value:.2f}", unit)
        with slider_mark.hidden_grab():
            changed, moved = imgui.slider_float(f"##{label}", reverse, 1.0 / low, 0.0, shown)
        slider_mark.draw(slider_mark.share_of(reverse, 1.0 / low, 0.0))
        after = math.inf if abs(moved) < 1e-4 else float(f"{1.0 / moved:.5g}")
    explain(label, tip, unit, how_to(None if reset is None else "none" if math.isinf(reset) else f"{reset:.2f}"))
    return _settled(changed, value, after, reset, label_hit, infinite=True)


def drag(
    label: str,
    value: float,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    unit: str,
    tip: str,
    reset: float | None = None,
    format: str = "%.3f",
    logarithmic: bool = False,
    speed: float | None = None,
) -> float:
    """A number changed by dragging across it, for ranges without natural ends.

    `speed` is the change a pixel; None takes half a percent of the value. `low` and `high` may be infinite.
    """
    label_hit = begin_row(label)
    step = speed if speed is not None else max(abs(value) * 5e-3, 1e-4)
    ends = max(low, -_LARGEST), min(high, _LARGEST)
    flags = _flags(logarithmic, True) | _no_typing_by_double_click()
    changed, moved = imgui.drag_float(f"##{label}", value, step, *ends, _with_unit(format, unit), flags)
    explain(label, tip, unit, how_to(None if reset is None else (format % reset).strip()))
    # What was clamped to the end of all numbers was infinity, or meant to be.
    return _settled(changed, value, _tidy(moved) if abs(moved) < 0.999 * _LARGEST else math.inf, reset, label_hit)


def vec3(
    label: str,
    value: Vec3,
    *,
    unit: str,
    tip: str,
    speed: float = 0.01,
    format: str = "%.3f",
    reset: Vec3 | None = None,
) -> Vec3:
    """Three numbers x, y, z in one row, marked red, green and blue. Other units than degrees are in the tooltip."""
    label_hit = begin_row(label)
    before = [float(v) for v in value]
    flags = imgui.SliderFlags_.color_markers.value | _no_typing_by_double_click()
    shown = _with_unit(format, unit if unit == "°" else "")
    changed, after = imgui.drag_float3(f"##{label}", list(before), speed, 0.0, 0.0, shown, flags)
    explain(label, tip, unit, how_to(None if reset is None else ", ".join(f"{v:g}" for v in reset)))
    if reset is not None and (label_hit or double_clicked()):
        imgui.internal.clear_active_id()
        return reset
    hold(imgui.is_item_active())
    changed = changed and all(abs(number) <= _LARGEST for number in after)
    # Only what moved is rounded to float32: the other two keep their digits.
    x, y, z = (_tidy(b) if np.float32(b) != np.float32(a) else a for a, b in zip(before, after, strict=True))
    return (x, y, z) if changed else value


def combo(label: str, options: Sequence[Choice] | Mapping[Choice, str], current: Choice, *, tip: str) -> Choice:
    """A choice. A mapping shows its values and returns its keys; `current` need not be among the options."""
    shown: Mapping[Choice, str] = options if isinstance(options, Mapping) else {option: option for option in options}
    preview = named(shown.get(current, current))
    begin_row(label, _boxed(preview))
    chosen = current
    opened = imgui.begin_combo(f"##{label}", preview)
    if opened:
        for key, text in shown.items():
            if imgui.selectable(f"{named(text)}##{key}", key == current)[0]:
                chosen = key
            item_rects.note(text)
            if key == current:
                imgui.set_item_default_focus()
        imgui.end_combo()
    explain(label, "" if opened else tip)
    return chosen


def toggle(label: str, value: bool, *, tip: str) -> bool:
    """A box to tick, in the column of the fields, its words behind it."""
    begin_row("", _boxed(label))
    _, ticked = imgui.checkbox(label, value)
    explain(label, tip)
    return ticked


def _boxed(text: str) -> float:
    """Width of a text with a square button and their margins, pixels."""
    style = imgui.get_style()
    return imgui.calc_text_size(text).x + imgui.get_frame_height() + 2.0 * style.frame_padding.x


def button(label: str, *, tip: str, enabled: bool = True, width: float = 0.0) -> bool:
    """A button; `width` in pixels, 0 fits the text, −1 fills the row. What is off still explains itself."""
    imgui.begin_disabled(not enabled)
    pressed = imgui.button(label, ImVec2(width, 0.0))
    imgui.end_disabled()
    explain(label, tip)
    return pressed


def menu_button(label: str, options: Mapping[str, str], *, tip: str) -> str | None:
    """A button that opens a list; the one that was chosen. `options` are names and what their tooltips say."""
    if button(label, tip=tip):
        imgui.open_popup(f"list of {label}")
    chosen = None
    if imgui.begin_popup(f"list of {label}"):
        for name, remark in options.items():
            if imgui.selectable(name, False)[0]:
                chosen = name
            explain(name, remark)
        imgui.end_popup()
    return chosen


def colour(label: str, rgb: Vec3, *, tip: str, highest: float = math.inf) -> Vec3:
    """A linear Rec.709 colour: its numbers, linear as in scene files or with sRGB's encoding, as the button behind them
    says, and a swatch that opens a picker. None is negative, or above `highest`."""
    row = imgui.get_cursor_screen_pos()
    begin_row(label)
    is_linear = _colour_numbers["linear"]
    style, side = imgui.get_style(), imgui.get_frame_height()
    word = "linear" if is_linear else "sRGB"
    word_width = imgui.calc_text_size("linear").x + 2.0 * style.frame_padding.x
    gap = style.item_inner_spacing.x
    imgui.set_next_item_width(max(imgui.get_content_region_avail().x - side - word_width - 2.0 * gap, side))
    flags = imgui.ColorEditFlags_
    shown = list(rgb) if is_linear else srgb_oetf(np.array(rgb)).tolist()
    changed, numbers = imgui.color_edit3(
        f"##{label}", shown, flags.float.value | flags.no_small_preview.value | flags.no_options.value
    )
    hold(imgui.is_item_active())
    explain(label, f"{tip} These numbers are {word}.")
    found = numbers[:3] if is_linear else srgb_eotf(np.array(numbers[:3])).tolist()
    imgui.same_line(0.0, gap)
    encoded = srgb_oetf(np.clip(rgb, 0.0, 1.0)).tolist()
    if imgui.color_button(
        f"##swatch {label}",
        imgui.ImVec4(encoded[0], encoded[1], encoded[2], 1.0),
        flags.no_tooltip.value,
        ImVec2(side, side),
    ):
        imgui.open_popup(f"picker of {label}")
    explain(f"{label}: swatch", "Choose the colour by eye.")
    if imgui.is_popup_open(f"picker of {label}"):
        _place_beside_row(row)
    if imgui.begin_popup(f"picker of {label}"):
        imgui.set_next_item_width(theme.em(_PICKER_EM))
        picked, by_eye = imgui.color_picker3(f"##picker {label}", encoded, flags.no_inputs.value)
        hold(imgui.is_item_active())
        item_rects.note(f"{label}: picker")
        if picked:
            changed, found = True, srgb_eotf(np.array(by_eye[:3])).tolist()
        imgui.end_popup()
    imgui.same_line(0.0, gap)
    if imgui.button(f"{word}##{label}", ImVec2(word_width, 0.0)):
        _colour_numbers["linear"] = not is_linear
    explain(f"{label}: numbers", "Linear: the numbers of scene files. sRGB: encoded, as in pictures and on the web.")
    if not changed or not all(map(math.isfinite, found)) or min(found) < 0.0:
        return rgb
    r, g, b = (min(_tidy(c), highest) for c in found)
    return r, g, b


def _place_beside_row(row: ImVec2) -> None:
    """Place the next window where it does not hide the row, whose numbers follow it: left of the panel's rows, right of
    them, or below where neither side has room."""
    view, gap, side = imgui.get_main_viewport(), theme.em(0.6), theme.em(_PICKER_EM + 2.0)
    left, top = view.work_pos
    right, bottom = left + view.work_size.x, top + view.work_size.y
    beyond = imgui.get_window_pos().x + imgui.get_window_width() + gap
    y = max(top, min(row.y, bottom - side))
    if row.x - gap - side >= left:
        imgui.set_next_window_pos((row.x - gap, y), imgui.Cond_.appearing, (1.0, 0.0))
    elif beyond + side <= right:
        imgui.set_next_window_pos((beyond, y), imgui.Cond_.appearing)
    else:
        below = row.y + imgui.get_frame_height_with_spacing()
        if below + side <= bottom:
            imgui.set_next_window_pos((row.x, below), imgui.Cond_.appearing)
        else:
            imgui.set_next_window_pos((row.x, row.y - gap), imgui.Cond_.appearing, (0.0, 1.0))


_colour_numbers = {"linear": True}
"""How colours' numbers are shown: memory of the interface, like a scroll position."""


def text_field(label: str, value: str, *, tip: str) -> str:
    """A line of text; it changes when it is left or Enter is pressed, not with each letter."""
    begin_row(label)
    _, text = imgui.input_text(f"##{label}", value)
    done = imgui.is_item_deactivated_after_edit()
    explain(label, tip)
    return text if done else value


def file_field(label: str, name: str, *, tip: str, enabled: bool = True, clear_tip: str = "") -> bool | None:
    """A file's name in the row's field, to be clicked for another one: True. With `clear_tip` a small button behind it
    takes the file away: None."""
    begin_row(label)
    style = imgui.get_style()
    room = imgui.get_content_region_avail().x
    side = imgui.get_frame_height()
    width = room - (side + style.item_inner_spacing.x if clear_tip else 0.0)
    imgui.begin_disabled(not enabled)
    imgui.push_style_var(imgui.StyleVar_.button_text_align, ImVec2(0.0, 0.5))
    imgui.push_style_color(imgui.Col_.button, imgui.get_style_color_vec4(imgui.Col_.frame_bg))
    pressed = imgui.button(
        f"{_fitting(f'{icons.ICON_FA_FOLDER_OPEN}  {name}', width - 2 * style.frame_padding.x)}##{label}",
        ImVec2(width, 0.0),
    )
    imgui.pop_style_color()
    imgui.pop_style_var()
    imgui.end_disabled()
    explain(label, tip)
    if not clear_tip:
        return pressed
    imgui.same_line(0.0, style.item_inner_spacing.x)
    cleared = imgui.button(f"{icons.ICON_FA_XMARK}##clear {label}", ImVec2(side, 0.0))
    explain(f"Clear {label}", clear_tip)
    return None if cleared else pressed


def read_out(label: str, text: str, *, tip: str) -> None:
    """A value that cannot be edited, in the row layout."""
    begin_row(label)
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(named(text))
    explain(label, tip)


def section(title: str, *, is_open: bool = True) -> bool:
    """A heading that folds; True when what is below it is to be drawn."""
    flags = imgui.TreeNodeFlags_.default_open.value if is_open else 0
    shown = imgui.collapsing_header(title, flags)
    item_rects.note(title)
    return shown


def begin_columns(name: str) -> bool:
    """Begin a table of a panel's two halves, `imgui.end_table` ends it: side by side where the panel is wide. Below the
    picture it is low and wide, and nothing has to be scrolled to."""
    is_wide = imgui.get_content_region_avail().x >= theme.em(_WIDE_EM)
    return imgui.begin_table(name, 2 if is_wide else 1, imgui.TableFlags_.sizing_stretch_same)


def hint(text: str) -> None:
    """Quiet words, wrapped to the window."""
    words(text, theme.palette().muted)


def note(text: str) -> None:
    """Something the user should know."""
    words(text, theme.palette().warning)


def error(text: str) -> None:
    """Something that was refused, and why; written as a sentence whatever its ends."""
    end = "" if text.endswith("?") else "."
    words(f"{text[:1].upper()}{text[1:].rstrip('.')}{end}", theme.palette().error)


def unless_locked(state: State, selection: Selection, draw: Callable[[State], State]) -> State:
    """What `draw` draws and makes of the state; of what is locked its rows are shown and cannot be changed."""
    locked = selecting.is_locked(state, selection)
    if locked:
        hint("Locked: it cannot be moved. The lock in the outliner frees it.")
    imgui.begin_disabled(locked)
    state = draw(state)
    imgui.end_disabled()
    return state


# ---- parts --------------------------------------------------------------------------------


def _settled(
    changed: bool, before: float, after: float, reset: float | None, label_hit: bool, infinite: bool = False
) -> float:
    """The value after the last item and a double click on it or its label."""
    if reset is not None and (label_hit or double_clicked()):
        imgui.internal.clear_active_id()  # else the slider, still held, takes the value back in the next frame
        return reset
    hold(imgui.is_item_active())
    # "nan", "inf" and what float32 does not hold can be typed, and are no numbers; infinity where it has a meaning.
    changed = changed and (abs(after) <= _LARGEST or (infinite and math.isinf(after)))
    return after if changed else before


def _flags(logarithmic: bool, clamp: bool) -> int:
    flags = imgui.SliderFlags_.always_clamp.value if clamp else 0
    if logarithmic:
        flags |= imgui.SliderFlags_.logarithmic.value | imgui.SliderFlags_.no_round_to_format.value
    return flags


def _no_typing_by_double_click() -> int:
    """Dear ImGui opens a drag field for typing on a double click; here that resets."""
    return imgui.SliderFlags_.no_input.value if imgui.is_mouse_double_clicked(0) else 0


def _with_unit(format: str, unit: str) -> str:
    """`format` with the unit behind it, percent signs doubled for printf."""
    if not unit:
        return format
    return format + ("" if unit == "°" else " ") + named(unit).replace("%", "%%")


def _tidy(value: float) -> float:
    """A float32 as the decimal number that was meant."""
    return float(f"{value:.7g}")


def _fitting(text: str, width: float) -> str:
    """`text`, or as much of its beginning as there is room for."""
    if imgui.calc_text_size(text).x <= width:
        return text
    while text and imgui.calc_text_size(text + "…").x > width:
        text = text[:-1]
    return text + "…"
