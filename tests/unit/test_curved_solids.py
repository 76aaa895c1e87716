"""Which objects are met as curved solids, and that their faces are those of the meshes that stand for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.features.features import Features
from spectrasplat.gpu.gpu_space import GpuSpace
from spectrasplat.gpu.scene_geometry import Curved
from spectrasplat.model.curved_solids import MOST_FACES, curved_solids, faces_of
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import Mesh, note_recipe
from spectrasplat.model.scene import Dielectric, Diffuse, Mirror, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.reference.scene_surfaces import as_triangles
from spectrasplat.stress.rigs.scene_parts import BEAM, FLINT, TABLE, UNDER_GLASS

GLASS = Dielectric(FLINT)
CYLINDER = [[0.0, -0.3], [0.4, -0.3], [0.4, 0.3], [0.0, 0.3]]


def described(shape: str, **sizes) -> Mesh:
    """A mesh as a scene file's keys make it."""
    function = primitives.solid_of_revolution if shape == "revolution" else getattr(primitives, shape)
    mesh = function(**sizes)
    note_recipe(mesh, {"shape": shape, **sizes})
    return mesh


def placed(mesh: Mesh, at: tuple[float, float, float] = (0.0, 0.0, 2.0), material=GLASS) -> SceneObject:
    matrix = np.eye(4)
    matrix[:3, 3] = at
    return SceneObject("solid", mesh, material, matrix)


def scene_of(*objects: SceneObject) -> Scene:
    return Scene("test", UNDER_GLASS, (BEAM,), (TABLE, *objects))


SHAPES = {
    "ball": ("sphere", {"radius": 0.7}, 1),
    "ellipsoid": ("ellipsoid", {"semi_axes": (0.7, 0.4, 0.2)}, 1),
    "lens": ("lens", {"radius1": 1.0, "radius2": -2.0, "thickness": 0.4, "diameter": 0.9}, 3),
    "plane and convex": ("lens", {"radius1": float("inf"), "radius2": -0.8, "thickness": 0.3, "diameter": 0.6}, 3),
    "lens by default": ("lens", {}, 3),
    "cylinder": ("revolution", {"profile": CYLINDER, "segments": 64}, 3),
}


@pytest.mark.parametrize("name", SHAPES)
def test_faces_are_where_the_meshes_corners_are(name: str) -> None:
    shape, sizes, count = SHAPES[name]
    item = placed(described(shape, **sizes))
    faces = faces_of(item)
    assert len(faces) == count and set(curved_solids(scene_of(item))) == {1}
    corners = item.mesh.corners()
    outside = np.stack([face.distance(corners) for face in faces])
    # On one face, and within the others.
    assert np.abs(outside.max(axis=0)).max() < 1e-9
    # Placed with a stretch, in GPU space: each triangle lies on the face it is said to stand for.
    matrix = np.diag([2.0, 1.0, 0.5, 1.0])
    matrix[:3, 3] = 3.0, -2.0, 5.0
    item = replace(item, object_to_world=matrix)
    scene = scene_of(item)
    space = GpuSpace.of(scene)
    curved, _ = Curved.of(scene, space, {1: faces})
    corners = space.to_gpu(item.mesh.transformed(matrix).corners())
    number = curved.primitives(1, corners) & 0x3FFFFFFF
    for own, triangle in zip(number, corners, strict=True):
        assert np.abs(curved.faces[own].distance(triangle)).max() < 1e-6
    assert set(number) == set(range(count))


@pytest.mark.parametrize(
    ("shape", "sizes"),
    [
        ("lens", {"conic1": -1.0}),
        ("lens", {"radius1": -2.0, "radius2": -1.0}),
        # The sphere of the first face ends before the lens does.
        ("lens", {"radius1": 0.5, "radius2": float("inf"), "thickness": 3.0, "diameter": 0.98}),
        ("torus", {}),
        ("revolution", {"profile": [[0.0, -0.3], [0.4, -0.3], [0.3, 0.3], [0.0, 0.3]]}),
        ("revolution", {"profile": CYLINDER, "crease_deg": 120.0}),
        ("box", {}),
    ],
)
def test_other_shapes_stay_triangles(shape: str, sizes: dict) -> None:
    assert not faces_of(placed(described(shape, **sizes)))


def test_what_touches_something_round_or_receives_or_has_no_description_stays_triangles() -> None:
    ball = described("sphere", radius=0.5)
    assert curved_solids(scene_of(placed(ball)))
    assert curved_solids(scene_of(placed(ball, material=Mirror())))
    assert not curved_solids(scene_of(placed(ball, material=Diffuse())))
    on_the_table = placed(ball, at=(0.0, 0.0, 0.5))
    assert curved_solids(scene_of(on_the_table))
    beside_it = placed(described("sphere", radius=0.3), at=(0.0, 0.79, 0.5), material=Diffuse())
    assert not curved_solids(scene_of(on_the_table, beside_it))
    assert not curved_solids(as_triangles(scene_of(placed(ball))))


def test_glass_in_glass_is_met_exactly_all_or_not_at_all() -> None:
    outer, inner = placed(described("sphere", radius=0.5)), placed(described("sphere", radius=0.3))
    assert set(curved_solids(scene_of(outer, inner))) == {1, 2}
    meshed = placed(primitives.torus())
    assert not curved_solids(scene_of(outer, inner, meshed))
    in_a_box = placed(primitives.box((2.0, 2.0, 2.0)))
    assert set(curved_solids(scene_of(outer, in_a_box))) == {1}


def test_many_go_to_the_tree() -> None:
    ball = described("sphere", radius=0.1, triangles=20)
    row = [placed(ball, at=(float(i), 0.0, 2.0)) for i in range(MOST_FACES + 1)]
    assert len(curved_solids(scene_of(*row[1:]))) == MOST_FACES and not curved_solids(scene_of(*row))


@pytest.mark.parametrize("name", ["ball", "ellipsoid", "lens"])
def test_records_are_the_same_in_micrometres_and_in_metres(name: str) -> None:
    """The shader normalises gradients whose square is above 1e-12: those of a bead of 1e-6 units were below."""
    shape, sizes, _ = SHAPES[name]

    def records(unit: float) -> np.ndarray:
        scaled = {key: (unit * np.array(value)).tolist() for key, value in sizes.items()}
        scene = scene_of(placed(described(shape, **scaled), (0.0, 0.0, 2.0 * unit)))
        return Curved.of(scene, GpuSpace.of(scene), curved_solids(scene))[1]["PIECES"]

    assert records(2.0**-20).tobytes() == records(1.0).tobytes() == records(2.0**20).tobytes()


def test_features_hold_no_triangles_for_them() -> None:
    scene = scene_of(placed(described("sphere", radius=0.5)))
    exact, meshed = (Features.of(s, RenderSettings()) for s in (scene, as_triangles(scene)))
    assert exact.curved_solids and exact.normal_derivatives and not exact.smooth_normals and not exact.tree
    assert not meshed.curved_solids and meshed.smooth_normals and meshed.tree
