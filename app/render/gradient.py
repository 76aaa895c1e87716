"""Derivatives of a caustic map, or of a picture, by the numbers of a scene.

Each is the difference of two pictures over twice a small step. Both have the same random numbers, the same lattices of
light and the same texels: what does not depend on the parameter is the same in both to the bit, and what does changes
smoothly, so that chance, which would be divided by the step, drops out. What remains of it, and of the blur of
footprints, is told by a quarter of the photons.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import UserError
from ..base.generators import mapped, part_of
from ..edit.glass import bent
from ..edit.parameters import Stage, apply, parameter, parts, value_of
from ..gpu.context import Context
from ..model.scene import SceneObject
from ..model.settings import RenderSettings
from .bake import drawn
from .frames import Picture
from .sampling import CameraSampling

INDEX = "index"
"""Parameter of an object of glass: n(λ), raised alike at all wavelengths."""
_CHANGE, _LEAST_CHANGE, _MOST_CHANGE = 0.03, 0.01, 0.08
"""Change of the picture, as a share of its norm, that a step is to make: much less is lost in rounding, and more is no
derivative."""
_LARGEST, _TRIES, _TRIED = 8.0, 3, 1 << 15
"""A step over the first one at most; pictures by so many photons until it is found."""
ENOUGH, _BANDS = 1 << 17, 16
"""Photons, and their spectral bands, of which fewer have fewer: within one, footprints are as broad as at its middle.
That misses little of a picture, and much of what dispersion changes in a focus."""
_OTHER_SEED = 1 << 31
"""Added to the seed of all photons for the quarter of them."""
_WORSE, _WORSE_SEEN = 3.0, 5.0**0.5
"""By how many errors of all photons, at least, a quarter of them differs: four times the blur and the chance of a
lattice, in pictures twice the chance of the camera's samples."""


@dataclass(frozen=True)
class Derivative:
    """Derivative of every number of a picture by one parameter, per unit of it."""

    path: str
    picture: Picture
    step: float
    """The parameter's change to either side."""
    noise: float
    """Error of `picture.rgb` by chance and blur, as a share of its norm; NaN where it was not asked for."""


@dataclass(frozen=True)
class Gradient:
    """A picture and its derivatives."""

    base: Picture
    derivatives: tuple[Derivative, ...]
    placement: Mapping[str, object] | None
    """Where the map lies on its receiver, as `bake` writes it; None for other layers."""


def gradient(
    context: Context,
    stage: Stage,
    settings: RenderSettings,
    paths: Sequence[str],
    steps: Mapping[str, float] | None = None,
    window: np.ndarray | None = None,
    *,
    noise: bool = False,
) -> Generator[float, None, Gradient]:
    """Gradient of what `settings.layer` shows by each of `paths` (`edit.parameters`, and `INDEX`), pausing with the
    share done.

    `steps`: of parameters; those of others are found by a few photons. `window`: `MapFit.window` of a map. `noise`: by
    a quarter of the photons and of the camera's samples as well, whose difference says it. Raises `UserError`."""
    for path in paths:
        check_path(stage, path)
    photons = settings.photons or stage.scene.render.photons
    few = with_bands(replace(settings, photons=min(photons, _TRIED), seconds=None, spp=1))
    runs = [with_bands(replace(settings, photons=photons))]
    if noise:
        spp, seed = max(1, CameraSampling.of(settings).budget // 4), (settings.seed + _OTHER_SEED) & 0xFFFFFFFF
        runs.append(replace(runs[0], photons=max(1, photons // 4), spp=spp, seed=seed))
    worse = _WORSE if settings.layer.startswith("map:") else _WORSE_SEEN
    derivatives: list[Derivative] = []
    base: Picture | None = None
    where: Mapping[str, object] = {}
    share = 1.0 / (len(paths) * len(runs))
    for number, path in enumerate(paths):
        h = (steps or {}).get(path) or (yield from mapped(_step(context, stage, few, path, window), lambda done: 0.0))
        either = sides(stage, path, h)
        differences: list[Picture] = []
        for run in runs:
            steps_of = drawn(context, run, either, window, *([stage] if base is None else []))
            found = yield from part_of(steps_of, (number * len(runs) + len(differences)) * share, share)
            (low, high), base = found.pictures[:2], base or found.pictures[2]
            where, window = where or found.placement, found.window
            differences.append(_difference(low, high, h))
        its, norm = differences[0], float(np.linalg.norm(differences[0].rgb))
        if noise and not norm > 0.0:
            raise UserError(f"'{path}' changes nothing there: its derivative is 0 everywhere")
        apart = float(np.linalg.norm(its.rgb - differences[1].rgb)) if noise else np.nan
        derivatives.append(Derivative(path, its, h, apart / worse / max(norm, 1e-300)))
    assert base is not None, "there are paths"
    return Gradient(base, tuple(derivatives), where or None)


def with_bands(settings: RenderSettings) -> RenderSettings:
    """`settings` of what is differentiated, or compared with that."""
    assert settings.photons is not None
    return replace(settings, least_bands=int(np.clip(settings.photons * _BANDS // ENOUGH, 1, _BANDS)))


def _difference(low: Picture, high: Picture, h: float) -> Picture:
    """Over twice `h`."""
    spectral = None
    if low.spectral is not None and high.spectral is not None:
        spectral = (high.spectral - low.spectral) / np.float32(2.0 * h)
    return Picture((high.rgb - low.rgb) / np.float32(2.0 * h), spectral, low.bin_edges_nm)


def _step(
    context: Context, stage: Stage, settings: RenderSettings, path: str, window: np.ndarray | None
) -> Generator[float, None, float]:
    """A change of a parameter that changes the picture as much as it should."""
    first = h = first_step(stage, path)
    for _ in range(_TRIES):
        found = yield from drawn(context, settings, sides(stage, path, h), window)
        low, high = (picture.rgb for picture in found.pictures)
        norm, moved = float(np.linalg.norm(low + high)), float(np.linalg.norm(high - low))
        if not moved > 0.0 or _LEAST_CHANGE <= moved / norm <= _MOST_CHANGE:
            break
        h = float(np.clip(h * _CHANGE * norm / moved, first / 64.0, _LARGEST * first))
        if h == _LARGEST * first:
            break
    return h


def check_path(stage: Stage, path: str) -> None:
    """Raise `UserError` where the scene has no such parameter."""
    parameter(stage, _known(path))
    if path.startswith("camera.") or path in ("exposure_ev", "solo_nm"):
        raise UserError(f"'{path}' changes no light: give a parameter of an object or of a light")


def _known(path: str) -> str:
    return path.removesuffix(f".{INDEX}") + ".n_d" if path.endswith(f".{INDEX}") else path


def first_step(stage: Stage, path: str) -> float:
    """A small change of a parameter: of an index, of turns in degrees, of anything else as a share of it."""
    field = path.rpartition(".")[0].rpartition(".")[2], path.rpartition(".")[2]
    if field[1] in ("n_d", INDEX):
        return 2e-3
    if field[0] == "rotation":
        return 0.1
    if field[0] == "position":
        points = np.concatenate([item.world_vertices for item in stage.scene.objects if item.material.is_specular])
        return 2e-3 * float(np.ptp(points, axis=0).max())
    share = 0.02 if field[1] in ("V_d", "dispersion_gain") else 0.01
    return share * (abs(value_of(stage, path)) or 1.0)


def sides(stage: Stage, path: str, h: float) -> list[Stage]:
    """`stage` at either side, about twice `h` apart: of V_d so that its reciprocal, dispersion, changes alike. Raises
    `UserError` for what cannot change so much."""
    low, high = -h, h
    if path.endswith(".V_d"):
        v_d = value_of(stage, path)
        if not h < abs(v_d) < np.inf:
            raise UserError(f"'{path}' is {v_d:g} and cannot change by {h:g} to either side")
        low, high = (v_d / (1.0 - change / v_d) - v_d for change in (low, high))
    return [nudged(stage, path, low), nudged(stage, path, high)]


def nudged(stage: Stage, path: str, change: float) -> Stage:
    """`stage` with one parameter changed; a glass keeps the rest of its curve."""
    head, name, field = parts(stage.scene, _known(path))
    if head != "objects" or field not in ("n_d", "V_d"):
        return apply(stage, path, value_of(stage, path) + change)

    def changed(item: SceneObject) -> SceneObject:
        dispersion = bent(item.material.dispersion, path.rpartition(".")[2], change)
        return replace(item, material=item.material.changed(dispersion=dispersion))

    items = tuple(changed(item) if item.name == name else item for item in stage.scene.objects)
    return replace(stage, scene=replace(stage.scene, objects=items))
