"""Derivatives of a caustic map, or of a picture, by the numbers of a scene.

Each is the difference of two pictures over twice a small step. Both have the same random numbers, the same lattices of
light and the same texels: what does not depend on the parameter is the same in both to the bit, and what does changes
smoothly, so that chance, which would be divided by the step, drops out.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import UserError
from ..base.generators import mapped
from ..edit.glass import bent
from ..edit.parameters import Stage, apply, parameter, parts, value_of
from ..gpu.context import Context
from ..model.settings import RenderSettings
from .bake import placement
from .frames import FrameRenderer, Picture

INDEX = "index"
"""Parameter of an object of glass: n(λ), raised alike at all wavelengths."""
_CHANGE, _LEAST_CHANGE, _MOST_CHANGE = 0.03, 0.01, 0.08
"""Change of the picture, as a share of its norm, that a step is to make: much less is lost in rounding, and more is no
derivative."""
_LARGEST, _TRIES, _TRIED = 8.0, 3, 1 << 15
"""A step over the first one at most; pictures by so many photons until it is found."""


@dataclass(frozen=True)
class Derivative:
    """Of every number of a picture by one parameter, per unit of it."""

    path: str
    picture: Picture
    step: float
    """The parameter's change to either side."""


@dataclass(frozen=True)
class Gradient:
    """A picture and its derivatives."""

    base: Picture
    derivatives: tuple[Derivative, ...]
    placement: Mapping[str, object] | None
    """Of a map, as `bake` writes it."""


def gradient(
    context: Context,
    stage: Stage,
    settings: RenderSettings,
    paths: Sequence[str],
    steps: Mapping[str, float] | None = None,
    window: np.ndarray | None = None,
) -> Generator[float, None, Gradient]:
    """Of what `settings.layer` shows, by each of `paths` (`edit.parameters`, and `INDEX`), pausing with the share done.

    `steps`: of parameters; those of others are found by a few photons. `window`: `MapFit.window` of a map. Raises
    `UserError`."""
    for path in paths:
        check_path(stage, path)
    few = replace(settings, photons=min(settings.photons or stage.scene.render.photons, _TRIED), seconds=None, spp=1)
    found: list[Derivative] = []
    base, where = None, None
    for number, path in enumerate(paths):
        h = (steps or {}).get(path) or (yield from mapped(_step(context, stage, few, path, window), lambda share: 0.0))
        either = [nudged(stage, path, -h), nudged(stage, path, h)]
        renderer = FrameRenderer(context, settings, either, window=window)
        try:
            drawn: list[Picture] = []
            for one in (*either, stage)[: 3 if base is None else 2]:
                for share in renderer.steps(one):
                    yield (number + (len(drawn) + share) / 3.0) / len(paths)
                drawn.append(renderer.picture)
            if base is None:
                base = drawn[2]
                where = placement(renderer.light) if settings.layer.startswith("map:") else None
        finally:
            renderer.release()
        low, high, spectral = drawn[0], drawn[1], None
        if high.spectral is not None and low.spectral is not None:
            spectral = (high.spectral - low.spectral) / (2.0 * h)
        found.append(Derivative(path, Picture((high.rgb - low.rgb) / (2.0 * h), spectral, high.bin_edges_nm), h))
    assert base is not None, "there are paths"
    return Gradient(base, tuple(found), where)


def _step(
    context: Context, stage: Stage, settings: RenderSettings, path: str, window: np.ndarray | None
) -> Generator[float, None, float]:
    """A change of a parameter that changes the picture as much as it should."""
    first = h = first_step(stage, path)
    for _ in range(_TRIES):
        either = [nudged(stage, path, -h), nudged(stage, path, h)]
        renderer = FrameRenderer(context, settings, either, window=window)
        try:
            drawn = []
            for one in either:
                yield from renderer.steps(one)
                drawn.append(renderer.picture.rgb)
        finally:
            renderer.release()
        norm, moved = float(np.linalg.norm(drawn[0] + drawn[1])), float(np.linalg.norm(drawn[1] - drawn[0]))
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


def _is_glass(stage: Stage, path: str) -> bool:
    return parts(stage.scene, _known(path))[2] in ("n_d", "V_d", "dispersion_gain")


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
    return 0.01 * (abs(value_of(stage, path)) or 1.0)


def nudged(stage: Stage, path: str, change: float) -> Stage:
    """`stage` with one parameter changed; a glass keeps the rest of its curve."""
    head, name, field = parts(stage.scene, _known(path))
    if head != "objects" or not _is_glass(stage, path) or field == "dispersion_gain":
        return apply(stage, path, value_of(stage, path) + change)
    items = tuple(
        replace(
            item,
            material=item.material.changed(dispersion=bent(item.material.dispersion, path.rpartition(".")[2], change)),
        )
        if item.name == name
        else item
        for item in stage.scene.objects
    )
    return replace(stage, scene=replace(stage.scene, objects=items))
