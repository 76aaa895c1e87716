"""Keyed animation: parameters by path (`parameters.py`), interpolated over time; the turntable; key files.

A file of keys is TOML:

    [[keys]]
    time_s = 0.0
    parameter = "objects.prism.dispersion_gain"
    value = 0.0
    interpolation = "smooth"     # towards the next key: smooth, linear or hold
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, cast

import numpy as np

from ..base import files
from ..base.errors import UserError
from ..model.io.scene_table import SceneTable
from .parameters import Stage, apply_all, check_value, parameter
from .state import Key

Interpolation = Literal["smooth", "linear", "hold"]
SMOOTH: Interpolation = "smooth"
INTERPOLATIONS: tuple[Interpolation, ...] = ("smooth", "linear", "hold")
ORBIT = "camera.orbit_deg"
MAX_FRAMES = 1_000_000


@dataclass(frozen=True)
class Track:
    """One parameter over time."""

    path: str
    times_s: tuple[float, ...]
    """Rising."""
    values: tuple[float, ...]
    interpolations: tuple[Interpolation, ...]
    """From each key to the next."""

    def at(self, time_s: float) -> float:
        """The value at a time; before the first key and after the last it is constant."""
        times, values = self.times_s, self.values
        if time_s <= times[0]:
            return values[0]
        if time_s >= times[-1]:
            return values[-1]
        left = int(np.searchsorted(times, time_s, side="right")) - 1
        share = (time_s - times[left]) / (times[left + 1] - times[left])
        a, b = values[left], values[left + 1]
        match self.interpolations[left]:
            case "hold":
                return a
            case "linear":
                return a + (b - a) * share
        step = times[left + 1] - times[left]
        slope_a, slope_b = self._slope(left) * step, self._slope(left + 1) * step
        # Cubic Hermite, counted from a so that equal keys give exactly their value.
        return (
            a
            + (b - a) * share**2 * (3 - 2 * share)
            + slope_a * share * (1 - share) ** 2
            - slope_b * share**2 * (1 - share)
        )

    def _slope(self, index: int) -> float:
        """Slope at a key: 0 at the ends and at turning points, so that nothing overshoots [Fritsch, Butland 1984]."""
        if index in (0, len(self.times_s) - 1):
            return 0.0
        steps = np.diff(self.times_s)[index - 1 : index + 1]
        before, after = np.diff(self.values)[index - 1 : index + 1] / steps
        if before * after <= 0.0:
            return 0.0
        weights = np.array([steps[0] + 2 * steps[1], 2 * steps[0] + steps[1]])
        return float(weights.sum() / (weights[0] / before + weights[1] / after))


@dataclass(frozen=True)
class Animation:
    """A stage and what moves on it."""

    start: Stage
    tracks: tuple[Track, ...]
    times_s: tuple[float, ...]
    """Times of the frames."""

    def frame(self, index: int) -> Stage:
        """The stage at a frame: a function of its time alone."""
        return apply_all(self.start, {track.path: track.at(self.times_s[index]) for track in self.tracks})


def turntable(stage: Stage, frames: int, fps: float) -> Animation:
    """Once about the target in `frames` frames; the last comes before the first again, so that it can loop."""
    return with_turntable(Animation(stage, (), tuple(i / fps for i in range(frames))))


def with_turntable(animation: Animation) -> Animation:
    """`animation` while the camera turns about its target at an even pace; all frames together are one turn."""
    frames = len(animation.times_s)
    first = animation.times_s[0]
    step = animation.times_s[1] - first if frames > 1 else 1.0
    track = Track(ORBIT, (first, first + frames * step), (0.0, 360.0), ("linear", "linear"))
    others = tuple(t for t in animation.tracks if t.path != ORBIT)
    return replace(animation, tracks=(*others, track))


def keyed(stage: Stage, tracks: Sequence[Track], frames: int | None, fps: float) -> Animation:
    """Frames from the first key to the last; `frames` None takes as many as `fps` gives, both ends included."""
    if not tracks:
        raise UserError("there is nothing to animate: give keys, a range of a parameter, or a turntable")
    for track in tracks:
        for value in track.values:
            check_value(stage, track.path, value)
    first = min(track.times_s[0] for track in tracks)
    last = max(track.times_s[-1] for track in tracks)
    count = frames if frames is not None else max(1, round((last - first) * fps) + 1)
    if count > MAX_FRAMES:
        raise UserError(
            f"the keys span {last - first:g} s, which is {count} frames: give at most {MAX_FRAMES}, or fewer a second"
        )
    # The last frame is the last key, whatever the number of frames.
    times = np.linspace(first, last, count) if count > 1 else np.array([first])
    made = Animation(stage, tuple(tracks), tuple(float(t) for t in times))
    for index, time_s in enumerate(made.times_s):
        try:  # what cannot be drawn is refused before minutes of work
            made.frame(index)
        except UserError as error:
            raise UserError(f"the animation fails at {time_s:g} s: {error}") from error
    return made


def tracks_of(keys: Iterable[Key], interpolations: Sequence[Interpolation] = ()) -> tuple[Track, ...]:
    """Tracks of loose keys, in the order in which parameters first appear; of two keys at one time the later counts.

    `interpolations`: one a key; without them all are smooth.
    """
    keys = tuple(keys)
    kinds = tuple(interpolations) or (SMOOTH,) * len(keys)
    by_path: dict[str, dict[float, tuple[float, Interpolation]]] = {}
    for key, kind in zip(keys, kinds, strict=True):
        by_path.setdefault(key.path, {})[key.time_s] = (key.value, kind)
    tracks = []
    for path, points in by_path.items():
        times = tuple(sorted(points))
        tracks.append(Track(path, times, tuple(points[t][0] for t in times), tuple(points[t][1] for t in times)))
    return tuple(tracks)


def read_keys(path: Path, stage: Stage) -> tuple[Track, ...]:
    """Tracks of a TOML file of `[[keys]]`; raises `UserError` naming file and key."""
    try:
        document = tomllib.loads(files.read_text(path, files.SETTINGS_BYTES))
    except OSError as error:
        raise UserError(f"--keys {path} cannot be read: {error.strerror}; check the path") from error
    except (ValueError, RecursionError) as error:
        reason = "it is not UTF-8 text" if isinstance(error, UnicodeDecodeError) else str(error).partition(":")[0]
        raise UserError(f"{path.name} is not TOML: {reason}; see docs/command-line.md for an example") from error
    rows = document.pop("keys", None)
    if document:
        raise UserError(f"{path.name}: unknown key '{next(iter(document))}'; a file of keys holds [[keys]] only")
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise UserError(f"{path.name} holds no keys: write [[keys]] with time_s, parameter and value")
    keys: list[Key] = []
    kinds: list[Interpolation] = []
    for index, row in enumerate(rows):
        table = SceneTable(row, path, f"keys[{index}]")
        where = table.where("parameter") + ": "
        name = table.string("parameter")
        parameter(stage, name, where)
        keys.append(
            Key(
                table.number("time_s", at_least=0.0, at_most=1e6),
                name,
                check_value(stage, name, table.number("value"), where),
            )
        )
        kinds.append(cast(Interpolation, table.choice("interpolation", INTERPOLATIONS, "smooth")))
        table.finish("a key")
    return tracks_of(keys, kinds)


def parse_range(text: str, stage: Stage, duration_s: float) -> Track:
    """ "objects.prism.dispersion_gain=0:3" (or more values, evenly spaced) as a track over `duration_s`."""
    path, equals, numbers = text.partition("=")
    try:
        values = tuple(float(number) for number in numbers.split(":"))
    except ValueError:
        values = ()
    if not equals or len(values) < 2:
        raise UserError(f"--set '{text}' is not PARAMETER=FROM:TO, for example objects.prism.dispersion_gain=0:3")
    path = path.strip()
    for value in values:
        check_value(stage, path, value, "--set ")
    times = tuple(float(t) for t in np.linspace(0.0, duration_s, len(values)))
    return Track(path, times, values, (SMOOTH,) * len(values))
