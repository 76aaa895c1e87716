"""How grooves share light out among orders: closed forms, their sums, where blazed gratings are bright, keys."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.edit.objects import set_material
from spectrasplat.model.materials import Grating
from spectrasplat.model.optics.gratings import facet_angle
from spectrasplat.reference import gratings as reference

from tests.unit.test_material_settings import GRATING, read, shipped

EVERY = tuple(range(-50, 51))
DOWN = np.array([0.0, 0.0, -1.0])


def grating(lines: float, profile: str, orders: tuple[int, ...] = EVERY, **more) -> Grating:
    return Grating(lines, orders, (1.0,) * len(orders), profile=profile, **more)


def directions(count: int, seed: int = 5) -> np.ndarray:
    found = np.random.default_rng(seed).normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1)[:, None]


@pytest.mark.parametrize("reflects", [False, True])
@pytest.mark.parametrize(
    "profile", [{"profile": "blazed"}, {"profile": "lamellar"}, {"profile": "sinusoidal", "depth_nm": 700.0}]
)
def test_all_orders_together_have_all_light(profile: dict, reflects: bool) -> None:
    """At every wavelength and angle, from both sides; a few orders have less."""
    light, nm = directions(400), np.random.default_rng(1).uniform(380.0, 780.0, 400)
    shares = grating(600.0, reflects=reflects, **profile).shares(nm, light)
    assert (shares >= 0.0).all() and shares.sum(axis=0).max() <= 1.0 + 1e-12
    # Beyond order 50 steep walls leave 8/(π² 50) or less.
    assert shares.sum(axis=0).min() > (1.0 - 1e-12 if "depth_nm" in profile else 0.99)


@pytest.mark.parametrize(("lines", "blaze"), [(300.0, 500.0), (600.0, 1000.0), (1200.0, 500.0), (79.0, 20_000.0)])
def test_order_m_is_brightest_at_the_mth_part_of_the_blaze(lines: float, blaze: float) -> None:
    """In Littrow's mounting, where light goes back along the facets' normal: all of it, and nothing in other orders."""
    found = grating(lines, "blazed", reflects=True, blaze_nm=blaze)
    angle = np.arcsin(0.5e-6 * blaze * lines)
    back = -np.array([np.sin(angle), 0.0, np.cos(angle)])
    for order in (1, 2, 5, 40):
        shares = dict(zip(EVERY, found.shares(np.array(blaze / order), back), strict=True))
        assert shares[order] == pytest.approx(1.0, abs=1e-12)
        assert max(shares[other] for other in EVERY if other != order) < 1e-20
    nm = np.linspace(0.5 * blaze, 2.0 * blaze, 31)
    assert found.shares(nm, back)[51] == pytest.approx(np.sinc(1.0 - blaze / nm) ** 2, abs=1e-12)


@pytest.mark.parametrize("reflects", [False, True])
def test_the_facets_bend_and_mirror_what_order_1_gets(reflects: bool) -> None:
    """Snell's law, or the mirror's, at the facet alone: order 1 has all light of the wavelength that it leads there."""
    found = grating(600.0, "blazed", reflects=reflects, blaze_nm=480.0)
    tilt, rng = found.relief, np.random.default_rng(2)
    for sine in rng.uniform(-0.5, 0.3, 20):
        if reflects:
            leaves = np.sin(2.0 * tilt + np.arcsin(sine))
        else:
            inside = np.arcsin(sine / 1.5)
            leaves = np.sin(np.arcsin(1.5 * np.sin(tilt + inside)) - tilt)
        # Light that comes with part `sine` across the lines leaves with the part `leaves`.
        change = leaves - sine
        nm = abs(change) * 1e6 / 600.0
        light = np.array([sine, 0.0, -np.sqrt(1.0 - sine * sine)])
        order = 51 if change > 0.0 else 49
        assert found.shares(np.array(nm), light)[order] == pytest.approx(1.0, abs=1e-9)


def test_grooves_of_steps_and_waves() -> None:
    """Depth of half a wave: no light goes straight on, orders ±1 of steps have 4/π² each; a wave's first is J₁²."""
    half = grating(300.0, "lamellar", depth_nm=550.0, groove_index=1.5)
    shares = dict(zip(EVERY, half.shares(np.array(550.0), DOWN), strict=True))
    assert shares[0] == pytest.approx(0.0, abs=1e-12) and shares[2] == 0.0
    assert shares[1] == pytest.approx(4.0 / np.pi**2, abs=1e-12) == shares[-1]
    assert shares[3] == pytest.approx(4.0 / (9.0 * np.pi**2), abs=1e-12)
    # J₁ is greatest at 1.8412: the well-known 33.9 % of a thin sinusoidal phase grating.
    wave = grating(300.0, "sinusoidal", (-1, 0, 1), depth_nm=2.0 * 550.0 * 1.841184 / np.pi, groove_index=1.5)
    assert wave.shares(np.array(550.0), DOWN) == pytest.approx([0.338567, 0.099873, 0.338567], abs=1e-6)
    slits = grating(100.0, "slits", (-2, -1, 0, 1, 2), open=0.5)
    assert slits.fixed_shares == pytest.approx([0.0, 1.0 / np.pi**2, 0.25, 1.0 / np.pi**2, 0.0], abs=1e-12)


@pytest.mark.parametrize("profile", ["blazed", "lamellar", "sinusoidal"])
def test_the_reference_knows_the_same(profile: str) -> None:
    """By vectors and recurrences of its own, in air, in water and in glass denser than what is ruled."""
    rng, light = np.random.default_rng(9), directions(200, 8)
    lines, normal = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    for reflects in (False, True):
        for n in (1.0, 1.333, 1.9):
            found = grating(500.0, profile, (-3, -1, 0, 1, 2), reflects=reflects, blaze_nm=-600.0, depth_nm=800.0)
            for direction, nm in zip(light, rng.uniform(380.0, 780.0, len(light)), strict=True):
                want = found.shares(np.array(nm), direction, n)
                for k, order in enumerate(found.orders):
                    row = np.array([0.0, 1.0, order, 0.5, found.profile_code, found.relief, found.relief_index])
                    got = reference.order_share(row, tuple(direction), tuple(normal), tuple(lines), n, nm)
                    assert got == pytest.approx(want[k], abs=1e-10)


BLAZED = GRATING + 'profile = "blazed"\n'


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        (GRATING + 'profile = "blazd"', "did you mean 'blazed'"),
        (GRATING + "blaze_nm = 500", 'profile = "blazed"\' as well'),
        (GRATING + 'profile = "lamellar"\nblaze_nm = 500', 'profile = "blazed"\' as well'),
        (BLAZED + "depth_nm = 200", 'profile = "lamellar"\' as well'),
        (BLAZED + "blaze_nm = 500\nblaze_deg = 10", "cannot stand beside"),
        (BLAZED + "blaze_deg = 60", "so steep"),
        (GRATING + 'profile = "slits"\nopen = 0', "above 0"),
    ],
)
def test_bad_keys_get_a_sentence(keys: str, told: str) -> None:
    with pytest.raises(UserError, match="s.toml") as error:
        read(keys)
    assert told in str(error.value) and "\n" not in str(error.value)


def test_keys_and_the_way_back() -> None:
    from spectrasplat.model.io.toml_text import toml_text

    for keys in ("blaze_nm = 420", "blaze_deg = -12.5", "blaze_deg = 63\nreflects = true", "groove_index = 1.7"):
        found = read(BLAZED + keys)
        assert read(toml_text(found.values())) == found
    assert read(BLAZED + "blaze_deg = 17\nreflects = true").relief == pytest.approx(np.radians(17.0))
    assert read(BLAZED + "blaze_deg = -17").relief == pytest.approx(np.radians(-17.0))
    assert read(BLAZED + "efficiency = 0.8").efficiency == (0.8,) * 3


def test_a_slit_is_an_opening_of_its_width() -> None:
    from spectrasplat.model.io.toml_text import toml_text

    slit = read('kind = "slit"\nwidth_um = 25')
    assert slit.spread_per_um == pytest.approx(1.0 / 25.0) and slit.orders == (0,) and slit.efficiency == (1.0,)
    assert read(toml_text(slit.values())) == slit and slit.changed(width_um=50.0).spread_per_um == pytest.approx(0.02)
    assert not slit.is_like(Grating(orders=(0,), efficiency=(1.0,)))
    for keys, told in (
        ("width_um = 0.4", "depends on its edges"),
        ("width_um = -3", "above 0"),
        ("grooves = 3", "grooves"),
    ):
        with pytest.raises(UserError, match="s.toml") as error:
            read('kind = "slit"\n' + keys)
        assert told in str(error.value)
    assert read(GRATING + "grooves = 500").spread_per_um == pytest.approx(0.6 / 500.0)
    with pytest.raises(UserError, match="at least 0"):
        read(GRATING + "grooves = -1")


def test_a_blaze_beyond_the_lines_is_refused() -> None:
    spectrometer = shipped("spectrometer")
    assert np.isnan(facet_angle(1.5, 0.6, 1.5)) and np.isfinite(facet_angle(1.5, 0.6, 0.0))
    with pytest.raises(UserError, match="no facet sends 1500 nm into order 1"):
        set_material(spectrometer, 0, Grating(profile="blazed", blaze_nm=1500.0))
