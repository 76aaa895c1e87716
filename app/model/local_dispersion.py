"""What the dispersion brush painted: a gain of the spectral displacement at each place of a receiver.

Not physical. Dabs are laid down in order, each mixing the doublings of the gain (log2) found
so far with its own, and the result scales how far a photon's colours spread where they land.
`gain_at` is the definition; `GainGrid` samples it for the GPU and grows while one paints.
Positions are in the receiver's own space, float64. In a scene file dabs are written
`local_dispersion = [{ position, radius, … }, …]`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..base.errors import UserError
from .fields import Number, Vector, check_numbers, read_fields, write_fields
from .io.scene_table import MAX_MAGNITUDE, SceneTable
from .scene import Dab, Material, SceneObject
from .vectors import frozen

MIN_LOG2_GAIN = -6.0
MAX_LOG2_GAIN = math.log2(10.0)
"""Ends of what dabs can add up to: 1/64 and 10, as the sliders have it."""

MAX_FLAT_SIDE = 512
MAX_VOLUME_SIDE = 64
_FLAT_SAMPLES = 8.0
_VOLUME_SAMPLES = 4.0
"""Samples across the smallest radius that are aimed at: more where there are only two dimensions."""

Plane = np.ndarray
"""float64 (4,): n·x = d as (n, d), in object space."""


def gain_at(dabs: Sequence[Dab], points: np.ndarray) -> np.ndarray:
    """Gain at `points` (n, 3): float64 (n,), 1 where nothing was painted."""
    points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    log2 = np.zeros(len(points))
    for dab in dabs:
        log2 = _touched(log2, dab, _distance(points - np.array(dab.position)))
    return np.exp2(log2)


def dab_weight(dab: Dab, distance: np.ndarray) -> np.ndarray:
    """How much of a dab is felt at a distance from its centre: 1 inside, a smoothstep over the falloff, 0 from its
    radius on."""
    share = np.asarray(distance, dtype=np.float64) / dab.radius
    fade = np.clip((share - (1.0 - dab.falloff)) / max(dab.falloff, 1e-9), 0.0, 1.0)
    return np.where(share < 1.0, 1.0 - fade * fade * (3.0 - 2.0 * fade), 0.0)


def _touched(log2: np.ndarray, dab: Dab, distance: np.ndarray) -> np.ndarray:
    """The doublings after one more dab. Held in range after each, so that painting on past an end and back is felt at
    once."""
    weight = dab_weight(dab, distance)
    log2 = log2 * (1.0 - dab.erase * weight) if dab.erase > 0.0 else log2 + dab.log2_gain * weight
    return np.clip(log2, MIN_LOG2_GAIN, MAX_LOG2_GAIN)


def _distance(offset: np.ndarray) -> np.ndarray:
    return np.sqrt(offset[..., 0] ** 2 + offset[..., 1] ** 2 + offset[..., 2] ** 2)


def plane_of(item: SceneObject) -> Plane | None:
    """The plane a flat receiver lies in, in its own space; None for a curved one."""
    if not item.mesh.is_flat:
        return None
    centre = item.mesh.vertices.mean(axis=0)
    normal = np.linalg.svd(item.mesh.vertices - centre, full_matrices=False)[2][-1]
    return np.append(normal, normal @ centre)


@dataclass(frozen=True, eq=False)
class GainGrid:
    """`gain_at` sampled at the centres of cubic voxels; 1 outside its box.

    Voxels are powers of two wide and lie on the lattice of whole voxels, so that a grid that grew with
    the strokes is equal, bit for bit, to one built anew. A flat receiver has a single layer across the axis
    nearest to its normal; its samples are taken on the plane itself, however it is tilted.
    """

    dabs: tuple[Dab, ...]
    plane: Plane | None
    voxel: float
    """Edge of a voxel, object units."""
    first: tuple[int, int, int]
    """Lattice numbers of the lowest voxel; a flat receiver's layer axis has 0."""
    box: tuple[np.ndarray, np.ndarray]
    """Low and high corner, float64 (3,) each, object space. Across a flat receiver it holds the plane with room to
    spare."""
    log2: np.ndarray
    """Doublings of the gain, float64 (nz, ny, nx)."""

    @property
    def dims(self) -> tuple[int, int, int]:
        """Voxels along x, y, z."""
        nz, ny, nx = self.log2.shape
        return nx, ny, nz

    @property
    def low(self) -> np.ndarray:
        """Low corner of the box, float64 (3,)."""
        return self.box[0]

    @property
    def high(self) -> np.ndarray:
        """High corner of the box, float64 (3,)."""
        return self.box[1]

    @cached_property
    def gains(self) -> np.ndarray:
        """Gain at the voxel centres, float32 (nz, ny, nx): rows of a 3D texture as OpenGL takes them."""
        return np.exp2(self.log2).astype(np.float32)

    @staticmethod
    def of(item: SceneObject) -> GainGrid:
        """What was painted on a receiver."""
        plane = plane_of(item)
        return GainGrid.build(item.local_dispersion, False if plane is None else plane)

    @staticmethod
    def build(dabs: Sequence[Dab], flat: bool | Plane) -> GainGrid:
        """All `dabs`, sampled.

        `flat`: False for a curved receiver, its plane (`plane_of`) for a flat one, or True for one
        that lies in a plane of constant z. Without dabs the grid is a single voxel of gain 1.
        """
        dabs = tuple(dabs)
        plane = _as_plane(dabs, flat)
        if not dabs:
            nowhere = (np.zeros(3), np.zeros(3))
            return GainGrid(dabs, plane, 1.0, (0, 0, 0), nowhere, np.zeros((1, 1, 1)))
        box = _box_of(dabs)
        axis = _layer_axis(plane)
        voxel = _voxel_size(dabs, box, axis)
        first = np.floor(box[0] / voxel).astype(int)
        count = np.ceil(box[1] / voxel).astype(int) - first
        if axis is not None:
            first[axis], count[axis] = 0, 1
        across = np.arange(3) != axis
        corners = (np.where(across, first * voxel, box[0]), np.where(across, (first + count) * voxel, box[1]))
        empty = GainGrid(dabs, plane, voxel, tuple(first.tolist()), corners, np.zeros(tuple(count[::-1])))
        return empty._painted(dabs)

    def extended(self, new_dabs: Sequence[Dab]) -> GainGrid:
        """With more dabs on top: only what they touch is computed, equal to building all of them."""
        new_dabs = tuple(new_dabs)
        if not new_dabs:
            return self
        dabs = self.dabs + new_dabs
        box = _box_of(dabs)
        axis = _layer_axis(self.plane)
        same_lattice = bool(self.dabs) and _voxel_size(dabs, box, axis) == self.voxel
        across = np.arange(3) != axis
        inside = np.all((box[0] >= self.low)[across]) and np.all((box[1] <= self.high)[across])
        if not (same_lattice and inside):
            return GainGrid.build(dabs, False if self.plane is None else self.plane)
        if axis is not None:  # the layer has no lattice of its own: its box is that of the dabs
            low, high = self.low.copy(), self.high.copy()
            low[axis], high[axis] = box[0][axis], box[1][axis]
            return replace(self, dabs=dabs, box=(low, high))._painted(new_dabs)
        return replace(self, dabs=dabs)._painted(new_dabs)

    def sample(self, points: np.ndarray) -> np.ndarray:
        """Gain at `points` (n, 3), float64 (n,): trilinear between voxel centres, held at the rim, 1 outside the
        box."""
        points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        dims = np.array(self.dims)
        inside = np.all((points >= self.low) & (points <= self.high), axis=1) & bool(self.dabs)
        extent = np.maximum(self.high - self.low, np.finfo(float).tiny)
        place = np.clip(np.where(inside[:, None], points - self.low, 0.0) / extent * dims - 0.5, 0.0, dims - 1.0)
        corner = np.minimum(place.astype(int), np.maximum(dims - 2, 0))
        share = place - corner
        gains = self.gains.astype(np.float64)
        total = np.zeros(len(points))
        for step in np.ndindex(2, 2, 2):
            x, y, z = np.minimum(corner + step, dims - 1).T
            total += np.prod(np.where(np.array(step) == 1, share, 1.0 - share), axis=1) * gains[z, y, x]
        return np.where(inside, total, 1.0)

    def _painted(self, dabs: Sequence[Dab]) -> GainGrid:
        log2 = self.log2.copy()
        for dab in dabs:
            x, y, z = (self._touched_range(dab, axis) for axis in range(3))
            if min(x.stop - x.start, y.stop - y.start, z.stop - z.start) <= 0:
                continue
            offset = self._centres(x, y, z) - np.array(dab.position)
            log2[z, y, x] = _touched(log2[z, y, x], dab, _distance(offset))
        return replace(self, log2=frozen(log2))

    def _touched_range(self, dab: Dab, axis: int) -> slice:
        """Voxels of one axis whose centres a dab may reach."""
        count = self.dims[axis]
        if axis == _layer_axis(self.plane):
            return slice(0, 1)
        low, high = (dab.position[axis] + side * dab.radius for side in (-1.0, 1.0))
        start = math.floor(low / self.voxel) - self.first[axis]
        return slice(max(start, 0), min(math.ceil(high / self.voxel) - self.first[axis], count))

    def _centres(self, x: slice, y: slice, z: slice) -> np.ndarray:
        """Sample positions of a block of voxels, float64 (nz, ny, nx, 3)."""
        along = [
            (np.arange(s.start, s.stop) + f + 0.5) * self.voxel for s, f in zip((x, y, z), self.first, strict=True)
        ]
        zs, ys, xs = np.meshgrid(*along[::-1], indexing="ij")
        centres = np.stack([xs, ys, zs], axis=-1)
        axis = _layer_axis(self.plane)
        if axis is not None:
            assert self.plane is not None
            others = [i for i in range(3) if i != axis]
            reached = sum(self.plane[i] * centres[..., i] for i in others)
            centres[..., axis] = (self.plane[3] - reached) / self.plane[axis]
        return centres


def _as_plane(dabs: Sequence[Dab], flat: bool | Plane) -> Plane | None:
    if isinstance(flat, np.ndarray):
        return np.asarray(flat, dtype=np.float64)
    if not flat:
        return None
    return np.array([0.0, 0.0, 1.0, dabs[0].position[2] if dabs else 0.0])


def _layer_axis(plane: Plane | None) -> int | None:
    """The axis a flat receiver is seen along: each of its points has one place in the other two."""
    return None if plane is None else int(np.argmax(np.abs(plane[:3])))


def _box_of(dabs: Sequence[Dab]) -> tuple[np.ndarray, np.ndarray]:
    """A box round all dabs, rounded outwards to a coarse lattice so that a stroke seldom leaves it."""
    centres = np.array([dab.position for dab in dabs])
    radii = np.array([dab.radius for dab in dabs])[:, None]
    low, high = (centres - radii).min(axis=0), (centres + radii).max(axis=0)
    step = 2.0 ** (math.floor(math.log2(float((high - low).max()))) - 1)
    return np.floor(low / step) * step, np.ceil(high / step) * step


def _voxel_size(dabs: Sequence[Dab], box: tuple[np.ndarray, np.ndarray], axis: int | None) -> float:
    """Power of two that resolves the smallest dab, or what the largest allowed grid resolves."""
    samples, most = (_VOLUME_SAMPLES, MAX_VOLUME_SIDE) if axis is None else (_FLAT_SAMPLES, MAX_FLAT_SIDE)
    across = np.arange(3) != axis
    longest = float((box[1] - box[0])[across].max())
    wanted = min(dab.radius for dab in dabs) / samples
    voxel = 2.0 ** math.floor(math.log2(wanted))
    # A side off the lattice may need one voxel more.
    while math.ceil(longest / voxel) + 1 > most:
        voxel *= 2.0
    return voxel


DABS = "local_dispersion"
MAX_DAB_LOG2 = 60.0
"""Doublings one dab may ask for: more than any gain can use."""


def read_dabs(table: SceneTable, material: Material) -> tuple[Dab, ...]:
    """`local_dispersion` of an object's table, oldest first. Raises UserError on anything but a diffuse object."""
    if table.has(DABS) and not material.receives:
        table.fail(DABS, "is painted on what receives the caustic; this object is not diffuse")
    return tuple(_read_dab(entry) for entry in table.tables(DABS))


_FIELDS = (
    Vector("position"),
    Number("radius", above=0.0, at_most=MAX_MAGNITUDE),
    Number("falloff", 0.5, at_least=0.0, at_most=1.0),
    # An eraser's own gain counts for nothing, but is kept where it is not the default.
    Number("log2_gain", 0.0, optional=True, at_least=-MAX_DAB_LOG2, at_most=MAX_DAB_LOG2),
    Number("erase", 0.0, optional=True, at_least=0.0, at_most=1.0),
)


def _read_dab(table: SceneTable) -> Dab:
    dab = Dab(**read_fields(_FIELDS, table))
    table.finish("a touch of the dispersion brush")
    return dab


def check_dab(dab: Dab, name: str) -> None:
    """Raise UserError where no scene file could hold a dab on the object called `name`."""
    if not all(map(math.isfinite, dab.position)):
        raise UserError(f"'{name}': a touch of the brush has a position that is not finite")
    check_numbers(_FIELDS, dab, f"'{name}': of a touch of the brush ")


def describe_dabs(dabs: Sequence[Dab]) -> list[dict[str, Any]]:
    """The tables that `read_dabs` makes into `dabs`."""
    return [write_fields(_FIELDS, dab) for dab in dabs]
