"""Photons of a rendering, pass after pass: of a given number, or as many as some time allows."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

from .light_pass import LightPass
from .pass_sizes import FIRST_PHOTONS, SHRINKING, endless_passes, pass_sizes
from .sampling import LightSampling

_TRIALS_SHARE = 0.1
"""Share of the time for doubling passes that measure how fast a scene is traced."""
_AFTER_STOP = 0.2
"""Share of the time that a pass took until it was stopped in which what it lacks is traced coarsely."""
_SMALLEST_PASS = FIRST_PHOTONS // 2
"""Photons; what time is left for fewer is given back."""


def traced_light(light: LightPass, sampling: LightSampling, stop: Callable[[], bool]) -> Iterator[float]:
    """Fill the maps of a prepared light pass, pausing with the share done."""
    if sampling.seconds is not None:
        yield from _traced_for(light, sampling.seconds, sampling.seed, stop)
        return
    sizes = pass_sizes(light.features.method, sampling.photons)
    light.begin(sizes[0], sampling.seed)
    for number, photons in enumerate(sizes):
        light.plan(photons, number)
        for step in light.pass_of(number, photons).steps(seconds_left=_seconds_left(stop)):
            yield (sum(sizes[:number]) + step.fraction * photons) / sum(sizes)
        if number + 1 < len(sizes) and stop():
            return


def _traced_for(light: LightPass, seconds: float, seed: int, stop: Callable[[], bool]) -> Iterator[float]:
    """As many photons as `seconds` allow.

    Doubling passes measure how fast the scene is traced; when they have taken a tenth of the time, one pass fills what
    is left of it, as one lattice is better than several. What it leaves in turn, since photons of a large pass take
    less each, is filled in the same way. All stay in the sum, each with its weight."""
    begun, number, trials = time.perf_counter(), 0, endless_passes(light.features.method)
    photons = next(trials)
    light.begin(photons, seed)

    def spent() -> float:
        return min((time.perf_counter() - begun) / seconds, 1.0)

    while light.plans or light.survey.has_beams:
        started = time.perf_counter()
        light.plan(photons, number)
        for _ in light.pass_of(number, photons).steps(seconds_left=_seconds_left(stop, begun + seconds)):
            yield spent()
        if spent() >= 1.0 or stop():
            return
        number += 1
        if spent() < _TRIALS_SHARE or light.features.method == SHRINKING:
            photons = next(trials)
        else:
            affordable = (1.0 - spent()) * seconds / (time.perf_counter() - started) * photons
            if affordable < _SMALLEST_PASS:
                return
            photons = int(affordable)


def _seconds_left(stop: Callable[[], bool], ends: float = math.inf) -> Callable[[], float]:
    """Seconds left to a pass that begins now, until `ends` (`time.perf_counter()`), or until soon after `stop()` turned
    true."""
    begun = time.perf_counter()

    def left() -> float:
        nonlocal ends
        now = time.perf_counter()
        if stop():
            ends = min(ends, now + _AFTER_STOP * (now - begun))
        return ends - now

    return left
