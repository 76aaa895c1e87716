"""A refractive index in the words of a scene file, read and written."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...base.errors import UserError
from ..fields import Part
from ..io.scene_table import SceneTable
from ..optics import catalogue, crystals, glass, index_file
from ..optics.glass import Dispersion

GAIN = "dispersion_gain"
_INDEX_KEYS = ("glass", "n_d", "sellmeier", "cauchy", "formula", "table", "csv")
_CRYSTAL_KEYS = ("crystal", "ordinary")
_FITS_WITH_RANGE = ("sellmeier", "cauchy", "formula")
_LEAST_NM2, _MOST_NM2 = 50.0, 2e5
"""First coefficients in this range are in nm²: in µm² they are below 1, and in Å² larger."""


class DispersionPart(Part):
    """The keys of a refractive index, or of the two of a crystal, and `dispersion_gain`, as `dispersion` and
    `extraordinary`."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """The dispersion, of a crystal the ordinary one; and the extraordinary one or None."""
        key = table.one_of((*_INDEX_KEYS, *_CRYSTAL_KEYS), "the refractive index")
        found: dict[str, Dispersion | None] = {"dispersion": None, "extraordinary": None}
        if key == "crystal":
            crystal = crystals.find_crystal(table.string(key), table.where(key))
            found = {"dispersion": crystal.ordinary, "extraordinary": crystal.extraordinary}
        elif key == "ordinary":
            found = {"dispersion": _read_own(table, key), "extraordinary": _read_own(table, "extraordinary")}
        else:
            found["dispersion"] = _read_index(table)
        if table.has(GAIN):
            found = {name: None if each is None else with_gain(table, each) for name, each in found.items()}
        return found

    def write(self, value: Any, path: Path | None) -> dict[str, Any]:
        """Its glass or crystal by name where it has one, else its data."""
        if value.extraordinary is None:
            return describe_dispersion(value.dispersion)
        gain = {} if value.dispersion.gain == 1.0 else {GAIN: value.dispersion.gain}
        if name := crystals.named(value.dispersion, value.extraordinary):
            return {"crystal": name} | gain
        own = {"ordinary": value.dispersion, "extraordinary": value.extraordinary}
        return {key: describe_dispersion(each.natural) for key, each in own.items()} | gain


def _read_own(table: SceneTable, key: str) -> Dispersion:
    """One of the two indices of a crystal: the name of a glass, or a table with the keys of one."""
    if isinstance(table.raw(key), str):
        return named_glass(table, key, table.string(key))
    inner = table.given_table(key, "{ n_d = 1.66, V_d = 49 }")
    found = _read_index(inner)
    inner.finish("an index of a crystal")
    return found


def with_gain(table: SceneTable, dispersion: Dispersion) -> Dispersion:
    """`dispersion` with the gain that `table` gives."""
    return glass.with_gain(dispersion, table.number(GAIN, at_least=0.0), table.where(GAIN))


def named_glass(table: SceneTable, key: str, name: str) -> Dispersion:
    """The glass of this name, or in the file of this name, given under `key`."""
    if index_file.names_file(name):
        return _from_file(table, key)
    return index_file.find_glass(name, table.file.parent, table.where(key), table.notes)


def _from_file(table: SceneTable, key: str) -> Dispersion:
    path = table.existing_file(key, or_part=True)
    try:
        return index_file.read_index(path, table.notes)
    except UserError as error:
        table.fail(key, f"cannot be used: {error}")


def _read_index(table: SceneTable) -> Dispersion:
    key = table.one_of(_INDEX_KEYS, "the refractive index")
    if key is None:
        for lone, partner in (("V_d", "n_d"), ("extraordinary", "ordinary")):
            if table.has(lone):
                table.fail(lone, f"needs '{partner}' beside it")
        table.fail(
            "", f"has no refractive index: give one of {', '.join((*_INDEX_KEYS, *_CRYSTAL_KEYS))}, or another kind"
        )
    if key == "glass":
        return named_glass(table, key, table.string(key))
    name = table.string("name", "")
    where = table.where(key)
    limits = _read_range(table) if key in _FITS_WITH_RANGE else None
    if key == "n_d":
        v_d = table.number("V_d", math.inf, infinite=True)
        return glass.from_abbe(table.number(key), v_d, name, where)
    if key == "sellmeier":
        inner = table.given_table(key, "{ B = […], C = […] } with C in µm²")
        b, c = inner.numbers("B"), inner.numbers("C")
        inner.finish("sellmeier")
        if c and min(map(abs, c)) > _LEAST_NM2:  # the first pole of all glass is in the ultraviolet, C = 0.02 µm²
            c = tuple(_from_nm(table, key, value, 2) for value in c)
        return glass.sellmeier(b, c, name, limits, where)
    if key == "cauchy":
        terms = table.numbers(key)
        if len(terms) > 1 and _LEAST_NM2 < abs(terms[1]) < _MOST_NM2:
            terms = terms[:1] + tuple(_from_nm(table, key, v, 2 * i) for i, v in enumerate(terms[1:], start=1))
        return glass.cauchy(terms, name, limits, where)
    if key == "formula":
        inner = table.given_table(key, "{ number = 1, coefficients = […] } as refractiveindex.info numbers them")
        number = inner.integer("number", at_least=1, at_most=9)
        coefficients = inner.numbers("coefficients")
        inner.finish("formula")
        return glass.from_formula(f"formula {number}", coefficients, name, limits, where)  # type: ignore[arg-type]
    if key == "table":
        wavelengths, n = zip(*table.rows(key, 2), strict=True)
        return glass.table(wavelengths, n, name, where)
    found = _from_file(table, key)
    return replace(found, name=name) if name else found


def _from_nm(table: SceneTable, key: str, value: float, power: int) -> float:
    """A coefficient in nm to `power` in µm, with a note."""
    note = f"{table.where(key)}: its coefficients look like nm², and were taken as such; they are meant in µm²."
    if note not in table.notes:
        table.notes.append(note)
    return value * 1e-3**power


def _read_range(table: SceneTable) -> tuple[float, float] | None:
    if not table.has("range_nm"):
        return None
    low, high = table.numbers("range_nm", count=2)
    return low, high


def describe_dispersion(dispersion: Dispersion) -> dict[str, Any]:
    """The keys that give this dispersion."""
    if dispersion.gain != 1.0:
        return describe_dispersion(dispersion.natural) | {"dispersion_gain": dispersion.gain}
    try:
        if catalogue.find(dispersion.name) == dispersion:
            return {"glass": dispersion.name}
    except UserError:
        pass  # not of the catalogue: its data are written out
    values: dict[str, Any] = {"name": dispersion.name} if dispersion.name else {}
    kind, data = dispersion.kind, dispersion.coefficients
    if kind == "constant":
        return values | {"n_d": data[0]}
    if kind == "abbe":
        return values | {"n_d": data[0], "V_d": data[1]}
    if kind == "table":
        # Micrometres came from nanometres: rounding brings those back exactly.
        pairs = zip(data[0::2], data[1::2], strict=True)
        return values | {"table": [[round(um * 1e3, 9), n] for um, n in pairs]}
    values["formula"] = {"number": int(kind.removeprefix("formula ")), "coefficients": list(data)}
    if dispersion.range_nm != (0.0, math.inf):
        values["range_nm"] = list(dispersion.range_nm)
    return values
