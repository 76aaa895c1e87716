"""The live camera before dispersive glass: smooth while the camera moves, whole cycles of bands once it rests, and
edits that are only looked at."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.edit.picking import pick
from spectrasplat.edit.projection import View
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.device_traits import Budget
from spectrasplat.model.environment import world_to_local
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.lights import SpotLight
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Camera, Dielectric, Scene
from spectrasplat.model.texture import Environment
from spectrasplat.passes.spectrum_choice import Spectrum
from spectrasplat.render.solo import solo_scene
from spectrasplat.render.viewer.engine import PREVIEW_S, LiveEngine
from spectrasplat.render.viewer.glass_steps import STEPS, GlassSteps
from spectrasplat.render.viewer.live_camera import MOVING_TAPS, _side
from spectrasplat.render.viewer.spectrum_guess import guess_weights

from tests.gpu.test_live_light import edited

SIZE = (120, 68)
WHITE = 5.0
MOST_STEPS = 400
"""Of a millisecond each, while maps are filled: a busy machine needs more than a quiet one."""
GREY = 0.03
"""Spread of the colours over their mean, up to which a picture is called free of colour grain."""


@pytest.fixture(scope="module")
def stage() -> Scene:
    """The prism from close by, near minimum deviation, before white: the table lies far below. The studio that it
    mirrors is left out, whose lamps have coloured edges behind a prism."""
    scene = replace(load_scene(assets_dir() / "scenes" / "prism.toml"), environment=None)
    below = np.eye(4)
    below[2, 3] = -30.0
    objects = tuple(
        o if isinstance(o.material, Dielectric) else replace(o, object_to_world=below @ o.object_to_world)
        for o in scene.objects
    )
    glass = next(o for o in objects if isinstance(o.material, Dielectric))
    middle = glass.object_to_world[:3, :3] @ np.mean(glass.mesh.bounds(), axis=0) + glass.object_to_world[:3, 3]
    x, y, z = (float(v) for v in middle)
    camera = Camera((x - 4.0 * 0.83, y - 4.0 * 0.55, z), (x, y, z), vertical_fov_deg=20.0)
    return replace(scene, objects=objects, camera=camera, background_rgb=(WHITE, WHITE, WHITE))


def inputs(scene: Scene, **changes) -> LiveInputs:
    return LiveInputs(scene, scene.camera, *SIZE, **changes)


def edged(scene: Scene, turn_deg: float = 0.0) -> Scene:
    """White and black stripes all round behind it, 4 degrees wide; they light no receiver."""
    rgb = np.zeros((90, 360, 3), np.float32)
    rgb[:, np.arange(360) % 8 < 4] = WHITE
    return replace(scene, environment=Environment(rgb, world_to_local((0.0, 0.0, 1.0), turn_deg), lights=False))


@pytest.fixture
def engine(gl: Context) -> Iterator[LiveEngine]:
    made = LiveEngine(gl, Budget(8192, 1 << 12, 1 << 14, 1 << 24))
    made.target_photons = 1 << 13
    made.refine_when_still = False
    yield made
    made.release()


def until(
    done: Callable[[], bool],
    engine: LiveEngine,
    each: Callable[[], None] = lambda: None,
    patience_s: float = 120.0,
    budget_s: float = 0.05,
) -> None:
    end = time.monotonic() + patience_s
    while not done():
        assert engine.problem is None, engine.problem
        assert time.monotonic() < end, "it took too long"
        engine.advance(budget_s)
        each()


def settle(engine: LiveEngine, wanted: LiveInputs) -> np.ndarray:
    engine.set(wanted)
    until(lambda: engine.is_idle, engine)
    return picture(engine)


def picture(engine: LiveEngine) -> np.ndarray:
    texture = engine.picture
    return np.frombuffer(texture.read(), np.float32).reshape(texture.height, texture.width, 4)[..., :3].astype(float)


def in_glass(engine: LiveEngine, shape: tuple[int, ...]) -> np.ndarray:
    """bool (h, w): pixels whose middle shows glass, and their neighbours too."""
    height, width = shape[:2]
    glass = {i for i, o in enumerate(engine.inputs.scene.objects) if isinstance(o.material, Dielectric)}
    view = View.of(engine.inputs.camera, width / height)
    places = [[((x + 0.5) / width, (y + 0.5) / height) for x in range(width)] for y in range(height)]
    hits = [[pick(engine.inputs.scene, view, *place) for place in row] for row in places]
    mask = np.array([[hit is not None and hit.object_index in glass for hit in row] for row in hits])
    return mask & np.roll(mask, 1, 0) & np.roll(mask, -1, 0) & np.roll(mask, 1, 1) & np.roll(mask, -1, 1)


def colour_grain(rgb: np.ndarray, mask: np.ndarray) -> float:
    """Root mean square of how much R − G and B − G differ from pixel to pixel, over the mean."""
    colour = (rgb[..., ::2] - rgb[..., 1:2]) / rgb[mask].mean()
    step = (colour - np.roll(colour, 1, axis=1))[mask]
    return float(np.sqrt((step**2).mean()))


def test_a_moving_camera_sees_no_colour_grain_in_glass(
    engine: LiveEngine, stage: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "spectrasplat.render.viewer.glass_steps.STEPS", (1,)
    )  # a slow machine must not leave too few pixels to see grain in
    engine.set(inputs(stage))
    until(lambda: engine.picture is not None, engine)
    moved = replace(stage.camera, position=tuple(np.add(stage.camera.position, (0.02, 0.0, 0.0))))
    engine.set(replace(inputs(stage), camera=moved))
    engine.advance(5.0, interacting=True)
    assert engine.stats.camera_samples == 1 and engine.stats.camera_bands == 1
    first = picture(engine)
    mask = in_glass(engine, first.shape)
    assert mask.sum() > 100
    assert colour_grain(first, mask) < GREY
    # What a sample of one band of sixteen looks like: this measure sees it.
    viewpoint = engine._camera_pass._pass
    viewpoint.spectrum = Spectrum(16)
    viewpoint.run(moved, first.shape[1], first.shape[0], 1, 0, engine._maps)
    assert colour_grain(viewpoint.read_rgb().astype(float), mask) > 5 * GREY


@pytest.mark.slow
def test_only_whole_cycles_of_bands_are_shown_and_smooth_samples_before(engine: LiveEngine, stage: Scene) -> None:
    shown: list[tuple[int, int, int]] = []

    def look() -> None:
        stats = engine.stats
        if not shown or shown[-1][0] != engine.picture_version:
            shown.append((engine.picture_version, int(stats.camera_samples), stats.camera_bands))

    engine.set(inputs(edited(edged(stage), 3.0)))
    until(lambda: engine.is_idle, engine, look)
    told = [(samples, bands) for version, samples, bands in shown if version]
    assert told[0][1] == 1 and told[-1][1] > 1, told
    assert all(samples % bands == 0 for samples, bands in told)
    samples, bands = told[-1]
    assert samples >= engine.camera_samples > samples - bands
    # After bands came into view nothing of the whole spectrum replaces them unless the maps became finer.
    rgb, mask = picture(engine), in_glass(engine, (SIZE[1], SIZE[0]))
    assert np.abs(rgb[mask][:, 0] - rgb[mask][:, 2]).max() > 0.1 * WHITE  # fringes


def test_one_wavelength_leaves_the_environment_dark(stage: Scene) -> None:
    alone = solo_scene(edged(stage), 550.0)
    assert alone.environment is None and alone.background_rgb == (0.0, 0.0, 0.0)
    assert solo_scene(stage, None) is stage


def test_a_picture_in_motion_follows_as_much_glass_as_its_time_asks_for(engine: LiveEngine, stage: Scene) -> None:
    large = replace(inputs(stage), width=480, height=270)
    engine.set(large)
    until(lambda: engine.picture is not None, engine)
    engine.playing = False
    pictures = []
    for step in range(12):
        moved = replace(stage.camera, position=tuple(np.add(stage.camera.position, (0.01 + 0.01 * step, 0.0, 0.0))))
        engine.set(replace(large, camera=moved))
        engine.advance(0.045, interacting=True)
        pictures.append(engine.picture_version)
    # However slow the machine is, what is moved is seen to move: every few frames at least.
    assert all(later > before for before, later in zip(pictures[:-4], pictures[4:], strict=True)), pictures
    view = engine._camera_pass
    assert view.shown_samples == 1 and view._glass.rate is not None and view._glass.pixels > 1000
    step = view._glass.within(PREVIEW_S)
    assert view._glass.pixels <= step * step * view._glass.rate * PREVIEW_S or step == STEPS[-1]


@pytest.fixture(scope="module")
def table() -> Scene:
    """The prism with its caustic and its shadow on the table."""
    return load_scene(assets_dir() / "scenes" / "prism.toml")


def seen_objects(engine: LiveEngine) -> np.ndarray:
    """(h, w): which object every pixel sees first, as the rasteriser found it."""
    texture = engine._camera_pass._surfaces.texture
    return np.frombuffer(texture.read(), np.uint32).reshape(texture.height, texture.width, 2)[..., 1]


def glass_of(table: Scene) -> int:
    """The prism, of the two things that there are."""
    assert len(table.objects) == 2
    return next(i for i, o in enumerate(table.objects) if o.material.is_specular)


def one_sample(engine: LiveEngine, camera: Camera) -> np.ndarray:
    """The picture of one whole sample in every pixel's middle."""
    view = engine._camera_pass._pass
    view.primary_samples, view.max_taps, view.spectrum = 1, MOVING_TAPS, Spectrum(1)
    view.run(camera, *SIZE, 1, 0, engine._maps)
    return view.read_rgb().astype(float)


def moved(engine: LiveEngine, scene: Scene) -> Camera:
    """Move the camera by a little and show that."""
    camera = replace(scene.camera, position=tuple(np.add(scene.camera.position, (0.3, 0.1, 0.0))))
    engine.set(replace(inputs(scene), camera=camera))
    engine.advance(5.0, interacting=True)
    return camera


def test_in_motion_what_is_seen_directly_is_as_sharp_as_ever(
    engine: LiveEngine, table: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Smallest error that would be seen: a picture of half the side misses by three times the bound."""
    monkeypatch.setattr("spectrasplat.render.viewer.glass_steps.STEPS", (24,))
    monkeypatch.setattr("spectrasplat.render.viewer.live_camera.SCALES", (1.0,))
    settle(engine, inputs(table))
    camera = moved(engine, table)
    stats, shown = engine.stats, picture(engine)
    assert (
        shown.shape[:2] == SIZE[::-1] and stats.direct_scale == 1.0 and stats.resolution_scale == pytest.approx(1 / 24)
    )
    on_table = seen_objects(engine) == next(i for i, o in enumerate(table.objects) if not o.material.is_specular)
    expected = one_sample(engine, camera)

    def error(rgb: np.ndarray) -> float:
        return float(np.abs(rgb - expected)[on_table].mean() / expected[on_table].mean())

    assert error(shown) < 0.03
    coarse = expected[::2, ::2].repeat(2, axis=0).repeat(2, axis=1)
    assert error(coarse) > 0.1
    # Nothing of the glass is missing, and no pixel of it is black where the whole sample is not.
    glass = ~on_table
    assert glass.sum() > 100 and (shown[glass].sum(axis=-1) > 0).mean() > 0.95


def test_in_motion_only_sharp_edges_of_light_are_looked_at_pixel_by_pixel(
    engine: LiveEngine, table: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A spot that fades from its middle to its border is smooth there; one with a hard border is not."""
    monkeypatch.setattr("spectrasplat.render.viewer.glass_steps.STEPS", (24,))
    monkeypatch.setattr("spectrasplat.render.viewer.live_camera.SCALES", (1.0,))
    x, y, _ = table.camera.target
    uneven, errors = [], []
    for inner_deg in (0.0, 34.9):
        spot = SpotLight(
            "spot",
            illuminant("D65").scaled_to_luminous(20.0),
            position=(x, y, 2.0),
            direction=(0.0, 0.0, -1.0),
            inner_half_angle_deg=inner_deg,
            outer_half_angle_deg=35.0,
        )
        lit = replace(table, lights=(*table.lights, spot))
        settle(engine, inputs(lit))
        camera = moved(engine, lit)
        shown, on_table = picture(engine), seen_objects(engine) == 1 - glass_of(lit)
        uneven.append(int(np.frombuffer(engine._camera_pass._moving._lists.read(4), "u4")[0]))
        expected = one_sample(engine, camera)
        errors.append(np.abs(shown - expected)[on_table].mean() / expected[on_table].mean())
    assert uneven[0] < 0.8 * uneven[1]
    assert max(errors) < 0.03


def test_in_motion_cells_beside_a_broad_shadow_are_even_and_those_beside_a_thin_one_are_not(
    engine: LiveEngine, table: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the lattice's marks, in numpy: only of cells next to something broad does the device ask more."""
    monkeypatch.setattr("spectrasplat.render.viewer.live_camera.SCALES", (1.0,))
    settle(engine, inputs(table))
    large = replace(inputs(table), width=480, height=270)
    engine.set(
        replace(large, camera=replace(table.camera, position=tuple(np.add(table.camera.position, (0.3, 0.1, 0.0)))))
    )
    engine.advance(5.0, interacting=True)
    textures = engine._camera_pass._moving._lattice[2:]
    cells, marks = (np.frombuffer(t.read(), np.uint32).reshape(t.height, t.width) for t in textures)
    around = np.pad(marks, 1, mode="edge")
    sides = [around[1:-1, :-2], around[1:-1, 2:], around[:-2, 1:-1], around[2:, 1:-1]]
    left, right, above, below = (side != marks for side in sides)
    thin = np.pad((left & right) | (above & below), 1, mode="edge")
    height, width = cells.shape
    corners = [around[1 + j : 1 + j + height, 1 + i : 1 + i + width] for j in (0, 1) for i in (0, 1)]
    even = (corners[0] != 0) & np.all([corner == corners[0] for corner in corners], axis=0)
    alone, by_thin = np.zeros_like(even), np.zeros_like(even)
    for j in range(4):
        for i in range(4):
            differs = around[j : j + height, i : i + width] != corners[0]
            alone |= differs
            by_thin |= differs & thin[j : j + height, i : i + width]
    looks = cells == 0xFFFFFFFF
    assert looks[~even].all() and not looks[even & ~alone].any()
    assert looks[even & by_thin].all() and (even & by_thin).any()
    broad = even & alone & ~by_thin
    assert broad.sum() > 20 and looks[broad].mean() < 0.4


def test_in_motion_the_last_rows_and_columns_are_as_sharp_as_the_others(
    engine: LiveEngine, table: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A picture whose sides are no multiples of the lattice's cells."""
    size = 158, 91
    monkeypatch.setattr("spectrasplat.render.viewer.glass_steps.STEPS", (24,))
    monkeypatch.setattr("spectrasplat.render.viewer.live_camera.SCALES", (1.0,))
    wanted = replace(inputs(table), width=size[0], height=size[1])
    settle(engine, wanted)
    camera = replace(table.camera, position=tuple(np.add(table.camera.position, (0.3, 0.1, 0.0))))
    engine.set(replace(wanted, camera=camera))
    engine.advance(5.0, interacting=True)
    shown, on_table = picture(engine), seen_objects(engine) == 1 - glass_of(table)
    view = engine._camera_pass._pass
    view.primary_samples, view.max_taps, view.spectrum = 1, MOVING_TAPS, Spectrum(1)
    view.run(camera, *size, 1, 0, engine._maps)
    expected = view.read_rgb().astype(float)
    edge = np.zeros_like(on_table)
    edge[-3:], edge[:, -3:] = True, True
    where = edge & on_table
    assert where.sum() > 100
    assert np.abs(shown - expected)[where].mean() < 0.03 * expected[where].mean()


def test_once_still_glass_becomes_finer_until_every_pixel_has_its_own_path(
    engine: LiveEngine, table: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spectrasplat.render.viewer.glass_steps.STEPS", (24,))
    settle(engine, inputs(table))
    camera = moved(engine, table)
    engine.playing = False
    # Samples that come after them would be published in the same breath on a slow machine.
    monkeypatch.setattr("spectrasplat.render.viewer.live_camera.LiveCamera._publish", lambda self: None)
    scales: list[float] = []
    whole: list[np.ndarray] = []

    def look() -> None:
        if not scales or engine.stats.resolution_scale != scales[-1]:
            scales.append(engine.stats.resolution_scale)
            if scales[-1] == 1.0:
                whole.append(picture(engine))

    until(lambda: bool(whole), engine, look)
    assert scales == sorted(scales) and scales[0] == pytest.approx(1 / 24) and scales[-1] == 1.0, scales
    glass = seen_objects(engine) == next(i for i, o in enumerate(table.objects) if o.material.is_specular)
    expected = one_sample(engine, camera)
    assert np.abs(whole[0] - expected)[glass].max() <= 1e-4 * expected[glass].max()


def test_whoever_walks_round_while_maps_are_laid_out_anew_sees_those_of_before(
    engine: LiveEngine, table: Scene
) -> None:
    """Nothing new was shown for as long as the stored photons took to fill them: seconds in large scenes."""
    engine.set(inputs(table))
    until(lambda: engine.schedule.splatting and not engine._shown.light.is_coarse, engine, budget_s=1e-3)
    assert engine._shown.light.shows_outdated and engine._camera_pass.is_paused
    version, seen = engine.picture_version, []
    for step in range(MOST_STEPS):
        # Never the same place twice.
        position = tuple(np.add(table.camera.position, (0.1 * (step % 50 + 1), 0.05 + 0.01 * (step // 50), 0.0)))
        camera = replace(table.camera, position=position)
        engine.set(replace(inputs(table), camera=camera))
        engine.advance(1e-3, interacting=True)
        assert engine.inputs.camera == camera
        assert engine.picture_version > version, "the picture stood still"
        version = engine.picture_version
        seen.append(picture(engine))
        if not engine._shown.light.shows_outdated:
            break
    # While the hand still moves there are the new ones.
    assert 1 < step < MOST_STEPS - 1
    assert all(p.max() > 0.0 for p in seen) and not np.array_equal(seen[0], seen[-1])
    until(lambda: engine.is_idle, engine)
    assert engine.stats.resolution_scale == 1.0


@pytest.mark.parametrize(
    ("rate", "later"), [(None, [6, 1]), (50.0, [6, 1]), (1.0, [6, 3, 1])], ids=["unknown", "soon", "slow"]
)
def test_blocks_before_the_last_are_left_out_where_that_is_soon_there(rate: float | None, later: list[int]) -> None:
    steps = GlassSteps()
    steps.rate, steps.pixels = rate, 900
    assert steps.after(12) == later and steps.after(6) == later[1:] and steps.after(1) == []


def test_it_is_said_while_picture_and_scene_differ(engine: LiveEngine, stage: Scene) -> None:
    engine.set(inputs(stage))
    engine.advance(0.0)
    assert engine.stats.differs == "scene"
    until(lambda: engine.picture is not None, engine)
    assert engine.stats.differs == ""
    glass = next(i for i, o in enumerate(stage.objects) if isinstance(o.material, Dielectric))
    aside = np.eye(4)
    aside[0, 3] = 0.1
    objects = list(stage.objects)
    objects[glass] = replace(objects[glass], object_to_world=aside @ objects[glass].object_to_world)
    turned = inputs(replace(stage, objects=tuple(objects)))
    engine.set(turned)
    engine.advance(0.0)
    assert engine.stats.differs == "light"
    until(lambda: engine.inputs is turned, engine)
    assert engine.stats.differs == ""


def test_sides_in_motion_are_no_powers_of_two() -> None:
    sides = [_side(pixels) for pixels in range(1, 1100)]
    assert (
        all(side & (side - 1) for side in sides)
        and max(abs(side - pixels) for pixels, side in enumerate(sides[8:], start=9)) <= 1
    )


def test_the_spectrum_guessed_for_a_colour_has_that_colour(gl: Context, engine: LiveEngine, stage: Scene) -> None:
    engine.set(inputs(stage))
    until(lambda: engine._shown is not None, engine)
    channels = engine._shown.light.light_pass.shown.channels
    weights, luminance = guess_weights(channels, stage.lights)
    xyz = np.array([spectrum.xyz() for spectrum in channels.spectra(stage.lights)])
    np.testing.assert_allclose(weights.T @ xyz, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(luminance, xyz[:, 1])
    # The light's own colour is the light itself: every channel holds its own share.
    cells = channels.cell_weights()[:, 4 : 4 + channels.count]
    own = np.sum([light.spectral_power.density for light in stage.lights], axis=0) @ cells
    np.testing.assert_allclose(weights @ (own @ xyz), own, rtol=0.02)
