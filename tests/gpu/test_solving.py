"""A hidden glass is found among all, numbers of a scene with their uncertainty, and what says nothing is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import spectrasplat as ss
from spectrasplat.base.generators import finished
from spectrasplat.base.tone_map import luminance
from spectrasplat.edit.parameters import Stage
from spectrasplat.model.optics import catalogue
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.frames import FrameRenderer
from spectrasplat.render.light_target import Target, axes_of
from spectrasplat.render.solving import Solver, _at_bins, _errors, _least_squares, width_of

EDGES = np.linspace(380.0, 780.0, 17)


def light_of(scene: ss.Scene, receiver: str, seed: int) -> tuple[np.ndarray, list[list[float]]]:
    """Spectra of what falls on a receiver (rows, columns, bins), and where they are."""
    found = ss.caustic(scene, receiver, size=(96, 96), photons=60_000, seed=seed, bins=16)
    corners = found.placement["corners_world"]
    return found.spectral, [corners["top_left"], corners["top_right"], corners["bottom_left"]]


def test_least_squares_know_how_sure_they_are() -> None:
    """Moves and brightness are found; their scatter over many noises is what is said of it."""
    rng = np.random.default_rng(5)
    columns = rng.normal(size=(400, 3))
    moves, said = [], None
    for _ in range(300):
        wanted = 2.5 * (columns @ [1.0, 0.2, -0.3]) + 0.1 * rng.normal(size=400)
        move, covariance, _ = _least_squares(columns, wanted)
        moves.append(move)
        said = covariance if said is None else said + covariance
    assert np.mean(moves, axis=0) == pytest.approx([0.2, -0.3], abs=5e-4)
    assert np.std(moves, axis=0) == pytest.approx(np.sqrt(np.diag(said / 300)), rel=0.2)


def test_least_squares_know_what_is_alike_in_blocks() -> None:
    """What each of 40 blocks of ten has in common scatters three times as far as noise that is as strong."""
    rng = np.random.default_rng(6)
    block = np.repeat(np.arange(40), 10)
    columns = rng.normal(size=(40, 3))[block] + 0.2 * rng.normal(size=(400, 3))
    found = [
        _least_squares(columns, wanted, which) + (which is None,)
        for wanted in (columns @ [1.0, 0.2, -0.3] + 0.1 * rng.normal(size=(300, 40))[:, block])
        for which in (block, None)
    ]
    scatter = np.std([move for move, *_, is_plain in found if not is_plain], axis=0)
    said, plain = (np.mean([np.diag(c) for _, c, _, p in found if p == is_plain], axis=0) ** 0.5 for is_plain in (0, 1))
    assert said == pytest.approx(scatter, rel=0.2) and (plain < 0.5 * scatter).all()


def test_predictions_are_believed_near_by_only() -> None:
    """The error of a move is what remains at the best brightness; a large move is no candidate."""
    columns = np.array([[1.0, 0.0], [1.0, 0.1], [0.0, 0.2]])
    wanted = 3.0 * (columns @ [1.0, 0.5])
    errors = _errors(columns, wanted, np.array([[0.5], [0.0], [50.0]]))
    assert errors[0] == pytest.approx(0.0, abs=1e-7) and 0.0 < errors[1] < 0.2 and np.isinf(errors[2])


def test_a_target_reads_the_map_where_it_lies() -> None:
    """Cells of an oblique field of a map that rises linearly."""
    x, y = np.meshgrid((np.arange(64) + 0.5) / 64.0, 1.0 - (np.arange(32) + 0.5) / 32.0)
    spectral = np.stack([x, y, x + y, 2.0 * x], axis=-1)
    placement = {"corners_world": {"bottom_left": [0, 0, 1], "bottom_right": [1, 0, 1], "top_left": [0, 1, 1]}}
    corners = np.array([[0.2, 0.3, 1.0], [0.6, 0.4, 1.0], [0.1, 0.7, 1.0]])
    target = Target("floor", np.eye(3)[:2], corners, np.ones((2, 4, 4)), np.linspace(380.0, 780.0, 5))
    seen = target.seen(spectral, placement)
    upright = replace(target, corners=np.array([[0.2, 0.1, 1.0], [0.2, 0.9, 1.0], [0.3, 0.1, 1.0]]))
    its = upright.settings(RenderSettings(photons=1000))
    assert (its.width, its.height) == (24, 192)  # along the map's axes, however the target's rows lie
    first = corners[0] + 0.125 * (corners[1] - corners[0]) + 0.25 * (corners[2] - corners[0])
    assert seen[0, 0] == pytest.approx([first[0], first[1], first[0] + first[1], 2.0 * first[0]], abs=1e-9)


def test_index_of_a_bin() -> None:
    """The mean over a bin, between the indices at its ends."""
    glass = catalogue.find("N-SF11")
    found = _at_bins(glass, EDGES)
    assert (found < glass.index(EDGES[:-1])).all() and (found > glass.index(EDGES[1:])).all()


def test_what_is_no_target_is_refused(tmp_path: Path) -> None:
    """In one sentence each, before anything is rendered."""
    scene, ends = ss.load("spectrum"), [[3.9, 0.0, -1.1], [3.7, 0.0, -1.4]]
    with pytest.raises(ss.UserError, match="no object of glass called 'screen'"):
        ss.match(scene, "screen", "screen", np.ones((4, 16)), ends)
    with pytest.raises(ss.UserError, match="where the target lies"):
        ss.match(scene, "prism", "screen", np.ones((4, 16)))
    with pytest.raises(ss.UserError, match="dark"):
        ss.match(scene, "prism", "screen", np.zeros((4, 16)), ends)
    with pytest.raises(ss.UserError, match="nothing to fit to"):
        ss.fit(scene, ["objects.prism.n_d"], "screen")
    with pytest.raises(ss.UserError, match="the line's two ends"):
        ss.match(scene, "prism", "screen", width=0.1)
    with pytest.raises(ss.UserError, match="does not fit on a line 0.36"):
        ss.match(scene, "prism", "screen", between=ends, width=0.35)
    with pytest.raises(ss.UserError, match="a target of 2 channels"):
        ss.match(scene, "prism", "screen", np.ones((4, 2)), ends)
    with pytest.raises(ss.UserError, match="not in one"):
        ss.match(scene, "prism", "screen", np.ones((4, 4, 16)), [*ends, ends[1]])
    with pytest.raises(ss.UserError, match="given twice"):
        ss.fit(scene, ["objects.prism.n_d"] * 2, "screen", np.ones((4, 16)), ends)
    for text in ("1,2,3,4\n1,2,x,4\n", "1,2,3,4\n1,2,3\n", ""):
        (tmp_path / "lines.csv").write_text(text)
        with pytest.raises(ss.UserError, match="lines of as many numbers"):
            ss.match(scene, "prism", "screen", tmp_path / "lines.csv", ends)


def test_the_light_of_all_glasses_is_foreseen(gl) -> None:
    """By the light of a few indices alone the hidden glass is among the first ten of all, from whatever glass."""
    scene = ss.load("spectrum")
    hidden = scene.copy()
    hidden.objects["prism"].update(glass="Hoya FDS18")
    target, between = light_of(hidden, "screen", seed=3)
    model = scene._model
    its = Solver(
        gl,
        Stage(model, model.camera),
        RenderSettings(photons=20_000),
        Target("screen", axes_of(model, "screen"), np.array(between), target, EDGES),
    )
    entries = [entry for entry in catalogue.entries() if entry.dispersion.is_dispersive]
    errors = finished(its._foreseen(0, np.stack([_at_bins(entry.dispersion, EDGES) for entry in entries])))
    first = np.argsort(errors)[:10]
    assert "Hoya FDS18" in [entries[i].qualified_name for i in first] and errors[first[-1]] < 0.5 < np.median(errors)


@pytest.mark.slow
def test_a_hidden_glass_is_found_among_all() -> None:
    """By the spectra that it casts in texels twice as wide: among the first ten, n_d within 1e-4 and V_d within 0.5."""
    scene = ss.load("spectrum")
    hidden = scene.copy()
    hidden.objects["prism"].update(glass="Ohara S-LAH64")
    target, between = light_of(hidden, "screen", seed=3)
    found = ss.match(scene, "prism", "screen", target, between, photons=60_000)
    glass = ss.glass("Ohara S-LAH64")
    assert glass.name in [each.name for each in found.glasses]
    assert found.glasses[0].error < 0.05 and abs(found.glasses[0].n_d - glass.n_d) < 1e-4
    assert found.fit.values["n_d"] == pytest.approx(glass.n_d, abs=1e-4)
    assert found.fit.values["V_d"] == pytest.approx(glass.V_d, abs=0.5)


@pytest.mark.slow
def test_numbers_are_fitted_through_noise() -> None:
    """n_d, V_d and the prism's turn at once, each within two of its deviations, which know what wider texels do."""
    true = ss.load("spectrum")
    true.objects["prism"].update(glass=None, material={"n_d": 1.70, "V_d": 30.0})
    target, between = light_of(true, "screen", seed=3)
    noisy = target + 0.02 * target.max() * np.random.default_rng(1).normal(size=target.shape)
    start = true.copy()
    start.objects["prism"].update(material={"n_d": 1.703, "V_d": 32.0})
    paths = ["objects.prism.n_d", "objects.prism.V_d", "objects.prism.rotation.y"]
    found = ss.fit(start, paths, "screen", noisy, between, photons=60_000)
    for path, wanted, most in zip(paths, (1.70, 30.0, 0.0), (1e-3, 0.1, 0.2), strict=True):
        assert 0.0 < found.deviations[path] < most
        assert abs(found.values[path] - wanted) < 2.0 * found.deviations[path]


def test_a_width_is_that_of_what_lies_on_the_line() -> None:
    """Full width at half maximum: of a bell 2.355 deviations, wherever it lies and whatever is dim beside it; all of a
    line that is even; none in the dark."""
    t = (np.arange(400) + 0.5) / 400.0
    found = width_of(np.stack([np.exp(-0.5 * ((t - 0.4) / 0.05) ** 2) + 0.02 * (t > 0.9), np.ones(400), np.zeros(400)]))
    assert found[:2] == pytest.approx([2.0 * math.sqrt(2.0 * math.log(2.0)) * 0.05, 1.0], rel=3e-3)
    assert np.isnan(found[2])


@pytest.mark.slow
def test_a_width_is_fitted_and_matched(gl) -> None:
    """The Abbe number of a glass of this n_d is that of the spectrum so wide; a glass of the catalogue has it too."""
    true = ss.load("spectrum")
    true.objects["prism"].update(glass=None, material={"n_d": 1.80, "V_d": 20.0})
    line = [[3.5009, 0.0, -1.95945], [4.00595, 0.0, -0.871475]]
    window = np.array([[3.5009, -0.02, -1.95945], [4.00595, 0.02, -0.871475]])
    its = RenderSettings(width=8, height=1200, photons=60_000, seed=3, layer="map:screen")
    frames = FrameRenderer(gl, its, [Stage(true._model, true._model.camera)], window=window)
    seen = frames.run(Stage(true._model, true._model.camera)).astype(float)
    frames.release()
    light = luminance(seen)[:, 3:5].mean(axis=1)
    width = float(width_of(light[None])[0]) * float(np.linalg.norm(np.subtract(*line)))
    start = true.copy()
    start.objects["prism"].update(material={"n_d": 1.80, "V_d": 24.0})
    found = ss.fit(start, ["objects.prism.V_d"], "screen", between=line, width=width, photons=30_000)
    assert found.values["objects.prism.V_d"] == pytest.approx(20.0, abs=0.8)
    near = ss.match(start, "prism", "screen", between=line, width=width, photons=30_000, count=3)
    assert near.glasses[0].error < 0.1 and 18.0 < near.fit.values["V_d"] < 26.0
    with pytest.raises(ss.UserError, match="one number only"):
        ss.fit(start, ["objects.prism.V_d", "objects.prism.n_d"], "screen", between=line, width=width)


def test_light_without_colours_says_nothing() -> None:
    """Light that comes straight through a plate cannot tell one glass from another; nor where none casts any."""
    scene = ss.load("spectrum")
    del scene.objects["prism"]
    scene.objects.add(name="plate", shape="box", size=[1, 1, 0.2], z_axis=[0.907, 0, 0.421], glass="N-SF66")
    scene.objects.add(
        name="wall", shape="plane", width=1.0, height=1.0, z_axis=[-1, 0, 0], position=[3, 0, 1.4], material="diffuse"
    )
    target, between = light_of(scene, "wall", seed=3)
    with pytest.raises(ss.UserError, match="says nothing about a glass"):
        ss.match(scene, "plate", "wall", target, between, photons=4_000)
    dark = np.add(between, [0.0, 0.3, 0.0]).tolist()
    with pytest.raises(ss.UserError, match="no glass of the catalogue casts such light"):
        ss.match(scene, "plate", "wall", target, dark, photons=4_000)
    with pytest.raises(ss.UserError, match=r"'objects.plate.n_d' changes no light there"):
        ss.fit(scene, ["objects.plate.n_d"], "wall", target, dark, photons=4_000)
