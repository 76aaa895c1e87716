"""The caustic of the camera's reference on disk: made once, grown as far as a picture needs, kept over interrupts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import CollimatedLight
from spectrasplat.model.scene import Camera, Dielectric, Scene
from spectrasplat.reference import caustic_cache, photon_run, spectral_caustic
from spectrasplat.reference.camera_reference import cached_camera_reference, render_camera_reference
from spectrasplat.reference.camera_run import summed_camera
from spectrasplat.reference.caustic_cache import CachedCaustic, picture_noise
from spectrasplat.reference.photon_run import TALLY_SIZE
from spectrasplat.reference.rounds import PARTS
from spectrasplat.reference.spectral_caustic import CausticPlan, CausticRun, build_caustic

from tests.unit.camera_scenes import D65, FLINT, place, plate, scene_of

SIZE = 24, 16
PLAN = CausticPlan(photons=1 << 17, bins=12)


@pytest.fixture(autouse=True)
def short_pilots(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photon_run, "_PILOT_PHOTONS", 1 << 12)
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
    return CachedCaustic(scene, *SIZE, 64, plan, "key", folder)


def quiet(fraction: float, text: str) -> None:
    assert 0.0 <= fraction <= 1.0 and "photons" in text


@pytest.mark.slow
def test_a_finished_reference_builds_nothing(scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = cached_camera_reference(scene, *SIZE, samples=16, caustic=PLAN, folder=tmp_path)
    assert first.caustic_photons >= PLAN.photons and 0.0 < first.caustic_relmse < 0.1
    monkeypatch.setattr(CausticRun, "__init__", lambda *_: pytest.fail("the caustic was prepared again"))
    again = cached_camera_reference(scene, *SIZE, samples=16, caustic=PLAN, folder=tmp_path)
    assert np.array_equal(first.xyz, again.xyz)
    assert (again.caustic_photons, again.caustic_relmse) == (first.caustic_photons, first.caustic_relmse)


@pytest.mark.slow
def test_more_samples_look_up_the_stored_caustic(scene: Scene, tmp_path: Path, rounds: list[int]) -> None:
    cached_camera_reference(scene, *SIZE, samples=16, caustic=PLAN, folder=tmp_path)
    assert rounds
    rounds.clear()
    more = cached_camera_reference(scene, *SIZE, samples=64, caustic=PLAN, folder=tmp_path)
    assert rounds == [] and more.samples == 64
    at_once = render_camera_reference(scene, *SIZE, samples=64, caustic=build_caustic(scene, *SIZE, PLAN))
    np.testing.assert_allclose(more.xyz, at_once.xyz, rtol=1e-6, atol=1e-9 * at_once.xyz.max())


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
    units, tallies = np.full(PARTS, 4), np.zeros((PARTS, TALLY_SIZE))
    picture = summed_camera(sums, units, tallies, 1.0, halves=True)
    assert picture.samples == 4 * PARTS
    np.testing.assert_allclose(picture.xyz, 1.0)
    np.testing.assert_allclose(picture.variance, 0.3**2)  # of a mean of two that are 0.6 apart
    apart = summed_camera(sums, units, tallies, 1.0)
    np.testing.assert_allclose(apart.variance, 0.3**2 / (PARTS - 1))
