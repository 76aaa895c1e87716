"""Parts and materials of OBJ files: what is a solid of its own, what of it is glass."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.edit.opening import import_objects
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.materials.diffuse import Diffuse
from spectrasplat.model.optics import catalogue
from spectrasplat.model.scene import Dielectric, Scene
from spectrasplat.model.staging import Staging

BOX = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6]]
BOX += [[3, 0, 4], [3, 4, 7]]


class Writer:
    """An OBJ file made of boxes."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._vertices = 0

    def box(self, at: tuple[float, float, float], side: float, *statements: str, inward: bool = False) -> None:
        """A cube with its lowest corner at `at`, under `statements`."""
        square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
        for x, y, z in side * np.concatenate([square, square + [0, 0, 1]]) + at:
            self.lines.append(f"v {x} {y} {z}")
        self.lines += statements
        for a, b, c in BOX:
            b, c = (c, b) if inward else (b, c)
            self.lines.append(f"f {a + 1 + self._vertices} {b + 1 + self._vertices} {c + 1 + self._vertices}")
        self._vertices += 8

    def load(self, folder: Path, mtl: str | None = None, staging: Staging | None = None) -> Scene:
        """The scene of the file, with its materials beside it."""
        if mtl is not None:
            (folder / "own.mtl").write_text(mtl)
        head = [] if mtl is None else ["mtllib own.mtl"]
        (folder / "own.obj").write_text("\n".join(head + self.lines))
        return load_scene(folder / "own.obj", staging or Staging(up="z"))


def names(scene: Scene) -> list[str]:
    """Of all but the table."""
    return [item.name for item in scene.objects if item.name != "table"]


def test_objects_of_a_file_are_parts_that_can_be_made_of_their_own_glass(tmp_path: Path) -> None:
    file = Writer()
    file.box((0, 0, 0), 1.0, "o body")
    file.box((3, 0, 0), 1.0, "o lid")
    scene = file.load(tmp_path, staging=Staging(up="z", glass=(("lid", "N-SF11"),)))
    assert names(scene) == ["body", "lid"]
    body, lid = (item.material for item in scene.objects[:2])
    assert isinstance(body, Dielectric) and isinstance(lid, Dielectric)
    assert body.dispersion == catalogue.find("N-BK7") and lid.dispersion == catalogue.find("N-SF11")
    assert all(item.mesh.is_closed and item.mesh.volume() == pytest.approx(1.0) for item in scene.objects[:2])
    with pytest.raises(UserError, match="holds no object 'spout'.*'body', 'lid'"):
        load_scene(tmp_path / "own.obj", Staging(glass=(("spout", "N-SF11"),)))


def test_what_shares_a_vertex_stays_one_solid(tmp_path: Path) -> None:
    file = Writer()
    file.box((0, 0, 0), 1.0, "o bottle", "usemtl glass")
    file.lines.insert(-4, "usemtl rim")  # the last faces of the same box
    scene = file.load(tmp_path)
    assert names(scene) == ["own"] and scene.objects[0].mesh.is_closed


def test_a_part_without_area_is_left_out(tmp_path: Path) -> None:
    file = Writer()
    file.box((0, 0, 0), 1.0, "o body")
    file.box((3, 0, 0), 1.0, "o lid")
    file.box((7, 0, 0), 0.0, "o point")
    assert names(file.load(tmp_path)) == ["body", "lid"]


def test_what_faces_inward_is_the_cavity_of_what_holds_it(tmp_path: Path) -> None:
    file = Writer()
    file.box((0, 0, 0), 4.0, "g outside")
    file.box((1, 1, 1), 2.0, "g inside", inward=True)
    file.box((9, 0, 0), 1.0, "g else")
    scene = file.load(tmp_path)
    assert names(scene) == ["outside", "else"]
    assert scene.objects[0].mesh.volume() == pytest.approx(4.0**3 - 2.0**3)


MTL = """
newmtl glass
Kd 1 1 1
Ni {index}
d 0.1
illum 7
newmtl wood   # of the handle
Kd 0.4 0.2 0.08
newmtl gone
Kd broken
"""


def test_materials_say_what_is_glass_and_the_colour_of_the_rest(tmp_path: Path) -> None:
    file = Writer()
    file.box((0, 0, 0), 1.0, "o pot", "usemtl glass")
    file.box((3, 0, 0), 1.0, "o handle", "usemtl wood")
    scene = file.load(tmp_path, MTL.format(index=2.4))
    pot, handle, table = scene.objects
    assert isinstance(pot.material, Dielectric) and pot.material.dispersion.n_d == pytest.approx(2.4)
    assert pot.material.dispersion.V_d == pytest.approx(catalogue.find("N-BK7").V_d, rel=0.01)
    assert isinstance(handle.material, Diffuse) and handle.material.reflectance_rgb == (0.4, 0.2, 0.08)
    assert table.name == "table" and table.world_bounds[1][2] < 0.0 + 1e-6  # though the handle is diffuse too
    assert any("make glass of 'pot'" in note for note in scene.notes)
    assert any("line 10" in note and "'Kd'" in note for note in scene.notes)


def test_an_index_nobody_chose_is_the_default_glass(tmp_path: Path) -> None:
    file = Writer()
    file.box((0, 0, 0), 1.0, "usemtl glass")
    material = file.load(tmp_path, MTL.format(index=1.45)).objects[0].material
    assert isinstance(material, Dielectric) and material.dispersion == catalogue.find("N-BK7")


def test_where_no_material_is_glass_all_is_and_it_is_said(tmp_path: Path) -> None:
    file = Writer()
    file.box((0, 0, 0), 1.0, "usemtl wood")
    scene = file.load(tmp_path, MTL.format(index=1.5))
    assert isinstance(scene.objects[0].material, Dielectric)
    assert any("though its materials are opaque" in note for note in scene.notes)


@pytest.mark.parametrize("library", ["missing.mtl", "../outside.mtl"])
def test_a_library_that_cannot_be_read_is_a_note(tmp_path: Path, library: str) -> None:
    folder = tmp_path / "own"
    folder.mkdir()
    (tmp_path / "outside.mtl").write_text("newmtl wood\n")
    file = Writer()
    file.lines.append(f"mtllib {library}")
    file.box((0, 0, 0), 1.0, "usemtl wood")
    scene = file.load(folder)
    assert any(library in note for note in scene.notes) and isinstance(scene.objects[0].material, Dielectric)


def test_parts_are_imported_together(tmp_path: Path) -> None:
    file = Writer()
    file.box((0, 0, 0), 1.0, "o body")
    file.box((3, 0, 0), 1.0, "o lid")
    scene = file.load(tmp_path)
    larger = import_objects(scene, tmp_path / "own.obj")
    added = larger.objects[len(scene.objects) :]
    assert [item.name for item in added] == ["body 2", "lid 2"]
    body, lid = (item.world_bounds for item in added)
    assert np.allclose(lid - body, [3.0, 0.0, 0.0])
    assert not np.allclose(body, scene.objects[0].world_bounds)
