"""What is remembered between sessions, in one JSON file of the user's config folder.

The folder is the platform's own, or the one that SPECTRASPLAT_CONFIG names (tests do).
A file that cannot be read is set aside under another name and reported, never fatal and never
silently lost; a folder that cannot be written costs only the remembering.
"""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec

from ..base import files
from ..base.atomic import atomic_output
from ..base.errors import UserError
from ..base.paths import CONFIG_ENVIRONMENT, config_path
from ..model.staging import UpAxis
from .state import Preferences

MAX_RECENT = 10
MAX_UP = 100
"""Files whose axis is remembered."""
_FILE = "settings.json"
_SCALES = (0.5, 4.0)
_PHOTONS = (10_000, 10**12)


@dataclass(frozen=True)
class WindowPlace:
    """Where the window was, in screen coordinates; None lets the system choose."""

    position: tuple[int, int] | None = None
    size: tuple[int, int] = (1440, 900)
    maximised: bool = False


@dataclass(frozen=True)
class Settings:
    """Everything remembered."""

    preferences: Preferences = field(default_factory=Preferences)
    recent: tuple[Path, ...] = ()
    """Files opened or saved, the last one first; some may be gone."""
    window: WindowPlace = field(default_factory=WindowPlace)
    is_new: bool = True
    """Nobody has seen the start page yet."""
    up: dict[str, UpAxis] = field(default_factory=dict)
    """File -> the axis that its user said is up; the last one said is the last."""

    def opened(self, path: Path) -> Settings:
        """With `path` the most recent file."""
        path = Path(os.path.abspath(path))
        others = tuple(p for p in self.recent if p != path)
        return replace(self, recent=(path, *others)[:MAX_RECENT])

    def said_up(self, path: Path, up: UpAxis) -> Settings:
        """With `up` remembered for the file at `path`."""
        key = os.path.abspath(path)
        kept = [(k, v) for k, v in self.up.items() if k != key][1 - MAX_UP :]
        return replace(self, up=dict([*kept, (key, up)]))

    def up_of(self, path: Path) -> UpAxis | None:
        """What was said of the file at `path`."""
        return self.up.get(os.path.abspath(path))

    def existing_recent(self) -> tuple[Path, ...]:
        """Recent files that are still there."""
        return tuple(p for p in self.recent if files.is_file(p))


def config_dir() -> Path:
    """The user's settings folder, created on demand. Raises UserError when it cannot be."""
    path = config_path()
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        remedy = f"make it writable or set {CONFIG_ENVIRONMENT} to another folder"
        raise UserError(f"the settings folder {path} cannot be made: {error.strerror}; {remedy}") from error
    return path


def layout_file() -> Path:
    """Where Dear ImGui keeps the places of its windows (its `imgui.ini`)."""
    return config_dir() / "layout.ini"


def load_settings() -> tuple[Settings, str | None]:
    """What was remembered, and a sentence to show when it could not be read."""
    try:
        path = config_dir() / _FILE
    except UserError as error:
        return Settings(), f"Settings are not remembered: {error}."
    try:
        data = files.read_bytes(path, files.SETTINGS_BYTES)
    except FileNotFoundError:
        return Settings(), None
    except OSError as error:
        return (
            Settings(),
            f"The settings in {path} cannot be read ({error.strerror}); those of a new installation are used.",
        )
    try:
        settings = msgspec.json.decode(data, type=Settings, dec_hook=_decode_path)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        where = set_aside(path, "The settings", error)
        return Settings(), f"{where}; those of a new installation are used."
    return _sound(settings), None


def save_settings(settings: Settings) -> None:
    """Remember `settings`, whole or not at all. Raises UserError when the folder is not writable."""
    # A file's name need not be text; such a one is not remembered.
    recent = tuple(path for path in settings.recent if _is_text(path))
    up = {name: axis for name, axis in settings.up.items() if _is_text(Path(name))}
    content = msgspec.json.format(msgspec.json.encode(replace(settings, recent=recent, up=up), enc_hook=os.fspath))
    with atomic_output(config_dir() / _FILE) as temporary:
        temporary.write_bytes(content)


def _decode_path(kind: type, value: object) -> Path:
    if kind is Path and isinstance(value, str):
        return Path(value)
    raise ValueError(f"{kind.__name__} expected")


def _sound(settings: Settings) -> Settings:
    """Values that would make the interface unusable are brought back into range."""
    given = settings.preferences
    scale = min(max(given.ui_scale, _SCALES[0]), _SCALES[1])
    photons = min(max(given.target_photons, _PHOTONS[0]), _PHOTONS[1])
    width, height = settings.window.size
    window = replace(settings.window, size=(max(width, 320), max(height, 240)))
    preferences = replace(given, ui_scale=scale, target_photons=photons)
    return replace(settings, preferences=preferences, window=window, recent=settings.recent[:MAX_RECENT])


def set_aside(path: Path, what: str, error: Exception) -> str:
    """Keep a damaged file under another name; says so, opened by `what` ("The settings"), without its full stop."""
    aside = path.with_name(f"{path.stem}.broken{path.suffix}")
    reason = str(error).partition("\n")[0]
    with suppress(OSError):
        os.replace(path, aside)
        return f"{what} were damaged ({reason}) and are kept as {aside}"
    return f"{what} in {path} are damaged ({reason})"


def _is_text(path: Path) -> bool:
    try:
        os.fspath(path).encode()
    except UnicodeEncodeError:
        return False
    return True
