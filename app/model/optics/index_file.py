"""Refractive indices from people's files: Zemax AGF catalogues, refractiveindex.info's YAML and CSV, tables of n.

A glass is named as "SCHOTT.AGF:N-BK7", or by its name alone where a catalogue holds it: the program's own first, then
those next to the scene file, then those in the folder `glass` of the user's settings.
"""

from __future__ import annotations

import itertools
import math
import os
import re
from functools import lru_cache
from pathlib import Path
from typing import cast

import numpy as np

from ...base import files
from ...base.errors import UserError, suggestion
from ...base.paths import config_path
from ..io.curve_file import read_curves
from ..io.scene_table import MAX_MAGNITUDE
from . import catalogue, glass
from .colorimetry import VISIBLE_NM
from .dispersion_formulas import Kind
from .glass import Dispersion
from .spectrum import rgb_under_white

_NAMES_FILE = re.compile(r"\.(?:agf|ya?ml|csv|txt)(?::|$)", re.IGNORECASE)
_INDEX = re.compile(r"(\d(?:\.\d*)?)(?:\s*[/:]\s*(-?\d+(?:\.\d+)?))?")
_MAX_BYTES = 4 << 20
_OPAQUE_K = 0.01
"""Extinction coefficient from which on a hundredth of a millimetre is black."""
_N_D_APART = 1e-3
_SERIES = {
    1: (2, -2, -4, -6, -8),
    10: (2, -2, -4, -6, -8, -10, -12),
    12: (2, -2, -4, -6, -8, 4, 6),
    13: (2, 4, -2, -4, -6, -8, -10, -12),
}
"""AGF formulas that are power series for n², by number: the powers of λ in µm behind the constant."""


def names_file(name: str) -> bool:
    """Whether `name` is that of a file with an index, or of a part of one, rather than of a glass."""
    return _NAMES_FILE.search(name) is not None


def find_glass(name: str, folder: Path, where: str, notes: list[str]) -> Dispersion:
    """The glass `name`: of a file, of the program's catalogue, of an AGF file in `folder` or the user's settings;
    "1.5168/64.17" is one of that n_d and V_d, "1.5" one without dispersion."""
    if names_file(name):
        return read_index(folder / name, notes)
    if found := _INDEX.fullmatch(name.strip()):
        return glass.from_abbe(float(found[1]), float(found[2] or 0.0) or math.inf, name.strip(), where)
    try:
        return catalogue.find(name, where)
    except UserError:
        for place in (folder, config_path() / "glass"):
            for path in sorted(p for p in place.glob("*.[aA][gG][fF]") if files.is_file(p)):
                if files.may_read(path, place) and _known_as(name, _agf_glasses(path)):
                    return _from_agf(path, name, notes)
        raise


def read_index(name: str | os.PathLike[str], notes: list[str]) -> Dispersion:
    """n(λ) in a file, of the glass or column "file:part" where it holds several; what was assumed goes to `notes`.

    Raises UserError naming the file, and what it holds where the choice is open.
    """
    path, part = files.with_part(name)
    if path.suffix.lower() == ".agf":
        return _from_agf(path, part, notes)
    if path.suffix.lower() in (".yml", ".yaml"):
        found, k = _from_yaml(path)
    else:
        curves = read_curves(path, notes)
        by_name = {curve.name.casefold(): curve for curve in curves}
        chosen = by_name.get((part or "n").casefold(), curves[0] if len(curves) == 1 and not part else None)
        if chosen is None:
            listed = ", ".join(f"'{curve.name}'" for curve in curves[:12])
            raise UserError(f'{path} holds {listed}; name the one that is n, as in "{path.name}:{curves[0].name}"')
        found, absorbs = glass.table(chosen.nm, chosen.values, path.stem, str(path)), by_name.get("k")
        k = None if absorbs is None or absorbs is chosen else np.interp(VISIBLE_NM, absorbs.nm, absorbs.values)
    if k is not None and np.median(k) > _OPAQUE_K:
        n = found.index(VISIBLE_NM)
        seen = rgb_under_white(((n - 1.0) ** 2 + k**2) / ((n + 1.0) ** 2 + k**2))
        remedy = f'material = {{ kind = "mirror", reflectance = [{", ".join(f"{v:.3f}" for v in seen)}] }}'
        raise UserError(f"{path}: this absorbs so strongly (k up to {k.max():.3g}) that it is no glass; use {remedy}")
    if k is not None and k.max() > 0.0:
        notes.append(
            f"{path}: its absorption (k up to {k.max():.2g}) is not used; 'absorption' says what glass absorbs."
        )
    return found


def _numbers(words: list[str], where: str | Path) -> list[float]:
    try:
        found = [float(word.replace(",", ".")) for word in words]
    except ValueError:
        found = [np.nan]
    if not (np.abs(found) <= MAX_MAGNITUDE).all():
        raise UserError(f"{where} has something among its coefficients that is no number; export it again")
    return found


def _range_nm(words: list[str], where: str | Path) -> tuple[float, float] | None:
    """The two wavelengths in µm, if there are two."""
    limits = _numbers(words, where)
    return (1e3 * limits[0], 1e3 * limits[1]) if len(limits) == 2 else None


# ---- Zemax AGF ----------------------------------------------------------------------------


def _agf_glasses(path: Path) -> dict[str, dict[str, list[str]]]:
    """Lines NM, CD and LD, split into words, of every glass in an AGF file, by name."""
    with files.reading(path, "choose another file"):
        return _parsed_agf(files.read_any_text(path, _MAX_BYTES))


@lru_cache(maxsize=8)
def _parsed_agf(text: str) -> dict[str, dict[str, list[str]]]:
    glasses: dict[str, dict[str, list[str]]] = {}
    current: dict[str, list[str]] = {}
    for key, *words in filter(None, (line.split() for line in text.splitlines())):
        if key.upper() == "NM" and len(words) > 1:
            current = glasses.setdefault(words[0], {})
        current.setdefault(key.upper(), words)
    return glasses


def _known_as(name: str, glasses: dict[str, dict[str, list[str]]]) -> str | None:
    wanted = catalogue.search_key(name)
    return next((known for known in glasses if catalogue.search_key(known) == wanted), None)


def _from_agf(path: Path, name: str, notes: list[str]) -> Dispersion:
    glasses = _agf_glasses(path)
    found = _known_as(name, glasses) if name or len(glasses) != 1 else next(iter(glasses))
    if found is None:
        near = suggestion(name, glasses) if name else ""
        listed = near or f"; it holds {len(glasses)}: {', '.join(list(glasses)[:12])}"
        raise UserError(
            f"{path} has no glass '{name}'{listed}" if name else f'{path}: which glass ("{path.name}:NAME"){listed}'
        )
    lines, where = glasses[found], f"{path}: {found}"
    if not lines.get("CD"):
        raise UserError(f"{where} has no coefficients (a line CD); export the catalogue again")
    number, *stated = _numbers(lines["NM"][1:2] + lines["NM"][3:4], where)
    kind, coefficients = _as_published(int(number), [*_numbers(lines.get("CD", []), where), *[0.0] * 10][:10], where)
    dispersion = glass.from_formula(kind, coefficients, found, _range_nm(lines.get("LD", [])[:2], where), where)
    if stated and stated[0] > 1.0 and abs(stated[0] - dispersion.n_d) > _N_D_APART:
        notes.append(f"{where}: its coefficients give n_d = {dispersion.n_d:.5f}, and its line NM says {stated[0]:g}.")
    return dispersion


def _as_published(number: int, c: list[float], where: str) -> tuple[Kind, list[float]]:
    """AGF's formula `number` with its ten coefficients `c` as one of refractiveindex.info's (OpticStudio's help, "The
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


def _from_yaml(path: Path) -> tuple[Dispersion, np.ndarray | None]:
    """n of the first entry of a database page that has it, λ in µm, and k on the visible grid where one says it."""
    import yaml

    try:
        with files.reading(path, "choose another file"):
            text = files.read_any_text(path, _MAX_BYTES)
        page = yaml.load(text, yaml.BaseLoader)  # texts, lists and tables only: nothing is constructed
    except (yaml.YAMLError, RecursionError) as error:
        raise UserError(f"{path} is not whole YAML; get it again from refractiveindex.info") from error
    entries = page.get("DATA") if isinstance(page, dict) else None
    found, k = None, None
    for entry in entries if isinstance(entries, list) else []:
        texts = {key: str(value) for key, value in entry.items()} if isinstance(entry, dict) else {}
        kind = texts.get("type", "")
        if kind.startswith("formula") and found is None:
            range_nm = _range_nm(texts.get("wavelength_range", texts.get("range", "")).split(), path)
            coefficients = _numbers(texts.get("coefficients", "").split(), path)
            found = glass.from_formula(cast(Kind, kind), coefficients, path.stem, range_nm, str(path))
        rows = [_numbers(line.split(), path) for line in texts.get("data", "").splitlines() if line.split()]
        if kind in ("tabulated n", "tabulated nk", "tabulated k") and {len(row) for row in rows} == {len(kind) - 9}:
            x, *columns = np.array(sorted(rows)).T
            x, first = np.unique(1e3 * x, return_index=True)
            if kind != "tabulated k" and found is None:
                found = glass.table(x, columns[0][first], path.stem, str(path))
            k = k if kind == "tabulated n" else np.interp(VISIBLE_NM, x, columns[-1][first])
    if found is None:
        raise UserError(f"{path} holds no table or formula of n under DATA, as refractiveindex.info's files do")
    return found, k
