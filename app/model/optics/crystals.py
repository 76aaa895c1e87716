"""Uniaxial crystals of the catalogue: pairs of entries, one for the ordinary and one for the extraordinary index."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np

from ...base.errors import UserError, suggestion
from . import catalogue
from .catalogue import search_key
from .colorimetry import VISIBLE_NM
from .glass import Dispersion

_ORDINARY, _EXTRAORDINARY = " (ordinary)", " (extraordinary)"
_FLAT = 1e-7


@dataclass(frozen=True)
class Crystal:
    """Both indices, and the names it was asked by and is listed under."""

    name: str
    substance: str
    ordinary: Dispersion
    extraordinary: Dispersion


@cache
def crystals() -> dict[str, Crystal]:
    """All by name, those that are called otherwise too ("ruby") under each of their names."""
    found: dict[str, Crystal] = {}
    plain = {(entry.maker, entry.name): entry for entry in catalogue.entries()}
    for entry in catalogue.entries():
        if entry.name.endswith(_EXTRAORDINARY):
            name = entry.name.removesuffix(_EXTRAORDINARY)
            ordinary = plain.get((entry.maker, name + _ORDINARY)) or plain[entry.maker, name]
            for called in dict.fromkeys((name, *ordinary.aliases)):
                found[called] = Crystal(called, name, ordinary.dispersion, entry.dispersion)
    return found


def find_crystal(name: str, where: str = "") -> Crystal:
    """The crystal of this name, without regard to case and blanks. Raises `UserError` that begins with `where`."""
    known = crystals()
    found = next((crystal for called, crystal in known.items() if search_key(called) == search_key(name)), None)
    if found is None:
        hint = suggestion(name, known) or "; 'spectrasplat glass extraordinary' lists all"
        raise UserError(f"{where + ': ' if where else ''}'{name}' is no uniaxial crystal that is known{hint}")
    return found


def named(ordinary: Dispersion, extraordinary: Dispersion) -> str:
    """The first name under which the catalogue has both, or ""."""
    pair = (ordinary.natural, extraordinary.natural)
    return next((name for name, c in crystals().items() if (c.ordinary, c.extraordinary) == pair), "")


@lru_cache(256)
def is_birefringent(ordinary: Dispersion, extraordinary: Dispersion) -> bool:
    """Whether both differ by more than 1e-7 anywhere in the visible range."""
    return bool(np.abs(ordinary.index(VISIBLE_NM) - extraordinary.index(VISIBLE_NM)).max() > _FLAT)
