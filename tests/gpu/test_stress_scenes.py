"""Whole-scene stress cases: a few real ones hold, mutants of the renderer break them, and (slow) the whole run does."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.gpu import records
from spectrasplat.model.geometry.primitives import box
from spectrasplat.model.lights import PointLight
from spectrasplat.render import light_plan, still
from spectrasplat.stress.case import Case, not_finite
from spectrasplat.stress.cases import contacts, crowds, losses, sweeps
from spectrasplat.stress.rigs import probe
from spectrasplat.stress.rigs.probe import WatchedRecords, with_photons
from spectrasplat.stress.rigs.scene_parts import (
    BEAM,
    FLINT,
    brighter,
    extent,
    moved,
    solid,
    stage,
    turn,
)

FEW = with_photons(4096)


def block():
    return stage(solid("block", box(), FLINT, (0.3, 0.0, 0.8), turned=turn((1.0, 0.3, 0.2), 25.0)))


def swept(name: str) -> Case:
    """One case of the sweep over the block."""
    return next(case for case in sweeps.scene_sweep(block()) if case.name == name)


def test_a_pile_of_plates_transmits_what_reflections_add_up_to() -> None:
    """Closed forms for one plate of n and for a film of air, and light that goes in comes out: reversed, the pile is as
    clear."""
    r = (0.5 / 2.5) ** 2
    assert contacts.plates(1.5) == pytest.approx((1 - r) / (1 + r), abs=1e-14)
    assert contacts.plates(1.5, 1.0, 1.5) == pytest.approx((1 - r) / (1 + 3 * r), abs=1e-14)
    assert contacts.plates(1.5, 1.9, 1.2) == pytest.approx(contacts.plates(1.2, 1.9, 1.5), abs=1e-14)


def test_gap_and_contact_hold(gl) -> None:
    found = list(contacts.gap.only(1e-3, 0.0).measure(gl))
    assert [m.note for m in found] == ["a film of air", "optical contact"]
    assert [m.broken() for m in found] == [[], []]


@pytest.mark.slow
def test_lines_narrower_than_even_bands_are_absorbed(gl, monkeypatch) -> None:
    """Bands are cut about the lines; sixteen even ones, as there once were, miss one part in fifty or more."""
    case = crowds.absorption_lines.only(5.0)
    (found,) = case.measure(gl)
    assert found.broken() == []
    monkeypatch.setattr(light_plan, "cut_by_tints", lambda ends, *_: np.linspace(*ends, 17))
    (found,) = case.measure(gl)
    assert any("error of power" in sentence for sentence in found.broken()), found.errors


def test_more_lights_and_objects_than_a_photon_can_tell_are_refused(gl, monkeypatch) -> None:
    monkeypatch.setattr(crowds, "probe", lambda *_: None)
    for case in (crowds.many_lights.only(300), crowds.many_objects.only(70_000)):
        (found,) = case.measure(gl)
        assert found.broken() == [] and "at most" in found.note


def test_a_pile_of_sixteen_keeps_its_light(gl) -> None:
    """Pilots once gave up after twelve events and saw nothing; roulette once drew the same numbers every eight events
    (1.6e-2)."""
    (found,) = contacts.stack.only(16).measure(gl)
    assert found.broken() == []


def test_scene_may_be_of_any_size(gl) -> None:
    (found,) = swept("scale").only(1e-4).measure(gl)
    assert found.broken() == []
    assert found.errors["picture"] < 1e-3


def test_passes_add_up(gl) -> None:
    (found,) = swept("passes").only(3).measure(gl)
    assert found.broken() == []


def test_a_picture_that_knows_its_scale_is_found(gl, monkeypatch) -> None:
    """Mutant: intensities do not follow the scale (here: a light 2 % too bright)."""
    scene = block()
    base = probe.probe(gl, scene, FEW)
    brighter_one = replace(scene, lights=(replace(BEAM, spectral_power=brighter(BEAM.spectral_power, 1.02)),))
    found = probe.probe(gl, moved(brighter_one, scale=1e-4), FEW)
    broken = probe.rendered(1.0, "", found, sweeps.unchanged(found, base)).broken()
    assert len(broken) == 2 and "picture" in broken[0] and "energy" in broken[1]


def test_every_nan_is_found_and_every_dropped_footprint_must_be_counted(gl, monkeypatch) -> None:
    """Mutant: after tracing, three photons lose their position and two more their footprint without being counted."""
    watch = WatchedRecords._watch

    def spoil(self: WatchedRecords, photons: np.ndarray) -> None:
        photons = photons.copy()
        photons["position"][:3, 1] = np.nan
        photons["flags"][3:5] |= records.FLAG_FOOTPRINT_DROPPED
        photons["dposition_ds"][3:5] = np.inf
        watch(self, photons)

    monkeypatch.setattr(WatchedRecords, "_watch", spoil)
    found = probe.rendered(1.0, "", probe.probe(gl, block(), FEW))
    assert found.nonfinite == 3 and found.dropped == 2
    assert len([s for s in found.broken() if "finite" in s or "uncounted" in s]) == 2


def test_nan_in_maps_and_pictures_are_counted() -> None:
    values = np.ones((4, 5, 3))
    values[1, 2] = np.nan
    values[0, 0, 0] = -np.inf
    assert not_finite([values]) == 4
    assert probe.picture_error(np.zeros((2, 2)), np.zeros((2, 2))) == 0.0
    assert probe.picture_error(np.ones((2, 2)), np.zeros((2, 2))) == np.inf
    assert np.allclose(
        probe.blocks(np.arange(400.0).reshape(20, 20, 1)), np.array([[[94.5], [104.5]], [[294.5], [304.5]]])
    )


def test_moved_scenes_are_the_same_scene() -> None:
    """Distances and the solid's extent follow the scale; directions stay unit vectors; the sun's irradiance stays, a
    lamp's intensity grows."""
    scene = block()
    large = moved(scene, 10.0, (1.0, 2.0, 3.0), turn((0.0, 0.0, 1.0), 90.0))
    assert extent(large) == pytest.approx(10.0 * extent(scene))
    assert large.lights[0].radius == pytest.approx(10.0 * BEAM.radius)
    assert np.linalg.norm(large.lights[0].direction) == pytest.approx(1.0)
    assert large.lights[0].spectral_power == scene.lights[0].spectral_power
    assert np.allclose(large.camera.position, (1.0, 2.0, 3.01))
    lamp = PointLight(BEAM.name, BEAM.spectral_power, BEAM.position)
    assert np.allclose(
        moved(replace(scene, lights=(lamp,)), 10.0).lights[0].spectral_power.density,
        100.0 * lamp.spectral_power.density,
    )


@pytest.mark.slow
def test_the_whole_run_keeps_every_promise(tmp_path: Path, capsys) -> None:
    assert main(["stress", "-o", str(tmp_path)]) == 0, capsys.readouterr().out[-2000:]
    held = json.loads((tmp_path / "stress.json").read_text(encoding="utf-8"))
    assert not held["partial"] and held["broken"] == []
    assert sum(len(case["measurements"]) for case in held["cases"]) > 200


QUICK = "contact-mirror", "contact-black-box"
"""The others of the sweep are as those of test_contact.py."""
LOSSES = [case.only(1e-5, 0.0) for case in losses.CONTACTS if case.name in QUICK]
LOSSES.append(losses.lamp_on_floor.only(1e-2, 1e-6, 0.0))


@pytest.mark.parametrize("case", LOSSES, ids=lambda case: case.name)
def test_little_is_lost_and_nothing_in_silence(gl, case) -> None:
    assert [m.broken() for m in case.measure(gl) if m.broken()] == []


def test_a_loss_without_a_word_is_found(gl) -> None:
    """Mutant: notices are not said."""
    settings = replace(FEW, max_depth=2)
    said = still.render(block(), settings, context=gl)
    silent = replace(said, stats=replace(said.stats, notices=()))
    assert "unsaid" not in " ".join(losses.honest(said, 1.0, "").broken())
    assert any("unsaid" in s for s in losses.honest(silent, 1.0, "").broken())
    found = losses.honest(still.render(block(), FEW, context=gl), 1.0, "", lacking=0.9)
    assert found.note == "a picture that lacks light"
