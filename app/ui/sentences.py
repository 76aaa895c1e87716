"""Errors and requests in words, for messages."""

from __future__ import annotations

from ..base.errors import UserError

MAX_REASON = 160


def sentence(text: str) -> str:
    """A `UserError`'s text as it stands on its own."""
    text = " ".join(text.split())
    # A file's or an object's name stays as it is written.
    start = text[:1].upper() if text.split(" ")[0].isalpha() else text[:1]
    return f"{start}{text[1:]}{'' if text.endswith(('.', '?', '!')) else '.'}"


def brief(error: BaseException) -> str:
    """What went wrong, by its cause, short enough for a message."""
    cause = error.__cause__ or error
    text = " ".join(str(cause).split())
    if isinstance(cause, UserError):
        return text
    return f"{type(cause).__name__}: {text[:MAX_REASON]}" if text else type(cause).__name__


def words(request: type) -> str:
    """ "SelectAt" → "Select at"."""
    return "".join(f" {c.lower()}" if c.isupper() else c for c in request.__name__).strip().capitalize()
