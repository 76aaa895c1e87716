"""An exposure that follows the picture without flicker, and stays once it has arrived."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..base.tone_map import auto_exposure

MEASURE_S = 0.25
"""Time between two measurements: the picture is read back for each."""
TIME_CONSTANT_S = 0.25
DEADBAND_EV = 0.15
"""A picture that still gathers light wavers by less; the exposure does not follow that."""
ARRIVED_EV = 0.01


class AutoExposure:
    """The exposure in use and the one that it approaches."""

    def __init__(self) -> None:
        self._ev: float | None = None
        self._target = 0.0
        self._next_s = 0.0

    @property
    def is_moving(self) -> bool:
        """On its way to a new exposure."""
        return self._ev is not None and self._ev != self._target

    def restart(self) -> None:
        """Another scene: take the next picture's exposure at once."""
        self._ev = None
        self._next_s = 0.0

    def follow(self, measure: Callable[[], np.ndarray], now_s: float, delta_s: float) -> float:
        """The exposure at `now_s`, `delta_s` after the last call. `measure` gives the picture's pixels (…, 3)."""
        if now_s >= self._next_s:
            self._next_s = now_s + MEASURE_S
            self._aim(measure())
        if self._ev is None:
            return 0.0
        step = (self._target - self._ev) * (1.0 - math.exp(-max(delta_s, 0.0) / TIME_CONSTANT_S))
        self._ev = self._target if abs(self._target - self._ev) < ARRIVED_EV else self._ev + step
        return self._ev

    def _aim(self, pixels: np.ndarray) -> None:
        if not (pixels > 0.0).any():  # nothing has arrived yet
            return
        measured = auto_exposure(pixels)
        if self._ev is None:
            self._ev = self._target = measured
        elif abs(measured - self._target) > DEADBAND_EV:
            self._target = measured
