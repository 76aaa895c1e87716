"""Keys of a scene file, each declared once: how it is read and checked, written, shown in a panel and animated.

A class of the scene lists its fields; `read_fields` makes attributes of a table and `write_fields` a table of a value.
What is more than one key for one attribute (a cone's soft edge, an outline) is a `Part` of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..base.errors import UserError
from .io.scene_pictures import kept_name
from .io.scene_table import REQUIRED, SceneTable, broken_limit

_LEAST, _MOST = 1e-6, 1e6
"""Ends of the rows of numbers without bounds."""


class Part:
    """Some keys of a table that become some attributes of a value, and the way back."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """Attributes by name. Raises UserError, one sentence with the key, for what cannot be."""
        raise NotImplementedError

    def write(self, value: Any, path: Path | None) -> dict[str, Any]:
        """Keys that `read` makes into the same attributes.

        Files are named as the scene file `path` would name them, absolutely where it is None."""
        raise NotImplementedError


@dataclass(frozen=True)
class Animated:
    """What an animation may do with a number."""

    meaning: str
    low: float | None = None
    high: float | None = None
    """None: the number's own bounds, as in `Row`."""
    name: str = ""
    """Its name in an animation, where that is not the attribute's."""


@dataclass(frozen=True)
class Row:
    """How a panel shows a field."""

    label: str
    tip: str
    low: float | None = None
    high: float | None = None
    reset: float | None = None
    """None: the number's default."""
    format: str = "%.4g"
    bounded_by: str = ""
    """Attribute that `high` and `reset` are, where they are not fixed."""
    is_slider: bool = False
    """A slider between `low` and `high`; else a logarithmic drag."""


@dataclass(frozen=True)
class Field(Part):
    """One key that is one attribute."""

    attribute: str
    default: Any = REQUIRED
    key: str = ""
    """Where it is not the attribute's name."""
    unit: str = ""
    row: Row | None = None
    animated: Animated | None = None
    optional: bool = False
    """Left out when saved at its default."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """The attribute by name."""
        return {self.attribute: self.value(table, self.key or self.attribute)}

    def value(self, table: SceneTable, key: str) -> Any:
        """The value under `key`, checked."""
        raise NotImplementedError

    def write(self, value: Any, path: Path | None) -> dict[str, Any]:
        """The key with its value, in the types of TOML."""
        found = getattr(value, self.attribute)
        if found is None or (self.optional and found == self.default):
            return {}
        return {self.key or self.attribute: list(found) if isinstance(found, tuple) else found}


@dataclass(frozen=True)
class Number(Field):
    """A finite number within bounds."""

    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None

    def value(self, table: SceneTable, key: str) -> float:
        """The number."""
        limits = {"above": self.above, "at_least": self.at_least, "below": self.below, "at_most": self.at_most}
        return table.number(key, self.default, **limits)  # type: ignore[arg-type]

    def span(self, of: Row | Animated) -> tuple[float, float]:
        """From where to where a row or an animation goes: as it says, or else as far as the number may."""
        low = self.at_least if of.low is None else of.low
        high = self.at_most if of.high is None else of.high
        return _LEAST if low is None else low, _MOST if high is None else high

    def broken_limit(self, number: float) -> str | None:
        """What `number` must be that it is not, such as "above 0"; None where it lies within the bounds."""
        return broken_limit(number, self.above, self.at_least, self.below, self.at_most)

    @property
    def range_words(self) -> str:
        """The bounds, as in "between 0 and 1" or "more than 0 and at most 1"."""
        if self.at_least is not None and self.at_most is not None:
            return f"between {self.at_least:.7g} and {self.at_most:.7g}"
        bounds = {"more than": self.above, "at least": self.at_least, "less than": self.below, "at most": self.at_most}
        return " and ".join(f"{words} {bound:.7g}" for words, bound in bounds.items() if bound is not None)

    def holds(self, number: float) -> bool:
        """Whether `number` lies within the bounds."""
        return self.broken_limit(number) is None


@dataclass(frozen=True)
class Integer(Number):
    """A whole number within bounds."""

    def value(self, table: SceneTable, key: str) -> int:
        """The number."""
        assert self.at_least is not None and self.at_most is not None
        return table.integer(key, self.default, at_least=self.at_least, at_most=self.at_most)


@dataclass(frozen=True)
class Flag(Field):
    """true or false."""

    def value(self, table: SceneTable, key: str) -> bool:
        """Which."""
        return table.boolean(key, self.default)


@dataclass(frozen=True)
class Vector(Field):
    """Three finite numbers."""

    nonzero: bool = False

    def value(self, table: SceneTable, key: str) -> tuple[float, float, float]:
        """The three."""
        return table.vector(key, self.default, nonzero=self.nonzero)


@dataclass(frozen=True)
class Direction(Field):
    """Three numbers, normalised."""

    def value(self, table: SceneTable, key: str) -> tuple[float, float, float]:
        """The unit vector."""
        return table.unit_vector(key, self.default)


@dataclass(frozen=True)
class Colour(Field):
    """Linear Rec.709 from 0 to 1."""

    def value(self, table: SceneTable, key: str) -> tuple[float, float, float]:
        """The three channels."""
        return table.colour(key, self.default)


@dataclass(frozen=True)
class FileName(Field):
    """A file of the value's own: `attribute` is what `load` makes of it, and has its path as `source`."""

    load: Callable[[Path], Any] | None = None

    def value(self, table: SceneTable, key: str) -> Any:
        """What is in the file."""
        assert self.load is not None
        path = table.existing_file(key)
        try:
            return self.load(path)
        except UserError as error:
            table.fail(key, f"cannot be used: {error}")

    def write(self, value: Any, path: Path | None) -> dict[str, Any]:
        """The file's name."""
        source = getattr(value, self.attribute).source
        return {self.key or self.attribute: source if path is None else kept_name(source, path)}


def read_fields(parts: Iterable[Part], table: SceneTable) -> dict[str, Any]:
    """Attributes that `parts` find in `table`."""
    found: dict[str, Any] = {}
    for part in parts:
        found |= part.read(table)
    return found


def write_fields(parts: Iterable[Part], value: Any, path: Path | None = None) -> dict[str, Any]:
    """The keys of `value`, in the order of `parts`."""
    values: dict[str, Any] = {}
    for part in parts:
        values |= part.write(value, path)
    return values


def check_numbers(parts: Iterable[Part], value: Any, who: str) -> None:
    """Raise UserError, which begins with `who`, for a number of `value` that no scene file could hold."""
    for number in (part for part in parts if isinstance(part, Number)):
        found = float(getattr(value, number.attribute))
        if limit := number.broken_limit(found):
            what = number.attribute.removesuffix("_deg").replace("_", " ")
            raise UserError(f"{who}{what} is {found:g} but must be {limit}")
