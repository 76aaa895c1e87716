"""How far a frame is: what each part of it takes, weighted by time.

How long photons and camera samples take is guessed beforehand; the environment's light, which can take longer than
both, tells by how far it has come.
"""

from __future__ import annotations

PHOTON_S, SAMPLE_S = 10e-6, 3e-6
"""What a photon and a camera sample of a pixel take on two cores, and hardly more than one to the other elsewhere."""


class FrameProgress:
    """Shares of a frame's time, from 0 to 1, that never fall."""

    def __init__(self) -> None:
        self._environment_s = self._light_s = self._camera_s = 0.0
        self._share = 0.0
        self.ends = 0.0
        """The frame's share when the part that was reported last is done."""

    def expect_photons(self, photons: int) -> None:
        """So many will be traced."""
        self._light_s = photons * PHOTON_S

    def expect_samples(self, samples: int) -> None:
        """So many will be taken, over all pixels."""
        self._camera_s = samples * SAMPLE_S

    def environment(self, share: float, seconds: float) -> float:
        """The frame's share when `share` of the environment's light is known after `seconds`."""
        if share > 0.0:
            self._environment_s = seconds / share
        return self._done(seconds, self._environment_s)

    def light(self, share: float) -> float:
        """The frame's share when `share` of the photons is traced."""
        return self._done(self._environment_s + share * self._light_s, self._environment_s + self._light_s)

    def camera(self, share: float) -> float:
        """The frame's share when `share` of the camera's samples is taken."""
        before = self._environment_s + self._light_s
        return self._done(before + share * self._camera_s, before + self._camera_s)

    def _done(self, seconds: float, end: float) -> float:
        whole = self._environment_s + self._light_s + self._camera_s
        if whole > 0.0:
            self._share = max(self._share, min(seconds / whole, 1.0))
            self.ends = end / whole
        return self._share
