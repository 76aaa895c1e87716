"""The scene's lights as sources of beams: parallel ones and points; extended ones as several, each a part of them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..model.geometry.mesh import Mesh
from ..model.lights.light import Light
from ..model.optics.spectral_tables import SpectralAxis, cumulative
from ..model.optics.spectrum import Spectrum
from ..model.tint_bands import cut_by_tints, ends_of
from .facets import BLACK, SAMPLES, BeamScene
from .find import Emission
from .rays import PARALLEL, POINT, SOURCE

RIM = 64
"""Corners of the polygon that represents a round aperture or a cone, of the same area: its sides are at most 0.04 % of
the radius inside of the circle, its corners 0.08 % outside."""
_WIDEST = math.tan(math.radians(75.0))
"""Half side of a gnomonic plane up to which one is enough, turned anyhow."""
_WIDEST_ALONG = 100.0
"""Half side of one along a facet, in tiles; beyond, the six sides of a cube are taken."""
_NEAREST = 1.65
"""Least distance of a facet, in half extents of an extended lamp: from nearer ones penumbrae are wider than what casts
them, and more would be drawn than lands."""
_MOST_BANDS = 32
"""Bands into which a light's spectrum is cut where something is coloured, at most."""
_FEW = 8
"""Points of a rectangle that may lie in one row."""
_ON_FACET = 2e-7
"""GPU units: a light as near to a facet is on it (START_DISTANCE of shaders/lib/intersect.glsl)."""
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))


def why_no_beams(light: Light) -> str | None:
    """Why a light's beams cannot be followed; None: they can."""
    if light.emission == "profile":
        return "its intensity is a table over directions"
    return None


def is_near_facets(light: Light, scene: BeamScene, to_gpu: Callable[[np.ndarray], np.ndarray], unit: float) -> bool:
    """Whether an extended lamp is so near to the facets of beams that penumbrae, or the seams of a cube about it, would
    draw more than lands: photons carry its light. Arguments as of `emissions`."""
    if light.is_parallel or not light.has_outline:
        return False
    place, reach = to_gpu(np.array(light.position)), max(light.half_extent) * unit
    facets = [f for f in scene.facets[scene.facets["kind"] < BLACK] if int(f["owner"]) in scene.beam_objects]
    if any(distance_to(place, f["corner"][: f["corners"]]) < _NEAREST * reach for f in facets):
        return True
    corners = _specular_corners(scene)
    edges = reach * light.axes()[:, :2].T
    return any(len(_charts(place + edge, corners)) > 1 for edge in (*edges, *-edges))


def distance_to(place: np.ndarray, corners: np.ndarray) -> float:
    """From a point to a flat convex polygon (n, 3)."""
    starts = corners - place
    along = np.roll(starts, -1, axis=0) - starts
    normal = np.cross(along[0], along[1])
    if np.all(np.cross(along, -starts) @ normal >= 0.0):
        return abs(float(starts[0] @ normal)) / float(np.linalg.norm(normal))
    share = -np.einsum("ij,ij->i", starts, along) / np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
    return float(np.linalg.norm(starts + np.clip(share, 0.0, 1.0)[:, None] * along, axis=1).min())


def emissions(
    light: Light,
    scene: BeamScene,
    to_gpu: Callable[[np.ndarray], np.ndarray],
    unit: float,
    axis: SpectralAxis,
    parts: int,
    inside: int = 0,
    bins: int | None = None,
) -> list[Emission]:
    """`light` as sources; an extended one as about `parts` of equal power. `to_gpu`: scene to GPU space, `unit`: GPU
    units a scene unit; `inside`: mask of the solids that the light is in; `bins`: spectral bins that are kept."""
    corners = _specular_corners(scene)
    if not len(corners):
        return []
    # Lines are followed by themselves.
    smooth = cumulative(axis, Spectrum(light.spectral_power.density)).at(np.linspace(0.0, 1.0, SAMPLES))
    whole = cumulative(axis, light.spectral_power).at(1.0)
    lines = [float(axis.x_of_nm(nm)) for nm, _ in light.spectral_power.lines]
    shares = [float(watts) for _, watts in light.spectral_power.lines]
    total = sum(shares) + float(np.sum(light.spectral_power.density))
    common = {
        "power": _importance(smooth, whole),
        "watts": smooth[:, 3] / max(float(whole[3]), 1e-300),
        "lines": tuple(lines),
        "line_shares": tuple(s / total for s in shares),
        "is_continuous": bool(np.any(light.spectral_power.density > 0.0)),
        "edges": colour_edges(scene, Spectrum(light.spectral_power.density), axis, bins),
        "mask": inside,
    }
    make = _parallel if light.is_parallel else _diverging
    facets = scene.facets[scene.facets["kind"] < BLACK]
    return make(light, corners, facets["plane"][np.argmax(facets["radius"]), :3], to_gpu, unit, parts, common)


def colour_edges(scene: BeamScene, light: Spectrum, axis: SpectralAxis, bins: int | None = None) -> tuple[float, ...]:
    """x between which three weights a beam follow what absorbs and what is coloured, also within each of `bins`."""
    return tuple(cut_by_tints(ends_of(light, axis), 1, _MOST_BANDS, scene.tints, light, axis, bins=bins).tolist())


def _specular_corners(scene: BeamScene) -> np.ndarray:
    facets = scene.facets[scene.facets["kind"] < BLACK]
    return np.concatenate([f["corner"][: f["corners"]] for f in facets]) if len(facets) else np.zeros((0, 3))


def _importance(smooth: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Half by brightness, half by power, so that bins where the eye sees little are sampled too."""
    return 0.5 * smooth[:, 1] / max(float(whole[1]), 1e-300) + 0.5 * smooth[:, 3] / max(float(whole[3]), 1e-300)


def _parallel(light, corners, _, to_gpu, unit, parts, common) -> list[Emission]:
    right, up, forward = light.axes().T
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    reach = float(np.linalg.norm(corners - middle, axis=1).max())
    limits = np.zeros((0, 3))
    if light.has_place:
        at = (to_gpu(np.array(light.position)) - middle) @ np.stack([right, up]).T
        half = np.array(light.half_extent) * unit
        limits = _disc(at, float(half[0])) if light.is_disc else _rectangle(at, half)
        back = float((middle - to_gpu(np.array(light.position))) @ forward)
    else:
        back = 4.0 * reach + 1e3
    tangent = math.tan(light.angular_radius)
    places = _places(parts if light.has_extent else 1) * tangent
    result = []
    for u, v in places:
        tilted = forward + u * right + v * up
        tilted /= np.linalg.norm(tilted)
        spread = tangent / math.sqrt(len(places)) if tangent > 0.0 else 0.0
        source = _source(PARALLEL, middle - back * tilted, tilted, right, up)
        neighbours = tuple(
            _source(PARALLEL, middle - back * _unit(tilted + w), _unit(tilted + w), right, up)
            for w in (spread * right, spread * up)
        )
        grow = 1.0 + math.hypot(u, v)
        room = np.array([0.0, 0.0, 1.05 * reach * grow])
        density = 1.0 / unit**2 / len(places)
        shifted = neighbours if spread else ()
        result.append(Emission(source, limits, room, density=density, shifted=shifted, **common))
    return result


def _diverging(light, corners, along, to_gpu, unit, parts, common) -> list[Emission]:
    origin = to_gpu(np.array(light.position))
    direction = light.axes()[:, 2]
    is_area = light.has_outline
    offsets, measure = np.zeros((1, 3)), 1.0
    spread: tuple[np.ndarray, ...] = ()
    if is_area:
        edge_u, edge_v, _ = light.axes().T
        half = np.array(light.half_extent) * unit
        if light.is_disc:
            places, cell = _places(parts), half / math.sqrt(parts)
        else:
            places, cell = _grid(parts, half)
        offsets = places[:, :1] * half[0] * edge_u + places[:, 1:] * half[1] * edge_v
        measure = light.area / len(offsets)
        spread = (edge_u * cell[0], edge_v * cell[1])
    result = []
    for offset in offsets:
        place = origin + offset
        for forward, right, up, room in _charts(place, corners, along):
            limits = _cone(light, direction, forward, right, up)
            if limits is None:
                continue
            if is_area:
                limits = np.concatenate([limits, [_line_of(direction, forward, right, up)]])
            axes, shape = (right, up), (direction, light.cone, is_area)
            source = _source(POINT, place, forward, *axes, *shape)
            # The same q leads to the same place at the distance of the glass, about which rays are straight.
            depth = (corners - place) @ forward
            ahead = float(depth[depth > 0.0].mean()) if (depth > 0.0).any() else math.inf
            shifted = tuple(_source(POINT, place + s, forward - s / ahead, *axes, *shape) for s in spread)
            result.append(Emission(source, limits, room, density=measure, shifted=shifted, **common))
    return result


def _charts(place, corners, along=None):
    """Gnomonic planes that hold all corners as seen from a place: one, or the sides of a cube. Where the former would
    be wide it is across `along`, if given, the normal of a facet: rays that meet that one are affine."""
    towards = 0.5 * (corners.min(axis=0) + corners.max(axis=0)) - place
    distance = float(np.linalg.norm(towards))
    ways = [] if distance <= 1e-9 else [(towards / distance, _WIDEST)]
    if along is not None:
        ways.append((along * np.sign(along @ towards), _WIDEST_ALONG))
    for forward, widest in ways:
        depth = (corners - place) @ forward
        if depth.min() > 0.0:
            right = _unit(np.cross(forward, np.eye(3)[np.argmin(np.abs(forward))]))
            up = np.cross(forward, right)
            flat = np.column_stack([(corners - place) @ right, (corners - place) @ up]) / depth[:, None]
            if np.abs(flat).max() <= widest:
                low, high = flat.min(axis=0), flat.max(axis=0)
                half = 0.5 * float((high - low).max())
                u, v = 0.5 * (low + high)
                whole = float(u), float(v), 1.02 * half + 1e-9
                rooms = _tiles(*whole) if widest > _WIDEST else [whole]
                return [(forward, right, up, np.array(room)) for room in rooms]
    square = np.array([0.0, 0.0, 1.0])
    eye = np.eye(3)
    return [
        (sign * eye[k], eye[(k + 1) % 3], sign * eye[(k + 2) % 3], square) for k in range(3) for sign in (1.0, -1.0)
    ]


def _tiles(u, v, half):
    """A square of a wide gnomonic plane as squares (u, v, half side) that a light falls on nearly evenly."""
    if half <= 0.5 * math.hypot(1.0, max(abs(u) - half, 0.0), max(abs(v) - half, 0.0)):
        return [(u, v, half)]
    part = 0.5 * half
    return [tile for x in (u - part, u + part) for y in (v - part, v + part) for tile in _tiles(x, y, part)]


def _line_of(normal, forward, right, up):
    """normal . direction >= 0 on a gnomonic plane."""
    return np.array([normal @ forward, normal @ right, normal @ up])


def _cone(light, direction, forward, right, up) -> np.ndarray | None:
    """Half-planes of a spot's cone on a gnomonic plane; None: the plane is all outside."""
    outer = light.cone[1]
    if outer >= math.pi:
        return np.zeros((0, 3))
    if outer > math.radians(85.0):
        return np.array([_line_of(direction, forward, right, up)])
    # Planes through the tip that touch the polygon of the cone's own area at its sides.
    first = _unit(np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))]))
    second = np.cross(direction, first)
    step = 2.0 * math.pi / RIM
    rim = math.tan(outer) * math.sqrt(step / math.sin(step))
    turn = step * np.arange(RIM)
    corners = direction + rim * (np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second)
    normals = np.cross(corners, np.roll(corners, -1, axis=0))
    normals *= np.sign(normals @ direction)[:, None]
    return np.stack([_line_of(n / np.linalg.norm(n), forward, right, up) for n in normals])


def _disc(at: np.ndarray, radius: float) -> np.ndarray:
    step = 2.0 * math.pi / RIM
    inner = radius * math.sqrt(step / math.sin(step)) * math.cos(0.5 * step)
    turn = step * np.arange(RIM)
    normals = -np.column_stack([np.cos(turn), np.sin(turn)])
    return np.column_stack([inner - normals @ at, normals])


def _rectangle(at: np.ndarray, half: np.ndarray) -> np.ndarray:
    normals = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    return np.column_stack([half[[0, 0, 1, 1]] - normals @ at, normals])


def _places(count: int) -> np.ndarray:
    """Points (count, 2) that share the unit disc evenly: Vogel's spiral (1979), moved and stretched so that its mean is
    the disc's middle and its variance, with that of a disc of 1/count of the area about each point (`soften`), is the
    disc's own, 1/4 along every axis. Otherwise few points would shift what a lamp lights, and blur it unevenly."""
    k = np.arange(count) + 0.5
    places = np.sqrt(k / count)[:, None] * np.column_stack([np.cos(_GOLDEN * k), np.sin(_GOLDEN * k)])
    places -= places.mean(axis=0)
    if count < 3:  # in one line: no variance across
        return places
    variance, axes = np.linalg.eigh(places.T @ places / count)
    return places @ (axes * np.sqrt(0.25 * (1.0 - 1.0 / count) / variance)) @ axes.T


def _grid(count: int, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middles (n, 2), in [-1, 1]², of about `count` cells, as nearly square as can be, of a rectangle with half sides
    `half` (2,); and the radii (2,) of a disc with a cell's variances. A strip has two rows, since penumbrae of one are
    not as deep as it is wide where its edges lie aslant."""
    rows = 1 if count < _FEW else 2
    across = min(max(rows, round(math.sqrt(count * half[0] / half[1]))), count // rows)
    cells = np.array([across, max(1, round(count / across))])
    u, v = np.meshgrid(*((2.0 * np.arange(n) + 1.0) / n - 1.0 for n in cells))
    return np.column_stack([u.ravel(), v.ravel()]), 2.0 / math.sqrt(3.0) * half / cells


def _source(kind, origin, forward, right, up, axis=None, cone=(4.0, 4.0), lambert=False) -> np.ndarray:
    record = np.zeros(1, SOURCE)
    record["kind"], record["origin"], record["forward"] = kind, origin, forward
    record["right"], record["up"] = right, up
    record["axis"], record["cone"], record["lambert"] = forward if axis is None else axis, cone, lambert
    return record


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def _is_within(facet: np.ndarray, point: np.ndarray) -> bool:
    """Whether a point (3,) of a facet's plane is within its edges."""
    corners = facet["corner"][: facet["corners"]]
    along = np.roll(corners, -1, axis=0) - corners
    return bool((np.cross(along, point - corners) @ facet["plane"][:3] >= 0.0).all())


def mask_at(point: np.ndarray, scene: BeamScene, meshes: list[Mesh]) -> int:
    """Solids that a point in GPU space is in: those whose facets some line from it crosses an odd number of times.
    What is on a facet is outside: from there light enters."""
    mask = 0
    towards = _unit(np.array([0.3713, 0.5471, 0.7502]))
    for solid in scene.solids[: len(meshes)]:
        if solid["bit"] < 0:
            continue
        crossings, lies_on = 0, False
        for facet in scene.facets[solid["first"] : solid["last"]]:
            facing = facet["plane"][:3] @ towards
            height = facet["plane"][3] - facet["plane"][:3] @ point
            lies_on = lies_on or (abs(height) <= _ON_FACET and _is_within(facet, point))
            if abs(facing) < 1e-12:
                continue
            t = height / facing
            crossings += bool(t > 0.0 and _is_within(facet, point + t * towards))
        mask |= (0 if lies_on else crossings & 1) << int(solid["bit"])
    return mask
