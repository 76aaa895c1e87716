"""Where on the receivers the light of the environment, and of other receivers, is found: texels of few windows and
charts, coarser than caustic maps.

A flat receiver has a coarse window over all of it and, where other things stand on or near a part of it, a fine one
round those, since only there shadows are sharp, and some between both where they differ much; of an open sheet both
sides, of a room that holds anything its inside. A curved receiver has charts.
Positions, normals and facets of all texels are worked out here, so that the programs that ask know nothing of windows.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..gpu.scene_buffers import SceneBuffers
from ..gpu.schema import Field, Struct
from ..gpu.tiles import pack
from ..model.geometry.charts import DEFAULT_GUTTER, ChartAtlas, build_charts
from ..model.scene import SceneObject
from ..model.scene_checks import contains
from .map_layout import Window
from .plane_frame import PlaneFrame, plane_frame

FINE_TEXELS, BETWEEN_TEXELS, COARSE_TEXELS, CHART_TEXELS = 104 * 104, 32 * 32, 40 * 40, 88 * 88
"""Texels of a flat receiver's three windows, and of a curved one's charts."""
_GROWTH = 6.0
"""Largest ratio of a window's side to that of the next one."""
_BORDER = 0.07
"""Share of a thing's size: the fine window reaches beyond it by as much at least, and fades into the next one there."""
ALL_PARTS = 0xFFFF
"""`PLACE.parts` of a whole texel."""
MOST_TEXELS = 1 << 17
"""Texels of all receivers together, at most."""
RECORD_TEXELS = 3
"""Texels of a window's record, or a chart's triangle's: both rows, then the rectangle."""
_FULL_SHARE = 0.5
"""Share of a receiver's area from which on one window serves all."""

PLACE = Struct(
    "EnvironmentPlace",
    (
        Field("position", "vec3", "GPU space"),
        Field("primitive", "uint", "facet it lies on"),
        Field("normal", "vec3", "unit, of the side that is lit"),
        Field("object", "uint", "scene object index"),
        Field("step_u", "vec3", "to the next texel, GPU space; zero on charts"),
        Field("inside", "uint", "1: the facet's back is lit"),
        Field("step_v", "vec3", "likewise"),
        Field("parts", "uint", "of 4 × 4, row by row, those that it stands for, as bits (`covered_places`)"),
        Field("span_u", "vec3", "side of what the texel covers, GPU space; on charts too"),
        Field("reserved_too", "uint", ""),
        Field("span_v", "vec3", "likewise"),
        Field("reserved_three", "uint", ""),
    ),
)


@dataclass(frozen=True)
class EnvironmentPlaces:
    """Texels of all receivers, in one texture after the records of their places."""

    size: tuple[int, int]
    records: np.ndarray
    """float32 (rows, width, 4): for every side of a receiver (first record's texel, records a side, charts' first
    triangle + 1 or 0, sides), of a back zeros, then the records."""
    places: np.ndarray
    """PLACE (n,)."""
    texel_xy: np.ndarray
    """int (n, 2): where each belongs."""
    tiles: tuple[tuple[int, int], ...]
    """First place of each tile, and the one after its last."""
    filled_xy: np.ndarray
    """int (m, 2): texels next to charts, which are looked up too."""
    source: np.ndarray
    """int (m,): the place whose light each of these texels shows."""
    on_top: np.ndarray
    """bool (n,): of a window, in a part of it that no finer one covers: looked up at its own middle."""
    is_window: np.ndarray
    """bool (n,): of a window, not of charts."""
    covered: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    """int (k,): of the last k places, which represent the covered parts of a texel, those for its other parts."""
    shares: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """float (n - k,): how much of each texel is open and covered, in 64ths: 128 times the one plus the other."""

    @property
    def areas(self) -> np.ndarray:
        """float64 (n,): what each texel covers, GPU unit²."""
        u, v = self.places["span_u"].astype(float), self.places["span_v"].astype(float)
        return np.linalg.norm(np.cross(u, v), axis=1)

    @property
    def rows(self) -> np.ndarray:
        """int (k + 1,): first place of each row of texels of each tile, and the number of places."""
        ends = np.zeros(len(self.places), bool)
        ends[[first for first, end in self.tiles if end > first]] = True
        ends[1:] |= np.diff(self.texel_xy[:, 1]) != 0
        return np.append(np.flatnonzero(ends), len(self.places))

    def image(self, values: np.ndarray) -> np.ndarray:
        """float32 (height, width, 4): the texture with `values` (n, 3 or 4) in its texels. Where some are covered in
        part the lower half has the covered parts' values, with `shares`; a fourth channel's sign says that both
        differ."""
        width, height = self.size
        own = len(values) - len(self.covered)
        texels = np.zeros((own, 4), np.float32)
        texels[:, : values.shape[1]] = values[:own]
        image = np.zeros((height, width, 4), np.float32)
        halves = [texels]
        if len(self.covered):
            halves.append(texels.copy())
            halves[1][self.covered, :3], halves[1][:, 3] = values[own:, :3], self.shares
            texels[self.covered, 3] *= -1.0
        for half, part in zip(np.split(image, len(halves)), halves, strict=True):
            half[self.texel_xy[:own, 1], self.texel_xy[:own, 0]] = part
            half[self.filled_xy[:, 1], self.filled_xy[:, 0]] = part[self.source]
        image[: len(self.records)] = self.records
        return image

    def smoothed(self, values: np.ndarray, texels: float) -> np.ndarray:
        """`values` (n, 3) averaged over neighbours by a Gaussian of so many texels, within each tile; what is covered
        and what is open each by itself."""
        from scipy.ndimage import gaussian_filter

        found = np.array(values, float)
        own = len(values) - len(self.covered)
        texel, covered = np.append(np.arange(own), self.covered), np.arange(len(values)) >= own
        covered[: len(self.shares)] = self.shares < 128.0
        for first, end in self.tiles:
            within = (texel >= first) & (texel < end)
            for chosen in (within & covered, within & ~covered):
                if chosen.sum() < 2:
                    continue
                x, y = (self.texel_xy[chosen] - self.texel_xy[chosen].min(axis=0)).T
                image = np.zeros((y.max() + 1, x.max() + 1, 4))
                image[y, x, :3], image[y, x, 3] = values[chosen], 1.0
                mean = gaussian_filter(image, (texels, texels, 0.0), mode="constant", truncate=2.5)
                found[chosen] = mean[y, x, :3] / mean[y, x, 3:]
        return found

    def spread(self, values: np.ndarray) -> np.ndarray:
        """`values` (n,) as means over each window's texel and the eight about it; 0 on charts."""
        from scipy.ndimage import uniform_filter

        found = np.zeros(len(values))
        for first, end in self.tiles:
            if self.is_window[first:end].any():
                width = int(np.ptp(self.texel_xy[first:end, 0])) + 1
                found[first:end] = uniform_filter(values[first:end].reshape(-1, width), 3, mode="nearest").ravel()
        return found

    @property
    def normals(self) -> np.ndarray:
        """float64 (n, 3)."""
        return self.places["normal"].astype(float)


@dataclass(frozen=True)
class _Side:
    """A tile: of one window on one side, or of charts."""

    receiver: int
    size: tuple[int, int]
    frame: PlaneFrame | None = None
    window: Window | None = None
    back: bool = False
    atlas: ChartAtlas | None = None
    finer: Window | None = None
    """The window that covers a part of this one."""


def environment_places(buffers: SceneBuffers, finer: float = 1.0, gutter: int = DEFAULT_GUTTER) -> EnvironmentPlaces:
    """All texels of the scene's receivers; `finer`: factor on their number; `gutter`: texels round each chart."""
    scene, receivers = buffers.scene, buffers.receivers[::2]
    tiles: list[_Side] = []
    # Faces of one object (`model.flat_faces`), which have its name, share its texels.
    areas = [float(mesh.areas().sum()) for mesh in buffers.world_meshes]
    names = [item.name for item in scene.objects]
    is_solid = {names[i]: _is_solid(buffers, scene.objects[i].whole) for i in {names[i]: i for i in receivers}.values()}
    of_name = {name: sum(areas[i] for i in receivers if names[i] == name) for name in set(names)}
    share = finer * min(1.0, MOST_TEXELS / (max(len({names[i] for i in receivers}), 1) * (FINE_TEXELS + COARSE_TEXELS)))
    for receiver, index in zip(range(0, 2 * len(receivers), 2), receivers, strict=True):
        item, mesh = scene.objects[index], buffers.world_meshes[index]
        sides = (False,) if is_solid[item.name] else (False, True)
        if not item.mesh.is_flat:
            atlas = build_charts(mesh, total_texels=max(256, int(share * CHART_TEXELS)), gutter=gutter)
            tiles += [_Side(receiver, (atlas.width, atlas.height), back=back, atlas=atlas) for back in sides]
            continue
        frame = plane_frame(buffers.space.to_gpu(mesh.vertices))
        windows = _windows(buffers, index, frame)
        for back in sides:
            for number, window in enumerate(windows):
                texels = COARSE_TEXELS if number + 1 == len(windows) else BETWEEN_TEXELS
                texels = FINE_TEXELS if number == 0 else texels
                texels = round(texels * areas[index] / max(of_name[item.name], 1e-300))
                size = _size(window, share * texels * (0.25 if back else 1.0))
                tiles.append(_Side(receiver, size, frame, window, back, finer=windows[number - 1] if number else None))
    placed, size = pack([tile.size for tile in tiles], 4096)
    # Mesa compiles its programs once more for sides that are powers of two.
    width = max(size[0], 64)
    width += 1 if width & (width - 1) == 0 else 0
    return _packed(buffers, tiles, placed, (width, size[1]))


def _is_solid(buffers: SceneBuffers, item: SceneObject) -> bool:
    """Whether nobody sees the inside of a receiver: it is closed, and no room whose walls light each other, with a
    lamp, the camera or another thing in it."""
    scene, is_closed = buffers.scene, item.mesh.is_closed and not item.mesh.is_flat
    if not (is_closed and buffers.features.bounces):
        return is_closed
    within = [np.array(light.position) for light in scene.lights] + [np.array(scene.camera.position)]
    others = {other.name: other.whole for other in scene.objects if other.name != item.name}
    within += [other.world_bounds.mean(axis=0) for other in others.values()]
    return not any(contains(item, point) for point in within)


def _windows(buffers: SceneBuffers, index: int, frame: PlaneFrame) -> list[Window]:
    """Fine (where it pays) and coarser windows on a flat receiver, finest first."""
    points = frame.project(buffers.space.to_gpu(buffers.world_meshes[index].vertices))
    extent = Window(points.min(axis=0), points.max(axis=0))
    normal = np.cross(frame.axes[0], frame.axes[1])
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for other, item in enumerate(buffers.scene.objects):
        if other == index:
            continue
        box = buffers.space.to_gpu(item.world_bounds)
        corners = np.array(np.meshgrid(*box.T, indexing="ij")).reshape(3, 8).T
        flat = frame.project(corners)
        # A shadow under a uniform sky has nearly faded as far beside a thing as that is high, beside one that hovers
        # at three times its height.
        above, size = (corners - frame.origin) @ normal, float(np.linalg.norm(box[1] - box[0]))
        height = np.abs(above)
        gap = height.min() if (above > 0.0).all() or (above < 0.0).all() else 0.0
        reach = max(min(float(height.max() + 2.0 * gap), size), _BORDER * size)
        least, most = flat.min(axis=0) - reach, flat.max(axis=0) + reach
        if (least < extent.high).all() and (most > extent.low).all() and height.min() < 3.0 * reach:
            low, high = np.minimum(low, least), np.maximum(high, most)
    fine = Window(np.maximum(low, extent.low), np.minimum(high, extent.high))
    if not (fine.size > 1e-9).all() or np.prod(fine.size) > _FULL_SHARE * np.prod(extent.size):
        return [extent]
    ratio, windows = extent.size.max() / fine.size.max(), [fine]
    steps = int(np.ceil(np.log(ratio) / np.log(_GROWTH)))
    for step in range(1, steps):
        more = 0.5 * (ratio ** (step / steps) - 1.0) * fine.size.max()
        windows.append(Window(np.maximum(fine.low - more, extent.low), np.minimum(fine.high + more, extent.high)))
    return [*windows, extent]


def _size(window: Window, texels: float) -> tuple[int, int]:
    """Square texels, as nearly as whole ones fit."""
    side = np.sqrt(np.prod(window.size) / max(texels, 16.0))
    width, height = np.clip(np.round(window.size / side), 4, 1024).astype(int)
    return int(width), int(height)


def _packed(buffers: SceneBuffers, tiles: list[_Side], placed, size: tuple[int, int]) -> EnvironmentPlaces:
    count = len(buffers.receivers)
    heads = np.zeros((count, 4), np.float32)
    records: list[np.ndarray] = []
    parts: list[tuple[np.ndarray, np.ndarray]] = []
    filled: list[np.ndarray] = []
    on_top: list[np.ndarray] = []
    sources: list[np.ndarray] = []
    rows = _record_rows(buffers, tiles, size[0])
    for tile, at in zip(tiles, placed, strict=True):
        offset = np.array([at.x, at.y + rows])
        head = heads[tile.receiver]
        if not head[3]:
            head[0] = count + sum(len(r) for r in records)
        first = sum(len(places) for places, _ in parts)
        if tile.atlas is None:
            assert tile.window is not None and tile.frame is not None
            head[1] += not tile.back
            head[3] = 2 if tile.back else 1
            records.append(_window_record(tile, offset))
            parts.append(_window_places(buffers, tile, offset))
            on_top.append(_on_top(tile))
        else:
            index = buffers.receivers[tile.receiver]
            head[1:] = len(tile.atlas.rows), 1 + buffers.first_triangle[index], 2 if tile.back else 1
            records.append(_chart_records(buffers, tile.atlas, offset))
            places, texel_xy, beside, nearest = _chart_places(buffers, tile, index, offset)
            parts.append((places, texel_xy))
            on_top.append(np.zeros(len(places), bool))
            filled.append(beside)
            sources.append(first + nearest)
    texels = np.concatenate([heads, *records]) if records else heads
    image = np.zeros((rows * size[0], 4), np.float32)
    image[: len(texels)] = texels
    none = np.zeros((0, 2), int)
    places = np.concatenate([p for p, _ in parts]) if parts else PLACE.zeros(0)
    places["parts"] = ALL_PARTS
    ends = np.cumsum([len(places) for places, _ in parts]).tolist()
    return EnvironmentPlaces(
        (size[0], size[1] + rows),
        image.reshape(rows, size[0], 4),
        places,
        np.concatenate([xy for _, xy in parts]) if parts else none,
        tuple((end - len(places), end) for (places, _), end in zip(parts, ends, strict=True)),
        np.concatenate([none, *filled]),
        np.concatenate([np.zeros(0, int), *sources]),
        np.concatenate([np.zeros(0, bool), *on_top]),
        np.repeat([tile.atlas is None for tile in tiles], [len(places) for places, _ in parts]).astype(bool),
    )


def _record_rows(buffers: SceneBuffers, tiles: list[_Side], width: int) -> int:
    texels = len(buffers.receivers)
    for tile in tiles:
        texels += RECORD_TEXELS * (1 if tile.atlas is None else len(tile.atlas.rows))
    return -(-texels // width)


def _window_record(tile: _Side, offset: np.ndarray) -> np.ndarray:
    assert tile.frame is not None and tile.window is not None
    scale = np.array(tile.size) / tile.window.size
    axes = tile.frame.axes
    rows = np.concatenate([axes, (-(axes @ tile.frame.origin) - tile.window.low)[:, None]], axis=1) * scale[:, None]
    rows[:, 3] += offset
    return np.array([rows[0], rows[1], [*offset, *(offset + tile.size)]], np.float32)


def _window_places(buffers: SceneBuffers, tile: _Side, offset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    assert tile.frame is not None and tile.window is not None
    index = buffers.receivers[tile.receiver]
    mesh = buffers.world_meshes[index]
    width, height = tile.size
    x, y = (g.ravel() for g in np.meshgrid(np.arange(width), np.arange(height)))
    step = tile.window.size / np.array(tile.size)
    found = PLACE.zeros(len(x))
    found["position"] = tile.frame.origin + _middles(tile) @ tile.frame.axes
    found["step_u"], found["step_v"] = step[0] * tile.frame.axes[0], step[1] * tile.frame.axes[1]
    found["span_u"], found["span_v"] = found["step_u"], found["step_v"]
    outward = mesh.face_normals()[int(np.argmax(mesh.areas()))]
    found["normal"] = -outward if tile.back else outward
    found["inside"] = tile.back
    found["object"] = index
    found["primitive"] = buffers.primitives[buffers.first_triangle[index]]
    return found, np.stack([x, y], axis=-1) + offset


def _middles(tile: _Side) -> np.ndarray:
    """Middles of a window's texels, row by row, on its plane: float64 (n, 2)."""
    assert tile.window is not None
    width, height = tile.size
    x, y = (g.ravel() for g in np.meshgrid(np.arange(width), np.arange(height)))
    return tile.window.low + (np.stack([x, y], axis=-1) + 0.5) * tile.window.size / np.array(tile.size)


def _on_top(tile: _Side) -> np.ndarray:
    middles = _middles(tile)
    if tile.finer is None:
        return np.ones(len(middles), bool)
    return np.any((middles < tile.finer.low) | (middles >= tile.finer.high), axis=1)


def _chart_records(buffers: SceneBuffers, atlas: ChartAtlas, offset: np.ndarray) -> np.ndarray:
    rows = atlas.rows.copy()
    rows[..., 3] += rows[..., :3] @ buffers.space.centre
    rows[..., :3] /= buffers.space.scale
    rows[..., 3] += offset
    found = np.concatenate([rows, (atlas.triangle_rects + np.tile(offset, 2))[:, None]], axis=1)
    return found.reshape(-1, 4).astype(np.float32)


def _sides_of_texels(rows: np.ndarray) -> np.ndarray:
    """Sides of a texel on each triangle's plane, float64 (T, 2, 3), of maps to texels (T, 2, 3): their
    pseudo-inverses."""
    products = np.einsum("tik,tjk->tij", rows, rows)
    determinant = products[:, 0, 0] * products[:, 1, 1] - products[:, 0, 1] ** 2
    inverse = np.stack([products[:, 1, 1], -products[:, 0, 1], -products[:, 0, 1], products[:, 0, 0]], axis=-1)
    inverse = np.where(
        determinant[:, None] > 0.0, inverse / np.where(determinant > 0.0, determinant, 1.0)[:, None], 0.0
    )
    return np.einsum("tij,tjk->tik", inverse.reshape(-1, 2, 2), rows)


def _chart_places(
    buffers: SceneBuffers, tile: _Side, index: int, offset: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Places and texels that triangles own, texels next to them, and of each of those the nearest place."""
    from scipy.ndimage import distance_transform_edt

    mesh, atlas = buffers.world_meshes[index], tile.atlas
    assert atlas is not None
    y, x = np.nonzero(atlas.owner >= 0)
    triangle = atlas.owner[y, x]
    corners = mesh.corners()[triangle]
    ends = np.einsum("nij,nkj->nki", atlas.rows[triangle][..., :3], corners) + atlas.rows[triangle][:, None, :, 3]
    middle = np.stack([x, y], axis=-1) + 0.5
    sides = np.stack([ends[:, 1] - ends[:, 0], ends[:, 2] - ends[:, 0]], axis=-1)
    solid = np.abs(np.linalg.det(sides)) > 1e-12
    sides[~solid] = np.eye(2)
    shares = np.linalg.solve(sides, (middle - ends[:, 0])[..., None])[..., 0]
    shares[~solid] = 1.0 / 3.0
    world = corners[:, 0] + np.einsum("nk,nkj->nj", shares, corners[:, 1:] - corners[:, :1])
    found = PLACE.zeros(len(x))
    found["position"] = buffers.space.to_gpu(world)
    spans = buffers.space.scale * _sides_of_texels(atlas.rows[..., :3])[triangle]
    found["span_u"], found["span_v"] = spans[:, 0], spans[:, 1]
    found["normal"] = mesh.face_normals()[triangle] * (-1.0 if tile.back else 1.0)
    found["inside"] = tile.back
    found["object"] = index
    found["primitive"] = buffers.primitives[buffers.first_triangle[index] + triangle]
    if not len(x):
        return found, np.zeros((0, 2), int), np.zeros((0, 2), int), np.zeros(0, int)
    number = np.full(atlas.owner.shape, -1)
    number[y, x] = np.arange(len(x))
    distance, (near_y, near_x) = distance_transform_edt(atlas.owner < 0, return_indices=True)
    beside_y, beside_x = np.nonzero((distance > 0.0) & (distance < 4.0))
    nearest = number[near_y[beside_y, beside_x], near_x[beside_y, beside_x]]
    return (
        found,
        np.stack([x, y], axis=-1) + offset,
        np.stack([beside_x, beside_y], axis=-1) + offset,
        nearest,
    )
