"""The lessons that come with the program: a scene each, a few sentences, and what to try in it.

`assets/lessons/lessons.toml` holds them in their order.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypedDict

import msgspec

from ..base import files
from ..base.errors import UserError, suggestion
from ..base.paths import assets_dir, shipped_scenes


class PageStep(TypedDict):
    """What to try on a page, and what it sets there (docs/pages.md)."""

    text: str
    set: dict[str, Any]


@dataclass(frozen=True)
class Lesson:
    """One lesson."""

    name: str
    """As on the command line."""
    title: str
    scene: str
    """A shipped scene's name, or a file in the lessons' folder."""
    select: str
    """Name of the object that it is about."""
    rays: bool
    """Whether a fan of rays is drawn through that object."""
    words: str
    steps: tuple[str, ...]
    ray_count: int = 5
    reflections: int = 0
    """Reflections of the rays within the object, before they leave it."""
    target: str = ""
    """Picture that a caustic plate was made for, from the scene's folder; the plate check begins with it."""
    page: tuple[PageStep, ...] = ()
    """Steps of its page for browsers, instead of `steps`."""

    @property
    def path(self) -> Path:
        """The scene's file."""
        return _folder() / self.scene if self.scene.endswith(".toml") else shipped_scenes()[self.scene]


@dataclass(frozen=True)
class _Lessons:
    lessons: tuple[Lesson, ...]


@cache
def lessons() -> tuple[Lesson, ...]:
    """All of them, in their order."""
    return msgspec.toml.decode(
        files.read_bytes(_folder() / "lessons.toml", files.SETTINGS_BYTES), type=_Lessons
    ).lessons


def lesson(name: str) -> Lesson:
    """By name. Raises UserError for one that does not exist."""
    found = next((each for each in lessons() if each.name == name), None)
    if found is None:
        names = [each.name for each in lessons()]
        raise UserError(f"there is no lesson '{name}'{suggestion(name, names) or ','} there are {', '.join(names)}")
    return found


def _folder() -> Path:
    return assets_dir() / "lessons"
