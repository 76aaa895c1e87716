"""Where something stands on a receiver: what lands beneath it is not seen beside it, and what lands beside it is all
there up to the line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import uniform_filter
from spectrasplat.base.paths import assets_dir
from spectrasplat.features.features import Features
from spectrasplat.model.contacts import standing
from spectrasplat.model.geometry.primitives import box, polygon_prism
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.scene import Black, Camera, Scene, SceneObject
from spectrasplat.model.scene_camera import camera_frame
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.contact_lines import PARTS, contact_words, read_words
from spectrasplat.passes.picture_window import PictureWindow
from spectrasplat.render import light_pass as light_pass_module
from spectrasplat.render.light_pass import LightPass
from spectrasplat.render.still import render
from spectrasplat.stress.rigs.glsl_function import evaluate
from spectrasplat.stress.rigs.probe import light_pass
from spectrasplat.stress.rigs.scene_parts import SUN, solid, stage, turn

OBLIQUE = Camera((1.2, -5.0, 4.0), (0.0, 0.0, 0.2), kind="orthographic", vertical_extent=3.0)
NOON = replace(SUN, direction=(0.0, 0.0, -1.0))
SIZE = 64, 36
SETTINGS = RenderSettings(width=SIZE[0], height=SIZE[1], photons=40_000, spp=16, layer="caustic")
BOX = (1.0, 0.8, 0.5)
TURN = turn((0.0, 0.0, 1.0), 13.0)
TO_SKY = np.array(OBLIQUE.position) - np.array(OBLIQUE.target)


def standing_box(material=None) -> SceneObject:
    """On the table; of glass, or of `material`."""
    item = solid("box", box(BOX), constant(1.5, "n 1.5"), (0.0, 0.0, 0.5 * BOX[2]), turned=TURN)
    return item if material is None else replace(item, material=material)


def under_a_plate() -> Scene:
    """The light of noon comes through a plate high above, evenly, and a black box stands in it."""
    plate = solid("plate", box((9.0, 9.0, 0.2)), constant(1.5, "n 1.5"), (0.0, 0.0, 20.0))
    return stage(plate, standing_box(Black()), lights=[NOON], camera=OBLIQUE)


def places(parts: int) -> np.ndarray:
    """World points of the table (36 · parts, 64 · parts, 3) that the middles of every pixel's parts show, from the
    top."""
    right, up, forward = camera_frame(OBLIQUE)
    width, height = (parts * side for side in SIZE)
    x = (np.arange(width) + 0.5) / parts - 0.5 * SIZE[0]
    y = 0.5 * SIZE[1] - (np.arange(height) + 0.5) / parts
    side = OBLIQUE.vertical_extent / SIZE[1]
    points = np.array(OBLIQUE.position) + side * (x[None, :, None] * right + y[:, None, None] * up)
    return points - points[..., 2:] / forward[2] * forward


def hidden(points: np.ndarray) -> np.ndarray:
    """Whether the standing box hides places of the table from the camera, by its slabs."""
    local, along = points @ TURN, (TO_SKY / np.linalg.norm(TO_SKY)) @ TURN
    low, high = -0.5 * np.array(BOX), 0.5 * np.array(BOX)
    low[2], high[2] = 0.0, BOX[2]
    ends = np.stack([(low - local) / along, (high - local) / along])
    return ends.min(axis=0).max(axis=-1) < ends.max(axis=0).min(axis=-1)


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch):
    """Calls a function as if nothing stood on anything."""

    def call(function):
        with monkeypatch.context() as patch:
            patch.setattr(LightPass, "_has_contacts", property(lambda _: False, lambda *_: None), raising=False)
            return function()

    return call


def test_words_are_what_rays_see(gl) -> None:
    with light_pass(gl, under_a_plate(), replace(SETTINGS, method="srd")) as (light, _):
        words = light.maps.atlas.contact_words
        assert words is not None
        window, tile = light.layout.windows[0][0], light.layout.tiles[0][0]
        assert isinstance(window, PictureWindow)
        found = read_words(words)[tile.y : tile.y + tile.height, tile.x : tile.x + tile.width]
    per_pixel = window.per_pixel
    bits = np.arange(PARTS * PARTS).reshape(PARTS, PARTS)
    seen = np.block([[(word >> bits) & 1 for word in row] for row in found])
    want = ~hidden(places(PARTS * per_pixel))
    if window.rows[1] @ np.append(camera_frame(OBLIQUE)[1], 0.0) > 0.0:
        want = want[::-1]
    x, y = (PARTS * per_pixel * int(side) for side in window.low)
    want = want[y : y + seen.shape[0], x : x + seen.shape[1]]
    # Middles of parts within a rounding of an edge may fall on either side.
    assert np.count_nonzero(seen != want) <= 2e-3 * seen.size
    assert (found > 0xFFFF).any() and (found == 0xFFFF).any()


def test_a_face_just_behind_a_wall_does_not_hide_it_from_within_the_glass(gl) -> None:
    """The pool's far wall stands a hundredth before the water's side, which came through the wall in dashes: depth of a
    projection that begins at the camera tells such distances no longer."""
    pool = load_scene(assets_dir() / "scenes" / "underwater.toml")
    with light_pass(gl, pool, replace(SETTINGS, width=1280, height=720, photons=2_000)) as (light, _):
        wall = 2  # of the receivers: floor, its back, far wall, …
        tile = light.layout.tiles[wall][0]
        words = read_words(light.maps.atlas.contact_words)[tile.y : tile.y + tile.height, tile.x : tile.x + tile.width]
    wall_round_it = uniform_filter(((words & 0xFFFF) == 0xFFFF).astype(float), 9)
    assert not ((words > 0xFFFF) & (wall_round_it > 0.8)).any() and (words > 0xFFFF).any()


@pytest.mark.parametrize(("method", "left"), [("srd", 0.4), ("srd-photons", 0.45)])
def test_light_beneath_a_glass_is_not_seen_beside_it(gl, method: str, left: float, without) -> None:
    """At noon all that a glass block lets through lies beneath it, where the camera sees the block. What is left fell
    on parts of texels that the line crosses."""
    scene = stage(standing_box(), lights=[NOON], camera=OBLIQUE)
    settings = replace(SETTINGS, method=method)
    leaked = render(scene, settings, context=gl).rgb[..., 1]
    before = without(lambda: render(scene, settings, context=gl).rgb[..., 1])
    assert before.sum() > 0.0 and leaked.sum() < left * before.sum()


@pytest.mark.parametrize(("method", "most"), [("srd", 0.02), ("srd-photons", 0.1)])
def test_light_beside_a_box_reaches_up_to_it(gl, method: str, most: float, without) -> None:
    """Photons' footprints are half a pixel wide here: what they lose beyond the line they have more beside it."""
    settings = replace(SETTINGS, method=method)
    share = ~hidden(places(16))
    share = share.reshape(SIZE[1], 16, SIZE[0], 16).mean(axis=(1, 3))
    at_line = (share > 0.0) & (share < 1.0)
    # Of the pixels that the box hides in part, those in which it meets the table and nothing lies in its shadow.
    feet = places(1)
    local = feet @ TURN
    near = np.maximum(np.abs(local[..., 0]) - 0.5 * BOX[0], np.abs(local[..., 1]) - 0.5 * BOX[1])
    at_line &= np.abs(near) < 0.1
    errors = []
    for take in (lambda function: function(), without):
        picture = take(lambda: render(under_a_plate(), settings, context=gl).rgb[..., 1])
        even = np.median(picture[share == 1.0])
        errors.append(picture[at_line].sum() / (even * share[at_line].sum()) - 1.0)
    assert abs(errors[0]) < most and abs(errors[0]) < 0.5 * abs(errors[1]), errors


def test_a_beam_cut_into_parts_of_texels_keeps_its_light(gl, monkeypatch: pytest.MonkeyPatch, without) -> None:
    """Where all parts of every texel are seen, they add up to what texels get without a line. Each part is looked at by
    itself: of the one before, the edge that crossed it does not count."""
    post = solid("post", polygon_prism(24, 0.5, 0.5), constant(1.5, "n 1.5"), (0.0, 0.0, 0.25))
    scene = stage(post, lights=[SUN], camera=OBLIQUE)
    settings = replace(SETTINGS, method="srd", width=32, height=18)

    def all_seen(*arguments):
        words = contact_words(*arguments)
        words.write(np.full((words.height, words.width), 0xFFFFFFFF, "u4").tobytes())
        return words

    whole = without(lambda: render(scene, settings, context=gl).rgb[..., 1])
    monkeypatch.setattr(light_pass_module, "contact_words", all_seen)
    in_parts = render(scene, settings, context=gl).rgb[..., 1]
    assert abs(in_parts.sum() / whole.sum() - 1.0) < 2e-3, in_parts.sum() / whole.sum()


def test_only_scenes_in_which_something_stands_on_a_receiver_ask() -> None:
    scene = under_a_plate()
    assert standing(scene) == [(2, 1)] and Features.of(scene, SETTINGS).contact_lines
    floating = replace(scene, objects=(scene.objects[0], scene.objects[2]))
    assert not standing(floating) and not Features.of(floating, SETTINGS).contact_lines


def test_the_rules_of_a_texel_by_themselves(gl) -> None:
    rng = np.random.default_rng(5)
    count = 512
    words = rng.integers(0, 1 << 32, count, np.uint64).astype(np.uint32)
    words[:64] &= 0xFFFF0000
    words[64:128] |= 0xFFFF
    words[128:192] &= 0xFFFF
    within = rng.uniform(0.0, 1.0, (count, 2)).astype(np.float32)
    side, part = rng.integers(0, 3, count).astype(np.uint32), rng.integers(0, 16, count).astype(np.uint32)
    body = """
    seen = seen_share(word);
    contact = is_contact(word) ? 1u : 0u;
    found = side_of(word, within);
    takes = takes_side(word, side);
    held = held_share(word, side);
    place = part_place(part);
    """
    inputs = {"word": words, "within": within, "side": side, "part": part}
    outputs = {"seen": "float", "contact": "uint", "found": "uint", "takes": "float", "held": "float", "place": "vec2"}
    got = evaluate(gl.ctx, ["lib/contact.glsl"], body, inputs, outputs)
    bits = (words[:, None] >> np.arange(32)) & 1
    seen = bits[:, :16].mean(axis=1)
    np.testing.assert_allclose(got["seen"], seen)
    np.testing.assert_array_equal(got["contact"], bits[:, 16:].any(axis=1))
    cell = np.floor(within.astype(float) * 4.0).astype(int)
    np.testing.assert_array_equal(got["found"], 2 - bits[np.arange(count), 4 * cell[:, 1] + cell[:, 0]])
    takes = np.select([side == 0, side == 1], [True, seen > 0.0], seen == 0.0)
    np.testing.assert_array_equal(got["takes"], takes)
    np.testing.assert_allclose(got["held"], np.where(side == 1, seen, takes))
    np.testing.assert_allclose(got["place"], np.column_stack([part % 4, part // 4]) / 4.0 - 0.375)
