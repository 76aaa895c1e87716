"""Arguments of renderings, checked as the command line checks its options and with its sentences."""

from __future__ import annotations

import re

from ..base.errors import UserError
from ..commands import options
from ..commands.render import picture_settings
from ..commands.table import Render
from ..model.settings import RenderSettings
from .scene import Scene

Size = tuple[int, int] | str
"""Width and height in pixels, or text such as "960x540"."""
Count = int | float | str
"""A whole number; "4M" is understood as well."""


def settings_of(scene: Scene, **arguments: object) -> RenderSettings:
    """The settings of a rendering of `scene`; `arguments` by the names of `render`'s options, None: not given.
    Raises `UserError`."""
    check_scene(scene)
    texts = {name: _text(name, value) for name, value in arguments.items() if value is not None}
    try:
        values = options.read(Render, {"scene": scene.name, "output": "", **texts})
        return picture_settings(values, scene._model, True)
    except UserError as error:
        raise UserError(in_python(str(error))) from None


def check_scene(scene: object) -> None:
    """Raise `UserError` where it is none: the likeliest mistake is a file's name."""
    if not isinstance(scene, Scene):
        raise UserError(f"{type(scene).__name__} is no scene: open one with spectrasplat.load, for example")


def whole(name: str, value: object, low: int, high: int) -> int:
    """`value` where it is a whole number within these ends; raises `UserError` otherwise."""
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise UserError(f"{name}: {value!r} is out of range: give a whole number from {low} to {high:,}")
    return value


def in_python(sentence: str) -> str:
    """A sentence about options of the command line, about arguments of the same name."""
    return re.sub(r"--([a-z]+(?:-[a-z]+)*)", lambda found: found[1].replace("-", "_"), sentence)


def _text(name: str, value: object) -> str:
    if name == "size" and not isinstance(value, str):
        try:
            return "x".join(str(side) for side in value)  # type: ignore[attr-defined]
        except TypeError:
            return str(value)
    if isinstance(value, float) and value.is_integer() and name != "seconds":
        return str(int(value))
    return str(value)
