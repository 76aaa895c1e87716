"""How a mesh was made, so that a scene can be saved by description instead of by triangles.

Meshes are compared by identity and never changed, so a recipe stays true for exactly the
value it was noted for; a mesh that was edited is another value, has no recipe, and is saved
as triangles.
"""

from __future__ import annotations

from collections.abc import Mapping
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
