"""Saving over what a person wrote: an edited light or object keeps, key by key, the words that still say what it is.

Units, rotations in degrees, `rests_at_z`, a glass's short name and the comments behind them stay where nobody changed
what they say. What is written is read again first: words that would not give the same value give way to plain ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import UserError
from ..geometry.mesh import Mesh
from ..lights.light import Light
from ..lights.light_file import light_values, read_light
from ..placement import PLACEMENT_KEYS, Surroundings, angles_deg, read_placement
from ..scene_objects import rested
from .scene_table import SceneTable

_REST = "rests_at_z"
_AIM = ("target", "direction")
_DIGITS = 9
_SAME = 1e-8
"""Relative difference up to which words read back as what is meant."""


def merged(
    raw: Mapping[str, Any], old: Mapping[str, Any], new: Mapping[str, Any], rounded: Iterable[str] = ()
) -> dict[str, Any]:
    """The table `raw`, whose plain keys were `old`, with those that differ in `new`; `rounded`: which of these numbers
    need no more than `_DIGITS` digits."""
    changed = {key: value for key, value in new.items() if not _alike(old.get(key), value)}
    changed |= {key: _tidy(changed[key]) for key in rounded if key in changed}
    return _without(raw, old.keys() - new.keys()) | changed


def kept_light(
    raw: Mapping[str, Any], before: Light, after: Light, path: Path, index: int, around: Surroundings
) -> dict[str, Any]:
    """One of [[lights]] for `after`, in the words `raw` of `before` where these still hold."""
    if before.kind != after.kind:
        return light_values(after, path)
    power = next((key for key in after.power_keys if key.key in raw), None)
    old, new = (light_values(each, path, power) for each in (before, after))
    values = merged(raw, old, new, ("position", "direction", *(() if power is None else (power.key,))))
    # A target says where a light is aimed only as long as it is not moved.
    aimed = _without(values, _AIM) | {key: new[key] for key in ("direction",) if key in new}
    candidates = (values, aimed)
    return next(
        (each for each in candidates if _reads_as_light(each, after, path, index, around)), light_values(after, path)
    )


def kept_placement(raw: Mapping[str, Any], mesh: Mesh, wanted: np.ndarray, path: Path) -> dict[str, Any]:
    """Keys of an object's placement `wanted` (4, 4): those of `raw` where they say it, the fewest others where not."""
    written = {key: raw[key] for key in (*PLACEMENT_KEYS, _REST) if key in raw}
    place = {"position": _tidy(wanted[:3, 3])}
    turned = place | _turned(wanted)
    candidates = [written]
    if "matrix" not in written:
        candidates += [written | place, _without(written, (_REST,)) | place]
        rests = {key: written[key] for key in (_REST, "position") if key in written}
        candidates += [_turned(wanted) | rests, turned | rests, turned]
    for candidate in candidates:
        if _reads_as_placement(candidate, mesh, wanted, path):
            return candidate
    return {"matrix": [float(v) for v in wanted.ravel()]}


def _turned(matrix: np.ndarray) -> dict[str, Any]:
    """`rotation_deg` and `scale` of a matrix without shear, without those that say nothing; about x, y, z."""
    linear = matrix[:3, :3]
    scale = np.linalg.norm(linear, axis=0)
    if not scale.all():
        return {}
    if np.linalg.det(linear) < 0.0:
        scale[2] *= -1.0
    angles = _tidy(angles_deg(linear / scale))
    values: dict[str, Any] = {}
    if any(angles):
        values["rotation_deg"] = angles
    if np.ptp(scale) <= _SAME * abs(scale[0]):
        if not _close(scale[0], 1.0):
            values["scale"] = _rounded(scale[0])
    else:
        values["scale"] = _tidy(scale)
    return values


def _reads_as_placement(values: Mapping[str, Any], mesh: Mesh, wanted: np.ndarray, path: Path) -> bool:
    try:
        found = read_placement(SceneTable(_without(values, (_REST,)), path))
    except UserError:
        return False
    found = rested(mesh, found, values.get(_REST))
    return bool(np.allclose(found, wanted, rtol=0.0, atol=_SAME * max(1.0, float(np.abs(wanted).max()))))


def _reads_as_light(values: Mapping[str, Any], wanted: Light, path: Path, index: int, around: Surroundings) -> bool:
    try:
        found = read_light(SceneTable(values, path), index, around)
    except UserError:
        return False
    a, b = (light_values(each, path) for each in (found, wanted))
    return a.keys() == b.keys() and all(_alike(a[key], b[key]) for key in a)


def _alike(a: Any, b: Any) -> bool:
    """Numbers to `_SAME`, all else exactly."""
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_alike(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(_alike(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, int | float) and isinstance(b, int | float) and not isinstance(a, bool):
        return _close(float(a), float(b))
    return bool(a == b)


def _close(a: float, b: float) -> bool:
    return a == b or abs(a - b) <= _SAME * max(abs(a), abs(b), _SAME)


def _without(values: Mapping[str, Any], keys: Iterable[str]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if key not in set(keys)}


def _rounded(value: float) -> float:
    return float(f"{float(value):.{_DIGITS}g}")


def _tidy(values: Any) -> Any:
    """Numbers, or one, of as many digits as somebody might read; what is negligible next to the others is 0."""
    if isinstance(values, float):
        return _rounded(values)
    found = [_rounded(v) for v in values]
    largest = max(map(abs, found), default=0.0)
    return [0.0 if abs(v) < 1e-12 * max(largest, 1.0) else v for v in found]
