"""A receiver's caustic map as a texture, with its place on the receiver in a `.json` next to it.

What is written is irradiance: the light that glass and mirrors cast on the receiver, before its own reflectance,
linear Rec.709 in lm/unit² for white. A flat receiver gets the rectangle on which its light lands; a curved one its
charts, with the texture coordinates of every triangle.
"""

from __future__ import annotations

import json
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from ..base import files
from ..base.atomic import atomic_outputs
from ..base.errors import UserError, suggestion
from ..base.image_io import check_finite, check_suffix, write_image
from ..base.tone_map import auto_exposure
from ..edit.parameters import Stage
from ..gpu.context import Context
from ..model.geometry.charts import ChartAtlas
from ..model.scene import Scene
from ..model.settings import RenderSettings
from ..passes.plane_frame import plane_frame
from .frames import FrameRenderer, Picture, Stop
from .light_pass import LightPass
from .notices import FrameNotices, light_notices

DEFAULT_SIZE = (1024, 1024)
UNITS = "irradiance, lm/unit² (linear Rec.709, white counts in full), without the receiver's reflectance"


def placement_path(path: Path) -> Path:
    """The `.json` that belongs to a baked map."""
    return path.with_suffix(".json")


def written_with(path: Path, *others: Path) -> list[Path]:
    """`path` and the files that are written with it. Raises `UserError` where one of those is there and was not
    written with a `path` of this name, as the `.json` says: nobody was asked whether it may go."""
    beside = [*others, placement_path(path)]
    there = [each.name for each in beside if files.is_file(each)]
    try:
        numbers = msgspec.json.decode(files.read_bytes(beside[-1], files.TABLE_BYTES))
    except (OSError, msgspec.DecodeError):
        numbers = None
    if there and not (isinstance(numbers, dict) and numbers.get("file") == path.name):
        raise UserError(
            f"cannot write {path}: that would replace {' and '.join(there)} next to it, which it "
            "did not write; choose another name"
        )
    return [path, *beside]


def check_receiver(scene: Scene, name: str) -> None:
    """Raise `UserError`, naming those there are, where this is no receiver of `scene`."""
    known = scene.receiver_names
    if name not in known:
        listed = ", ".join(f"'{receiver}'" for receiver in known) or "none, for nothing in it is diffuse"
        raise UserError(f"'{name}' is no receiver of scene '{scene.name}'{suggestion(name, known)}; it has {listed}")


@dataclass(frozen=True)
class Drawn:
    """Pictures of the same settings, random numbers and texels; of a map the irradiance, see `UNITS`, row 0 on top."""

    pictures: list[Picture]
    placement: Mapping[str, object]
    """Where the map lies on its receiver; empty for other layers."""
    window: np.ndarray | None
    """`MapFit.window` by which a map holds the same part of its receiver again."""
    photons: int
    notices: list[str]


def drawn(
    context: Context,
    settings: RenderSettings,
    fitted: Sequence[Stage],
    window: np.ndarray | None = None,
    *others: Stage,
    stop: Stop = lambda: False,
) -> Generator[float, None, Drawn]:
    """What `settings.layer` shows of the stages that maps and lattices are `fitted` to, and of `others`, pausing with
    the share done. What was done when `stop()` turned true is a picture too. Raises `UserError`."""
    stages = [*fitted, *others]
    pictures: list[Picture] = []
    renderer = FrameRenderer(context, settings, fitted, window=window)
    try:
        for stage in stages:
            for share in renderer.steps(stage, stop):
                yield 0.98 * (len(pictures) + share) / len(stages)
            pictures.append(renderer.picture)
        light = renderer.light
        where = placement(light) if settings.layer.startswith("map:") else {}
        return Drawn(pictures, where, renderer.window, light.stats.photons, light_notices(light))
    finally:
        renderer.release()


def bake_map(
    context: Context,
    stage: Stage,
    settings: RenderSettings,
    receiver: str,
    stop: Stop = lambda: False,
) -> Generator[float, None, Drawn]:
    """The caustic map of `receiver` in steps; `settings.width`, `height`: texels. Raises `UserError`."""
    check_receiver(stage.scene, receiver)
    return (yield from drawn(context, replace(settings, layer=f"map:{receiver}"), [stage], stop=stop))


def bake(
    context: Context,
    stage: Stage,
    settings: RenderSettings,
    receiver: str,
    path: Path,
    notices: FrameNotices | None = None,
) -> Iterator[float]:
    """Bake in steps, pausing with the share done; writes `path` and its placement at the end, or nothing if it is left
    before.

    `settings.width`, `height`: texels. What is noticed about the light pass is added to `notices`. Raises `UserError`.
    """
    check_suffix(path)
    baked = yield from bake_map(context, stage, settings, receiver)
    if notices is not None:
        notices.take(baked.notices)
    write_map(baked, stage.scene, receiver, path)
    yield 1.0


def write_map(baked: Drawn, scene: Scene, receiver: str, path: Path) -> None:
    """Write a map and its placement, or neither. Raises `UserError`."""
    rgb = baked.pictures[0].rgb
    check_finite(path.name, rgb)
    numbers = {**baked.placement, "receiver": receiver, "scene": scene.name, "file": path.name, "units": UNITS}
    if path.suffix.lower() == ".png":
        numbers["exposure_ev"] = auto_exposure(rgb)
    with atomic_outputs(*written_with(path)) as (picture, note):
        write_image(path, rgb, antialias=False, into=picture)  # a texture: a pixel stays what it is
        note.write_text(json.dumps(numbers, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def placement(light: LightPass) -> Mapping[str, object]:
    """The place of the map that the settings' layer names."""
    receiver = light.map_receiver
    assert receiver is not None
    x0, y0, x1, y1 = light.layout.tiles[receiver][0].rect
    width, height = x1 - x0, y1 - y0
    charts = light.layout.charts.get(receiver)
    where = _rectangle(light, receiver, width, height) if charts is None else _charts(light, receiver, charts)
    return {"width": width, "height": height, **where}


def _rectangle(light: LightPass, receiver: int, width: int, height: int) -> Mapping[str, object]:
    space = light.buffers.space
    points = space.to_gpu(light.buffers.world_meshes[light.buffers.receivers[receiver]].vertices)
    frame = plane_frame(points)
    low, high = light.layout.windows[receiver][0].low, light.layout.windows[receiver][0].high
    corners = {
        "bottom_left": (low[0], low[1]),
        "bottom_right": (high[0], low[1]),
        "top_right": (high[0], high[1]),
        "top_left": (low[0], high[1]),
    }
    world = {
        name: space.to_world(frame.origin + np.array(place) @ frame.axes).tolist() for name, place in corners.items()
    }
    size = (high - low) / space.scale
    return {
        "kind": "rectangle",
        "corners_world": world,
        "normal_world": np.cross(frame.axes[0], frame.axes[1]).tolist(),
        "size_units": size.tolist(),
        "texel_size_units": (size / (width, height)).tolist(),
    }


def _charts(light: LightPass, receiver: int, charts: ChartAtlas) -> Mapping[str, object]:
    mesh = light.buffers.world_meshes[light.buffers.receivers[receiver]]
    corners = mesh.corners()
    texel = np.einsum("tij,tcj->tci", charts.rows[..., :3], corners) + charts.rows[:, None, :, 3]
    # As glTF has them: (0, 0) is the picture's upper left corner; row 0 of the map is its bottom.
    uv = np.stack([texel[..., 0] / charts.width, 1.0 - texel[..., 1] / charts.height], axis=-1)
    return {
        "kind": "charts",
        "uv_origin": "upper left",
        "mesh": mesh.name,
        "own_uv": charts.from_own_uv,
        "triangle_uv": np.round(uv, 7).tolist(),
        "texel_area_units2": [float(charts.texel_area.min()), float(charts.texel_area.max())],
    }
