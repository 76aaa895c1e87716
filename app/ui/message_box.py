"""Sentences to the user: notices fade, errors later or with the next success, repetitions only renew. Errors of the
layers below become whole sentences, options of the command line what the window has instead."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass

from ..base.errors import UserError
from .view_model import Message

_INSTEAD: tuple[tuple[str, str], ...] = (
    (r"; --(?:flat shows facets|smooth rounds it)", ""),
    (r"; --up y or z says it", "; the button on the picture stands it up along the other"),
    (r"--up is for", "an upward axis is for"),
    (r"--up '([^']*)'", r"the upward axis '\1'"),
    (r"; --glass takes another(?:, for one part too \([^)]*\))?", "; Choose glass… in the Dispersion panel has others"),
    (
        r"Make it glass with --glass diamond, or one part with --glass .*?, in the window with Make glass\.",
        "Make one part of it glass with Make glass, on the picture.",
    ),
    (r"--glass: ", ""),
    (r"--glass (\S+): ", r"\1: "),
    (r"--environment sky, or a panorama, shows another", "Environment, with World in the Inspector, shows another"),
    (r"--environment '([^']*)'", r"the environment '\1'"),
    (r"; --max-depth allows more", "; Longest path, with World in the Inspector, allows more"),
    (r"choose more --spp", "choose more Samples"),
    (r"--size (\d+x\d+)", r"a picture of \1"),
    (r" with --bins (\d+)", r" with \1 spectral bins"),
    (r"smaller --size", "smaller size"),
    (r"larger --size", "larger size"),
    (r"fewer --bins", "no spectral bins"),
    (r"choose another folder, or replace (its frames|them) with --overwrite", "choose another folder"),
    (r"allow it with --allow-outside \(or its folder in (\w+)\)", r"name its folder in \1 before the start"),
)


def in_window(text: str) -> str:
    """`text` without options of the command line."""
    if "--" not in text:
        return text
    began = text.startswith("--")
    for option, instead in _INSTEAD:
        text = re.sub(option, instead, text)
    return text[:1].upper() + text[1:] if began else text


MAX_REASON = 160


def sentence(text: str) -> str:
    """A `UserError`'s text as a whole sentence."""
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


def broken(text: str, width: float, measure: Callable[[str], float], at: str = " ") -> str:
    """`text` in as few lines of `width` as its parts, which `at` divides, fit; a part that is wider has a line of its
    own. `measure`: width of a text, in the same unit."""
    lines: list[str] = []
    for part in text.split(at):
        longer = f"{lines[-1]}{at}{part}" if lines else part
        if lines and measure(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(part)
    return "\n".join(lines)


NOTICE_S, ERROR_S = 6.0, 20.0
"""A short notice, an error is gone after this long on the screen."""
READ_S = 2.0
"""Shortest time that an error is on the screen, whatever succeeds meanwhile."""
CHARACTERS_S = 15.0
"""Characters of a longer one that are read in a second."""
MAX_MESSAGES = 6


@dataclass
class _Shown:
    text: str
    is_error: bool
    stays: bool = False
    """Until a success."""
    shown_s: float | None = None
    """When it came on the screen: preparing a scene may delay the next frame."""

    @property
    def stays_s(self) -> float:
        return max(ERROR_S if self.is_error else NOTICE_S, len(self.text) / CHARACTERS_S)


class MessageBox:
    """What is on the screen now, oldest first."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._shown: list[_Shown] = []

    def show(self, text: str, is_error: bool = False, stays: bool = False) -> None:
        """Show one sentence; one that `stays` does so until the next success."""
        sentence = in_window(" ".join(text.split()))
        self._shown = [shown for shown in self._shown if shown.text != sentence]
        self._shown.append(_Shown(sentence, is_error, stays))
        del self._shown[:-MAX_MESSAGES]

    def close(self, text: str) -> None:
        """Take a message away."""
        self._shown = [shown for shown in self._shown if shown.text != text]

    def succeed(self) -> None:
        """Something that the user wanted was done: errors that could be read go."""
        now = self._clock()
        self._shown = [
            shown
            for shown in self._shown
            if not shown.is_error or shown.shown_s is None or now - shown.shown_s < READ_S
        ]

    def messages(self) -> tuple[Message, ...]:
        """What to show."""
        now, ages = self._clock(), {}
        for shown in self._shown:
            shown.shown_s = now if shown.shown_s is None else shown.shown_s
            ages[id(shown)] = now - shown.shown_s
        self._shown = [shown for shown in self._shown if shown.stays or ages[id(shown)] < shown.stays_s]
        return tuple(
            Message(shown.text, shown.is_error, math.inf if shown.stays else shown.stays_s - ages[id(shown)])
            for shown in self._shown
        )

    @property
    def is_fading(self) -> bool:
        """Something on the screen will change by itself."""
        return any(math.isfinite(message.left_s) for message in self.messages())
