"""Normals of mesh files: what is cut is flat although its normals were averaged, what is round stays round."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.model.geometry.mesh import Mesh, make_mesh
from spectrasplat.model.geometry.mesh_health import repair
from spectrasplat.model.geometry.mesh_normals import Edges, with_smooth
from spectrasplat.model.io.gltf_write import save_gltf
from spectrasplat.model.io.mesh_io import save_ply
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Camera, Dielectric, Scene, SceneObject
from spectrasplat.model.scene_objects import make_shape
from spectrasplat.model.staging import AS_FOUND, Staging


def turned(sides: int, *profile: tuple[float, float]) -> Mesh:
    """A solid of few sides round z from a profile of (radius, z), from the lower end of the axis to the upper one."""
    angle = 2.0 * math.pi * np.arange(sides) / sides
    points = [(r * math.cos(a) + 0.0, r * math.sin(a) + 0.0, z) for r, z in profile for a in angle]
    low, high = (n := np.arange(len(points)).reshape(-1, sides))[:-1], n[1:]
    right, above = np.roll(low, -1, axis=1), np.roll(high, -1, axis=1)
    triangles = np.concatenate([np.stack([low, right, above], axis=-1), np.stack([low, above, high], axis=-1)])
    return repair(make_mesh("turned", np.array(points), triangles.reshape(-1, 3)))[0]


def ball(sides: int, rows: int, height: float = 1.0) -> Mesh:
    inner = [(math.sin(a), -height * math.cos(a)) for a in np.pi * np.arange(1, rows) / rows]
    return turned(sides, (0.0, -height), *inner, (0.0, height))


def rod(sides: int) -> Mesh:
    return turned(sides, (0.0, -1.0), (1.0, -1.0), (1.0, 1.0), (0.0, 1.0))


WALLS = ((0.8, 0.0), (1.0, 0.5), (0.9, 1.2), (0.6, 1.7), (0.8, 2.1), (0.7, 2.1), (0.5, 1.7), (0.9, 0.5))
VASE = ((0.0, 0.0), *WALLS, (0.0, 0.1))
FLAT, ROUND, ROUND_BETWEEN_EDGES = "flat", "round", "round between edges"
CRYSTALS = [turned(8, (0, -0.8), (1, 0), (0, 1)), turned(6, (0, -1.6), (0.5, -1), (0.5, 1), (0, 1.6))]
CUTS = [
    make_shape("brilliant", girdle=0.0),
    make_shape("step_cut", length=1.0),
    turned(4, (0, -0.6), (1, 0), (0.6, 0.3), (0, 0.3)),
]
FACETED = [make_shape(name) for name in ("brilliant", "step_cut", "box", "prism", "polygon_prism")]
BALLS = [ball(8, 4), ball(12, 6), ball(32, 16), ball(16, 8, 0.33), ball(12, 8, 1.6)]
CURVED = [make_shape(name, triangles=n) for name in ("sphere", "ellipsoid", "torus") for n in (300, 5000)]
# Mesh, crease angle in degrees up to which its file's normals are averaged, what it becomes
SOLIDS = [(mesh, 180, FLAT) for mesh in CRYSTALS + CUTS + FACETED]
SOLIDS += [(mesh, 180, ROUND) for mesh in [*BALLS, *CURVED, turned(16, *VASE)]]
SOLIDS += [(mesh, 50, ROUND) for mesh in (rod(8), rod(12), turned(16, (0, 0), (1, 0), (0, 2)), turned(12, *VASE))]
SOLIDS += [(make_shape("lens", triangles=300), 30, ROUND), (make_shape("rippled_water", resolution=24), 30, ROUND)]
SOLIDS += [(mesh, 180, ROUND_BETWEEN_EDGES) for mesh in (rod(32), make_shape("lens", triangles=2000))]


def write_glb(mesh: Mesh, path: Path) -> None:
    item = SceneObject("stone", mesh, Dielectric.usual())
    save_gltf(Scene("s", Camera((0, -5, 1), (0, 0, 0)), (), (item,)), path)


WRITERS = {".ply": save_ply, ".glb": write_glb}


def read(path: Path, staging: Staging = AS_FOUND) -> tuple[Mesh, str]:
    scene = load_scene(path, staging)
    return scene.objects[0].mesh, " ".join(scene.notes)


@pytest.mark.parametrize(("mesh", "averaged_deg", "becomes"), SOLIDS)
@pytest.mark.parametrize("suffix", WRITERS)
def test_cut_solids_are_flat_and_round_ones_stay_round(
    tmp_path: Path, mesh: Mesh, averaged_deg: float, becomes: str, suffix: str
) -> None:
    WRITERS[suffix](with_smooth(mesh, averaged_deg), tmp_path / f"a{suffix}")
    found, notes = read(tmp_path / f"a{suffix}")
    assert (found.corner_normals is None) == (becomes == FLAT)
    assert ("far off their facets" in notes) == (becomes != ROUND)
    if becomes == ROUND_BETWEEN_EDGES:
        assert not (Edges.of(found).is_averaged(found) & (Edges.of(found).bend_deg > 31.0)).any()


@pytest.mark.parametrize(
    ("shape", "is_round"), [("torus", True), ("brilliant", False), ("step_cut", False), ("box", False)]
)
def test_without_normals_a_fine_mesh_is_round(tmp_path: Path, shape: str, is_round: bool) -> None:
    save_ply(with_smooth(make_shape(shape), False), tmp_path / "a.ply")
    found, notes = read(tmp_path / "a.ply")
    assert (found.corner_normals is not None) == ("no normals are given" in notes) == is_round


def test_what_is_said_of_normals_counts(tmp_path: Path) -> None:
    """On the command line and in a scene file; either way the file's own normals are not asked."""
    save_ply(with_smooth(turned(16, (0.0, -0.8), (1.0, 0.0), (0.0, 1.0)), True), tmp_path / "a.ply")
    (tmp_path / "own.toml").write_text('[[objects]]\nmesh = "a.ply"\nsmooth = true')
    (tmp_path / "open.toml").write_text('[[objects]]\nmesh = "a.ply"')
    assert read(tmp_path / "own.toml")[0].corner_normals is not None
    assert read(tmp_path / "open.toml")[0].corner_normals is None and "a.ply" in read(tmp_path / "open.toml")[1]
    for name in ("a.ply", "own.toml", "open.toml"):
        assert read(tmp_path / name, Staging(smooth=False))[0].corner_normals is None
        rounded, notes = read(tmp_path / name, Staging(smooth=True))
        np.testing.assert_array_equal(Edges.of(rounded).is_averaged(rounded), Edges.of(rounded).bend_deg < 60.0)
        assert "facets" not in notes
