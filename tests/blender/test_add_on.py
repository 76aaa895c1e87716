"""The Blender add-on. What needs Blender runs in a Python that has `bpy` (this one, or the one that
SPECTRASPLAT_BPY_PYTHON names); the rest with a stand-in that lets the file be imported and nothing more."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import time
import types
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import spectrasplat as ss
from spectrasplat.base.image_io import read_image
from spectrasplat.model.io.gltf import load_gltf
from spectrasplat.model.staging import Y_UP_TO_Z_UP

ROOT = Path(__file__).resolve().parents[2]
ADD_ON = ROOT / "integrations" / "blender" / "spectrasplat_blender.py"


@pytest.fixture(scope="module")
def add_on() -> Any:
    """The file as a module, in a world whose `bpy` has names and does nothing."""
    stub: Any = types.ModuleType("bpy")
    stub.types = types.SimpleNamespace(
        **{name: type(name, (), {}) for name in ("PropertyGroup", "AddonPreferences", "Operator", "Panel", "Object")}
    )
    properties = ("String", "Float", "FloatVector", "Pointer", "Int")
    stub.props = types.SimpleNamespace(**{f"{name}Property": lambda **told: None for name in properties})
    before = sys.modules.get("bpy")
    sys.modules["bpy"] = stub
    try:
        described = importlib.util.spec_from_file_location("spectrasplat_blender", ADD_ON)
        assert described is not None and described.loader is not None
        module = importlib.util.module_from_spec(described)
        described.loader.exec_module(module)
    finally:
        del sys.modules["bpy"]
        if before is not None:
            sys.modules["bpy"] = before
    return module


@pytest.fixture
def program(tmp_path: Path) -> list[str]:
    """The command as it is installed: found whatever PYTHONPATH its caller has."""
    file = tmp_path / "bin" / "spectrasplat"
    file.parent.mkdir()
    path = os.environ.get("PYTHONPATH", "")
    file.write_text(f"#!/bin/sh\nPYTHONPATH='{path}' exec '{sys.executable}' -m spectrasplat \"$@\"\n")
    file.chmod(0o755)
    return [str(file)]


@pytest.fixture
def exported(tmp_path: Path) -> Path:
    """As Blender's exporter leaves it: opaque where it has no word, no area lamps."""
    scene = ss.load(
        {
            "camera": {"position": [0.0, 2.0, 5.0], "target": [0.0, 0.0, 0.0], "up": [0.0, 1.0, 0.0]},
            "lights": [{"kind": "directional", "direction": [0.0, -1.0, 0.0], "illuminance_lx": 683.0}],
            "objects": [
                {"name": "ball", "shape": "sphere", "radius": 0.5, "position": [0.0, 1.2, 0.0], "glass": "N-BK7"},
                {
                    "name": "table",
                    "shape": "plane",
                    "width": 4.0,
                    "height": 4.0,
                    "rotation_deg": [-90.0, 0.0, 0.0],
                    "material": "diffuse",
                },
                {"name": "old caustic", "shape": "box", "size": [1, 1, 1], "position": [3, 3, 3]},
            ],
        }
    )
    from spectrasplat.model.io.gltf_write import save_gltf

    path = tmp_path / "scene.glb"
    save_gltf(scene._model, path)
    return path


def test_the_file_says_what_blender_asks(add_on: Any) -> None:
    assert add_on.bl_info["blender"] == (4, 2, 0) and callable(add_on.register) and callable(add_on.unregister)
    assert add_on.SpectraSplatPreferences.bl_idname == add_on.__name__


def test_glass_gets_dispersion_and_area_lamps_are_sent(add_on: Any, exported: Path) -> None:
    document, chunks = add_on.read_glb(exported)
    for material, name in zip(document["materials"], ("glass", "wood"), strict=True):
        material.clear()
        material["name"] = name
    glass = {"ior": 1.7, "abbe": 25.0, "glass": "", "colour": [1.0, 0.5, 0.5], "distance": 2.0}
    add_on.add_glass(document, {"glass": glass})
    add_on.leave_out(document, {"old caustic"})
    turned = [[1, 0, 0, 0.5], [0, 1, 0, -1.0], [0, 0, 1, 3.0], [0, 0, 0, 1]]  # Blender's: 3 above, shining down
    lamp = {"kind": "area", "shape": "rectangle", "size": [0.5, 0.25], "flux_lm": 683.0}
    matrix = add_on.gltf_matrix(turned)
    add_on.add_area_lights(document, [{"name": "softbox", "matrix": matrix, "colour": [1.0, 1.0, 1.0], "light": lamp}])
    add_on.write_glb(exported, document, chunks)
    scene = load_gltf(exported)
    assert [item.name for item in scene.objects] == ["ball", "table"]
    sent = scene.objects[0].material
    assert (sent.dispersion.n_d, sent.dispersion.V_d) == pytest.approx((1.7, 25.0), rel=1e-4)
    assert sent.absorption is not None and scene.objects[1].material.receives
    light = next(light for light in scene.lights if light.name == "softbox")
    assert light.position == pytest.approx((0.5, 3.0, 1.0)) and light.direction == pytest.approx((0.0, -1.0, 0.0))
    assert light.flux_factor * light.spectral_power.luminous() == pytest.approx(683.0, rel=1e-3)


def test_a_named_glass_is_the_catalogues(add_on: Any, exported: Path) -> None:
    document, chunks = add_on.read_glb(exported)
    document["materials"][0] = {"name": "glass"}
    add_on.add_glass(
        document, {"glass": {"ior": 1.5, "abbe": 0.0, "glass": "N-SF11", "colour": [1, 1, 1], "distance": 0.0}}
    )
    add_on.write_glb(exported, document, chunks)
    assert load_gltf(exported).objects[0].material.dispersion.name.endswith("N-SF11")


def test_places_turn_as_blenders_own_exporter_turns_them(add_on: Any) -> None:
    place = np.array([1.0, 2.0, 3.0])
    assert add_on.blender_place(place) == tuple((Y_UP_TO_Z_UP[:3, :3] @ place).tolist())
    matrix = np.array(add_on.gltf_matrix([[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])).reshape(4, 4).T
    assert np.array_equal(Y_UP_TO_Z_UP @ matrix, [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])


@pytest.mark.slow
def test_the_program_bakes_and_is_stopped(add_on: Any, exported: Path, program: list[str], tmp_path: Path) -> None:
    job = add_on.Job(program, exported, "table", tmp_path / "map.exr", 48, 3_000, 1)
    placement = job.result()
    assert placement["kind"] == "rectangle" and not job.is_running
    rgb = read_image(tmp_path / "map.exr").rgb
    corner = {name: np.array(place) for name, place in placement["corners_world"].items()}
    height, width = rgb.shape[:2]
    v, u = (np.indices((height, width)) + 0.5) / np.array([height, width])[:, None, None]
    points = corner["top_left"] + u[..., None] * (corner["top_right"] - corner["top_left"])
    points = points + v[..., None] * (corner["bottom_left"] - corner["top_left"])
    middle = (rgb[..., 1, None] * points).sum(axis=(0, 1)) / rgb[..., 1].sum()
    assert middle == pytest.approx([0.0, 0.0, 0.0], abs=0.05)

    wrong = add_on.Job(program, exported, "tabel", tmp_path / "wrong.exr", 48, 3_000, 1)
    with pytest.raises(RuntimeError, match="exit code 2.*did you mean 'table'"):
        wrong.result()

    long = add_on.Job(program, exported, "table", tmp_path / "long.exr", 48, 10**9, 1)
    time.sleep(1.5)
    assert long.is_running
    long.cancel()
    assert not long.is_running and not (tmp_path / "long.exr").exists()


def test_progress_is_read_from_what_the_program_prints(add_on: Any, tmp_path: Path) -> None:
    script = tmp_path / "spectrasplat"
    script.write_text(
        "#!/bin/sh\necho 'scene: 43 % after 10 s, baking, about 14 s left' >&2\necho 'note: a lamp was added' >&2\n"
        'echo \'{"kind": "charts"}\' > "$5".json\nmv "$5".json "${5%.exr}.json"\n'
    )
    script.chmod(0o755)
    job = add_on.Job([str(script)], "s.glb", "table", tmp_path / "m.exr", 64, 0, 1)
    assert job.result() == {"kind": "charts"} and job.share == 0.43 and job.notes == ["a lamp was added"]


def test_a_program_that_is_not_there_is_noticed(add_on: Any, program: list[str], tmp_path: Path) -> None:
    assert add_on.find_program(program[0]) == program
    assert add_on.find_program(str(tmp_path / "nothing")) is None


BPY = os.environ.get("SPECTRASPLAT_BPY_PYTHON") or (sys.executable if find_spec("bpy") else None)


@pytest.mark.slow
@pytest.mark.skipif(BPY is None, reason="no Python with bpy: pip install bpy, or set SPECTRASPLAT_BPY_PYTHON")
def test_a_round_trip_of_a_glass_and_a_table(program: list[str], tmp_path: Path) -> None:
    """The caustic comes back where it was made and as strong: in units of the sun that Cycles shows beside it, as much
    as Fresnel lets through a ball."""
    assert BPY is not None and shutil.which(BPY) is not None
    around = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    command = [BPY, str(Path(__file__).with_name("round_trip.py")), str(ADD_ON), program[0], str(tmp_path)]
    done = subprocess.run(command, env=around, capture_output=True, text=True, check=False, timeout=900)
    assert done.returncode == 0, done.stdout + done.stderr
    told = json.loads((tmp_path / "told.json").read_text())
    assert "Choose a receiver first" in told["without a receiver"]
    assert told["result"] == told["again"] == ["FINISHED"] and told["objects"].count("table caustic") == 1
    assert told["plain sun"] == pytest.approx(1.0, abs=1e-3)
    assert told["middle"] == pytest.approx([0.4, -0.2], abs=0.02)
    assert told["through the ball"] == pytest.approx(expected_share(1.5168), rel=0.04)
    assert told["colours"] == pytest.approx([1.0, 1.0, 1.0], abs=0.01)


def expected_share(n: float, radius: float = 0.5, above: float = 1.2, reach: float = 3.0) -> float:
    """Of the light that meets a ball over a table that reaches so far, what arrives there: by two refractions, or by
    reflection on its side. Fresnel's equations, over rings of equal area; what is reflected inside is left out."""
    height = np.sqrt((np.arange(100_000) + 0.5) / 100_000)
    angle, inner = np.arcsin(height), np.arcsin(height / n)
    outside, inside = np.cos(angle), np.cos(inner)
    across = ((outside - n * inside) / (outside + n * inside)) ** 2
    along = ((n * outside - inside) / (n * outside + inside)) ** 2

    def arriving(share: np.ndarray, bent: np.ndarray, outward: np.ndarray, up: np.ndarray) -> float:
        """`bent`: angle from straight down, outward; from a place so far from the axis and above the centre."""
        down = bent < 0.499 * np.pi
        landing = outward + (above + up) * np.tan(np.where(down, bent, 0.0))
        return float((share * (down & (np.abs(landing) < reach))).mean())

    through = 0.5 * (1.0 - across) ** 2 + 0.5 * (1.0 - along) ** 2
    leaves = 2.0 * inner - angle  # the place on the ball where it does, from straight below
    refracted = arriving(through, 2.0 * (angle - inner), -radius * np.sin(leaves), -radius * np.cos(leaves))
    reflected = arriving(0.5 * (across + along), np.pi - 2.0 * angle, radius * height, radius * outside)
    return refracted + reflected
