"""The layout of the caustic maps on the receivers, fitted to where pilot photons landed.

A flat receiver gets a coarse window over everything that lands on it and a fine one inside: for a picture that is kept
on the camera's own pixels, for one that changes where most of the light falls on (or the camera sees) a small part of
the plane. A curved receiver gets charts. All of them are tiles of one atlas.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..base.errors import UserError
from ..gpu.records import NONE, PLACEMENT, RECEIVER
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.tiles import Tile, pack
from ..model.geometry.charts import ChartAtlas, build_charts
from ..model.scene import Camera, Scene
from ..model.scene_camera import camera_frame, camera_rays
from .borders import lit_borders
from .landings import Landings, faces_camera, is_back, on_both
from .map_atlas import placement_rows
from .picture_window import PLENTY, PictureWindow, picture_window
from .plane_frame import PlaneFrame, plane_frame

MIN_TILE = 32
_UNSEEN_TILE = 64
"""Longest side, texels, of the map of a side that pilot photons did not meet and the camera does not look at."""
LEVEL_STEPS = (1, 2, 4, 8, 16, 32, 64)
"""Texel widths in which every window is kept: broad splats go to the wider ones (footprint.comp). A window on a
picture's pixels has whole pixels second, and wider ones from there on (`steps_of`)."""
_MIN_SIDE = 1e-4
"""Least side of a window as a share of its coordinates: float32 places have some texels in it."""
_GRID, _SEEN_QUANTILE = 17, 0.9
"""Points of a window along a side, at which pixels are measured; the share of them whose pixels have all the texels
that they should."""
_QUANTILE = 0.01
_MARGIN = 0.06
_BEYOND, _BEYOND_TEXELS = 1.0, 256
"""What lands where no pilot photon did: how far round these, as a share of their extent, and in how many texels along
the longer side. In view it is kept wherever it lands."""


@dataclass(frozen=True)
class Fineness:
    """How fine maps are."""

    texels_per_pixel: float
    """Along a pixel's side in a fine window: what is thinner than a texel is blurred to it, and a pixel's border cuts
    texels in parts."""
    fine: int
    """Longest side of a fine window, texels."""
    coarse: int
    """Longest side of a coarse window, texels."""
    in_register: int = 0
    """Texels along a pixel's side, at most, of windows on the picture's own pixels; 0: none is made, since each view
    needs others."""

    @property
    def least_pixels(self) -> float:
        """Least side of a window, pixels: texels of the smallest tile are no finer than others then, and no camera
        sample steps over them."""
        return MIN_TILE / self.texels_per_pixel

    def times(self, factor: float) -> Fineness:
        """Coarser by `factor` below 1."""
        fewer = round(self.fine * factor), round(self.coarse * factor)
        return replace(self, texels_per_pixel=self.texels_per_pixel * factor, fine=fewer[0], coarse=fewer[1])


LIVE = Fineness(2.0, 2048, 768)
"""For the viewer's pictures."""
STILL = Fineness(4.0, 3072, 1024, 4)
"""For pictures that are kept."""
_SHRINK = 0.85
"""Factor by which maps that do not fit a texture are made coarser until they do."""
_LEAST_TEXELS_PER_PIXEL = 0.5
"""Maps are not made coarser than this to fit a texture."""
_NOWHERE = np.array([[0.0, 0.0, 0.0, -1e6]] * 2)
"""Places in a map that nothing touches."""


@dataclass(frozen=True)
class Window:
    """A rectangle on a flat receiver, coordinates along `axes` in GPU space."""

    low: np.ndarray
    high: np.ndarray
    largest: int | None = None
    """Longest side, texels, of a window of one texel a pixel; None: as `Fineness` says."""

    @property
    def size(self) -> np.ndarray:
        return self.high - self.low


@dataclass(frozen=True)
class MapLayout:
    """Everything the atlas and the lookups need; `tiles[receiver]` lists each window's finest texels, fine window
    first. A bake's has no more than the fronts, whose maps hold what lands on either side."""

    size: tuple[int, int]
    placements: np.ndarray
    receivers: np.ndarray
    tiles: dict[int, list[Tile]]
    windows: dict[int, list[Window | PictureWindow]]
    charts: dict[int, ChartAtlas]
    folds: tuple[tuple[Tile, Tile, int], ...]
    """(wider texels, finer texels) of the same window, in the order in which they are added up, and how many finer ones
    along a wider one's side share it evenly; 0: it is two, and interpolated."""
    frames: dict[int, PlaneFrame] = field(default_factory=dict)
    """Frames of flat receivers."""
    borders: dict[int, np.ndarray] = field(default_factory=dict)
    """Borders of convex flat receivers, (n, 4): those near which light lands (`borders.borders_near`)."""
    seen: dict[int, Window | None] = field(default_factory=dict)
    """What the camera sees of flat receivers (`visible`)."""

    def resolved_width(self, receiver: int) -> float:
        """What a receiver's finest map resolves, scene units: a texel's side, or half a pixel's where texels are
        smaller than that. These are so only that outlines cut them in smaller parts."""
        side = float(np.sqrt(self.placements["texel_area"][self.receivers[receiver]["placement"]]))
        window = next(iter(self.windows.get(receiver, ())), None)
        return side * max(1.0, window.per_pixel / PLENTY) if isinstance(window, PictureWindow) else side


def layout_maps(
    scene: Scene,
    buffers: SceneBuffers,
    landings: dict[int, Landings],
    picture: tuple[int, int],
    reflectance_class: dict[int, int],
    map_receiver: int | None = None,
    fineness: Fineness = STILL,
    window: np.ndarray | None = None,
) -> MapLayout:
    """Fit windows and charts, as fine as `fineness` says or as fit a texture.

    `picture`: (width, height) whose camera decides resolution and what is in view; with `map_receiver`
    that receiver's one window has exactly this size instead and the camera is ignored; it just holds `window`
    (n, 3), GPU space, then, and all maps hold both sides.
    Raises `UserError` where even coarse maps do not fit.
    """
    while True:
        try:
            return _layout_maps(scene, buffers, landings, picture, reflectance_class, map_receiver, fineness, window)
        except UserError:
            fineness = fineness.times(_SHRINK)
            if map_receiver is not None or fineness.texels_per_pixel < _LEAST_TEXELS_PER_PIXEL:
                raise


def _layout_maps(
    scene: Scene,
    buffers: SceneBuffers,
    landings: dict[int, Landings],
    picture: tuple[int, int],
    reflectance_class: dict[int, int],
    map_receiver: int | None,
    fineness: Fineness,
    given: np.ndarray | None,
) -> MapLayout:
    sizes: list[tuple[int, int]] = []
    seen: dict[int, Window | None] = {}
    plans: list[tuple[int, PlaneFrame | None, list[Window | PictureWindow], ChartAtlas | None]] = []
    if map_receiver is not None:
        landings = on_both(landings)
    for receiver, object_index in enumerate(buffers.receivers):
        item = scene.objects[object_index]
        if map_receiver is not None and is_back(receiver):
            continue
        points = buffers.space.to_gpu(buffers.world_meshes[object_index].vertices)
        landed = landings.get(receiver)
        if item.mesh.is_flat:
            frame = plane_frame(points)
            extent = extent_of(frame.project(points))
            windows: list[Window | PictureWindow]
            looked_at = map_receiver is None and faces_camera(scene.camera, buffers, receiver)
            if receiver == map_receiver and given is not None:
                windows = [extent_of(frame.project(given))]
            elif receiver == map_receiver:
                around = extent if landed is None else _at_least(known_windows(frame, extent, landed)[0], 0.0, extent)
                windows = [_with_aspect(around, picture)]
            elif map_receiver is None and landed is None and not looked_at:
                windows = [] if item.whole.mesh.is_closed else [replace(extent, largest=_UNSEEN_TILE)]
            else:
                seen_in = picture if looked_at else None
                seen[receiver] = None if seen_in is None else visible(scene.camera, buffers, frame, picture)
                windows = _flat_windows(scene.camera, buffers, frame, extent, landed, seen_in, seen[receiver], fineness)
            for level, window in enumerate(windows):
                largest = fineness.fine if looked_at and not level else fineness.coarse
                if isinstance(window, PictureWindow):
                    size = window.texels
                elif window.largest is not None:
                    size = _tile_size(scene.camera, buffers, frame, window, picture, window.largest, 1.0)
                elif receiver == map_receiver:
                    size = picture
                else:
                    size = _tile_size(scene.camera, buffers, frame, window, picture, largest, fineness.texels_per_pixel)
                sizes += [(-(-size[0] // step), -(-size[1] // step)) for step in steps_of(window)]
            plans.append((receiver, frame, windows, None))
        elif landed is None and is_back(receiver) and item.mesh.is_closed:
            plans.append((receiver, None, [], None))
        else:
            lit = landed is not None or receiver == map_receiver
            side = int(np.clip(picture[0], 256, 1024)) if lit else 64
            atlas = build_charts(buffers.world_meshes[object_index], total_texels=side * side)
            sizes.append((atlas.width, atlas.height))
            plans.append((receiver, None, [], atlas))
    tiles, size = pack(sizes)
    layout = _place(scene, buffers, plans, tiles, size, reflectance_class)
    return replace(layout, borders=lit_borders(scene, buffers, layout.frames, landings), seen=seen)


def _place(
    scene: Scene,
    buffers: SceneBuffers,
    plans,
    tiles: list[Tile],
    size: tuple[int, int],
    reflectance_class: dict[int, int],
) -> MapLayout:
    placements: list[np.ndarray] = []
    receivers = RECEIVER.zeros(len(buffers.receivers))
    tile_of: dict[int, list[Tile]] = {}
    charts: dict[int, ChartAtlas] = {}
    folds: list[tuple[Tile, Tile, int]] = []
    count, next_tile = 0, 0
    for receiver, frame, windows, atlas in plans:
        object_index = buffers.receivers[receiver]
        material = scene.objects[object_index].material
        record = receivers[receiver]
        record["object"], record["placement"] = object_index, count
        record["first_triangle"] = buffers.first_triangle[object_index]
        record["reflectance_class"] = reflectance_class[receiver]
        record["reflectance_rgb"] = 1.0 if material.reflectance is not None else material.reflectance_rgb
        levels = tiles[next_tile : next_tile + (1 if atlas is not None else len(LEVEL_STEPS) * len(windows))]
        next_tile += len(levels)
        own = levels[:: len(LEVEL_STEPS)] if windows else levels
        tile_of[receiver] = own
        if atlas is None and not windows:
            placements.append(placement_rows(Tile(0, 0, 0, 0), _NOWHERE, 1e30))
            count += 1
        elif atlas is None:
            assert frame is not None
            for level, window in enumerate(windows):
                of_window = levels[level * len(LEVEL_STEPS) : (level + 1) * len(LEVEL_STEPS)]
                for i, (tile, step) in enumerate(zip(of_window, steps_of(window), strict=True)):
                    placed = _placed(window, frame, buffers.space.scale, tile, of_window[0], step)
                    first = count + level * len(LEVEL_STEPS)
                    placed["next"] = first + len(LEVEL_STEPS) if level + 1 < len(windows) else NONE
                    placed["blurred"] = first + i + 1 if i + 1 < len(LEVEL_STEPS) else NONE
                    placements.append(placed)
                finest = window.per_pixel if isinstance(window, PictureWindow) else 0
                parts = (finest, *(0 for _ in LEVEL_STEPS[2:]))
                folds += reversed([*zip(of_window[1:], of_window[:-1], parts, strict=True)])
            count += len(LEVEL_STEPS) * len(windows)
        else:
            record["kind"] = 1
            # The charts' rows act on world positions; the records hold GPU-space ones.
            rows = atlas.rows.copy()
            rows[..., 3] += rows[..., :3] @ buffers.space.centre
            rows[..., :3] /= buffers.space.scale
            placements.append(placement_rows(own[0], rows, atlas.texel_area, atlas.triangle_rects))
            count += len(atlas.rows)
            charts[receiver] = atlas
    if len(plans) < len(receivers):
        receivers[1::2] = receivers[::2]
    return MapLayout(
        size,
        np.concatenate(placements) if placements else PLACEMENT.zeros(1),
        receivers,
        tile_of,
        {r: w for r, _, w, _ in plans},
        charts,
        tuple(folds),
        {r: frame for r, frame, _, _ in plans if frame is not None},
    )


def steps_of(window: Window | PictureWindow) -> tuple[int, ...]:
    """Widths of a window's texels, in its finest."""
    if isinstance(window, PictureWindow):
        return 1, *(window.per_pixel * step for step in LEVEL_STEPS[:-1])
    return LEVEL_STEPS


def _placed(
    window: Window | PictureWindow, frame: PlaneFrame, scale: float, tile: Tile, finest: Tile, step: int
) -> np.ndarray:
    """PLACEMENT of a window's texels that are exactly `step` of the finest wide, also where those do not fill the last
    one."""
    if isinstance(window, PictureWindow):
        return placement_rows(tile, window.texel_rows(step), window.texel_area(frame, step) / scale**2)
    texels = np.array([finest.width, finest.height]) / step
    rows = np.concatenate([frame.axes, (-(frame.axes @ frame.origin) - window.low)[:, None]], axis=1)
    rows *= (texels / window.size)[:, None]
    return placement_rows(tile, rows, float(np.prod(window.size / texels)) / scale**2)


def extent_of(points: np.ndarray) -> Window:
    """The box of `points` (n, 2)."""
    return Window(points.min(axis=0), points.max(axis=0))


def grown(window: Window, share: float) -> Window:
    """Larger on each side by a share of its size."""
    margin = share * window.size + 1e-9
    return Window(window.low - margin, window.high + margin)


def _at_least(window: Window, side: float, extent: Window) -> Window:
    """The window, or a wider one about its middle with sides of at least `side`, as far as `extent` reaches."""
    middle, far = 0.5 * (window.low + window.high), np.maximum(np.abs(window.low), np.abs(window.high)).max()
    half = 0.5 * np.maximum(window.size, max(side, _MIN_SIDE * far))
    return meet(Window(middle - half, middle + half), extent) or extent


def meet(a: Window, b: Window) -> Window | None:
    """What is in both."""
    low, high = np.maximum(a.low, b.low), np.minimum(a.high, b.high)
    return Window(low, high) if np.all(high - low > 1e-12) else None


def known_windows(frame: PlaneFrame, extent: Window, landed: Landings) -> list[Window]:
    """Windows about most of the light that landed, and about all of it."""
    flat = frame.project(landed.positions)
    everything = meet(grown(extent_of(flat), 0.02), extent) or extent
    return [meet(grown(_quantile_box(flat, landed.flux_w, _QUANTILE), _MARGIN), extent) or everything, everything]


def _with_aspect(window: Window, picture: tuple[int, int]) -> Window:
    """The smallest window round `window` with the picture's aspect."""
    centre, size = 0.5 * (window.low + window.high), window.size
    aspect = picture[0] / picture[1]
    half = 0.5 * np.maximum(size, np.array([size[1] * aspect, size[0] / aspect]))
    return Window(centre - half, centre + half)


def _quantile_box(points: np.ndarray, weights: np.ndarray, share: float) -> Window:
    """Box that leaves out `share` of the weight at each end of each axis."""
    low, high = np.empty(2), np.empty(2)
    for axis in range(2):
        order = np.argsort(points[:, axis])
        running = np.cumsum(weights[order])
        at = np.searchsorted(running, np.array([share, 1.0 - share]) * running[-1])
        low[axis], high[axis] = points[order[np.minimum(at, len(order) - 1)], axis]
    return Window(low, high)


def _flat_windows(
    camera: Camera,
    buffers: SceneBuffers,
    frame: PlaneFrame,
    extent: Window,
    landed: Landings | None,
    picture: tuple[int, int] | None,
    seen: Window | None,
    fineness: Fineness,
) -> list[Window | PictureWindow]:
    """Fine (where it pays) and coarse window, and one of what may land beyond them, finest first."""
    if landed is None or len(landed.positions) == 0:
        return [extent]

    def widened(window: Window) -> Window:
        """Where a caustic is thinner than a pixel."""
        pixel = 0.0 if picture is None else pixel_side(camera, buffers, frame, window, picture)
        return _at_least(window, fineness.least_pixels * pixel, extent)

    light, everything = known_windows(frame, extent, landed)
    everything = widened(everything)
    if picture is not None and fineness.in_register:
        on_pixels = picture_window(
            camera,
            buffers.space,
            frame,
            landed.positions,
            landed.flux_w,
            picture,
            fineness.in_register,
            fineness.fine,
        )
        if on_pixels is not None:
            # Only glass and mirrors show what lands beside those pixels, in a part of the picture.
            beside = [] if on_pixels.is_all else [replace(everything, largest=min(max(picture), fineness.coarse))]
            known: list[Window | PictureWindow] = [on_pixels, *beside]
            return [*known, *_beyond(everything, seen, extent)]
    fine = light if seen is None else meet(light, grown(seen, 0.02))
    known = [everything]
    if fine is not None:
        fine = widened(fine)
        known = [everything] if np.prod(fine.size) > 0.6 * np.prod(everything.size) else [fine, everything]
    return [*known, *_beyond(everything, seen, extent)]


def _beyond(known: Window, seen: Window | None, extent: Window) -> list[Window]:
    """A window, of few texels, round the known one for what pilot photons did not find: a rare path, or one that begins
    in a part of a lamp only. None where the receiver ends there."""
    wide = grown(known, _BEYOND)
    if seen is not None:
        wide = Window(np.minimum(wide.low, seen.low), np.maximum(wide.high, seen.high))
    found = meet(wide, extent)
    if found is None or not (np.any(found.low < known.low) or np.any(found.high > known.high)):
        return []
    return [replace(found, largest=_BEYOND_TEXELS)]


def visible(camera: Camera, buffers: SceneBuffers, frame: PlaneFrame, picture: tuple[int, int]) -> Window | None:
    """Box of the plane's points that camera rays meet, or None where none does or the horizon is in view."""
    origins, directions = camera_rays(camera, picture, grid=33)
    origins = buffers.space.to_gpu(origins).reshape(-1, 3)
    directions = directions.reshape(-1, 3)
    normal = np.cross(frame.axes[0], frame.axes[1])
    along = directions @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = ((frame.origin - origins) @ normal) / along
    ahead = np.isfinite(distance) & (distance > 0)
    if not ahead.any():
        return None
    points = origins[ahead] + distance[ahead, None] * directions[ahead]
    return extent_of(frame.project(points))


def _tile_size(
    camera: Camera,
    buffers: SceneBuffers,
    frame: PlaneFrame,
    window: Window,
    picture: tuple[int, int],
    largest: int,
    texels_per_pixel: float,
) -> tuple[int, int]:
    """Texels of a window: as many a pixel where the camera sees it, within `largest`."""
    count = np.ceil(window.size * texels_per_pixel * pixels_per_length(camera, buffers, frame, window, picture))
    count *= min(1.0, largest / count.max())
    # Only a receiver of few pixels has a window so small.
    least = np.clip(2.0 * count, 4, MIN_TILE)
    width, height = np.clip(count, least, largest).astype(int)
    return int(width), int(height)


def project(camera: Camera, picture: tuple[int, int], points: np.ndarray) -> np.ndarray:
    """Places of world `points` (n, 3) in the picture: pixels (n, 2) from the left and the top; NaN behind a pinhole."""
    right, up, forward = camera_frame(camera)
    offset = points - np.asarray(camera.position, float)
    if camera.kind == "orthographic":
        half, depth = 0.5 * camera.vertical_extent, np.ones(len(points))
    else:
        half, depth = np.tan(np.radians(0.5 * camera.vertical_fov_deg)), offset @ forward
    depth = np.where(depth > 0.0, depth, np.nan)
    x, y = offset @ right / (half * depth), offset @ up / (half * depth)
    return np.stack([0.5 * (picture[0] + x * picture[1]), 0.5 * picture[1] * (1.0 - y)], axis=-1)


def pixels_per_length(
    camera: Camera, buffers: SceneBuffers, frame: PlaneFrame, window: Window, picture: tuple[int, int]
) -> np.ndarray:
    """How many pixels a GPU unit along either axis of the frame is long in the picture (2,), in most of what is seen of
    the window: a plane seen aslant needs fewer texels along the slope."""
    u, v = np.meshgrid(*(np.linspace(*ends, _GRID) for ends in zip(window.low, window.high, strict=True)))
    points = frame.origin + np.stack([u.ravel(), v.ravel()], axis=-1) @ frame.axes
    step = 1e-3 * window.size
    here = project(camera, picture, buffers.space.to_world(points))
    ends = [
        project(camera, picture, buffers.space.to_world(points + s * a)) for s, a in zip(step, frame.axes, strict=True)
    ]
    seen = ((here >= 0.0) & (here <= np.array(picture))).all(axis=1)
    lengths = np.stack([np.linalg.norm(end - here, axis=1) for end in ends], axis=1)[seen] / step
    lengths = lengths[np.isfinite(lengths).all(axis=1)]
    if not len(lengths):
        return np.full(2, 1.0 / pixel_side(camera, buffers, frame, window, picture))
    return np.maximum(np.quantile(lengths, _SEEN_QUANTILE, axis=0), 1e-2 * lengths.max())


def pixel_side(
    camera: Camera, buffers: SceneBuffers, frame: PlaneFrame, window: Window, picture: tuple[int, int]
) -> float:
    """Side of a pixel where the camera sees a window, GPU units."""
    if camera.kind == "pinhole":
        # Pixels are smallest where the window comes nearest to the camera.
        u, v = np.meshgrid(np.linspace(window.low[0], window.high[0], 9), np.linspace(window.low[1], window.high[1], 9))
        points = frame.origin + np.stack([u.ravel(), v.ravel()], axis=-1) @ frame.axes
        distance = np.linalg.norm(points - buffers.space.to_gpu(np.array(camera.position)), axis=1)
        return float(np.quantile(distance, 0.25) * 2 * np.tan(np.radians(0.5 * camera.vertical_fov_deg)) / picture[1])
    return camera.vertical_extent * buffers.space.scale / picture[1]


def check_map_receiver(scene: Scene, buffers: SceneBuffers, name: str) -> int:
    """Receiver index of the object called `name`; raises UserError naming the receivers there are."""
    names = [scene.objects[i].name for i in buffers.receivers]
    if name in names:
        return names.index(name)
    raise UserError(f"--layer map:{name}: no receiver has this name; there are: " + ", ".join(names))
