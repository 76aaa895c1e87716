"""A file as it is opened for somebody: the scene in it, with what they asked for beyond what it says."""

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
    """Wishes for a file: of its objects, and of what lies behind them ("studio", "sky" or a panorama's file)."""

    staging: Staging = field(default_factory=Staging)
    environment: str | None = None


AS_FOUND = Opening()


def open_scene(path: Path, opening: Opening = AS_FOUND) -> Scene:
    """The scene in `path` as wished. Raises UserError for what cannot be opened or cannot be had."""
    scene = load_scene(path, opening.staging)
    wish = opening.environment
    if wish is None or (wish == STUDIO and _shows_studio(scene)):
        return scene
    # Anew, so that its brightness is fitted to the lights.
    plain = replace(scene, environment=None)
    if wish == SKY:
        return set_environment_kind(plain, "sky")
    return set_environment_map(plain, STUDIO_MAP if wish == STUDIO else _panorama(wish))


def _shows_studio(scene: Scene) -> bool:
    return scene.environment is not None and scene.environment.source == str(STUDIO_MAP.resolve())


def _panorama(name: str) -> Path:
    path = Path(name).expanduser()
    if path.suffix.lower() not in ENVIRONMENT_SUFFIXES:
        raise UserError(
            f"--environment '{name}' is neither {STUDIO} nor {SKY} nor a panorama; give a latitude-longitude picture "
            f"({', '.join(ENVIRONMENT_SUFFIXES)})"
        )
    return path
