"""One pass of the light pass, in rounds: each is an even sub-lattice of the whole, traced as beams and as photons.

Rounds that there is no time for are traced together: one of them with the light of all, its footprints as long as the
row of points that it stands for.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.random_words import Dimension, random_word, shift
from ..passes.beam_emission import BeamEmission
from ..passes.lattice_slice import Part, every, row_of
from .light_plan import LightPlan
from .light_stats import PassStep
from .light_survey import LightSurvey
from .photon_batches import Deposit, PhotonBatches
from .photon_records import RoundOf

BEAM_ROUND = 1 << 19
"""Photons' worth of beams, where they carry everything, after which a pass may be stopped."""
MIN_BEAM_PHOTONS = 1 << 17
"""Photons, at least, whose beams are found at once, where photons are traced besides."""
_DENSITY = 64.0
"""As many times more photons than an even lattice would have, at most, carry on weak beams, and all that beams leave
where no others are traced; never more than a round's."""
_WHOLE_BAND, _NARROWEST_BAND = 1e5, 0.25
"""Photons of a pass up to which those that carry on weak beams keep these beams' bands, swept from where one wavelength
goes: with more the chord would be most of the error. They narrow by the power 2/3, to this share of the spectrum."""
_FEWEST = 256
"""Photons over the pieces of a light."""


def roulette_word(seed: int, number: int) -> int:
    """Seed of beams' roulette in round `number` of all passes."""
    return random_word(seed, 0, number, Dimension.BRANCH)


@dataclass(frozen=True)
class PassRounds:
    """Pass `number` of about `photons` over all lights, as it is planned."""

    survey: LightSurvey
    plans: Sequence[LightPlan]
    batches: PhotonBatches
    into: Deposit
    number: int
    photons: int
    weight: float
    """What it adds to the weight of the maps' sums."""
    seed: int

    @property
    def count(self) -> int:
        """Into how many rounds the pass is divided."""
        if not self.plans:
            return -(-self.photons // BEAM_ROUND) if self.survey.has_beams else 0
        return self.batches.trace.rounds(self._parts)

    @property
    def _parts(self) -> list[Part]:
        return [plan.part(self.seed, self.number, self.photons, self.weight) for plan in self.plans]

    @property
    def together(self) -> int:
        """How many rounds have their beams together: few photons' worth of beams are coarse ones."""
        if not (self.plans and self.survey.has_beams):
            return 1
        return max(1, -(-MIN_BEAM_PHOTONS * self.count // self.photons))

    def steps(
        self,
        first_round: int = 0,
        first_group: int = 0,
        stride: int = 1,
        seconds_left: Callable[[], float] | None = None,
    ) -> Iterator[PassStep]:
        """The whole pass, pausing after every event of the rays and after every splatting.

        `first_round`: where a pass continues that was stopped before. `first_group`, `stride`: of the groups of rounds
        that have their beams together, this one and every `stride`-th after it, where others trace the rest.
        `seconds_left`: until it should be over; it takes one more round if need be, and ends early where light is not
        missing between photons anyway. Its rounds go along rows of neighbours; those of a pass without an end leave
        what is there as even as can be."""
        if not self.plans:
            yield from self._only_beams(range(first_round + first_group, self.count, stride), seconds_left)
            return
        rounds, together, smoothing = self.count, self.together, self.into.smoothing
        j = has_beams = first_round
        started, traced = time.perf_counter(), 0
        while j < rounds:
            if (j // together - first_group) % stride:
                j += 1
                continue
            length, parts = 1, self._parts
            if seconds_left and traced:
                affordable = seconds_left() * traced / (time.perf_counter() - started)
                if affordable <= 0.0 and not self.batches.trace.has_footprints:
                    return
                length = (rounds - j) // max(round(min(affordable, rounds - j)), 1)
            if j + length > has_beams:
                first, has_beams = max(j, has_beams), min(-(-(j + length) // together) * together, rounds)
                yield from self._beams(RoundOf(self.number, first, rounds, False), j / rounds, has_beams - first)
            some = row_of(rounds, j, length, smoothing, parts) if seconds_left else every(rounds, j, parts)
            for _ in self.batches.lattice(some, RoundOf(self.number, j, rounds, True), self.into):
                yield PassStep(j / rounds, False)
            for _ in self.batches.settle() if j + length == rounds else ():
                yield PassStep(j / rounds, False)
            j, traced = j + length, traced + 1
            self.into.maps.photon_weight += length * self.weight / rounds
            yield PassStep(j / rounds, j == has_beams)

    def _only_beams(self, numbers: Sequence[int], seconds_left: Callable[[], float] | None) -> Iterator[PassStep]:
        rounds, photons = self.count, self.photons
        for j in numbers:
            for step in self._beams(RoundOf(self.number, j, rounds, True)):
                yield PassStep((j + step.fraction) / rounds, False)
            self.into.maps.photon_weight += self.weight / rounds
            self.into.stats.photons += photons * (j + 1) // rounds - photons * j // rounds
            yield PassStep((j + 1) / rounds, True)
            if seconds_left and seconds_left() <= 0.0:
                return

    def _beams(self, of: RoundOf, done: float = 0.0, rounds: int = 1) -> Iterator[PassStep]:
        """The beams of so many `rounds` from one on, and the photons that carry on what those left."""
        beams, stats = self.survey.beams, self.into.stats
        if beams is None:
            return
        share, weight = self.photons * rounds / of.count, self.weight * rounds / of.count
        before = beams.stats.find_seconds, beams.stats.draw_seconds
        for part in beams.steps(share, weight, roulette_word(self.seed, self._nth(of)), self.into.maps):
            yield PassStep(done if self.plans else part, False)
        after = beams.stats.find_seconds, beams.stats.draw_seconds
        stats.trace_seconds += after[0] - before[0]
        stats.splat_seconds += after[1] - before[1]
        tally = beams.tally(weight)
        stats.tally.merge(tally)
        stats.polygons_w += tally.ended["deposited"]
        for tails in (False, True):
            for _ in self._carried_on(of, share, weight, tails):
                yield PassStep(done, False)

    def _carried_on(self, of: RoundOf, share: float, weight: float, tails: bool) -> Iterator[None]:
        """Photons that carry on what beams of `share` photons left: weak beams (`tails`), or all else."""
        beams, batches = self.survey.beams, self.batches
        if beams is None or beams.found is None or beams.found.pieces is None:
            return
        pieces, started = beams.found.pieces, time.perf_counter()
        pieces = pieces.where(pieces.is_tail == tails)
        if not len(pieces):
            return
        widest = max(min(1.0, _WHOLE_BAND / self.photons) ** (2.0 / 3.0), _NARROWEST_BAND)
        emission = BeamEmission(self.survey.buffers, batches.trace.ray, pieces, batches.records.tables.spans, widest)
        flux_w = {light: emission.flux_w(light) for light in np.unique(emission.pieces.light).tolist()}
        total, roots = sum(flux_w.values()), sum(watts**0.5 for watts in flux_w.values())
        denser = 1.0 if self.plans and not tails else _DENSITY
        most_of_all = share * min(1.0, denser * total / max(beams.stats.entered_w, 1e-300))
        for light, watts in flux_w.items():
            # Tails are shared out among lights by the root of their flux.
            count = most_of_all * (watts**0.5 / roots if tails else watts / total) if watts > 0.0 else 0.0
            if count <= 0.0 or (tails and count < 1.0):
                continue  # less than a 64th of a photon's power
            words = self.seed, light, self._nth(of)
            shifts = shift(*words, Dimension.LATTICE_U), shift(*words, Dimension.LATTICE_V)
            key, count = random_word(*words, Dimension.BRANCH), max(_FEWEST, int(count))
            for rays in emission.batches(light, count, weight, shifts, key, batches.budget.units):
                self.into.stats.trace_seconds += time.perf_counter() - started
                yield from batches.carry_on(rays, light, of, self.into, of_tails=tails)
                started = time.perf_counter()

    @staticmethod
    def _nth(of: RoundOf) -> int:
        """A round's number among those of all passes."""
        return of.number * of.count + of.index
