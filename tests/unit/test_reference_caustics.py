"""Parts of the camera's reference: its caustic on disk, the windows it is kept in, direct light."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.edit.chromaticity import colour_info
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import CollimatedLight
from spectrasplat.model.optics.spectrum import Spectrum, illuminant, laser
from spectrasplat.model.scene import Camera, Dielectric, Scene
from spectrasplat.reference import caustic_cache, photon_reference, spectral_caustic
from spectrasplat.reference.camera_reference import (
    KIND,
    picture_noise,
    render_camera_reference,
)
from spectrasplat.reference.caustic_cache import CachedCaustic
from spectrasplat.reference.caustic_windows import Landed, Planes, VisiblePoints, _shared, fit_windows
from spectrasplat.reference.direct_light import DirectLight
from spectrasplat.reference.rounds import PARTS, TALLY_SIZE, summed
from spectrasplat.reference.spectral_caustic import CausticPlan, CausticRun, build_caustic

from tests.unit.camera_scenes import D65, FLINT, place, plate, scene_of
from tests.unit.scene_texts import load

SIZE = 24, 16
PLAN = CausticPlan(photons=1 << 17, bins=12)


@pytest.fixture(autouse=True)
def short_pilots(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photon_reference, "_PILOT_PHOTONS", 1 << 12)
    monkeypatch.setattr(spectral_caustic, "_PILOT", 1 << 14)
    monkeypatch.setattr(spectral_caustic, "_MAX_UNITS", 2)  # several rounds
    monkeypatch.setattr(caustic_cache, "_FIRST_STEP", 1 << 15)


@pytest.fixture
def scene() -> Scene:
    """A beam through a prism on to a plate that the camera sees from above."""
    light = CollimatedLight(
        "beam", D65.scaled(3.0), (-0.2, 0.0, 3.0), (0.0, 0.0, -1.0), shape="rectangle", width=0.3, height=0.6
    )
    prism = place(primitives.prism(50.0, 1.0, 1.0), Dielectric(FLINT), (0.0, 0.0, 1.6))
    return scene_of(
        light, prism, plate(size=8.0), camera=Camera((0.9, -3.0, 4.0), (1.2, 0.0, 0.0), vertical_fov_deg=38.0)
    )


@pytest.fixture
def rounds(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Photons of every run before each of its rounds."""
    seen: list[int] = []
    advance = CausticRun.advance

    def counted(self: CausticRun, photons_left: int) -> None:
        seen.append(self.photons)
        advance(self, photons_left)

    monkeypatch.setattr(CausticRun, "advance", counted)
    return seen


def kept(scene: Scene, plan: CausticPlan, folder: Path) -> CachedCaustic:
    return CachedCaustic(scene, *SIZE, plan, "key", folder, lambda caustic: picture_noise(scene, *SIZE, 64, caustic))


def quiet(fraction: float, text: str) -> None:
    assert 0.0 <= fraction <= 1.0 and "photons" in text


def test_an_interrupt_keeps_the_photons(scene: Scene, tmp_path: Path, rounds: list[int]) -> None:
    def interrupt(fraction: float, text: str) -> None:
        if fraction > 0.4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        kept(scene, PLAN, tmp_path).grown(interrupt)
    stopped_at = rounds[-1]
    rounds.clear()
    caustic, _ = kept(scene, PLAN, tmp_path).grown(quiet)
    assert rounds[0] > stopped_at >= 0 and caustic.photons >= PLAN.photons
    whole = build_caustic(scene, *SIZE, PLAN)
    assert caustic.photons == whole.photons and caustic.landed_w == pytest.approx(whole.landed_w, rel=1e-12)
    np.testing.assert_allclose(
        caustic.tables.irradiance, whole.tables.irradiance, rtol=1e-4, atol=1e-6 * whole.tables.irradiance.max()
    )


def test_a_larger_plan_goes_on_from_a_smaller_one(scene: Scene, tmp_path: Path, rounds: list[int]) -> None:
    small, small_noise = kept(scene, PLAN, tmp_path).grown(quiet)
    rounds.clear()
    large, large_noise = kept(scene, replace(PLAN, photons=8 * PLAN.photons), tmp_path).grown(quiet)
    assert rounds[0] == small.photons and large.photons >= 8 * PLAN.photons
    # One over the photons, but two passes on some fifty lit pixels tell their noise to a factor of two only.
    assert 0.03 < large_noise / small_noise < 0.5


def test_photons_are_enough_when_the_picture_says_so(scene: Scene, tmp_path: Path) -> None:
    _, noise = kept(scene, PLAN, tmp_path / "a").grown(quiet)
    reached, less = kept(scene, replace(PLAN, photons=1 << 30, target_relmse=0.5 * noise), tmp_path / "b").grown(quiet)
    assert less <= 0.5 * noise and 1.3 * PLAN.photons < reached.photons < 8 * PLAN.photons
    least, _ = kept(scene, replace(PLAN, photons=1 << 30, target_relmse=1.0), tmp_path / "c").grown(quiet)
    assert least.photons == 1 << 15
    capped, too_much = kept(scene, replace(PLAN, target_relmse=1e-12), tmp_path / "d").grown(quiet)
    assert capped.photons == PLAN.photons and too_much > 1e-12


def test_the_noise_is_what_other_photons_would_change(scene: Scene) -> None:
    """Half the mean square difference of pictures by the same paths and independent photons; their windows differ, so
    to a factor of 2."""
    caustics = [build_caustic(scene, *SIZE, replace(PLAN, seed=seed, texel_size=0.05)) for seed in (1, 2, 3)]
    pictures = [render_camera_reference(scene, *SIZE, samples=1024, caustic=c).xyz for c in caustics]
    mean = np.mean(pictures, axis=0)
    observed = np.mean(np.var(pictures, axis=0, ddof=1) / (mean**2 + 1e-2 * mean.mean() ** 2))
    told = np.mean([picture_noise(scene, *SIZE, 256, c) for c in caustics])
    assert told == pytest.approx(observed, rel=1.0) and told > 0.5 * observed


def test_what_does_not_fit_is_made_anew(scene: Scene, tmp_path: Path, rounds: list[int]) -> None:
    """A damaged file, and one whose pilots found other windows."""
    kept(scene, PLAN, tmp_path).grown(quiet)
    (stored,) = tmp_path.glob("*.npz")
    whole = stored.read_bytes()
    stored.write_bytes(whole[:5000])
    rounds.clear()
    kept(scene, PLAN, tmp_path).grown(quiet)
    assert rounds[0] == 0
    moved = replace(scene, camera=replace(scene.camera, position=(0.8, -3.0, 4.0)))
    rounds.clear()
    kept(moved, PLAN, tmp_path).grown(quiet)
    assert rounds[0] == 0


def test_what_halves_of_the_caustic_have_apart_is_in_the_variance() -> None:
    """Parts that look up one half of the photons share its error: 8 parts without noise of their own are two pictures,
    not 8."""
    error = np.array([0.3, -0.3])
    sums = np.stack([np.full((1, 1, 3), 4.0 * (1.0 + error[part % 2])) for part in range(PARTS)])
    kept = {"sums": sums, "units": np.full(PARTS, 4), "tallies": np.zeros((PARTS, TALLY_SIZE)), "seconds": 1.0}
    kept |= {"unit": 1, "caustic_photons": 0, "caustic_relmse": 0.0}
    picture = summed(kept, replace(KIND, has_halves=True))
    assert picture.amount == 4 * PARTS
    np.testing.assert_allclose(picture.xyz, 1.0)
    np.testing.assert_allclose(picture.variance, 0.3**2)  # of a mean of two that are 0.6 apart
    apart = summed(kept, KIND)
    np.testing.assert_allclose(apart.variance, 0.3**2 / (PARTS - 1))


RNG = np.random.default_rng(4)
PAGE, FLOOR = 0, 1
TEXEL = 0.01


def planes() -> Planes:
    """The front of a page from −1 to 1 and that of a floor from −20 to 20."""
    frame = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    extent = np.array([[[-1.0, -1.0], [1.0, 1.0]], [[-20.0, -20.0], [20.0, 20.0]]])
    return Planes(
        np.array([[0, -1], [1, -1]], np.int32), np.arange(2), np.stack([frame, frame]), extent, np.ones(2, bool)
    )


def points(count: int, half: float) -> np.ndarray:
    flat = RNG.uniform(-half, half, (count, 3))
    flat[:, 2] = 0.0
    return flat


def looks(stray: int) -> VisiblePoints:
    """3000 at the page, 1000 at the floor's middle, `stray` anywhere on the floor."""
    where = np.concatenate([points(3000, 1.0), points(1000, 1.5), points(stray, 20.0)])
    return VisiblePoints(where, np.ones(len(where)), np.repeat(np.array([PAGE, FLOOR], np.int32), [3000, 1000 + stray]))


def light() -> Landed:
    """As much on the page as on all the floor."""
    side = np.repeat(np.array([PAGE, FLOOR], np.int32), 20_000)
    return Landed(
        np.concatenate([points(20_000, 1.0), points(20_000, 20.0)]),
        np.ones(40_000),
        np.stack([side, *np.zeros((3, 40_000), np.int32)], axis=1),
    )


@pytest.mark.parametrize("stray", [0, 5])
def test_stray_looks_do_not_spread_the_texels(stray: int) -> None:
    tables, wanted = fit_windows(planes(), looks(stray), light(), 4, lambda _: TEXEL, 1 << 18)
    assert wanted.all()
    span = tables.size / tables.texels_per_unit
    assert (span[FLOOR, 1] < 4.0).all() and (span[PAGE, 1] > 1.9).all()
    assert (1.0 / tables.texels_per_unit[:, 1] < 1.01 * TEXEL).all()
    assert (span[FLOOR, 0] > (10.0 if stray else 2.0)).all()  # what is seldom seen is in the coarse one


def test_where_looks_and_light_are_apart_the_light_is_covered() -> None:
    beside = light()
    beside.points[beside.ends[:, 0] == FLOOR] = (18.0, 18.0, 0.0)
    tables, wanted = fit_windows(planes(), looks(400), beside, 4, lambda _: TEXEL, 1 << 18)
    assert wanted[FLOOR]
    high = tables.low[FLOOR, 1] + tables.size[FLOOR, 1] / tables.texels_per_unit[FLOOR, 1]
    assert (tables.low[FLOOR, 1] <= 18.0).all() and (high >= 18.0 - 1e-6).all()


def test_too_many_texels_are_shared_by_looks() -> None:
    most = 1 << 14
    tables, _ = fit_windows(planes(), looks(0), light(), 4, lambda _: TEXEL, most)
    texels = np.prod(tables.size[:, 1], axis=1)
    assert texels.sum() == pytest.approx(most, rel=0.05)
    assert texels[PAGE] / texels[FLOOR] == pytest.approx(3.0, rel=0.1)


@pytest.mark.parametrize(
    ("asked", "weight", "most", "got"),
    [
        ((3.0, 4.0), (1.0, 9.0), 8.0, (3.0, 4.0)),
        ((6.0, 6.0), (1.0, 3.0), 8.0, (2.0, 6.0)),
        ((1.0, 20.0, 20.0), (5.0, 1.0, 3.0), 9.0, (1.0, 2.0, 6.0)),
        ((0.0, 20.0, 5.0, 4.0), (0.0, 1.0, 1.0, 6.0), 12.0, (0.0, 4.0, 4.0, 4.0)),
    ],
)
def test_sharing(asked: tuple[float, ...], weight: tuple[float, ...], most: float, got: tuple[float, ...]) -> None:
    np.testing.assert_allclose(_shared(np.array(asked), np.array(weight), most), got)


LIT = """
lights = [
  { kind = "directional", direction = [0.6, 0, -0.8], illuminance_lx = 1000 },
  { kind = "point", position = [0, 0, 2], intensity_cd = 40 },
  { kind = "area", position = [0, 0, 3], direction = [0, 0, -1], radius = 1.0, luminance_nt = 10 },
]
[[objects]]
shape = "plane"
width = 40
height = 40
material = "diffuse"
[[objects]]
shape = "sphere"
radius = 0.5
position = [8, 0, 1]
"""


@pytest.fixture
def lit(tmp_path: Path):
    return load(tmp_path, LIT)


def luxes(lit, place, normal=(0.0, 0.0, 1.0)) -> np.ndarray:
    gains = DirectLight.of(lit).gains(np.array(place), np.array(normal))
    return gains * [light.spectral_power.luminous() for light in lit.lights]


def test_sun_point_and_disc_by_their_closed_forms(lit) -> None:
    sun, point, disc = luxes(lit, (0.0, 0.0, 0.0))
    assert sun == pytest.approx(800.0, rel=1e-9)  # E cos θ
    assert point == pytest.approx(40.0 / 4.0, rel=1e-6)  # I / d²
    assert disc == pytest.approx(np.pi * 10.0 * 1.0 / (1.0 + 9.0), rel=1e-3)  # π L r² / (r² + h²) on the axis
    assert luxes(lit, (1.0, 0.0, 0.0))[1] == pytest.approx(40.0 * 2.0 / 5.0**1.5, rel=1e-6)


def test_glass_and_the_surface_itself_are_in_the_way(lit) -> None:
    # Behind the ball as the sun sees it; its middle is at height 1, the sun's slope 0.6 to 0.8.
    assert luxes(lit, (8.75, 0.0, 0.0))[0] == 0.0
    assert luxes(lit, (7.0, 0.0, 0.0))[0] == pytest.approx(800.0)
    assert not luxes(lit, (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)).any()


def test_nothing_is_there_where_nothing_is(lit) -> None:
    assert not luxes(lit, (0.0, 0.0, 1.0)).any()


@pytest.mark.parametrize("bins", [10, 20, 40])
@pytest.mark.parametrize("spectrum", [illuminant("D65"), illuminant("F11"), laser(532.0, 1.0), laser(780.0, 1.0)])
def test_bins_hold_the_power_and_the_lumens(spectrum: Spectrum, bins: int) -> None:
    scaled = spectrum.scaled_to_luminous(1000.0)
    edges = np.linspace(380.0, 780.0, bins + 1)
    binned = scaled.binned(edges)
    assert binned.sum() * 400.0 / bins == pytest.approx(scaled.power_w(), rel=1e-12)
    if not spectrum.lines and bins == 40:
        found = colour_info(0.5 * (edges[:-1] + edges[1:]), binned)
        assert found is not None and found.illuminance == pytest.approx(1000.0, rel=0.02)
    if spectrum == illuminant("D65"):  # however wide the bins are
        found = colour_info(0.5 * (edges[:-1] + edges[1:]), binned, spectrum.density)
        assert found is not None and found.temperature_k == pytest.approx(6504.0, abs=0.6)
