"""Ctrl-C, SIGTERM and SIGHUP: one way to end, which cleans up and keeps what is done.

Outside `interrupt_flag` each of them raises KeyboardInterrupt, so that `finally` removes partial files; but for
imports, which an exception may leave locked for ever: there the process ends at once.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from .atomic import remove_parts

_OTHERS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))


INTERRUPTED = 130


class Terminated(KeyboardInterrupt):
    """SIGTERM or SIGHUP."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


class Interruption:
    """Whether a signal asked for the end; calling it tells."""

    def __init__(self) -> None:
        self.number: int | None = None

    def __call__(self) -> bool:
        return self.number is not None

    @property
    def exit_code(self) -> int:
        """As shells have it: 128 and the signal's number; 0 without one."""
        return 0 if self.number is None else 128 + self.number


def exit_code_of(interrupt: KeyboardInterrupt) -> int:
    """130 for Ctrl-C, 143 for SIGTERM, 129 for SIGHUP."""
    return 128 + (interrupt.number if isinstance(interrupt, Terminated) else int(signal.SIGINT))


@contextmanager
def signals_raise() -> Iterator[Interruption]:
    """Within the block SIGTERM and SIGHUP raise `Terminated`, unless somebody chose otherwise (nohup ignores one), and
    Ctrl-C raises KeyboardInterrupt as ever; what is yielded knows of it where the exception was lost on the way."""
    interruption = Interruption()

    def end(number: int, frame: FrameType | None) -> None:
        interruption.number = number
        if _is_importing(frame):
            remove_parts()
            os.write(2, b"spectrasplat: interrupted\n")
            os._exit(interruption.exit_code)
        raise KeyboardInterrupt if number == signal.SIGINT else Terminated(number)

    usual = (signal.SIG_DFL, signal.default_int_handler)
    with _handled({number: end for number in (signal.SIGINT, *_OTHERS) if signal.getsignal(number) in usual}):
        yield interruption


def _is_importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


@contextmanager
def interrupt_flag() -> Iterator[Interruption]:
    """Within the block the first Ctrl-C, SIGTERM or SIGHUP only sets a flag, which calling the yielded value returns.

    The renderer then stops after its batch and what it has is written. A second one interrupts as usual.
    """
    interruption = Interruption()

    def remember(number: int, _frame: FrameType | None) -> None:
        if interruption.number is not None:
            raise KeyboardInterrupt if number == signal.SIGINT else Terminated(number)
        interruption.number = number
        print("spectrasplat: stopping; what is done will be written", file=sys.stderr)

    numbers = [signal.SIGINT, *(number for number in _OTHERS if signal.getsignal(number) is not signal.SIG_IGN)]
    with _handled(dict.fromkeys(numbers, remember)):
        yield interruption


@contextmanager
def _handled(handlers: dict) -> Iterator[None]:
    before = {}
    try:
        for number, handler in handlers.items():
            before[number] = signal.signal(number, handler)
    except ValueError:  # not the main thread, to which signals go
        pass
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
