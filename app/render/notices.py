"""What a rendering reports in any case: light that was lost, lights that reached nothing, maps and pictures that
do not hold what they should. One line each; a picture without any is right as far as the program can tell."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from ..gpu.tiles import Tile
from ..model.optics.colorimetry import rgb709_to_xyz_matrix
from ..model.scene import Camera
from ..model.settings import RenderSettings
from ..passes.bounce_light import BounceLightPass
from ..passes.environment_light import EnvironmentLightPass
from ..passes.gathered_light import MAX_EVENTS
from ..passes.landings import faces_camera
from ..passes.map_layout import Window, pixel_side, project
from ..passes.picture_window import PictureWindow
from ..passes.plane_frame import TexelMap, plane_frame
from .light_pass import LightPass
from .light_stats import LightStats

LOST_SHARE = 0.01
"""Share of the light that meets glass or mirrors beyond which its loss is reported."""
HELD_SHARE = 0.5
"""Share of the light that a map puts into pixels which see it, below which a picture does not hold its map: where a
pixel is a slanting patch, 16 samples weigh a spot within it to a quarter."""
_BRIGHTEST = 4096
"""Texels that are compared with the picture."""


class FrameNotices:
    """Notices about the frames of a job, each kind once, however its shares change from frame to frame."""

    def __init__(self) -> None:
        self._found: dict[str, tuple[str, int, int]] = {}

    def take(self, notices: Iterable[str], number: int = 1) -> None:
        """Those of frame `number`, from 1 on."""
        for notice in notices:
            kind = re.sub(r"[\d.]+ %", "%", notice)
            text, first, count = self._found.get(kind, (notice, number, 0))
            self._found[kind] = text, first, count + 1

    def lines(self, of_frames: bool = False) -> list[str]:
        """A line for each kind; with the frames that it was said of."""
        if not of_frames:
            return [text for text, _, _ in self._found.values()]
        return [
            f"frame {first}" + (f" and {count - 1} more" if count > 1 else "") + f": {text}"
            for text, first, count in self._found.values()
        ]


def frame_notices(light: LightPass, camera: Camera, settings: RenderSettings, rgb: np.ndarray) -> list[str]:
    """Notices about a finished frame: its light and its picture (H, W, 3)."""
    return [*light_notices(light), *picture_notices(light, camera, settings, rgb)]


def loss_notices(lost: dict[str, float], max_depth: int | None = None) -> list[str]:
    """`lost`: shares of the light by how it ended."""
    fates = {
        "lost_depth": "was given up after the largest number of refractions and reflections"
        + (f" ({max_depth}; --max-depth allows more)" if max_depth is not None else ""),
        "lost_numeric": "was lost to numerics, for instance where a mesh is open",
    }
    return [
        f"{100.0 * lost.get(fate, 0.0):.1f} % of the light that meets glass or mirrors {words}: the picture lacks it"
        for fate, words in fates.items()
        if lost.get(fate, 0.0) > LOST_SHARE
    ]


def environment_notices(environment: EnvironmentLightPass | None, bounces: BounceLightPass | None) -> list[str]:
    """What the environment's light on receivers lacks, and what these give each other."""
    lost = {} if environment is None else {"the environment's light": environment.lost}
    if bounces is not None:
        lost["what diffuse surfaces send out"] = bounces.lost
    return [
        f"{100.0 * share:.1f} % of what glass and mirrors bring of {source} was given up after {MAX_EVENTS} surfaces: "
        "diffuse surfaces lack it"
        for source, share in lost.items()
        if share > LOST_SHARE
    ]


def shares(stats: LightStats) -> dict[str, float]:
    """Where light ended, as shares of what was emitted; empty where nothing was."""
    tally = stats.tally
    return {fate: flux / tally.emitted for fate, flux in tally.ended.items()} if tally.emitted else {}


def light_notices(light: LightPass) -> list[str]:
    """Notices about a light pass that has finished."""
    found = loss_notices(shares(light.stats), light.settings.max_depth)
    for index in light.survey.domains:
        name = light.scene.lights[index].name
        if light.buffers.light_power[index].band(0.0, 1.0)[3] > 0.0 and not len(light.survey.pilots[index].whole):
            found.append(
                f"light '{name}': of {light.survey.pilots[index].lattice_count:,} photons sent ahead none reaches a "
                "receiver by way of glass or mirrors; it draws no caustic"
            )
    outside = light.stats.outside_map_w
    drawn = light.stats.drawn_w
    if drawn and outside > LOST_SHARE * drawn:
        found.append(f"{100.0 * outside / drawn:.1f} % of the caustics misses all maps and the picture")
    if light.map_receiver is not None:  # its texels are the picture's
        return found
    pixels: dict[str, float] = {}
    for receiver, windows in light.layout.windows.items():
        if receiver in light.survey.lit_receivers and windows:
            name = light.scene.objects[light.buffers.receivers[receiver]].name
            largest = max(_window_pixels(light, receiver, window) for window in windows)
            pixels[name] = max(largest, pixels.get(name, 0.0))  # of all faces of one object
    return found + [
        f"the caustic map of '{name}' is smaller than a pixel; choose a larger --size or come nearer"
        for name, largest in pixels.items()
        if largest < 1.0
    ]


def _window_pixels(light: LightPass, receiver: int, window: Window | PictureWindow) -> float:
    """Longest side of a flat receiver's window, pixels of the picture that maps are fitted to."""
    if isinstance(window, PictureWindow):
        return float(window.pixels.max())
    points = light.buffers.space.to_gpu(light.buffers.world_meshes[light.buffers.receivers[receiver]].vertices)
    size = light.fit.width, light.fit.height
    pixel = pixel_side(light.fit.view, light.buffers, plane_frame(points), window, size)
    return float(window.size.max()) / pixel


def picture_notices(light: LightPass, camera: Camera, settings: RenderSettings, rgb: np.ndarray) -> list[str]:
    """Whether a picture (H, W, 3) with caustics in it is black, or lacks what the maps of flat receivers put into its
    pixels, where nothing may be in the way."""
    if settings.bins or settings.layer not in ("beauty", "caustic") or not np.isfinite(rgb).all():
        return []
    if light.stats.tally.ended["deposited"] > 0.0 and not rgb.any():
        if settings.layer == "beauty":
            return ["the picture is black: the camera sees nothing that is lit; see whether something hides it"]
        seen = "the camera sees what caustics fall on through glass or in mirrors, or not at all"
        return [f"the picture is black: {seen}; the layer 'beauty' shows what it sees"]
    expected, held = 0.0, 0.0
    for receiver in light.survey.lit_receivers:
        if light.layout.windows[receiver] and faces_camera(camera, light.buffers, receiver):
            found = _pixels_of(light, receiver, camera, settings)
            about = np.zeros(rgb.shape[:2], bool)
            for row, column in found:
                about[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] = True
            energy = sum(found.values())
            there = float((rgb[about].astype(float) @ rgb709_to_xyz_matrix()[1]).sum())
            expected, held = expected + energy, held + min(there, energy)
    if held >= HELD_SHARE * expected:
        return []
    share = 100.0 * held / expected
    words = f"the picture holds only {share:.0f} % of the light that its brightest caustics have in the maps"
    return [f"{words}; choose more --spp"]


def _pixels_of(
    light: LightPass, receiver: int, camera: Camera, settings: RenderSettings
) -> dict[tuple[int, int], float]:
    """Luminance, summed, that the brightest texels of a flat receiver's finest map give to pixels (row, column) that
    see them past all other objects' bounds."""
    number = light.buffers.receivers[receiver]
    item, space = light.scene.objects[number], light.buffers.space
    tile = light.layout.tiles[receiver][0]
    rows, columns, luminous = _brightest(light, tile)
    if not len(luminous):
        return {}
    frame = plane_frame(space.to_gpu(light.buffers.world_meshes[number].vertices))
    to_texels = TexelMap.of(light.layout.placements[light.layout.receivers[receiver]["placement"]], frame)
    corners = np.stack([columns + tile.x, rows + tile.y], axis=-1)
    places, *sides = (
        space.to_world(frame.at(to_texels.points(corners + at))) for at in ((0.5, 0.5), (1.5, 0.5), (0.5, 1.5))
    )
    size = settings.width, settings.height
    middle, right, up = (project(camera, size, points) for points in (places, *sides))
    inside = np.all((middle >= 0.0) & (middle < size), axis=-1)
    across, along = right - middle, up - middle
    area_px = np.abs(across[:, 0] * along[:, 1] - across[:, 1] * along[:, 0])
    material = item.material
    reflectance = (
        1.0 if material.reflectance is not None else float(rgb709_to_xyz_matrix()[1] @ material.reflectance_rgb)
    )
    if material.texture is not None:
        return {}
    texel_area = 1.0 / (to_texels.density(to_texels.points(corners + 0.5)) * space.scale**2)
    energy = luminous * light.maps.scale / texel_area * reflectance / np.pi * area_px
    inside &= np.isfinite(energy) & ~_may_be_hidden(light, number, camera, places)
    found: dict[tuple[int, int], float] = {}
    for (column, row), value in zip(
        np.floor(middle[inside]).astype(int).tolist(), energy[inside].tolist(), strict=True
    ):
        found[row, column] = found.get((row, column), 0.0) + value
    return found


def _brightest(light: LightPass, tile: Tile) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns and luminance, as summed, of the brightest texels of a map: (n,) each. Read in portions, for a map
    takes more memory than all else."""
    places, values = np.zeros(0, np.int64), np.zeros(0)
    for first, texels in light.maps.portions(tile):
        luminous = texels[..., 1].ravel()
        lit = np.flatnonzero(luminous > 0.0)
        places = np.concatenate([places, first * tile.width + lit])
        values = np.concatenate([values, luminous[lit].astype(float)])
        if len(values) > _BRIGHTEST:
            kept = np.argpartition(values, -_BRIGHTEST)[-_BRIGHTEST:]
            places, values = places[kept], values[kept]
    return places // tile.width, places % tile.width, values


def _may_be_hidden(light: LightPass, receiver: int, camera: Camera, places: np.ndarray) -> np.ndarray:
    """Whether the bounds of another object meet the way from the camera to `places` (n, 3)."""
    position = np.asarray(camera.position, float)
    if camera.kind == "orthographic":
        forward = np.asarray(camera.target, float) - position
        forward /= np.linalg.norm(forward)
        start = places - forward * ((places - position) @ forward)[:, None]
    else:
        start = np.broadcast_to(position, places.shape)
    way, hidden = places - start, np.zeros(len(places), bool)
    with np.errstate(divide="ignore", invalid="ignore"):
        for index, item in enumerate(light.scene.objects):
            if index != receiver:
                low, high = ((bound - start) / way for bound in item.world_bounds)
                enter = np.fmax.reduce(np.minimum(low, high), axis=1)
                leave = np.fmin.reduce(np.maximum(low, high), axis=1)
                hidden |= (enter <= np.minimum(leave, 1.0)) & (leave >= 0.0)
    return hidden
