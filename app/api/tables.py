"""The tables of a scene as Python sees them: keys as attributes, objects and lights by name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..base.errors import UserError, suggestion
from ..model.geometry.mesh import Mesh, note_recipe
from ..model.materials.material import Material
from ..model.naming import place_of
from ..model.scene_objects import load_checked_mesh
from ..model.texture import Environment

_KEPT_WHOLE = (Mesh, Material, Environment)
"""Values that Python may give where a file names or describes them."""


class Owner(Protocol):
    """The scene that tables belong to."""

    _values: dict[str, Any]

    @property
    def name(self) -> str:
        """Its title."""

    def _editing(self, container: dict[str, Any] | list[Any]) -> AbstractContextManager[None]:
        """Edit `container`, one of the scene's, or leave everything as it was."""

    def _amounts(self, values: dict[str, Any]) -> dict[str, Any]:
        """What one of the tables amounts to."""

    def _names(self, key: str) -> list[str]:
        """Names of the objects or the lights."""


class UnknownKeyError(UserError, AttributeError):
    """A key that a table does not have."""


class Table:
    """One table of a scene: its keys are attributes. `None`, or `del`, leaves a key out."""

    __slots__ = ("_scene", "_values", "_where")

    def __init__(self, scene: Owner, values: dict[str, Any], where: str) -> None:
        object.__setattr__(self, "_scene", scene)
        object.__setattr__(self, "_values", values)
        object.__setattr__(self, "_where", where)

    def __getattr__(self, key: str) -> Any:
        """The value of `key`, or its default where it is not given; tables as `Table`."""
        if key.startswith("_"):
            raise AttributeError(key)
        if key in self._values:
            return _shown(self._scene, self._values[key], f"{self._where}.{key}")
        known_values = self._scene._amounts(self._values)
        if key not in known_values:
            known = list(dict.fromkeys((*self._values, *known_values)))
            hint = suggestion(key, known) or f"; there are {', '.join(known)}"
            raise UnknownKeyError(f"{self._where} has no '{key}'{hint}")
        return known_values[key]

    def __setattr__(self, key: str, value: Any) -> None:
        self.update(**{key: value})

    def __delattr__(self, key: str) -> None:
        self.update(**{key: None})

    def update(self, **keys: Any) -> None:
        """Set several keys at once, for those that only go together; None leaves one out.

        Raises `UserError`, with the sentence that a scene file would get, and then changes nothing.
        """
        given = {key: plain(value, f"{self._where}.{key}") for key, value in keys.items()}
        with self._scene._editing(self._values):
            for key, value in given.items():
                if value is None:
                    self._values.pop(key, None)
                else:
                    self._values[key] = value

    def to_dict(self) -> dict[str, Any]:
        """What is given, as the scene file would hold it; a copy."""
        return copied(self._values)  # type: ignore[no-any-return]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._values, *self._scene._amounts(self._values)]

    def __repr__(self) -> str:
        return f"{self._where}: " + ", ".join(f"{key} = {_words(value)}" for key, value in self._values.items())


class Entries:
    """The objects or the lights of a scene, by name or by number, in their order."""

    def __init__(self, scene: Owner, key: str) -> None:
        self._scene, self._key = scene, key

    @property
    def names(self) -> list[str]:
        """Their names."""
        return self._scene._names(self._key)

    def __len__(self) -> int:
        return len(self._list)

    def __iter__(self) -> Iterator[Table]:
        return (self[i] for i in range(len(self)))

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __getitem__(self, name: str | int) -> Table:
        """Raises `UserError` naming those there are."""
        index = self._index(name)
        return Table(self._scene, self._list[index], f"{self._key}['{self.names[index]}']")

    def __delitem__(self, name: str | int) -> None:
        index = self._index(name)
        with self._scene._editing(self._list):
            del self._list[index]

    def add(self, **keys: Any) -> Table:
        """One more, by the keys of the scene file; raises `UserError` as that would."""
        given = {k: plain(v, f"{self._key}.{k}") for k, v in keys.items() if v is not None}
        with self._scene._editing(self._list):
            self._list.append(given)
        return self[len(self) - 1]

    @property
    def _list(self) -> list[dict[str, Any]]:
        return self._scene._values[self._key]  # type: ignore[no-any-return]

    def _index(self, name: str | int) -> int:
        names = self.names
        if isinstance(name, int) and not isinstance(name, bool) and -len(names) <= name < len(names):
            return name % len(names)
        return place_of(name, names, f"scene '{self._scene.name}' has no {self._key[:-1]}")

    def __repr__(self) -> str:
        return f"{self._key}: {', '.join(self.names)}"


def _shown(scene: Owner, value: Any, where: str) -> Any:
    if isinstance(value, dict):
        return Table(scene, value, where)
    if isinstance(value, list) and value and all(isinstance(entry, dict) for entry in value):
        return tuple(Table(scene, entry, f"{where}[{i}]") for i, entry in enumerate(value))
    return copied(value)


def copied(value: Any) -> Any:
    """Tables and lists anew; their values are shared."""
    if isinstance(value, dict):
        return {key: copied(inner) for key, inner in value.items()}
    return [copied(inner) for inner in value] if isinstance(value, list) else value


def plain(value: Any, where: str) -> Any:
    """`value` in the types of TOML: tuples and arrays become lists, a `Path` to a mesh that mesh."""
    if value is None or isinstance(value, (bool, int, float, str, *_KEPT_WHOLE)):
        return value
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist(), where)
    if isinstance(value, list | tuple):
        return [plain(inner, where) for inner in value]
    if isinstance(value, Table):
        return value.to_dict()
    if isinstance(value, Mapping):
        return {str(key): plain(inner, f"{where}.{key}") for key, inner in value.items() if inner is not None}
    if isinstance(value, Path):
        return _mesh_in(value) if where.endswith(".mesh") else str(value)
    raise UserError(f"{where} cannot be of type {type(value).__name__}: give a number, a text, a list or a dictionary")


def _mesh_in(path: Path) -> Mesh:
    mesh = load_checked_mesh(path, None, [])
    note_recipe(mesh, {"mesh": str(path.resolve())})
    return mesh


def _words(value: Any) -> str:
    text = f"<{type(value).__name__}>" if isinstance(value, _KEPT_WHOLE) else repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
