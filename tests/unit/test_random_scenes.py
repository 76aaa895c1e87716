"""Scenes drawn by chance: the same seed, the same scenes; all load; all kinds come up; nothing stands in another."""

from __future__ import annotations

import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.bench.random_scenes import random_scene, random_scenes, scene_name
from spectrasplat.bench.random_solids import PLAIN, WIDER
from spectrasplat.model.io.scene_file import load_scene

MANY = 60


@pytest.fixture(scope="module")
def drawn() -> list[dict]:
    return [random_scene(7, number) for number in range(MANY)]


def test_a_seed_and_a_number_say_the_scene(tmp_path: Path) -> None:
    first, again, other = (random_scene(seed, 3) for seed in (5, 5, 6))
    assert first == again and first != other and first["name"] == scene_name(5, 3)
    random_scenes(2, 5, tmp_path)
    (tmp_path / "more").mkdir()
    random_scenes(3, 5, tmp_path / "more")
    for number in range(2):
        name = f"{scene_name(5, number)}.toml"
        assert (tmp_path / name).read_bytes() == (tmp_path / "more" / name).read_bytes()


def test_nothing_stands_in_another(tmp_path: Path) -> None:
    for scene in random_scenes(12, 9, tmp_path).values():
        bounds = [(o.name, o.world_bounds) for o in scene.objects if not o.material.receives]
        for (a, one), (b, other) in combinations(bounds, 2):
            middle = 0.5 * (one.sum(axis=0) - other.sum(axis=0))
            # Boxes of turned solids may meet where these do not.
            assert np.linalg.norm(middle[:2]) > 1.2, (a, b)


def test_scenes_of_all_kinds_load_and_stand(tmp_path: Path) -> None:
    for name, scene in random_scenes(40, 3, tmp_path, "all").items():
        assert load_scene(tmp_path / f"{name}.toml").lights == scene.lights
        assert any(o.material.is_specular for o in scene.objects) and any(o.material.receives for o in scene.objects)
        # Data that end within the spectrum, and dispersion wider than any glass has: asked for.
        assert all("nearest value" in note or "nature does not" in note for note in scene.notes), scene.notes
        low = {o.name: o.world_bounds[0, 2] for o in scene.objects if o.name not in ("table", "wall")}
        assert min(low.values()) > 0.0, (name, low)


def test_all_kinds_come_up() -> None:
    drawn = [random_scene(5, number, "all") for number in range(150)]
    objects = [item for values in drawn for item in values["objects"]]
    names = {re.sub(r" \d+( inside)?$", "", item["name"]) for item in objects}
    assert {*PLAIN, *WIDER, "grating", "white ball", "board"} <= names
    assert {light["kind"] for values in drawn for light in values["lights"]} >= {"spot", "collimated", "area", "point"}
    materials = [item["material"] for item in objects if isinstance(item.get("material"), dict)]
    assert {material["kind"] for material in materials} == {"glass", "mirror", "grating", "diffuse"}
    assert any("absorption" in material for material in materials) and any("V_d" in material for material in materials)
    assert any("roughness" in item for item in objects) and any("dispersion_gain" in item for item in objects)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--random", "0"), "--random 0 is out of range"),
        (("--random", "few"), "--random 'few' is not a whole number"),
        (("--random", "2", "--random-seed", "-1"), "--random-seed -1 is out of range"),
        (("--random-seed", "3"), "--random N how many"),
        (("--random-kinds", "all"), "--random N how many"),
        (("--random", "2", "--random-kinds", "some"), "--random-kinds 'some' is unknown, known are plain, all"),
        (("--random", "2", "--random-kinds", ""), "--random-kinds '' is unknown"),
        (("prism", "--random", "2"), "leave out prism"),
    ],
)
def test_bad_values_are_one_sentence(
    options: tuple[str, ...], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench-agreement", *options, "-o", str(tmp_path / "found")]) == 2
    said = capsys.readouterr().err
    assert sentence in said and said.count("\n") <= 2
    assert not (tmp_path / "found").exists()
