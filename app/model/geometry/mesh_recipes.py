"""How a mesh was made, so that a scene can be saved by description instead of by triangles.

Meshes are compared by identity and never changed, so a recipe stays true for exactly the
value it was noted for; a mesh that was edited is another value, has no recipe, and is saved
as triangles. A recipe goes with its mesh to another process.
"""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any
from weakref import WeakKeyDictionary

from .mesh import Mesh

_RECIPES: WeakKeyDictionary[Mesh, Mapping[str, Any]] = WeakKeyDictionary()


def note_recipe(mesh: Mesh, recipe: Mapping[str, Any]) -> None:
    """Remember the scene-file keys that make `mesh`: `shape` with its sizes, or `mesh` (absolute path) with
    `smooth`."""
    _RECIPES[mesh] = MappingProxyType(dict(recipe))


def recipe_of(mesh: Mesh) -> Mapping[str, Any] | None:
    """The scene-file keys that make exactly this mesh, or None."""
    return _RECIPES.get(mesh)


def _carried(mesh: Mesh) -> tuple[Callable[..., Mesh], tuple[Any, ...]]:
    recipe = recipe_of(mesh)
    return _arrived, (dict(vars(mesh)), None if recipe is None else dict(recipe))


def _arrived(state: dict[str, Any], recipe: dict[str, Any] | None) -> Mesh:
    mesh = object.__new__(Mesh)
    vars(mesh).update(state)
    if recipe is not None:
        note_recipe(mesh, recipe)
    return mesh


copyreg.pickle(Mesh, _carried)
