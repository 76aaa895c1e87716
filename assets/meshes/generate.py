"""Makes the shipped meshes, so that their shapes can be changed and nobody owns them but us.

Run from the project's folder: `python -m assets.meshes.generate` (or `python assets/meshes/generate.py`).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import Mesh, make_mesh, normalised
from spectrasplat.model.io.gltf_write import save_gltf
from spectrasplat.model.io.mesh_io import save_ply
from spectrasplat.model.optics import catalogue
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import (
    Absorption,
    Camera,
    Dielectric,
    Diffuse,
    Light,
    Scene,
    SceneObject,
)

HERE = Path(__file__).resolve().parent


def trefoil_knot(radius: float = 0.5, tube: float = 0.13, along: int = 168, around: int = 20) -> Mesh:
    """A tube round a trefoil knot, lying across z: a smooth solid no primitive gives.

    The frame follows the curve by projection of its own derivative, so the tube closes
    without a twist; the normals are those of the tube.
    """
    t = 2.0 * np.pi * np.arange(along) / along
    curve = (
        radius
        / 3.0
        * np.stack([np.sin(t) + 2.0 * np.sin(2.0 * t), np.cos(t) - 2.0 * np.cos(2.0 * t), -np.sin(3.0 * t)], axis=1)
    )
    first = np.stack(
        [np.cos(t) + 4.0 * np.cos(2.0 * t), -np.sin(t) + 4.0 * np.sin(2.0 * t), -3.0 * np.cos(3.0 * t)], axis=1
    )
    tangent = normalised(first)
    # The curve winds about z and never runs straight away from it, so this is never along the tangent.
    across = normalised(curve * (1.0, 1.0, 0.0)) + np.array([0.0, 0.0, 0.35])
    normal = normalised(across - np.einsum("ij,ij->i", across, tangent)[:, None] * tangent)
    binormal = np.cross(tangent, normal)
    s = 2.0 * np.pi * np.arange(around) / around
    radial = np.cos(s)[None, :, None] * normal[:, None] + np.sin(s)[None, :, None] * binormal[:, None]
    vertices = (curve[:, None] + tube * radial).reshape(-1, 3)
    k, j = (g.ravel() for g in np.meshgrid(np.arange(along), np.arange(around), indexing="ij"))
    a, b = k * around + j, ((k + 1) % along) * around + j
    c, d = ((k + 1) % along) * around + (j + 1) % around, k * around + (j + 1) % around
    triangles = np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)])
    return make_mesh("trefoil knot", vertices, triangles, radial.reshape(-1, 3)[triangles])


def gems() -> Scene:
    """A glTF scene as another program would hand it over: y up, a spot light, three tinted stones."""
    stone = primitives.brilliant(1.0)
    # Table up: the stone's z becomes glTF's y.
    y_up = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])
    tints = {"clear": (1.0, 1.0, 1.0), "rose": (0.9, 0.45, 0.5), "sea": (0.4, 0.8, 0.85)}
    objects = []
    for index, (name, colour) in enumerate(tints.items()):
        absorption = Absorption.of_colour(colour, 1.0) if min(colour) < 1.0 else None
        matrix = y_up.copy()
        matrix[:3, 3] = (1.35 * (index - 1), 0.45, 0.25 * (index % 2))
        glass = catalogue.find("diamond" if name == "clear" else "N-SF11")
        objects.append(SceneObject(name, stone, Dielectric(glass, absorption), matrix))
    floor = y_up.copy()
    floor[1, 3] = 0.0
    objects.append(SceneObject("table", primitives.plane(14.0, 14.0), Diffuse((0.75, 0.75, 0.75)), floor))
    aim = np.array([0.35, -1.0, 0.3])
    aim /= np.linalg.norm(aim)
    lamp = Light(
        "lamp",
        "spot",
        illuminant("D65").scaled_to_luminous(9000.0),
        tuple((-6.0 * aim + (0.0, 0.4, 0.0)).tolist()),
        tuple(aim.tolist()),
        None,
        18.0,
        22.0,
    )
    camera = Camera((0.6, 3.4, 5.4), (0.15, 0.2, 0.2), (0.0, 1.0, 0.0), vertical_fov_deg=34.0)
    return Scene("gems", camera, (lamp,), tuple(objects))


def main() -> None:
    """Write every mesh beside this file."""
    save_ply(trefoil_knot(), HERE / "trefoil_knot.ply")
    save_gltf(gems(), HERE / "gems.glb")


if __name__ == "__main__":
    main()
