"""What the dispersion panels compute: edited glasses, their catalogue origin, the numbers that opticians quote.

Pure functions of `Dispersion`; nothing here draws.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np

from ...base.errors import UserError
from ...edit.glass import abbe_numbers, set_dispersion
from ...edit.state import State
from ...model.optics import catalogue, glass
from ...model.optics.glass import LINE_C_NM, LINE_D_NM, LINE_F_NM, Dispersion
from ...model.scene import Dielectric, Scene, SceneObject

LINE_G_NM = 435.8343
"""Mercury's blue line g, nm, for partial dispersion."""

CONTROL_NM = (380.0, 408.0, 440.0, LINE_F_NM, 530.0, LINE_D_NM, LINE_C_NM, 710.0, 780.0)
"""Where n(λ) can be taken hold of: the Fraunhofer lines F, d, C and six between and beyond them."""

_EDITED, _SHAPED = " (edited)", " (shaped)"
_SUFFIXES = (_EDITED, _SHAPED, " (drawn)")


@dataclass(frozen=True)
class Lines:
    """A glass in the numbers of a catalogue."""

    n_f: float
    n_d: float
    n_c: float
    v_d: float
    """Abbe number; inf without dispersion."""
    principal: float
    """n_F − n_C."""
    partial_gf: float | None
    """Relative partial dispersion P_g,F = (n_g − n_F)/(n_F − n_C); None without dispersion."""


@lru_cache(maxsize=64)
def notes_of(dispersion: Dispersion) -> tuple[str, ...]:
    """`Dispersion.notes`, remembered from frame to frame."""
    return tuple(dispersion.notes())


@lru_cache(maxsize=64)
def lines_of(dispersion: Dispersion) -> Lines:
    """The catalogue numbers of what is rendered, dispersion gain included."""
    n_g, n_f, n_c = (float(dispersion.index(nm)) for nm in (LINE_G_NM, LINE_F_NM, LINE_C_NM))
    spread = n_f - n_c
    partial = (n_g - n_f) / spread if abs(spread) > 1e-12 else None
    return Lines(n_f, dispersion.n_d, n_c, dispersion.V_d, spread, partial)


def selected_glass(state: State) -> tuple[int, SceneObject, Dielectric] | None:
    """Index, object and material of the selection when it is of glass."""
    index = state.selection.index
    if state.selection.kind != "object" or not 0 <= index < len(state.scene.objects):
        return None
    item = state.scene.objects[index]
    return (index, item, item.material) if isinstance(item.material, Dielectric) else None


def glasses_of(scene: Scene) -> list[tuple[int, SceneObject, Dielectric]]:
    """Every object of glass with its index and material."""
    return [(i, o, o.material) for i, o in enumerate(scene.objects) if isinstance(o.material, Dielectric)]


def own_numbers(dispersion: Dispersion) -> tuple[float, float]:
    """n_d and V_d of the material before its gain, such that `with_abbe` of them changes nothing."""
    return abbe_numbers(dispersion.natural)


def base_name(dispersion: Dispersion) -> str:
    """The name before it was edited or shaped."""
    name = dispersion.name
    for suffix in _SUFFIXES:
        name = name.removesuffix(suffix)
    return name


def as_sold(dispersion: Dispersion) -> Dispersion | None:
    """The catalogue's glass that this one was made from, with its natural dispersion; None where no name says so."""
    return _in_catalogue(base_name(dispersion))


@lru_cache(maxsize=256)
def _in_catalogue(name: str) -> Dispersion | None:
    """Remembered, because looking for names like an unknown one takes longer than a frame."""
    try:
        return catalogue.find(name) if name else None
    except UserError:
        return None


def is_as_sold(dispersion: Dispersion) -> bool:
    """Whether it is exactly a glass of the catalogue."""
    return as_sold(dispersion) == dispersion


def shown_name(dispersion: Dispersion) -> str:
    """A name for people, where there is none too."""
    return dispersion.name or ("Constant index" if dispersion.kind == "constant" else "Unnamed glass")


def with_abbe(dispersion: Dispersion, n_d: float, v_d: float) -> Dispersion:
    """A model glass of this n_d and Abbe number (of the material, before its gain); the gain stays.

    Raises `UserError` for numbers that no material can have.
    """
    name = base_name(dispersion) + _EDITED if as_sold(dispersion) else dispersion.name or "Model glass"
    return glass.with_gain(glass.from_abbe(n_d, v_d, name), dispersion.gain)


def with_point(dispersion: Dispersion, at: int, n: float, keep_n_d: bool) -> Dispersion:
    """The curve drawn through `CONTROL_NM` with point `at` put to `n`; what is rendered is taken as it is, so the gain
    becomes 1.

    With `keep_n_d` the point of the d line does not move. Raises `UserError` for an impossible index.
    """
    values = np.array(dispersion.index(np.array(CONTROL_NM)))
    if not (keep_n_d and CONTROL_NM[at] == LINE_D_NM):
        values[at] = n
    name = (base_name(dispersion) or "Glass") + _SHAPED
    return glass.table(CONTROL_NM, values.tolist(), name)


class Refusing(Protocol):
    """Memory of a panel that edits a glass."""

    refused: str
    """Why the last edit was refused; empty once one succeeds."""


def attempted(state: State, index: int, label: str, make: Callable[[], Dispersion], memory: Refusing) -> State:
    """`state` with the glass that `make()` gives for object `index`; a refusal is kept in `memory`, to be shown."""
    try:
        scene = set_dispersion(state.scene, index, make())
    except UserError as refusal:
        memory.refused = str(refusal)
        return state
    memory.refused = ""
    return state.edited(scene, label)


def abbe_text(v_d: float) -> str:
    """An Abbe number in a few characters."""
    return "none" if math.isinf(v_d) else f"{v_d:.2f}"
