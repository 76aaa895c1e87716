"""What the rays of a reference can meet, gathered from a scene's objects: triangles, curved surfaces where known."""

from __future__ import annotations

import numpy as np

from ..model.geometry.mesh import Mesh
from ..model.scene import Scene, SceneObject
from .exact_shapes import FORM_SIZE, pieces, placed


class Surfaces:
    """T surfaces, added object by object; their frame is the world's about one position."""

    def __init__(self) -> None:
        self._corners: list[np.ndarray] = []
        self._rows: list[np.ndarray] = []
        self._forms: list[np.ndarray] = []
        self._normals: list[np.ndarray] = []
        self._corner_normals: list[np.ndarray] = []

    def add(self, index: int, item: SceneObject, mesh: Mesh, centre: np.ndarray) -> None:
        """Object number `index`, with its `mesh` in the world: as curved surfaces where these are known."""
        exact = [placed(piece, item.object_to_world, centre) for piece in pieces(item)]
        count = len(exact) or len(mesh.triangles)
        rows = np.full((count, 3), -1, np.int32)
        rows[:, 0] = index
        smooth = None
        if exact:
            boxes = np.array([(box.min(axis=0), box.max(axis=0)) for _, box in exact])
            rows[:, 2] = len(self._forms) + np.arange(count)
            self._forms += [form for form, _ in exact]
            self._corners.append(np.stack([boxes[:, 0], boxes[:, 1], boxes.mean(axis=1)], axis=1))
            self._normals.append(np.zeros((count, 3)))
        else:
            rows[:, 1] = np.arange(count)
            self._corners.append(mesh.corners() - centre)
            self._normals.append(mesh.face_normals())
            smooth = mesh.corner_normals if item.material.is_specular else None
        self._corner_normals.append(np.zeros((count, 3, 3)) if smooth is None else smooth)
        self._rows.append(rows)

    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Corners (T, 3, 3), of a curved surface those of its box; and int32 (T,) each: object, triangle of its mesh
        (-1: curved), row of `forms` (-1: triangle)."""
        rows = np.ascontiguousarray(np.concatenate(self._rows).T)
        return np.concatenate(self._corners), rows[0], rows[1], rows[2]

    def forms(self) -> np.ndarray:
        """float64 (Q, FORM_SIZE)."""
        return np.array(self._forms) if self._forms else np.zeros((1, FORM_SIZE))

    def normals(self, order: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """In this order: geometric normals (T, 3), the row of each surface's corner normals (-1: flat, curved, or not
        specular), and the rows (S, 9)."""
        corner = np.concatenate(self._corner_normals)[order]
        known = (np.abs(corner).sum(axis=2) > 0.0).all(axis=1)
        index = np.full(len(order), -1, np.int32)
        index[known] = np.arange(np.count_nonzero(known))
        packed = corner[known].reshape(-1, 9)
        return (
            np.ascontiguousarray(np.concatenate(self._normals)[order]),
            index,
            np.ascontiguousarray(packed) if len(packed) else np.zeros((1, 9)),
        )


def specular_corners(scene: Scene, centre: np.ndarray) -> np.ndarray:
    """Triangles that cover glass and mirrors as a light sees them, float64 (S, 3, 3) about `centre`.

    Of curved surfaces they are the mesh's, swollen by twice what that falls short.
    """
    found = [np.zeros((0, 3, 3))]
    for item in scene.objects:
        if item.material.is_specular:
            mesh = item.mesh.transformed(item.object_to_world)
            normals = mesh.corner_normals if pieces(item) else None
            swollen = 0.0 if normals is None else 2.0 * _sagitta(mesh.corners(), normals) * normals
            found.append(mesh.corners() - centre + swollen)
    return np.concatenate(found)


def _sagitta(corners: np.ndarray, normals: np.ndarray) -> float:
    """How far an arc rises above the longest chord of a smooth mesh: an eighth of chord times turn of the normals."""
    chord = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    turn = np.linalg.norm(np.roll(normals, -1, axis=1) - normals, axis=2)
    return float((chord * turn).max()) / 8.0
