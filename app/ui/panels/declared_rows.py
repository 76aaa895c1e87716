"""Rows of a light or a material that follow from what its class declares: its numbers and its switches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

from ...model.fields import Flag, Number, Part
from ...model.lights import Light
from ...model.materials import Material
from . import widgets

T = TypeVar("T", Light, Material)


def draw_numbers(thing: T, numbers: Sequence[Number]) -> T:
    """A row for each number: `thing` as the user left it."""
    for number in numbers:
        thing = _number(thing, number)
    return thing


def draw_flags(thing: T, parts: Sequence[Part]) -> T:
    """A switch for each part that is one."""
    for part in parts:
        if isinstance(part, Flag) and part.row is not None:
            before = getattr(thing, part.attribute)
            on = widgets.toggle(part.row.label, before, tip=part.row.tip)
            thing = thing.changed(**{part.attribute: on}) if on != before else thing
    return thing


def _number(thing: T, number: Number) -> T:
    row, value = number.row, getattr(thing, number.attribute)
    assert row is not None
    low, high = number.span(row)
    reset = number.default if row.reset is None else row.reset
    shown: dict[str, Any] = {"unit": number.unit, "tip": row.tip, "format": row.format, "reset": reset}
    if row.bounded_by:
        high = shown["reset"] = getattr(thing, row.bounded_by)
        value = min(value, high)
    if row.is_slider:
        new = widgets.slider(row.label, value, low, high, **shown)
    else:
        new = widgets.drag(row.label, value, low, high, logarithmic=True, **shown)
    return thing.changed(**{number.attribute: new}) if new != value else thing
