"""Photometric files: read in all their symmetries, refused in one sentence, kept by every kind of file."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reference.lamps import cosine, ies_text, isotropic, lamp, ldt_text, lopsided
from spectrasplat.base import files
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import parameters
from spectrasplat.edit.lights import add_light, light_power, set_light_file, set_light_kind
from spectrasplat.edit.placing import moved_light
from spectrasplat.model.io.gltf import load_gltf
from spectrasplat.model.io.gltf_write import save_gltf
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.lights import IesLight
from spectrasplat.model.lights.ies_file import Profile, read_ies
from spectrasplat.model.optics.spectrum import constant
from spectrasplat.model.scene import Scene

from tests.unit.scene_texts import load

ONE = constant(1.0)


def read(tmp_path: Path, text: str) -> Profile:
    path = tmp_path / "lamp.ies"
    path.write_text(text, encoding="latin-1")
    return read_ies(path)


def at(profile: Profile, vertical_deg: float, horizontal_deg: float) -> float:
    """Candela."""
    found = profile.at(np.radians([vertical_deg]), np.radians([horizontal_deg]))
    return profile.peak_cd * float(found[0])


# -- reading ----------------------------------------------------------------------------------


def shape(vertical: np.ndarray, horizontal: np.ndarray) -> np.ndarray:
    """Symmetric about C0 and about C90."""
    return 100.0 + vertical * (2.0 + np.cos(np.radians(2.0 * horizontal)))


UP = np.arange(0, 181, 10.0)


@pytest.mark.parametrize(
    "text",
    [
        *(ies_text(shape, UP, np.arange(low, high, 15.0)) for low, high in ((0, 91), (0, 181), (0, 361), (90, 271))),
        ies_text(shape, UP, np.arange(0, 346, 15.0)),  # 360 is 0
        *(ldt_text(shape, UP, 24, symmetry) for symmetry in (0, 2, 3, 4)),
        *(text.replace(".", ",") for text in (ldt_text(shape, UP, 24, 0), ies_text(shape, UP, np.arange(0, 91, 15.0)))),
    ],
    ids=[
        "0-90",
        "0-180",
        "0-360",
        "90-270",
        "0-345",
        "ldt 0",
        "ldt 2",
        "ldt 3",
        "ldt 4",
        "ldt, decimal commas",
        "decimal commas",
    ],
)
def test_all_symmetries_are_the_same_lamp(tmp_path: Path, text: str) -> None:
    profile = read(tmp_path, text)
    for v in (0.0, 10.0, 90.0, 170.0, 180.0):
        for h in (-30.0, 0.0, 15.0, 75.0, 90.0, 105.0, 195.0, 255.0, 270.0, 345.0, 360.0):
            assert at(profile, v, h) == pytest.approx(float(shape(np.array(v), np.array(h))), rel=1e-12)
    middle = 0.25 * sum(float(shape(np.array(v), np.array(h))) for v in (20.0, 30.0) for h in (15.0, 30.0))
    assert at(profile, 25.0, 22.5) == pytest.approx(middle, rel=1e-12)


def test_a_half_symmetric_about_c90_is_not_the_one_about_c0(tmp_path: Path) -> None:
    def leaning(v: np.ndarray, h: np.ndarray) -> np.ndarray:
        return 100.0 + 0.5 * v * np.sin(np.radians(h))

    profile = read(tmp_path, ies_text(leaning, [0.0, 90.0, 180.0], np.arange(90, 271, 30.0)))
    assert at(profile, 90.0, 90.0) == pytest.approx(145.0) and at(profile, 90.0, 270.0) == pytest.approx(55.0)
    assert at(profile, 90.0, 30.0) == pytest.approx(at(profile, 90.0, 150.0)) == pytest.approx(122.5)
    np.testing.assert_allclose(
        read(tmp_path, ldt_text(leaning, [0.0, 90.0, 180.0], 12, 3)).intensity, profile.intensity
    )


def test_one_horizontal_angle_is_all_the_way_round(tmp_path: Path) -> None:
    profile = read(tmp_path, cosine())
    np.testing.assert_allclose(
        read(tmp_path, ldt_text(lambda v, h: np.cos(np.radians(v)), np.arange(91.0), 1, 1)).intensity,
        profile.intensity,
        atol=1e-12,
    )
    with pytest.raises(UserError, match="goes on after its 91 candela"):  # of more planes than its symmetry has
        read(tmp_path, ldt_text(lambda v, h: np.cos(np.radians(v)), np.arange(91.0), 1, 1) + "0.5\n")
    assert at(profile, 60.0, 0.0) == at(profile, 60.0, 217.0) == pytest.approx(25.0)
    assert at(profile, 91.0, 0.0) == 0.0 and profile.cone_rad == pytest.approx(0.5 * math.pi)


def test_lamps_that_shine_up(tmp_path: Path) -> None:
    profile = read(tmp_path, ies_text(lambda v, h: 0.0 * v + 70.0, [90.0, 120.0, 180.0]))
    assert at(profile, 89.9, 0.0) == 0.0 and at(profile, 90.0, 0.0) == at(profile, 180.0, 0.0) == 70.0
    assert profile.integral_sr == pytest.approx(2.0 * math.pi, rel=1e-4)


def test_factors_multiply(tmp_path: Path) -> None:
    one = read(tmp_path, lopsided())
    both = read(tmp_path, lopsided().replace("1 1000 1 ", "1 1000 2.5 ").replace("\n1 1 0\n", "\n0.8 0.5 60\n"))
    assert both.peak_cd == pytest.approx(one.peak_cd)
    np.testing.assert_allclose(both.intensity, one.intensity)


def test_forms_of_the_file(tmp_path: Path) -> None:
    plain = read(tmp_path, isotropic())
    tilted = isotropic().replace("TILT=NONE", "TILT=INCLUDE\n1\n3\n0 45 90\n1.0 0.9 0.8")
    for text in (
        isotropic().partition("TILT")[1] + isotropic().partition("TILT")[2],  # 1986: no first line
        isotropic().replace("IESNA:LM-63-1995", "IESNA91"),
        isotropic().replace("\n", "\r\n"),
        isotropic() + "\x1a",
        isotropic().replace(" ", ",  ").replace("TILT=NONE", "TILT = NONE".replace(" ", "")),
        tilted,
        isotropic().replace("[TEST]", "[MANUFAC] Léuchte\n[TEST]"),
    ):
        np.testing.assert_array_equal(read(tmp_path, text).intensity, plain.intensity)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (isotropic(), 4.0 * math.pi),
        (ies_text(lambda v, h: 1.0 + 0.0 * v, [0.0, 45.0, 90.0]), 2.0 * math.pi),
        # ∫ (1 − θ/π) sin θ dθ = 1: linear stretches are integrated exactly.
        (ies_text(lambda v, h: 180.0 - v, [0.0, 60.0, 180.0]), 2.0 * math.pi),
        (cosine(0.5), math.pi),
    ],
)
def test_the_integral(tmp_path: Path, text: str, expected: float) -> None:
    assert read(tmp_path, text).integral_sr == pytest.approx(expected, rel=2e-5)


def test_the_shipped_lamp_is_what_its_script_says() -> None:
    text = (assets_dir() / "lights" / "downlight.ies").read_text(encoding="ascii")
    assert text.startswith("IESNA:LM-63-2002")
    profile = read_ies(assets_dir() / "lights" / "downlight.ies")
    assert profile.peak_cd == 900.0 and at(profile, 30.0, 0.0) > at(profile, 30.0, 90.0)


# -- refusals ---------------------------------------------------------------------------------

LDT = ldt_text(shape, UP, 24, 4)
GOOD = ies_text(lambda v, h: 5.0 + 0.0 * v, [0.0, 45.0, 90.0], [0.0, 45.0, 90.0])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "is empty"),
        ("hello\nworld\n", "has no line TILT="),
        (GOOD[: GOOD.index("5 5")], "ends within candela"),
        (GOOD[:-4], "ends within candela"),
        (GOOD + "7 7 7\n", "goes on after its 9 candela"),
        (GOOD.replace("0 45 90\n0 45 90", "0 90 45\n0 45 90"), "vertical angles that do not ascend"),
        (GOOD.replace("0 45 90\n0 45 90", "0 45 90\n90 45 0"), "horizontal angles that do not ascend"),
        (GOOD.replace("0 45 90\n0 45 90", "0 45 80\n0 45 90"), "vertical angles that do not run"),
        (GOOD.replace("0 45 90\n0 45 90", "0 45 90\n0 45 70"), "horizontal angles that run neither"),
        (GOOD.replace(" 3 3 1 2 ", " 0 3 1 2 "), "says it has 0 vertical angles"),
        (GOOD.replace(" 3 3 1 2 ", " 3 9999999 1 2 "), "says it has 1e+07 horizontal angles"),
        (GOOD.replace(" 3 3 1 2 ", " 3 3 2 2 "), "photometric type B and only type C is read; export it as type C"),
        (GOOD.replace(" 3 3 1 2 ", " 3 3 3 2 "), "photometric type A"),
        (GOOD.replace("5 5 5\n", "5 nan 5\n", 1), "not finite among candela"),
        (GOOD.replace("5 5 5\n", "5 inf 5\n", 1), "not finite among candela"),
        (GOOD.replace("5 5 5\n", "5 five 5\n", 1), "has something among candela that is no number"),
        (GOOD.replace("5 5 5\n", "5 -5 5\n", 1), "negative or too large"),
        (GOOD.replace("5 5 5\n", "5 1e300 5\n").replace("1 1 0\n", "1e300 1 0\n"), "negative or too large"),
        (GOOD.replace("5 5 5\n", "0 0 0\n"), "gives no light in any direction"),
        (
            GOOD.replace("TILT=NONE", "TILT=lamp.tlt"),
            "keeps its tilt factors in another file, which is not read; write TILT=",
        ),
        (GOOD.replace("TILT=NONE", "TILT=INCLUDE\n1\n999"), "ends within the factors for a tilted lamp"),
        (GOOD.replace("0 45 90\n0 45 90", "0 45 90\n0 45 200"), "horizontal angles that run neither"),
        (LDT.replace("\r\n2\r\n1\r\nLED", "\r\n0\r\n1\r\nLED"), "does not say which lamps it has"),
        (LDT[: len(LDT) // 2], "ends within"),
        (LDT.replace("\r\n4\r\n24", "\r\n4\r\n22"), "has 22 C planes, which its symmetry 4 does not allow"),
        (LDT.replace("\r\n1200\r\n", "\r\n-5\r\n"), "negative or too large"),
    ],
)
def test_what_cannot_be_read_is_said_in_one_sentence(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(UserError) as caught:
        read(tmp_path, text)
    sentence = str(caught.value)
    assert told in sentence and "lamp.ies" in sentence and "; " in sentence and "\n" not in sentence


# -- in scenes --------------------------------------------------------------------------------

SCENE = """[[lights]]
name = "lamp"
kind = "ies"
file = "lamp.ies"
position = [1, 0, 5]
direction = [0, 0.6, -0.8]
{more}
[[objects]]
shape = "sphere"
[[objects]]
shape = "plane"
material = "diffuse"
position = [0, 0, -1]
"""


def scene(tmp_path: Path, more: str = "", text: str | None = None) -> Scene:
    (tmp_path / "lamp.ies").write_text(text or lopsided(), encoding="ascii")
    return load(tmp_path, SCENE.format(more=more))


def test_its_power_is_the_files_own_or_what_lumens_says(tmp_path: Path) -> None:
    own = scene(tmp_path).lights[0]
    assert isinstance(own, IesLight) and own.spectral_power.luminous() == pytest.approx(own.profile.peak_cd)
    lumens = scene(tmp_path, "lumens = 800").lights[0]
    assert lumens.spectral_power.luminous() * lumens.profile.integral_sr == pytest.approx(800.0)
    assert light_power(lumens) == pytest.approx(800.0) and lumens.power_keys[0].key == "lumens"


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ("lumen = 800", "unknown key 'lights[0].lumen', did you mean 'lumens'?"),
        ("lumens = 800\nintensity_cd = 3", "cannot stand beside"),
    ],
)
def test_bad_keys(tmp_path: Path, more: str, told: str) -> None:
    with pytest.raises(UserError) as caught:
        scene(tmp_path, more)
    assert told in str(caught.value)


def test_a_bad_file_is_blamed_on_its_key(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"scene.toml: lights\[0\].file cannot be used: .*lamp.ies has no line TILT="):
        scene(tmp_path, text="nothing")
    with pytest.raises(UserError, match=r"lights\[0\].file names .*none.ies, which is not a file"):
        load(tmp_path, SCENE.format(more="").replace("lamp.ies", "none.ies"))


@pytest.mark.parametrize("more", ["", "rotation_deg = 70\ntangent = [0, 0.8, 0.6]\nlumens = 800"])
@pytest.mark.parametrize("suffix", [".toml", ".glb", ".gltf"])
def test_every_kind_of_scene_file_keeps_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, more: str
) -> None:
    monkeypatch.setenv(files.ENVIRONMENT, str(tmp_path))
    before = scene(tmp_path, more)
    (tmp_path / "elsewhere").mkdir()
    path = tmp_path / "elsewhere" / f"saved{suffix}"
    if suffix == ".toml":
        save_scene(before, path)
        assert 'file = "../lamp.ies"' in path.read_text(encoding="utf-8")
        after = load_scene(path)
    else:
        save_gltf(before, path)
        after = load_gltf(path)
    one, two = before.lights[0], after.lights[0]
    assert isinstance(one, IesLight) and isinstance(two, IesLight) and one.profile == two.profile
    assert two.rotation_deg == one.rotation_deg
    np.testing.assert_allclose(two.axes(), one.axes(), atol=1e-12)
    assert two.spectral_power.power_w() == pytest.approx(one.spectral_power.power_w())


# -- turning ----------------------------------------------------------------------------------


def shine(light: IesLight, directions: np.ndarray) -> np.ndarray:
    """Intensity in world directions (N, 3)."""
    axis, (u, v) = np.asarray(light.direction), light.across
    return light.profile.at(
        np.arctan2(np.linalg.norm(np.cross(directions, axis), axis=-1), directions @ axis),
        np.arctan2(directions @ v, directions @ u),
    )


def test_a_hanging_lamp_has_its_angles_where_the_standard_says(tmp_path: Path) -> None:
    light = lamp(tmp_path, ONE, lopsided())
    angle = np.radians([0.0, 40.0, 90.0, 210.0])
    outward = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(4)])
    np.testing.assert_allclose(shine(light, outward), light.profile.at(np.full(4, 0.5 * math.pi), angle))
    turned = replace(light, rotation_deg=25.0)
    np.testing.assert_allclose(
        shine(turned, outward), light.profile.at(np.full(4, 0.5 * math.pi), angle - math.radians(25.0))
    )


def test_the_gizmo_and_an_animation_turn_all_of_it(tmp_path: Path) -> None:
    light = lamp(tmp_path, ONE, lopsided(), rotation_deg=20.0)
    c, s = math.cos(0.7), math.sin(0.7)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    delta = np.eye(4)
    delta[:3, :3] = turn
    directions = np.random.default_rng(3).normal(size=(64, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    moved = moved_light(light, delta)
    np.testing.assert_allclose(shine(moved, directions @ turn.T), shine(light, directions), atol=1e-12)
    animated = parameters._with_light(light, "rotation.x", math.degrees(0.7))
    np.testing.assert_allclose(shine(animated, directions @ turn.T), shine(light, directions), atol=1e-12)


# -- edits ------------------------------------------------------------------------------------


def test_a_file_makes_a_lamp_of_any_light(tmp_path: Path) -> None:
    before = scene(tmp_path, text=cosine())
    path = tmp_path / "other.ies"
    path.write_text(lopsided(), encoding="ascii")
    for start in ("point", "directional", "area", "ies"):
        lit = set_light_file(set_light_kind(before, 0, start), 0, path).lights[0]
        assert isinstance(lit, IesLight) and lit.profile.source == str(path)
        assert lit.spectral_power.luminous() == pytest.approx(lit.profile.peak_cd)
    more = set_light_file(before, None, path)
    assert [light.name for light in more.lights] == ["lamp", "ies light"]
    with pytest.raises(UserError, match="not a file"):
        set_light_file(before, 0, tmp_path / "none.ies")


def test_a_new_one_begins_with_the_shipped_lamp(tmp_path: Path) -> None:
    lit = add_light(scene(tmp_path), "ies").lights[1]
    assert isinstance(lit, IesLight) and Path(lit.profile.source).name == "downlight.ies"
