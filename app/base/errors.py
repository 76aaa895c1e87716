"""The one kind of error a user is meant to read.

Every bad input ends as a `UserError` whose message is one clear sentence that names the
file, the key and the remedy. `spectrasplat.__main__` catches it in one place, prints it without a
traceback and exits with code 2.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class UserError(Exception):
    """A mistake in what the user gave us, told in one sentence with a way out."""

    exit_code = 2


class BrokenPictureError(UserError):
    """A picture that would be wrong, and is not written."""

    exit_code = 1


class DeviceError(UserError, RuntimeError):
    """OpenGL could not do what was asked of it."""


def nearest_names(name: str, known: Iterable[str], count: int = 3) -> list[str]:
    """Known names that resemble `name`, best first (case-insensitive; may be empty)."""
    by_folded = {candidate.casefold(): candidate for candidate in known}
    matches = difflib.get_close_matches(name.casefold(), by_folded, n=count, cutoff=0.5)
    return [by_folded[match] for match in matches]


def suggestion(name: str, known: Iterable[str], count: int = 3) -> str:
    """A clause ", did you mean 'a' or 'b'?", or "" when nothing is near."""
    near = nearest_names(name, known, count)
    if not near:
        return ""
    return ", did you mean " + " or ".join(f"'{n}'" for n in near) + "?"
