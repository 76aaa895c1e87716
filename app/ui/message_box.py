"""Sentences to the user: notices fade, errors stay until they are closed, repetitions only renew."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from .view_model import Message

NOTICE_S = 6.0
"""A notice is gone after this long."""
MAX_MESSAGES = 6


@dataclass
class _Said:
    text: str
    is_error: bool
    at_s: float


class MessageBox:
    """What is on the screen now, oldest first."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._said: list[_Said] = []

    def tell(self, text: str, is_error: bool = False) -> None:
        """Show one sentence."""
        sentence = " ".join(text.split())
        self._said = [said for said in self._said if said.text != sentence]
        self._said.append(_Said(sentence, is_error, self._clock()))
        del self._said[:-MAX_MESSAGES]

    def close(self, text: str) -> None:
        """Take a message away."""
        self._said = [said for said in self._said if said.text != text]

    def messages(self) -> tuple[Message, ...]:
        """What to show."""
        now = self._clock()
        self._said = [said for said in self._said if said.is_error or now - said.at_s < NOTICE_S]
        return tuple(Message(said.text, said.is_error, now - said.at_s) for said in self._said)

    @property
    def is_fading(self) -> bool:
        """Something on the screen will change by itself."""
        return any(not message.is_error for message in self.messages())
