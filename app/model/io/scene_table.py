"""Strict reading of one table of a scene file: every mistake becomes one sentence with its full key path.

A `SceneTable` returns validated values and remembers which keys were read; `finish()` then
refuses keys that were not and names the nearest one that is known.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn, cast

import numpy as np

from ...base import files
from ...base.errors import UserError, nearest_names
from ...base.tone_map import srgb_eotf
from ..vectors import Vec3, vec3

MAX_MAGNITUDE = 1e30
"""Largest number in a scene: the renderer's float32 ends at 3e38, and sums need room."""

REQUIRED: Any = object()
"""Default of a key that has none."""


class SceneTable:
    """One TOML table, its file, and its path inside that file."""

    def __init__(self, values: Mapping[str, Any], file: Path, path: str = "", notes: list[str] | None = None) -> None:
        self._values = values
        self.notes: list[str] = [] if notes is None else notes
        """Sentences on what was assumed, of the whole file: tables in it share the list."""
        self._read: set[str] = set()
        self.file = file
        self.path = path

    # -- errors ---------------------------------------------------------------------------

    def key_path(self, key: str) -> str:
        """Full path of `key`, such as `objects[2].material.glass`."""
        return f"{self.path}.{key}" if self.path else key

    def where(self, key: str) -> str:
        """The beginning of every sentence about `key`: file and full key path."""
        return f"{self.file.name}: {self.key_path(key)}" if key else f"{self.file.name}: {self.path}"

    def fail(self, key: str, message: str) -> NoReturn:
        """Raise the one sentence about `key` ("" = the table itself)."""
        raise UserError(f"{self.where(key)} {message}")

    def finish(self, noun: str = "this table") -> None:
        """Refuse the first key that was never read; `noun` says whose keys are listed."""
        unknown = [key for key in self._values if key not in self._read]
        if unknown:
            self._fail_unknown(unknown[0], noun)

    def _fail_unknown(self, key: str, noun: str) -> NoReturn:
        near = nearest_names(key, sorted(self._read), count=1)
        remedy = f"did you mean '{near[0]}'?" if near else f"{noun} knows {', '.join(sorted(self._read))}"
        raise UserError(f"{self.file.name}: unknown key '{self.key_path(key)}', {remedy}")

    # -- raw access -----------------------------------------------------------------------

    def has(self, key: str) -> bool:
        """Is `key` given? Counts as understood from now on."""
        self._read.add(key)
        if key == "colour" and key not in self._values and "color" in self._values:
            self._values = {key if name == "color" else name: value for name, value in self._values.items()}
        return key in self._values

    def given(self, keys: Sequence[str]) -> list[str]:
        """Those of `keys` that are given, in the order of `keys`."""
        return [key for key in keys if self.has(key)]

    def one_of(self, keys: Sequence[str], what: str) -> str | None:
        """The only one of `keys` that is given, or None; two of them are an error."""
        found = self.given(keys)
        if len(found) > 1:
            self.fail(found[1], f"cannot stand beside '{found[0]}': give {what} once")
        return found[0] if found else None

    def raw(self, key: str, default: Any = REQUIRED) -> Any:
        """The value as TOML gave it; a missing required key is an error."""
        if self.has(key):
            return self._values[key]
        if default is REQUIRED:
            # A misspelt key is the likelier mistake, and the more helpful sentence.
            for unknown in self._values:
                if unknown not in self._read and nearest_names(unknown, [key]):
                    self._fail_unknown(unknown, "this table")
            self.fail(key, "is missing")
        return default

    # -- scalars --------------------------------------------------------------------------

    def number(
        self,
        key: str,
        default: Any = REQUIRED,
        *,
        above: float | None = None,
        at_least: float | None = None,
        below: float | None = None,
        at_most: float | None = None,
        infinite: bool = False,
    ) -> float:
        """A number within the stated range; NaN never, infinity only where `infinite`."""
        value = self.raw(key, default)
        if value is default and not self.has(key):
            return value
        number = self._as_number(key, value, infinite)
        if limit := broken_limit(number, above, at_least, below, at_most):
            self.fail(key, f"is {number:g} but must be {limit}")
        return number

    def integer(self, key: str, default: Any = REQUIRED, *, at_least: float, at_most: float) -> int:
        """A whole number in [at_least, at_most]; 1e6 is accepted as one."""
        number = self.number(key, default, at_least=at_least, at_most=at_most)
        if number != int(number):
            self.fail(key, f"is {number:g} but must be a whole number")
        return int(number)

    def boolean(self, key: str, default: Any = REQUIRED) -> bool:
        """true or false."""
        value = self.raw(key, default)
        if not isinstance(value, bool):
            self.fail(key, f"must be true or false, not {_show(value)}")
        return value

    def string(self, key: str, default: Any = REQUIRED) -> str:
        """A non-empty string."""
        value = self.raw(key, default)
        if not isinstance(value, str) or (not value and value is not default):
            self.fail(key, f"must be a text in quotes, not {_show(value)}")
        return value

    def choice(self, key: str, options: Sequence[str], default: Any = REQUIRED) -> str:
        """One of a few words."""
        value = self.raw(key, default)
        if value not in options:
            near = nearest_names(value, options, count=1) if isinstance(value, str) else []
            hint = f"did you mean '{near[0]}'?" if near else f"choose one of {', '.join(options)}"
            self.fail(key, f"is {_show(value)}, which is not known: {hint}")
        return value

    # -- vectors --------------------------------------------------------------------------

    def numbers(
        self, key: str, default: Any = REQUIRED, *, count: int | None = None, at_least: int = 1
    ) -> tuple[float, ...]:
        """A list of finite numbers, of exactly `count` or no fewer than `at_least`."""
        value = self.raw(key, default)
        if value is default and not self.has(key):
            return value
        wanted = f"{count} numbers" if count is not None else f"at least {at_least} numbers"
        if not isinstance(value, list):
            self.fail(key, f"must be a list of {wanted}, not {_show(value)}")
        if (count is not None and len(value) != count) or len(value) < at_least:
            self.fail(key, f"has {len(value)} entries but needs {wanted}")
        return tuple(self._as_number(f"{key}[{i}]", v, False) for i, v in enumerate(value))

    def vector(self, key: str, default: Any = REQUIRED, *, nonzero: bool = False) -> Vec3:
        """Three finite numbers; where `nonzero`, a length that can be normalised."""
        vector = self.numbers(key, default, count=3)
        if nonzero and vector is not default and math.hypot(*vector) < 1e-150:
            self.fail(key, "is the zero vector and has no direction")
        return cast(Vec3, vector)

    def unit_vector(self, key: str, default: Any = REQUIRED) -> Vec3:
        """A direction, normalised."""
        vector = self.vector(key, default, nonzero=True)
        if vector is default:
            return vector
        length = math.hypot(*vector)
        return vector[0] / length, vector[1] / length, vector[2] / length

    def rows(self, key: str, columns: int, at_least: int = 2) -> list[tuple[float, ...]]:
        """A list of rows of `columns` finite numbers each."""
        value = self.raw(key)
        if not isinstance(value, list) or len(value) < at_least:
            self.fail(key, f"must be a list of at least {at_least} rows of {columns} numbers")
        rows = []
        for i, row in enumerate(value):
            if not isinstance(row, list) or len(row) != columns:
                self.fail(f"{key}[{i}]", f"must be {columns} numbers, not {_show(row)}")
            rows.append(tuple(self._as_number(f"{key}[{i}][{j}]", v, False) for j, v in enumerate(row)))
        return rows

    def colour(self, key: str, default: Any = REQUIRED) -> Vec3:
        """Linear Rec.709 in [0, 1]: three numbers, one number for a grey, or an sRGB "#rrggbb"."""
        value = self.raw(key, default)
        if value is default and not self.has(key):
            return value
        if isinstance(value, str):
            return self._hex_colour(key, value)
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            value = [value] * 3
        if not isinstance(value, list) or len(value) != 3:
            self.fail(key, f'must be three numbers, one number or "#rrggbb", not {_show(value)}')
        channels = tuple(self._as_number(key, channel, False) for channel in value)
        if not all(0.0 <= channel <= 1.0 for channel in channels):
            self.fail(key, f"is {_show(value)} but every channel must lie between 0 and 1")
        return channels[0], channels[1], channels[2]

    def _hex_colour(self, key: str, text: str) -> Vec3:
        digits = text.removeprefix("#")
        try:
            if not text.startswith("#") or len(digits) != 6:
                raise ValueError
            encoded = np.array([*bytes.fromhex(digits)]) / 255.0
        except ValueError:
            self.fail(key, f'is {_show(text)} but a colour in quotes must read "#rrggbb"')
        return vec3(srgb_eotf(encoded))

    def _as_number(self, key: str, value: Any, infinite: bool) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            self.fail(key, f"must be a number, not {_show(value)}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if math.isnan(number) or (math.isinf(number) and not infinite):
            self.fail(key, f"is {number} but must be a finite number")
        if math.isfinite(number) and abs(number) > MAX_MAGNITUDE:
            self.fail(key, f"is {number:g} but must lie within ±{MAX_MAGNITUDE:g}; choose larger units")
        return number

    # -- tables and files -----------------------------------------------------------------

    def table(self, key: str) -> SceneTable | None:
        """The table under `key`, or None when there is none."""
        return self.given_table(key) if self.has(key) else None

    def given_table(self, key: str, such_as: str = "") -> SceneTable:
        """The table under `key`, which is there; `such_as`: one that would do, for who gave something else."""
        value = self.raw(key)
        if not isinstance(value, dict):
            self.fail(key, f"must be a table{such_as and f' such as {such_as}'}, not {_show(value)}")
        return SceneTable(value, self.file, self.key_path(key), self.notes)

    def tables(self, key: str) -> list[SceneTable]:
        """The list of tables under `key`; none at all is the empty list."""
        if not self.has(key):
            return []
        value = self._values[key]
        if not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value):
            self.fail(key, f"must be a list of tables: write [[{self.key_path(key)}]]")
        return [SceneTable(entry, self.file, f"{self.key_path(key)}[{i}]", self.notes) for i, entry in enumerate(value)]

    def named_tables(self, key: str) -> dict[str, SceneTable]:
        """The tables inside the table under `key`, by name: [materials.NAME]."""
        outer = self.table(key)
        if outer is None:
            return {}
        return {name: outer.table(name) for name in outer._values}  # type: ignore[misc]

    def existing_file(self, key: str, or_part: bool = False) -> Path:
        """A file named relative to the scene file's folder; must exist, where the scene may read.

        With `or_part` the name may go on with what is meant within it (`files.with_part`)."""
        path = self.file.parent / self.string(key)
        file = files.with_part(path)[0] if or_part else path
        if not files.may_read(file, self.file.parent):
            self.fail(key, f"names {path}, which {files.OUTSIDE}")
        if not files.is_file(file):
            self.fail(key, f"names {path}, which is not a file")
        return path


def broken_limit(
    number: float, above: float | None, at_least: float | None, below: float | None, at_most: float | None
) -> str | None:
    """What a number must be that it is not, such as "above 0"; None where it lies within the limits."""
    if above is not None and not number > above:
        return f"above {above:g}"
    if at_least is not None and not number >= at_least:
        return f"at least {at_least:g}"
    if below is not None and not number < below:
        return f"below {below:g}"
    if at_most is not None and not number <= at_most:
        return f"at most {at_most:g}"
    return None


def _show(value: Any) -> str:
    """A value as the user wrote it, shortened."""
    text = f"'{value}'" if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."
