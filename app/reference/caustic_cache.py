"""The spectral caustic kept in the user's cache folder, as large as a picture needs it.

What counts is how much noise it leaves in the picture, and that is measured: the same camera paths look up either half
of the photons. A caustic in plain view needs a hundred times the photons of one that covers a corner.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from ..model.scene import Scene
from ..model.scene_key import ContentKey
from .camera_reference import CameraRun
from .photon_reference import relative_variance
from .rounds import PARTS, Progress, kept_path, load_kept, save_kept
from .spectral_caustic import CausticPlan, CausticRun, SpectralCaustic

_FIRST_STEP = 1 << 22
"""Photons after which the noise is measured first."""
_NOISE_SAMPLES = 128
"""Samples of each pixel by which the noise is measured."""
_SPARE, _MIN_STEP = 1.1, 1.25
"""Factors on the photons that should be enough, as noise falls as one over their number, about; and on those that were
not."""
_SAVE_SECONDS = 120.0
"""A run that is killed loses no more."""


class CachedCaustic:
    """A caustic on disk that grows as far as its plan asks for."""

    def __init__(
        self,
        scene: Scene,
        width: int,
        height: int,
        max_depth: int,
        plan: CausticPlan,
        picture_key: str,
        folder: Path | None,
    ) -> None:
        """`max_depth`: of camera paths; `picture_key`: hash of everything that a picture with this caustic depends on,
        but for the number of photons."""
        self._scene, self._size, self._max_depth, self._plan = scene, (width, height), max_depth, plan
        key = ContentKey(picture_key)
        key.add("caustic alone")
        self._path = kept_path(key.hexdigest(), folder)

    def grown(self, progress: Progress) -> tuple[SpectralCaustic, float]:
        """The caustic, and the noise it leaves in the picture as relMSE; traced as far as the disk has less than
        planned, and stored.

        An interrupt stores what is done and goes on upwards. Raises UserError as `build_caustic` does.
        """
        run = CausticRun(self._scene, *self._size, self._plan)
        if run.exhausted:
            return run.caustic(), 0.0
        measured, noise = self._restore(run)
        while run.photons < (goal := _goal(self._plan, measured, noise)):
            self._grow(run, goal, measured, noise, progress)
            caustic = run.caustic()
            measured, noise = run.photons, picture_noise(self._scene, *self._size, self._max_depth, caustic)
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


def picture_noise(scene: Scene, width: int, height: int, max_depth: int, caustic: SpectralCaustic) -> float:
    """relMSE that the caustic's noise adds to a picture, mean[var/(R² + ε)].

    Both halves are looked up by the same paths, and what the parts' differences have in common is no noise of the
    paths.
    """
    runs = [CameraRun(scene, width, height, max_depth, caustic=caustic.half(number)) for number in range(2)]
    for run in runs:
        while run.samples < _NOISE_SAMPLES:
            run.advance(_NOISE_SAMPLES - run.samples)
    even, odd = (run.sums / run.units[:, None, None, None] for run in runs)
    apart = even - odd
    variance = 0.25 * (apart.sum(axis=0) ** 2 - (apart**2).sum(axis=0)) / (PARTS * (PARTS - 1))
    mean = 0.5 * (even + odd).mean(axis=0)
    return max(relative_variance(mean, variance), 0.0)


def _goal(plan: CausticPlan, measured: int, noise: float) -> int:
    """Photons to go on to, after `measured` of them left `noise`; those themselves where they are enough."""
    if plan.target_relmse <= 0.0:
        return plan.photons
    if not measured:
        return min(_FIRST_STEP, plan.photons)
    if noise <= plan.target_relmse or measured >= plan.photons:
        return measured
    return int(min(max(_SPARE * noise / plan.target_relmse, _MIN_STEP) * measured, plan.photons))
