"""The controls every panel is made of, so that they look, align, explain and reset alike.

A row is a label in a column of fixed width and a field that fills the rest. Everywhere: hover
explains (with the unit), Ctrl+click types a value, a double click on field or label goes back
to the default where there is one. Values come back as Python floats with seven digits, because
Dear ImGui itself works in float32. Each item is told to `item_rects` by its label.

Values that are dragged return `active`: pass it to `holding` so that the state knows that
something is being dragged. The host lowers that flag before every frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui

from app.model.scene import Vec3
from app.ui import item_rects
from app.ui.state import State

FloatResult = tuple[bool, float, bool]
"""Whether it changed, the value, whether it is being dragged or typed in."""

_LABEL_EM, _LABEL_SHARE = 8.4, 0.42
_LEAST_FIELD_EM = 4.5
_TIP_EM = 26.0


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
) -> FloatResult:
    """A slider from `low` to `high`; typing is held to that range too.

    `unit` stands behind the number ("" for none), `reset` is what a double click brings, `mark`
    puts a notch on a linear slider.
    """
    flags = imgui.SliderFlags_.always_clamp.value | _typing_only_with_ctrl(label)
    if logarithmic:
        flags |= imgui.SliderFlags_.logarithmic.value | imgui.SliderFlags_.no_round_to_format.value
    label_hit = _begin_row(label)
    changed, moved = imgui.slider_float(f"##{label}", value, low, high, _with_unit(format, unit), flags)
    if mark is not None and low < mark < high:
        _notch((mark - low) / (high - low))
    return _end_value(label, changed, value, _tidy(moved), reset, label_hit, tip, unit, format)


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
) -> FloatResult:
    """A number changed by dragging across it, for ranges without natural ends.

    `speed` is the change a pixel; None takes half a percent of the value. `low` and `high` may be infinite.
    """
    flags = imgui.SliderFlags_.always_clamp.value | _typing_only_with_ctrl(label)
    if logarithmic:
        flags |= imgui.SliderFlags_.logarithmic.value | imgui.SliderFlags_.no_round_to_format.value
    label_hit = _begin_row(label)
    step = speed if speed is not None else max(abs(value) * 5e-3, 1e-4)
    ends = max(low, -3e38), min(high, 3e38)
    changed, moved = imgui.drag_float(f"##{label}", value, step, *ends, _with_unit(format, unit), flags)
    return _end_value(label, changed, value, _tidy(moved), reset, label_hit, tip, unit, format)


def vec3(
    label: str,
    value: Vec3,
    *,
    unit: str,
    tip: str,
    speed: float = 0.01,
    format: str = "%.3f",
    reset: Vec3 | None = None,
) -> tuple[bool, Vec3, bool]:
    """Three numbers x, y, z in one row, marked red, green and blue."""
    flags = imgui.SliderFlags_.color_markers.value | _typing_only_with_ctrl(label)
    label_hit = _begin_row(label)
    before = [float(v) for v in value]
    changed, after = imgui.drag_float3(
        f"##{label}", list(before), speed, 0.0, 0.0, _with_unit(format, unit if unit == "°" else ""), flags
    )
    # Only what moved is rounded to float32: the other two keep their digits.
    moved = tuple(_tidy(b) if np.float32(b) != np.float32(a) else a for a, b in zip(before, after, strict=True))
    active, field_hit = imgui.is_item_active(), _double_clicked()
    _explain(label, tip, unit, _reset_text("" if reset is None else ", ".join(f"{v:g}" for v in reset), True))
    if reset is not None and (label_hit or field_hit):
        imgui.internal.clear_active_id()
        return reset != value, reset, False
    return (changed, moved, active) if changed else (False, value, active)


def combo(label: str, options: Sequence[str] | Mapping[str, str], current: str, *, tip: str) -> tuple[bool, str]:
    """A choice. A mapping shows its values and returns its keys; `current` need not be among the options."""
    shown = options if isinstance(options, Mapping) else {option: option for option in options}
    _begin_row(label)
    chosen = current
    opened = imgui.begin_combo(f"##{label}", shown.get(current, current))
    if opened:
        for key, text in shown.items():
            if imgui.selectable(f"{text}##{key}", key == current)[0]:
                chosen = key
            item_rects.note(text)
            if key == current:
                imgui.set_item_default_focus()
        imgui.end_combo()
    _explain(label, "" if opened else tip, "")
    return chosen != current, chosen


def toggle(label: str, value: bool, *, tip: str) -> tuple[bool, bool]:
    """A box to tick, in the column of the fields, its words behind it."""
    _begin_row("")
    changed, ticked = imgui.checkbox(label, value)
    _explain(label, tip, "")
    return changed, ticked


def button(label: str, *, tip: str, enabled: bool = True, width: float = 0.0) -> bool:
    """A button; `width` in pixels, 0 fits the text, −1 fills the row. What is off still explains itself."""
    imgui.begin_disabled(not enabled)
    pressed = imgui.button(label, ImVec2(width, 0.0))
    imgui.end_disabled()
    _explain(label, tip, "")
    return pressed


def colour(label: str, rgb: Vec3, *, tip: str) -> tuple[bool, Vec3, bool]:
    """A linear Rec.709 colour, shown and edited with sRGB's encoding (what colour pickers expect)."""
    _begin_row(label)
    flags = imgui.ColorEditFlags_.float.value
    changed, encoded = imgui.color_edit3(f"##{label}", [_encode(c) for c in rgb], flags)
    active = imgui.is_item_active()
    _explain(label, tip, "")
    if not changed:
        return False, rgb, active
    r, g, b = (_tidy(_decode(c)) for c in encoded[:3])
    return True, (r, g, b), active


def text_field(label: str, value: str, *, tip: str) -> tuple[bool, str]:
    """A line of text; changed when it is left or Enter is pressed, not with each letter."""
    _begin_row(label)
    _, text = imgui.input_text(f"##{label}", value)
    done = imgui.is_item_deactivated_after_edit()
    _explain(label, tip, "")
    return done and text != value, text


def read_out(label: str, text: str, *, tip: str) -> None:
    """A value that cannot be edited, in the row layout."""
    _begin_row(label)
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(text)
    _explain(label, tip, "")


def section(title: str, *, is_open: bool = True) -> bool:
    """A heading that folds; True when what stands below it is to be drawn."""
    flags = imgui.TreeNodeFlags_.default_open.value if is_open else 0
    shown = imgui.collapsing_header(title, flags)
    item_rects.note(title)
    return shown


def hint(text: str) -> None:
    """Quiet words, wrapped to the window."""
    _coloured(text, imgui.get_style_color_vec4(imgui.Col_.text_disabled))


def note(text: str) -> None:
    """Something the user should know: amber on dark, brown on light."""
    _coloured(text, ImVec4(0.95, 0.72, 0.32, 1.0) if on_dark() else ImVec4(0.55, 0.34, 0.0, 1.0))


def error(text: str) -> None:
    """Something that was refused, and why."""
    _coloured(text, ImVec4(0.98, 0.47, 0.42, 1.0) if on_dark() else ImVec4(0.70, 0.10, 0.08, 1.0))


def on_dark() -> bool:
    """Whether the theme's windows are dark."""
    back = imgui.get_style_color_vec4(imgui.Col_.window_bg)
    return back.x + back.y + back.z < 1.5


def em() -> float:
    """The font's height in pixels: what sizes are given in."""
    return imgui.get_font_size()


def holding(state: State, active: bool) -> State:
    """The state, told that something is being dragged when `active`; never lowers the flag."""
    return replace(state, interacting=True) if active and not state.interacting else state


def tooltip(text: str, *extra: str) -> None:
    """Explain the last item when it is hovered, off ones too."""
    if text and imgui.is_item_hovered(
        imgui.HoveredFlags_.for_tooltip.value | imgui.HoveredFlags_.allow_when_disabled.value
    ):
        imgui.begin_tooltip()
        imgui.push_text_wrap_pos(_TIP_EM * em())
        imgui.text_unformatted(text)
        for line in filter(None, extra):
            hint(line)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


# ---- parts of a row -----------------------------------------------------------------------


def _begin_row(label: str) -> bool:
    """Draw the label and give the next item the rest of the row; True when the label was double-clicked."""
    shown = label.split("##")[0]
    room = imgui.get_content_region_avail().x
    column = min(_LABEL_EM * em(), _LABEL_SHARE * room)
    start, hit = imgui.get_cursor_pos_x(), False
    gap = imgui.get_style().item_inner_spacing.x
    if shown:
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(shown)
        hit = _double_clicked()
        column = max(column, imgui.calc_text_size(shown).x)
        if room - column - gap >= _LEAST_FIELD_EM * em():
            imgui.same_line(start + column + gap)
    else:
        imgui.set_cursor_pos_x(start + column + gap)
    imgui.set_next_item_width(-1.0)
    return hit


def _end_value(
    label: str,
    changed: bool,
    before: float,
    after: float,
    reset: float | None,
    label_hit: bool,
    tip: str,
    unit: str,
    format: str,
) -> FloatResult:
    active, field_hit = imgui.is_item_active(), _double_clicked()
    _explain(label, tip, unit, _reset_text("" if reset is None else (format % reset).strip(), True))
    if reset is not None and (label_hit or field_hit):
        imgui.internal.clear_active_id()  # else the held slider takes the value back next frame
        return reset != before, reset, False
    return (changed, after, active) if changed else (False, before, active)


def _explain(label: str, tip: str, unit: str, how: str = "") -> None:
    item_rects.note(label)
    tooltip(tip, f"Unit: {unit}" if unit else "", how)


def _reset_text(default: str, can_type: bool) -> str:
    parts = ["Ctrl+click: type"] if can_type else []
    if default:
        parts.append(f"double-click: back to {default}")
    return ", ".join(parts)


def _double_clicked() -> bool:
    return imgui.is_item_hovered() and imgui.is_mouse_double_clicked(0)


def _typing_only_with_ctrl(label: str) -> int:
    """No text entry by double click, which resets; entry by Ctrl+click stays until it is left."""
    identity = imgui.get_id(f"##{label}")
    wants_text = imgui.get_io().key_ctrl or imgui.internal.temp_input_is_active(identity)
    return 0 if wants_text else imgui.SliderFlags_.no_input.value


def _with_unit(format: str, unit: str) -> str:
    """`format` with the unit behind it, percent signs doubled for printf."""
    if not unit:
        return format
    gap = "" if unit == "°" else " "
    return format + gap + unit.replace("%", "%%")


def _tidy(value: float) -> float:
    """A float32 as the decimal number that was meant."""
    return float(f"{value:.7g}")


def _notch(share: float) -> None:
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    grab = imgui.get_style().grab_min_size
    x = low.x + 2.0 + grab / 2 + share * (high.x - low.x - grab - 4.0)
    tint = imgui.get_color_u32(imgui.Col_.text, 0.55)
    drawing = imgui.get_window_draw_list()
    length = 0.2 * (high.y - low.y)
    drawing.add_line(ImVec2(x, high.y - length), ImVec2(x, high.y), tint, 1.5)
    drawing.add_line(ImVec2(x, low.y), ImVec2(x, low.y + length), tint, 1.5)


def _coloured(text: str, tint: ImVec4) -> None:
    imgui.push_style_color(imgui.Col_.text, tint)
    imgui.push_text_wrap_pos(_wrap_position())
    imgui.text_unformatted(text)
    imgui.pop_text_wrap_pos()
    imgui.pop_style_color()


def _wrap_position() -> float:
    """The window's right edge, or the tooltip's width inside of one that fits its contents."""
    is_tooltip = bool(imgui.internal.get_current_window_read().flags & imgui.WindowFlags_.tooltip.value)
    return _TIP_EM * em() if is_tooltip else 0.0


def _encode(linear: float) -> float:
    return 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055


def _decode(encoded: float) -> float:
    return encoded / 12.92 if encoded <= 0.04045 else ((encoded + 0.055) / 1.055) ** 2.4
