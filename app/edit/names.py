"""Names of objects and lights: each its own, as in a scene file."""

from __future__ import annotations

from collections.abc import Sequence

from ..base.errors import UserError


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
