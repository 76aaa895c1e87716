"""Refractive indices from people's files: Zemax AGF catalogues, refractiveindex.info's YAML and CSV, tables of n.

A glass is named as "SCHOTT.AGF:N-BK7", or by its name alone where a catalogue holds it: the program's own first, then
those beside the scene file, then those in the folder `glass` of the user's settings.
"""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import NoReturn, cast

import numpy as np
import yaml

from ...base import files
from ...base.errors import UserError, suggestion
from ...base.paths import config_path
from ..io.curve_file import Curve, read_curves
from . import catalogue, glass
from .colorimetry import VISIBLE_NM
from .dispersion_formulas import Kind
from .glass import Dispersion
from .spectrum import rgb_under_white

SUFFIXES = (".agf", ".yml", ".yaml", ".csv", ".txt")
"""Of files that hold an index."""
_MAX_BYTES = 4 << 20
_OPAQUE_K = 0.01
"""Extinction coefficient from which on a hundredth of a millimetre is black."""
_SERIES = {
    1: (2, -2, -4, -6, -8),
    10: (2, -2, -4, -6, -8, -10, -12),
    12: (2, -2, -4, -6, -8, 4, 6),
    13: (2, 4, -2, -4, -6, -8, -10, -12),
}
"""AGF formulas that are power series for n², by number: the powers of λ in µm behind the constant."""


def names_file(name: str) -> bool:
    """Whether `name` is that of a file with an index, or of a part of one, rather than of a glass."""
    return re.search(rf"(?:{'|'.join(map(re.escape, SUFFIXES))})(?::|$)", name, re.IGNORECASE) is not None


def find_glass(name: str, beside: Path, where: str, notes: list[str]) -> Dispersion:
    """The glass `name` of the program's catalogue or of an AGF file beside or among the user's settings."""
    try:
        return catalogue.find(name, where)
    except UserError:
        for folder in (beside, config_path() / "glass"):
            for path in sorted(p for p in folder.glob("*") if p.suffix.lower() == ".agf" and files.is_file(p)):
                if files.may_read(path, folder) and (found := _key(name, _agf_glasses(path, path.stat().st_mtime_ns))):
                    return read_index(f"{path}:{found}", notes)
        raise


def read_index(name: str | os.PathLike[str], notes: list[str]) -> Dispersion:
    """n(λ) in a file, of the glass or column "file:part" where it holds several; what was assumed goes to `notes`.

    Raises UserError naming the file, and what it holds where the choice is open.
    """
    path, part = files.with_part(name)
    suffix = path.suffix.lower()
    if suffix == ".agf":
        return _from_agf(path, part, notes)
    if suffix in (".yml", ".yaml"):
        return _from_yaml(path, notes)
    curves = read_curves(path, notes)
    chosen = [c for c in curves if c.name.casefold() == (part or "n").casefold()] or (curves if not part else [])
    if len(chosen) != 1:
        listed = ", ".join(f"'{curve.name}'" for curve in curves[:12])
        raise UserError(f'{path} holds {listed}; name the one that is n, as in "{path.name}:{curves[0].name}"')
    extinction = [c for c in curves if c.name.casefold() == "k" and c is not chosen[0]]
    return _measured(path, chosen[0], extinction[0] if extinction else None, notes)


def _measured(path: Path, n: Curve, k: Curve | None, notes: list[str]) -> Dispersion:
    found = glass.table(n.nm, n.values, path.stem, str(path))
    if k is not None:
        _check_clear(path, found.index(VISIBLE_NM), np.interp(VISIBLE_NM, k.nm, k.values), notes)
    return found


def _check_clear(path: Path, n: np.ndarray, k: np.ndarray, notes: list[str]) -> None:
    """Raise UserError for a metal, n and k on the visible grid; a little absorption goes to `notes`."""
    if np.median(k) > _OPAQUE_K:
        seen = rgb_under_white(((n - 1.0) ** 2 + k**2) / ((n + 1.0) ** 2 + k**2))
        shown = ", ".join(f"{channel:.3f}" for channel in seen)
        raise UserError(
            f"{path}: this material absorbs so strongly (k up to {k.max():.3g}) that it is no glass; "
            f'use material = {{ kind = "mirror", reflectance = [{shown}] }}'
        )
    if k.max() > 0.0:
        notes.append(
            f"{path}: its absorption (k up to {k.max():.2g}) is not used; 'absorption' says what glass absorbs."
        )


# ---- Zemax AGF ----------------------------------------------------------------------------


def _text(path: Path) -> str:
    try:
        return files.read_any_text(path, _MAX_BYTES)
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}; choose another file") from error


@lru_cache(maxsize=16)
def _agf_glasses(path: Path, _changed_ns: int) -> dict[str, dict[str, list[str]]]:
    """Lines NM, CD and LD, split into words, of every glass in an AGF file, by name."""
    glasses: dict[str, dict[str, list[str]]] = {}
    current: dict[str, list[str]] = {}
    for line in _text(path).splitlines():
        words = line.split()
        if words and words[0].upper() == "NM" and len(words) > 2:
            current = glasses.setdefault(words[1], {})
        if words and words[0].upper() in ("NM", "CD", "LD"):
            current.setdefault(words[0].upper(), words[1:])
    return glasses


def _key(name: str, glasses: Iterable[str]) -> str | None:
    wanted = catalogue.search_key(name)
    return next((known for known in glasses if catalogue.search_key(known) == wanted), None)


def _from_agf(path: Path, name: str, notes: list[str]) -> Dispersion:
    glasses = _agf_glasses(path, path.stat().st_mtime_ns)
    found = _key(name, glasses) if name or len(glasses) != 1 else next(iter(glasses))
    if found is None:
        listed = ", ".join(list(glasses)[:12]) or "no glass"
        hint = (suggestion(name, glasses) if name else "") or f"; it holds {listed}{' …' if len(glasses) > 12 else ''}"
        raise UserError(
            f"{path} has no glass '{name}'{hint}"
            if name
            else f'{path} holds {len(glasses)} glasses ({listed}); name one, as in "{path.name}:N-BK7"'
        )
    lines, where = glasses[found], f"{path}: {found}"
    number, c = _numbers(lines["NM"][1:2], where)[0], _numbers(lines.get("CD", []), where)
    kind, coefficients = _as_published(int(number), [*c, *[0.0] * 10][:10], where)
    limits = _numbers(lines.get("LD", [])[:2], where)
    range_nm = (1e3 * limits[0], 1e3 * limits[1]) if len(limits) == 2 else None
    dispersion = glass.from_formula(kind, coefficients, found, range_nm, where)
    said = _numbers(lines["NM"][3:4], where)
    if said and said[0] > 1.0 and abs(said[0] - dispersion.n_d) > 1e-3:
        notes.append(f"{where}: its coefficients give n_d = {dispersion.n_d:.5f}, and its line NM says {said[0]:g}.")
    return dispersion


def _numbers(words: list[str], where: str) -> list[float]:
    try:
        found = [float(word.replace(",", ".")) for word in words]
    except ValueError:
        found = [np.nan]
    if not np.isfinite(found).all():
        raise UserError(f"{where} has something that is no number among its coefficients; export it again")
    return found


def _as_published(number: int, c: list[float], where: str) -> tuple[Kind, list[float]]:
    """AGF's formula `number` with its ten coefficients `c` as one of refractiveindex.info's (OpticStudio help, "The
    Glass Dispersion Formulas")."""
    if number in _SERIES:
        return "formula 3", [c[0], *itertools.chain(*zip(c[1:], _SERIES[number], strict=False))]
    match number:
        case 2 | 6 | 11:  # Sellmeier 1, 3, 5
            return "formula 2", [0.0, *c[: {2: 6, 6: 8, 11: 10}[number]]]
        case 3:  # Herzberger
            return "formula 7", c[:6]
        case 4:  # Sellmeier 2
            return "formula 4", [1.0 + c[0], c[1], 2, c[2], 2, c[3], 0, c[4], 2]
        case 5:  # Conrady
            return "formula 5", [c[0], c[1], -1, c[2], -3.5]
        case 7 | 8:  # Handbook of Optics 1, 2
            return "formula 4", [c[0], c[1], 0 if number == 7 else 2, c[2], 1, 0, 0, 1, 1, -c[3], 2]
        case 9:  # Sellmeier 4
            return "formula 2", [c[0] - 1.0, *c[1:5]]
    raise UserError(f"{where} has the dispersion formula {number}; known are 1 to 13")


# ---- refractiveindex.info -----------------------------------------------------------------


def _from_yaml(path: Path, notes: list[str]) -> Dispersion:
    """The first entry with n of a page of refractiveindex.info's database; λ in µm."""
    try:
        page = yaml.load(_text(path), yaml.BaseLoader)  # texts, lists and tables only: nothing is constructed
    except (yaml.YAMLError, RecursionError) as error:
        raise UserError(f"{path} is not whole YAML; download it again from refractiveindex.info") from error
    data = page.get("DATA") if isinstance(page, dict) else None
    entries = [e for e in data if isinstance(e, dict)] if isinstance(data, list) else []
    found, k = None, None
    for entry in entries:
        kind, where = str(entry.get("type", "")), f"{path}: DATA"
        if kind.startswith("formula") and found is None:
            limits = _numbers(str(entry.get("wavelength_range", entry.get("range", ""))).split(), where)
            range_nm = (1e3 * limits[0], 1e3 * limits[1]) if len(limits) == 2 else None
            coefficients = _numbers(str(entry.get("coefficients", "")).split(), where)
            found = glass.from_formula(cast(Kind, kind), coefficients, path.stem, range_nm, where)
        elif kind in ("tabulated n", "tabulated nk", "tabulated k"):
            rows = [_numbers(line.split(), where) for line in str(entry.get("data", "")).splitlines() if line.split()]
            if len(rows) < 2 or {len(row) for row in rows} != {len(kind) - len("tabulated ") + 1}:
                _fail_yaml(path)
            x, *columns = np.array(sorted(rows)).T
            x, first = np.unique(1e3 * x, return_index=True)
            if kind != "tabulated k" and found is None:
                found = glass.table(x, columns[0][first], path.stem, where)
            if kind != "tabulated n":
                k = Curve("k", x, columns[-1][first])
    if found is None:
        _fail_yaml(path)
    if k is not None:
        _check_clear(path, found.index(VISIBLE_NM), np.interp(VISIBLE_NM, k.nm, k.values), notes)
    return found


def _fail_yaml(path: Path) -> NoReturn:
    raise UserError(f"{path} holds no table or formula of n under DATA, as refractiveindex.info's files do")
