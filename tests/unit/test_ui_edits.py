"""Edits of a scene: what they change, what they leave, and what they refuse."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.edit import edits
from spectrasplat.edit.adding import RECEIVERS, SHAPES, add_object
from spectrasplat.edit.glass import abbe_numbers, set_absorption, set_dispersion, set_dispersion_gain
from spectrasplat.edit.lights import (
    add_light,
    delete_light,
    duplicate_light,
    light_power,
    photometric_key,
    set_light,
    set_light_kind,
    set_light_power,
    set_light_spectrum,
    spectrum_words,
)
from spectrasplat.edit.matrices import decompose
from spectrasplat.edit.objects import (
    add_dabs,
    clear_dabs,
    delete,
    duplicate,
    rename,
    set_diffuse_colour,
    set_material,
    set_position,
    set_rotation,
    set_scale,
    set_transform,
)
from spectrasplat.edit.projection import View
from spectrasplat.edit.requests import Notice
from spectrasplat.edit.state import State
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.lights import LIGHT_KINDS, SpotLight
from spectrasplat.model.optics import catalogue, glass
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Black, Camera, Dab, Dielectric, Diffuse, Mirror, Scene, SceneObject
from spectrasplat.model.scene_defaults import bounds_of, default_light
from spectrasplat.model.scene_objects import make_shape

BLOCK, MIRROR, FLOOR = 0, 1, 2


@pytest.fixture
def scene() -> Scene:
    def at(x: float, z: float) -> np.ndarray:
        matrix = np.eye(4)
        matrix[:3, 3] = (x, 0.0, z)
        return matrix

    box = make_shape("box")
    objects = (
        SceneObject("block", box, Dielectric(catalogue.find("N-SF11"), priority=3), at(0.0, 0.6)),
        SceneObject("mirror", box, Mirror(), at(3.0, 0.6)),
        SceneObject("floor", make_shape("plane", width=20.0, height=20.0), Diffuse(), at(0.0, 0.0)),
    )
    lamp = SpotLight("lamp", illuminant("D65").scaled_to_luminous(90.0), (0.0, 0.0, 5.0), (0.0, 0.0, -1.0))
    return Scene("bench", Camera((0, -9, 4), (0, 0, 0)), (default_light(), lamp), objects)


def reopened(scene: Scene, folder: Path) -> Scene:
    save_scene(scene, folder / "scene.toml")
    return load_scene(folder / "scene.toml")


def refusal(edit, *arguments: object, **more: object) -> str:
    with pytest.raises(UserError) as caught:
        edit(*arguments, **more)
    sentence = str(caught.value)
    assert "\n" not in sentence and len(sentence) > 15
    return sentence


# -- objects --------------------------------------------------------------------------------


def test_edits_change_one_object_and_share_the_rest(scene: Scene) -> None:
    moved = set_position(scene, BLOCK, (1.0, 2.0, 3.0))
    assert tuple(moved.objects[BLOCK].object_to_world[:3, 3]) == (1.0, 2.0, 3.0)
    assert moved.objects[1:] == scene.objects[1:] and moved.objects[BLOCK].mesh is scene.objects[BLOCK].mesh
    assert moved.lights is scene.lights
    assert tuple(scene.objects[BLOCK].object_to_world[:3, 3]) == (0.0, 0.0, 0.6)
    with pytest.raises(ValueError, match="read-only"):
        moved.objects[BLOCK].object_to_world[0, 0] = 2.0


def test_position_rotation_and_scale_are_what_decompose_shows(scene: Scene) -> None:
    changed = set_scale(set_rotation(scene, BLOCK, (10.0, 20.0, 30.0)), BLOCK, (1.0, 2.0, -0.5))
    position, rotation, scale = decompose(changed.objects[BLOCK].object_to_world)
    np.testing.assert_allclose([position, rotation, scale], [(0, 0, 0.6), (10, 20, 30), (1, 2, -0.5)], atol=1e-9)


def test_impossible_places_are_refused(scene: Scene) -> None:
    assert "flatten" in refusal(set_scale, scene, BLOCK, (1.0, 0.0, 1.0))
    assert "flattens" in refusal(set_transform, scene, BLOCK, np.diag([1.0, 1.0, 1e-15, 1.0]))
    assert "finite" in refusal(set_position, scene, BLOCK, (math.nan, 0.0, 0.0))
    assert "inside the glass of 'block'" in refusal(set_position, scene, BLOCK, (0.0, 0.0, 5.0))
    assert "units" in refusal(set_scale, scene, BLOCK, (1e-14, 1e-14, 1e-14))
    set_position(scene, MIRROR, (0.0, 0.0, 5.0))  # a lamp may stand in what is opaque


def test_names_are_trimmed_unique_and_never_empty(scene: Scene) -> None:
    assert rename(scene, BLOCK, "  big  prism ").objects[BLOCK].name == "big prism"
    assert rename(scene, BLOCK, "block").objects[BLOCK].name == "block"
    assert "called 'floor' already" in refusal(rename, scene, BLOCK, "floor")
    assert "needs a name" in refusal(rename, scene, BLOCK, "  ")


def test_duplicates_stand_beside_the_original_and_share_its_mesh(scene: Scene, tmp_path: Path) -> None:
    three = duplicate(duplicate(scene, BLOCK), BLOCK)
    assert [o.name for o in three.objects[3:]] == ["block 2", "block 3"]
    solids = [three.objects[i] for i in (0, 1, 3, 4)]
    assert all(o.mesh is scene.objects[BLOCK].mesh for o in solids)
    boxes = [bounds_of([o]) for o in solids]
    for i, a in enumerate(boxes):
        for b in boxes[:i]:
            assert np.any(a[0] > b[1]) or np.any(b[0] > a[1])
    again = reopened(three, tmp_path)
    assert [o.name for o in again.objects] == [o.name for o in three.objects]
    numbered = duplicate(three, 4)
    assert numbered.objects[-1].name == "block 4"


def test_the_last_receiver_and_the_last_object_stay(scene: Scene) -> None:
    assert [o.name for o in delete(scene, BLOCK).objects] == ["mirror", "floor"]
    assert "only surface that receives" in refusal(delete, scene, FLOOR)
    assert "only surface that receives" in refusal(set_material, scene, FLOOR, Black())
    alone = delete(delete(scene, 0), 0)
    assert "only object" in refusal(delete, alone, 0)


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)])
@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_can_be_added_beside_the_others(scene: Scene, shape: str, up: tuple[float, float, float]) -> None:
    scene = replace(scene, camera=replace(scene.camera, up=up, position=(5.0, 5.0, 5.0)))
    added = add_object(scene, shape)
    item = added.objects[-1]
    assert isinstance(item.material, Diffuse) == (shape in RECEIVERS)
    low, high = bounds_of([item])
    size = np.linalg.norm(high - low)
    assert 0.3 < size < 40.0
    if shape not in RECEIVERS:
        for other in scene.objects[:2]:
            a, b = bounds_of([other])
            assert np.any(low > b) or np.any(high < a)
    assert add_object(added, shape).objects[-1].name == f"{item.name} 2"


def test_added_shapes_are_saved_by_name(scene: Scene, tmp_path: Path) -> None:
    reopened(add_object(scene, "brilliant"), tmp_path)
    text = (tmp_path / "scene.toml").read_text(encoding="utf-8")
    assert 'shape = "brilliant"' in text and [p.name for p in tmp_path.iterdir()] == ["scene.toml"]
    assert "did you mean 'sphere'" in refusal(add_object, scene, "sfere")


def test_colours(scene: Scene) -> None:
    assert set_diffuse_colour(scene, FLOOR, (0.1, 0.2, 0.3)).objects[FLOOR].material == Diffuse((0.1, 0.2, 0.3))
    rough = set_material(scene, MIRROR, Mirror(metal="gold", roughness=0.3))
    coloured = set_diffuse_colour(rough, MIRROR, (0.1, 0.2, 0.3)).objects[MIRROR].material
    assert coloured == Mirror((0.1, 0.2, 0.3), metal="gold", roughness=0.3)
    assert "between 0 and 1" in refusal(set_diffuse_colour, scene, FLOOR, (0.1, 1.2, 0.3))
    assert "no colour" in refusal(set_diffuse_colour, scene, BLOCK, (0.1, 0.2, 0.3))


# -- the brush ------------------------------------------------------------------------------


def test_dabs_are_laid_on_receivers_only_and_go_with_the_material(scene: Scene) -> None:
    dab = Dab((0.0, 0.0, 0.0), 0.5, 1.0)
    painted = add_dabs(add_dabs(scene, FLOOR, [dab]), FLOOR, [dab, dab])
    assert painted.objects[FLOOR].local_dispersion == (dab,) * 3
    assert clear_dabs(painted, FLOOR).objects[FLOOR].local_dispersion == ()
    assert clear_dabs(painted).objects[FLOOR].local_dispersion == ()
    assert clear_dabs(painted).objects[BLOCK] is painted.objects[BLOCK]
    assert "not diffuse" in refusal(add_dabs, scene, BLOCK, [dab])
    two = add_object(painted, "plane")
    assert set_material(two, FLOOR, Black()).objects[FLOOR].local_dispersion == ()


@pytest.mark.parametrize(
    "change",
    [
        {"radius": 0.0},
        {"radius": math.nan},
        {"position": (0.0, math.inf, 0.0)},
        {"falloff": 1.5},
        {"erase": -0.1},
        {"log2_gain": 1e9},
    ],
)
def test_impossible_dabs_are_refused(scene: Scene, change: dict[str, object]) -> None:
    refusal(add_dabs, scene, FLOOR, [replace(Dab((0, 0, 0), 0.5, 1.0), **change)])


# -- glass ----------------------------------------------------------------------------------


def test_a_gain_keeps_n_d_absorption_and_priority(scene: Scene) -> None:
    tinted = set_absorption(scene, BLOCK, (0.5, 0.9, 0.7), 2.0)
    strong = set_dispersion_gain(tinted, BLOCK, 4.0).objects[BLOCK].material
    before = scene.objects[BLOCK].material
    assert isinstance(strong, Dielectric) and isinstance(before, Dielectric)
    assert strong.dispersion.n_d == before.dispersion.n_d and strong.priority == 3 and strong.absorption is not None
    assert strong.dispersion.V_d == pytest.approx(before.dispersion.V_d / 4.0)
    assert set_absorption(tinted, BLOCK, None).objects[BLOCK].material == before
    assert "-1" in refusal(set_dispersion_gain, scene, BLOCK, -1.0)
    assert "must be a positive number" in refusal(set_dispersion_gain, scene, BLOCK, 1e3)
    assert "not made of glass" in refusal(set_dispersion_gain, scene, FLOOR, 2.0)


def test_abbe_numbers_do_not_creep_while_a_slider_is_dragged(scene: Scene) -> None:
    changed = glass.from_abbe(1.6, 30.0)
    for _ in range(1000):
        changed = glass.from_abbe(*abbe_numbers(changed))
    assert abbe_numbers(changed) == (1.6, 30.0)
    assert abbe_numbers(glass.from_abbe(1.6, math.inf)) == (1.6, math.inf)
    stronger = glass.with_gain(glass.from_abbe(1.6, 30.0), 2.0)
    assert abbe_numbers(stronger) == (1.6, 15.0)
    sf11 = scene.objects[BLOCK].material.dispersion
    assert abbe_numbers(sf11) == (sf11.n_d, sf11.V_d)


def test_a_glass_without_data_at_a_lamps_line_is_refused(scene: Scene) -> None:
    laser = set_light_spectrum(scene, 1, "laser", 405.0)
    narrow = glass.cauchy([1.5, 0.01], "X", (450.0, 700.0))
    assert "405 nm" in refusal(set_dispersion, laser, BLOCK, narrow)
    assert "405 nm" in refusal(set_material, laser, BLOCK, Dielectric(narrow))
    assert "405 nm" in refusal(set_light_spectrum, set_dispersion(scene, BLOCK, narrow), 1, "laser", 405.0)


# -- lights ---------------------------------------------------------------------------------


def test_power_is_set_and_read_in_every_unit(scene: Scene) -> None:
    for kind in LIGHT_KINDS:
        for key in {key.key for cls in LIGHT_KINDS.values() for key in cls.power_keys}:
            lit = set_light_kind(scene, 1, kind)
            try:
                lit = set_light_power(lit, 1, 12.5, key)
            except UserError as error:
                assert f"has no {key}" in str(error)
                continue
            assert light_power(lit.lights[1], key) == pytest.approx(12.5)
    assert photometric_key(scene.lights[1]) == "intensity_cd"
    assert light_power(scene.lights[1]) == pytest.approx(90.0)
    assert "0 or more" in refusal(set_light_power, scene, 1, -1.0)


def test_a_light_turned_down_to_nothing_keeps_its_colour(scene: Scene) -> None:
    dark = set_light_power(scene, 1, 0.0)
    assert light_power(dark.lights[1]) == pytest.approx(1e-9)
    assert spectrum_words(set_light_power(dark, 1, 90.0).lights[1].spectral_power) == ("illuminant", "D65")


@pytest.mark.parametrize(
    ("kind", "value"),
    [("illuminant", "A"), ("blackbody", 3200.0), ("laser", 532.25), ("lines", ((435.8, 0.5), (546.1, 0.5)))],
)
def test_a_spectrum_is_set_keeps_the_brightness_and_is_told_back(scene: Scene, kind: str, value: object) -> None:
    lit = set_light_spectrum(scene, 1, kind, value)
    assert light_power(lit.lights[1]) == pytest.approx(90.0)
    told_kind, told = spectrum_words(lit.lights[1].spectral_power)
    assert told_kind == kind
    if kind == "lines":
        np.testing.assert_allclose(np.array(told)[:, 0], [435.8, 546.1])
        assert told[0][1] == pytest.approx(told[1][1])
    else:
        assert told == value


@pytest.mark.parametrize(
    ("kind", "value"),
    [("illuminant", "D66"), ("laser", 1064.0), ("blackbody", 1.0), ("blackbody", "hot"), ("lines", ())],
)
def test_an_impossible_spectrum_is_refused(scene: Scene, kind: str, value: object) -> None:
    refusal(set_light_spectrum, scene, 1, kind, value)


@pytest.mark.parametrize("kind", LIGHT_KINDS)
@pytest.mark.parametrize("start", LIGHT_KINDS)
def test_another_kind_lights_the_objects_as_brightly(scene: Scene, start: str, kind: str) -> None:
    first = set_light_kind(scene, 1, start)
    second = set_light_kind(set_light_kind(first, 1, kind), 1, start)
    assert (
        light_power(second.lights[1]) == pytest.approx(light_power(first.lights[1]), rel=1e-9) or kind == "directional"
    )
    assert second.lights[1].kind == start


@pytest.mark.parametrize("kind", LIGHT_KINDS)
def test_lights_can_be_added_copied_saved_and_deleted(scene: Scene, kind: str, tmp_path: Path) -> None:
    more = duplicate_light(add_light(scene, kind), 2)
    assert [light.name for light in more.lights[2:]] == [f"{kind} light", f"{kind} light 2"]
    assert more.lights[2] != replace(more.lights[3], name=more.lights[2].name)
    again = reopened(more, tmp_path)
    for a, b in zip(more.lights, again.lights, strict=True):
        assert light_power(a) == pytest.approx(light_power(b))
    assert delete_light(more, 2).lights[2].name == f"{kind} light 2"
    alone = delete_light(scene, 0)
    assert "only light" in refusal(delete_light, alone, 0)


@pytest.mark.parametrize("kind", [kind for kind, cls in LIGHT_KINDS.items() if cls.has_place])
@pytest.mark.parametrize("position", [(0.0, -6.0, 1.0), (0.2, -0.2, 9.0), (8.0, 0.0, -0.5)])
def test_a_new_light_is_in_the_picture(scene: Scene, kind: str, position: tuple[float, float, float]) -> None:
    view = View.of(replace(scene.camera, position=position, target=(0.0, 0.0, 0.3)), 1.6)
    light = add_light(scene, kind, view).lights[-1]
    (x, y), depth = view.project(np.array(light.position))
    assert 0.0 < x < 1.0 and 0.0 < y < 1.0 and depth > 0.0


@pytest.mark.parametrize(
    "change",
    [
        {"position": (0.0, 0.0, 0.6)},
        {"position": (math.nan, 0.0, 0.0)},
        {"direction": (0.0, 0.0, 0.0)},
        {"radius": 0.0},
        {"inner_half_angle_deg": 50.0},
        {"outer_half_angle_deg": 91.0},
        {"angular_diameter_deg": -1.0},
        {"name": "sun"},
        {"name": ""},
    ],
)
def test_impossible_lights_are_refused(scene: Scene, change: dict[str, object]) -> None:
    # Of the first kind that has such an attribute.
    kinds = (set_light_kind(scene, 1, kind) for kind in LIGHT_KINDS)
    lit = next(lit for lit in kinds if change.keys() <= lit.lights[1].given().keys())
    refusal(set_light, lit, 1, replace(lit.lights[1], **change))


def test_directions_are_normalised(scene: Scene) -> None:
    lit = set_light(scene, 1, replace(scene.lights[1], direction=(0.0, 3.0, -4.0)))
    assert lit.lights[1].direction == pytest.approx((0.0, 0.6, -0.8))


# -- the rest -------------------------------------------------------------------------------


def test_scene_values(scene: Scene) -> None:
    assert edits.set_background(scene, (0.0, 0.5, 1e3)).background_rgb == (0.0, 0.5, 1e3)
    assert "0 or more" in refusal(edits.set_background, scene, (0.0, -0.1, 0.0))
    assert edits.set_render_defaults(scene, width=640, exposure_ev=-1.5).render.width == 640
    assert "max depth" in refusal(edits.set_render_defaults, scene, max_depth=0)
    assert edits.set_camera(scene, replace(scene.camera, vertical_fov_deg=20.0)).camera.vertical_fov_deg == 20.0
    assert "own position" in refusal(edits.set_camera, scene, replace(scene.camera, target=scene.camera.position))


def test_a_camera_that_looks_straight_down_can_be_saved(scene: Scene, tmp_path: Path) -> None:
    down = replace(scene.camera, position=(0.0, 0.0, 9.0), target=(0.0, 0.0, 0.0))
    saved = edits.set_camera(scene, down)
    assert reopened(saved, tmp_path).camera == saved.camera != down


def test_an_attempt_is_an_edit_or_a_notice(scene: Scene) -> None:
    state = State(scene, scene.camera)
    done = edits.attempt(state, "Rename block", rename, BLOCK, "prism")
    assert done.scene.objects[BLOCK].name == "prism" and done.edit_label == "Rename block" and done.requests == ()
    refused = edits.attempt(state, "Rename block", rename, BLOCK, "floor")
    assert refused.scene is scene
    (notice,) = refused.requests
    assert isinstance(notice, Notice) and notice.is_error and notice.text.startswith("Another object")
    assert notice.text.endswith(".")
