"""The scene in a file, with what the user wants in addition to what it says."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from ..base.errors import UserError
from ..model.io.scene_file import load_scene
from ..model.scene import Scene
from ..model.scene_environment import STUDIO_MAP
from ..model.staging import Staging
from .environments import ENVIRONMENT_SUFFIXES, set_environment_kind, set_environment_map

STUDIO, SKY = "studio", "sky"


@dataclass(frozen=True)
class Opening:
    """What is wanted of a file: of its objects, and the environment ("studio", "sky" or a panorama's file)."""

    staging: Staging = field(default_factory=Staging)
    environment: str | None = None


AS_FOUND = Opening()


def open_scene(path: Path, opening: Opening = AS_FOUND) -> Scene:
    """The scene in `path` as wanted. Raises UserError for what cannot be opened or cannot be fulfilled."""
    scene = load_scene(path, opening.staging)
    wish = opening.environment
    source = None if scene.environment is None else scene.environment.source
    if wish is None or (wish == STUDIO and source == str(STUDIO_MAP.resolve())):
        return scene
    # Anew, so that its brightness is fitted to the lights.
    plain = replace(scene, environment=None)
    if wish == SKY:
        return set_environment_kind(plain, "sky")
    return set_environment_map(plain, STUDIO_MAP if wish == STUDIO else _panorama(wish))


def _panorama(name: str) -> Path:
    path = Path(name).expanduser()
    if path.suffix.lower() not in ENVIRONMENT_SUFFIXES:
        raise UserError(
            f"--environment '{name}' is neither {STUDIO} nor {SKY} nor a panorama; give a latitude-longitude picture "
            f"({', '.join(ENVIRONMENT_SUFFIXES)})"
        )
    return path
