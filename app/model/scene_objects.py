"""Objects of a scene file: which mesh, which material, where, and how often."""

from __future__ import annotations

import inspect
import io
import json
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..base import files
from ..base.errors import UserError
from ..base.paths import MESH_SUFFIXES
from .geometry import primitives
from .geometry.mesh import Mesh, note_recipe
from .geometry.mesh_normals import ROUND_DEG, with_plausible_normals
from .io.mesh_raw import as_float64
from .io.scene_table import SceneTable
from .local_dispersion import read_dabs
from .materials.material_file import read_object_material
from .naming import Names
from .placement import read_placement
from .scene import Material, SceneObject
from .texture import TextureReader
from .vectors import frozen

INLINE = "inline"
"""Shape of triangles that stand in the scene file itself."""


class ObjectReader:
    """Reads [[objects]] one by one; equal descriptions share one `Mesh`."""

    def __init__(
        self,
        materials: dict[str, Material],
        textures: TextureReader,
        meshes: dict[str, Mesh] | None = None,
        smooth: bool | None = None,
    ) -> None:
        """`meshes`: by description, what an earlier reading of the same file made; kept up. `smooth`: replaces
        that of every mesh file."""
        self._materials = materials
        self._textures = textures
        self._meshes = {} if meshes is None else meshes
        self._smooth = smooth
        self._names = Names()
        self.notes: list[str] = []

    def read(self, table: SceneTable) -> list[SceneObject]:
        """The object of one table, or its instances."""
        material = read_object_material(table, self._materials, self._textures)
        mesh = self._read_mesh(table, solid=material.is_solid)
        base = read_placement(table)
        rest = table.number("rests_at_z", None)
        painted = read_dabs(table, material)
        placed: list[SceneObject] = []
        if not table.has("instances"):
            name = self._unique_name(table, mesh.name)
            placed.append(SceneObject(name, mesh, material, rested(mesh, base, rest), painted))
        else:
            entries = table.tables("instances")
            if not entries:
                table.fail("instances", "is empty; leave it out to place the object once")
            name = table.string("name", mesh.name)
            for i, entry in enumerate(entries):
                label = self._unique_name(entry, f"{name} {i + 1}")
                matrix = rested(mesh, read_placement(entry) @ base, rest)
                more = read_dabs(entry, material)
                entry.finish("an instance")
                placed.append(SceneObject(label, mesh, material, matrix, painted + more))
        table.finish("this object")
        return placed

    def _unique_name(self, table: SceneTable, fallback: str) -> str:
        if table.has("name"):
            name = table.string("name")
            if name in self._names:
                table.fail("name", f"is '{name}', which another object has already; give each its own")
        else:
            return self._names.unique(fallback)
        self._names.add(name)
        return name

    def _read_mesh(self, table: SceneTable, solid: bool) -> Mesh:
        key = table.one_of(("mesh", "shape"), "the geometry")
        if key is None:
            table.raw("shape")  # blames a misspelt key, or says that this one is missing
        if key == "mesh" and isinstance(table.raw("mesh"), Mesh):
            return table.raw("mesh")  # from Python, which may give the triangles themselves
        recipe = _file_recipe(table, self._smooth) if key == "mesh" else _shape_recipe(table)
        identity = json.dumps(recipe, sort_keys=True)
        if identity not in self._meshes:
            found: list[str] = []
            self._meshes[identity] = self._make(table, recipe, found)
            # An open sheet is a fault in glass only: tables and blockers are open by nature.
            self.notes += [note for note in found if solid or not note.startswith("open mesh")]
        return self._meshes[identity]

    def _make(self, table: SceneTable, recipe: dict[str, Any], notes: list[str]) -> Mesh:
        if "mesh" in recipe:
            mesh = load_checked_mesh(Path(recipe["mesh"]), recipe.get("smooth"), notes)
            note_recipe(mesh, recipe)
            return mesh
        try:
            return make_shape(notes=notes, **recipe)
        except UserError as error:
            table.fail("shape", f"cannot be made: {error}")


def load_checked_mesh(path: Path, smooth: bool | float | None, notes: list[str]) -> Mesh:
    """A mesh file, repaired where that is safe, its normals passed over where they cannot be meant; what was found goes
    to `notes`."""
    from .io.mesh_io import load_mesh

    mesh = checked_mesh(load_mesh(path, smooth), notes)
    return with_plausible_normals(mesh, notes, path.name) if smooth is None else mesh


def checked_mesh(mesh: Mesh, notes: list[str]) -> Mesh:
    """`mesh` repaired where that is safe; what was found goes to `notes`."""
    from .geometry.mesh_health import examine, repair

    mesh, found = repair(mesh, examine(mesh))
    notes.extend(found)
    return mesh


def rested(mesh: Mesh, matrix: np.ndarray, rest: float | None) -> np.ndarray:
    """`matrix`, lifted along z so that the mesh's lowest point lies at z = `rest`."""
    if rest is not None:
        lowest = float((mesh.vertices @ matrix[2, :3]).min()) + matrix[2, 3]
        matrix = matrix.copy()
        matrix[2, 3] += rest - lowest
    return frozen(matrix)


def _file_recipe(table: SceneTable, override: bool | None) -> dict[str, Any]:
    path = table.existing_file("mesh").resolve()
    if path.suffix.lower() not in MESH_SUFFIXES:
        table.fail("mesh", f"must be one of {', '.join(MESH_SUFFIXES)}; open a .glb or .gltf as the scene itself")
    recipe: dict[str, Any] = {"mesh": str(path)}
    if table.has("smooth"):
        smooth = table.raw("smooth")
        if not isinstance(smooth, bool):
            smooth = table.number("smooth", at_least=0.0, at_most=180.0)
        recipe["smooth"] = smooth
    return recipe if override is None else recipe | {"smooth": override and ROUND_DEG}


# -- shapes: the keys are the parameters of the functions in `primitives` --------------------

SHAPES = (
    "sphere",
    "ellipsoid",
    "box",
    *primitives.SPECIAL,
    "slab",
    "prism",
    "polygon_prism",
    "lens",
    "brilliant",
    "step_cut",
    "torus",
    "revolution",
    "height_field",
    "rippled_water",
    "plane",
    "disc",
    INLINE,
)
_FUNCTION = {"revolution": "solid_of_revolution"}
_HIDDEN = {"name", "names", "gradient"}


@cache
def parameters_of(shape: str) -> dict[str, tuple[str, bool]]:
    """Key -> (annotation, required) of a shape, in the order of its function.

    A file leaves out a parameter that may be None to mean None; a key that is given has the other type.
    """
    if shape == INLINE:
        return {"vertices": ("rows3", True), "triangles": ("rows3", True), "uv": ("rows2", False)}
    signature = inspect.signature(_function(shape))
    return {
        key: (str(parameter.annotation).removesuffix(" | None"), parameter.default is inspect.Parameter.empty)
        for key, parameter in signature.parameters.items()
        if key not in _HIDDEN
    }


def _function(shape: str) -> Callable[..., Any]:
    return getattr(primitives, _FUNCTION.get(shape, shape))


def _shape_recipe(table: SceneTable) -> dict[str, Any]:
    shape = table.choice("shape", SHAPES)
    recipe: dict[str, Any] = {"shape": shape}
    for key, (annotation, required) in parameters_of(shape).items():
        if required or table.has(key):
            recipe[key] = _read_parameter(table, key, annotation)
    return recipe


def _read_parameter(table: SceneTable, key: str, annotation: str) -> Any:
    if key == "part":
        return table.choice(key, ("front", "back"))
    if annotation in ("rows2", "rows3"):
        return [list(row) for row in table.rows(key, int(annotation[-1]), at_least=1)]
    if key == "profile":
        return [list(row) for row in table.rows(key, 2, at_least=3)]
    if key == "heights":
        return _read_heights(table, key)
    if annotation == "int":
        return table.integer(key, at_least=0, at_most=100_000_000)
    if annotation == "float":
        return table.number(key, infinite=True)
    return list(table.numbers(key, count=annotation.count("float")))


def _read_heights(table: SceneTable, key: str) -> Any:
    """Rows of heights in the file itself, or the absolute name of a .npy or .csv that holds them."""
    value = table.raw(key)
    if isinstance(value, str):
        path = table.existing_file(key).resolve()
        if path.suffix.lower() not in (".npy", ".csv"):
            table.fail(key, "must name a .npy or .csv file, or list rows of numbers")
        return str(path)
    if not isinstance(value, list) or not value or not isinstance(value[0], list):
        table.fail(key, "must list rows of numbers, or name a .npy or .csv file")
    return [list(row) for row in table.rows(key, len(value[0]))]


def make_shape(shape: str, notes: list[str] | None = None, **parameters: Any) -> Mesh:
    """The mesh of a shape of the scene file, saved by that description; what was repaired goes to `notes`.

    Raises UserError for impossible sizes.
    """
    if shape in primitives.SPECIAL:
        return make_shape(**_function(shape)(**parameters))
    arguments = dict(parameters)
    if "heights" in arguments:
        arguments["heights"] = _load_heights(arguments["heights"])
    if shape == INLINE:
        mesh = checked_mesh(_inline_mesh(**arguments), [] if notes is None else notes)
    else:
        mesh = _function(shape)(**arguments)
    note_recipe(mesh, {"shape": shape} | parameters)
    return mesh


def _inline_mesh(
    vertices: list[list[float]], triangles: list[list[float]], uv: list[list[float]] | None = None
) -> Mesh:
    from .geometry.mesh import make_mesh

    indices = np.array(triangles)
    if np.any(indices != np.floor(indices)):
        raise UserError("triangles must hold whole numbers, counted from 0")
    if uv is not None and len(uv) != 3 * len(triangles):
        raise UserError(
            f"uv has {len(uv)} rows for {len(triangles)} triangles; give one for each corner, three a triangle"
        )
    corners = None if uv is None else np.array(uv).reshape(-1, 3, 2)
    return make_mesh("mesh", np.array(vertices), indices.astype(np.int64), uv=corners, uv_unwraps=False)


def _load_heights(heights: Any) -> np.ndarray:
    if not isinstance(heights, str):
        return np.array(heights, dtype=np.float64)
    try:
        if heights.endswith(".npy"):
            return as_float64(files.read_npy(heights))
        return _csv_numbers(files.read_text(heights, files.TABLE_BYTES))
    except (OSError, ValueError) as error:
        reason = files.reason_of(error)
        raise UserError(f"the heights in {heights} cannot be read ({reason}); give a plain array of numbers") from error


def _csv_numbers(text: str) -> np.ndarray:
    """Rows of numbers with commas between, float64 (R, C). Raises ValueError that quotes nothing of them."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)  # no data at all
            return np.loadtxt(io.StringIO(text), delimiter=",", ndmin=2)
    except (ValueError, UserWarning) as error:
        raise ValueError("it is no table of numbers with commas between") from error
