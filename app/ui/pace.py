"""How long the engine may work in a frame so that input has its effect in time, whatever else a frame costs."""

from __future__ import annotations

SOFTWARE_FRAME_S = 0.04
"""A frame on the software renderer: with the batch that runs over its end, within the 50 ms in which input must
have its effect."""
PATIENT_FRAME_S = 0.15
"""While nobody touches anything: what the interface costs, on two cores more than half of a frame, is then spent less
often. Input and a new picture end it, or else half of the interface's frames would show what the last one did."""
LIGHT_SHARE = 3.0
"""Of what the interface costs that the engine gets at least then, on a machine with other things to do as well …"""
LONGEST_PATIENT_S = 0.3
"""… but no longer: what is written in the window changes meanwhile."""
GPU_SHARE = 0.75
"""Of the time between two pictures of the screen; the rest is the driver's and the window system's."""
MIN_SHARE = 0.25
"""Of a frame that the engine always gets: a slow interface must not stop the light."""
_SMOOTHING = 0.2


class Pace:
    """`budget_s` for the next frame, from what the last ones cost beside the engine."""

    def __init__(self, is_software: bool, refresh_s: float = 1 / 60) -> None:
        self._is_software = is_software
        self.frame_s = SOFTWARE_FRAME_S if is_software else GPU_SHARE * refresh_s
        self._besides_s = self._patient_besides_s = 0.0

    @property
    def budget_s(self) -> float:
        """Seconds for the engine."""
        return self._left_of(self.frame_s)

    @property
    def patient_budget_s(self) -> float:
        """The same while nobody touches anything."""
        if not self._is_software:
            return self.budget_s
        least = min(LIGHT_SHARE * self._patient_besides_s, LONGEST_PATIENT_S)
        return max(self._left_of(max(self.frame_s, PATIENT_FRAME_S)), least)

    def _left_of(self, frame_s: float) -> float:
        return max(frame_s - self._besides_s, MIN_SHARE * frame_s)

    def note(self, besides_s: float) -> None:
        """A frame took `besides_s` seconds beside the engine's work (without waiting for the screen)."""
        # One long frame (a file was read) says nothing about the next.
        self._besides_s += _SMOOTHING * (min(besides_s, self.frame_s) - self._besides_s)
        self._patient_besides_s += _SMOOTHING * (min(besides_s, PATIENT_FRAME_S) - self._patient_besides_s)
