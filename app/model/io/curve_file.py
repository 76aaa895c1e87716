"""Curves over wavelength as instruments, spreadsheets and databases write them: text tables of any dialect, TM-27 XML.

A table is found by its numbers: what an instrument writes above and below is passed over. Wavelengths come out in nm
and ascending. Refused is what leaves open which values are meant.
"""

from __future__ import annotations

import csv
import itertools
import math
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from ...base import files
from ...base.errors import UserError
from ..optics.colorimetry import VISIBLE_NM
from .scene_table import MAX_MAGNITUDE

NOISE = 0.05
"""Share of a curve's largest value up to which impossible values (power below 0, say) are noise."""
LEAST_TRANSMITTANCE = 1e-6
"""What a measured 0 is taken for: no instrument sees less, and nothing is quite opaque."""

_NUMBER = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[ed][-+]?\d+)?", re.IGNORECASE)
_WITH_UNIT = re.compile(r"(?:.*[^\d.,])?(\d+(?:[.,]\d+)?) ?[\[(]?nm[\])]?", re.IGNORECASE)
"""A wavelength in a cell of text: "380nm" (UPRtek), "Spectral Data 380[nm]" (Sekonic)."""
_HEADED = re.compile(r"\D*(\d{3,4}(?:[.,]\d+)?)\D*")
"""A wavelength as a heading: "SPECTRAL_NM380", "R380"."""
_MISSING = {"", "-", "--", "nan", "n/a", "na", "#n/a", "null", "none"}
_WAVELENGTH = re.compile(
    r"wave|^wl\b|lambda|λ|^nm\b|[\[(]nm[\])]|wellenl|longueur|longitud|lunghezza|波长|波長", re.IGNORECASE
)
_UNITS_NM = {r"µm|μm|\bum\b|micro[nm]|mikrom": 1e3, r"\bnm\b|nanom": 1.0, r"å|angstr": 0.1}
_OTHER_UNITS = re.compile(r"cm ?\^?[-⁻−] ?[1¹]|1/cm|wavenumber|\b[tgmk]?hz\b|\bev\b", re.IGNORECASE)
_NO_SHARE = re.compile(r"abs\w* coeff|absorptionsk|\balpha\b|α|1/[cmµ]?m\b|[cm]m ?\^?[-−⁻][1¹]|\bdb\b", re.IGNORECASE)
"""What absorbs per length, and decibels."""
_SEEN_NM = 400.0, 700.0
"""Less than a thousandth of white light's luminance lies beyond."""
_MAX_BYTES = 4 << 20
_LEAST_ACROSS = 8
"""Wavelengths in one row that make it the heading of a table with a curve in each row below."""
_NEAR = 8
"""Lines above a table in which its heading may stand."""
PathLike = str | os.PathLike[str]


class Curve(NamedTuple):
    """One column, or row, of a file."""

    name: str
    nm: np.ndarray
    """float64 (n,), ascending."""
    values: np.ndarray
    """float64 (n,), finite."""


class Row(NamedTuple):
    """A line of a text table."""

    line: int
    cells: list[str]
    numbers: list[float | None]
    """NaN where a value is missing, None for text."""

    @property
    def is_data(self) -> bool:
        """Whether it begins with a number and has more."""
        first, *others = self.numbers or [None]
        return first is not None and not math.isnan(first) and any(number is not None for number in others)


_Table = tuple[str, str, Any, Any]
"""Name, heading of the wavelengths, these and the values."""


def read_curve(name: PathLike, notes: list[str]) -> Curve:
    """The curve called "file:column", or the only one of a file. Raises UserError, with a list, where that is open."""
    path, part = files.with_part(name)
    found = read_curves(path, notes, part)
    found = [curve for curve in found if curve.name.casefold() == part.casefold()] or found
    if len(found) == 1:
        return found[0]
    listed = ", ".join(f"'{curve.name}'" for curve in found[:12])
    name_one = f'name one of them, as in "{path.name}:{found[-1].name}"'
    raise UserError(f"{path} has {len(found)} columns of values: {listed}; {name_one}")


def read_curves(path: Path, notes: list[str], part: str = "") -> list[Curve]:
    """All curves in `path` whose names hold `part`, at least one; what was assumed goes to `notes`.

    Raises UserError with a remedy."""
    with files.reading(path, "give a table of wavelength_nm, value"):
        text = files.read_any_text(path, _MAX_BYTES).replace("\0", "").lstrip("\ufeff \t\r\n")
        is_xml = text.startswith("<")
        rows = [] if is_xml else rows_of(text.splitlines())
    tables = _from_xml(text, path) if is_xml else list(_across(rows)) or _down(path, rows, notes)
    curves: list[Curve] = []
    names: list[str] = []
    for name, unit, nm, values in tables:
        same = sum(each.partition(" (#")[0] == name for each in names)
        names.append(f"{name} (#{same + 1})" if same else name)
        if part.casefold() in names[-1].casefold():
            curves.append(_in_order(path, names[-1], unit, nm, values, notes))
    curves = [curve for curve in curves if len(curve.nm) > 1]
    if not curves and part and names:
        listed = ", ".join(f"'{each}'" for each in names[:12])
        raise UserError(f"{path} has no column '{part}' but {listed}; name one of them")
    if not curves:
        raise UserError(f"{path}: there is no table of two or more rows of wavelength_nm, value; export it as text")
    return curves


def note_ends(path: PathLike, curve: Curve, beyond: str, notes: list[str]) -> None:
    """Say what is taken `beyond` the ends of a curve that leaves out some of what is seen."""
    if curve.nm[0] > _SEEN_NM[0] or curve.nm[-1] < _SEEN_NM[1]:
        notes.append(f"{path}: it reaches from {curve.nm[0]:g} to {curve.nm[-1]:g} nm; beyond, {beyond}.")


def clipped(path: PathLike, curve: Curve, what: str, notes: list[str], most: float = math.inf) -> np.ndarray:
    """Values of `curve` from 0 to `most`; what noise has put beyond them is clipped and goes to `notes`.

    Raises UserError where that is more than noise within the visible range.
    """
    seen = np.interp(VISIBLE_NM, curve.nm, curve.values)
    excess = np.maximum(-seen, seen - most)
    if excess.max() > NOISE * min(max(float(seen.max()), 0.0), most):
        at = int(excess.argmax())
        raise UserError(
            f"{path}: the {what} is {seen[at]:g} at {VISIBLE_NM[at]:g} nm, by more than noise beyond "
            f"{'0' if seen[at] < 0.0 else f'{most:g}'}; correct the file"
        )
    values = np.clip(curve.values, 0.0, most)
    if (values != curve.values).any():
        worst = curve.values[np.abs(values - curve.values).argmax()]
        notes.append(f"{path}: noise in the {what} (such as {worst:g}) was set to the nearest possible value.")
    return values


def share(path: PathLike, curve: Curve, what: str, notes: list[str]) -> np.ndarray:
    """Values of `curve` as shares from 0 to 1, given as such, in per cent or as absorbance; transmittance above 0."""
    note_ends(path, curve, f"the {what} at its ends is used", notes)
    values, highest = curve.values, float(np.interp(VISIBLE_NM, curve.nm, curve.values).max())
    if other := _NO_SHARE.search(curve.name):
        raise UserError(f"{path}: '{curve.name}' is no {what} ('{other[0]}'); give shares, or per cent, of the light")
    if re.search(r"\babs\b|absorbance|extinktion|optical density|\bod\b", curve.name, re.IGNORECASE):
        notes.append(f"{path}: '{curve.name}' was taken as absorbance, minus the decimal logarithm of transmittance.")
        values = 10.0 ** -np.clip(values, -300.0, 300.0)
    elif "%" in curve.name or 2.0 < highest <= 150.0:
        values = values / 100.0
        notes.append(f"{path}: the {what} (up to {highest:g}) looks like per cent and was taken as such.")
    values = clipped(path, Curve(curve.name, curve.nm, values), what, notes, most=1.0)
    return np.maximum(values, LEAST_TRANSMITTANCE) if what == "transmittance" else values


def rows_of(lines: list[str]) -> list[Row]:
    """Lines that are not blank, in the dialect in which most of them are numbers."""

    def parsed(some: list[tuple[int, str]], delimiter: str, comma: bool | None = None) -> list[Row]:
        split = [(i, _cells(line, delimiter)) for i, line in some]
        comma = _has_decimal_comma([cell for _, cells in split for cell in cells]) if comma is None else comma
        return [Row(i, cells, _numbers(cells, comma)) for i, cells in split]

    numbered = [(i, line) for i, line in enumerate(lines, start=1) if line.strip(" \t;,")]
    sample = [each for each in numbered if re.search(r"\d", each[1])]
    best = max("\t;, ", key=lambda d: sum((1 + (None not in r.numbers)) for r in parsed(sample[:2000], d) if r.is_data))
    comma = _has_decimal_comma([cell for _, line in sample for cell in _cells(line, best)])
    return parsed(numbered, best, comma)


def _cells(line: str, delimiter: str) -> list[str]:
    line = line[:1] + line[1:].partition("#")[0]  # comments
    if delimiter == " ":
        return line.split()
    split = next(csv.reader([line], delimiter=delimiter), []) if '"' in line else line.split(delimiter)
    return [cell.strip() for cell in split]


def _has_decimal_comma(cells: list[str]) -> bool:
    numbers = [cell for cell in cells if re.fullmatch(r"[-+]?[\d.,]+(?:[eE][-+]?\d+)?%?", cell)]
    both = next((cell for cell in numbers if "," in cell and "." in cell), None)
    if both:
        return both.rfind(",") > both.rfind(".")
    return any("," in cell for cell in numbers) and not any("." in cell for cell in numbers)


def _numbers(cells: list[str], comma: bool) -> list[float | None]:
    numbers = [_number(cell, comma) for cell in cells]
    if numbers and numbers[0] is None and (found := _WITH_UNIT.fullmatch(cells[0])):
        numbers[0] = _number(found[1], True)
    return numbers


def _number(cell: str, comma: bool) -> float | None:
    text = cell.strip(" \u00a0'\"%").replace("−", "-")
    if text.casefold() in _MISSING:
        return math.nan
    if comma and "," in text:
        text = text.replace(".", "").replace(",", ".")
    else:  # thousands, or a decimal comma in quotes between commas
        text = text.replace(",", "" if re.fullmatch(r"[-+]?\d{1,3}(?:,\d{3})+(?:\.\d*)?", text) else ".")
    return float(text.lower().replace("d", "e")) if _NUMBER.fullmatch(text) else None


def _across(rows: list[Row]) -> Iterator[_Table]:
    """Curves in rows below a row of wavelengths, as CGATS files and spreadsheets of samples have them."""
    for i, row in enumerate(rows):
        headed = [(column, found[1]) for column, cell in enumerate(row.cells) if (found := _HEADED.fullmatch(cell))]
        together = itertools.groupby(enumerate(headed), key=lambda each: each[1][0] - each[0])
        runs = [[mark for _, mark in run] for _, run in together]
        longest = max(runs, key=len, default=[])
        marks = dict(longest)
        nm = np.array([float(text.replace(",", ".")) for text in marks.values()])
        steps = np.abs(np.diff(nm))
        if len(nm) < _LEAST_ACROSS or nm.min() < 200.0 or nm.max() > 2600.0 or not 0.0 < steps.max() <= 2 * steps.min():
            continue
        first, last = min(marks), max(marks)
        for number, below in enumerate((r for r in rows[i + 1 :] if len(r.cells) > last), start=1):
            values = [below.numbers[column] for column in marks]
            if None not in values:
                named = [below.cells[column] for column in range(first) if below.numbers[column] is None]
                yield " ".join(named) or f"row {number}", "nm", nm, values
        return


def _down(path: PathLike, rows: list[Row], notes: list[str]) -> Iterator[_Table]:
    """Curves in columns, of all stretches of rows that begin with a number."""
    above: list[Row] = []
    width = 0
    for is_data, group in itertools.groupby(rows, key=lambda row: row.is_data):
        stretch = list(group)
        if not is_data:
            cells = stretch[0].cells
            if width and cells[0][:1].isdigit() and (len(cells) == width or not re.search(r"[^\W\d_]", "".join(cells))):
                _fail_line(path, stretch[0])
            above = stretch
            continue
        width = max(len(row.cells) for row in stretch)
        # A list that begins again at its first wavelength is another one: Sekonic's steps of 5 nm, then of 1 nm.
        starts = [i for i, row in enumerate(stretch) if row.numbers[0] == stretch[0].numbers[0]]
        blocks = [stretch[a:b] for a, b in itertools.pairwise([*starts, len(stretch)])]
        longest = max(blocks, key=len)
        if len(blocks) > 1 and [len(block) for block in blocks].count(len(longest)) == 1:
            notes.append(f"{path} lists its wavelengths {len(blocks)} times; the longest list was taken.")
            blocks = [longest]
        for block in blocks:
            yield from _columns(path, block, above, width)
        above = []


def _columns(path: PathLike, block: list[Row], above: list[Row], width: int) -> Iterator[_Table]:
    titles = [
        [cell.strip("#!/* ") for cell in row.cells] + [""] * width
        for row in above[-_NEAR:]
        if abs(len(row.cells) - width) <= 1
        and (all(n is None or math.isnan(n) for n in row.numbers) or _WAVELENGTH.search(row.cells[0]))
    ]
    upper, lower = ([[""] * width] * 2 + titles)[-2:]
    if len(set(lower[:width])) < width:  # pairs of columns, with what they are of above the first of each
        upper = [next(filter(None, upper[column::-1]), "") for column in range(width)]
    elif not re.fullmatch(r"[\[(]?(?:nm|[µμu]m|å)[\])]?", lower[0], re.IGNORECASE):
        upper = [""] * width  # else the lower row has the units
    names = [f"{a} {b}".strip() for a, b in zip(upper, lower, strict=False)]
    waves = [column for column in range(width) if _WAVELENGTH.search(lower[column] or upper[column])]
    at = waves[0] if waves else 0
    for column in range(at + 1, width):
        pairs = [(row, row.numbers[at], row.numbers[column]) for row in block if len(row.cells) > column]
        text = [row for row, nm, value in pairs if nm is None or value is None]
        if column in waves:
            at = column
        elif 2 * len(text) <= len(pairs) and not all(math.isnan(value or 0.0) for _, _, value in pairs):
            if text:
                _fail_line(path, text[0])
            yield names[column] or f"column {column + 1}", names[at], [p[1] for p in pairs], [p[2] for p in pairs]


def _fail_line(path: PathLike, row: Row) -> NoReturn:
    raise UserError(f"{path}, line {row.line}: expected numbers, wavelength_nm and a value, as in the rows above it")


def _from_xml(text: str, path: PathLike) -> Iterator[_Table]:
    """Curves of an IES TM-27 file (.spdx); document types, and with them entities, are refused."""
    from xml.etree import ElementTree  # most curves are tables

    try:
        root = ElementTree.fromstring("" if "<!DOCTYPE" in text else text)
    except (ElementTree.ParseError, ValueError) as error:
        raise UserError(f"{path} is not whole XML without a document type; export it again") from error
    for number, held in enumerate((e for e in root.iter() if e.tag.endswith("SpectralDistribution")), start=1):
        data = [e for e in held.iter() if e.tag.endswith("SpectralData")]
        nm = [_number(e.get("wavelength", ""), False) for e in data]
        values = [_number((e.text or "").strip(), False) for e in data]
        if None in nm or None in values:
            raise UserError(f"{path} has something among its SpectralData that is no number; export it again")
        yield f"spectrum {number}", "nm", nm, values


def _in_order(path: PathLike, name: str, unit: str, nm: Any, values: Any, notes: list[str]) -> Curve:
    """The curve with wavelengths in nm and ascending, one value for each."""
    x, y = np.array(nm, float), np.array(values, float)
    x, y = x[keep := ~(np.isnan(x) | np.isnan(y))], y[keep]
    if len(x) < 2:
        return Curve(name, x, y)
    if max(np.abs(x).max(), np.abs(y).max()) > MAX_MAGNITUDE:
        raise UserError(f"{path} holds a number beyond {MAX_MAGNITUDE:g}; remove the row")
    x, places, counts = np.unique(x * _factor_nm(path, unit, x, notes), return_inverse=True, return_counts=True)
    means = np.bincount(places, y) / counts
    apart = np.abs(y - means[places])
    if apart.max() > NOISE * np.abs(y).max():
        at = x[places[apart.argmax()]]
        raise UserError(f"{path}: there are different values of '{name}' at {at:g} nm; remove all but one")
    if x[-1] < VISIBLE_NM[0] or x[0] > VISIBLE_NM[-1]:
        hint = "; if they are Å, write 'wavelength (Å)' above them" if 3800.0 <= x[-1] <= 12000.0 else ""
        raise UserError(
            f"{path}: its wavelengths, {x[0]:g} to {x[-1]:g} nm, are outside the visible 380 to 780 nm{hint}"
        )
    return Curve(name, x, means)


def _factor_nm(path: PathLike, unit: str, x: np.ndarray, notes: list[str]) -> float:
    """Nanometres in the unit of the wavelengths `x`: that of their heading, or what their size leaves possible."""
    if (other := _OTHER_UNITS.search(unit)) and "nm" not in unit:
        raise UserError(f"{path}: its curve is given over {other[0]}, not over wavelengths; convert it to nm")
    said = next((factor for words, factor in _UNITS_NM.items() if re.search(words, unit, re.IGNORECASE)), None)
    low, high = float(np.abs(x).min()), float(np.abs(x).max())
    looks = "m" if high < 1e-3 else "µm" if high < 100.0 else "nm"
    if (looks == "nm" and (said != 1e3 or low < 100.0)) or (looks == "µm" and said == 1e3):
        return said or 1.0
    note = f"{path}: its wavelengths ({x.min():g} to {x.max():g}) look like {looks} and were taken as such."
    notes.extend([] if note in notes else [note])
    return {"m": 1e9, "µm": 1e3, "nm": 1.0}[looks]
