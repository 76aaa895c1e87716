"""A plate of glass whose one side is shaped so that parallel light draws a picture: where its light lands, exactly.

The shaped side is sampled evenly, and each sample sends a ray: through a flat side and one refracting surface no
intersection must be searched for. Its triangles are taken for the smooth surface that they stand for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import UserError
from ..geometry.mesh import Mesh, normalised
from ..vectors import unit
from .glass import Dispersion
from .rough_surfaces import fresnel

SAMPLES = 200_000
_FLAT = math.cos(math.radians(0.25))
_STEEP = 0.1
"""Cosine between a face and the plate from which on it is a rim."""
_THICKEST = 0.7
"""Thickness over the shorter side from which on a solid is no plate."""
_CURVED = 1e-5
"""Spread of unit normals below which the other side is flat too."""


@dataclass(frozen=True)
class Plate:
    """Samples of its shaped side. Frame: the middle of the flat side is the origin, z goes from there to the shaped
    side, x and y are as near to the mesh's own axes as can be."""

    name: str
    glass: Dispersion
    side: str
    """Which side of the mesh is shaped: "+z", or the direction."""
    points: np.ndarray
    """float64 (n, 3)."""
    normals: np.ndarray
    """float64 (n, 3), unit, outward."""
    facets: np.ndarray
    """float64 (n, 3): area that a sample stands for times the outward normal of its triangle."""
    size: tuple[float, float]
    thickness: float
    """From the flat side to the highest place of the other."""

    def thinned(self, samples: int) -> Plate:
        """With about so many of the samples, evenly chosen."""
        every = slice(None, None, max(1, len(self.points) // samples))
        points, normals, facets = (each[every] for each in (self.points, self.normals, self.facets))
        return replace(self, points=points, normals=normals, facets=facets * (len(self.points) / len(points)))


def plate_of(mesh: Mesh, glass: Dispersion, samples: int = SAMPLES) -> Plate:
    """The plate that `mesh` is. Raises `UserError` where it is none: no side is flat, or both."""
    vectors = mesh.area_vectors()
    areas = np.linalg.norm(vectors, axis=1)
    vectors, corners, areas = vectors[areas > 0.0], mesh.corners()[areas > 0.0], areas[areas > 0.0]
    facing = vectors / areas[:, None]
    extent = float(np.linalg.norm(np.subtract(*mesh.bounds()[::-1])))
    is_flat = _flat_side(facing, areas, corners, extent)
    inward = -unit(vectors[is_flat].sum(axis=0))
    frame = _frame(inward)
    local = corners @ frame.T
    low, high = (edge(local[is_flat], axis=(0, 1)) for edge in (np.min, np.max))
    local -= np.array([*(0.5 * (low + high)[:2]), low[2]])
    facing, vectors = facing @ frame.T, vectors @ frame.T
    size, flat_area = (high - low)[:2], float(areas[is_flat].sum())
    shaped = (facing[:, 2] > _STEEP) & ~is_flat
    behind = (facing[:, 2] < -_STEEP) & ~is_flat
    covered = float(vectors[shaped, 2].sum())
    thickness = float(local[..., 2].max())
    if flat_area < 0.3 * size.prod() or not 0.7 < covered / flat_area < 1.3 or areas[behind].sum() > 0.02 * flat_area:
        raise UserError(
            f"'{mesh.name}' is no plate: it must have one flat side and, across from it, one that is shaped"
        )
    if thickness > _THICKEST * size.min():
        raise UserError(f"'{mesh.name}' is {thickness:.4g} thick and {size.min():.4g} wide, a block and no plate")
    if np.ptp(facing[shaped], axis=0).max() < _CURVED:
        raise UserError(
            f"both sides of '{mesh.name}' are flat, so it casts no picture; give the mesh of the shaped plate"
        )
    if mesh.corner_normals is not None:
        normals = mesh.corner_normals[mesh.areas() > 0.0][shaped] @ frame.T
    else:
        triangles = mesh.triangles[mesh.areas() > 0.0][shaped]
        at_vertices = np.zeros_like(mesh.vertices)
        np.add.at(at_vertices, triangles.ravel(), np.repeat(vectors[shaped], 3, axis=0))
        normals = normalised(at_vertices)[triangles]
    weights = _centroids(max(1, round(math.sqrt(samples / int(shaped.sum())))))
    return Plate(
        mesh.name,
        glass,
        _side_words(inward),
        np.einsum("sk,tkd->tsd", weights, local[shaped]).reshape(-1, 3),
        normalised(np.einsum("sk,tkd->tsd", weights, normals).reshape(-1, 3)),
        np.repeat(vectors[shaped] / len(weights), len(weights), axis=0),
        (float(size[0]), float(size[1])),
        thickness,
    )


def _flat_side(facing: np.ndarray, areas: np.ndarray, corners: np.ndarray, extent: float) -> np.ndarray:
    """Which triangles lie in the plane that holds most area, bool (T,)."""
    keys, of_key = np.unique(np.round(facing, 3), axis=0, return_inverse=True)
    by_key = np.bincount(of_key.ravel(), areas, len(keys))
    best = np.zeros(len(facing), bool)
    for key in np.argsort(by_key)[::-1][:6]:
        direction = unit(keys[key])
        alike = facing @ direction > _FLAT
        heights = corners.mean(axis=1) @ direction
        middle = np.median(
            np.repeat(heights[alike], np.maximum(1, (64 * areas[alike] / areas[alike].max()).astype(int)))
        )
        lying = alike & (np.abs(corners @ direction - middle).max(axis=1) < 1e-4 * extent)
        best = lying if areas[lying].sum() > areas[best].sum() else best
    return best


def _frame(z: np.ndarray) -> np.ndarray:
    """Rows x, y, z: a right-handed frame, x the nearest to a coordinate axis."""
    x = np.eye(3)[0 if abs(z[0]) < 0.9 else 1]
    x = unit(x - z * (x @ z))
    return np.stack([x, np.cross(z, x), z])


def _side_words(direction: np.ndarray) -> str:
    axis = int(np.abs(direction).argmax())
    if abs(direction[axis]) > _FLAT:
        return ("+" if direction[axis] > 0.0 else "-") + "xyz"[axis]
    return "({:.3f}, {:.3f}, {:.3f})".format(*direction)


def _centroids(parts: int) -> np.ndarray:
    """Barycentric middles of the parts² triangles that a triangle is cut into, float64 (parts², 3)."""
    i, j = (each.ravel() for each in np.meshgrid(np.arange(parts), np.arange(parts), indexing="ij"))
    upright = np.stack([i, j], axis=1)[i + j < parts] + 1.0 / 3.0
    turned = np.stack([i, j], axis=1)[i + j < parts - 1] + 2.0 / 3.0
    uv = np.concatenate([upright, turned]) / parts
    return np.column_stack([1.0 - uv.sum(axis=1), uv])


def landing(
    plate: Plate,
    distance: float,
    wavelength_nm: float,
    flat_first: bool = True,
    tilt_deg: tuple[float, float] = (0.0, 0.0),
) -> tuple[np.ndarray, np.ndarray]:
    """Where the samples' light lands on a screen `distance` behind the plate's far side: float64 (n, 2), and its flux
    (n,), per unit of irradiance; 0 of what is totally reflected.

    The light comes straight from the flat side, or from the shaped one; `tilt_deg` turns the plate about x and y. x and
    y of the screen are the plate's, of a plate that was turned over y is the other way.
    """
    n = float(plate.glass.index(wavelength_nm))
    a, b = np.radians(tilt_deg)
    about_x = np.array([(1.0, 0.0, 0.0), (0.0, np.cos(a), -np.sin(a)), (0.0, np.sin(a), np.cos(a))])
    about_y = np.array([(np.cos(b), 0.0, np.sin(b)), (0.0, 1.0, 0.0), (-np.sin(b), 0.0, np.cos(b))])
    turn = about_y @ about_x @ np.diag([1.0, 1.0, 1.0] if flat_first else [1.0, -1.0, -1.0])
    points, normals, facets = (each @ turn.T for each in (plate.points, plate.normals, plate.facets))
    flat = turn[:, 2][None]
    light = np.array([(0.0, 0.0, 1.0)])
    if flat_first:
        inside, first = _refracted(light, flat, 1.0 / n)
        narrowed = float((light * flat).sum() / (inside * flat).sum())
        flux = narrowed * (facets * inside).sum(axis=1)
        out, second = _refracted(np.broadcast_to(inside, normals.shape), normals, n)
    else:
        inside, first = _refracted(np.broadcast_to(light, normals.shape), -normals, 1.0 / n)
        flux = -facets[:, 2]
        points = points - inside * ((points @ flat[0]) / (inside @ flat[0]))[:, None]
        out, second = _refracted(inside, np.broadcast_to(-flat, normals.shape), n)
    flux = np.maximum(flux, 0.0) * first * second
    lands = (flux > 0.0) & (out[:, 2] > 1e-3)
    way = (distance + (plate.thickness if flat_first else 0.0) - points[:, 2]) / np.where(lands, out[:, 2], 1.0)
    return (points + out * way[:, None])[:, :2], np.where(lands, flux, 0.0)


def _refracted(direction: np.ndarray, normal: np.ndarray, eta: float) -> tuple[np.ndarray, np.ndarray]:
    """Unit directions behind a surface whose `normal` is along the light, `eta` = n_i/n_t, and the share that passes
    (Fresnel, unpolarised): 0 where all is reflected."""
    cosine = (direction * normal).sum(axis=1)
    square = 1.0 - eta**2 * (1.0 - cosine**2)
    passes = (square > 0.0) & (cosine > 0.0)
    behind = np.sqrt(np.where(passes, square, 1.0))
    out = eta * direction + (behind - eta * cosine)[:, None] * normal
    return out, np.where(passes, 1.0 - fresnel(np.maximum(cosine, 0.0), 1.0 / eta), 0.0)
