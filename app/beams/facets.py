"""A scene as beams see it: convex flat facets with what is on their two sides, and boxes round all that is not flat.

Beams carry flat-faceted glass and flat mirrors. Flat receivers and blockers end them; what is neither is an obstacle,
and a beam that may meet one is carried on by photons.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from ..features.facts import why_no_beams
from ..model.geometry.mesh import Mesh
from ..model.optics.colorimetry import VISIBLE_NM, mirror_reflectance
from ..model.optics.spectral_tables import SpectralAxis
from ..model.scene import Scene
from ..model.tint_bands import tint_curves

DIELECTRIC, MIRROR, BLACK, RECEIVER, FACED = 0, 1, 2, 3, 4
"""What a facet is of; FACED: of a receiver of several, which has no map that polygons could be drawn into."""
MAX_SOLIDS = 62
"""Transparent solids that fit the bits of a beam's medium."""
MAX_FACETS = 4096
"""An object of more facets is left to photons whatever it would cost."""
MAX_FACED = 128
"""Triangles of a receiver that is no plane, at most: rays of every beam are tested against all of them."""
MAX_CORNERS = 10
"""A facet of more corners is cut into pieces."""
SAMPLES = 2049
"""Samples of every spectral table, equally spaced in x."""
_COPLANAR = 2e-6
"""How far from a plane corners may be, as a share of an object's size: float32 coordinates resolve a few times 1e-7."""
_NO_ROW = -1


FACET = np.dtype(
    [
        # n, d with n . p = d; n points out of a solid.
        ("plane", "f8", 4),
        ("kind", "i8"),
        ("owner", "i8"),
        # Counter-clockwise seen from where n points.
        ("corner", "f8", (MAX_CORNERS, 3)),
        ("corners", "i8"),
        # Edge from each corner to the next: unit vector e, moment P x e [Pluecker].
        ("edge", "f8", (MAX_CORNERS, 6)),
        # Ball that holds it.
        ("centre", "f8", 3),
        ("radius", "f8"),
        # Origin and two axes of its plane; a receiver's are its map's.
        ("frame", "f8", (3, 3)),
        # Number of the receiver, -1: none; tolerated error of places on it, GPU units.
        ("receiver", "i8"),
        ("texel", "f8"),
        # One of the object's triangles that it is made of.
        ("triangle", "i8"),
    ]
)
"""A facet, in GPU space. `kind`: DIELECTRIC, MIRROR, BLACK, RECEIVER or FACED; `owner`: object."""

SOLID = np.dtype(
    [
        # Place in a medium's mask, the higher one wins; -1: not transparent. `of_bit` of record b: the object of bit b.
        ("bit", "i8"),
        ("of_bit", "i8"),
        # Rows of the tables: refractive index; absorption per GPU unit (glass) or reflectance (mirror); -1: none.
        ("glass", "i8"),
        ("tint", "i8"),
        # Facets first … last - 1.
        ("first", "i8"),
        ("last", "i8"),
        # A convex solid: its facets never hide each other.
        ("convex", "?"),
        ("centre", "f8", 3),
        ("radius", "f8"),
    ]
)
"""What the search knows of an object."""


@dataclass(frozen=True)
class BeamScene:
    """All of it, with which objects are met by beams."""

    facets: np.ndarray
    """FACET (F,), by owner."""
    solids: np.ndarray
    """SOLID (at least 64 and the objects,)."""
    tables: np.ndarray
    """(rows, SAMPLES): spectral tables over x."""
    obstacles: np.ndarray
    """(B, 2, 3): boxes round what is not flat."""
    absorbs: bool
    """Some medium absorbs."""
    coloured: bool
    """Some mirror reflects one colour more than another."""
    tints: np.ndarray
    """(N, 401): what that does to light, `model.tint_bands.tint_curves`."""
    beam_objects: tuple[int, ...]
    """Objects of glass and mirrors whose light is carried by beams."""
    why_not: dict[int, str]
    """Specular objects that beams do not carry, and why."""
    polarised: bool
    """Beams carry their light's state of polarisation."""

    @property
    def disperses(self) -> bool:
        """Whether some glass bends one wavelength more than another."""
        rows = self.tables[np.unique(self.solids["glass"][self.solids["glass"] >= 0])]
        return bool(np.any(rows != rows[:, :1]))


def in_gpu_space(world_meshes: list[Mesh], to_gpu: Callable[[np.ndarray], np.ndarray], unit: float) -> list[Mesh]:
    """Meshes as `beam_scene` takes them. `to_gpu`, `unit`: scene to GPU space, GPU units a scene unit."""
    matrix = np.eye(4)
    matrix[:3, :3] *= unit
    matrix[:3, 3] = to_gpu(np.zeros(3))
    return [mesh.transformed(matrix) for mesh in world_meshes]


def beam_scene(
    scene: Scene,
    meshes: list[Mesh],
    frames: dict[int, tuple[np.ndarray, np.ndarray]],
    axis: SpectralAxis,
    unit: float,
) -> BeamScene:
    """The facets of `scene`. `meshes`: each object's in GPU space; `frames`: origin (3,) and axes (2, 3) of every flat
    receiver's map by number; `unit`: GPU units a scene unit."""
    why_not: dict[int, str] = {}
    outlines: dict[int, list[tuple[np.ndarray, int]]] = {}
    receivers = [i for i, o in enumerate(scene.objects) if o.material.receives]
    obstacles: list[int] = []
    for i, item in enumerate(scene.objects):
        if item.material.is_specular:
            reason = why_no_beams(item)
            if reason is None:
                outlines[i] = _facets_kept(item.mesh, meshes[i])
                if len(outlines[i]) > MAX_FACETS:
                    reason = f"it has {len(outlines[i])} facets"
                    del outlines[i]
            if reason is not None:
                why_not[i] = reason
                obstacles.append(i)
        elif len(item.mesh.triangles) > (MAX_FACED if item.material.receives and not item.mesh.is_flat else MAX_FACETS):
            obstacles.append(i)
        else:
            outlines[i] = _facets_kept(item.mesh, meshes[i])
    for i in _inside_of_obstacles(scene, meshes, [i for i in outlines if scene.objects[i].material.is_solid], why_not):
        why_not[i] = "it nests in, or touches, a solid that is not faceted"
        obstacles.append(i)
        del outlines[i]
    transparent = [i for i in outlines if scene.objects[i].material.is_solid]
    for i in transparent[MAX_SOLIDS:]:
        why_not[i] = f"more than {MAX_SOLIDS} transparent solids"
        obstacles.append(i)
        del outlines[i]
    _cut_where_they_cross(outlines)
    ranked = sorted(transparent[:MAX_SOLIDS], key=lambda i: (scene.objects[i].material.priority, i))
    tables, glass, tint = _tables(scene, axis, unit)
    facets = _facets(scene, outlines, receivers, frames)
    return BeamScene(
        facets,
        _solids(scene, meshes, facets, {i: bit for bit, i in enumerate(ranked)}, glass, tint),
        tables,
        np.array([meshes[i].bounds() for i in obstacles], float).reshape(-1, 2, 3),
        any(o.material.is_solid and o.material.absorption is not None for o in scene.objects),
        any(o.material.is_mirror and len(set(o.material.reflectance_rgb)) > 1 for o in scene.objects),
        tint_curves(scene),
        tuple(i for i in outlines if scene.objects[i].material.is_specular),
        why_not,
        scene.polarised,
    )


def shown_as(beams: BeamScene, scene: Scene, axis: SpectralAxis, unit: float) -> BeamScene:
    """The same facets with the glass, tints and mirrors of `scene`, whose objects have the places of those of
    `beams`."""
    tables, glass, tint = _tables(scene, axis, unit)
    solids = beams.solids.copy()
    solids["glass"][: len(glass)], solids["tint"][: len(tint)] = glass, tint
    return replace(beams, tables=tables, solids=solids, tints=tint_curves(scene))


_KEPT: WeakKeyDictionary[Mesh, list[tuple[np.ndarray, int]]] = WeakKeyDictionary()
"""Facets of meshes as they are modelled: what is turned from frame to frame keeps them."""


def _facets_kept(mesh: Mesh, placed: Mesh) -> list[tuple[np.ndarray, int]]:
    """`facets_of` of an object's own mesh, where `placed` puts it: an affine map keeps what is flat and convex."""
    own, there = mesh.vertices - mesh.vertices.mean(axis=0), placed.vertices - placed.vertices.mean(axis=0)
    matrix, _, rank, _ = np.linalg.lstsq(own, there)
    if rank < 3:  # flat, so of few facets
        return facets_of(placed)
    if mesh not in _KEPT:
        _KEPT[mesh] = facets_of(mesh)
    turn = -1 if np.linalg.det(matrix) < 0.0 else 1
    from_middle, to = mesh.vertices.mean(axis=0), placed.vertices.mean(axis=0)
    return [(((corners - from_middle) @ matrix + to)[::turn], triangle) for corners, triangle in _KEPT[mesh]]


def facets_of(mesh: Mesh) -> list[tuple[np.ndarray, int]]:
    """Convex polygons (corners (n, 3) counter-clockwise from outside, one of their triangles) that make up a mesh.

    Coplanar neighbours become one facet where that is convex, triangles of no area none."""
    areas, normals = mesh.areas(), mesh.face_normals()
    low, high = mesh.bounds()
    tolerance = _COPLANAR * float(np.linalg.norm(high - low))
    corners = mesh.corners()
    offset = np.einsum("tj,tj->t", normals, corners.mean(axis=1))
    neighbours = _neighbours(mesh)
    left = areas > 1e-14 * max(areas.max(), np.finfo(float).tiny)
    facets: list[tuple[np.ndarray, int]] = []
    for seed in np.argsort(-areas, kind="stable"):
        if not left[seed]:
            continue
        patch, border = [int(seed)], [int(seed)]
        left[seed] = False
        while border:
            for near in neighbours[border.pop()]:
                flat = np.abs(corners[near] @ normals[seed] - offset[seed]).max() <= tolerance
                if left[near] and flat and normals[near] @ normals[seed] > 0.9999:
                    left[near] = False
                    patch.append(near)
                    border.append(near)
        facets += _convex_parts(corners[patch], normals[seed], float(areas[patch].sum()), patch)
    # In an order that does not depend on how the mesh was cut into triangles: roulette knows facets by number.
    size = float(np.linalg.norm(high - low))
    return sorted(facets, key=lambda facet: tuple(np.round((facet[0].mean(axis=0) - low) / size, 6)))


def _neighbours(mesh: Mesh) -> list[list[int]]:
    # By place: triangles may have corners of their own.
    _, place = np.unique(mesh.vertices.round(9), axis=0, return_inverse=True)
    edges: dict[tuple[int, int], list[int]] = {}
    for t, triangle in enumerate(place.reshape(-1)[mesh.triangles]):
        for a, b in zip(triangle, np.roll(triangle, -1), strict=True):
            edges.setdefault((min(a, b), max(a, b)), []).append(t)
    found: list[list[int]] = [[] for _ in mesh.triangles]
    for triangles in edges.values():
        for t in triangles:
            found[t] += [other for other in triangles if other != t]
    return found


def _convex_parts(
    corners: np.ndarray, normal: np.ndarray, area: float, patch: list[int]
) -> list[tuple[np.ndarray, int]]:
    guide = np.eye(3)[np.argmin(np.abs(normal))]
    first = np.cross(normal, guide)
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    points = corners.reshape(-1, 3)
    flat = np.column_stack([points @ first, points @ second])
    hull = convex_hull(flat)
    around = flat[hull]
    hull_area = 0.5 * abs(
        float(np.sum(around[:, 0] * np.roll(around[:, 1], -1) - around[:, 1] * np.roll(around[:, 0], -1)))
    )
    if abs(hull_area - area) > 1e-6 * hull_area:
        return [(corners[k], patch[k]) for k in range(len(patch))]
    outline = points[hull]
    return [
        (np.concatenate([outline[:1], outline[i : i + MAX_CORNERS - 1]]), patch[0])
        for i in range(1, len(outline) - 1, MAX_CORNERS - 2)
    ]


def convex_hull(points: np.ndarray) -> np.ndarray:
    """Indices of the corners of (n, 2) points' convex hull, counter-clockwise, without those on its edges to 1e-9
    of its size [Andrew 1979]."""
    order = np.lexsort((points[:, 1], points[:, 0]))
    size = float(np.ptp(points, axis=0).max())

    def half(sequence: np.ndarray) -> list[int]:
        chain: list[int] = []
        for i in sequence:
            while len(chain) > 1:
                a, b = points[chain[-2]], points[chain[-1]]
                along, to = b - a, points[i] - a
                if along[0] * to[1] - along[1] * to[0] > 1e-9 * size * np.hypot(*to):
                    break
                chain.pop()
            if not chain or np.hypot(*(points[i] - points[chain[-1]])) > 1e-9 * size:
                chain.append(int(i))
        return chain

    lower, upper = half(order), half(order[::-1])
    return np.array(lower[:-1] + upper[:-1])


def _cut_where_they_cross(outlines: dict[int, list[tuple[np.ndarray, int]]]) -> None:
    """Cut facets of different objects that cross each other along the line where they do: which one is nearer may
    change from one side of it to the other, but nowhere else."""
    whole = {i: [corners for corners, _ in pieces] for i, pieces in outlines.items()}
    low = {i: np.array([c.min(axis=0) for c in pieces]).reshape(-1, 3) for i, pieces in whole.items()}
    high = {i: np.array([c.max(axis=0) for c in pieces]).reshape(-1, 3) for i, pieces in whole.items()}
    for i, pieces in outlines.items():
        for j in outlines:
            if i == j or not len(low[i]) or not len(low[j]):
                continue
            if (low[i].min(axis=0) > high[j].max(axis=0)).any() or (low[j].min(axis=0) > high[i].max(axis=0)).any():
                continue
            result = []
            for corners, triangle in pieces:
                near = (corners.min(axis=0) <= high[j]).all(axis=1) & (corners.max(axis=0) >= low[j]).all(axis=1)
                parts = [corners]
                for other in np.flatnonzero(near):
                    parts = [part for whole_part in parts for part in _cut_by(whole_part, whole[j][other])]
                result += [(part, triangle) for part in parts]
            pieces[:] = result


def _cut_by(corners: np.ndarray, other: np.ndarray) -> list[np.ndarray]:
    """A convex facet, in two where another one crosses it."""
    normal, apart = _plane_and_side(other, corners)
    own_normal, other_apart = _plane_and_side(corners, other)
    along = np.cross(normal, own_normal)
    length = float(np.linalg.norm(along))
    size = float(np.ptp(corners, axis=0).max() + np.ptp(other, axis=0).max())
    least = _COPLANAR * size
    if length < 1e-6 or min(apart.max(), -apart.min(), other_apart.max(), -other_apart.min()) <= least:
        return [corners]
    spans = [np.sort(_on_plane(c, d) @ along / length) for c, d in ((corners, apart), (other, other_apart))]
    if min(spans[0][-1], spans[1][-1]) - max(spans[0][0], spans[1][0]) <= least:
        return [corners]
    result = []
    for sign in (1.0, -1.0):
        part = []
        for k in range(len(corners)):
            here, there = sign * apart[k - 1], sign * apart[k]
            if (here > 0.0) != (there > 0.0):
                part.append(corners[k - 1] + here / (here - there) * (corners[k] - corners[k - 1]))
            if there > 0.0:
                part.append(corners[k])
        if len(part) > MAX_CORNERS:
            result.append(np.array([part[0], *part[MAX_CORNERS - 1 :]]))
            part = part[:MAX_CORNERS]
        result.append(np.array(part))
    return result


def _plane_and_side(corners: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normal of a polygon's plane, and how far in front of it points are."""
    middle = corners.mean(axis=0)
    normal = np.cross(corners - middle, np.roll(corners, -1, axis=0) - middle).sum(axis=0)
    normal /= np.linalg.norm(normal)
    return normal, (points - middle) @ normal


def _on_plane(corners: np.ndarray, apart: np.ndarray) -> np.ndarray:
    """Where a polygon's outline meets a plane that its corners are so far in front of."""
    after, there = np.roll(corners, -1, axis=0), np.roll(apart, -1)
    across = (apart > 0.0) != (there > 0.0)
    part = (apart / np.where(across, apart - there, 1.0))[across, None]
    return corners[across] + part * (after - corners)[across]


def _facets(
    scene: Scene,
    outlines: dict[int, list[tuple[np.ndarray, int]]],
    receivers: list[int],
    frames: dict[int, tuple[np.ndarray, np.ndarray]],
) -> np.ndarray:
    records = np.zeros(sum(map(len, outlines.values())), FACET)
    pieces = ((i, *piece) for i in sorted(outlines) for piece in outlines[i])
    for record, (i, outline, triangle) in zip(records, pieces, strict=True):
        material = scene.objects[i].material
        middle = outline.mean(axis=0)
        shifted = outline - middle
        normal = np.cross(shifted, np.roll(shifted, -1, axis=0)).sum(axis=0)
        normal /= np.linalg.norm(normal)
        along = outline[1] - outline[0]
        along /= np.linalg.norm(along)
        record["plane"] = *normal, normal @ middle
        record["kind"] = (RECEIVER if scene.objects[i].mesh.is_flat else FACED) if material.receives else BLACK
        if material.is_specular:
            record["kind"] = DIELECTRIC if material.is_solid else MIRROR
        record["owner"], record["triangle"] = i, triangle
        record["corner"][: len(outline)], record["corners"] = outline, len(outline)
        edge = np.roll(outline, -1, axis=0) - outline
        edge /= np.linalg.norm(edge, axis=1)[:, None]
        record["edge"][: len(outline)] = np.concatenate([edge, np.cross(outline, edge)], axis=1)
        record["centre"], record["radius"] = middle, np.linalg.norm(shifted, axis=1).max()
        record["receiver"] = 2 * receivers.index(i) if record["kind"] == RECEIVER else -1
        record["frame"] = middle, along, np.cross(normal, along)
        if record["receiver"] in frames:
            origin, axes = frames[int(record["receiver"])]
            record["frame"] = origin, axes[0], axes[1]
    return records


def _solids(
    scene: Scene, meshes: list[Mesh], facets: np.ndarray, bits: dict[int, int], glass: list[int], tint: list[int]
) -> np.ndarray:
    records = np.zeros(max(len(scene.objects), 64), SOLID)
    records["bit"] = -1
    for i, bit in bits.items():
        records[i]["bit"], records[bit]["of_bit"] = bit, i
    for i, (mesh, item) in enumerate(zip(meshes, scene.objects, strict=True)):
        low, high = mesh.bounds()
        record = records[i]
        record["glass"], record["tint"] = glass[i], tint[i]
        record["first"], record["last"] = np.searchsorted(facets["owner"], [i, i + 1])
        record["convex"] = item.mesh.convex_planes is not None or record["last"] - record["first"] == 1
        record["centre"], record["radius"] = 0.5 * (low + high), 0.5 * np.linalg.norm(high - low)
    return records


def _tables(scene: Scene, axis: SpectralAxis, unit: float) -> tuple[np.ndarray, list[int], list[int]]:
    """All rows, and each object's of its glass and of its tint."""
    nm = axis.nm_of_samples(SAMPLES)
    rows: list[np.ndarray] = []
    glasses: list = []
    row_of_glass: list[int] = []
    glass, tint = [], []
    for item in scene.objects:
        material = item.material
        glass.append(_NO_ROW)
        tint.append(_NO_ROW)
        if material.is_solid:
            if material.dispersion not in glasses:
                glasses.append(material.dispersion)
                row_of_glass.append(len(rows))
                rows.append(material.dispersion.index(nm))
            glass[-1] = row_of_glass[glasses.index(material.dispersion)]
            if material.absorption is not None:
                tint[-1] = len(rows)
                rows.append(np.interp(nm, VISIBLE_NM, material.absorption.coefficient) / unit)
        if material.is_mirror:
            tint[-1] = len(rows)
            rows.append(mirror_reflectance(material.reflectance_rgb, nm))
    return np.array(rows, float).reshape(-1, SAMPLES), glass, tint


def _inside_of_obstacles(
    scene: Scene, meshes: list[Mesh], transparent: list[int], why_not: dict[int, str]
) -> list[int]:
    """Faceted solids whose boxes meet that of a solid that photons carry, or of another one of these."""
    bounds = {i: np.array(mesh.bounds()) for i, mesh in enumerate(meshes)}
    found = [i for i in why_not if scene.objects[i].material.is_solid]
    taken: list[int] = []
    while found:
        low, high = bounds[found.pop()]
        for i in transparent:
            if i not in taken and (bounds[i][0] <= high).all() and (bounds[i][1] >= low).all():
                taken.append(i)
                found.append(i)
    return taken
