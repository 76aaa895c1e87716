"""Curves, indices and catalogues as instruments and programs write them: each kind is a row of a table."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.model.io.scene_file import scene_of
from spectrasplat.model.optics import catalogue
from spectrasplat.model.optics import spectrum as sp

NM = np.array([380.0, 450.0, 500.0, 560.0, 600.0, 700.0, 780.0])
POWER = np.array([0.0, 0.25, 0.5, 1.0, 0.75, 0.0625, 0.0])


def each(row: str, comma: bool = False, x: np.ndarray = NM, y: np.ndarray = POWER) -> str:
    """`row` for all wavelengths {x} and values {y}, numbered {i}."""
    lines = [row.format(i=i, x=f"{a:.10g}", y=f"{b:.10g}") for i, (a, b) in enumerate(zip(x, y, strict=True))]
    return "".join(lines).replace(".", ",") if comma else "".join(lines)


def rows(between: str, comma: bool = False, x: np.ndarray = NM, y: np.ndarray = POWER) -> str:
    return each("{x}" + between + "{y}\n", comma, x, y)


WIDE = np.arange(380.0, 781.0, 20.0)
WIDE_POWER = np.interp(WIDE, NM, POWER)
CGATS = "ID\tNAME" + each("\tnm{x}", x=WIDE, y=WIDE) + "\nEND_DATA_FORMAT\nBEGIN_DATA"
CGATS += "\n1\tA1" + each("\t{y}", x=WIDE, y=WIDE_POWER) + "\n2\tA2" + each("\t{y}", x=WIDE, y=1.0 - WIDE_POWER)
SPDX = f"""<?xml version="1.0"?><IESTM2714 xmlns="iestm2714"><SpectralDistribution>
{each('<SpectralData wavelength="{x}">{y}</SpectralData>')}</SpectralDistribution></IESTM2714>"""
OCEAN = "Data from a spectrometer\n\nDate: today\nIntegration time (s): 1,0E-1\nPixels: 2048\n>>>>>Begin Data<<<<<\n"
SEKONIC = "Tcp [K],3262\nCRI Ra,87.5\n" + each("Spectral Data {x}[nm],{y}\n")


@pytest.mark.parametrize(
    ("text", "part", "note"),
    [
        ("# lamp\nwavelength_nm,power\n" + rows(",") + "\n", "", ""),
        (each("{x}, {y}  # a\n"), "", ""),
        ("Wellenlänge [nm];Leistung\n" + rows(";", comma=True), "", ""),
        (rows(" ", comma=True), "", ""),
        (each('"{x}","{y}"\n').replace(".", ","), "", ""),
        (OCEAN + rows("\t") + ">>>>>End Data<<<<<\n", "", ""),
        (OCEAN + rows("\t", comma=True), "", ""),
        ("wavelength;power\nnm;W/nm\n" + rows(";"), "", ""),
        ("Model\tX\nLUX\t695.1\nR9\t77\n" + rows("nm\t"), "", ""),  # UPRtek
        (SEKONIC, "", ""),
        ("Spectral Data 380[nm],0\nSpectral Data 780[nm],0\n" + SEKONIC.partition("87.5\n")[2], "", "2 times"),
        (rows(",", x=NM[::-1], y=POWER[::-1]), "", ""),
        (rows(",", x=NM[[3, 0, 6, 1, 2, 5, 4]], y=POWER[[3, 0, 6, 1, 2, 5, 4]]), "", ""),
        (rows(",") + "500,0.5\n", "", ""),
        ("200,nan\n" + rows(",") + "800,\n", "", ""),
        ("341.2,-0.02\n" + rows(","), "", "noise"),
        ("wl (µm),P\n" + rows(",", x=NM * 1e-3), "", ""),
        (rows(",", x=NM * 1e-3), "", "look like µm"),
        ("wl (µm),P\n" + rows(","), "", "look like nm"),
        ("wavelength (Å)\tP\n" + rows("\t", x=NM * 10.0), "", ""),
        ("wavelength,Sample 1,Sample 2\n" + each("{x},{i}e999,{y}\n"), "Sample 2", ""),
        ("pixel,wavelength,P\n" + each("{i},{x},{y}\n"), "", ""),
        ("Dark,,Lamp,\nnm,a,nm,a\n" + each("{x},3,{x},{y}\n"), "Lamp a", ""),
        (CGATS, "A1", ""),
        (SPDX, "", ""),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be"])
def test_spectra(tmp_path: Path, text: str, part: str, note: str, encoding: str) -> None:
    file, notes = tmp_path / "lamp.csv", []
    file.write_bytes(text.replace("\n", "\r\n").encode(encoding))
    found = sp.from_csv(f"{file}:{part}" if part else file, notes)
    assert found.density[[120, 180, 220, 320]] == pytest.approx(POWER[2:-1], abs=1e-5)
    assert found.density[[95, 200]] == pytest.approx([0.375, 0.875], abs=0.01)
    assert note in " ".join(notes) and len(notes) == bool(note)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("400,1\n500,x\n", "line 2: expected numbers"),
        ("400,1\n500,2\n600;3\n", "line 3: expected numbers"),
        ("400,1,7\n500,1,7\n", "2 columns of values: 'column 2', 'column 3'; name one of them, as in \"lamp.csv:col"),
        ("nm,a,b\n400,1,7\n500,1,7\n", "'a', 'b'; name one"),
        ("nm,a,b\n400,1,7\n500,1,7\n", "has no column 'c' but 'a', 'b'"),
        ("400,1\n500,1e999\n", "beyond 1e+30"),
        ("400,1\n500,-1\n", "power is -1 at 500 nm"),
        ("400,1\n500,1\n500,2\n", "different values of 'column 2' at 500 nm"),
        ("400,1\n", "two or more rows"),
        ("", "two or more rows"),
        ("\x01\x02", "two or more rows"),
        ("3800,1\n7800,1\n", "if they are Å, write"),
        ("wavenumber cm-1,T\n13000,1\n26000,1\n", "convert it to nm"),
        ("Frequency (Hz),P\n4e14,1\n7e14,1\n", "given over Hz"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>", "without a document type"),
        ("<a><SpectralDistribution><SpectralData wavelength='x'>1</SpectralData></SpectralDistribution></a>", "no num"),
    ],
)
def test_what_is_no_spectrum(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "lamp.csv"
    file.write_text(text)
    with pytest.raises(UserError) as caught:
        sp.from_csv(f"{file}:c" if "'c'" in message else file)
    assert str(file) in str(caught.value) and message in str(caught.value)
    with pytest.raises(UserError, match="No such file"):
        sp.from_csv(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("text", "at_500", "note"),
    [
        ("400,0.2\n500,0.4\n700,0.8\n", 0.4, None),
        ("nm,%R\n400,0.2\n500,0.4\n700,0.8\n", 0.004, "per cent"),
        ("400,20\n500,40\n700,80\n", 0.4, "per cent"),
        ("400,-0.01\n500,0.4\n700,1.01\n", 0.4, "noise"),
        ("nm,Abs\n400,2\n500,1\n700,0.3\n", 0.1, "absorbance"),
        ("nm,R\n480,0.4\n560,0.4\n", 0.4, "reaches from 480 to 560 nm; beyond, the reflectance at its ends is used"),
    ],
)
def test_shares_of_light(tmp_path: Path, text: str, at_500: float, note: str | None) -> None:
    (tmp_path / "paint.csv").write_text(text)
    scene = made(tmp_path, {"kind": "diffuse", "reflectance": {"csv": "paint.csv"}})
    assert scene.objects[0].material.reflectance[120] == pytest.approx(at_500)
    assert any(note in each for each in scene.notes) if note else not any("paint.csv" in each for each in scene.notes)
    tinted = {"n_d": 1.5, "absorption": {"csv": "paint.csv", "distance": 2.0}}
    through = made(tmp_path, tinted)
    assert through.objects[0].material.absorption.coefficient[120] == pytest.approx(-np.log(at_500) / 2.0)
    (tmp_path / "paint.csv").write_text("nm,alpha (1/cm)\n400,0.2\n700,0.1\n")
    with pytest.raises(UserError, match="is no transmittance"):
        made(tmp_path, tinted)


def made(folder: Path, material: dict | str):
    key = "glass" if isinstance(material, str) else "material"
    return scene_of({"objects": [{"shape": "sphere", key: material}]}, folder / "a.toml")


# ---- indices ------------------------------------------------------------------------------

BK7 = catalogue.find("N-BK7")
LAMBDA = np.array([0.4, 0.5, 0.5875618, 0.7])
SELLMEIER = "1.03961212 0.00600069867 0.231792344 0.0200179144 1.01046945 103.560653"
KNOTS = np.arange(360.0, 810.0, 20.0)
N_ROWS = each("{x},{y}\n", x=KNOTS * 1e-3, y=BK7.index(KNOTS))
AGF = f"CC own\nNM MYGLASS 2 517642 1.5168 64.17 0 1\nCD {SELLMEIER} 0 0\nLD 0.3 2.5\n"
YAML = f"REFERENCES: own\nDATA:\n  - type: formula 2\n    wavelength_range: 0.3 2.5\n    coefficients: 0 {SELLMEIER}\n"
TABLE = "DATA:\n  - type: tabulated KIND\n    data: |\n"
TABLE += each("      {x} {y}\n", x=KNOTS * 1e-3, y=BK7.index(KNOTS))
IN_NM = {"B": [1.03961212, 0.231792344, 1.01046945], "C": [6000.69867, 20017.9144, 103560653.0]}
METAL = "wl,n\n0.38,1.64\n0.78,0.15\nwl,k\n0.38,1.95\n0.78,4.8\n"


@pytest.mark.parametrize(
    ("name", "text", "material", "note"),
    [
        ("n.csv", "wl,n\n" + N_ROWS, "n.csv", "look like µm"),
        ("n.csv", "wl,n\n" + N_ROWS + "\nwl,k\n0.36,1e-7\n0.9,1e-7\n", {"csv": "n.csv"}, "absorption (k up to 1e-07)"),
        ("n.csv", "wl (um),a,b\n" + N_ROWS.replace("\n", ",3\n"), "n.csv:a", None),
        ("n.yml", YAML, "n.yml", None),
        ("n.yml", TABLE.replace("KIND", "n"), {"csv": "n.yml"}, None),
        ("n.yaml", re.sub(r"(0\.\d+ \S+)", r"\1 1e-8", TABLE).replace("KIND", "nk"), "n.yaml", "absorption"),
        ("own.agf", AGF, "own.agf:MyGlass", None),
        ("own.agf", AGF, "own.agf", None),
        ("own.agf", AGF + AGF.replace("MYGLASS", "OTHER").replace("1.03", "1.3"), "myglass", None),
        ("OWN.AGF", AGF.encode("utf-16"), {"csv": "OWN.AGF:MYGLASS"}, None),
        ("own.agf", AGF.replace("1.5168", "1.6"), "own.agf", "its line NM says 1.6"),
        ("none", "", {"cauchy": [1.5046, 4200.0]}, "look like nm²"),
        ("none", "", {"sellmeier": IN_NM}, "nm²"),
    ],
)
def test_indices(tmp_path: Path, name: str, text: str | bytes, material: dict | str, note: str | None) -> None:
    (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    scene = made(tmp_path, material)
    found = scene.objects[0].material.dispersion
    tolerance = 1e-3 if "cauchy" in material else 2e-6
    assert found.index(LAMBDA * 1e3) == pytest.approx(BK7.index(LAMBDA * 1e3), abs=tolerance)
    assert any(note in each for each in scene.notes) if note else not any(name in each for each in scene.notes)


@pytest.mark.parametrize(
    ("name", "text", "material", "message"),
    [
        ("own.agf", AGF + AGF.replace("MYGLASS", "OTHER"), "own.agf", 'which glass ("own.agf:NAME"); it holds 2: MYG'),
        ("own.agf", AGF, "own.agf:MYGLAS", "has no glass 'MYGLAS', did you mean 'MYGLASS'?"),
        ("own.agf", AGF.replace(" 2 517642", " 14 517642"), "own.agf", "dispersion formula 14; known are 1 to 13"),
        ("own.agf", AGF.replace("1.0396", "one"), "own.agf", "no number"),
        ("own.agf", AGF, "own.agv:MYGLASS", "unknown glass"),
        ("own.agf", AGF, "none.agf:MYGLASS", "is not a file"),
        ("own.agf", AGF.replace("CD ", "CC "), "own.agf", "has no coefficients"),
        ("n.yml", "a: [", "n.yml", "not whole YAML"),
        ("n.yml", "DATA: 3", "n.yml", "no table or formula of n"),
        ("n.csv", "wl,a,b\n0.4,1,2\n0.7,1,2\n", "n.csv", "holds 'a', 'b'; name the one that is n"),
        ("n.csv", METAL, "n.csv", 'kind = "mirror", reflectance = [0.9'),
        ("none", "", {"cauchy": [1.5, 4.2e5]}, "check the units"),
        ("none", "", {"table": [[0.4, 1.53], [0.7, 1.51]]}, "look like µm"),
        ("none", "", {"n_d": 1.5, "absorption": {"nm": [0.4, 0.7], "coefficient": [1, 1]}}, "look like µm"),
    ],
)
def test_what_is_no_index(tmp_path: Path, name: str, text: str, material: dict | str, message: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(UserError) as caught:
        made(tmp_path, material)
    assert message in str(caught.value) and "a.toml" in str(caught.value)


def test_catalogues_among_the_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPECTRASPLAT_CONFIG", str(tmp_path / "settings"))
    (tmp_path / "settings" / "glass").mkdir(parents=True)
    (tmp_path / "settings" / "glass" / "mine.agf").write_text(AGF + AGF.replace("MYGLASS", "N-SF11"))
    assert made(tmp_path, "MYGLASS").objects[0].material.dispersion.n_d == pytest.approx(1.5168, abs=1e-5)
    shipped = made(tmp_path, "N-SF11").objects[0].material.dispersion
    assert shipped == catalogue.find("N-SF11")  # the program's own goes first


W = LAMBDA
L = 1.0 / (W**2 - 0.028)
K = (1.04, 0.006, 0.23, 0.02, 1.01, 104.0, 0.1, 0.01, 0.05, 0.03)
S = (2.27, -0.01, 0.0106, 1.9e-4, -6e-6, 3e-7, 1e-9, 1e-10, 1e-11, 0.0)
CONRADY = (1.49, 0.012, 3e-4)


def series(*powers: float) -> np.ndarray:
    return np.sqrt(sum(c * W**p for c, p in zip(S, (0.0, *powers), strict=False)))


def poles(count: int) -> np.ndarray:
    return np.sqrt(1.0 + sum(K[i] * W**2 / (W**2 - K[i + 1]) for i in range(0, 2 * count, 2)))


@pytest.mark.parametrize(
    ("number", "c", "expected"),
    [  # OpticStudio's help, "The Glass Dispersion Formulas"
        (1, S[:6], series(2, -2, -4, -6, -8)),
        (2, K[:6], poles(3)),
        (3, S, S[0] + S[1] * L + S[2] * L**2 + S[3] * W**2 + S[4] * W**4 + S[5] * W**6),
        (4, (0.2, 1.0, 0.1, 0.05, 0.15), np.sqrt(1.2 + W**2 / (W**2 - 0.01) + 0.05 / (W**2 - 0.0225))),
        (5, CONRADY, CONRADY[0] + CONRADY[1] / W + CONRADY[2] / W**3.5),
        (7, (2.25, 0.011, 0.01, 0.009), np.sqrt(2.25 + 0.011 / (W**2 - 0.01) - 0.009 * W**2)),
        (8, (1.3, 0.98, 0.01, 0.009), np.sqrt(1.3 + 0.98 * W**2 / (W**2 - 0.01) - 0.009 * W**2)),
        (9, (1.2, 1.0, 0.01, 0.9, 90.0), np.sqrt(1.2 + W**2 / (W**2 - 0.01) + 0.9 * W**2 / (W**2 - 90.0))),
        (6, K[:8], poles(4)),
        (10, S[:8], series(2, -2, -4, -6, -8, -10, -12)),
        (11, K, poles(5)),
        (12, S[:8], series(2, -2, -4, -6, -8, 4, 6)),
        (13, S[:9], series(2, 4, -2, -4, -6, -8, -10, -12)),
    ],
)
def test_formulas_of_agf(tmp_path: Path, number: int, c: tuple[float, ...], expected: np.ndarray) -> None:
    (tmp_path / "a.agf").write_text(f"NM A {number} 0 0 0\nCD {' '.join(map(str, c))}\n")
    assert made(tmp_path, "a.agf").objects[0].material.dispersion.index(W * 1e3) == pytest.approx(expected, rel=1e-12)
