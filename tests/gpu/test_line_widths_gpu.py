"""Slits and gratings of N lines: a line is λ / W wide, its profile sinc², resolving power m N, through the GPU's path
and the float64 reference.

Smallest error this can detect: 20,000 photons in bins of a tenth of a line's width know its profile to 0.02 of its
peak."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.gpu.context import Context
from spectrasplat.model.materials import Slit
from spectrasplat.model.optics.gratings import line_quantiles
from spectrasplat.model.scene import Camera, Grating
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.still import render
from spectrasplat.stress.rigs.camera_probe import white_furnace
from spectrasplat.stress.rigs.gpu_paths import placed as placed_at
from spectrasplat.stress.rigs.gpu_paths import screen, trace_beam

from tests.gpu.test_grating_gpu import sheet

COUNT = 20_000
DOWN = np.array([0.0, 0.0, -1.0])
SODIUM_NM = (588.995, 589.592)


def sines(gl: Context, material: Grating, nm: float, method: str = "srd", count: int = COUNT) -> np.ndarray:
    """Sines of the angles across the lines at which photons of a thin beam leave."""
    wall = screen(np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0]), 30.0)
    sheets = [placed_at("grating", screen(np.zeros(3), -DOWN, 0.5), material)]
    found = trace_beam(gl, sheets, None, wall, -0.1 * DOWN, DOWN, 1e-7, nm, count=count, method=method)
    offset = found.position[:, 0] - found.start[:, 0]
    return offset / np.hypot(1.0, offset)


def profile(places: np.ndarray, at: np.ndarray, width: float = 0.1) -> np.ndarray:
    """Density of `places` near each of `at`."""
    return np.array([(np.abs(places - x) < 0.5 * width).mean() / width for x in at])


@pytest.mark.parametrize("method", ["srd", "hero", "regular-point"])
def test_a_slits_minima_and_maxima(gl: Context, method: str) -> None:
    """Light of two wavelengths behind 20 µm: minima at m λ/w, the principal maximum twice as wide as the others, and
    nine tenths of all light in it."""
    for nm in (450.0, 650.0):
        places = sines(gl, Slit(width_um=20.0), nm, method) * 20.0 / (nm * 1e-3)
        assert len(places) > 0.7 * COUNT
        at = np.arange(-3.0, 3.01, 0.25)
        assert np.abs(profile(places, at) - np.sinc(at) ** 2).max() < 0.03
        assert profile(places, np.array([-2.0, -1.0, 1.0, 2.0])).max() < 6e-3
        # What would leave beyond 90° is gone.
        gone = nm * 1e-3 / (20.0 * np.pi**2)
        assert (np.abs(places) < 1.0).mean() == pytest.approx(0.90282 / (1.0 - gone), abs=2e-3)
        assert (np.abs(places) > 10.0).mean() == pytest.approx(1.0 / (10.0 * np.pi**2) - gone, abs=1e-3)


def two_lines(gl: Context, nm: tuple[float, float], grooves: float, order: int = 1) -> np.ndarray:
    """Where light of both lines goes, in widths of a line from the middle between them."""
    grating = Grating(600.0, (order,), (1.0,), grooves=grooves)
    width = 1e-3 * np.mean(nm) * 0.6 / grooves
    both = [sines(gl, grating, one) for one in nm]
    middle = order * np.mean(nm) * 6e-4
    return (np.concatenate(both) - middle) / width


def dip(places: np.ndarray, apart: float) -> float:
    """Brightness midway between two lines, over that at either."""
    seen = profile(places, np.array([-0.5 * apart, 0.0, 0.5 * apart]), 0.2)
    return float(2.0 * seen[1] / (seen[0] + seen[2]))


@pytest.mark.parametrize(("order", "grooves"), [(1, 500.0), (2, 250.0), (-1, 2000.0)])
def test_two_lines_that_differ_by_a_part_in_m_n_are_just_resolved(gl: Context, order: int, grooves: float) -> None:
    """Rayleigh's criterion: one's maximum is on the other's minimum, and between them lies 8/π² of either."""
    nm = 550.0
    apart = nm / (abs(order) * grooves)
    places = two_lines(gl, (nm - 0.5 * apart, nm + 0.5 * apart), grooves, order)
    assert dip(places, 1.0) == pytest.approx(8.0 / np.pi**2, abs=0.03)


def test_the_sodium_lines(gl: Context) -> None:
    """589.3 / 0.597 = 987 lines in first order are just enough; 2000 part them, 400 show one line."""
    apart = {n: n * (SODIUM_NM[1] - SODIUM_NM[0]) / np.mean(SODIUM_NM) for n in (400.0, 987.0, 2000.0)}
    dips = {n: dip(two_lines(gl, SODIUM_NM, n), apart[n]) for n in apart}
    assert dips[987.0] == pytest.approx(8.0 / np.pi**2, abs=0.03)
    assert dips[2000.0] < 0.05 and dips[400.0] > 1.05


def test_two_slits_make_youngs_fringes(gl: Context) -> None:
    """All orders of a grating of N lines, each with its width, are together the interference of N waves, to a sum:
    sin²(πNs) / (N² sin²(πs)). Of two lines 50 µm apart: cos²."""
    grating = Grating(20.0, tuple(range(-10, 11)), (1.0 / 21.0,) * 21, grooves=2.0)
    places = sines(gl, grating, 500.0, count=500) * 50.0 / 0.5
    places = places[np.abs(places) < 8.5]
    seen, edges = np.histogram(places - np.rint(places), bins=10, range=(-0.5, 0.5), density=True)
    # The mean of 2 cos² over each bin.
    want = 1.0 + np.diff(np.sin(2.0 * np.pi * edges)) / (0.2 * np.pi)
    assert len(places) > 4000 and np.abs(seen - want).max() < 0.15


@pytest.mark.parametrize("grooves", [1.0, 10.0, 1e4, 1e6])
def test_from_one_groove_to_a_million(gl: Context, grooves: float) -> None:
    """Half of the light within 0.2619 λ/W, as far as single precision knows a sine; what would leave beyond the horizon
    is counted as absorbed."""
    nm, grating = 550.0, Grating(300.0, (1,), (1.0,), grooves=grooves)
    wall = screen(np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0]), 30.0 if grooves < 100.0 else 1.0)
    found = trace_beam(gl, [sheet(grating)], None, wall, -0.1 * DOWN, DOWN, 1e-7, nm, count=COUNT)
    offset = found.position[:, 0] - found.start[:, 0]
    places = (offset / np.hypot(1.0, offset) - nm * 3e-4) * grooves / (nm * 3e-4)
    half = float(np.interp(0.5, np.linspace(0.0, 1.0, 1025), line_quantiles(1025)))
    rounding = 3e-7 * grooves / (nm * 3e-4)
    if grooves > 1.0:
        assert np.median(np.abs(places)) == pytest.approx(half, abs=0.01 + rounding)
    tally = found.tally
    assert sum(tally.ended.values()) == pytest.approx(tally.emitted, rel=1e-5)
    beyond = [1.0 - nm * 3e-4, 1.0 + nm * 3e-4]
    want = sum(0.5 / (np.pi**2 * way * grooves / (nm * 3e-4)) for way in beyond)
    assert tally.ended["absorbed"] / tally.emitted == pytest.approx(want, abs=0.3 * want + 1e-3)


def test_white_all_round_stays_white_behind_a_slit(gl: Context) -> None:
    """The camera sees each place of the surroundings spread, and no light more."""
    camera = Camera((0, 0, 2), (0, 0, 0), (0, 1, 0), vertical_fov_deg=20.0)
    scene = white_furnace(placed_at("slit", screen(np.zeros(3), -DOWN, 3.0), Slit(width_um=40.0)), camera=camera)
    picture = render(scene, RenderSettings(width=24, height=16, spp=64), context=gl).rgb
    assert np.abs(picture.mean(axis=(0, 1)) - 1.0).max() < 4e-3
