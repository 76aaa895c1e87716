"""What the rays of a reference can meet, gathered from a scene's objects: triangles, and curved surfaces where known.

A mesh with a recipe (`geometry.mesh`) is met as the surface that it names, a sphere, an ellipsoid, a lens, half a
lens, a torus or a solid of revolution: tessellation is then an error of the renderer, which is measured, and no part
of the truth. Everything else, what shows a picture (whose place is known on triangles only), and all of
`as_triangles(scene)` is met as triangles.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..model.geometry import primitives
from ..model.geometry.mesh import Mesh
from ..model.geometry.primitives_lens import vertices_of
from ..model.geometry.primitives_round import in_rows, profile_with_normals
from ..model.scene import Scene, SceneObject

QUADRIC, TORUS = 0.0, 1.0
FORM_SIZE = 32
"""Numbers of a surface; these columns of them:"""
TO_LOCAL = 0
"""Twelve: rows of the matrix from the reference's frame into the surface's own."""
KIND = 12
COEFFICIENTS = 13
"""a, b, c, d; of a torus the radius of the circle that its tube follows, and the tube's."""
RANGE = 17
"""Lowest and highest z, least and largest x² + y² of the part that is there."""
SHEET = 21
"""e, f: only where e + f z >= 0. A hyperboloid and a cone have a second half."""
OUTWARD = 23
"""1 where the gradient points outward, else −1."""
TURNS = 24
"""1 where normals turn along a profile: from the (radial, z) of the next two numbers to that of the two after them, as
1 − w to w with w = the last three · (1, radius, z)."""
_SLACK = 1e-10
"""Share of a surface's size by which neighbours overlap, so that no ray slips between them."""


class Piece(NamedTuple):
    """One smooth part of an object, in the object's own frame."""

    form: np.ndarray
    """float64 (`FORM_SIZE`,)."""
    low: np.ndarray
    """float64 (3,): of the box round it."""
    high: np.ndarray


def pieces(item: SceneObject) -> list[Piece]:
    """The smooth parts that make up the object's true surface; none where only its triangles are known."""
    recipe = item.mesh.recipe
    if recipe is None or item.material.texture is not None:
        return []
    make = _SHAPES.get(recipe.get("shape", ""))
    if make is None:
        return []
    function = getattr(primitives, _FUNCTIONS.get(recipe["shape"], recipe["shape"]))
    bound = inspect.signature(function).bind(**{key: value for key, value in recipe.items() if key != "shape"})
    bound.apply_defaults()
    return list(make(bound.arguments))


def placed(piece: Piece, object_to_world: np.ndarray, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(form in the frame about world position `origin` (3,), the corners (8, 3) of the box there)."""
    matrix = object_to_world.copy()
    matrix[:3, 3] -= origin
    form = piece.form.copy()
    own = np.vstack([form[TO_LOCAL : TO_LOCAL + 12].reshape(3, 4), (0.0, 0.0, 0.0, 1.0)])
    form[TO_LOCAL : TO_LOCAL + 12] = (own @ np.linalg.inv(matrix))[:3].ravel()
    ends = np.stack([piece.low, piece.high])
    corners = np.array([(ends[i, 0], ends[j, 1], ends[k, 2]) for i in range(2) for j in range(2) for k in range(2)])
    return form, corners @ matrix[:3, :3].T + matrix[:3, 3]


def as_triangles(scene: Scene) -> Scene:
    """The scene with meshes without recipes: its reference meets the renderer's triangles."""
    bare: dict[Mesh, Mesh] = {}
    for item in scene.objects:
        bare.setdefault(item.mesh, replace(item.mesh))
    return replace(scene, objects=tuple(replace(item, mesh=bare[item.mesh]) for item in scene.objects))


def description(scene: Scene) -> str:
    """What a reference of the scene depends on beside its triangles."""
    exact = {i: dict(item.mesh.recipe or {}) for i, item in enumerate(scene.objects) if pieces(item)}
    return repr({i: sorted(recipe.items()) for i, recipe in exact.items()})


def _form(
    kind: float,
    coefficients: tuple[float, ...],
    *,
    middle: tuple[float, float, float] = (0.0, 0.0, 0.0),
    axes: tuple[float, ...] = (1.0, 1.0, 1.0),
    reach: tuple[float, float, float, float] = (-np.inf, np.inf, -np.inf, np.inf),
    sheet: tuple[float, float] = (0.0, 0.0),
    outward: float = 1.0,
) -> np.ndarray:
    """`middle`: of the surface's own frame, whose axes are those of the object, each stretched by one of `axes`."""
    form = np.zeros(FORM_SIZE)
    form[TO_LOCAL : TO_LOCAL + 12] = np.column_stack(
        [np.diag(1.0 / np.array(axes)), -np.array(middle) / np.array(axes)]
    ).ravel()
    form[KIND], form[OUTWARD] = kind, outward
    form[COEFFICIENTS : COEFFICIENTS + len(coefficients)] = coefficients
    form[RANGE : RANGE + 4], form[SHEET : SHEET + 2] = reach, sheet
    return form


def _sphere(shape: dict[str, Any]) -> Iterator[Piece]:
    axes = np.array(shape["semi_axes"] if "semi_axes" in shape else [shape["radius"]] * 3, float)
    yield Piece(_form(QUADRIC, (1.0, 1.0, 0.0, -1.0), axes=tuple(axes)), -axes, axes)


def _torus(shape: dict[str, Any]) -> Iterator[Piece]:
    major, minor = float(shape["major_radius"]), float(shape["minor_radius"])
    high = np.array([major + minor, major + minor, minor])
    yield Piece(_form(TORUS, (major, minor)), -high, high)


def _lens(shape: dict[str, Any]) -> Iterator[Piece]:
    low, high = vertices_of(shape["thickness"], shape["front"])
    first = (low, shape["radius1"], shape["conic1"])
    second = (high, shape["radius2"], shape["conic2"])
    return _between(first, second, 0.5 * float(shape["diameter"]))


def _between(first: tuple[float, float, float], second: tuple[float, float, float], aperture: float) -> Iterator[Piece]:
    """Two caps, each (vertex z, signed radius, conic constant), and the rim where there is one.

    A cap is c r² + c (1 + k) ζ² − 2 ζ = 0 about its vertex, and of its two halves the one where 1 − (1 + k) c ζ > 0
    (Born and Wolf, Principles of Optics, §4.4).
    """
    rims = []
    for (vertex, radius, conic), outward in ((first, 1.0), (second, -1.0)):
        c = 0.0 if np.isinf(radius) else 1.0 / float(radius)
        root = np.sqrt(max(0.0, 1.0 - (1.0 + conic) * (c * aperture) ** 2))
        sag = c * aperture**2 / (1.0 + root)
        rims.append(vertex + sag)
        form = _form(
            QUADRIC,
            (c, c * (1.0 + conic), -2.0, 0.0),
            middle=(0.0, 0.0, vertex),
            # A hemisphere ends where its halves meet.
            reach=(-np.inf, np.inf, -np.inf, (aperture * (1.0 + _SLACK)) ** 2),
            sheet=(1.0 + _SLACK, -(1.0 + conic) * c),
            outward=outward,
        )
        low = np.array([-aperture, -aperture, vertex + min(sag, 0.0)])
        yield Piece(form, low, np.array([aperture, aperture, vertex + max(sag, 0.0)]))
    if rims[1] - rims[0] > 1e-12 * aperture:
        yield _band((aperture, rims[0]), (aperture, rims[1]))


def _revolution(shape: dict[str, Any]) -> Iterator[Piece]:
    points, start, end, loop = profile_with_normals(shape["profile"], float(shape["crease_deg"]))
    # Where normals turn along the profile, they do from row to row, as the mesh's corners have them.
    points, start, end = in_rows(points, start, end, loop)
    following = np.roll(points, -1, axis=0)[: None if loop else -1]
    for a, b, normal_a, normal_b in zip(points, following, start, end, strict=False):
        yield _band(a, b, normal_a, normal_b)


def _band(
    a: tuple[float, float] | np.ndarray,
    b: tuple[float, float] | np.ndarray,
    start: np.ndarray | None = None,
    end: np.ndarray | None = None,
) -> Piece:
    """What a segment from (radius, z) `a` to `b` sweeps about z: a cone, a cylinder or a disc, the solid on its left.

    With n its normal, it is (n_r r)² = (n_r r_a − n_z ζ)², ζ from a's height. `start`, `end`: normals that the mesh's
    corners have there, for profiles that are smooth.
    """
    (ra, za), (rb, zb) = (float(v) for v in a), (float(v) for v in b)
    length = float(np.hypot(rb - ra, zb - za))
    nr, nz = (zb - za) / length, -(rb - ra) / length
    largest = max(ra, rb)
    slack = _SLACK * max(largest, length)
    reach = (
        min(0.0, zb - za) - slack,
        max(0.0, zb - za) + slack,
        max(min(ra, rb) - slack, 0.0) ** 2 if nz != 0.0 else -np.inf,
        (largest + slack) ** 2,
    )
    if nr == 0.0:
        quadric, outward, sheet = (0.0, 0.0, 1.0, 0.0), np.sign(nz), (0.0, 0.0)
    else:
        quadric, outward = (nr * nr, -nz * nz, 2.0 * nr * nz * ra, -((nr * ra) ** 2)), np.sign(nr)
        sheet = (abs(nr) * ra + slack, -np.sign(nr) * nz)
    form = _form(QUADRIC, quadric, middle=(0.0, 0.0, za), reach=reach, sheet=sheet, outward=outward)
    flat = np.array([nr, nz])
    if start is not None and end is not None and not (np.allclose(start, flat) and np.allclose(end, flat)):
        form[TURNS] = 1.0
        form[TURNS + 1 : TURNS + 5] = (*start, *end)
        # The share of the way from a to b.
        form[TURNS + 5 :] = -ra * (rb - ra) / length**2, (rb - ra) / length**2, (zb - za) / length**2
    low = np.array([-largest, -largest, min(za, zb)])
    return Piece(form, low, np.array([largest, largest, max(za, zb)]))


_FUNCTIONS = {"revolution": "solid_of_revolution"}
_SHAPES: dict[str, Callable[[dict[str, Any]], Iterator[Piece]]] = {
    "sphere": _sphere,
    "ellipsoid": _sphere,
    "lens": _lens,
    "torus": _torus,
    "revolution": _revolution,
}


class Surfaces:
    """T surfaces, added object by object; their frame is the world's about one position."""

    def __init__(self) -> None:
        self._corners: list[np.ndarray] = []
        self._rows: list[np.ndarray] = []
        self._forms: list[np.ndarray] = []
        self._normals: list[np.ndarray] = []
        self._corner_normals: list[np.ndarray] = []

    def add(self, index: int, item: SceneObject, mesh: Mesh, centre: np.ndarray) -> None:
        """Object number `index`, with its `mesh` in the world: as curved surfaces where these are known."""
        exact = [placed(piece, item.object_to_world, centre) for piece in pieces(item)]
        count = len(exact) or len(mesh.triangles)
        rows = np.full((count, 3), -1, np.int32)
        rows[:, 0] = index
        smooth = None
        if exact:
            boxes = np.array([(box.min(axis=0), box.max(axis=0)) for _, box in exact])
            rows[:, 2] = len(self._forms) + np.arange(count)
            self._forms += [form for form, _ in exact]
            self._corners.append(np.stack([boxes[:, 0], boxes[:, 1], boxes.mean(axis=1)], axis=1))
            self._normals.append(np.zeros((count, 3)))
        else:
            rows[:, 1] = np.arange(count)
            self._corners.append(mesh.corners() - centre)
            self._normals.append(mesh.face_normals())
            smooth = mesh.corner_normals if item.material.is_specular else None
        self._corner_normals.append(np.zeros((count, 3, 3)) if smooth is None else smooth)
        self._rows.append(rows)

    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Corners (T, 3, 3), of a curved surface those of its box; and int32 (T,) each: object, triangle of its mesh
        (-1: curved), row of `forms` (-1: triangle)."""
        rows = np.ascontiguousarray(np.concatenate(self._rows).T)
        return np.concatenate(self._corners), rows[0], rows[1], rows[2]

    def forms(self) -> np.ndarray:
        """float64 (Q, FORM_SIZE)."""
        return np.array(self._forms) if self._forms else np.zeros((1, FORM_SIZE))

    def normals(self, order: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """In this order: geometric normals (T, 3), the row of each surface's corner normals (-1: flat, curved, or not
        specular), and the rows (S, 9)."""
        corner = np.concatenate(self._corner_normals)[order]
        known = (np.abs(corner).sum(axis=2) > 0.0).all(axis=1)
        index = np.full(len(order), -1, np.int32)
        index[known] = np.arange(np.count_nonzero(known))
        packed = corner[known].reshape(-1, 9)
        return (
            np.ascontiguousarray(np.concatenate(self._normals)[order]),
            index,
            np.ascontiguousarray(packed) if len(packed) else np.zeros((1, 9)),
        )


def specular_corners(scene: Scene, centre: np.ndarray) -> np.ndarray:
    """Triangles that cover glass and mirrors as a light sees them, float64 (S, 3, 3) about `centre`.

    Of curved surfaces they are the mesh's, swollen by twice what that falls short.
    """
    found = [np.zeros((0, 3, 3))]
    for item in scene.objects:
        if item.material.is_specular:
            mesh = item.mesh.transformed(item.object_to_world)
            normals = mesh.corner_normals if pieces(item) else None
            swollen = 0.0 if normals is None else 2.0 * _sagitta(mesh.corners(), normals) * normals
            found.append(mesh.corners() - centre + swollen)
    return np.concatenate(found)


def _sagitta(corners: np.ndarray, normals: np.ndarray) -> float:
    """How far an arc rises above the longest chord of a smooth mesh: an eighth of chord times turn of the normals."""
    chord = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    turn = np.linalg.norm(np.roll(normals, -1, axis=1) - normals, axis=2)
    return float((chord * turn).max()) / 8.0
