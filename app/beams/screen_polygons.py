"""What a camera sees by way of flat glass and mirrors, as polygons of its picture.

The camera is a light backwards: a beam that starts from the picture's pixels keeps its facets inside a polygon of the
picture, whose edges move with the wavelength. Inside one, the ray that leaves the last facet is a smooth function of
pixel and wavelength, so what lies behind is looked up along it and no path has to be followed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .polygons import Outlines

PIXEL_BITS = 27
"""Of the second word of an entry of `screen_pairs.pixel_parts`: the pixel; the others hold the part of it."""


@dataclass(frozen=True)
class ScreenPolygons(Outlines):
    """N polygons, E edges, H corners of hulls.

    Places are pixel coordinates (x, y): x to the right, y downwards, pixel (i, j) of column i and row j covers
    [i, i + 1] × [j, j + 1]. At t in [0, 1], where x = x_lo + t (x_hi - x_lo) is the spectral coordinate, p is inside
    where for every edge  a(t) . p + c(t) >= 0, with (a, c) linear in t. Two polygons that part at an edge have the same
    one with opposite signs, so that every place belongs to one of them. Lengths are in GPU space.
    """

    is_handed: np.ndarray
    """bool (N,): its rays go on as ordinary camera paths, for what they meet is not flat; else they are looked up."""
    source: np.ndarray
    """int32 (N,), object that the camera sees there first."""
    depth: np.ndarray
    """int32 (N,), specular events on the way, at least 1."""
    key: np.ndarray
    """uint32 (N,), hash of the facets in their order: random numbers of what goes on from here."""
    x_lo: np.ndarray
    """(N,), start of the band."""
    x_hi: np.ndarray
    """(N,), its end."""
    centre: np.ndarray
    """(N, 2), the place that `position` and `direction` are about."""
    position: np.ndarray
    """(N, 3, 3, 3): [at x_lo, middle, x_hi][X, X_x, X_y][xyz]; a ray of place p leaves the last facet at
    X + X_x (p_x - centre_x) + X_y (p_y - centre_y), at other x by the parabola through the three."""
    direction: np.ndarray
    """(N, 3, 3, 3) likewise; the first of each is a unit vector."""
    throughput: np.ndarray
    """(N, 3): radiance that arrives at the camera per radiance that enters the last facet, at x_lo, in the middle and
    at x_hi: Fresnel, absorption, tints of mirrors, and one over the probability that the beam was kept."""
    slope: np.ndarray
    """(N, 2): relative change of the throughput with the place, per pixel."""
    state: np.ndarray
    """(N, 3, 6): of polarisation, as `polarised`; zeros where it is not followed."""
    last_triangle: np.ndarray
    """int32 (N,), some triangle (of the scene's, in the object's order) of the facet that was left last."""
    last_object: np.ndarray
    """int32 (N,)."""
    is_inside: np.ndarray
    """bool (N,), whether the ray travels on the inner side of `last_object`'s facet."""
    inside: np.ndarray
    """uint64 (N,), bit per object of the solids that the ray is inside of."""
    edge_start: np.ndarray
    """int32 (N + 1,), polygon i has edges edge_start[i] … edge_start[i + 1]."""
    edges: np.ndarray
    """(E, 6): a_x, a_y, c at x_lo, the same at x_hi; |a| = 1, so that a . p + c is the distance inside, pixels."""
    hull_start: np.ndarray
    """int32 (N + 1,), likewise into `hulls`."""
    hulls: np.ndarray
    """(H, 2), corners, in order, of a convex polygon that holds the places of the whole band."""

    def __len__(self) -> int:
        return len(self.x_lo)

    def scaled(self, factor: float) -> ScreenPolygons:
        """The same for a picture `factor` times as wide and high."""
        values = {name: getattr(self, name) for name in self.__dataclass_fields__}
        values["centre"], values["hulls"] = self.centre * factor, self.hulls * factor
        values["edges"] = self.edges * np.array([1.0, 1.0, factor, 1.0, 1.0, factor])
        per_place = np.array([1.0, 1.0 / factor, 1.0 / factor])[:, None]
        values["position"], values["direction"] = self.position * per_place, self.direction * per_place
        return ScreenPolygons(**values)
