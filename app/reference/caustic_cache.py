"""The spectral caustic kept in the user's cache folder, as large as a picture needs it.

What counts is how much noise it leaves in the picture, and that is measured: the same camera paths look up either half
of the photons. A caustic in plain view needs a hundred times the photons of one that covers a corner.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..model.scene import Scene
from ..model.scene_key import ContentKey
from .rounds import Progress, kept_path, load_kept, save_kept
from .spectral_caustic import CausticPlan, CausticRun, SpectralCaustic

_FIRST_STEP = 1 << 22
"""Photons after which the noise is measured first."""
_SPARE, _MIN_STEP = 1.1, 1.25
"""Factors on the photons that should be enough, as noise falls as one over their number, about; and on those that were
not."""
_SAVE_SECONDS = 120.0
"""A run that is killed loses no more."""


class CachedCaustic:
    """A caustic on disk that grows as far as its plan says."""

    def __init__(
        self,
        scene: Scene,
        width: int,
        height: int,
        plan: CausticPlan,
        picture_key: str,
        folder: Path | None,
        noise_of: Callable[[SpectralCaustic], float],
    ) -> None:
        """`picture_key`: hash of everything that a picture with this caustic depends on, but for the number of photons;
        `noise_of`: relMSE that a caustic's noise adds to the picture."""
        self._scene, self._size, self._plan, self._noise_of = scene, (width, height), plan, noise_of
        key = ContentKey(picture_key)
        key.add("caustic alone")
        self._path = kept_path(key.hexdigest(), folder)

    def grown(self, progress: Progress) -> tuple[SpectralCaustic, float]:
        """The caustic, and the noise it leaves in the picture as relMSE; traced as far as the disk has less than
        planned, and stored.

        An interrupt stores what is done and is raised again. Raises UserError as `build_caustic` does.
        """
        run = CausticRun(self._scene, *self._size, self._plan)
        if run.exhausted:
            return run.caustic(), 0.0
        measured, noise = self._restore(run)
        while run.photons < (goal := _goal(self._plan, measured, noise)):
            self._grow(run, goal, measured, noise, progress)
            caustic = run.caustic()
            measured, noise = run.photons, self._noise_of(caustic)
            self._save(run, measured, noise)
        return run.caustic(), noise

    def _grow(self, run: CausticRun, goal: int, measured: int, noise: float, progress: Progress) -> None:
        saved = time.perf_counter()
        try:
            while run.photons < goal:
                progress(run.photons / goal, f"caustic, {run.photons / 1e6:.1f} of {goal / 1e6:.1f} M photons")
                run.advance(goal - run.photons)
                if time.perf_counter() - saved > _SAVE_SECONDS:
                    self._save(run, measured, noise)
                    saved = time.perf_counter()
        finally:
            if run.photons < goal:
                self._save(run, measured, noise)

    def _restore(self, run: CausticRun) -> tuple[int, float]:
        """Photons at which the noise was measured last, and the noise; `run` gets what is stored, if that fits."""
        pilots: dict[str, np.ndarray] = {
            "counts": run.counts,
            "low": run.tables.low,
            "texels": run.tables.texels_per_unit,
        }
        own: dict[str, np.ndarray] = {"sums": run.sums, "units": run.units, "flux": run.flux}
        shapes = {name: values.shape for name, values in (pilots | own).items()}
        stored = load_kept(self._path, shapes | {"noise": (), "measured": ()})
        if stored is None or any(not np.array_equal(stored[name], values) for name, values in pilots.items()):
            return 0, 0.0
        for name, values in own.items():
            values[...] = stored[name]
        return int(stored["measured"]), float(stored["noise"])

    def _save(self, run: CausticRun, measured: int, noise: float) -> None:
        save_kept(
            self._path,
            sums=run.sums,
            units=run.units,
            flux=run.flux,
            counts=run.counts,
            low=run.tables.low,
            texels=run.tables.texels_per_unit,
            noise=noise,
            measured=measured,
        )


def _goal(plan: CausticPlan, measured: int, noise: float) -> int:
    """Photons to go on to, after `measured` of them left `noise`; those themselves where they are enough."""
    if plan.target_relmse <= 0.0:
        return plan.photons
    if not measured:
        return min(_FIRST_STEP, plan.photons)
    if noise <= plan.target_relmse or measured >= plan.photons:
        return measured
    return int(min(max(_SPARE * noise / plan.target_relmse, _MIN_STEP) * measured, plan.photons))
