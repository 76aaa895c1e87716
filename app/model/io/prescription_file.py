"""Lens prescriptions: a list of surfaces as a table (.csv), and Zemax files (.zmx) of spheres and conics.

What such a file may hold and this program cannot draw is refused with its line, never left out.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from ...base import files
from ...base.errors import UserError, suggestion
from ..optics.glass import Dispersion
from ..optics.index_file import find_glass
from ..optics.lens_design import Lens, Surface, paraxial, widest_beam
from .curve_file import Row, rows_of

SUFFIXES = (".zmx", ".csv")
_MAX_BYTES = 4 << 20
_MOST_SURFACES = 200
_LONGEST, _MOST_CONIC = 1e9, 1e6
_COLUMNS = {
    "radius": ("radius", "r", "radiusofcurvature"),
    "curvature": ("curvature", "c"),
    "thickness": ("thickness", "t", "d", "distance", "separation"),
    "glass": ("glass", "material", "medium"),
    "semi_diameter": ("semidiameter", "clearsemidiameter", "semiaperture"),
    "diameter": ("diameter", "clearaperture", "cleardiameter"),
    "conic": ("conic", "conicconstant", "k"),
    "": ("", "surface", "surf", "no", "number", "comment", "name", "note", "type"),
}
"""Headings of a table, without case, blanks, punctuation and unit; of the last, what is passed over."""
_HEADINGS = {word: column for column, words in _COLUMNS.items() for word in words}
_UNIT = re.compile(r"[\s_]*[(\[]?\b(mm|cm|in)\b[)\]]?$", re.IGNORECASE)
_PLANE = ("inf", "infinity", "∞", "plano", "plane", "flat")
_AIR = ("", "air", "vacuum", "-")
_ZEMAX_UNITS = {"MM": "mm", "CM": "cm", "IN": "in", "METER": "m"}

_OTHER_NAMES = {"fsilica": "fused silica", "polycarb": "polycarbonate", "polystyr": "polystyrene"}
"""What lens programs call materials of the catalogue."""


class _Listed(NamedTuple):
    line: int
    radius: float
    thickness: float
    glass: str
    semi_diameter: float
    conic: float
    is_stop: bool = False


def read_prescription(path: str | os.PathLike[str]) -> Lens:
    """The lens in a .csv or .zmx file. Raises `UserError` with line, key and remedy for what is not understood."""
    path = Path(path)
    with files.reading(path, "give a .csv or .zmx file"):
        text = files.read_any_text(path, _MAX_BYTES).replace("\0", "")
        rows = rows_of(text.splitlines()) if path.suffix.lower() == ".csv" else []
    return _from_table(path, rows) if path.suffix.lower() == ".csv" else _from_zemax(path, text)


def _fail(path: Path, line: int, words: str) -> NoReturn:
    raise UserError(f"{path.name}, line {line}: {words}")


# ---- tables -----------------------------------------------------------------------------------


def _from_table(path: Path, rows: Sequence[Row]) -> Lens:
    rows = [row for row in rows if not row.cells[0].startswith("#")]
    if not rows or not any(heading in ("radius", "curvature") for heading in map(_column, rows[0].cells)):
        raise UserError(
            f"{path}: it is no lens: no surfaces follow a first row of column names; give radius, thickness, glass, "
            "semi_diameter"
        )
    head, *body = rows
    columns = [_column(cell) for cell in head.cells]
    for cell, column in zip(head.cells, columns, strict=True):
        if column is None:
            known = [name for name in _COLUMNS if name]
            _fail(
                path, head.line, f"unknown column '{cell}'{suggestion(cell, known) or ';'} known are {', '.join(known)}"
            )
    for one, other in (("radius", "curvature"), ("semi_diameter", "diameter")):
        if (one in columns) == (other in columns):
            _fail(path, head.line, f"give a column '{one}' or '{other}', one of the two")
    if "thickness" not in columns or "glass" not in columns:
        _fail(path, head.line, "there must be columns 'thickness' and 'glass'")
    units = {found[1].lower() for cell in head.cells if (found := _UNIT.search(cell))}
    listed = [_listed(path, row, columns) for row in body]
    return _lens(path, listed, (), [], units.pop() if len(units) == 1 else "")


def _column(cell: str) -> str | None:
    return _HEADINGS.get("".join(filter(str.isalnum, _UNIT.sub("", cell).casefold())))


def _listed(path: Path, row: Row, columns: Sequence[str | None]) -> _Listed:
    values: dict[str, float] = {}
    glass = ""
    for column, cell, number in zip(columns, row.cells, row.numbers, strict=False):
        if column == "glass":
            glass = cell
        elif column:
            values[column] = _number(path, row.line, column, cell, number)
    radius = values.get("radius", math.inf)
    if "curvature" in values:
        radius = 1.0 / values["curvature"] if values["curvature"] else math.inf
    semi = values.get("semi_diameter", 0.5 * values.get("diameter", math.nan))
    return _Listed(row.line, radius, values.get("thickness", math.nan), glass, semi, values.get("conic", 0.0))


def _number(path: Path, line: int, column: str, cell: str, number: float | None) -> float:
    if column in ("radius", "thickness") and cell.casefold().lstrip("+-") in _PLANE:
        return math.inf
    if number is None:
        _fail(path, line, f"{column} '{cell}' is no number{'; a plane has radius inf' if column == 'radius' else ''}")
    if math.isnan(number):  # an empty cell
        return {"radius": math.inf, "conic": 0.0}.get(column, math.nan)
    return number


# ---- Zemax ------------------------------------------------------------------------------------


class _Line(NamedTuple):
    path: Path
    line: int
    key: str
    values: list[str]

    def number(self, place: int = 0) -> float:
        """One of its values. Raises `UserError`."""
        try:
            return float(self.values[place])
        except (IndexError, ValueError):
            self.fail(f"{self.key} gives no number; export the file again")

    def fail(self, words: str) -> NoReturn:
        _fail(self.path, self.line, words)


def _from_zemax(path: Path, text: str) -> Lens:
    split = ((i, line.split()) for i, line in enumerate(text.splitlines(), start=1))
    lines = [_Line(path, i, words[0].upper(), words[1:]) for i, words in split if words]
    known = {line.key: line for line in lines}
    listed: list[_Listed] = []
    for line in lines:
        if line.key == "SURF":
            listed.append(_Listed(line.line, math.inf, math.nan, "", math.nan, 0.0))
        elif listed:
            listed[-1] = _zemax_surface(line, listed[-1])
    if len(listed) < 3:
        raise UserError(f"{path}: it holds no lens (SURF); export a sequential one from Zemax as .zmx")
    notes: list[str] = []
    if not math.isinf(listed[0].thickness):
        notes.append(f"{path.name}: its object is {listed[0].thickness:g} off; light from infinitely far was taken.")
    unit = known["UNIT"].values[:1] if "UNIT" in known else ["MM"]
    makers = known["GCAT"].values if "GCAT" in known else []
    lens = _lens(path, listed[1:-1], makers, notes, _ZEMAX_UNITS.get("".join(unit).upper(), ""))
    # There are always 24 wavelengths; FTYP says how many of them count.
    count = int(known["FTYP"].number(3)) if "FTYP" in known and len(known["FTYP"].values) > 3 else 0
    nm = tuple(1e3 * line.number(1) for line in lines if line.key == "WAVM")[:count]
    if nm and all(100.0 < each < 1e5 for each in nm):
        primary = int(known["PWAV"].number()) if "PWAV" in known else 1
        lens = replace(lens, wavelengths_nm=nm, reference_nm=nm[min(max(primary, 1), len(nm)) - 1])
    beams = [lens.beam_radius, 0.5 * known["ENPD"].number() if "ENPD" in known else None]
    if "FNUM" in known and known["FNUM"].number() > 0.0:
        (focal_length,), _ = paraxial(lens, (lens.reference_nm,))
        beams.append(abs(float(focal_length)) / (2.0 * known["FNUM"].number()))
    beam = min((each for each in beams if each is not None and each > 0.0), default=None)
    return replace(lens, beam_radius=beam)


def _zemax_surface(line: _Line, so_far: _Listed) -> _Listed:
    """`so_far` with what `line` says of it."""
    values = line.values
    match line.key:
        case "TYPE" if values[:1] not in (["STANDARD"], ["EVENASPH"]):
            line.fail(f"a surface of TYPE {' '.join(values)} cannot be drawn; make it STANDARD or EVENASPH")
        case "PARM" if line.number(1) != 0.0:
            line.fail("aspheric terms (PARM) cannot be drawn; a sphere or a conic can")
        case "CURV":
            return so_far._replace(radius=1.0 / line.number() if line.number() else math.inf)
        case "DISZ":
            return so_far._replace(thickness=math.inf if values[:1] == ["INFINITY"] else line.number())
        case "DIAM":
            return so_far._replace(semi_diameter=line.number())
        case "CONI":
            return so_far._replace(conic=line.number())
        case "STOP":
            return so_far._replace(is_stop=True)
        case "GLAS" if values:
            is_model = values[0] == "___BLANK"
            return so_far._replace(glass=f"{line.number(3):.15g}/{line.number(4):.15g}" if is_model else values[0])
    return so_far


# ---- of both ----------------------------------------------------------------------------------


def _lens(path: Path, listed: Sequence[_Listed], makers: Sequence[str], notes: list[str], units: str) -> Lens:
    if len(listed) > _MOST_SURFACES:
        raise UserError(f"{path}: it has {len(listed)} surfaces; give at most {_MOST_SURFACES}")
    behind = [_glass(path, each, makers, notes) for each in listed]
    of_glass = [i for i, each in enumerate(behind) if each is not None]
    if not of_glass:
        raise UserError(f"{path}: no surface has a glass behind it; name one, for example N-BK7")
    first, last = of_glass[0], of_glass[-1] + 1
    if last == len(listed):
        _fail(path, listed[-1].line, f"glass '{listed[-1].glass}' has no surface behind it; add the one that ends it")
    stops = [each.semi_diameter for each in listed[:first] if each.is_stop]
    surfaces = []
    for at, (each, glass) in enumerate(
        zip(listed[first : last + 1], behind[first : last + 1], strict=True), start=first
    ):
        if each.radius == 0.0 or math.isnan(each.radius):
            _fail(path, each.line, f"radius is {each.radius:g}; a plane has radius inf")
        if at < last and not (math.isfinite(each.thickness) and each.thickness >= 0.0):
            _fail(
                path, each.line, f"thickness {_told(each.thickness)}; give the distance to the next surface, 0 or more"
            )
        if glass is not None and each.thickness == 0.0:
            _fail(path, each.line, f"thickness of the {each.glass} is 0; give how thick it is on the axis")
        if not (math.isfinite(each.semi_diameter) and each.semi_diameter > 0.0):
            _fail(
                path, each.line, f"semi_diameter {_told(each.semi_diameter)}; give half the width that light may have"
            )
        if not abs(each.conic) < _MOST_CONIC:
            _fail(path, each.line, f"conic is {each.conic:g}; give a number below {_MOST_CONIC:g}, 0 for a sphere")
        lengths = (each.semi_diameter, each.thickness if at < last else 0.0, 1.0 / abs(each.radius))
        if max(lengths) > _LONGEST or _LONGEST**2 < abs(each.radius) < math.inf:
            _fail(path, each.line, f"a length is beyond {_LONGEST:g} or below its inverse; give it in other units")
        surface = Surface(each.radius, each.thickness if at < last else 0.0, glass, each.semi_diameter, each.conic)
        if np.isnan(surface.sag(np.array([each.semi_diameter]))).any():
            sizes = f"radius {each.radius:g} does not reach a semi_diameter of {each.semi_diameter:g}"
            _fail(path, each.line, f"a surface of {sizes}; give less")
        surfaces.append(surface)
    lens = Lens(path.stem, tuple(surfaces), min(stops, default=None), units=units, notes=tuple(dict.fromkeys(notes)))
    widest_beam(lens)
    return lens


def _told(value: float) -> str:
    return "is missing" if math.isnan(value) else f"is {value:g}"


def _glass(path: Path, listed: _Listed, makers: Sequence[str], notes: list[str]) -> Dispersion | None:
    """A glass of the catalogue, by the makers of the file first; "1.5168/64.17" is n_d and V_d, "1.5" an index."""
    name, where = listed.glass.strip(), f"{path.name}, line {listed.line}: glass"
    if name.casefold() in _AIR:
        return None
    if name.upper() == "MIRROR":
        _fail(path, listed.line, "mirrors cannot be drawn in a row of lenses; place them as objects of a scene")
    plain = "".join(filter(str.isalnum, name.casefold()))
    name = _OTHER_NAMES.get(plain, name)
    rest, _, last = name.rpartition("_")  # as in N-BK7_SCHOTT
    # Makers write N- before the names of glasses that they make without lead today.
    for each in (f"{last} {rest}", name, f"N-{name}"):
        for maker in (*makers, ""):
            try:
                glass = find_glass(f"{maker} {each}", path.parent, where, notes)
            except UserError:
                continue
            if each == f"N-{name}":
                notes.append(f"{path.name}: {name} is not in the catalogue; {glass.name} was taken for it.")
            return glass
    return find_glass(name, path.parent, where, notes)
