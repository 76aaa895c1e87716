"""Lens prescriptions and their figures: published lenses, textbook formulas, solids, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import spectrasplat as ss
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir, shipped_scenes
from spectrasplat.model.io.prescription_file import read_prescription
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.lens_scene import lens_in
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.optics.lens_design import LINES_NM, lens_table, paraxial, traced

LENSES = assets_dir() / "lenses"
HEAD = "radius, thickness, glass, semi_diameter\n"
DOUBLET = HEAD + "7.3895, 1.05, 1.517, 2.2\n-5.1784, 0.40, 1.649, 2.2\n-16.2225, , , 2.2\n"
ZEMAX = """VERS 140124
UNIT MM X W X CM MR CPMM
ENPD 1.0E+1
FTYP 0 0 3 3 0 0 0
GCAT SCHOTT MISC
WAVM 1 0.48 1
WAVM 2 0.55 1
WAVM 3 0.65 1
WAVM 4 0.55 1
PWAV 2
SURF 0
  TYPE STANDARD
  DISZ INFINITY
SURF 1
  TYPE STANDARD
  CURV 0.02 0 0 0 0 ""
  DISZ 4
  GLAS N-BK7 0 0 1.5 40 0 0 0 0 0 0
  DIAM 6 1 0 0 1 ""
SURF 2
  STOP
  TYPE STANDARD
  CURV 0.0
  CONI 0.0
  DISZ 98
  DIAM 6 1 0 0 1 ""
SURF 3
  TYPE STANDARD
  CURV 0.0
  DISZ 0
"""


def written(tmp_path: Path, text: str, name: str = "lens.csv", encoding: str = "utf-8") -> Path:
    path = tmp_path / name
    path.write_text(text, encoding=encoding)
    return path


def matrices(path: Path, nm: float) -> tuple[float, float]:
    """Focal length and back focal length by the product of ray matrices, written down anew from the rows of a file."""
    rows = [line.split(",") for line in path.read_text().splitlines() if line[:1].isdigit()]
    system, before = np.eye(2), 1.0
    for row in rows:
        _, radius, thickness, glass = (cell.strip() for cell in row[:4])
        after = float(find(glass).index(nm)) if glass else 1.0
        system = np.array([[1.0, 0.0], [-(after - before) / (float(radius) * after), before / after]]) @ system
        if row is not rows[-1]:
            system = np.array([[1.0, float(thickness)], [0.0, 1.0]]) @ system
        before = after
    return -1.0 / system[1, 0], -system[0, 0] / system[1, 0]


def test_a_textbook_doublet(tmp_path: Path) -> None:
    """Kingslake and Johnson, Lens Design Fundamentals (2010), §2.5: f' = 12.00, l' = 11.2858; a ray at height 2 comes
    to L' = 11.2939."""
    lens = read_prescription(written(tmp_path, DOUBLET))
    (focal,), (back,) = paraxial(lens, [587.56])
    assert (focal, back) == (pytest.approx(12.0, abs=2e-5), pytest.approx(11.2858, abs=6e-5))
    y, slope = traced(lens, np.array([2.0]), [587.56])
    assert -float(y[0, 0] / slope[0, 0]) == pytest.approx(11.2939, abs=1e-4)


def test_a_cooke_triplet_has_the_focal_length_it_is_sold_with() -> None:
    """50 mm, f/5; and every wavelength's focal lengths equal the product of ray matrices."""
    table = ss.lens_table(LENSES / "cooke_triplet.csv", beam=10.0, wavelengths_nm=(*LINES_NM, 550.0))
    assert table.rows[-1].focal_length == pytest.approx(50.0, abs=0.005)
    assert table.f_number == pytest.approx(5.0, abs=0.005)
    for row in table.rows:
        focal, back = matrices(LENSES / "cooke_triplet.csv", row.wavelength_nm)
        assert (row.focal_length, row.back_focus) == (pytest.approx(focal, rel=1e-6), pytest.approx(back, rel=1e-6))
    # Thin beams have no spherical aberration: what is left of the spot is the shift of the focus.
    thin = ss.lens_table(LENSES / "cooke_triplet.csv", beam=0.02)
    for row in thin.rows:
        assert row.best_shift == pytest.approx(row.shift, abs=1e-4)
        assert row.spot == pytest.approx(0.01 / math.sqrt(2.0) * abs(row.shift) / row.focal_length, rel=2e-3, abs=1e-8)


def test_zemax_files_in_either_encoding(tmp_path: Path) -> None:
    for encoding in ("utf-8", "utf-16"):
        lens = read_prescription(written(tmp_path, ZEMAX, f"{encoding}.zmx", encoding))
        table = lens_table(lens)
        assert (lens.units, lens.reference_nm, table.beam_radius) == ("mm", 550.0, 5.0)
        assert lens.wavelengths_nm == (480.0, 550.0, 650.0)
        assert table.focal_length == pytest.approx(50.0 / (float(find("N-BK7").index(550.0)) - 1.0), rel=1e-9)
    lens = read_prescription(written(tmp_path, ZEMAX.replace("ENPD 1.0E+1", "FNUM 20 0"), "f.zmx"))
    assert lens_table(lens).f_number == pytest.approx(20.0)


@pytest.mark.parametrize(
    "spelt, found",
    [
        ("NBK7", "Schott N-BK7"),
        ("N-BK7_SCHOTT", "Schott N-BK7"),
        ("SK5", "Schott N-SK5"),
        ("F_SILICA", "fused silica"),
        ("POLYCARB", "polycarbonate"),
    ],
)
def test_vendors_spellings(tmp_path: Path, spelt: str, found: str) -> None:
    lens = read_prescription(written(tmp_path, ZEMAX.replace("N-BK7", spelt), "lens.zmx"))
    assert lens.surfaces[0].glass is not None and lens.surfaces[0].glass.name == found
    assert any("was taken for it" in note for note in lens.notes) is (spelt == "SK5")


def test_a_file_is_opened_as_solids_and_gives_its_figures_back(tmp_path: Path) -> None:
    path = written(tmp_path, DOUBLET.replace("2.2\n-5", "2.4\n-5"))
    scene = load_scene(path)
    crown, flint, screen = scene.objects
    shared = set(map(tuple, crown.mesh.vertices)) & set(map(tuple, flint.mesh.vertices))
    assert len(shared) > 1000 and screen.material.receives
    lens, table = lens_in(scene), lens_table(read_prescription(path))
    assert screen.object_to_world[0, 3] == pytest.approx(1.45 + table.back_focus)
    again = lens_table(lens, beam_radius=table.beam_radius)
    assert again.back_focus == pytest.approx(table.back_focus, rel=1e-12)
    assert [row.spot for row in again.rows] == pytest.approx([row.spot for row in table.rows], rel=1e-9)
    # From the other side it is another lens, with the same focal length.
    turned = ss.load(path)
    turned.lights["beam"].update(direction=(-1.0, 0.0, 0.0))
    other = ss.lens_table(turned)
    assert other.focal_length == pytest.approx(table.focal_length, rel=1e-12) and other.back_focus > table.back_focus


def test_a_stretched_lens_is_measured_across_its_stretch() -> None:
    achromat, singlet = (ss.lens_table("achromat", name) for name in ("flint", "singlet"))
    assert singlet.focal_length == pytest.approx(1.3021 / (find("F2").n_d - 1.0), rel=1e-9)
    assert not singlet.lens.is_round
    shifts = [abs(table.rows[0].shift - table.rows[-1].shift) for table in (achromat, singlet)]
    assert shifts[0] < 0.05 * shifts[1]


def test_faces_that_meet_narrow_their_glass(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, HEAD + "10, 1, N-BK7, 2\n-10, , , 4\n"))
    assert scene.objects[0].mesh.recipe["diameter"] == pytest.approx(2.0 * math.sqrt(10.0**2 - 9.5**2), rel=2e-3)
    assert any("its faces" in note for note in scene.notes)


@pytest.mark.parametrize(
    "text, words",
    [
        ("a, b\n1, 2\n", "no surfaces follow a first row of column names"),
        (HEAD.replace("glass", "glas") + "1, 2, N-BK7, 1\n", "line 1: unknown column 'glas', did you mean 'glass'"),
        (HEAD.replace(", semi_diameter", "") + "1, 2, N-BK7\n", "line 1: give a column 'semi_diameter' or 'diameter'"),
        (HEAD + "9, 2, N-BK9, 1\n-9, 0, , 1\n", "line 2: glass: unknown glass 'N-BK9', did you mean"),
        (HEAD + "9, 2, N-BK7, 1\n", "line 2: glass 'N-BK7' has no surface behind it"),
        (HEAD + "9, 2, , 1\n", "no surface has a glass"),
        (HEAD + "0, 2, N-BK7, 1\n-9, 0, , 1\n", "line 2: radius is 0; a plane has radius inf"),
        (HEAD + "x, 2, N-BK7, 1\n-9, 0, , 1\n", "line 2: radius 'x' is no number; a plane has radius inf"),
        (HEAD + "9, -2, N-BK7, 1\n-9, 0, , 1\n", "line 2: thickness is -2"),
        (HEAD + "9, 2, N-BK7, 10\n-9, 0, , 1\n", "line 2: a surface of radius 9 does not reach a semi_diameter of 10"),
        (HEAD + "9, 2, N-BK7, 1\n-9, 0, MIRROR, 1\n9, 0, , 1\n", "line 3: mirrors cannot be drawn"),
    ],
)
def test_mistakes_in_tables_are_sentences(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(UserError, match=words.replace("(", r"\(")):
        load_scene(written(tmp_path, text))


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("TYPE STANDARD\n  CURV 0.02", "TYPE COORDBRK\n  CURV 0.02", "line 15: a surface of TYPE COORDBRK"),
        ("CONI 0.0", "PARM 2 1e-5", "line 24: aspheric terms"),
        ("CURV 0.02", "CURV x", "line 16: CURV gives no number"),
        ("SURF", "SRF", "holds no lens"),
    ],
)
def test_mistakes_in_zemax_files_are_sentences(tmp_path: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(UserError, match=words):
        read_prescription(written(tmp_path, ZEMAX.replace(old, new), "lens.zmx"))


def test_what_has_no_figures_is_refused() -> None:
    with pytest.raises(UserError, match='no glass of shape "lens"; add one'):
        lens_in(load_scene(shipped_scenes()["prism"]))
    with pytest.raises(UserError, match="called 'crwn', did you mean 'crown'"):
        ss.lens_table("achromat", "crwn")
    with pytest.raises(UserError, match="a beam of diameter 40 does not pass"):
        ss.lens_table(LENSES / "cooke_triplet.csv", beam=40.0)


def test_a_table_with_decimal_commas_and_units(tmp_path: Path) -> None:
    text = "Surface;Radius (mm);Thickness (mm);Glass;Diameter (mm)\n1;22,5;3,25;N-BK7;10\n2;-30,1;0;;10\n"
    lens = read_prescription(written(tmp_path, text))
    assert lens.units == "mm" and [s.radius for s in lens.surfaces] == [22.5, -30.1]
    assert (lens.surfaces[0].thickness, lens.surfaces[0].semi_diameter) == (3.25, 5.0)


def test_lengths_beyond_reason_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="line 2: a length is beyond 1e[+]09"):
        read_prescription(written(tmp_path, HEAD + "1e300, 1, N-BK7, 2\n-10, , , 2\n"))
