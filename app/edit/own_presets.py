"""A user's own presets, kept in the config folder as TOML in the words of scene files.

A file that cannot be understood is set aside under another name and reported, like the settings.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ..base import files
from ..base.atomic import atomic_output
from ..base.errors import UserError
from ..model.io.scene_table import SceneTable
from ..model.io.toml_text import toml_text
from ..model.lights.light_file import light_values, read_light
from ..model.materials.material_file import read_material
from ..model.placement import Surroundings
from ..model.scene import Camera, Light, Material
from ..model.scene_camera import camera_values, read_camera
from .preferences import config_dir, set_aside
from .presets import LightPreset, MaterialPreset, ViewPreset

Preset = TypeVar("Preset", MaterialPreset, LightPreset, ViewPreset)

_FILE = "presets.toml"
_NOWHERE = Surroundings(np.zeros(3), 1.0)


@dataclass(frozen=True)
class OwnPresets:
    """What the user kept, each list in the order it was kept."""

    materials: tuple[MaterialPreset, ...] = ()
    lights: tuple[LightPreset, ...] = ()
    views: tuple[ViewPreset, ...] = ()

    def with_material(self, name: str, material: Material) -> OwnPresets:
        """With a material kept as `name`, in the place of one of that name."""
        return replace(self, materials=_put(self.materials, MaterialPreset(_named(name), material)))

    def with_light(self, name: str, light: Light) -> OwnPresets:
        """With a light kept as `name`."""
        return replace(self, lights=_put(self.lights, LightPreset(_named(name), None, None, light=light)))

    def with_view(self, name: str, camera: Camera) -> OwnPresets:
        """With a view kept as `name`."""
        return replace(self, views=_put(self.views, ViewPreset(_named(name), camera=camera)))

    def without(self, name: str) -> OwnPresets:
        """Without what is called `name`, of any kind."""
        materials, lights, views = (
            tuple(p for p in kept if p.name != name) for kept in (self.materials, self.lights, self.views)
        )
        return OwnPresets(materials, lights, views)  # type: ignore[arg-type]


def load_own_presets() -> tuple[OwnPresets, str | None]:
    """What the user kept, and a sentence to show when it could not be read."""
    try:
        path = config_dir() / _FILE
        text = files.read_text(path, files.SETTINGS_BYTES)
    except FileNotFoundError:
        return OwnPresets(), None
    except (OSError, UserError) as error:
        return OwnPresets(), f"Your presets cannot be read: {error}."
    except UnicodeDecodeError as error:
        return OwnPresets(), set_aside(path, "Your presets", error) + "."
    try:
        with files.own_files():
            return _read(SceneTable(tomllib.loads(text), path)), None
    except (ValueError, UserError, RecursionError) as error:
        return OwnPresets(), set_aside(path, "Your presets", error) + "."


def save_own_presets(presets: OwnPresets) -> None:
    """Keep `presets`, whole or not at all. Raises UserError when the folder is not writable."""
    kept = {
        "materials": {p.name: p.material.values() for p in presets.materials},
        "lights": {p.name: light_values(p.light) for p in presets.lights if p.light is not None},
        "views": {p.name: camera_values(p.camera) for p in presets.views if p.camera is not None},
    }
    with atomic_output(config_dir() / _FILE) as temporary:
        temporary.write_text(toml_text({k: v for k, v in kept.items() if v}), encoding="utf-8")


def _read(table: SceneTable) -> OwnPresets:
    materials = tuple(
        MaterialPreset(name, read_material(entry)) for name, entry in table.named_tables("materials").items()
    )
    lights = []
    for name, entry in table.named_tables("lights").items():
        lights.append(LightPreset(name, None, None, light=read_light(entry, 0, _NOWHERE)))
    views = tuple(
        ViewPreset(name, camera=read_camera(entry, _NOWHERE)) for name, entry in table.named_tables("views").items()
    )
    table.finish("a file of presets")
    return OwnPresets(materials, tuple(lights), views)


def _put(kept: tuple[Preset, ...], new: Preset) -> tuple[Preset, ...]:
    if all(p.name != new.name for p in kept):
        return kept + (new,)
    return tuple(new if p.name == new.name else p for p in kept)


def _named(name: str) -> str:
    plain = " ".join(name.split())
    if not plain:
        raise UserError("the preset needs a name")
    return plain
