"""Screen polygons of one convex flat solid in air, by a plain recursion in numpy: what tests of camera beams draw.

A beam is nine rays, of three places at three wavelengths, that are carried from facet to facet without asking whether
they hit it; where they do is what the edges say. Slow, short, and nothing in common with `app/beams`.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
from spectrasplat.beams.screen_polygons import ScreenPolygons
from spectrasplat.model.camera_rays import camera_frame
from spectrasplat.model.scene import Camera, Scene

STEP_PX = 4.0
"""Between the places whose rays make the columns."""


@dataclass
class _Facet:
    normal: np.ndarray
    corners: np.ndarray  # (K, 3), counter-clockwise from outside


@dataclass
class _Found:
    rows: list[dict] = field(default_factory=list)
    edges: list[np.ndarray] = field(default_factory=list)
    hulls: list[np.ndarray] = field(default_factory=list)


@dataclass
class _Beam:
    position: np.ndarray  # (3 places of the band, 3 rays, xyz)
    direction: np.ndarray
    throughput: np.ndarray  # (3,)
    polygons: list[np.ndarray]  # about the centre, one for each place of the band
    edges: np.ndarray  # (E, 6) about the centre
    depth: int = 0
    key: int = 0


def screen_polygons(
    scene: Scene,
    space,
    axis,
    width: int,
    height: int,
    *,
    solid: int = 0,
    bands: int = 1,
    threshold: float = 1e-3,
    cell_px: float = 32.0,
    max_depth: int = 24,
) -> ScreenPolygons:
    """Polygons of `scene.objects[solid]`; of those of less than `threshold` pixels times throughput, some that stand
    for all. `space`: the scene's `GpuSpace`; `axis`: its `SpectralAxis`."""
    item = scene.objects[solid]
    facets = _facets(item, space)
    found = _Found()
    for band in range(bands):
        x = (band + np.array([0.0, 0.5, 1.0])) / bands
        index = item.material.dispersion.index(axis.nm_of_x(x))
        for number, facet in enumerate(facets):
            for centre, beam in _first_beams(scene.camera, space, width, height, facet, cell_px):
                _follow(found, facets, number, beam, index, True, threshold, max_depth, (solid, x, centre))
    return _joined(found)


def _facets(item, space) -> list[_Facet]:
    """Faces of a convex mesh, coplanar triangles joined."""
    corners = space.to_gpu(item.mesh.transformed(item.object_to_world).corners())
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    planes: list[list[int]] = []
    for i, normal in enumerate(normals):
        for plane in planes:
            if normals[plane[0]] @ normal > 1.0 - 1e-9 and abs((corners[i, 0] - corners[plane[0], 0]) @ normal) < 1e-7:
                plane.append(i)
                break
        else:
            planes.append([i])
    facets = []
    for plane in planes:
        normal = normals[plane[0]]
        u = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        u /= np.linalg.norm(u)
        v = np.cross(normal, u)
        places = corners[plane].reshape(-1, 3)
        flat = _hull(np.column_stack([places @ u, places @ v]))
        height = places[0] @ normal
        facets.append(_Facet(normal, flat[:, :1] * u + flat[:, 1:] * v + height * normal))
    return facets


def _camera_rays(camera: Camera, space, width: int, height: int, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    right, up, forward = camera_frame(camera)
    x, y = 2.0 * places[:, :1] / width - 1.0, 1.0 - 2.0 * places[:, 1:] / height
    origin = space.to_gpu(np.array(camera.position, float))
    if camera.kind == "orthographic":
        half = 0.5 * camera.vertical_extent * space.scale
        return origin + half * (x * width / height * right + y * up), np.broadcast_to(forward, (len(places), 3)).copy()
    half = np.tan(np.radians(0.5 * camera.vertical_fov_deg))
    direction = forward + half * (x * width / height * right + y * up)
    return np.broadcast_to(origin, (len(places), 3)).copy(), direction / np.linalg.norm(direction, axis=1)[:, None]


def _to_pixels(camera: Camera, space, width: int, height: int, points: np.ndarray) -> np.ndarray:
    right, up, forward = camera_frame(camera)
    to = points - space.to_gpu(np.array(camera.position, float))
    if camera.kind == "orthographic":
        half = np.full(len(points), 0.5 * camera.vertical_extent * space.scale)
    else:
        half = np.tan(np.radians(0.5 * camera.vertical_fov_deg)) * (to @ forward)
    x, y = to @ right / (half * width / height), to @ up / half
    return np.column_stack([(x + 1.0) * 0.5 * width, (1.0 - y) * 0.5 * height])


def _first_beams(camera, space, width, height, facet, cell_px):
    """The part of the facet in each cell of the picture, where it is seen from outside."""
    outline = _to_pixels(camera, space, width, height, facet.corners)
    _, to = _camera_rays(camera, space, width, height, outline)
    if np.all(np.einsum("ij,j->i", to, facet.normal) >= -1e-9):
        return
    outline = _hull(outline)
    sides = [_line(a, b) for a, b in itertools.pairwise([*outline, outline[0]])]
    low, high = np.maximum(outline.min(0), 0.0), np.minimum(outline.max(0), [width, height])
    if np.any(low >= high):
        return
    first, last = np.floor(low / cell_px).astype(int), np.ceil(high / cell_px).astype(int)
    for i, j in itertools.product(range(first[0], last[0]), range(first[1], last[1])):
        a, b = np.array([i, j]) * cell_px, np.array([i + 1, j + 1]) * cell_px
        lines = [*sides, np.array([1.0, 0.0, -a[0]]), np.array([-1.0, 0.0, b[0]])]
        lines += [np.array([0.0, 1.0, -a[1]]), np.array([0.0, -1.0, b[1]])]
        polygon = np.array([[a[0], a[1]], [b[0], a[1]], [b[0], b[1]], [a[0], b[1]]])
        for line in lines:
            polygon = _clipped(polygon, line)
        if len(polygon) < 3:
            continue
        centre = 0.5 * (polygon.min(0) + polygon.max(0))
        step = np.array([[0.0, 0.0], [STEP_PX, 0.0], [0.0, STEP_PX]])
        origin, direction = _camera_rays(camera, space, width, height, centre + step)
        about = np.array([[*line[:2], line[2] + line[:2] @ centre] * 2 for line in lines])
        yield (
            centre,
            _Beam(np.stack([origin] * 3), np.stack([direction] * 3), np.ones(3), [polygon - centre] * 3, about, key=17),
        )


def _follow(found, facets, number, beam, index, outside, threshold, max_depth, about) -> None:
    """What becomes of a beam whose polygons are known to lie on facet `number`."""
    normal = facets[number].normal if outside else -facets[number].normal  # against the ray
    height = facets[number].corners[0] @ normal
    facing = beam.direction @ normal
    if np.any(facing > -1e-9):
        return
    position = beam.position + ((height - beam.position @ normal) / facing)[..., None] * beam.direction
    eta = (1.0 / index if outside else index)[:, None]
    sine2 = eta**2 * (1.0 - facing**2)
    reflectance = _fresnel(-facing[:, 0], eta[:, 0])
    key = (beam.key * 1000003 + 31 * number + 7) & 0xFFFFFFFF
    mirrored = beam.direction - 2.0 * facing[..., None] * normal
    bent = eta[..., None] * beam.direction - (eta * facing + np.sqrt(np.maximum(1.0 - sine2, 0.0)))[..., None] * normal
    children = [(mirrored, reflectance, outside, 2 * key)]
    if not np.any(sine2[1] >= 1.0):
        children.append(
            (bent / np.linalg.norm(bent, axis=-1, keepdims=True), 1.0 - reflectance, not outside, 2 * key + 1)
        )
    for direction, share, is_out, name in children:
        child = _Beam(
            position, direction, beam.throughput * share, beam.polygons, beam.edges, beam.depth + 1, name & 0xFFFFFFFF
        )
        if child.depth > max_depth or child.throughput.max() <= 0.0:
            continue
        if is_out:
            if _survives(child, threshold):
                _leave(found, child, about)
            continue
        for other, facet in enumerate(facets):
            if other == number:
                continue
            cut = _cut(child, facet)
            if cut is not None and _survives(cut, threshold):
                _follow(found, facets, other, cut, index, False, threshold, max_depth, about)


def _survives(beam: _Beam, threshold: float) -> bool:
    """Russian roulette, decided by the facets alone."""
    power = beam.throughput.max() * max(map(_area, beam.polygons))
    if power >= threshold:
        return True
    kept = (beam.key * 2654435761 % 2**32) / 2**32 < power / threshold
    if kept:
        beam.throughput = beam.throughput * threshold / power
    return kept


def _cut(beam: _Beam, facet: _Facet) -> _Beam | None:
    """The part of a beam inside the solid that reaches the facet."""
    facing = beam.direction @ facet.normal
    if np.any(facing < 1e-6):
        return None
    height = facet.corners[0] @ facet.normal
    at = beam.position + ((height - beam.position @ facet.normal) / facing)[..., None] * beam.direction
    polygons, edges = beam.polygons, list(beam.edges)
    for a, b in itertools.pairwise([*facet.corners, facet.corners[0]]):
        inward = np.cross(facet.normal, b - a)
        values = (at - a) @ inward  # (3, 3 rays)
        lines = np.column_stack(
            [(values[:, 1] - values[:, 0]) / STEP_PX, (values[:, 2] - values[:, 0]) / STEP_PX, values[:, 0]]
        )
        lines /= np.maximum(np.linalg.norm(lines[:, :2], axis=1, keepdims=True), 1e-30)
        # What is linear between both ends decides, in the middle too.
        lines[1] = 0.5 * (lines[0] + lines[2])
        clipped = [_clipped(polygon, line) for polygon, line in zip(polygons, lines, strict=True)]
        if all(len(polygon) < 3 for polygon in clipped):
            return None
        # Those that do not cut stay out: most of them.
        if any(
            len(polygon) and np.any(polygon @ line[:2] + line[2] < 0.0)
            for polygon, line in zip(polygons, lines, strict=True)
        ):
            edges.append(np.concatenate([lines[0], lines[2]]))
        polygons = clipped
    return _Beam(beam.position, beam.direction, beam.throughput, polygons, np.array(edges), beam.depth, beam.key)


def _leave(found: _Found, beam: _Beam, about) -> None:
    solid, x, centre = about
    hull = _hull(np.concatenate([polygon for polygon in beam.polygons if len(polygon)]))
    if len(hull) < 3:
        return

    def columns(rays: np.ndarray) -> np.ndarray:
        return np.stack([rays[:, 0], (rays[:, 1] - rays[:, 0]) / STEP_PX, (rays[:, 2] - rays[:, 0]) / STEP_PX], axis=1)

    found.rows.append(
        {
            "is_handed": False,
            "source": solid,
            "depth": beam.depth,
            "key": beam.key,
            "x_lo": x[0],
            "x_hi": x[2],
            "centre": centre,
            "position": columns(beam.position),
            "direction": columns(beam.direction),
            "throughput": beam.throughput,
            "slope": np.zeros(2),
            "last_triangle": 0,
            "last_object": solid,
            "is_inside": False,
            "inside": 0,
            "state": np.zeros((3, 6)),
        }
    )
    # An edge that others leave nothing to cut is no edge.
    cuts = [np.min(hull @ beam.edges[:, k : k + 2].T + beam.edges[:, k + 2], axis=0) < 1e-6 for k in (0, 3)]
    edges = beam.edges[cuts[0] | cuts[1]]
    edges[:, 2] -= edges[:, :2] @ centre
    edges[:, 5] -= edges[:, 3:5] @ centre
    found.edges.append(edges)
    found.hulls.append(hull + centre)


def _joined(found: _Found) -> ScreenPolygons:
    kinds = {"is_handed": bool, "is_inside": bool, "key": np.uint32, "inside": np.uint64}
    kinds |= dict.fromkeys(("source", "depth", "last_triangle", "last_object"), np.int32)
    shapes = {
        "centre": (2,),
        "position": (3, 3, 3),
        "direction": (3, 3, 3),
        "throughput": (3,),
        "slope": (2,),
        "state": (3, 6),
    }
    names = [n for n in ScreenPolygons.__dataclass_fields__ if n not in ("edges", "hulls", "edge_start", "hull_start")]
    values = {
        name: np.array([row[name] for row in found.rows], kinds.get(name, float)).reshape(-1, *shapes.get(name, ()))
        for name in names
    }
    for name, lists, width in (("edge", found.edges, 6), ("hull", found.hulls, 2)):
        values[f"{name}_start"] = np.cumsum([0, *map(len, lists)]).astype(np.int32)
        values[f"{name}s"] = np.concatenate(lists) if lists else np.zeros((0, width))
    return ScreenPolygons(**values)


def _fresnel(cosine: np.ndarray, eta: np.ndarray) -> np.ndarray:
    """Reflectance of unpolarised light, eta = n_i / n_t."""
    sine2 = eta**2 * (1.0 - cosine**2)
    other = np.sqrt(np.maximum(1.0 - sine2, 0.0))
    s = (eta * cosine - other) / (eta * cosine + other)
    p = (cosine - eta * other) / (cosine + eta * other)
    return np.where(sine2 >= 1.0, 1.0, 0.5 * (s**2 + p**2))


def _line(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The line through two neighbouring corners of a counter-clockwise polygon, inside on its left."""
    normal = np.array([a[1] - b[1], b[0] - a[0]])
    normal /= np.linalg.norm(normal)
    return np.array([*normal, -normal @ a])


def _area(polygon: np.ndarray) -> float:
    if len(polygon) < 3:
        return 0.0
    x, y = polygon.T
    return 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _clipped(polygon: np.ndarray, line: np.ndarray) -> np.ndarray:
    if not len(polygon):
        return polygon
    height = polygon @ line[:2] + line[2]
    kept = []
    for i in range(len(polygon)):
        k = (i + 1) % len(polygon)
        if height[i] >= 0.0:
            kept.append(polygon[i])
        if (height[i] >= 0.0) != (height[k] >= 0.0):
            share = height[i] / (height[i] - height[k])
            kept.append(polygon[i] + share * (polygon[k] - polygon[i]))
    return np.array(kept).reshape(-1, 2)


def _hull(points: np.ndarray) -> np.ndarray:
    """Convex hull (Andrew's monotone chain), counter-clockwise."""
    points = np.unique(np.round(points, 12), axis=0)
    if len(points) < 3:
        return points
    sides = []
    for ordered in (points, points[::-1]):
        chain: list[np.ndarray] = []
        for point in ordered:
            while len(chain) > 1:
                a, b = chain[-1] - chain[-2], point - chain[-2]
                if a[0] * b[1] - a[1] * b[0] > 1e-12:
                    break
                chain.pop()
            chain.append(point)
        sides += chain[:-1]
    return np.array(sides)
