"""The best that a baseline can do: for every budget the kernel with the least error, and a horizon long enough.

A kernel's width is a free parameter of every method that estimates density (Silverman 1986), and its best value depends
on scene and budget. The bench chooses it by the actual error against the reference, which nobody who renders a new
scene can: baselines are shown at their best, not as they would be used. `srd` is measured as it ships.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .curves import SMALLEST_ERROR
from .rendering import Rendering, Rig
from .results import ERROR_SOUGHT, Curve, Trial

SWEEP_SEED = 0
"""Not among the seeds that are measured."""
_SWEPT_BUDGETS = 5
_GROWTH = 3.0
"""From one budget beyond the first horizon to the next."""
_ALIKE = 2.5
"""Kernels that differ by at most this factor belong to one minimum."""
_FOLLOWED = 3
"""Minima that are followed from one budget to the next: few photons leave noise that has many."""
_SLOPES = (0.3, 1.0)
"""Between which the exponent of error against time is believed."""


@dataclass(frozen=True)
class Tuning:
    """Budgets of a curve, the kernel of each (empty: the method has none), and what was tried to find them."""

    budgets: list[int]
    kernels: list[float]
    sweep: list[Trial]


def tune(
    rig: Rig,
    seconds: float,
    horizon: float,
    count: int,
    judge: Callable[[Rendering], tuple[float, float]],
    progress: Callable[[str], None],
) -> Tuning:
    """Try kernels over a few budgets, then spread `count` budgets from the smallest to the one that takes `seconds`, or
    up to `horizon` where the error is above `ERROR_SOUGHT` until then.

    `judge`: (photon seconds, relMSE) of a rendering."""
    sweep = _Sweep(rig, judge, progress)
    budgets = rig.budgets(seconds, count)
    for budget in sorted({round(n) for n in np.geomspace(budgets[0], budgets[-1], _SWEPT_BUDGETS)}):
        sweep.try_out(budget)
    end = seconds
    while True:
        now = best_trials(sweep.trials)[-1]
        if now.relmse <= ERROR_SOUGHT or now.seconds > 0.7 * horizon:
            break
        sweep.try_out(int(now.photons * min(_GROWTH, horizon / max(now.seconds, 1e-9))))
        end = min(max(best_trials(sweep.trials)[-1].seconds, seconds), horizon)
    chosen = best_trials(sweep.trials)
    if end > chosen[-1].seconds:
        reach = chosen[-1].photons * end / chosen[-1].seconds
    else:
        # Seconds that do not rise with photons are a busy machine's; the envelope does.
        log_n, log_t = np.log([float(t.photons) for t in chosen]), np.log([max(t.seconds, 1e-9) for t in chosen])
        reach = float(np.exp(np.interp(np.log(end), np.maximum.accumulate(log_t), log_n)))
    budgets = sorted({round(n) for n in np.geomspace(min(budgets[0], reach), reach, count)})
    return Tuning(budgets, [sweep.between(chosen, budget) for budget in budgets] if rig.kernels else [], sweep.trials)


class _Sweep:
    """Trials of kernels, each once. Every kernel is tried at the first budget; from there on each of its least errors
    is followed downhill on both sides, since they move slowly, and the narrowest is looked at: a caustic of points has
    two minima, one of noise and one of blur, which change places."""

    def __init__(
        self, rig: Rig, judge: Callable[[Rendering], tuple[float, float]], progress: Callable[[str], None]
    ) -> None:
        self._rig, self._judge, self._progress = rig, judge, progress
        self._starts: set[int] = set(range(max(len(rig.kernels), 1)))
        self.trials: list[Trial] = []

    def tried(self, budget: int, kernel: float | None) -> Trial:
        """The trial of a kernel at a budget, now if not before."""
        known = next((t for t in self.trials if t.photons == budget and t.smoothing == (kernel or 0.0)), None)
        if known is None:
            self._progress(f"{budget} photons" + (f", kernel of {kernel:.2g} spacings" if kernel else ""))
            known = Trial(budget, kernel or 0.0, *self._judge(self._rig.render(budget, SWEEP_SEED, kernel)))
            self.trials.append(known)
        return known

    def try_out(self, budget: int) -> None:
        """All kernels that may be the best at `budget`."""
        count = max(len(self._rig.kernels), 1)

        def error(index: int) -> float:
            return self.tried(budget, self._rig.kernels[index] if self._rig.kernels else None).relmse

        minima = {0} if count == 1 or error(0) <= error(1) else set()
        for at in sorted(self._starts):
            while True:
                least = min((i for i in (at - 1, at, at + 1) if 0 <= i < count), key=error)
                if least == at:
                    break
                at = least
            minima.add(at)
        self._starts = set(sorted(minima, key=error)[:_FOLLOWED])

    def between(self, chosen: Sequence[Trial], budget: int) -> float:
        """The best kernel for a budget between those of `chosen`: in between theirs where they are alike, else the
        better of the two."""
        log_n = np.log([float(t.photons) for t in chosen])
        above = min(int(np.searchsorted(log_n, np.log(budget))), len(chosen) - 1)
        left, right = chosen[max(above - 1, 0)], chosen[above]
        if max(left.smoothing, right.smoothing) <= _ALIKE * min(left.smoothing, right.smoothing):
            return float(np.exp(np.interp(np.log(budget), log_n, np.log([t.smoothing for t in chosen]))))
        return min((left.smoothing, right.smoothing), key=lambda kernel: self.tried(budget, kernel).relmse)


def best_trials(sweep: Sequence[Trial]) -> list[Trial]:
    """For each budget, in rising order, the trial that is best at equal time: a wider kernel takes longer, which is
    weighed by the slope of the least errors against time."""
    by_budget = {n: [t for t in sweep if t.photons == n] for n in sorted({t.photons for t in sweep})}
    least = [min(trials, key=lambda t: t.relmse) for trials in by_budget.values()]
    slope = 1.0
    if len(least) > 1:
        x = np.log([max(t.seconds, 1e-9) for t in least])
        y = np.log([max(t.relmse, SMALLEST_ERROR) for t in least])
        if np.ptp(x) > 0.0:
            slope = float(np.clip(-np.polyfit(x, y, 1)[0], *_SLOPES))
    return [min(trials, key=lambda t: t.relmse * t.seconds**slope) for trials in by_budget.values()]


def kernel_at(curve: Curve, budget: int) -> float | None:
    """The kernel for any budget of a curve: that of the nearest of its own; None where the method has none."""
    if not curve.kernels:
        return None
    return curve.kernels[int(np.argmin(np.abs(np.log(np.array(curve.budgets) / budget))))]
