"""Boxes, steps, rooms and other receivers of few flat faces, as they are rendered: every face a receiver of its own.

A flat receiver has its map in its plane, on a still's own pixels, with borders and lines of contact, and beams draw
into it; charts of what is curved have none of these. An object's first face stays in its place, the others follow
behind all objects; the scene that people edit and save keeps its objects.
"""

from __future__ import annotations

from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from .geometry.mesh import Mesh, coplanar
from .scene import Scene, SceneObject
from .scene_checks import MAX_OBJECTS

_MOST_FACES = 12
"""Of an object: each has maps of its own, however few pixels see it."""
_faces: WeakKeyDictionary[Mesh, tuple[Mesh, ...]] = WeakKeyDictionary()


def with_flat_faces(scene: Scene) -> Scene:
    """`scene` with its receivers of few flat faces taken apart; itself where there are none. The same mesh gives the
    same faces again."""
    objects, more = list(scene.objects), list[SceneObject]()
    for i, item in enumerate(scene.objects):
        if item.material.receives and not item.mesh.is_flat:
            first, *others = faces_of(item.mesh)
            objects[i] = replace(item, mesh=first) if others else item
            more += [replace(item, mesh=face) for face in others]
    if not more or len(objects) + len(more) > MAX_OBJECTS:
        return scene
    return replace(scene, objects=(*objects, *more))


def faces_of(mesh: Mesh) -> tuple[Mesh, ...]:
    """The flat faces of a mesh; itself where there are too many of them, or where it is shaded as if it were curved."""
    if mesh not in _faces:
        planes = coplanar(mesh, _MOST_FACES) if mesh.is_faceted else None
        _faces[mesh] = (mesh,) if planes is None else tuple(_face(mesh, rows) for rows in planes)
    return _faces[mesh]


def _face(mesh: Mesh, rows: np.ndarray) -> Mesh:
    used, corners = np.unique(mesh.triangles[rows], return_inverse=True)
    return replace(
        mesh,
        vertices=mesh.vertices[used],
        triangles=corners.reshape(-1, 3).astype(np.int32),
        corner_normals=None,
        uv=None if mesh.uv is None else mesh.uv[rows],
    )
