"""Refractive indices against published values, and that impossible data are refused by name."""

from __future__ import annotations

import math

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.model.optics import catalogue, glass
from spectrasplat.model.optics.glass import LINE_C_NM, LINE_D_NM, LINE_F_NM

pytestmark = pytest.mark.core

VISIBLE = np.arange(380.0, 780.5, 1.0)

# name, n_F, n_d, n_C, V_d, dn/dλ at d (1/µm); computed from the makers' coefficients in double precision
KNOWN = [
    ("N-BK7", 1.522376, 1.516800, 1.514322, 64.167, -0.041799),
    ("F2", 1.632081, 1.620040, 1.615032, 36.366, -0.086493),
    ("N-SF11", 1.806513, 1.784720, 1.775955, 25.680, -0.152878),
    ("diamond", 2.435538, 2.417486, 2.409906, 55.301, -0.131002),
    ("water", 1.337492, 1.333403, 1.331513, 55.760, -0.031340),
    ("fused silica", 1.463126, 1.458464, 1.456367, 67.821, -0.035215),
]


@pytest.mark.parametrize(("name", "n_f", "n_d", "n_c", "v_d", "slope"), KNOWN)
def test_known_glasses(name: str, n_f: float, n_d: float, n_c: float, v_d: float, slope: float) -> None:
    found = catalogue.find(name)
    assert found.index([LINE_F_NM, LINE_D_NM, LINE_C_NM]) == pytest.approx([n_f, n_d, n_c], abs=1e-6)
    assert found.n_d == pytest.approx(n_d, abs=1e-6)
    assert found.V_d == pytest.approx(v_d, abs=1e-3)
    assert found.derivative(LINE_D_NM) == pytest.approx(slope, abs=1e-6)
    assert found.is_dispersive


PEAK = (2.4, 0.02, 0.03, 0.01, 0.2, 0.03)


def _one_of_each_kind() -> list[glass.Dispersion]:
    kinds: dict[str, glass.Dispersion] = {}
    for entry in catalogue.entries():
        kinds.setdefault(entry.dispersion.kind, entry.dispersion)
    kinds["abbe"] = glass.from_abbe(1.6, 30.0)
    for number, c in ((7, (1.5, 0.01, 1e-4, -3e-3, 1e-5, 1e-6)), (8, (0.27, 0.02, 0.01, -1e-3)), (9, PEAK)):
        kinds[f"formula {number}"] = glass.from_formula(f"formula {number}", c)  # type: ignore[arg-type]
    return list(kinds.values())


def test_derivative_is_that_of_index_for_every_kind() -> None:
    """Central differences; their own error is h²n‴/6 ~ 1e-9, a wrong term is off by 1e-3."""
    kinds = _one_of_each_kind()
    assert {d.kind for d in kinds} == {*(f"formula {i}" for i in range(1, 10)), "abbe", "constant", "table"}
    wavelength = np.linspace(452.1, 628.7, 57)  # between the table's knots, inside every range
    for dispersion in kinds:
        h = 1e-3 if dispersion.kind == "table" else 0.02
        numeric = (dispersion.index(wavelength + h) - dispersion.index(wavelength - h)) / (2e-3 * h)
        assert dispersion.derivative(wavelength) == pytest.approx(numeric, abs=3e-7), dispersion.name


def test_formulas_8_and_9_by_their_definitions() -> None:
    um, (a, b, c, d, e, f) = np.array([0.45, 0.6]), PEAK
    squares = a + b / (um**2 - c) + d * (um - e) / ((um - e) ** 2 + f)
    assert glass.from_formula("formula 9", PEAK).index(um * 1e3) == pytest.approx(np.sqrt(squares), rel=1e-12)
    squares = glass.from_formula("formula 8", (0.27, 0.02, 0.01, -1e-3)).index(um * 1e3) ** 2
    lorentz = 0.27 + 0.02 * um**2 / (um**2 - 0.01) - 1e-3 * um**2
    assert (squares - 1.0) / (squares + 2.0) == pytest.approx(lorentz, rel=1e-12)


def test_every_catalogue_entry_is_sound() -> None:
    """n is positive, finite and falls with wavelength; n_d is what optics can hold."""
    assert len(catalogue.entries()) > 1600
    for entry in catalogue.entries():
        dispersion = entry.dispersion
        n = dispersion.index(VISIBLE)
        assert np.all(np.isfinite(n)) and n.min() >= 1.0, entry.qualified_name
        assert np.all(np.diff(n) <= 0.0), entry.qualified_name
        assert 1.0 <= dispersion.n_d < 3.0, entry.qualified_name
        assert catalogue.find_entry(entry.qualified_name) is entry


def test_catalogue_agrees_with_makers_data_sheets() -> None:
    """n_d and V_d as the makers print them (five and two decimals)."""
    sheets = {
        "Schott N-SF66": (1.92286, 20.88),
        "Ohara S-BSL7": (1.51633, 64.14),
        "Hoya TAF1": (1.77250, 49.62),
        "CDGM H-K9L": (1.51680, 64.20),
        "Sumita K-BK7": (1.51633, 64.06),
        "Hikari J-BK7A": (1.51680, 64.13),
    }
    for name, (n_d, v_d) in sheets.items():
        found = catalogue.find(name)
        assert (found.n_d, found.V_d) == (pytest.approx(n_d, abs=1e-5), pytest.approx(v_d, abs=0.02)), name


def test_lookup_spellings_and_maker_order() -> None:
    same = ["N-BK7", "nbk7", "Schott N-BK7", "SCHOTT:N-BK7", "n bk7", "BK7"]
    assert {catalogue.find_entry(name).qualified_name for name in same} == {"Schott N-BK7"}
    assert catalogue.find_entry("F2").maker == "Schott"
    assert catalogue.find_entry("hikari:F2").maker == "Hikari"
    assert catalogue.find_entry("sapphire").name == "sapphire (ordinary)"
    with pytest.raises(UserError, match=r"scene.toml: material: unknown glass 'N-BK8', did you mean .*'Schott N-BK7'"):
        catalogue.find("N-BK8", "scene.toml: material")
    for name, guess in {
        "amathyst": "amethyst",
        "zirkon": "zircon",
        "§§§": None,
        "kryptonite": None,
        "pearl": None,
    }.items():
        with pytest.raises(UserError) as caught:
            catalogue.find(name)
        hint = f", did you mean '{guess}'?" if guess else "; 'spectrasplat glass' lists all"
        assert str(caught.value) == f"unknown glass '{name}'{hint}"


def test_gems_have_the_published_dispersion() -> None:
    """n_G − n_B of gem tables: of formulas to their last digit, of those made from these numbers exactly."""
    formulas = {"diamond": 44, "ruby": 18, "citrine": 13, "spinel": 20, "YAG": 28, "cubic zirconia": 60, "fluorite": 7}
    made = {"emerald": 14, "aquamarine": 14, "topaz": 14, "almandine": 27, "pyrope": 22, "spessartine": 27, "opal": 0}
    made |= {"tsavorite": 28, "demantoid": 57, "tourmaline": 17, "peridot": 20, "zircon": 39, "sphene": 51}
    for name, thousandths in (formulas | made).items():
        found = catalogue.find(name)
        spread = 1e3 * float(found.index(430.8) - found.index(686.7))
        assert spread == pytest.approx(thousandths, abs=0.001 if name in made else 1.0), name
    assert catalogue.find("lead crystal").n_d > 1.545 and "no dispersion" in catalogue.find_entry("jade").note


def test_an_index_is_a_glass_with_the_dispersion_of_its_abbe_number(tmp_path) -> None:  # type: ignore[no-untyped-def]
    from spectrasplat.model.optics.index_file import find_glass

    plain, given = (find_glass(name, tmp_path, "glass", []) for name in ("1.54", "1.5168/64.17"))
    assert plain.index(LINE_F_NM) == plain.index(LINE_C_NM) == 1.54
    assert given.n_d == pytest.approx(1.5168) and given.V_d == pytest.approx(64.17, rel=1e-3)
    with pytest.raises(UserError, match="glass"):
        find_glass("1.54 a", tmp_path, "glass", [])


def test_search_ranks_exact_then_prefix() -> None:
    found = catalogue.search("n-sf6")
    assert found[0].qualified_name == "Schott N-SF6"
    assert found[1].name.startswith("N-SF6")
    assert all("sf6" in catalogue.search_key(e.maker + e.name) for e in found)
    assert next(e.name for e in catalogue.search("diamnod")) == "diamond"
    assert {e.maker for e in catalogue.search("hoya fcd")} == {"Hoya"}
    assert len(catalogue.search()) == len(catalogue.entries())


def test_clamping_to_the_fit_range() -> None:
    diamond = catalogue.find("diamond")
    assert diamond.index(775.0) == diamond.index(760.0)
    assert diamond.derivative(775.0) == 0.0 and diamond.derivative(759.0) < -0.01
    assert "above 760 nm" in (diamond.clamps_visible() or "")
    assert catalogue.find("N-BK7").clamps_visible() is None
    assert catalogue.find("ice").clamps_visible() is not None


def test_shapes_follow_the_input() -> None:
    for dispersion in _one_of_each_kind():
        assert dispersion.index(550.0).shape == () and dispersion.index(np.full((2, 3), 550.0)).shape == (2, 3)
        assert dispersion.index(np.float32(550.0)).dtype == np.float64
        assert dispersion.derivative(np.full((2, 3), 550.0)).shape == (2, 3)


def test_abbe_model_is_khr_dispersion() -> None:
    model = glass.from_abbe(1.5168, 64.17)
    expected = 1.5168 + 0.5168 / 64.17 * (523655.0 / 450.0**2 - 1.5168)
    assert model.index(450.0) == pytest.approx(expected, abs=1e-12)
    assert model.V_d == pytest.approx(64.17, abs=2e-3)
    assert glass.from_abbe(1.5).V_d == math.inf and not glass.from_abbe(1.5).is_dispersive
    assert glass.from_abbe(1.2, 0.5).index(780.0) == 1.0  # the extension's floor
    anomalous = glass.from_abbe(1.5, -40.0)
    assert anomalous.derivative(550.0) > 0.0 and any("anomalous" in note for note in anomalous.notes())


def test_coefficients_tables_and_cauchy_agree() -> None:
    """N-BK7 from its coefficients, and from a table of it every 20 nm, is N-BK7."""
    real = catalogue.find("N-BK7")
    own = glass.sellmeier([1.03961212, 0.231792344, 1.01046945], [0.00600069867, 0.0200179144, 103.560653])
    assert own.index(VISIBLE) == pytest.approx(real.index(VISIBLE), abs=1e-15)
    knots = np.arange(380.0, 781.0, 20.0)
    tabled = glass.table(knots, real.index(knots))
    assert tabled.index(VISIBLE) == pytest.approx(real.index(VISIBLE), abs=1e-6)
    assert tabled.derivative(VISIBLE) == pytest.approx(real.derivative(VISIBLE), abs=2e-4)
    cauchy = glass.cauchy([1.5, 0.004, 1e-5])
    assert cauchy.index(500.0) == pytest.approx(1.5 + 0.004 / 0.25 + 1e-5 / 0.0625, abs=1e-15)
    two = glass.table([400.0, 700.0], [1.53, 1.51])
    assert two.index(390.0) == 1.53 and 1.51 < two.index(550.0) < 1.53


def test_table_is_pchip_in_inverse_square_wavelength() -> None:
    from scipy.interpolate import PchipInterpolator

    wavelength = np.array([380.0, 395.0, 450.0, 452.0, 560.0, 700.0, 780.0])
    n = np.array([1.56, 1.55, 1.53, 1.531, 1.52, 1.519, 1.515])
    reference = PchipInterpolator(wavelength[::-1] ** -2.0, n[::-1])
    assert glass.table(wavelength, n).index(VISIBLE) == pytest.approx(reference(VISIBLE**-2.0), abs=1e-13)


def test_notes_say_index_below_one() -> None:
    assert any("below 1" in note for note in glass.constant(0.9, "bubble").notes())
    assert catalogue.find("N-BK7").notes() == []


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda w: glass.constant(0.0, where=w), "index is 0 at 380 nm"),
        (lambda w: glass.constant(-1.5, where=w), "index is -1.5"),
        (lambda w: glass.constant(math.nan, where=w), "not a finite number"),
        (lambda w: glass.from_abbe(1.5, 0.0, where=w), "V_d is 0"),
        (lambda w: glass.from_abbe(1.5, math.nan, where=w), "V_d is nan"),
        (lambda w: glass.from_abbe(math.inf, 50.0, where=w), "not a finite number"),
        (lambda w: glass.sellmeier([1.0, math.inf], [0.01, 0.02], where=w), "not a finite number"),
        (lambda w: glass.sellmeier([1.0], [0.01, 0.02], where=w), "as many C as B"),
        (lambda w: glass.sellmeier([], [], where=w), "at least one"),
        (lambda w: glass.sellmeier([1.0], [0.25], where=w), "pole at 500 nm"),
        (lambda w: glass.sellmeier([-3.0], [0.01], where=w), "imaginary or infinite at 380 nm"),
        (lambda w: glass.sellmeier([1.0], [0.01], range_nm=(900.0, 2000.0), where=w), "outside the visible range"),
        (lambda w: glass.sellmeier([1.0], [0.01], range_nm=(700.0, 400.0), where=w), "range 700 to 400 nm is empty"),
        (lambda w: glass.cauchy([], where=w), "at least the coefficient A"),
        (lambda w: glass.cauchy([1.2, -0.5], where=w), "at 380 nm; from 380 to 780 nm it must be a positive number"),
        (lambda w: glass.table([], [], where=w), "two or more wavelengths"),
        (lambda w: glass.table([400.0, 500.0], [1.5], where=w), "got 2 and 1"),
        (lambda w: glass.table([500.0, 400.0], [1.5, 1.6], where=w), "400 follows 500"),
        (lambda w: glass.table([400.0, 400.0], [1.5, 1.6], where=w), "must ascend"),
        (lambda w: glass.table([400.0, 500.0], [1.5, math.nan], where=w), "n = nan at 500 nm"),
        (lambda w: glass.table([400.0, 500.0], [1.5, 0.0], where=w), "n = 0 at 500 nm"),
        (lambda w: glass.table([0.0, 500.0], [1.5, 1.5], where=w), "not a positive number"),
        (lambda w: glass.from_formula("formula 3", [2.0, 1.0], where=w), "does not take 2 coefficients"),
        (lambda w: glass.from_formula("formula 10", [2.0], where=w), "unknown dispersion formula"),  # type: ignore[arg-type]
    ],
)
def test_impossible_data_are_refused_by_key(make, message: str) -> None:
    with pytest.raises(UserError) as caught:
        make("s.toml: materials.prism")
    assert str(caught.value).startswith("s.toml: materials.prism: ") and message in str(caught.value)
    assert "\n" not in str(caught.value)


# -- gain of the dispersion -----------------------------------------------------------------


def test_a_gain_scales_n_about_the_d_line_and_is_told() -> None:
    plain = catalogue.find("N-SF11")
    strong = glass.with_gain(plain, 3.0)
    nm = np.linspace(380.0, 780.0, 101)
    np.testing.assert_allclose(strong.index(nm) - plain.n_d, 3.0 * (plain.index(nm) - plain.n_d), rtol=1e-12)
    np.testing.assert_allclose(strong.derivative(nm), 3.0 * plain.derivative(nm), rtol=1e-14)
    assert strong.n_d == plain.n_d and strong.V_d == pytest.approx(plain.V_d / 3.0)
    assert strong != plain and glass.with_gain(strong, 1.0) == plain
    assert "3 (n" in strong.formula_text() and "3 (n" not in plain.formula_text()
    assert any("3 times" in note for note in strong.notes()) and plain.notes() == []
    assert not glass.with_gain(plain, 0.0).is_dispersive


@pytest.mark.parametrize("gain", [-1.0, math.nan, math.inf, 1e4])
def test_an_impossible_gain_is_refused(gain: float) -> None:
    with pytest.raises(UserError, match="block: "):
        glass.with_gain(catalogue.find("N-SF11"), gain, "block")
