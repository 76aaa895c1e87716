"""What caustic maps are fitted to: a view, a picture's size, and where light lands in this and in other frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..gpu.gpu_space import GpuSpace
from ..model.scene import Camera
from ..passes.map_layout import STILL, Fineness
from ..passes.pilot import Pilot

PREVIEW = 8
"""Pixels to a texel's side in the maps of a preview."""
FINE_MAX = ((1, 3072), (4, 2560), (99, 2048))
"""Up to so many textures of the maps, and the longest side of their fine windows, texels."""
PREVIEW_FINENESS = Fineness(2.0, 288, 144)


@dataclass(frozen=True)
class MapFit:
    """One way to lay the maps of a scene out."""

    view: Camera
    width: int
    height: int
    """Pixels of the picture that `view` is seen in."""
    fineness: Fineness = STILL
    others: tuple[tuple[GpuSpace, Pilot], ...] = ()
    """Where light lands in other frames that the maps must serve as well, each in its own GPU space."""
    window: np.ndarray | None = None
    """World points (n, 3) that the map of the settings' layer just holds; None: where light lands."""
    is_shared: bool = False
    """Other views see the same maps: no window is laid out on this one's pixels."""
    avoids_powers_of_two: bool = False
    """Mesa's software renderer compiles what reads a texture once more, for seconds, where a side becomes a power of
    two: for maps that are made while a user waits."""

    def preview(self, side: float = 1.0) -> MapFit:
        """Small maps of the same, to be filled at once; `side`: of theirs over the usual one."""
        width, height = preview_size(self.width * side, self.height * side)
        return replace(self, width=width, height=height, fineness=PREVIEW_FINENESS.times(side))

    def fineness_for(self, targets: int) -> Fineness:
        """Fineness of maps with so many textures: memory bounds the finest."""
        fine = min(self.fineness.fine, next(most for n, most in FINE_MAX if targets <= n))
        return replace(self.fineness, fine=fine, in_register=0 if self.is_shared else self.fineness.in_register)

    def landings(self, own: Sequence[Pilot], space: GpuSpace) -> Sequence[Pilot]:
        """The pilots to fit to: `own` alone, or with the others' landings in `space`."""
        if not self.others:
            return own
        return [_landings(pilot, at, space) for at, pilot in (*((space, pilot) for pilot in own), *self.others)]


def preview_size(width: float, height: float) -> tuple[int, int]:
    """Picture size for which the maps of a preview are laid out."""
    return max(16, round(width / PREVIEW)), max(16, round(height / PREVIEW))


_LANDING = np.dtype([("position", "f4", 3), ("flux_w", "f4"), ("receiver", "u4")])
"""What maps are fitted to; the records of two frames may differ in their columns."""


def _landings(pilot: Pilot, old: GpuSpace, new: GpuSpace) -> Pilot:
    """Only the landings of `pilot`, in another frame's GPU space."""

    def moved(records: np.ndarray) -> np.ndarray:
        found = np.zeros(len(records), _LANDING)
        found["position"] = (
            records["position"] if old is new else new.to_gpu(old.to_world(records["position"].astype(float)))
        )
        found["flux_w"], found["receiver"] = records["flux_w"], records["receiver"]
        return found

    return replace(
        pilot, whole=moved(pilot.whole), spectral=[moved(r) for r in pilot.spectral], rim=[moved(r) for r in pilot.rim]
    )
