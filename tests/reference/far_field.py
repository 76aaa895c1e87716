"""Directions of outgoing rays, which photon records do not hold: from the same photons on two screens.

A ray's direction, and each derivative of it, is where it lands on a far screen less where it lands
on a near one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.reference.optics import normalised_derivative, unit
from spectrasplat.stress.rigs.gpu_paths import Photons, screen


@dataclass(frozen=True)
class OutgoingRays:
    """Rays as they pass the near screen, world units."""

    photons: Photons
    direction: np.ndarray
    """(N, 3), unit."""
    ddirection_ds: np.ndarray
    ddirection_dt: np.ndarray
    ddirection_dvar: np.ndarray
    """(N, G, 3) per unit of each group's variable."""

    @property
    def heading(self) -> np.ndarray:
        """Angle of the direction from +x in the x-y plane, rad (N,)."""
        return np.arctan2(self.direction[:, 1], self.direction[:, 0])

    def dheading(self, ddirection: np.ndarray) -> np.ndarray:
        """Derivative of the heading (N,) along a column (N, 3)."""
        x, y = self.direction[:, 0], self.direction[:, 1]
        return (x * ddirection[:, 1] - y * ddirection[:, 0]) / (x * x + y * y)

    @property
    def dheading_dn(self) -> np.ndarray:
        """By each group's variable: (N, G)."""
        groups = range(self.ddirection_dvar.shape[1])
        return np.stack([self.dheading(self.ddirection_dvar[:, g]) for g in groups], axis=1)


def outgoing(
    traced_onto: Callable[[Mesh], Photons],
    axis: np.ndarray | tuple[float, ...],
    near: float,
    far: float,
    about: np.ndarray | tuple[float, ...] = (0.0, 0.0, 0.0),
    half: float = 50.0,
) -> OutgoingRays:
    """Trace onto screens across `axis` at two distances from `about`; what met both, one path a lattice point, in the
    lattice's order."""
    axis = unit(np.asarray(axis, float))
    first, second = (traced_onto(screen(about + distance * axis, axis, half)) for distance in (near, far))
    _, in_first, in_second = np.intersect1d(
        first.records["photon_id"], second.records["photon_id"], return_indices=True
    )
    first, second = first.where(in_first), second.where(in_second)
    way = second.position - first.position
    columns = [
        normalised_derivative(way, getattr(second, name) - getattr(first, name))
        for name in ("dposition_ds", "dposition_dt")
    ]
    spectral = normalised_derivative(way[:, None], second.dposition_dvar - first.dposition_dvar)
    return OutgoingRays(first, unit(way), *columns, spectral)
