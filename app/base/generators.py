"""Generators that pause while they work, some of which return what they have worked out."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from typing import Any, TypeVar

P = TypeVar("P")
Q = TypeVar("Q")
T = TypeVar("T")


def finished(steps: Generator[P, Any, T], at_pause: Callable[[P], object] = lambda pause: None) -> T:
    """Run `steps` to their end, with a call at every pause; what they return."""
    while True:
        try:
            at_pause(next(steps))
        except StopIteration as end:
            return end.value


def mapped(steps: Generator[P, Any, T], change: Callable[[P], Q]) -> Generator[Q, None, T]:
    """`steps`, with what they report at a pause changed."""
    while True:
        try:
            pause = next(steps)
        except StopIteration as end:
            return end.value
        yield change(pause)


def part_of(steps: Generator[float, Any, T], begun: float, share: float) -> Generator[float, None, T]:
    """`steps`, whose shares done are of `share` of something larger, `begun` of which was done before."""
    return mapped(steps, lambda done: begun + share * done)


def timed(steps: Generator[P, Any, T], count: Callable[[float], object]) -> Generator[P, None, T]:
    """`steps`; `count` gets the seconds that they work from one pause to the next."""
    while True:
        started = time.perf_counter()
        try:
            pause = next(steps)
        except StopIteration as end:
            return end.value
        finally:
            count(time.perf_counter() - started)
        yield pause
