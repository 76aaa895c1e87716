"""Sentences to the user: notices fade, errors stay until they are closed, repetitions only renew."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from .view_model import Message
from .window_words import in_window

NOTICE_S = 6.0
"""A short notice is gone after this long on the screen."""
CHARACTERS_S = 15.0
"""Of a longer one that are read in a second."""
MAX_MESSAGES = 6


@dataclass
class _Said:
    text: str
    is_error: bool
    shown_s: float | None = None
    """When it came on the screen: preparing a scene may hold the frame after that in which it was told."""

    @property
    def stays_s(self) -> float:
        return max(NOTICE_S, len(self.text) / CHARACTERS_S)


class MessageBox:
    """What is on the screen now, oldest first."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._said: list[_Said] = []

    def tell(self, text: str, is_error: bool = False) -> None:
        """Show one sentence."""
        sentence = in_window(" ".join(text.split()))
        self._said = [said for said in self._said if said.text != sentence]
        self._said.append(_Said(sentence, is_error))
        del self._said[:-MAX_MESSAGES]

    def close(self, text: str) -> None:
        """Take a message away."""
        self._said = [said for said in self._said if said.text != text]

    def messages(self) -> tuple[Message, ...]:
        """What to show."""
        now, ages = self._clock(), {}
        for said in self._said:
            said.shown_s = now if said.shown_s is None else said.shown_s
            ages[id(said)] = now - said.shown_s
        self._said = [said for said in self._said if said.is_error or ages[id(said)] < said.stays_s]
        return tuple(Message(said.text, said.is_error, ages[id(said)]) for said in self._said)

    @property
    def is_fading(self) -> bool:
        """Something on the screen will change by itself."""
        return any(not message.is_error for message in self.messages())
