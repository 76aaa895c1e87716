"""The scene being worked on: its file, and every step since it was opened.

Saving writes a whole file or none: what was on the disk stays until the new one is complete.
A bare mesh and the scenes that come with the program are starting points, not files to write back
to, so they have no `path` until they are saved somewhere.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..base import files
from ..base.errors import UserError
from ..base.paths import MESH_SUFFIXES, assets_dir
from ..model.io.gltf import CAMERA_ADDED
from ..model.io.gltf_write import save_gltf
from ..model.io.scene_file import GLTF_SUFFIXES, load_scene
from ..model.io.scene_save import save_scene
from ..model.scene import Scene
from ..model.staging import UpAxis
from .history import History
from .opening import AS_FOUND, Opening, open_scene

SAVE_SUFFIXES = (".toml", ".glb", ".gltf")
DEFAULT_SCENE = "default"


class Document:
    """A scene with its history and its file."""

    def __init__(
        self, scene: Scene, source: Path | None = None, path: Path | None = None, opening: Opening = AS_FOUND
    ) -> None:
        self.history = History(scene)
        self.opening = opening
        """How it was opened."""
        self.path = path
        """The file that saving without a name writes; None asks for one."""
        self.source = source
        """The file it was opened from or saved to, for the list of recent files."""
        self._original = source if source is not None and source.suffix.lower() in GLTF_SUFFIXES else None

    @staticmethod
    def new() -> Document:
        """The scene the program starts with, untitled."""
        scene = load_scene(assets_dir() / "scenes" / f"{DEFAULT_SCENE}.toml")
        return Document(replace(scene, name="untitled"))

    @staticmethod
    def open(path: Path, opening: Opening = AS_FOUND) -> Document:
        """The scene in a file: .toml, .glb, .gltf, or a mesh that gets a glass, lights and a table.

        Raises UserError, in one sentence, for what cannot be opened.
        """
        path = Path(path).expanduser().absolute()
        scene = open_scene(path, opening)
        return Document(scene, path, path if _is_own_file(path) else None, opening)

    @staticmethod
    def recovered(scene: Scene, original: Path | None) -> Document:
        """A scene from an autosave: unsaved, and belonging to the file it was autosaved from."""
        document = Document(scene, original, original if original is not None and _is_own_file(original) else None)
        document.history.mark_unsaved()
        return document

    @property
    def scene(self) -> Scene:
        """The scene now."""
        return self.history.present

    @property
    def up(self) -> UpAxis | None:
        """The axis of its file that was taken to be up, as long as the scene is the one that was opened; None for a
        file that says so itself."""
        source = self.source
        if source is None or self.unsaved or source.suffix.lower() not in (*MESH_SUFFIXES, *GLTF_SUFFIXES):
            return None
        if source.suffix.lower() in GLTF_SUFFIXES:
            return (self.opening.staging.up or "y") if CAMERA_ADDED in self.scene.notes else None
        turned = not np.allclose(self.scene.objects[0].object_to_world[:3, :3], np.eye(3))
        return "y" if turned else "z"

    def stood_up(self, up: UpAxis) -> Document:
        """The same file anew, with another axis up. Raises UserError where that would lose work."""
        if self.source is None or self.up is None:
            raise UserError("only a mesh or a glTF file that was not edited yet can be stood up anew; open it again")
        staging = replace(self.opening.staging, up=up)
        return Document.open(self.source, replace(self.opening, staging=staging))

    @property
    def title(self) -> str:
        """What the title bar says: the file's name, or the scene's where it has no file."""
        if self.path is not None:
            return self.path.name
        return self.scene.name or "untitled"

    @property
    def unsaved(self) -> bool:
        """Whether anything would be lost by closing."""
        return self.history.unsaved

    def save(self, path: Path | None = None) -> Path:
        """Write the scene to `path`, or back to where it came from; returns where that is.

        Raises UserError where no name is known, the suffix is not one of `SAVE_SUFFIXES`, or the file cannot be
        written; the old file is then as it was and the document still unsaved.
        """
        target = self.path if path is None else Path(path).expanduser().absolute()
        if target is None:
            raise UserError("the scene has no file yet; choose a name ending in .toml or .glb")
        suffix = target.suffix.lower()
        if suffix not in SAVE_SUFFIXES:
            raise UserError(
                f"{target.name}: a scene is saved as .toml or .glb; choose a name with one of these endings"
            )
        scene = self.scene
        if suffix in GLTF_SUFFIXES:
            save_gltf(scene, target, self._readable_original())
            self._original = target
        else:
            # With the comments of the file it came from, also under another name: a file there is another scene's.
            save_scene(scene, target, words_from=self.source)
        self.path = self.source = target
        self.history.mark_saved(scene)
        return target

    def _readable_original(self) -> Path | None:
        """The glTF file whose textures and extras are kept, while it is there to be read."""
        if self._original is None or not files.is_file(self._original):
            return None
        return self._original


def _is_own_file(path: Path) -> bool:
    """Whether saving without a name may write to `path`."""
    if path.suffix.lower() not in SAVE_SUFFIXES:
        return False
    return not path.resolve().is_relative_to(assets_dir().resolve())
