"""Lights and materials as types: every field written and read back, what each kind is asked, saving over words."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import parameters
from spectrasplat.edit.lights import add_light, light_power, set_light_kind
from spectrasplat.model.fields import Animated, Number, Row
from spectrasplat.model.io.gltf import load_gltf
from spectrasplat.model.io.gltf_write import save_gltf
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.io.scene_table import SceneTable
from spectrasplat.model.io.toml_text import toml_text
from spectrasplat.model.lights import LIGHT_KINDS, Light, PointLight
from spectrasplat.model.lights.light import made
from spectrasplat.model.lights.light_file import light_values, read_light
from spectrasplat.model.materials import (
    MATERIAL_KINDS,
    Absorption,
    Dielectric,
    Diffuse,
    Grating,
    Material,
    Mirror,
    Polariser,
)
from spectrasplat.model.materials.material_file import read_material
from spectrasplat.model.materials.slit import Slit
from spectrasplat.model.optics import catalogue
from spectrasplat.model.optics.colorimetry import VISIBLE_NM
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.placement import Surroundings

pytestmark = pytest.mark.core

AROUND = Surroundings(np.zeros(3), 1.0)
ODD = {
    "position": (1.5, -2.0, 3.25),
    "direction": (0.0, 0.6, -0.8),
    "tangent": (1.0, 0.0, 0.0),
    "shape": "rectangle",
    "radius": 0.75,
    "width": 0.3,
    "height": 2.5,
    "inner_half_angle_deg": 11.0,
    "outer_half_angle_deg": 33.0,
    "angular_diameter_deg": 1.25,
}
"""A value for every attribute that no default has."""


def light_of(kind: str, **changes: object) -> Light:
    given = {"name": "lamp", "spectral_power": illuminant("D65").scaled_to_power(7.0)} | ODD | changes
    return made(LIGHT_KINDS[kind], given)


def read_back(values: dict[str, object], tmp_path: Path) -> Light:
    plain = tomllib.loads(toml_text({"lights": [values]}))["lights"][0]
    return read_light(SceneTable(plain, tmp_path / "scene.toml", "lights[0]"), 0, AROUND)


@pytest.mark.parametrize("shape", ["disc", "rectangle"])
@pytest.mark.parametrize("kind", LIGHT_KINDS)
def test_every_field_of_a_light_is_written_and_read_back(kind: str, shape: str, tmp_path: Path) -> None:
    light = light_of(kind, shape=shape)
    again = read_back(light_values(light), tmp_path)
    # What the other shape would be made of is not in the file.
    unused = {"disc": ("width", "height", "tangent"), "rectangle": ("radius",)}[shape]
    for field in fields(light):
        if field.name == "spectral_power":
            assert again.spectral_power.power_w() == pytest.approx(7.0, rel=1e-14)
        elif not (light.has_outline and field.name in unused):
            assert getattr(again, field.name) == getattr(light, field.name), field.name


@pytest.mark.parametrize("kind", LIGHT_KINDS)
def test_a_misspelt_key_of_every_number_is_met_by_the_right_one(kind: str, tmp_path: Path) -> None:
    for number in light_of(kind).shown_numbers():
        assert isinstance(number, Number)
        key = number.key or number.attribute
        values = light_values(light_of(kind, shape="disc"))
        if key not in values:
            continue  # the file has a size for width and height
        del values[key]
        with pytest.raises(UserError, match=f"did you mean '{key}'"):
            read_back(values | {key[:-1] + "x": 1.0}, tmp_path)


@pytest.mark.parametrize("kind", LIGHT_KINDS)
def test_bounds_of_the_panel_lie_within_those_of_the_file(kind: str) -> None:
    light = light_of(kind)
    for number in light.numbers:
        row = number.row
        assert row is not None and row.label and row.tip
        low, high = number.span(row)
        assert number.holds(low) and (row.bounded_by or number.holds(high))
        assert number.animated is not None


@pytest.mark.parametrize("kind", [*LIGHT_KINDS.values(), *MATERIAL_KINDS.values()], ids=lambda kind: kind.kind)
def test_a_row_says_its_unit_once(kind: type[Light | Material]) -> None:
    for number in (part for part in kind.parts if isinstance(part, Number) and part.row is not None and part.unit):
        assert number.unit not in number.row.format


@pytest.mark.parametrize("kind", LIGHT_KINDS)
def test_a_kind_says_of_itself_what_its_attributes_show(kind: str) -> None:
    light, given = light_of(kind), light_of(kind).given()
    assert light.has_place == ("position" in given) and light.has_direction == ("direction" in given)
    assert light.has_outline == ("shape" in given)
    assert light.is_parallel == (light.reach(3.0) == light.reach(7.0))
    light.check()
    assert light.emits_toward(np.array([light.direction])).all()


def test_kinds_differ_in_what_programs_are_built_for() -> None:
    variants = [light_of(kind).variant for kind in LIGHT_KINDS]
    assert len(set(variants)) == len(variants)
    assert light_of("area").variant != light_of("area", shape="disc").variant


MATERIALS: dict[str, Material] = {
    "glass": Dielectric(catalogue.find("N-SF11"), Absorption(np.linspace(0.1, 0.2, 401)), 3),
    "mirror": Mirror((0.9, 0.5, 0.25)),
    "diffuse": Diffuse((0.1, 0.2, 0.3)),
    "black": MATERIAL_KINDS["black"](),
    "grating": Grating(1234.5, (2, -1), (0.25, 0.5), True, (0.6, 0.0, 0.8)),
    "slit": Slit(width_um=50.0, direction=(0.6, 0.0, 0.8)),
    "polariser": Polariser(0.9, 0.25, 140.0, (0.6, 0.8, 0.0)),
}


@pytest.mark.parametrize("kind", MATERIAL_KINDS)
def test_every_field_of_a_material_is_written_and_read_back(kind: str, tmp_path: Path) -> None:
    material = MATERIALS[kind]
    values = tomllib.loads(toml_text({"materials": {"x": material.values()}}))["materials"]["x"]
    again = read_material(SceneTable(values, tmp_path / "scene.toml", "materials.x"))
    assert type(again) is type(material)
    for field in fields(material):
        one, two = getattr(material, field.name), getattr(again, field.name)
        if isinstance(one, Absorption):
            one, two = one.coefficient.tolist(), two.coefficient.tolist()
        assert one == two, field.name
    assert again.words() == material.words()


def test_a_measured_reflectance_is_read_back(tmp_path: Path) -> None:
    told = {"kind": "diffuse", "reflectance": {"nm": VISIBLE_NM.tolist(), "values": [0.5] * 401}}
    paint = read_material(SceneTable(told, tmp_path / "scene.toml"))
    assert paint.values() == told and paint.receives


@pytest.mark.parametrize("kind", MATERIAL_KINDS)
def test_light_goes_on_lands_or_ends(kind: str) -> None:
    material = MATERIALS[kind]
    assert material.is_specular == (
        material.transmits or material.is_mirror or material.is_grating or material.is_polariser
    )
    assert sum((material.is_specular, material.receives, material.is_black)) == 1
    # (A slit is a grating of one line.)
    assert sorted(cls.gpu_code for cls in MATERIAL_KINDS.values()) == [0, 1, 2, 3, 4, 4, 6]


# -- saving over what a person wrote --------------------------------------------------------

WRITTEN = """# A prism, by hand.
name = "mine"  # short

[camera]
# far away
position = [0, -8, 2]
target = [0, 0, 0]

# the lamps
[[lights]]
name = "left"
kind = "point"
position = [-3, 0, 4] # in the corner
flux_lm = 100

[[lights]]
name = "sun"
kind = "directional"
illuminance_lx = 10_000

[materials.heavy]   # flint
glass = "N-SF11"

[[objects]]
name = "ball"
shape = "sphere"
material = "heavy"
position = [0, 0, 1.0]

[[objects]]
# below
name = "floor"
shape = "plane"
material = "diffuse"
width = 9
height = 9
position = [0, 0, -2]
"""


def test_saving_over_a_file_keeps_what_nobody_changed(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(WRITTEN, encoding="utf-8")
    scene = load_scene(path)
    save_scene(scene, path, words_from=path)
    assert path.read_text(encoding="utf-8") == WRITTEN

    sun = replace(scene.lights[1], angular_diameter_deg=0.5)
    save_scene(replace(scene, lights=(scene.lights[0], sun)), path, words_from=path)
    text = path.read_text(encoding="utf-8")
    assert (
        "position = [-3, 0, 4] # in the corner" in text and "# the lamps" in text and "[materials.heavy]   # fl" in text
    )
    assert "# below" in text and "angular_diameter_deg = 0.5" in text and "10_000" in text
    again = load_scene(path)
    assert again.lights[0] == scene.lights[0] and again.lights[1].angular_diameter_deg == 0.5

    ball = replace(scene.objects[0], material=Dielectric(catalogue.find("N-BK7")))
    more = PointLight("new", illuminant("D65"), (1.0, 1.0, 5.0))
    changed = replace(again, objects=(ball, scene.objects[1]), lights=(*again.lights, more))
    save_scene(changed, path, words_from=path)
    text = path.read_text(encoding="utf-8")
    assert 'glass = "Schott N-BK7"' in text and "in the corner" in text and "width = 9\n" in text
    again = load_scene(path)
    assert [light.name for light in again.lights] == ["left", "sun", "new"]
    assert again.objects[0].material == ball.material
    np.testing.assert_array_equal(again.objects[1].object_to_world, scene.objects[1].object_to_world)

    save_scene(replace(again, objects=(again.objects[1],), lights=(again.lights[2],)), path, words_from=path)
    again = load_scene(path)
    assert [o.name for o in again.objects] == ["floor"] and [light.name for light in again.lights] == ["new"]


def test_a_file_that_is_no_scene_any_more_is_written_anew(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(WRITTEN, encoding="utf-8")
    scene = load_scene(path)
    path.write_text("not [ a scene", encoding="utf-8")
    save_scene(scene, path, words_from=path)
    assert load_scene(path).lights[0] == scene.lights[0]


@pytest.mark.parametrize("name", ["prism", "brilliant_studio", "wine_glass", "globe"])
def test_shipped_scenes_are_saved_over_word_for_word(name: str, tmp_path: Path) -> None:
    source = assets_dir() / "scenes" / f"{name}.toml"
    scene = load_scene(source)
    path = tmp_path / source.name
    text = source.read_text(encoding="utf-8").replace('"../', f'"{assets_dir().as_posix()}/')
    path.write_text(text, encoding="utf-8")
    scene = load_scene(path)
    save_scene(scene, path, words_from=path)
    assert path.read_text(encoding="utf-8") == text


def test_the_default_lamps_are_left_out_again(tmp_path: Path) -> None:
    path = tmp_path / "bare.toml"
    path.write_text('[[objects]]\nshape = "sphere"\n', encoding="utf-8")
    scene = load_scene(path)
    assert scene.lights[0].name == "lamp"
    save_scene(scene, path, words_from=path)
    # The table that was put below is an object now; the rest is as it was.
    assert "lights" not in path.read_text(encoding="utf-8")


# -- the proof by use -----------------------------------------------------------------------


@dataclass(frozen=True)
class Torch(PointLight):
    """A kind of light that nothing else knows of: a point whose glow is counted in candles."""

    candles: float = 1.0

    kind: ClassVar = "torch"
    title: ClassVar = "Torch"
    parts: ClassVar = (Number("candles", 1.0, above=0.0),)
    numbers: ClassVar = (
        Number("candles", 1.0, above=0.0, row=Row("Candles", "How many."), animated=Animated("Candles", 1.0, 9.0)),
    )


def test_a_new_kind_of_light_needs_its_class_and_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(LIGHT_KINDS, "torch", Torch)
    path = tmp_path / "mine.toml"
    path.write_text(WRITTEN.replace('kind = "point"', 'kind = "torch"\ncandles = 3'), encoding="utf-8")
    scene = load_scene(path)
    light = scene.lights[0]
    assert isinstance(light, Torch) and light.candles == 3.0
    assert light_power(light, "flux_lm") == pytest.approx(100)
    save_scene(scene, tmp_path / "again.toml")
    assert load_scene(tmp_path / "again.toml").lights[0].given().keys() == light.given().keys()
    save_gltf(scene, tmp_path / "again.glb")
    again = load_gltf(tmp_path / "again.glb").lights[0]
    assert isinstance(again, Torch) and again.candles == 3.0 and again.position == light.position
    stage = parameters.Stage(scene, scene.camera)
    assert parameters.apply(stage, "lights.left.candles", 5.0).scene.lights[0] == replace(light, candles=5.0)
    made_so = set_light_kind(scene, 1, "torch").lights[1]
    assert isinstance(made_so, Torch) and add_light(scene, "torch").lights[-1].kind == "torch"
    with pytest.raises(UserError, match=r"lights\[0\].candles is -1 but must be above 0"):
        path.write_text(path.read_text(encoding="utf-8").replace("candles = 3", "candles = -1"), encoding="utf-8")
        load_scene(path)
