"""A scene of `scenes/*.toml` as other renderers can take it: one glass solid, one lamp, one grey rectangle in z = 0.

`export` writes `scene.json` (numbers), `glass.npz` (corners and normals of the triangles, float32 (T, 3, 3) each),
`glass.ply` and `scene.bin` (for tracer.cpp). Exporting needs SpectraSplat; what reads them needs numpy alone.
Powers are spectral: W/sr/nm of a spotlight, W/(sr unit² nm) of an area; the spectrum is flat, 401 bins of 1 nm.
"""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
SCENES = ("prism", "ball", "brilliant", "gem", "goblet")
BAND_NM = 401.0
RGB_TO_XYZ = np.array([[0.41239, 0.35758, 0.18048], [0.21264, 0.71517, 0.07219], [0.01933, 0.11919, 0.95053]])
"""Of linear Rec.709."""


def unit(vector: Any) -> np.ndarray:
    """float64 (3,) of length 1."""
    vector = np.asarray(vector, dtype=float)
    return vector / np.linalg.norm(vector)


def described(name: str) -> dict[str, Any]:
    """The scene file's numbers in terms of every renderer; directions are unit vectors, `right` is the picture's."""
    table = tomllib.loads((HERE / "scenes" / f"{name}.toml").read_text(encoding="utf-8"))
    camera, lamp = table["camera"], table["lights"][0]
    glass, receiver = table["objects"]
    forward = unit(np.subtract(camera["target"], camera["position"]))
    right = unit(np.cross(forward, (0.0, 0.0, 1.0)))
    direction = unit(np.subtract(lamp["target"], lamp["position"]))
    # As SpectraSplat has it; a spot may be turned about its axis.
    guide = np.array(lamp.get("tangent", np.cross((0.0, 0.0, 1.0), direction)))
    tangent = unit(guide - (guide @ direction) * direction)
    is_area = lamp["kind"] == "area"
    return {
        "name": name,
        "size": table["render"]["size"],
        "camera": {
            "position": camera["position"],
            "target": camera["target"],
            "right": right.tolist(),
            "up": np.cross(right, forward).tolist(),
            "forward": forward.tolist(),
            "vertical_fov_deg": camera["vertical_fov_deg"],
        },
        "lamp": {
            "is_area": is_area,
            "position": lamp["position"],
            "target": lamp["target"],
            "direction": direction.tolist(),
            "tangent": tangent.tolist(),
            "bitangent": np.cross(direction, tangent).tolist(),
            "strength": lamp["radiance_w_sr_m2" if is_area else "intensity_w_sr"] / BAND_NM,
            "half_angle_deg": lamp.get("half_angle_deg", 90.0),
            "size": lamp.get("size", [0.0, 0.0]),
        },
        "cauchy": glass["material"]["cauchy"],
        "albedo": receiver["material"]["colour"],
        "receiver": [receiver["width"], receiver["height"]],
        "sphere": [*glass["position"], glass["radius"]] if glass["shape"] == "sphere" else None,
    }


def index(scene: dict[str, Any], wavelength_nm: float) -> float:
    """Cauchy's n = A + B / λ², λ in µm."""
    a, b = scene["cauchy"]
    return float(a + b * 1e6 / wavelength_nm**2)


def export(name: str, folder: Path) -> dict[str, Any]:
    """Writes the scene's files into `folder` and returns what scene.json holds."""
    from spectrasplat.model.io.scene_file import load_scene
    from spectrasplat.model.optics.colorimetry import cmf_xyz

    scene = described(name)
    folder.mkdir(parents=True, exist_ok=True)
    glass = load_scene(HERE / "scenes" / f"{name}.toml").objects[0]
    mesh = glass.mesh.transformed(glass.object_to_world)
    corners = mesh.corners().astype(np.float32)
    smooth = mesh.corner_normals is not None
    flat = np.repeat(mesh.face_normals()[:, None], 3, axis=1)
    normals = (mesh.corner_normals if mesh.corner_normals is not None else flat).astype(np.float32)
    scene |= {"smooth": smooth, "cmf": cmf_xyz().tolist()}
    (folder / "scene.json").write_text(json.dumps(scene), encoding="utf-8")
    np.savez(folder / "glass.npz", corners=corners, normals=normals)
    _write_ply(folder / "glass.ply", corners, normals if smooth else None)
    _write_numbers(folder / "scene.bin", scene, corners, normals)
    return scene


def load(folder: Path) -> dict[str, Any]:
    """What `export` wrote: scene.json's numbers with `corners` and `normals`."""
    scene = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
    with np.load(folder / "glass.npz") as arrays:
        return scene | {"corners": arrays["corners"], "normals": arrays["normals"]}


def receiver_corners(scene: dict[str, Any]) -> np.ndarray:
    """The receiver's corners, float64 (4, 3), anticlockwise from above."""
    x, y = np.multiply(scene["receiver"], 0.5)
    return np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])


def lamp_corners(scene: dict[str, Any]) -> np.ndarray:
    """An area lamp's corners, float64 (4, 3), anticlockwise seen from where it shines."""
    lamp = scene["lamp"]
    s, t = np.multiply(lamp["tangent"], lamp["size"][0] / 2), np.multiply(lamp["bitangent"], lamp["size"][1] / 2)
    return np.add(lamp["position"], [-s - t, s - t, s + t, -s + t])


def wavelengths(scene: dict[str, Any], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths, nm (count,), each in the middle of an equal share of x̄ + ȳ + z̄, and the X, Y, Z (count, 3) that a
    radiance of 1 W/(sr unit² nm) all over that share has: how a renderer without dispersion is given one."""
    nm, cmf = np.arange(380.0, 781.0), np.array(scene["cmf"])
    cumulative = np.cumsum(cmf.sum(axis=1))
    cumulative /= cumulative[-1]
    chosen = np.interp((np.arange(count) + 0.5) / count, cumulative, nm)
    share = np.minimum((cumulative * count).astype(int), count - 1)
    return chosen, 683.002 * np.array([cmf[share == k].sum(axis=0) for k in range(count)])


def accumulate(scene: dict[str, Any], count: int, render: Any) -> np.ndarray:
    """X, Y, Z float64 (height, width, 3) from `count` grey pictures: `render(number, n)` gives the radiance of a lamp
    of strength 1 with glass of index n."""
    width, height = scene["size"]
    total = np.zeros((height, width, 3))
    for number, (nm, xyz) in enumerate(zip(*wavelengths(scene, count), strict=True)):
        grey = np.asarray(render(number, index(scene, nm)), dtype=float)
        total += scene["lamp"]["strength"] * grey[..., None] * xyz
    return total


def _write_ply(path: Path, corners: np.ndarray, normals: np.ndarray | None) -> None:
    count = len(corners)
    properties = "xyz" if normals is None else ("x", "y", "z", "nx", "ny", "nz")
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {3 * count}"]
    header += [f"property float {name}" for name in properties]
    header += [f"element face {count}", "property list uchar int vertex_indices", "end_header\n"]
    rows = corners if normals is None else np.concatenate([corners, normals], axis=2)
    faces = np.zeros(count, dtype=[("sides", "u1"), ("corner", "<i4", 3)])
    faces["sides"], faces["corner"] = 3, np.arange(3 * count).reshape(-1, 3)
    path.write_bytes("\n".join(header).encode() + rows.astype("<f4").tobytes() + faces.tobytes())


def _write_numbers(path: Path, scene: dict[str, Any], corners: np.ndarray, normals: np.ndarray) -> None:
    camera, lamp = scene["camera"], scene["lamp"]
    numbers = [
        *scene["size"],
        *camera["position"],
        *camera["right"],
        *camera["up"],
        *camera["forward"],
        np.tan(np.radians(camera["vertical_fov_deg"]) / 2),
        lamp["is_area"],
        *lamp["position"],
        *lamp["direction"],
        *lamp["tangent"],
        *lamp["bitangent"],
        lamp["strength"],
        np.cos(np.radians(lamp["half_angle_deg"])),
        *lamp["size"],
        *scene["cauchy"],
        scene["albedo"],
        *np.multiply(scene["receiver"], 0.5),
        *np.ravel(scene["cmf"]),
        *(scene["sphere"] or (0.0, 0.0, 0.0, 0.0)),
        scene["smooth"],
        len(corners),
    ]
    path.write_bytes(b"".join(np.asarray(part, dtype="<f4").tobytes() for part in (numbers, corners, normals)))
