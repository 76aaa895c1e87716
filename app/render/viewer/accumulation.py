"""The order in which a live rendering traces: coarse passes first, each four times as fine as the one before, then more
of the finest.

Coarse footprints blur and what they blurred would stay in a sum: so a finer pass starts anew, and the maps
are published only when it is complete.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from .live_light import LiveLight

FINER = 4


@dataclass
class Accumulation:
    """Where one light pass stands in that order."""

    light: LiveLight
    photons: int
    """Of the pass that runs."""
    largest: int
    """Photons of the finest pass."""
    target: int
    """Photons after which nothing more is traced."""
    seed: int
    publish: Callable[[], None]
    """Called when the maps are worth showing."""
    number: int = 0
    """Passes of this size that are complete."""
    begun: bool = False

    @property
    def is_done(self) -> bool:
        """The target is reached."""
        return (
            self.begun
            and self.number > 0
            and self.photons >= self.largest
            and self.light.light_pass.stats.photons >= self.target
        )

    def aim_at(self, target: int, largest: int) -> None:
        """Another target; passes become no coarser for it."""
        self.target, self.largest = target, max(largest, self.photons)

    def steps(self) -> Iterator[None]:
        """Everything from here to the target, pausing often."""
        while not self.is_done:
            if not self.begun:
                self.light.light_pass.begin(self.photons, self.seed)
                self.begun = True
                yield
            yield from self._pass(0 if self.number else self.light.rounds_running)
            if not self.light.light_pass.plans:
                self.number, self.photons = 1, self.largest
                self.publish()
                return
            self.number += 1
            yield from self.light.light_pass.settling()
            self.publish()
            yield
            if self.photons < self.largest:
                self.photons = min(self.photons * FINER, self.largest)
                self.number, self.begun = 0, False

    def _pass(self, first_round: int) -> Iterator[None]:
        for _ in self.light.light_pass.pass_steps(self.number, self.photons, first_round):
            yield

    def resumed(self) -> Iterator[None]:
        """Go on tracing after `show_stored`: a pass that was running continues with the round it was in."""
        if self.number > 0:
            # Of the finished passes only the first is stored: the others are due again.
            self.number = 1
            self.light.light_pass.stats.photons = min(self.light.light_pass.stats.photons, self.photons)
        elif self.begun:
            yield from self.light.splat_stored(of_running=True)
        yield from self.steps()

    def show_stored(self) -> Iterator[None]:
        """Splat the stored photons and publish them."""
        if self.light.photons_stored:
            yield from self.light.splat_stored()
            yield from self.light.light_pass.settling()
            self.publish()
