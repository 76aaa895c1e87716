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
    """How far one light pass is in that order."""

    light: LiveLight
    photons: int
    """Photons of the pass that runs."""
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
    first: int = 0
    """Photons of the first pass."""
    finest: int = 0
    """Photons of the finest pass that was published."""

    def __post_init__(self) -> None:
        self.first = self.photons

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
        light_pass = self.light.light_pass
        while not self.is_done:
            yield from self._pass()
            if not light_pass.plans and not light_pass.survey.has_beams:
                self.number, self.photons = 1, self.largest
                self.publish()
                return
            yield from light_pass.settling()
            if self.photons > self.first:
                self.light.keep(self.photons, self.number)
            self.finest = max(self.finest, self.photons)
            self.publish()
            yield
            yield from self._refine()

    def survey(self) -> Iterator[None]:
        """What is there before anything else, published; nothing where photons are needed."""
        light_pass = self.light.light_pass
        if self.light.only_beams:
            light_pass.begin(self.photons, self.seed)
            yield
            self.light.show_survey()
            yield
            yield from light_pass.settling()
            self.publish()
            yield

    def _pass(self) -> Iterator[None]:
        light_pass = self.light.light_pass
        self.light.finest = self.largest
        light_pass.widening = self.light.widening(self.photons)
        if not self.begun:
            light_pass.begin(self.photons, self.seed)
            self.begun = True
            yield
        running = None if self.number else self.light.stored.running
        for _ in light_pass.pass_steps(self.number, self.photons, running.store.rounds if running else 0):
            yield
        self.number += 1

    def resumed(self) -> Iterator[None]:
        """Go on tracing after `show_stored`: a pass that was running continues with the round it was in."""
        if self.light.only_beams:
            yield from self._refine()
        elif self.number > 0:
            # Of the finished passes only the first is stored: the others are due again.
            self.number = 1
            self.light.light_pass.stats.photons = min(self.light.light_pass.stats.photons, self.photons)
        elif self.begun:
            yield from self.light.splat_stored(of_running=True)
        yield from self.steps()

    def _refine(self) -> Iterator[None]:
        """After a pass: a finer one is next, until passes are as fine as they may be."""
        yield from self.light.sample(self.first)
        if self.number and self.photons < self.largest:
            self.photons = min(self.photons * FINER, self.largest)
            self.number, self.begun = 0, False

    def bring_back(self) -> None:
        """Return to the state of the light that is kept (`LiveLight.holds_shown`)."""
        self.photons, self.number = self.light.bring_back()
        self.begun = True

    def show_stored(self) -> Iterator[None]:
        """Splat the stored photons and publish them; where there are none, what was kept of the same light, or else all
        beams again from the coarsest."""
        if self.light.only_beams and self.light.holds_shown:
            self.bring_back()
            yield
        elif self.light.only_beams:
            self.photons, self.number, self.begun = self.first, 0, False
            yield from self._pass()
        elif self.light.photons_stored:
            yield from self.light.splat_stored()
        else:
            return
        yield from self.light.light_pass.settling()
        self.publish()
