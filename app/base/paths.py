"""Where the program's own files lie: beside `pyproject.toml` in a checkout, in the wheel otherwise."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import platformdirs

MESH_SUFFIXES = (".ply", ".obj", ".stl", ".asc")
SCENE_SUFFIXES = (".toml", ".glb", ".gltf", *MESH_SUFFIXES, ".zmx", ".csv")
CONFIG_ENVIRONMENT = "SPECTRASPLAT_CONFIG"
_MESA_INDEX_BYTES = 8 + 65536 * 20
"""A size and the keys, see Mesa's src/util/disk_cache_os.c."""
_PACKAGE = Path(__file__).resolve().parents[1]


@cache
def _data_root() -> Path:
    checkout = _PACKAGE.parent
    if (checkout / "pyproject.toml").is_file() and (checkout / "shaders").is_dir():
        return checkout
    return _PACKAGE


def shaders_dir() -> Path:
    """Folder of GLSL sources."""
    return _data_root() / "shaders"


def assets_dir() -> Path:
    """Folder of scenes, glass tables and meshes."""
    return _data_root() / "assets"


def shipped_scenes() -> dict[str, Path]:
    """Name → file of the scenes that come with the program, sorted."""
    files = sorted((assets_dir() / "scenes").glob("*"))
    return {file.stem: file for file in files if file.suffix in SCENE_SUFFIXES[:3]}


def config_path() -> Path:
    """The user's settings folder, which may not be there yet: the platform's own or what the environment names."""
    given = os.environ.get(CONFIG_ENVIRONMENT)
    return Path(given or platformdirs.user_config_dir("spectrasplat", appauthor=False))


def forget_oldest(folder: Path, suffix: str, *, files: int | None = None, size: int | None = None) -> None:
    """Keep the most recently used files of a cache folder within a number of them and of bytes, the newest in any
    case. Where there are too many, an eighth more go, so that not every new one looks at all others."""
    with os.scandir(folder) as entries:
        found = [entry for entry in entries if entry.name.endswith(suffix)]
    if size is None and (files is None or len(found) <= files):
        return
    states = [(entry.path, entry.stat()) for entry in found]
    states.sort(key=lambda item: item[1].st_mtime_ns, reverse=True)
    used = 0
    for rank, (path, state) in enumerate(states):
        used += state.st_size
        if rank and ((files is not None and rank >= files - files // 8) or (size is not None and used > size)):
            Path(path).unlink(missing_ok=True)


def cache_dir() -> Path:
    """The user's cache folder for baked trees and tables (created on demand)."""
    path = Path(platformdirs.user_cache_dir("spectrasplat", appauthor=False))
    path.mkdir(parents=True, exist_ok=True)
    return path


def reserve_driver_cache() -> None:
    """Before OpenGL starts: room on the disk for the index of Mesa's shader cache, which Mesa writes as if it were
    memory, so that a full disk would end the process there (SIGBUS). Where there is no room Mesa keeps no cache."""
    if not hasattr(os, "posix_fallocate"):
        return
    folder = Path(os.environ.get("MESA_SHADER_CACHE_DIR") or platformdirs.user_cache_dir()) / "mesa_shader_cache"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        index = os.open(folder / "index", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            os.posix_fallocate(index, 0, _MESA_INDEX_BYTES)
        finally:
            os.close(index)
    except OSError:
        os.environ["MESA_SHADER_CACHE_DISABLE"] = "true"
