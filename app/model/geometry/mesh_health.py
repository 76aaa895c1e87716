"""What is wrong with a mesh, in counts, and the few repairs that cannot change its meaning.

Refraction needs to know which side is glass. A closed, consistently wound mesh says so; for
any other the program goes on with a stated assumption, never silently.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import UserError
from .mesh import Mesh, make_mesh

_DEGENERATE = 1e-12
"""A triangle is degenerate when twice its area is below this fraction of its longest edge squared."""

_SEAM = 1e-5
"""Share of a mesh's longest side: corners of borders that are nearer than this are one."""


@dataclass(frozen=True)
class MeshHealth:
    """Counts of everything that makes a mesh something other than a closed oriented surface."""

    triangles: int
    boundary_edges: int
    """Edges with one triangle."""
    non_manifold_edges: int
    """Edges with more than two."""
    inconsistent_edges: int
    """Edges whose two triangles run along them in the same direction."""
    degenerate_triangles: int
    """Triangles without area."""
    zero_normals: int
    """Shading normals that are zero or were not finite."""
    duplicate_vertices: int
    """Vertices at exactly the position of another one."""
    components: int
    """Parts that share no vertex."""
    inward_components: int
    """Closed parts that face inward: cavities, or mistakes."""
    signed_volume: float
    """Cubic units; means nothing when the mesh is open."""

    @property
    def watertight(self) -> bool:
        """Closed, manifold and consistently wound."""
        return not (self.boundary_edges or self.non_manifold_edges or self.inconsistent_edges)

    @property
    def inside_out(self) -> bool:
        """Watertight, but facing inward as a whole."""
        return self.watertight and self.signed_volume < 0.0

    def summary(self) -> str:
        """One line for `inspect`: "watertight" or the faults with their counts."""
        faults = [
            (self.boundary_edges, "boundary edge"),
            (self.non_manifold_edges, "non-manifold edge"),
            (self.inconsistent_edges, "inconsistently wound edge"),
            (self.degenerate_triangles, "degenerate triangle"),
            (self.zero_normals, "zero normal"),
            (self.duplicate_vertices, "duplicate vertices" if self.duplicate_vertices > 1 else "duplicate vertex"),
        ]
        said = [count_of(n, what) for n, what in faults if n]
        if self.inside_out:
            said.insert(0, "inside out")
        elif self.watertight:
            said.insert(0, "watertight")
        return ", ".join(said)


def count_of(number: int, thing: str) -> str:
    """ "1 edge", "2 edges"."""
    plural = thing if number == 1 or thing.endswith(("s", "ices")) else thing + "s"
    return f"{number} {plural}"


def weld_map(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merge exactly equal rows of float64 (V, N): positions, or positions with normals.

    Returns the kept row numbers (K,), in ascending order, and the new number of every row
    (V,), both int64.
    """
    # One 64-bit mix per row sorts ten times faster than rows do; equality is checked afterwards.
    bits = np.ascontiguousarray(rows + 0.0).view(np.uint64)  # + 0.0 turns -0 into 0
    mixed = np.zeros(len(rows), dtype=np.uint64)
    with np.errstate(over="ignore"):
        for column in range(bits.shape[1]):
            mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
            mixed ^= bits[:, column] * np.uint64(0x9E3779B97F4A7C15)
            mixed ^= mixed >> np.uint64(32)
    _, first, inverse = np.unique(mixed, return_index=True, return_inverse=True)
    if not (rows[first[inverse]] == rows).all():  # two different rows with one hash
        _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    rank = np.argsort(first)
    place = np.empty_like(rank)
    place[rank] = np.arange(len(rank))
    return first[rank], place[inverse.reshape(-1)]


def welded_corners(columns: Sequence[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
    """Vertices of triangles whose corners have several values: `columns`, (T, 3, n) each, with a row (V, n) for each
    different set of them, in their own type; and the vertices of the triangles, int64 (T, 3)."""
    flat = [column.reshape(-1, column.shape[-1]) for column in columns]
    kept, number = weld_map(np.hstack(flat).astype(np.float64))
    return [rows[kept] for rows in flat], number.reshape(-1, 3)


def seam_map(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As `weld_map` of positions (V, 3); borders of `triangles` (T, 3) that lie on each other but for rounding are
    merged too."""
    kept, number = weld_map(vertices)
    edges, uses = _edges(number[triangles])
    border = np.unique(edges[:, uses == 1])
    if len(border):
        # Places nearer than half a cell share one, in the grid or in one that is shifted by halves.
        cells = vertices[kept][border] / (2.0 * _SEAM * float(np.ptp(vertices, axis=0).max()) or 1.0)
        grids = [weld_map(np.floor(cells + 0.5 * np.array(shift))) for shift in np.ndindex(2, 2, 2)]
        first = np.concatenate([border[alone[group]] for alone, group in grids])
        used, place = np.unique(connected_roots(np.tile(border, 8), first, len(kept)), return_inverse=True)
        kept, number = kept[used], place[number]
    return kept, number


def _edges(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The edges of triangles (T, 3) by vertex number, int (2, E), and how many triangles use each (E,)."""
    ends = np.sort(np.stack([triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()]), axis=0)
    edges, uses = np.unique(ends[:, ends[0] != ends[1]], axis=1, return_counts=True)
    return edges, uses


def half_edges(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which half-edges 3 t + i (corner i to i + 1 of triangle t) lie on one edge: `order` (3 T,) with those of one edge
    in a row, `same` (3 T - 1,), where one is on the edge of the one before it; and vertices (T, 3), those at one
    position with one number."""
    vertex = weld_map(mesh.vertices)[1][mesh.triangles]
    start, end = vertex.ravel(), np.roll(vertex, -1, axis=1).ravel()
    key = np.minimum(start, end).astype(np.int64) * (int(vertex.max()) + 1) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    return order, key[order[1:]] == key[order[:-1]], vertex


def examine(mesh: Mesh) -> MeshHealth:
    """Count the faults of `mesh`, by vertex number (an unwelded closed mesh counts as open)."""
    triangles = mesh.triangles.astype(np.int64)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    size = len(mesh.vertices)
    low, high = np.minimum(start, end), np.maximum(start, end)
    real = low != high
    # The lowest bit keeps the direction, so one sort serves both questions.
    key = np.sort(((low * size + high) * 2 + (start > end))[real])
    edge = key >> 1
    first = np.flatnonzero(np.concatenate([[True], edge[1:] != edge[:-1]])) if len(edge) else np.zeros(0, int)
    uses = np.diff(np.append(first, len(edge)))
    pairs = first[uses == 2]
    degenerate = _degenerate(mesh)
    boundary, crowded = int((uses == 1).sum()), int((uses > 2).sum())
    inconsistent = int(((key[pairs] ^ key[pairs + 1]) & 1 == 0).sum())
    component = _components(triangles, size)
    # Tetrahedra with a common tip in the middle of the mesh (divergence theorem).
    apex = mesh.vertices[triangles[:, 0]] - 0.5 * np.add(*mesh.bounds())
    volumes = np.bincount(component, np.einsum("ij,ij->i", apex, mesh.area_vectors()) / 3.0)
    closed = not (boundary or crowded or inconsistent)
    return MeshHealth(
        triangles=len(triangles),
        boundary_edges=boundary,
        non_manifold_edges=crowded,
        inconsistent_edges=inconsistent,
        degenerate_triangles=int(degenerate.sum()),
        zero_normals=0 if mesh.corner_normals is None else int(_zero_normals(mesh.corner_normals).sum()),
        duplicate_vertices=size - len(weld_map(mesh.vertices)[0]),
        components=len(volumes),
        inward_components=int((volumes < 0.0).sum()) if closed else 0,
        signed_volume=float(volumes.sum()),
    )


def repair(mesh: Mesh, health: MeshHealth | None = None, solid: bool = True) -> tuple[Mesh, tuple[str, ...]]:
    """Mend what can be mended without a guess, and say in one sentence each what was done or assumed.

    Welds vertices at equal positions and seams that gape by rounding, drops triangles without area and doubles, winds
    neighbours one way, turns an inside-out solid, and replaces zero shading normals by the face's. Open and
    non-manifold meshes are kept, with a warning where the mesh is to be `solid` (a table may well be open). Raises
    UserError when nothing but degenerate triangles is left.
    """
    health = health or examine(mesh)
    notes: list[str] = []
    label = f"mesh '{mesh.name}'"
    if health.duplicate_vertices or health.boundary_edges:
        # No note: exporters split vertices for normals and texture coordinates as a matter of course.
        kept, number = seam_map(mesh.vertices, mesh.triangles)
        mesh = replace(mesh, vertices=mesh.vertices[kept], triangles=number[mesh.triangles].astype(np.int32))
        health = examine(mesh)
    if health.degenerate_triangles:
        mesh, dropped = _without_degenerate(mesh, health)
        if dropped:
            notes.append(f"{label}: {count_of(dropped, 'degenerate triangle')} dropped")
            health = examine(mesh)
    if health.zero_normals and mesh.corner_normals is not None:
        zero = _zero_normals(mesh.corner_normals)
        normals = np.where(zero[..., None], mesh.face_normals()[:, None], mesh.corner_normals)
        mesh = replace(mesh, corner_normals=normals)
        notes.append(f"{label}: {count_of(health.zero_normals, 'zero normal')} replaced by the face normal")
    if health.non_manifold_edges:
        mesh, dropped = _without_doubles(mesh)
        if dropped:
            notes.append(f"{label}: {count_of(dropped, 'triangle')} on the same corners as others dropped")
            health = examine(mesh)
    if health.inconsistent_edges:
        against = _against_the_largest(mesh) if mesh.is_flat else _against_neighbours(mesh)
        mesh = _turned(mesh, against)
        if against.any() and not mesh.is_flat:
            notes.append(f"{label}: {count_of(int(against.sum()), 'triangle')} turned to face as all others do")
        health = examine(mesh)
    if health.inside_out:
        mesh = mesh.flipped()
        mesh, _ = _with_agreeing_normals(mesh)
        notes.append(f"{label} was inside out (volume {health.signed_volume:.4g}); it was turned to face outward")
    elif health.inward_components:
        parts = f"{health.inward_components} of {health.components} parts"
        notes.append(f"{label}: {parts} face inward; they are taken as cavities")
    mesh, turned = _with_agreeing_normals(mesh)
    if turned:
        notes.append(f"{label}: its normals pointed away from its faces' outside; they were turned")
    notes += _warnings(label, health) if solid else []
    return make_mesh(
        mesh.name, mesh.vertices, mesh.triangles, mesh.corner_normals, mesh.uv, mesh.source, mesh.uv_unwraps
    ), tuple(notes)


def _against_the_largest(mesh: Mesh) -> np.ndarray:
    """Which triangles of a flat mesh face against its largest, bool (T,)."""
    normals = mesh.face_normals()
    return normals @ normals[int(np.argmax(mesh.areas()))] < 0.0


def _against_neighbours(mesh: Mesh) -> np.ndarray:
    """Which triangles to turn, bool (T,), so that neighbours across edges of two face one way: in each connected part
    those of less area; none in a part that has no two sides."""
    order, same, vertex = half_edges(mesh)
    follows, leads = np.append(same, False), np.append(False, same)
    one = np.flatnonzero(follows & ~leads & ~np.append(follows[1:], False))  # the first of two
    a, b = order[one], order[one + 1]
    start, count = vertex.ravel(), len(vertex)
    against = (start[a] == start[b]) * count
    # A graph of both ways to wind each triangle, t as it is and t + count turned.
    a, b = a // 3, b // 3
    root = connected_roots(np.append(a, a + count), np.append(b + against, b + count - against), 2 * count)
    as_it_is, other = root[:count], root[count:]
    part = np.minimum(as_it_is, other)
    second = as_it_is > other
    area = np.bincount(part, np.where(second, -1.0, 1.0) * mesh.areas(), 2 * count)[part]
    return np.where(area < 0.0, ~second, second) & (as_it_is != other)


def _turned(mesh: Mesh, which: np.ndarray) -> Mesh:
    """The mesh with the triangles `which`, bool (T,), wound the other way; their normals lie on their new outside."""
    other, rows = mesh.flipped(), which[:, None]
    normals = mesh.corner_normals
    if normals is not None:
        normals = np.where(rows[..., None], normals[:, ::-1], normals)
        against = np.einsum("tcj,tj->t", normals, other.area_vectors()) < 0.0
        normals = np.where((which & against)[:, None, None], -normals, normals)
    return replace(
        mesh,
        triangles=np.where(rows, other.triangles, mesh.triangles),
        corner_normals=normals,
        uv=None if mesh.uv is None or other.uv is None else np.where(rows[..., None], other.uv, mesh.uv),
    )


def forms_of(meshes: Sequence[Mesh]) -> list[str]:
    """What each surface is: "solid"; "sheet", which encloses nothing; or "part", where all open ones together do."""
    alone = [_is_open([mesh]) for mesh in meshes]
    together = any(alone) and _is_open([mesh for mesh, is_open in zip(meshes, alone, strict=True) if is_open])
    return ["solid" if not is_open else "sheet" if together else "part" for is_open in alone]


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """One repaired mesh of several, without texture coordinates."""
    first = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    normals = [
        mesh.face_normals()[:, None].repeat(3, 1) if mesh.corner_normals is None else mesh.corner_normals
        for mesh in meshes
    ]
    whole = make_mesh(
        meshes[0].name,
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, first, strict=False)]),
        None if all(mesh.corner_normals is None for mesh in meshes) else np.concatenate(normals),
        source=meshes[0].source,
    )
    return repair(whole, solid=False)[0]


def _is_open(meshes: Sequence[Mesh]) -> bool:
    """Whether borders are long for the area: of more than gaps."""
    sizes = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    triangles = np.concatenate([mesh.triangles + first for mesh, first in zip(meshes, sizes, strict=False)])
    kept, number = seam_map(vertices, triangles)
    edges, uses = _edges(number[triangles])
    border = float(np.linalg.norm(np.subtract(*vertices[kept][edges[:, uses == 1]]), axis=1).sum())
    return border**2 > float(sum(mesh.areas().sum() for mesh in meshes))


def warnings_of(mesh: Mesh) -> list[str]:
    """What makes a repaired mesh that is to be solid something else."""
    return _warnings(f"mesh '{mesh.name}'", examine(mesh))


def _warnings(label: str, health: MeshHealth) -> list[str]:
    assumed = "the side is decided by the face normals"
    warnings = []
    if health.boundary_edges:
        warnings.append(f"open {label}: {count_of(health.boundary_edges, 'boundary edge')}; {assumed}")
    if health.non_manifold_edges:
        count = count_of(health.non_manifold_edges, "edge")
        warnings.append(f"non-manifold {label}: {count} with more than two triangles; {assumed}")
    if health.inconsistent_edges:
        count = count_of(health.inconsistent_edges, "edge")
        warnings.append(f"inconsistently wound {label}: {count} where neighbours face opposite ways; {assumed}")
    return warnings


def _with_agreeing_normals(mesh: Mesh) -> tuple[Mesh, bool]:
    """Turn all shading normals when most oppose their face: the winding is the judge of sides."""
    if mesh.corner_normals is None:
        return mesh, False
    agreement = np.einsum("tcj,tj->t", mesh.corner_normals, mesh.area_vectors())
    if agreement.sum() >= 0.0:
        return mesh, False
    return replace(mesh, corner_normals=-mesh.corner_normals), True


def _degenerate(mesh: Mesh) -> np.ndarray:
    """Which triangles have no area, bool (T,)."""
    a, b, c = np.moveaxis(mesh.corners(), 1, 0)
    longest = np.max([np.einsum("ij,ij->i", e, e) for e in (b - a, c - b, a - c)], axis=0)
    return 2.0 * mesh.areas() <= _DEGENERATE * longest


def _zero_normals(corner_normals: np.ndarray) -> np.ndarray:
    """Which corner normals are zero, bool (T, 3)."""
    return (corner_normals == 0.0).all(axis=2)


def _without_degenerate(mesh: Mesh, health: MeshHealth) -> tuple[Mesh, int]:
    """Drop triangles without area.

    In a closed mesh one with three different vertices stays: it stitches a T-junction, and
    without it the mesh would be open by vertex number. It has no area for a ray to meet.
    """
    drop = _degenerate(mesh)
    if health.watertight:
        t = mesh.triangles
        drop &= (t[:, 0] == t[:, 1]) | (t[:, 1] == t[:, 2]) | (t[:, 2] == t[:, 0])
    if drop.all():
        raise UserError(f"{mesh.source or mesh.name}: every triangle is degenerate; export the mesh again")
    return _kept(mesh, ~drop), int(drop.sum())


def _without_doubles(mesh: Mesh) -> tuple[Mesh, int]:
    """Drop what lies on other triangles, where that leaves a watertight mesh, and count it.

    That is all but one of each group on the same corners, as of faces with two sides; or, of a group that faces both
    ways alike, all, as of a wall between two solids that touch, or of a fin.
    """
    corners = np.sort(mesh.triangles, axis=1)
    first, group = weld_map(corners.astype(np.float64))
    # The order of three corners from the lowest on: ascending to one side, descending to the other.
    lowest = np.argmin(mesh.triangles, axis=1)[:, None]
    second = np.take_along_axis(mesh.triangles, (lowest + 1) % 3, axis=1)[:, 0]
    excess = np.bincount(group, np.where(second == corners[:, 1], 1, -1))
    for kept in (first, first[excess != 0]):
        single = _kept(mesh, np.isin(np.arange(len(corners)), kept))
        if len(kept) and examine(single).watertight:
            return single, len(corners) - len(kept)
    return mesh, 0


def _kept(mesh: Mesh, keep: np.ndarray) -> Mesh:
    """The triangles `keep`, bool (T,), alone, with all vertices."""
    return replace(
        mesh,
        triangles=mesh.triangles[keep],
        corner_normals=None if mesh.corner_normals is None else mesh.corner_normals[keep],
        uv=None if mesh.uv is None else mesh.uv[keep],
    )


def _components(triangles: np.ndarray, size: int) -> np.ndarray:
    """Number of the connected part of each triangle, int (T,), from 0."""
    root = connected_roots(triangles[:, [0, 1]].ravel(), triangles[:, [1, 2]].ravel(), size)
    return np.unique(root[triangles[:, 0]], return_inverse=True)[1].reshape(-1)


def connected_roots(a: np.ndarray, b: np.ndarray, size: int) -> np.ndarray:
    """The lowest number in each node's connected part, int (size,), of the graph with edges (a, b)."""
    # Hook the higher root under the lower and shorten all paths, until both ends of every
    # edge agree; a few rounds, and no import of scipy for a small job.
    root = np.arange(size)
    while True:
        at_a, at_b = root[a], root[b]
        apart = at_a != at_b
        if not apart.any():
            return root
        a, b, at_a, at_b = a[apart], b[apart], at_a[apart], at_b[apart]
        np.minimum.at(root, np.maximum(at_a, at_b), np.minimum(at_a, at_b))
        while not np.array_equal(shorter := root[root], root):
            root = shorter
