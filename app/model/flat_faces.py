"""Boxes, steps, rooms and other receivers of few flat faces, as they are rendered: every face a receiver of its own.

A flat receiver has its map in its plane, on a still's own pixels, with borders and lines of contact, and beams draw
into it; charts of what is curved have none of these. Faces keep their object's place among the others, and its name;
the scene that people edit and save keeps its objects.
"""

from __future__ import annotations

from dataclasses import replace

from .scene import Scene, SceneObject

_MOST = 256
"""Receivers: the search for beams visits all of them, and every one has maps of its own."""


def with_flat_faces(scene: Scene) -> Scene:
    """`scene` with its receivers of few flat faces taken apart; itself where there are none, or too many together. The
    same mesh gives the same faces again."""
    objects = tuple(each for item in scene.objects for each in _faces(item))
    return replace(scene, objects=objects) if len(scene.objects) < len(objects) <= _MOST else scene


def _faces(item: SceneObject) -> list[SceneObject]:
    faces = item.mesh.flat_faces if item.material.receives else ()
    return [replace(item, mesh=face) for face in faces] or [item]
