"""Command line values checked by hand, so that each mistake gets one sentence with a way out.

The options arrive as strings: click's own conversions would say less and differ between
versions. Every function raises `UserError`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import files
from ..base.errors import UserError, nearest_names, suggestion
from ..base.memory import MAX_SIDE_PX, memory_bytes
from ..base.paths import SCENE_SUFFIXES, shipped_scenes
from ..model.scene import Scene
from ..model.scene_camera import FOCUS_DISTANCE, LENS_RADIUS
from ..model.scene_render import HAZE, HAZE_ANISOTROPY, MAX_ANISOTROPY, MAX_BOUNCES, MAX_GLARE, MAX_HAZE
from ..model.settings import CAMERA_METHODS, METHODS

if TYPE_CHECKING:
    from ..edit.opening import Opening

MAX_PHOTONS = 10**12
MAX_SEED = 2**32 - 1
MAX_SECONDS = 7 * 24 * 3600.0
MIN_BINS, MAX_BINS = 4, 32
MAX_DEPTH = 4096
MAX_SPP = 4096
MAX_PARTS = 100_000
MAX_EXPOSURE_EV = 64.0
_MULTIPLES = {"k": 10**3, "m": 10**6, "g": 10**9}
_BYTES_PER_PHOTON = 256
"""A photon record with several spectral columns, rounded up."""


def parse_size(text: str) -> tuple[int, int]:
    """ "960x540" (or with ×, X) as (width, height) in pixels."""
    parts = text.strip().lower().replace("×", "x").split("x")
    if len(parts) != 2 or not all(_is_integer(part) for part in parts):
        raise UserError(f"--size '{text}' is not WIDTHxHEIGHT, for example --size 960x540")
    width, height = int(parts[0]), int(parts[1])
    if width < 1 or height < 1:
        raise UserError(f"--size {text} holds no pixel: both sides must be at least 1")
    if width > MAX_SIDE_PX or height > MAX_SIDE_PX:
        raise UserError(f"--size {text} is too large: no side may exceed {MAX_SIDE_PX} pixels")
    return width, height


def parse_photons(text: str) -> int:
    """A count of photons; "2M", "500k" and "1e6" are understood."""
    count = _count("--photons", text)
    if count > MAX_PHOTONS:
        raise UserError(f"--photons {text} is beyond what can be counted: give at most {MAX_PHOTONS:.0e}")
    return count


def parse_batch(text: str) -> int:
    """Photons in flight at once; their records must fit into memory."""
    count = _count("--batch", text)
    limit = memory_bytes() // _BYTES_PER_PHOTON
    if count > limit:
        raise UserError(f"--batch {text} is beyond this machine's memory: give at most {limit}")
    return count


def _count(option: str, text: str) -> int:
    stripped = text.strip().lower().replace("_", "").replace(",", "")
    multiple = _MULTIPLES.get(stripped[-1:], 1)
    try:
        value = float(stripped[:-1] if multiple != 1 else stripped) * multiple
    except ValueError:
        value = math.nan
    if math.isnan(value) or (math.isfinite(value) and not value.is_integer()):
        raise UserError(f"{option} '{text}' is not a whole number: give for example 1000000, 1e6 or 1M")
    if value < 1:
        raise UserError(f"{option} {text} is too few: give at least 1")
    if value > 10**18:
        raise UserError(f"{option} {text} is beyond what memory can hold: give at most {MAX_PHOTONS:.0e}")
    return int(value)


def parse_seconds(text: str) -> float:
    """A time budget in seconds."""
    value = _number("--seconds", text, "for example 10")
    if not 0.0 < value <= MAX_SECONDS:
        raise UserError(f"--seconds {text} is out of range: give more than 0 and at most {MAX_SECONDS:.0f}")
    return value


def parse_exposure(text: str) -> float:
    """Stops."""
    value = _number("--exposure", text, "in stops, for example -1.5")
    if not abs(value) <= MAX_EXPOSURE_EV:
        raise UserError(
            f"--exposure {text} is out of range: give between -{MAX_EXPOSURE_EV:.0f} and {MAX_EXPOSURE_EV:.0f} stops"
        )
    return value


def parse_glare(text: str) -> float:
    """A share."""
    value = _number("--glare", text, "a share, for example 0.03")
    if not 0.0 <= value <= MAX_GLARE:
        raise UserError(f"--glare {text} is out of range: give a share of 0 to {MAX_GLARE:g}")
    return value


def parse_bounces(text: str) -> int:
    """How often light goes on from one diffuse surface to another."""
    return parse_integer("--bounces", text, 0, MAX_BOUNCES)


def parse_haze(text: str) -> float:
    """Scattering coefficient of the haze round all objects, 1/scene unit."""
    value = _number("--haze", text, "per scene unit, for example 0.03")
    if not HAZE.holds(value):
        raise UserError(f"--haze {text} is out of range: give 0 (clear air) to {MAX_HAZE:g} per scene unit")
    return value


def parse_haze_anisotropy(text: str) -> float:
    """Mean cosine of the angle by which haze scatters."""
    value = _number("--haze-anisotropy", text, "between -0.99 and 0.99, for example 0.3")
    if not HAZE_ANISOTROPY.holds(value):
        raise UserError(f"--haze-anisotropy {text} is out of range: give -{MAX_ANISOTROPY:g} to {MAX_ANISOTROPY:g}")
    return value


def with_lens(scene: Scene, radius: str | None, distance: str | None) -> Scene:
    """The scene with another lens on its camera; None: its own."""
    lens: dict[str, float] = {}
    for option, text, field in (("--lens-radius", radius, LENS_RADIUS), ("--focus-distance", distance, FOCUS_DISTANCE)):
        if text is None:
            continue
        value = _number(option, text, "a length in the scene's unit, for example 0.05")
        if not field.holds(value):
            least = "0 or more" if field is LENS_RADIUS else "more than 0"
            raise UserError(f"{option} {text} is out of range: give {least} and up to {field.at_most:g}")
        lens[field.attribute] = value
    camera = replace(scene.camera, **lens)  # type: ignore[arg-type]
    if distance is not None and camera.lens_radius == 0.0:
        raise UserError("--focus-distance changes nothing where the lens has no radius: give --lens-radius as well")
    return replace(scene, camera=camera)


def parse_integer(option: str, text: str, low: int, high: int) -> int:
    """A whole number in [low, high] for `option`."""
    if not _is_integer(text.strip()):
        raise UserError(f"{option} '{text}' is not a whole number, give between {low} and {high}")
    value = int(text)
    if not low <= value <= high:
        raise UserError(f"{option} {text} is out of range: give between {low} and {high}")
    return value


def _one_of(option: str, text: str, known: Sequence[str]) -> str:
    if text not in known:
        raise UserError(f"{option} '{text}' is unknown{suggestion(text, known) or ','} known are {', '.join(known)}")
    return text


def parse_method(text: str) -> str:
    """One of the sampling methods."""
    return _one_of("--method", text, METHODS)


def parse_reference(text: str) -> str:
    """What a reference meets, one of `REFERENCES`."""
    from ..bench.results import REFERENCES

    return _one_of("--reference", text, REFERENCES)


def parse_camera_method(text: str) -> str:
    """One of those that camera rays may follow."""
    return _one_of("--camera-method", text, CAMERA_METHODS)


def check_layer(text: str, scene: Scene) -> str:
    """ "beauty", "caustic" or "map:RECEIVER" with a diffuse object of `scene`."""
    if text in ("beauty", "caustic"):
        return text
    receivers = receivers_of(scene)
    kind, _, name = text.partition(":")
    if kind != "map":
        hint = suggestion(text, ("beauty", "caustic", "map"))
        raise UserError(f"--layer '{text}' is unknown{hint or ','} known are beauty, caustic and map:RECEIVER")
    if name not in receivers:
        listed = ", ".join(f"'map:{receiver}'" for receiver in receivers) or "none, for nothing in it is diffuse"
        raise UserError(f"--layer '{text}' names no receiver of scene '{scene.name}'; it has {listed}")
    return text


def receivers_of(scene: Scene) -> list[str]:
    """Names of the diffuse objects, in the scene's order."""
    return list(dict.fromkeys(item.name for item in scene.objects if item.material.receives))


def parse_opening(
    up: str | None, glass: Sequence[str] | None, environment: str | None, smooth: bool | None = None
) -> Opening | None:
    """Which axis of a file is up, glasses as "GLASS" or "OBJECT=GLASS", what lies behind it, and whether its meshes are
    round. An object's name may hold "=": the last one counts. None where nothing is asked for."""
    if up is None and not glass and environment is None and smooth is None:
        return None
    from ..edit.opening import SKY, STUDIO, Opening
    from ..model.staging import UP_AXES, Staging

    axis = next((each for each in UP_AXES if each == up), None)
    if up is not None and axis is None:
        raise UserError(f"--up '{up}' is no axis that can be up: give y or z")
    pairs = []
    for text in glass or ():
        name, equals, kind = text.rpartition("=")
        if not kind or (equals and not name):
            raise UserError(f"--glass '{text}' names no glass: give --glass diamond, or --glass OBJECT=N-SF11")
        pairs.append((name if equals else None, kind))
    if environment is not None and environment not in (STUDIO, SKY):
        path = Path(environment).expanduser()
        if not files.is_file(path):
            raise UserError(f"--environment '{environment}' is neither studio nor sky nor a file; check the path")
    return Opening(Staging(axis, tuple(pairs), smooth), environment)


def open_scene(text: str, opening: Opening | None) -> Scene:
    """The scene given by path or bare name, as wished."""
    path = find_scene(text)
    if opening is None:
        from ..model.io.scene_file import load_scene

        return load_scene(path)
    from ..edit.opening import open_scene as opened

    return opened(path, opening)


def find_scene(text: str) -> Path:
    """The file of a scene given by path, or by the bare name of a shipped one."""
    path = Path(text)
    if files.is_file(path):
        return path
    if os.path.isdir(path):
        raise UserError(f"scene {text} is a folder: give a scene file in it")
    shipped = shipped_scenes()
    if text in shipped:
        return shipped[text]
    if os.path.exists(path):
        raise UserError(f"scene {text} is a device or a pipe: give an ordinary file")
    if os.sep in text or path.suffix:
        near = nearest_names(path.name, _files_beside(path))
        hint = f", did you mean '{path.with_name(near[0])}'?" if near else ""
        if not hint and path.stem in shipped:
            hint = f", did you mean the shipped scene '{path.stem}'?"
        raise UserError(f"scene file {text} does not exist{hint or ': check the path'}")
    hint = suggestion(text, shipped)
    names = ", ".join(shipped) or "none"
    raise UserError(f"scene '{text}' is neither a file nor shipped{hint or ','} shipped are {names}")


def _files_beside(path: Path) -> list[str]:
    try:
        return [entry.name for entry in path.parent.iterdir() if entry.suffix.lower() in SCENE_SUFFIXES]
    except OSError:
        return []


def _is_integer(text: str) -> bool:
    """ASCII digits with an optional sign, of a length that int() takes gladly."""
    digits = text.removeprefix("-").removeprefix("+")
    return digits.isascii() and digits.isdigit() and len(digits) <= 18


def _number(option: str, text: str, example: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if math.isnan(value):
        raise UserError(f"{option} '{text}' is not a number, give one {example}")
    return value
