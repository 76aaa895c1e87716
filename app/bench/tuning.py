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

    `judge`: (photon seconds, relMSE) of a rendering. Every kernel is tried at the smallest budget; from there on the
    best one is followed downhill on both sides, since it moves slowly."""
    first, last = (budgets := rig.budgets(seconds, count))[0], budgets[-1]
    sweep: list[Trial] = []
    best = 0

    def tried(budget: int, index: int) -> float:
        kernel = rig.kernels[index] if rig.kernels else None
        known = next((t for t in sweep if t.photons == budget and t.smoothing == (kernel or 0.0)), None)
        if known is None:
            progress(f"{budget} photons" + (f", kernel of {kernel:.2g} spacings" if kernel else ""))
            took, error = judge(rig.render(budget, SWEEP_SEED, kernel))
            sweep.append(known := Trial(budget, kernel or 0.0, took, error))
        return known.relmse

    def follow(budget: int, start: int) -> int:
        """Index of the kernel with the least error, downhill from `start`."""
        at = start
        while True:
            near = [i for i in (at - 1, at, at + 1) if 0 <= i < max(len(rig.kernels), 1)]
            least = min(near, key=lambda i: tried(budget, i))
            if least == at:
                return at
            at = least

    ladder = sorted({round(n) for n in np.geomspace(first, last, _SWEPT_BUDGETS)})
    for budget in ladder:
        if budget == ladder[0]:
            best = min(range(max(len(rig.kernels), 1)), key=lambda i: tried(budget, i))
        best = follow(budget, best)
    end = seconds
    while True:
        now = _best_trials(sweep)[-1]
        if now.relmse <= ERROR_SOUGHT or now.seconds > 0.7 * horizon:
            break
        budget = int(now.photons * min(_GROWTH, horizon / max(now.seconds, 1e-9)))
        best = follow(budget, best)
        end = min(max(_best_trials(sweep)[-1].seconds, seconds), horizon)
    chosen = _best_trials(sweep)
    log_n, log_t = np.log([float(t.photons) for t in chosen]), np.log([max(t.seconds, 1e-9) for t in chosen])
    # Seconds that do not rise with photons are a busy machine's; the envelope does.
    reach = float(np.exp(np.interp(np.log(end), np.maximum.accumulate(log_t), log_n)))
    if end > chosen[-1].seconds:
        reach = chosen[-1].photons * end / chosen[-1].seconds
    budgets = sorted({round(n) for n in np.geomspace(min(first, reach), reach, count)})
    if not rig.kernels:
        return Tuning(budgets, [], sweep)
    log_k = np.log([t.smoothing for t in chosen])
    return Tuning(budgets, [float(k) for k in np.exp(np.interp(np.log(budgets), log_n, log_k))], sweep)


def _best_trials(sweep: Sequence[Trial]) -> list[Trial]:
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
    """The kernel for any budget of a curve, between those of its own; None where the method has none."""
    if not curve.kernels:
        return None
    return float(np.exp(np.interp(np.log(budget), np.log(curve.budgets), np.log(curve.kernels))))
