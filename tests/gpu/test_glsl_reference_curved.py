"""lib/curved.glsl and what lib/intersect.glsl and lib/interface.glsl do with it, against closed forms in float64."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.gpu import bindings
from spectrasplat.gpu.records import NONE
from spectrasplat.gpu.scene_records import OBJECT, PIECE, SCENE_STRUCTS
from spectrasplat.gpu.scene_texels import SceneTexels
from spectrasplat.model.curved_solids import Face
from spectrasplat.reference import optics
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

COUNT = 4000
CURVED_BIT = 0x40000000
UP = np.array([0.0, 0.0, 1.0])
BALL = Face(np.diag([1.0 / 0.9, 1.0 / 0.5, 1.0 / 0.7]), np.array([0.1, -0.2, 0.3]), np.zeros(3), 1.0)
FLAT_CAP = Face(np.sqrt(0.01) * np.eye(3), np.array([0.0, 0.0, -0.2]), UP, 0.0)
"""Of a sphere of radius 100."""
TUBE = Face(np.diag([1.0, 1.0, 0.0]) / np.sqrt(0.6), np.zeros(3), np.zeros(3), 0.6)
TOP = Face(np.zeros((3, 3)), np.array([0.0, 0.0, 0.4]), -UP, 0.0)
FACES = (BALL, FLAT_CAP, TUBE, TOP)


class Pieces:
    """A ball, and a solid of a slightly curved, a cylindrical and a plane face."""

    def __init__(self, gl) -> None:
        records = PIECE.zeros(len(FACES))
        for record, face in zip(records, FACES, strict=True):
            record["row_x"], record["row_y"], record["row_z"] = face.rows
            record["origin"], record["linear"], record["constant"] = face.origin, face.linear, face.constant
            record["is_plane"] = face.is_plane
        records["is_last"] = 1, 0, 0, 1
        records["object"] = 0, 1, 1, 1
        self.texels = SceneTexels(gl.ctx, {"PIECES": records, "OBJECTS": OBJECT.zeros(2)})
        self.ctx = gl.ctx

    def run(self, body: str, inputs: dict, outputs: dict, files: tuple[str, ...] = ("lib/interface.glsl",)) -> dict:
        counts = {"PIECE_COUNT": len(FACES), "TRIANGLE_COUNT": 0, "SPECTRAL_SAMPLES": 2}
        switches = {"CURVED_SOLIDS": 1, "NORMAL_DERIVATIVES": 1}
        defines = {**bindings.SCENE_DEFINES, **self.texels.defines, **counts, **switches}
        return evaluate(self.ctx, list(files), body, inputs, outputs, defines, SCENE_STRUCTS, {}, [self.texels.bind])


@pytest.fixture(scope="module")
def pieces(gl) -> Pieces:
    return Pieces(gl)


def value(face: Face, points: np.ndarray) -> np.ndarray:
    q = points - face.origin
    return ((q @ face.rows.T) ** 2).sum(axis=-1) - 2.0 * q @ face.linear - face.constant


def gradient(face: Face, points: np.ndarray) -> np.ndarray:
    """Half of it."""
    return (points - face.origin) @ face.rows.T @ face.rows - face.linear


def interval(face: Face, start: np.ndarray, way: np.ndarray) -> np.ndarray:
    """(N, 2), ascending; not a number where the ray misses."""
    u, w = way @ face.rows.T, (start - face.origin) @ face.rows.T
    a = optics.dot(u, u)
    b, c = optics.dot(u, w) - way @ face.linear, value(face, start)
    with np.errstate(invalid="ignore", divide="ignore"):
        if face.is_plane:
            t, far = -c / (2.0 * b), np.full_like(b, np.inf)
            return np.where(b[:, None] < 0.0, np.stack([t, far], -1), np.stack([-far, t], -1))
        root = np.sqrt(b * b - a * c)
        return np.stack([(-b - root) / a, (-b + root) / a], -1)


def rays(distance: float, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """From about so far away, towards the solids."""
    rng = np.random.default_rng(seed)
    start = as_f32(distance * optics.unit(rng.normal(size=(COUNT, 3))))
    return start, as_f32(optics.unit(rng.uniform(-0.7, 0.7, (COUNT, 3)) - start))


def on_face(face: Face, seed: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Places on it (float32) and the outward normals there."""
    start, way = rays(3.0, seed)
    t = interval(face, start, way)[:, 0 if not face.is_plane else 1]
    t = np.where(np.isfinite(t), t, interval(face, start, way)[:, 0])
    points = start + t[:, None] * way
    points = as_f32(points[np.isfinite(points).all(axis=1) & (np.abs(points).max(axis=1) < 3.0)])
    return points, optics.unit(gradient(face, points))


@pytest.mark.parametrize("distance", [0.2, 3.0, 300.0])
@pytest.mark.parametrize("number", range(len(FACES)))
def test_where_rays_come_in_and_go_out(pieces: Pieces, number: int, distance: float) -> None:
    face = FACES[number]
    start, way = rays(distance)
    body = f"found = piece_interval(piece_at({number}u), o, d); high = height_over(piece_at({number}u), o, d, 0.5);"
    outputs = {"found": "vec2", "high": "float"}
    told = pieces.run(body, {"o": start, "d": way}, outputs, ("lib/curved.glsl",))
    got = told["found"]
    normal = optics.unit(gradient(face, start + 0.5 * way))
    np.testing.assert_allclose(told["high"], 0.5 * optics.dot(way, normal), atol=2e-5)
    want = interval(face, start, way)
    # What only touches may be met or missed, and a plane seen edge-on is far away.
    middle = start + np.nan_to_num(want.mean(axis=1), posinf=0.0, neginf=0.0)[:, None] * way
    grazes = np.abs(value(face, middle)) < (1e-3 if distance < 100.0 else 0.1)
    met = np.isfinite(want).any(axis=1)
    assert ((got[:, 0] <= got[:, 1]) == met)[~grazes].all()
    near = np.abs(want) < 2.0 * distance + 10.0
    off = np.abs(got - np.nan_to_num(want))
    # Distances lose digits with the start's own, and where a face is steep.
    steep = np.abs(
        optics.dot(
            way[:, None], optics.unit(gradient(face, start[:, None] + np.nan_to_num(want)[..., None] * way[:, None]))
        )
    )
    bound = 3e-6 * max(distance, 1.0) / np.maximum(steep, 1e-2)
    held = near & np.isfinite(want) & ~grazes[:, None] & met[:, None]
    assert np.count_nonzero(held) > COUNT / 8 and (off <= bound)[held].all(), (off / bound)[held].max()


@pytest.mark.parametrize("number", range(len(FACES)))
def test_places_normals_and_their_changes(pieces: Pieces, number: int) -> None:
    face = FACES[number]
    points, normal = on_face(face)
    rng = np.random.default_rng(7)
    along = rng.normal(size=points.shape)
    along = as_f32(along - optics.dot(along, normal)[:, None] * normal)
    inputs = {
        "at": points,
        "dp": along,
        "off": as_f32(points + 1e-4 * normal),
        "side": np.resize([1, 0], len(points)).astype("u4"),
    }
    body = f"""
        Hit hit;
        hit.primitive = CURVED_BIT | {number}u;
        Piece piece = piece_at({number}u);
        hit.normal_g = normalize(piece_gradient(piece, at));
        Triangle facet;
        facet.normals = NONE;
        vec3 d = side != 0u ? -hit.normal_g : hit.normal_g;
        ShadingFrame frame = shading_frame(hit, facet, at, d);
        n = frame.normal;
        dn = normal_column(frame, dp);
        beside = normal_beside(frame, 0.01 * dp);
        back = on_piece(piece, off);
        turns = frame.interpolated;
        planar = is_planar(hit, facet) ? 1u : 0u;
        other = uint(is_curved(NONE)) + uint(is_curved(PLANE_BIT | 3u)) + uint(is_curved(3u));
        other += uint(is_plane(hit.primitive)) + uint(is_plane(NONE));
        plane = uint(is_plane(PLANE_BIT | 3u));
    """
    outputs = {
        "n": "vec3",
        "dn": "vec3",
        "beside": "vec3",
        "back": "vec3",
        "turns": "uint",
        "planar": "uint",
        "other": "uint",
        "plane": "uint",
    }
    got = pieces.run(body, inputs, outputs)
    side = np.where(inputs["side"] != 0, 1.0, -1.0)[:, None]
    np.testing.assert_allclose(got["n"], side * normal, atol=2e-6)
    step = 1e-6
    ahead, behind = (optics.unit(gradient(face, points + s * step * along)) for s in (1.0, -1.0))
    np.testing.assert_allclose(got["dn"], side * (ahead - behind) / (2.0 * step), atol=3e-5)
    np.testing.assert_allclose(got["beside"], side * optics.unit(gradient(face, points + 0.01 * along)), atol=3e-6)
    assert np.abs(face.distance(got["back"].astype(float))).max() < 3e-7
    assert (np.abs(got["back"] - points).max(axis=1) < 1e-5).all()
    assert (got["turns"] == (not face.is_plane)).all() and (got["planar"] == face.is_plane).all()
    assert not got["other"].any() and got["plane"].all()


CLOSEST = """
    Hit hit;
    RayOrigin origin = RayOrigin(from, from == NONE ? NONE : object, uint(inside != 0u), 0u);
    bool met = intersect_closest(o, d, FAR_DISTANCE, origin, hit);
    distance = met ? hit.distance : -1.0;
    primitive = hit.primitive;
    thing = hit.object;
    normal = hit.normal_g;
"""
FOUND = {"distance": "float", "primitive": "uint", "thing": "uint", "normal": "vec3"}


def nearest(start: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(distance, face) of a ray from outside both solids; infinite where it meets none."""
    best, face = np.full(len(start), np.inf), np.full(len(start), -1)
    for members in ((0,), (1, 2, 3)):
        inside = np.nan_to_num(np.stack([interval(FACES[i], start, way) for i in members]), nan=np.inf)
        enter, leave = (
            inside[..., 0],
            np.where(np.isinf(inside[..., 0]) & (inside[..., 0] > 0), -np.inf, inside[..., 1]),
        )
        first = enter.max(axis=0)
        met = (first <= leave.min(axis=0)) & (first > 0.0) & (first < best)
        best = np.where(met, first, best)
        face = np.where(met, np.array(members)[enter.argmax(axis=0)], face)
    return best, face


def test_the_nearest_face_is_met_first(pieces: Pieces) -> None:
    start, way = rays(3.0)
    none = np.full(COUNT, NONE, np.uint32)
    got = pieces.run(CLOSEST, {"o": start, "d": way, "from": none, "object": none, "inside": none}, FOUND)
    distance, face = nearest(start, way)
    met = np.isfinite(distance)
    same = got["primitive"] == np.where(met, CURVED_BIT | np.maximum(face, 0), NONE)
    # Rims and outlines to within rounding.
    assert np.count_nonzero(~same) <= 0.002 * COUNT
    both = met & same
    assert np.count_nonzero(both) > COUNT / 3 and set(face[both]) == set(range(4))
    assert (got["thing"] == np.where(face == 0, 0, 1))[both].all()
    steep = np.abs(optics.dot(way, got["normal"]))
    assert (np.abs(got["distance"] - distance) < 5e-6 / np.maximum(steep, 0.02))[both].all()
    for number, own in enumerate(FACES):
        chosen = both & (face == number)
        points = start[chosen] + distance[chosen, None] * way[chosen]
        np.testing.assert_allclose(got["normal"][chosen], optics.unit(gradient(own, points)), atol=2e-4)


def test_a_ray_goes_on_within_or_leaves_for_good(pieces: Pieces) -> None:
    """From the ball's own face: within, to where its chord ends, however steep; outward it never meets the ball
    again."""
    points, normal = on_face(BALL)
    rng = np.random.default_rng(9)
    way = optics.unit(rng.normal(size=points.shape))
    way = as_f32(np.where(optics.dot(way, normal)[:, None] < 0.0, way, -way))
    own = np.full(len(points), CURVED_BIT, np.uint32)
    zero, one = np.zeros(len(points), np.uint32), np.ones(len(points), np.uint32)
    within = pieces.run(CLOSEST, {"o": points, "d": way, "from": own, "object": zero, "inside": one}, FOUND)
    chord = interval(BALL, points, way)[:, 1]
    # The other solid stands in the ball here and there.
    other = np.nan_to_num(np.stack([interval(face, points, way) for face in FACES[1:]]), nan=-np.inf)
    alone = (other[..., 0].max(axis=0) > chord + 1e-3) | (other[..., 1].min(axis=0) < -1e-3)
    assert np.count_nonzero(alone) > len(points) / 4
    assert (within["primitive"] == CURVED_BIT)[alone].all()
    # Where the place itself is rounded a grazing ray's chord is not known to more digits.
    steep = np.abs(optics.dot(way, normal))
    assert (np.abs(within["distance"] - chord) < 1e-6 / np.maximum(steep, 1e-3))[alone].all()
    outward = pieces.run(CLOSEST, {"o": points, "d": as_f32(-way), "from": own, "object": zero, "inside": zero}, FOUND)
    assert (outward["primitive"] != CURVED_BIT).all()
