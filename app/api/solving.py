"""Which glass, and which numbers of a scene, cast the light that is wanted."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import UserError
from ..edit.solved import Fit, Match, Ranked
from .arguments import Count, check_scene, settings_of
from .device import Cancel, Progress, worked_out
from .rendering import check_receiver
from .scene import Scene

if TYPE_CHECKING:
    from ..render.solving import Solver

__all__ = ["Fit", "Match", "Ranked", "fit", "match"]
T = TypeVar("T")
Places = Sequence[Sequence[float]]


def match(
    scene: Scene,
    through: str,
    receiver: str,
    target: ArrayLike | str | os.PathLike[str] | None = None,
    between: Places | None = None,
    *,
    width: float | None = None,
    count: int = 10,
    photons: Count | None = None,
    seed: int | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Match:
    """The glasses of the catalogue of which object `through` casts light on `receiver` that is nearest to `target`.

    `target`: spectra along a line (places, bins) or over a field (rows, columns, bins), of 4 to 32 even bins from 380
    to 780 nm; linear Rec.709 in the same shapes with 3 in place of bins; one spectrum or colour (bins,) of a whole
    field; a picture file. None: the light of the scene as it is, for a `dispersion_gain` that nature does not offer.
    How bright it is does not count. `between`: two ends of a line on the receiver, or three corners of a field (where
    its first row begins and ends, where its last row begins), world; not needed where `target` is None. `width`,
    instead of `target`: full width at half maximum of the light along the line `between`, scene units.
    Raises `UserError`, also where the target says nothing about a glass or `cancel` stopped it.
    """
    from ..render.light_target import glass_called

    check_scene(scene)
    index = glass_called(scene._model, through)
    wish = scene, receiver, target, between, width
    return _run(*wish, lambda solver: solver.match(index, count), photons, seed, progress, cancel)


def fit(
    scene: Scene,
    of: Sequence[str],
    receiver: str,
    target: ArrayLike | str | os.PathLike[str] | None = None,
    between: Places | None = None,
    *,
    width: float | None = None,
    photons: Count | None = None,
    seed: int | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Fit:
    """Values of the parameters `of` (paths as for `gradient`) with which `receiver` is lit as `target` says, from those
    of the scene on; with their standard deviations by what is left over. The rest as for `match`; a
    `width` fixes one parameter, and says nothing of its deviation (NaN)."""
    if target is None and width is None:
        raise UserError("there is nothing to fit to: give a target, or a width")
    if isinstance(of, str) or not of:
        raise UserError("of must be a list of paths, such as ['objects.prism.n_d']")
    wish = scene, receiver, target, between, width
    return _run(*wish, lambda solver: solver.fit(list(of)), photons, seed, progress, cancel)


def _run(
    scene: Scene,
    receiver: str,
    target: ArrayLike | str | os.PathLike[str] | None,
    between: Places | None,
    width: float | None,
    work: Callable[[Solver], Generator[float, None, T]],
    photons: Count | None,
    seed: int | None,
    progress: Progress | None,
    cancel: Cancel | None,
) -> T:
    settings = settings_of(scene, photons=photons, seed=seed)
    check_receiver(scene, receiver)
    values = None if target is None else _values(target)
    from ..edit.parameters import Stage
    from ..render.solving import solution

    wish = Stage(scene._model, scene._model.camera), settings, receiver, values, between, width
    return worked_out("solving", lambda context: solution(context, *wish, work), progress, cancel)


def _values(target: ArrayLike | str | os.PathLike[str]) -> NDArray[np.float64]:
    if isinstance(target, str | os.PathLike):
        from ..render.light_target import read_target

        return read_target(Path(target))
    if hasattr(target, "__dlpack__") and not isinstance(target, np.ndarray):
        target = np.from_dlpack(target)  # type: ignore[arg-type]
    try:
        return np.asarray(target, np.float64)
    except (TypeError, ValueError) as error:
        raise UserError(f"{type(target).__name__} is no target: give an array of spectra or colours") from error
