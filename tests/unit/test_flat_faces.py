"""Receivers of few flat faces become one receiver a face, as they are rendered."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.model.flat_faces import with_flat_faces
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.geometry.primitives import box, prism, sphere
from spectrasplat.model.materials import Dielectric, Diffuse
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.scene import Camera, Scene, SceneObject

pytestmark = pytest.mark.core


def test_faces_make_up_their_object() -> None:
    whole = box((1.0, 2.0, 3.0))
    faces = whole.flat_faces
    assert len(faces) == 6 and all(face.is_flat for face in faces)
    assert sum(face.areas().sum() for face in faces) == pytest.approx(22.0)
    corners = np.concatenate([face.corners() for face in faces]).reshape(-1, 9)
    assert sorted(map(tuple, corners)) == sorted(map(tuple, whole.corners().reshape(-1, 9)))
    # The same mesh has the same faces: what an edit does not touch is recognised by them.
    assert whole.flat_faces is faces and all(face.whole is whole for face in faces)


def test_planes_far_apart_and_slivers() -> None:
    """Steps of a stair lie in planes of their own; a triangle of no width belongs to the plane that holds it."""
    step = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    stair = np.concatenate([step, step + [1, 0, 0.3], step + [2, 0, 0]])
    quads = np.array([[0, 1, 2], [0, 2, 3]])
    sliver = [[0, 1, 1 + 8]]
    triangles = np.concatenate([quads, quads + 4, quads + 8, sliver])
    faces = make_mesh("stair", stair, triangles).flat_faces
    assert sorted(face.areas().sum() for face in faces) == pytest.approx([1.0, 2.0])
    assert sum(len(face.triangles) for face in faces) == 7


def test_who_is_taken_apart() -> None:
    """Only receivers, and no mesh of more faces than maps are worth, nor one that is shaded as if it were round."""
    items = {
        "table": SceneObject("table", box((1, 1, 1)), Diffuse()),
        "glass": SceneObject("glass", prism(60.0, 1.0, 1.0), Dielectric(find("N-BK7"))),
        "stone": SceneObject("stone", sphere(1.0, 500), Diffuse()),
    }
    scene = Scene("s", Camera((0, 0, 9), (0, 0, 0)), (), tuple(items.values()))
    found = with_flat_faces(scene)
    assert [item.name for item in found.objects] == [*["table"] * 6, "glass", "stone"]
    assert found.objects[6] is items["glass"] and found.objects[7] is items["stone"]
    alone = Scene("s", scene.camera, (), (items["glass"], items["stone"]))
    assert with_flat_faces(alone) is alone
