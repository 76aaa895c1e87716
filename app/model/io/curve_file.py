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
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn
from xml.etree import ElementTree

import numpy as np

from ...base import files
from ...base.errors import UserError
from ..optics.colorimetry import VISIBLE_NM
from .scene_table import MAX_MAGNITUDE

NOISE = 0.05
"""Share of a curve's largest value up to which impossible values (power below 0, say) are noise."""

LEAST_TRANSMITTANCE = 1e-6
"""What a measurement of 0 is taken for: no instrument sees less, and nothing is quite opaque."""

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[ed][-+]?\d+)?", re.IGNORECASE)
_WITH_UNIT = re.compile(r"(?:.*[^\d.,])?(\d+(?:[.,]\d+)?) ?[\[(]?nm[\])]?", re.IGNORECASE)
"""A wavelength in a cell of text: "380nm" (UPRtek), "Spectral Data 380[nm]" (Sekonic)."""
_HEADED = re.compile(r"\D*(\d{3,4}(?:[.,]\d+)?)\D*")
"""A wavelength as a heading: "SPECTRAL_NM380", "R380"."""
_MISSING = {"", "-", "--", "nan", "n/a", "na", "#n/a", "null", "none"}
_WAVELENGTH = re.compile(r"wave|^wl\b|lambda|λ|\bnm\b|wellenl|longueur|longitud|lunghezza|波长|波長", re.IGNORECASE)
_UNITS_NM = {r"µm|μm|\bum\b|micro[nm]|mikrom": 1e3, r"\bnm\b|nanom": 1.0, r"å|angstr": 0.1}
_OTHER_UNITS = re.compile(r"cm ?\^?[-⁻−] ?[1¹]|1/cm|wavenumber|\bthz\b|\bev\b", re.IGNORECASE)
_SAMPLED_LINES = 2000
_LEAST_ACROSS = 8
"""Wavelengths in one row that make it the heading of a table with a curve in each row below."""
_NEAR = 8
"""Lines above a table in which its heading may stand."""


@dataclass(frozen=True)
class Curve:
    """One column, or row, of a file."""

    name: str
    nm: np.ndarray
    """float64 (n,), ascending."""
    values: np.ndarray
    """float64 (n,), finite."""


@dataclass(frozen=True)
class _Row:
    line: int
    cells: list[str]
    numbers: list[float | None]
    """NaN where a value is missing, None for text."""
    is_data: bool


def read_curve(name: str | os.PathLike[str], notes: list[str]) -> Curve:
    """The curve called "file:column", or the only one of a file. Raises UserError, with a list, where that is open."""
    path, part = files.with_part(name)
    curves = read_curves(path, notes)
    names = [curve.name for curve in curves]
    key = part.casefold()
    same = [i for i, name in enumerate(names) if name.casefold() == key]
    found = same or [i for i, name in enumerate(names) if key in name.casefold()]
    if len(found) == 1:
        return curves[found[0]]
    state = f"has no column '{part}' but" if part and not found else f"has {len(found)} columns of values:"
    listed = ", ".join(f"'{names[i]}'" for i in (found or range(len(names)))[:12])
    raise UserError(f'{path} {state} {listed}; name one of them, as in "{Path(path).name}:{names[-1]}"')


def read_curves(path: str | os.PathLike[str], notes: list[str]) -> list[Curve]:
    """All curves in `path`, at least one; what was assumed goes to `notes`. Raises UserError with a remedy."""
    try:
        text = files.read_any_text(path, files.SETTINGS_BYTES)
    except OSError as error:
        reason = f"cannot read the curve {path}: {error.strerror}"
        raise UserError(f"{reason}; give a table of wavelength_nm, value") from error
    if text.lstrip("\ufeff \t\r\n").startswith("<"):
        tables = list(_from_xml(text.lstrip("\ufeff \t\r\n"), path))
    else:
        rows = _rows(text.replace("\0", "").splitlines())
        tables = list(_across(rows)) or list(_down(path, rows, notes))
    seen: Counter[str] = Counter()
    curves = []
    for name, unit, nm, values in tables:
        curve = _in_order(path, name, unit, np.array(nm, float), np.array(values, float), notes)
        if len(curve.nm) >= 2:
            seen[name] += 1
            curves.append(curve if seen[name] == 1 else Curve(f"{name} ({seen[name]})", curve.nm, curve.values))
    if not curves:
        raise UserError(f"{path}: there is no table of two or more rows of wavelength_nm, value; export it as text")
    return curves


def clipped(
    path: str | os.PathLike[str], curve: Curve, what: str, notes: list[str], most: float = math.inf
) -> np.ndarray:
    """Values of `curve` from 0 to `most`; what noise has put beyond them is clipped and goes to `notes`.

    Raises UserError where that is more than noise within the visible range.
    """
    seen = np.interp(VISIBLE_NM, curve.nm, curve.values)
    allowed = NOISE * min(max(float(seen.max()), 0.0), most)
    for at, bound, beyond in ((int(seen.argmin()), 0.0, -seen.min()), (int(seen.argmax()), most, seen.max() - most)):
        if beyond > allowed:
            raise UserError(
                f"{path}: the {what} is {'below 0' if bound == 0.0 else f'above {bound:g}'} ({seen[at]:g}) at "
                f"{VISIBLE_NM[at]:g} nm, by more than noise; correct the file"
            )
    values = np.clip(curve.values, 0.0, most)
    count = int((values != curve.values).sum())
    if count:
        worst = curve.values[np.abs(values - curve.values).argmax()]
        limits = "0" if most == math.inf else f"0 to {most:g}"
        notes.append(f"{path}: {count} noisy values of the {what} (up to {worst:g}) were set to {limits}.")
    return values


def share(path: str | os.PathLike[str], curve: Curve, what: str, notes: list[str]) -> np.ndarray:
    """Values of `curve` as shares from 0 to 1, given as such, in per cent or as absorbance; transmittance comes out
    above 0."""
    values, highest = curve.values, float(np.interp(VISIBLE_NM, curve.nm, curve.values).max())
    if re.search(r"\babs\b|absorbance|extinktion|optical density", curve.name, re.IGNORECASE):
        notes.append(f"{path}: '{curve.name}' was taken as absorbance, minus the decimal logarithm of transmittance.")
        values = 10.0 ** -np.clip(values, -300.0, 300.0)
    elif "%" in curve.name or 2.0 < highest <= 150.0:
        values = values / 100.0
        if "%" not in curve.name:
            notes.append(f"{path}: the {what} (up to {highest:g}) looks like per cent and was taken as such.")
    values = clipped(path, Curve(curve.name, curve.nm, values), what, notes, most=1.0)
    return np.maximum(values, LEAST_TRANSMITTANCE) if what == "transmittance" else values


# ---- text ---------------------------------------------------------------------------------


def _rows(lines: list[str]) -> list[_Row]:
    """Lines that are not blank, in the dialect in which most of them are numbers."""
    sample = [line for line in lines if re.search(r"\d", line)][:_SAMPLED_LINES]
    best = (-1, "\t", False)
    for delimiter in "\t;, ":
        split = [_cells(line, delimiter) for line in sample]
        comma = _has_decimal_comma(split)
        parsed = [_row(0, cells, comma) for cells in split]
        score = sum((1 + (None not in row.numbers)) for row in parsed if row.is_data)
        if score > best[0]:
            best = (score, delimiter, comma)
    rows = [_row(i, _cells(line, best[1]), best[2]) for i, line in enumerate(lines, start=1) if line.strip(" \t;,")]
    return [row for row in rows if row.cells]


def _cells(line: str, delimiter: str) -> list[str]:
    line = line[:1] + line[1:].partition("#")[0]
    if delimiter == " ":
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))]
    except csv.Error:
        return []


def _has_decimal_comma(split: list[list[str]]) -> bool:
    numbers = [cell for cells in split for cell in cells if re.fullmatch(r"[-+]?[\d.,]+(?:[eE][-+]?\d+)?%?", cell)]
    both = [cell for cell in numbers if "," in cell and "." in cell]
    if both:
        return both[0].rfind(",") > both[0].rfind(".")
    return any("," in cell for cell in numbers) and not any("." in cell for cell in numbers)


def _row(line: int, cells: list[str], comma: bool) -> _Row:
    numbers = [_number(cell, comma) for cell in cells]
    if numbers and numbers[0] is None and (found := _WITH_UNIT.fullmatch(cells[0])):
        numbers[0] = _number(found[1], comma or "," in found[1])
    is_data = (
        len(numbers) > 1
        and numbers[0] is not None
        and not math.isnan(numbers[0])
        and any(number is not None for number in numbers[1:])
    )
    return _Row(line, cells, numbers, is_data)


def _number(cell: str, comma: bool) -> float | None:
    text = cell.strip(" \u00a0'\"%").replace("−", "-")
    if text.casefold() in _MISSING:
        return math.nan
    if comma and "," in text:
        text = text.replace(".", "").replace(",", ".")
    elif re.fullmatch(r"[-+]?\d{1,3}(?:,\d{3})+(?:\.\d*)?", text):
        text = text.replace(",", "")
    elif "." not in text:  # quoted between commas
        text = text.replace(",", ".")
    return float(text.lower().replace("d", "e")) if _NUMBER.fullmatch(text) else None


_Table = tuple[str, str, Any, Any]
"""Name, heading of the wavelengths, these and the values."""


def _across(rows: list[_Row]) -> Iterator[_Table]:
    """Curves in rows below a row of wavelengths, as CGATS files and spreadsheets of samples have them."""
    for i, row in enumerate(rows):
        marks = [(column, found[1]) for column, cell in enumerate(row.cells) if (found := _HEADED.fullmatch(cell))]
        nm = np.array([float(text.replace(",", ".")) for _, text in marks])
        steps = np.abs(np.diff(nm))
        if len(nm) < _LEAST_ACROSS or not (
            nm.min() >= 200.0 and nm.max() <= 2600.0 and 0.0 < steps.max() <= 2.0 * steps.min()
        ):
            continue
        columns = [column for column, _ in marks]
        for number, below in enumerate((r for r in rows[i + 1 :] if len(r.cells) > columns[-1]), start=1):
            values = [below.numbers[column] for column in columns]
            if None not in values:
                named = [below.cells[c] for c in range(columns[0]) if below.numbers[c] is None]
                yield " ".join(named) or f"row {number}", "nm", nm, values
        return


def _down(path: str | os.PathLike[str], rows: list[_Row], notes: list[str]) -> Iterator[_Table]:
    """Curves in columns, of all stretches of rows that begin with a number."""
    above: list[_Row] = []
    width = 0
    for is_data, group in itertools.groupby(rows, key=lambda row: row.is_data):
        stretch = list(group)
        if not is_data:
            cells = stretch[0].cells
            is_spoilt = len(cells) == width or not re.search(r"[^\W\d_]", "".join(cells))
            if width and cells[0][:1].isdigit() and is_spoilt:
                _fail_line(path, stretch[0])
            above = stretch
            continue
        width = max(len(row.cells) for row in stretch)
        # A list that begins again at its first wavelength is another one: Sekonic's steps of 5 nm, then of 1 nm.
        starts = [i for i, row in enumerate(stretch) if row.numbers[0] == stretch[0].numbers[0]]
        blocks = [stretch[a:b] for a, b in itertools.pairwise([*starts, len(stretch)])]
        longest = max(blocks, key=len)
        if len(blocks) > 1 and sum(len(block) == len(longest) for block in blocks) == 1 and len(longest) > 2:
            notes.append(f"{path} lists its wavelengths {len(blocks)} times; the longest list was taken.")
            blocks = [longest]
        for block in blocks:
            yield from _columns(path, block, above)
        above = []


def _columns(path: str | os.PathLike[str], block: list[_Row], above: list[_Row]) -> Iterator[_Table]:
    width = max(len(row.cells) for row in block)
    fits = [
        row
        for row in above[-_NEAR:]
        if abs(len(row.cells) - width) <= 1 and (not any(row.numbers) or _WAVELENGTH.search(row.cells[0]))
    ]
    titles = [[cell.strip("#%!/* ") for cell in row.cells] + [""] * width for row in fits[-2:]]
    if len(titles) == 2 and not re.fullmatch(r"[\[(]?(?:nm|[µμu]m|å)[\])]?", titles[1][0], re.IGNORECASE):
        del titles[0]  # only a row of units has the names above it
    names = [" ".join(filter(None, cells)) for cells in zip(*titles, strict=False)] or [""] * width
    at = next((c for c in range(width) if _WAVELENGTH.search(names[c])), 0)
    for column in range(at + 1, width):
        if _WAVELENGTH.search(names[column]):
            at = column
            continue
        pairs = [(row, row.numbers[at], row.numbers[column]) for row in block if len(row.cells) > column]
        text = [row for row, nm, value in pairs if nm is None or value is None]
        if 2 * len(text) > len(pairs) or all(value is None or math.isnan(value) for _, _, value in pairs):
            continue
        if text:
            _fail_line(path, text[0])
        yield names[column] or f"column {column + 1}", names[at], [p[1] for p in pairs], [p[2] for p in pairs]


def _fail_line(path: str | os.PathLike[str], row: _Row) -> NoReturn:
    raise UserError(f"{path}, line {row.line}: expected numbers, wavelength_nm and a value, as in the rows above it")


# ---- XML ----------------------------------------------------------------------------------


def _from_xml(text: str, path: str | os.PathLike[str]) -> Iterator[_Table]:
    """Curves of an IES TM-27 file (.spdx); document types, and with them entities, are refused."""
    if "<!DOCTYPE" in text:
        raise UserError(f"{path} declares a document type, which spectra do not need; remove it")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise UserError(f"{path} is not whole XML ({error}); export it again") from error
    for number, held in enumerate((e for e in root.iter() if e.tag.endswith("SpectralDistribution")), start=1):
        data = [e for e in held.iter() if e.tag.endswith("SpectralData")]
        nm = [_number(e.get("wavelength", ""), False) for e in data]
        values = [_number(e.text or "", False) for e in data]
        if None in nm or None in values:
            raise UserError(f"{path} has something among its SpectralData that is no number; export it again")
        yield f"spectrum {number}", "nm", nm, values


# ---- order and units ----------------------------------------------------------------------


def _in_order(
    path: str | os.PathLike[str], name: str, unit: str, x: np.ndarray, values: np.ndarray, notes: list[str]
) -> Curve:
    """The curve with wavelengths in nm and ascending, one value for each."""
    keep = ~(np.isnan(x) | np.isnan(values))
    x, values = x[keep], values[keep]
    if np.abs([x, values]).max(initial=0.0) > MAX_MAGNITUDE:
        raise UserError(f"{path} holds a number beyond {MAX_MAGNITUDE:g}; remove the row")
    if len(x) < 2:
        return Curve(name, x, values)
    x = x * _factor_nm(path, unit, x, notes)
    nm, places, counts = np.unique(x, return_inverse=True, return_counts=True)
    means = np.bincount(places, values) / counts
    if np.abs(values - means[places]).max() > NOISE * np.abs(values).max():
        at = nm[places[np.abs(values - means[places]).argmax()]]
        raise UserError(f"{path}: there are different values of '{name}' at {at:g} nm; remove all but one")
    if nm[-1] < VISIBLE_NM[0] or nm[0] > VISIBLE_NM[-1]:
        hint = "; if they are Å, write 'wavelength (Å)' above them" if nm[0] > 1000.0 else ""
        raise UserError(
            f"{path}: its wavelengths run from {nm[0]:g} to {nm[-1]:g} nm, outside the visible 380 to 780 nm{hint}; "
            "they must be in nanometres"
        )
    return Curve(name, nm, means)


def _factor_nm(path: str | os.PathLike[str], unit: str, x: np.ndarray, notes: list[str]) -> float:
    """Nanometres in the unit of the wavelengths `x`: that of their heading, or what their size leaves possible."""
    if (other := _OTHER_UNITS.search(unit)) and "nm" not in unit:
        raise UserError(f"{path}: its curve is given over {other[0]}, not over wavelengths; convert it to nm")
    said = next((factor for words, factor in _UNITS_NM.items() if re.search(words, unit, re.IGNORECASE)), None)
    low, high = float(np.abs(x).min()), float(np.abs(x).max())
    shown = f"{path}: its wavelengths ({x.min():g} to {x.max():g}) look like"
    if said in (None, 1.0) and high < 100.0:
        notes.append(f"{shown} {'µm' if high > 1e-3 else 'm'} and were taken as such; give them in nm otherwise.")
        return 1e3 if high > 1e-3 else 1e9
    if said == 1e3 and low > 100.0:
        notes.append(f"{shown} nm and were taken as such, although their heading says µm.")
        return 1.0
    return said or 1.0
