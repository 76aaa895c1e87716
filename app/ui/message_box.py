"""Sentences to the user: notices fade, errors later or with the next success, repetitions only renew."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from .view_model import Message
from .window_words import in_window

NOTICE_S, ERROR_S = 6.0, 20.0
"""A short notice, an error is gone after this long on the screen."""
READ_S = 2.0
"""Shortest time that an error is on the screen, whatever succeeds meanwhile."""
CHARACTERS_S = 15.0
"""Of a longer one that are read in a second."""
MAX_MESSAGES = 6


@dataclass
class _Said:
    text: str
    is_error: bool
    stays: bool = False
    """Until a success."""
    shown_s: float | None = None
    """When it came on the screen: preparing a scene may hold the frame after that in which it was told."""

    @property
    def stays_s(self) -> float:
        return max(ERROR_S if self.is_error else NOTICE_S, len(self.text) / CHARACTERS_S)


class MessageBox:
    """What is on the screen now, oldest first."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._said: list[_Said] = []

    def tell(self, text: str, is_error: bool = False, stays: bool = False) -> None:
        """Show one sentence; one that `stays` does so until the next success."""
        sentence = in_window(" ".join(text.split()))
        self._said = [said for said in self._said if said.text != sentence]
        self._said.append(_Said(sentence, is_error, stays))
        del self._said[:-MAX_MESSAGES]

    def close(self, text: str) -> None:
        """Take a message away."""
        self._said = [said for said in self._said if said.text != text]

    def succeed(self) -> None:
        """Something that the user wanted was done: errors that could be read go."""
        now = self._clock()
        self._said = [
            said for said in self._said if not said.is_error or said.shown_s is None or now - said.shown_s < READ_S
        ]

    def messages(self) -> tuple[Message, ...]:
        """What to show."""
        now, ages = self._clock(), {}
        for said in self._said:
            said.shown_s = now if said.shown_s is None else said.shown_s
            ages[id(said)] = now - said.shown_s
        self._said = [said for said in self._said if said.stays or ages[id(said)] < said.stays_s]
        return tuple(
            Message(said.text, said.is_error, math.inf if said.stays else said.stays_s - ages[id(said)])
            for said in self._said
        )

    @property
    def is_fading(self) -> bool:
        """Something on the screen will change by itself."""
        return any(math.isfinite(message.left_s) for message in self.messages())
