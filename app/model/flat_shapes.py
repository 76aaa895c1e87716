"""Which objects lie in one plane, and which are all flat facets."""

from __future__ import annotations

import numpy as np

from .scene import SceneObject


def is_flat(item: SceneObject) -> bool:
    """Whether all the object's triangles lie in one plane (relative tolerance 1e-5)."""
    points = item.mesh.vertices
    centred = points - points.mean(axis=0)
    singular = np.linalg.svd(centred, compute_uv=False)
    return bool(singular[-1] <= 1e-5 * max(singular[0], np.finfo(float).tiny))


def is_faceted(item: SceneObject) -> bool:
    """Whether all the object's facets are flat: no interpolated normals."""
    mesh = item.mesh
    if mesh.corner_normals is None:
        return True
    known = np.abs(mesh.corner_normals).sum(axis=2) > 0.0
    cosine = np.einsum("tcj,tj->tc", mesh.corner_normals, mesh.face_normals())
    return bool((~known | (cosine >= 1.0 - 1e-9)).all())
