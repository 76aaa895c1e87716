"""Light that is wanted on a receiver: spectra or colours of a line or a field, a picture, or the scene's own light."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..base.errors import UserError
from ..base.files import TABLE_BYTES, read_text, reason_of
from ..base.image_io import read_image
from ..edit.parameters import Stage
from ..gpu.context import Context
from ..model.naming import place_of
from ..model.scene import Scene
from ..model.settings import RenderSettings
from ..model.vectors import Vec3
from ..passes.plane_frame import plane_frame
from .bake import drawn
from .gradient import with_bands

BINS = 16
"""Spectral bins of maps that are compared in colour only."""
_TEXELS, _FEWEST = 192, 8
"""Texels of a map's longer side; at least, of its shorter one."""
_PARTS = 3
"""Along a side of one cell of a target, between which its mean is taken."""
_CELLS, _NARROW = 64, 32.0
"""Along a side of a target that is the scene as it is; length of a line over the breadth of its strip."""
_OFF_PLANE = 1e-4
"""Largest distance from a receiver's plane of a place that lies in it, over its extent."""
_WIDEST = 0.9
"""Width over the line, at most."""


@dataclass(frozen=True)
class Target:
    """Light that is wanted on a flat receiver."""

    receiver: str
    axes: np.ndarray
    """(2, 3), world, unit: along the rows and the columns of the receiver's map."""
    corners: np.ndarray
    """(3, 3), world: of the first row its beginning and its end, of the last row its beginning."""
    values: np.ndarray
    """(h, w, channels), in any unit."""
    bin_edges_nm: np.ndarray | None = None
    """(bins + 1,), of even bins from 380 to 780 nm; None: linear Rec.709."""
    width: float | None = None
    """Wanted instead of `values`, which are a line: see `solving.width_of`; as a share of the line."""

    def __post_init__(self) -> None:
        if not np.isfinite(self.values).all() or not self.values.max(initial=0.0) > 0.0:
            raise UserError("the target is dark, empty or not finite: give light that is to be matched")

    @property
    def bins(self) -> int:
        """Spectral bins of maps that are compared with it."""
        return BINS if self.bin_edges_nm is None else len(self.bin_edges_nm) - 1

    @property
    def window(self) -> np.ndarray:
        """All four corners."""
        first, end, last = self.corners
        return np.stack([first, end, last, end + last - first])

    def settings(self, settings: RenderSettings) -> RenderSettings:
        """Settings that maps of the target are rendered with."""
        size = np.ptp(self.window @ self.axes.T, axis=0)
        width, height = np.maximum(np.round(_TEXELS * size / size.max()), _FEWEST).astype(int)
        its = replace(
            settings,
            layer=f"map:{self.receiver}",
            bins=self.bins,
            width=int(width),
            height=int(height),
            exposure_ev=None,
        )
        return with_bands(its)

    def seen(self, spectral: np.ndarray, placement: object) -> np.ndarray:
        """Means over the target's cells (h, w, bins) of a map (H, W, bins) of such a placement."""
        assert isinstance(placement, dict)
        origin, right, top = (
            np.array(placement["corners_world"][k]) for k in ("bottom_left", "bottom_right", "top_left")
        )
        h, w, _ = self.values.shape
        rows, columns = ((np.arange(n * _PARTS) + 0.5) / (n * _PARTS) for n in (h, w))
        first, end, last = self.corners
        points = first + columns[None, :, None] * (end - first) + rows[:, None, None] * (last - first) - origin
        x, y = (
            points @ (axis / (axis @ axis)) * side - 0.5
            for axis, side in ((right - origin, spectral.shape[1]), (top - origin, spectral.shape[0]))
        )
        found = _between(spectral[::-1].astype(float), x, y)
        return found.reshape(h, _PARTS, w, _PARTS, -1).mean(axis=(1, 3))


def _between(texels: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Texels (H, W, c) at places in texels, bilinear, those at the border going on."""
    from scipy.ndimage import map_coordinates

    channels = np.moveaxis(texels, -1, 0)
    return np.stack([map_coordinates(each, (y, x), order=1, mode="nearest") for each in channels], axis=-1)


def glass_called(scene: Scene, name: str) -> int:
    """Index of an object whose glass may be another one. Raises `UserError`."""
    glasses = {o.name: i for i, o in enumerate(scene.objects) if o.material.transmits and not o.material.is_crystal}
    place_of(name, list(glasses), f"scene '{scene.name}' has no object of glass called")
    return glasses[name]


def flat_receiver(scene: Scene, places: Sequence[Vec3] = ()) -> str:
    """The first one in whose plane all `places` lie. Raises `UserError`."""
    flat = [o for o in scene.objects if o.name in scene.receiver_names and o.mesh.is_flat]
    for item in flat:
        frame, extent = plane_frame(item.world_vertices), float(np.ptp(item.world_vertices, axis=0).max())
        away = (np.reshape(places, (-1, 3)) - frame.origin) @ np.cross(*frame.axes)
        if np.abs(away).max(initial=0.0) <= _OFF_PLANE * extent:
            return item.name
    if flat:
        raise UserError("the ruler does not lie on a flat receiver: click its points there")
    raise UserError(f"scene '{scene.name}' has no flat receiver, on which light could be compared: add a table")


def line(scene: Scene, receiver: str, start: Sequence[float], end: Sequence[float]) -> np.ndarray:
    """Corners of a target that is a narrow strip about a line on a receiver."""
    first, last = np.asarray(start, float), np.asarray(end, float)
    across = np.cross(np.cross(*axes_of(scene, receiver)), last - first) / _NARROW
    return np.stack([first - 0.5 * across, last - 0.5 * across, first + 0.5 * across])


def axes_of(scene: Scene, receiver: str) -> np.ndarray:
    """`Target.axes` of a flat receiver."""
    item = scene.objects[[item.name for item in scene.objects].index(receiver)]
    return plane_frame(item.world_vertices).axes


def as_it_is(
    context: Context, stage: Stage, settings: RenderSettings, receiver: str, corners: np.ndarray | None = None
) -> Generator[float, None, Target]:
    """The light that the scene casts on a receiver, all of it or what is within `corners`, as a target."""
    edges = np.linspace(380.0, 780.0, BINS + 1)
    axes = axes_of(stage.scene, receiver)
    target = Target(receiver, axes, np.eye(3) if corners is None else corners, np.ones((_CELLS, _CELLS, BINS)), edges)
    settings, window = target.settings(settings), None if corners is None else target.window
    if corners is None:
        settings = replace(settings, width=_TEXELS, height=_TEXELS)
    found = yield from drawn(context, settings, [stage], window)
    where, spectral = found.placement, found.pictures[0].spectral
    assert spectral is not None
    if corners is None:
        at = where["corners_world"]
        assert isinstance(at, dict)
        target = replace(target, corners=np.array([at[k] for k in ("top_left", "top_right", "bottom_left")]))
    return replace(target, values=target.seen(spectral, where))


def wanted(
    context: Context,
    stage: Stage,
    settings: RenderSettings,
    receiver: str,
    values: np.ndarray | None,
    between: Sequence[Sequence[float]] | None,
    width: float | None = None,
) -> Generator[float, None, Target]:
    """The target of `values` or `width` (see `spectrasplat.match`), or the light as it is, on a line or a field of a
    receiver. Raises `UserError`."""
    scene = stage.scene
    if not scene.objects[[item.name for item in scene.objects].index(receiver)].mesh.is_flat:
        raise UserError(f"'{receiver}' is curved: light is compared on a flat receiver only, so name one")
    corners = None
    if between is not None:
        points = np.asarray(between, float)
        is_place = points.shape in ((2, 3), (3, 3)) and np.isfinite(points).all()
        if not is_place or np.linalg.matrix_rank(points[1:] - points[0]) < len(points) - 1:
            raise UserError("the target's place is two ends of a line or three corners not in one, three numbers each")
        corners = points if len(points) == 3 else line(scene, receiver, *points)
    if width is not None:
        if values is not None or between is None or len(between) != 2 or corners is None:
            raise UserError("a width is measured along a line, without another target: give the line's two ends")
        length = float(np.linalg.norm(np.subtract(*np.asarray(between, float))))
        if not 0.0 < width < _WIDEST * length:
            raise UserError(
                f"a width of {width:g} does not fit on a line {length:g} long: give more than 0 and less than "
                f"{_WIDEST * length:.4g}, or a longer line"
            )
        return Target(receiver, axes_of(scene, receiver), corners, np.ones((1, _TEXELS, 3)), width=width / length)
    if values is None:
        return (yield from as_it_is(context, stage, settings, receiver, corners))
    if corners is None:
        raise UserError("where the target lies is not given: give two ends of a line or three corners, on the receiver")
    if values.ndim not in (1, 2, 3):
        raise UserError(
            f"a target of shape {values.shape} is none: give (bins,), (places, bins) or (rows, columns, bins)"
        )
    cells = values.reshape((1,) * (3 - values.ndim) + values.shape)
    bins = cells.shape[-1]
    if bins != 3 and not 4 <= bins <= 32:
        raise UserError(f"a target of {bins} channels is none: give 3 (linear Rec.709) or 4 to 32 spectral bins")
    edges = None if bins == 3 else np.linspace(380.0, 780.0, bins + 1)
    return Target(receiver, axes_of(scene, receiver), corners, cells, edges)


def read_target(path: Path) -> np.ndarray:
    """A picture (rows, columns, 3), or lines of numbers from a .csv (places, bins). Raises `UserError`."""
    if path.suffix.lower() != ".csv":
        return read_image(path).rgb.astype(float)
    try:
        lines = filter(str.strip, read_text(path, TABLE_BYTES).splitlines())
        found = [[float(cell) for cell in line.split(",")] for line in lines]
        if len({len(line) for line in found}) != 1:
            raise ValueError("it is no table of numbers")
        return np.array(found)
    except OSError as error:
        raise UserError(f"cannot read {path}: {reason_of(error)}") from error
    except ValueError as error:
        raise UserError(f"{path}: {error}; give lines of as many numbers each, with commas between") from error
