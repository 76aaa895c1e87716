"""A scene to read and to edit, by the names of the scene file (docs/scene-format.md).

What is edited are the tables of the file; after every edit the whole is read and checked as a file would be, and what
cannot be is refused with the same sentence and left as it was. What did not change stays the same value, so that a
`Session` knows what need not be traced again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..base.errors import UserError
from ..commands.scenes import find_scene
from ..model import scene as values_of
from ..model.io.scene_file import Kept, load_scene, read_toml, scene_of
from ..model.lights import Light
from ..model.lights.light_file import light_values
from ..model.scene_camera import camera_values
from ..model.scene_defaults import environment_of
from ..model.scene_render import render_values
from .tables import Entries, Table, copied, plain


class Scene:
    """Everything there is, editable: `scene.objects["prism"].dispersion_gain = 2`.

    Lengths are in the scene's own unit, angles in degrees, as the scene file has them.
    """

    def __init__(self, values: Mapping[str, Any] | None = None, folder: str | os.PathLike[str] | None = None) -> None:
        """A scene from its tables, as the scene file would hold them; `folder`: of the files that it names
        (default: the current one). Raises `UserError` for what cannot be rendered."""
        file = Path(folder or ".").resolve() / "scene.toml"
        tables = plain(values or {}, "scene")
        if not isinstance(tables, dict):
            raise UserError("a scene is made of a dictionary of tables, for example {'objects': [{'shape': 'sphere'}]}")
        self._begin(tables, file)

    @classmethod
    def load(cls, source: str | os.PathLike[str]) -> Scene:
        """See `spectrasplat.load`."""
        path = find_scene(os.fspath(source))
        scene = cls.__new__(cls)
        if path.suffix.lower() == ".toml":
            scene._begin(read_toml(path), path)
        else:
            loaded = load_scene(path)
            scene._begin(_tables_of(loaded), path, loaded.notes)
        return scene

    def copy(self) -> Scene:
        """A scene of its own with the same content; meshes and pictures are shared."""
        scene = Scene.__new__(Scene)
        scene._values, scene._file, scene._kept = copied(self._values), self._file, self._kept
        scene._notes, scene._model = dict(self._notes), self._model
        scene._known_objects, scene._known_lights = self._known_objects, self._known_lights
        return scene

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write it as a scene file (.toml). Raises `UserError` where it cannot be written."""
        from ..model.io.scene_save import save_scene

        if Path(path).suffix.lower() != ".toml":
            raise UserError(f"cannot write {path}: a scene is saved as .toml")
        save_scene(self._model, path)

    # ---- what there is -----------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Its title."""
        return self._model.name

    @name.setter
    def name(self, name: str) -> None:
        self._root.update(name=name)

    @property
    def background(self) -> tuple[float, float, float]:
        """Linear Rec.709 radiance behind everything, lm/(sr unit²) for white; lights nothing."""
        return self._model.background_rgb

    @background.setter
    def background(self, rgb: tuple[float, float, float]) -> None:
        self._root.update(background=rgb, environment=None)

    @property
    def environment(self) -> Table | None:
        """What is seen beyond everything; assign a dictionary, or None."""
        found = self._values.get("environment")
        return self._table("environment") if isinstance(found, dict) else None

    @environment.setter
    def environment(self, keys: Mapping[str, Any] | None) -> None:
        self._root.update(environment=keys, background=None)

    @property
    def camera(self) -> Table:
        """Where it is seen from."""
        return self._table("camera")

    @camera.setter
    def camera(self, keys: Mapping[str, Any]) -> None:
        self._root.update(camera=keys)

    @property
    def render(self) -> Table:
        """Size of the picture, photons, exposure, depth: the defaults of `render`."""
        return self._table("render")

    @property
    def lights(self) -> Entries:
        """Its lights."""
        return Entries(self, "lights")

    @property
    def objects(self) -> Entries:
        """Its objects; those placed several times (`instances`) count once."""
        return Entries(self, "objects")

    @property
    def materials(self) -> dict[str, Table]:
        """The tables that objects name as their `material`."""
        named = self._values.get("materials", {})
        return {name: Table(self, table, f"materials['{name}']") for name, table in named.items()}

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed, one sentence each."""
        return tuple(self._notes)

    def to_dict(self) -> dict[str, Any]:
        """All tables, as the scene file would hold them; a copy."""
        return copied(self._values)  # type: ignore[no-any-return]

    def __repr__(self) -> str:
        return f"Scene '{self.name}' ({self.objects!r}; {self.lights!r})"

    # ---- private -----------------------------------------------------------------------------

    def _begin(self, values: dict[str, Any], file: Path, notes: tuple[str, ...] = ()) -> None:
        self._values, self._file, self._kept = values, file, Kept()
        self._notes: dict[str, None] = dict.fromkeys(notes)
        self._known_objects: dict[str, tuple[values_of.SceneObject, ...]] = {}
        self._known_lights: dict[str, Light] = {}
        self._model = scene_of(values, file, self._kept)
        self._notes |= dict.fromkeys(self._model.notes)
        # What was filled in is from now on given: an edit of one thing must not move another.
        listed = sum(len(entry.get("instances", (None,))) for entry in values["objects"])
        values["objects"] += [_object_table(item) for item in self._model.objects[listed:]]
        self._build()

    @property
    def _root(self) -> Table:
        return Table(self, self._values, "scene")

    def _table(self, key: str) -> Table:
        return Table(self, self._values[key], key)

    @contextmanager
    def _editing(self, container: dict[str, Any] | list[Any]) -> Iterator[None]:
        """Edit `container`, one of the scene's; read the scene again, and take the edit back where that fails."""
        if not _holds(self._values, container):
            raise UserError(f"this part is no longer in scene '{self.name}': ask the scene for it again")
        before = container.copy()
        try:
            yield
            self._build()
        except BaseException:
            if isinstance(container, dict):
                container.clear()
                container.update(before)
            else:
                container[:] = before
            raise

    def _build(self) -> None:
        """Read and check the tables; what is described as before stays the same value."""
        model, values = scene_of(self._values, self._file, self._kept), self._values
        values.setdefault("lights", [light_values(light) for light in model.lights])
        values.setdefault("camera", camera_values(model.camera))
        values.setdefault("render", render_values(model.render))
        shared = json.dumps(self._values.get("materials", {}), default=id)
        described = [json.dumps(entry, default=id) + shared for entry in self._values["objects"]]
        lights = [json.dumps(entry, default=id) for entry in self._values["lights"]]
        groups = list(_split(model.objects, self._values["objects"]))
        kept = [self._known_objects.get(text, ()) for text in described]
        groups = [
            old if [o.name for o in old] == [o.name for o in new] else new
            for old, new in zip(kept, groups, strict=True)
        ]
        known = dict(zip(described, groups, strict=True))
        around = environment_of(model.objects)  # what lights are fitted to
        fitted_to = f"{around.centre} {around.radius}"
        lights = [text + fitted_to for text in lights]
        found = [self._known_lights.get(text, light) for text, light in zip(lights, model.lights, strict=True)]
        found = [old if old.name == new.name else new for old, new in zip(found, model.lights, strict=True)]
        self._known_objects, self._known_lights = known, dict(zip(lights, found, strict=True))
        self._model = replace(model, objects=tuple(o for group in groups for o in group), lights=tuple(found))
        self._notes |= dict.fromkeys(model.notes)

    def _names(self, key: str) -> list[str]:
        if key == "lights":
            return [light.name for light in self._model.lights]
        entries = self._values["objects"]
        return [
            str(entry.get("name", placed[0].mesh.name if "instances" in entry else placed[0].name))
            for entry, placed in zip(entries, _split(self._model.objects, entries), strict=True)
        ]

    def _amounts(self, values: dict[str, Any]) -> dict[str, Any]:
        """What one of the scene's tables amounts to with all defaults, in keys of the scene file."""
        model, objects = self._model, self._values["objects"]
        if values is self._values["camera"]:
            return camera_values(model.camera)
        if values is self._values["render"]:
            return render_values(model.render)
        for light, entry in zip(model.lights, self._values["lights"], strict=True):
            if entry is values:
                return light_values(light)
        for entry, (item, *_) in zip(objects, _split(model.objects, objects), strict=True):
            if entry is values:
                amounts = _object_table(item) | {"position": [float(v) for v in item.object_to_world[:3, 3]]}
                if isinstance(glass := item.material, values_of.Dielectric):
                    amounts |= {"dispersion_gain": glass.dispersion.gain, "priority": glass.priority}
                    amounts |= {"roughness": glass.roughness}
                return amounts
        return {}


def _split(
    objects: tuple[values_of.SceneObject, ...], entries: list[dict[str, Any]]
) -> Iterator[tuple[values_of.SceneObject, ...]]:
    """The objects of each entry: one, or its instances."""
    first = 0
    for entry in entries:
        end = first + len(entry.get("instances", (None,)))
        yield objects[first:end]
        first = end


def _object_table(item: values_of.SceneObject) -> dict[str, Any]:
    """An object as a table; mesh and material as they are where no words say them."""
    recipe = item.mesh.recipe
    table: dict[str, Any] = {"name": item.name} | (dict(recipe) if recipe is not None else {"mesh": item.mesh})
    return table | {"material": item.material, "matrix": [float(v) for v in item.object_to_world.ravel()]}


def _tables_of(model: values_of.Scene) -> dict[str, Any]:
    """The tables of a scene that came from no scene file."""
    from ..model.local_dispersion import DABS, describe_dabs

    behind: dict[str, Any] = {"environment": model.environment}
    if model.environment is None:
        behind = {"background": list(model.background_rgb)}
    painted = ({DABS: describe_dabs(o.local_dispersion)} if o.local_dispersion else {} for o in model.objects)
    return {
        "name": model.name,
        **behind,
        "camera": camera_values(model.camera),
        "render": render_values(model.render),
        "lights": [light_values(light) for light in model.lights],
        "objects": [_object_table(item) | more for item, more in zip(model.objects, painted, strict=True)],
    }


def _holds(values: Any, container: object) -> bool:
    if values is container:
        return True
    inner = values.values() if isinstance(values, dict) else values if isinstance(values, list) else ()
    return any(_holds(value, container) for value in inner)
