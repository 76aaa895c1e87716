"""Parameters by path, their interpolation, key files, and what is said where they are wrong."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.animation import Track, keyed, parse_range, read_keys, tracks_of, turntable, with_turntable
from spectrasplat.edit.parameters import Stage, apply, apply_all, paths, value_of
from spectrasplat.edit.state import Key
from spectrasplat.model.io.scene_file import load_scene

GAIN = "objects.prism.dispersion_gain"


@pytest.fixture(scope="module")
def stage() -> Stage:
    scene = load_scene(assets_dir() / "scenes" / "default.toml")
    return Stage(scene, scene.camera, 1.5)


def test_every_parameter_reads_back_what_was_set_and_changes_nothing_else(stage: Stage) -> None:
    known = paths(stage.scene, stage.camera)
    assert {
        GAIN,
        "camera.orbit_deg",
        "lights.slit.power",
        "objects.table.position.z",
        "objects.diamond.V_d",
        "solo_nm",
    } <= set(known)
    relative = {"orbit_deg", "elevation_deg", "power"}
    for path, known_parameter in known.items():
        before = value_of(stage, path)
        value = {"V_d": 33.0, "n_d": 1.7, "solo_nm": 520.0}.get(path.rsplit(".", 1)[-1], before + 0.5)
        assert known_parameter.low <= value <= known_parameter.high, path
        after = apply(stage, path, value)
        is_relative = path.rsplit(".", 1)[-1] in relative or ".rotation." in path
        assert value_of(after, path) == pytest.approx(before if is_relative else value, rel=1e-4), path
        others = [p for p in known if p.partition(".")[0] != path.partition(".")[0]]
        assert all(value_of(after, p) == value_of(stage, p) for p in others[::7]), path


def test_setting_what_is_there_leaves_the_glass_itself(stage: Stage) -> None:
    assert apply(stage, GAIN, 1.0).scene.objects[0].material == stage.scene.objects[0].material
    stronger = apply(stage, GAIN, 2.0).scene.objects[0].material.dispersion
    plain = stage.scene.objects[0].material.dispersion
    assert stronger.n_d == plain.n_d and stronger.V_d == pytest.approx(plain.V_d / 2)
    edited = apply(apply(stage, GAIN, 2.0), "objects.prism.V_d", 40.0).scene.objects[0].material.dispersion
    assert edited.gain == 2.0 and edited.V_d == pytest.approx(20.0, rel=1e-3) and edited.n_d == pytest.approx(plain.n_d)


def test_orbit_keeps_distance_and_height_and_comes_back(stage: Stage) -> None:
    quarter = apply(stage, "camera.orbit_deg", 90.0).camera
    arm = np.subtract(stage.camera.position, stage.camera.target)
    turned = np.subtract(quarter.position, quarter.target)
    assert turned == pytest.approx((-arm[1], arm[0], arm[2]))
    whole = apply(stage, "camera.orbit_deg", 360.0).camera
    assert whole.position == pytest.approx(stage.camera.position)
    above = apply(stage, "camera.elevation_deg", 170.0).camera
    assert np.subtract(above.position, above.target)[2] == pytest.approx(
        np.linalg.norm(arm) * math.sin(math.radians(89.9))
    )


def test_turns_are_about_the_objects_own_place_and_the_order_of_keys_does_not_matter(stage: Stage) -> None:
    values = {"objects.prism.rotation.z": 30.0, "objects.prism.position.x": 2.0, "objects.prism.rotation.x": 10.0}
    one, other = apply_all(stage, values), apply_all(stage, dict(reversed(values.items())))
    assert np.array_equal(one.scene.objects[0].object_to_world, other.scene.objects[0].object_to_world)
    assert one.scene.objects[0].object_to_world[0, 3] == 2.0
    turned = apply(stage, "objects.prism.rotation.z", 77.0).scene.objects[0].object_to_world
    assert np.array_equal(turned[:3, 3], stage.scene.objects[0].object_to_world[:3, 3])
    assert abs(np.linalg.det(turned[:3, :3])) == pytest.approx(1.0)


def test_lights(stage: Stage) -> None:
    dimmed = apply(stage, "lights.slit.power", 0.25).scene.lights[0]
    assert dimmed.spectral_power.power_w() == pytest.approx(0.25 * stage.scene.lights[0].spectral_power.power_w())
    turned = apply(stage, "lights.slit.rotation.z", 90.0).scene.lights[0]
    x, y, z = stage.scene.lights[0].direction
    assert turned.direction == pytest.approx((-y, x, z))
    tangent = stage.scene.lights[0].tangent
    assert tangent is not None and turned.tangent == pytest.approx((-tangent[1], tangent[0], tangent[2]))


def test_names_that_hold_dots(stage: Stage) -> None:
    item = replace(stage.scene.objects[0], name="lens no. 1.5")
    dotted = replace(stage, scene=replace(stage.scene, objects=(item, *stage.scene.objects[1:])))
    assert (
        value_of(apply(dotted, "objects.lens no. 1.5.dispersion_gain", 3.0), "objects.lens no. 1.5.dispersion_gain")
        == 3.0
    )


@pytest.mark.parametrize(
    ("path", "value", "told"),
    [
        ("objects.prism.dispersion_gian", 1.0, "objects.prism.dispersion_gain"),
        ("objects.prims.dispersion_gain", 1.0, GAIN),
        ("objects.table.dispersion_gain", 1.0, "objects.table"),
        ("nonsense", 1.0, "exposure_ev"),
        (GAIN, -1.0, "between 0 and 100"),
        ("camera.fov_deg", 180.0, "between 0.01 and 179"),
        ("solo_nm", math.nan, "between 380 and 780"),
    ],
)
def test_wrong_paths_and_values_are_told(stage: Stage, path: str, value: float, told: str) -> None:
    with pytest.raises(UserError) as error:
        apply(stage, path, value)
    assert told in str(error.value) and "\n" not in str(error.value)


def test_interpolations() -> None:
    track = Track("p", (0.0, 1.0, 3.0, 4.0), (0.0, 2.0, 2.0, 6.0), ("linear", "smooth", "hold", "smooth"))
    assert [track.at(t) for t in (-1.0, 0.0, 0.25, 1.0, 2.0, 3.5, 3.999, 4.0, 9.0)] == [
        0.0,
        0.0,
        0.5,
        2.0,
        2.0,
        2.0,
        2.0,
        6.0,
        6.0,
    ]
    smooth = Track("p", (0.0, 1.0, 2.0, 5.0), (0.0, 1.0, 4.0, 5.0), ("smooth",) * 4)
    fine = [smooth.at(t) for t in np.linspace(0, 5, 501)]
    assert all(b >= a - 1e-12 for a, b in pairwise(fine))  # rising keys: nothing overshoots
    assert [smooth.at(t) for t in smooth.times_s] == pytest.approx(smooth.values)
    assert smooth.at(0.02) < 0.02 * 0.1  # eases in
    step = 1e-6
    for t in smooth.times_s[1:-1]:  # no kink at a key
        assert (smooth.at(t + step) - smooth.at(t)) / step == pytest.approx(
            (smooth.at(t) - smooth.at(t - step)) / step, rel=1e-4
        )


def test_turntables_loop_and_leave_the_light_alone(stage: Stage) -> None:
    once = turntable(stage, 8, 24.0)
    angles = [once.tracks[0].at(t) for t in once.times_s]
    assert angles == pytest.approx([45.0 * i for i in range(8)])
    assert once.frame(3).scene is stage.scene
    both = with_turntable(keyed(stage, [Track(GAIN, (0.0, 1.0), (0.0, 3.0), ("smooth", "smooth"))], 5, 24.0))
    assert {track.path for track in both.tracks} == {GAIN, "camera.orbit_deg"}
    assert value_of(both.frame(4), GAIN) == 3.0
    assert turntable(stage, 1, 24.0).frame(0).camera == stage.camera


def test_frames_of_keys(stage: Stage) -> None:
    tracks = tracks_of([Key(1.0, GAIN, 2.0), Key(0.0, GAIN, 1.0), Key(0.5, "solo_nm", 500.0), Key(1.0, GAIN, 4.0)])
    assert tracks[0] == Track(GAIN, (0.0, 1.0), (1.0, 4.0), ("smooth", "smooth"))
    made = keyed(stage, tracks, None, 24.0)
    assert len(made.times_s) == 25 and made.times_s[-1] == 1.0
    assert made.frame(24).solo_nm == 500.0 and value_of(made.frame(0), GAIN) == 1.0
    with pytest.raises(UserError, match="nothing to animate"):
        keyed(stage, [], 3, 24.0)


def test_key_files(stage: Stage, tmp_path: Path) -> None:
    file = tmp_path / "keys.toml"
    file.write_text(
        f'[[keys]]\ntime_s = 0\nparameter = "{GAIN}"\nvalue = 0\ninterpolation = "linear"\n[[keys]]\ntime_s = 2\n'
        f'parameter = "{GAIN}"\nvalue = 3\n'
    )
    (track,) = read_keys(file, stage)
    assert track == Track(GAIN, (0.0, 2.0), (0.0, 3.0), ("linear", "smooth"))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "holds no keys"),
        ("[[keys", "is not TOML"),
        ("keys = 3", "holds no keys"),
        ("frames = 3\n[[keys]]\n", "unknown key 'frames'"),
        ('[[keys]]\nparameter = "solo_nm"\nvalue = 500\n', "keys[0].time_s is missing"),
        ('[[keys]]\ntime_s = 0\nparameter = "solo_nm"\nvalue = 5\n', "between 380 and 780"),
        ('[[keys]]\ntime_s = 0\nparameter = "solo"\nvalue = 500\n', "solo_nm"),
        (
            '[[keys]]\ntime_s = 0\nparameter = "solo_nm"\nvalue = 500\ninterpolation = "smoth"\n',
            "did you mean 'smooth'",
        ),
        ('[[keys]]\ntime_s = 0\nparameter = "solo_nm"\nvalue = 500\nease = 1\n', "unknown key 'keys[0].ease'"),
    ],
)
def test_bad_key_files_name_file_and_key(stage: Stage, tmp_path: Path, text: str, told: str) -> None:
    file = tmp_path / "keys.toml"
    file.write_text(text)
    with pytest.raises(UserError) as error:
        read_keys(file, stage)
    assert "keys.toml" in str(error.value) and told in str(error.value)


def test_ranges_on_the_command_line(stage: Stage) -> None:
    assert parse_range(f"{GAIN}=0:3:1", stage, 2.0) == Track(GAIN, (0.0, 1.0, 2.0), (0.0, 3.0, 1.0), ("smooth",) * 3)
    for text, told in (
        ("gain", "PARAMETER=FROM:TO"),
        (f"{GAIN}=3", "FROM:TO"),
        (f"{GAIN}=a:b", "FROM:TO"),
        (f"{GAIN}=0:999", "between 0 and 100"),
    ):
        with pytest.raises(UserError, match=told):
            parse_range(text, stage, 1.0)


def test_what_would_fail_in_the_middle_is_told_before_the_first_frame(stage: Stage) -> None:
    through_zero = Track("objects.prism.V_d", (0.0, 1.0), (-20.0, 20.0), ("linear", "linear"))
    with pytest.raises(UserError, match=r"at 0\.5 s: .*V_d is 0"):
        keyed(stage, [through_zero], 5, 24.0)
    with pytest.raises(UserError, match="fewer a second"):
        keyed(stage, [through_zero], None, 1e9)
