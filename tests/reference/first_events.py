"""What the first two events of parallel light at a prism leave, as pieces of beams: plain float64 numpy.

Every triangle that the light meets, and every triangle behind it, has pieces of its own: reflected outside, then
transmitted and reflected at the second surface. All of the light is in them, none of it twice.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from spectrasplat.beams.polygons import BeamPieces, joined
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.passes.emission_domain import EmissionDomain, azimuthal_plane
from spectrasplat.reference.optics import fresnel_reflectance, reflect, refract


def half_planes(corners: np.ndarray) -> np.ndarray:
    """(n, 3) a_u, a_v, c of a polygon that may run either way round."""
    along = np.roll(corners, -1, axis=0) - corners
    inward = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    inward *= np.sign(inward @ corners.mean(axis=0) - np.einsum("ij,ij->i", inward, corners))[:, None]
    return np.column_stack([inward, -np.einsum("ij,ij->i", inward, corners)])


def counter_clockwise(corners: np.ndarray) -> np.ndarray:
    a, b, c = corners[:3]
    return corners if np.linalg.det([b - a, c - a]) > 0.0 else corners[::-1]


def first_events(
    buffers: SceneBuffers, domain: EmissionDomain, item: int, edges_x: np.ndarray, two_events: bool = True
) -> BeamPieces:
    """Pieces of the first light at the convex solid `item` in bands between `edges_x`; what enters its glass, after one
    event or after two."""
    scene, space = buffers.scene, buffers.space
    corners = space.to_gpu(buffers.world_meshes[item].corners())
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    glass = scene.objects[item].material.dispersion
    axis, across = domain.axis, np.stack([domain.tangent, domain.bitangent])
    found: list[BeamPieces] = []

    def affine(triangle: int, start: np.ndarray, ways: np.ndarray) -> np.ndarray:
        """Positions X, X_u, X_v of rays `start` (3, 3) (likewise) that go along `ways` on the triangle's plane."""
        normal = normals[triangle]
        placed = start.copy()
        placed[0] -= corners[triangle, 0]
        return start - np.outer(placed @ normal / (ways @ normal), ways)

    for lo, hi in pairwise(edges_x.tolist()):
        x = np.array([lo, 0.5 * (lo + hi), hi])
        n = glass.index(buffers.axis.nm_of_x(x))
        for t in np.flatnonzero(normals @ axis < 0.0):
            outline = (corners[t] - domain.origin) @ across.T
            centre = outline.mean(axis=0)
            hull = counter_clockwise(outline - centre)
            entry = half_planes(hull)
            plane = np.stack([domain.origin + centre @ across, *across])
            start = affine(t, plane, axis)
            reflectance = np.array([fresnel_reflectance(axis, normals[t], 1.0 / index) for index in n])
            inside = np.stack([refract(axis, normals[t], 1.0 / index) for index in n])
            common = (lo, hi, centre, hull)
            mirrored = np.repeat(reflect(axis, normals[t])[None], 3, axis=0)
            still = np.column_stack([entry, entry])
            found.append(_piece(*common, [start] * 3, mirrored, reflectance, still, t, item, 1, False))
            if not two_events:
                found.append(_piece(*common, [start] * 3, inside, 1.0 - reflectance, still, t, item, 1, True))
                continue
            for s in np.flatnonzero((inside @ normals.T > 0.0).all(axis=0)):
                at = np.stack([affine(s, start, way) for way in inside])
                moving = []
                for a, b in zip(corners[s], np.roll(corners[s], -1, axis=0), strict=True):
                    inward = np.cross(normals[s], b - a)
                    lines = np.column_stack([at[:, 1] @ inward, at[:, 2] @ inward, (at[:, 0] - a) @ inward])
                    lines /= np.linalg.norm(lines[:, :2], axis=1)[:, None]
                    moving.append(np.concatenate([lines[0], lines[2]]))
                edges = np.concatenate([still, moving])
                back = np.array([fresnel_reflectance(w, -normals[s], i) for w, i in zip(inside, n, strict=True)])
                turned = np.stack([reflect(way, -normals[s]) for way in inside])
                carried = 1.0 - reflectance
                found.append(_piece(*common, at, turned, carried * back, edges, s, item, 2, True))
                if (back < 1.0).all():
                    out = np.stack([refract(w, -normals[s], i) for w, i in zip(inside, n, strict=True)])
                    found.append(_piece(*common, at, out, carried * (1.0 - back), edges, s, item, 2, False))
    return _numbered(joined(found))


def diverging_first_event(
    buffers: SceneBuffers, domain: EmissionDomain, item: int, edges_x: np.ndarray, parts: int
) -> BeamPieces:
    """What a point light's first event at the convex solid `item` leaves, its facets divided into `parts`² each: there
    rays are nearly affine in the light's azimuthal plane."""
    scene, space = buffers.scene, buffers.space
    corners = space.to_gpu(buffers.world_meshes[item].corners())
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    glass = scene.objects[item].material.dispersion
    frame = np.stack([domain.tangent, domain.bitangent, domain.axis])
    found: list[BeamPieces] = []

    def way_of(q: np.ndarray) -> np.ndarray:
        r2 = q @ q
        return np.append(q * np.sqrt(1.0 - 0.25 * r2), 1.0 - 0.5 * r2) @ frame

    def derived(function: Callable[[np.ndarray], np.ndarray], q: np.ndarray) -> np.ndarray:
        """Value and central differences by both coordinates (3, 3)."""
        steps = 1e-5 * np.eye(2)
        return np.stack([function(q), *((function(q + s) - function(q - s)) / 2e-5 for s in steps)])

    for lo, hi in pairwise(edges_x.tolist()):
        n = glass.index(buffers.axis.nm_of_x(np.array([lo, 0.5 * (lo + hi), hi])))
        for t in np.flatnonzero(np.einsum("ij,ij->i", normals, corners[:, 0] - domain.origin) < 0.0):
            normal, (a, b, c) = normals[t], corners[t]
            for part in _subdivided(parts):
                outline = azimuthal_plane(_unit((a + part @ np.stack([b - a, c - a]) - domain.origin) @ frame.T))
                centre = outline.mean(axis=0)
                hull = counter_clockwise(outline - centre)
                edges = half_planes(hull)

                def met(q: np.ndarray, normal=normal, a=a) -> np.ndarray:
                    way = way_of(q)
                    return domain.origin + way * ((a - domain.origin) @ normal / (way @ normal))

                start, axis = derived(met, centre), way_of(centre)
                reflectance = np.array([fresnel_reflectance(axis, normal, 1.0 / index) for index in n])
                inside = [derived(lambda q, i=index, n=normal: refract(way_of(q), n, 1.0 / i), centre) for index in n]
                outside = derived(lambda q, n=normal: reflect(way_of(q), n), centre)
                rest = np.column_stack([edges, edges]), t, item, 1
                common = lo, hi, centre, hull, [start] * 3
                found.append(_piece(*common, [outside] * 3, reflectance, *rest, False))
                found.append(_piece(*common, inside, 1.0 - reflectance, *rest, True))
    return _numbered(joined(found))


def _numbered(pieces: BeamPieces) -> BeamPieces:
    """With keys of their own, the same whatever was made before."""
    return replace(pieces, key=np.arange(1, len(pieces) + 1))


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _subdivided(parts: int) -> list[np.ndarray]:
    """Triangles (3, 2) of weights that divide one into parts²."""
    found = []
    for i in range(parts):
        for j in range(parts - i):
            low = np.array([[i, j], [i + 1, j], [i, j + 1]]) / parts
            found.append(low)
            if i + j + 1 < parts:
                found.append(np.array([[i + 1, j], [i + 1, j + 1], [i, j + 1]]) / parts)
    return found


def _piece(lo, hi, centre, hull, positions, directions, weight, edges, triangle, item, depth, inside) -> BeamPieces:
    """`directions`: one at each place of the band (3, 3), or with its columns (3, 3, 3)."""
    direction = np.zeros((1, 3, 3, 3))
    direction[0, :, : 1 if np.ndim(directions) == 2 else 3] = np.reshape(directions, (3, -1, 3))
    one = np.ones(1, np.int32)
    return BeamPieces(
        light=0 * one,
        source=item * one,
        depth=depth * one,
        x_lo=np.array([lo]),
        x_hi=np.array([hi]),
        centre=centre[None],
        position=np.stack(positions)[None],
        direction=direction,
        weight=np.asarray(weight, float)[None],
        last_triangle=np.array([triangle], np.int32),
        last_object=item * one,
        is_inside=np.array([inside]),
        inside=np.array([1 << item if inside else 0], np.uint64),
        key=np.zeros(1, np.int64),
        is_tail=np.zeros(1, bool),
        flux=np.ones(1),
        state=np.zeros((1, 3, 6)),
        edge_start=np.array([0, len(edges)], np.int32),
        edges=edges,
        hull_start=np.array([0, len(hull)], np.int32),
        hulls=hull,
    )
