"""Names in files and in sentences: each given once, a few of many, and what of a file is not shown."""

from __future__ import annotations

from collections.abc import Sequence

from ..base.errors import UserError, suggestion


class Names(set[str]):
    """Names that are taken: of a file that repeats a name, later ones are numbered."""

    def __init__(self) -> None:
        super().__init__()
        self._last: dict[str, int] = {}

    def unique(self, name: str) -> str:
        """`name`, or with the first number from 2 on that is free ("ball 2"); taken from now on."""
        chosen, number = name, self._last.get(name, 1)
        while chosen in self:
            number += 1
            chosen = f"{name} {number}"
        # Lower ones stay taken: ten thousand equal names are not searched from the start each time.
        self._last[name] = number
        self.add(chosen)
        return chosen


def free_name(wanted: str, taken: Sequence[str]) -> str:
    """`wanted`, or with the first number from 2 on that makes it new ("prism 2"); a number it ends in is counted on."""
    if wanted not in taken:
        return wanted
    stem, _, tail = wanted.rpartition(" ")
    stem, number = (stem, int(tail)) if stem and tail.isdecimal() else (wanted, 1)
    while f"{stem} {number}" in taken or number < 2:
        number += 1
    return f"{stem} {number}"


def checked_name(wanted: str, taken: Sequence[str], noun: str) -> str:
    """A name a scene file could hold, blanks around it removed. Raises UserError for an empty or taken one."""
    name = " ".join(wanted.split())
    if not name:
        raise UserError(f"the {noun} needs a name")
    if name in taken:
        raise UserError(f"another {noun} is called '{name}' already; choose a name of its own")
    return name


def listed(names: Sequence[str], most: int = 6) -> str:
    """Names for a sentence, the first `most` of them."""
    shown = ", ".join(f"'{name}'" for name in names[:most])
    return shown if len(names) <= most else f"{shown} and {len(names) - most} more"


def place_of(name: object, names: Sequence[str], sentence: str) -> int:
    """Where `name` is among `names`. Raises `UserError`, which begins with `sentence`, as "scene 'a' has no object"."""
    if not isinstance(name, str) or name not in names:
        hint = suggestion(name, names) if isinstance(name, str) else ""
        raise UserError(f"{sentence} {name!r}{hint or ';'} it has {listed(names) or 'none'}")
    return names.index(name)


class Unshown:
    """What of a file's materials is not shown, or was taken for something else: one sentence for each kind of it."""

    def __init__(self) -> None:
        self._names: dict[str, dict[str, None]] = {}

    def add(self, kind: str, name: str) -> None:
        """Note `kind`, a sentence up to the names of the materials that it concerns, for one of these."""
        self._names.setdefault(kind, {})[name] = None

    def notes(self) -> list[str]:
        """A sentence for each kind, in the order in which they were met."""
        return [f"{kind}: {listed(list(names))}." for kind, names in self._names.items()]
