"""The triangle tree: complete, tight, shallow, and it finds what brute force finds."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.base import paths
from spectrasplat.model.geometry import bvh
from spectrasplat.model.geometry.bvh import MAX_DEPTH, MAX_LEAF, Bvh, build_bvh


def soup(count: int, size: float = 0.1, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (rng.random((count, 1, 3)) + rng.normal(0, size, (count, 3, 3))).astype(np.float32)


def bumpy_sphere(rings: int, sectors: int) -> np.ndarray:
    """A closed surface of 2·rings·sectors triangles, some of zero area at the poles."""
    u, v = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, sectors + 1), indexing="ij")
    radius = 1 + 0.1 * np.sin(7 * u) * np.cos(5 * v)
    p = radius[..., None] * np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], -1)
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], -2), np.stack([a, c, d], -2)]).reshape(-1, 3, 3).astype(np.float32)


def check_structure(tree: Bvh, triangles: np.ndarray) -> None:
    """Every triangle in exactly one leaf, bounds exact from leaf to root, depth and leaf size kept."""
    assert np.array_equal(np.sort(tree.order), np.arange(len(triangles)))
    reordered = triangles[tree.order]
    nodes, seen, deepest, visited = tree.nodes, np.zeros(len(triangles), int), 0, 0
    stack = [(0, 0)]
    while stack:
        index, depth = stack.pop()
        visited += 1
        deepest = max(deepest, depth)
        node = nodes[index]
        first, count = int(node["left_or_first"]), int(node["count"])
        if count:
            assert count <= MAX_LEAF
            seen[first : first + count] += 1
            held = reordered[first : first + count].reshape(-1, 3)
            low, high = held.min(0), held.max(0)
        else:
            children = nodes[first : first + 2]
            low, high = children["bounds_min"].min(0), children["bounds_max"].max(0)
            stack += [(first, depth + 1), (first + 1, depth + 1)]
        assert np.array_equal(node["bounds_min"], low) and np.array_equal(node["bounds_max"], high)
    assert (seen == 1).all()
    assert visited == len(nodes)
    assert deepest == tree.depth <= MAX_DEPTH


def hit_distances(triangles: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Distances (T,) along the ray, inf where it misses (Möller and Trumbore 1997), float64."""
    a, b, c = np.moveaxis(triangles.astype(np.float64), 1, 0)
    e1, e2 = b - a, c - a
    h = np.cross(direction, e2)
    det = (e1 * h).sum(-1)
    with np.errstate(all="ignore"):
        s = origin - a
        u = (s * h).sum(-1) / det
        q = np.cross(s, e1)
        v = (q @ direction) / det
        t = (e2 * q).sum(-1) / det
        return np.where((det != 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)


def box_entry(node: np.void, origin: np.ndarray, direction: np.ndarray) -> float:
    """Distance at which the ray enters the node's box, inf when it misses."""
    near = (node["bounds_min"] - origin) / direction
    far = (node["bounds_max"] - origin) / direction
    enter, leave = np.minimum(near, far).max(), np.maximum(near, far).min() * (1 + 1e-12)
    return max(enter, 0.0) if enter <= leave and leave >= 0 else np.inf


def traverse(tree: Bvh, triangles: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> tuple[float, int]:
    """(nearest distance, most stack entries used) by the traversal that `bvh` describes."""
    reordered = triangles[tree.order]
    nearest, highest, stack, index = np.inf, 0, [], 0
    while True:
        node = tree.nodes[index]
        first, count = int(node["left_or_first"]), int(node["count"])
        if count:
            nearest = min(nearest, hit_distances(reordered[first : first + count], origin, direction).min())
        else:
            entries = sorted((box_entry(tree.nodes[i], origin, direction), i) for i in (first, first + 1))
            waiting = [entry for entry in entries if entry[0] < nearest]
            if waiting:
                stack += waiting[1:]
                highest = max(highest, len(stack))
                index = waiting[0][1]
                continue
        while stack and stack[-1][0] >= nearest:
            stack.pop()
        if not stack:
            return nearest, highest
        index = stack.pop()[1]


@pytest.mark.parametrize(
    "triangles",
    [soup(400, 0.08), soup(300, 0.6, seed=2), bumpy_sphere(12, 16)],
    ids=["sparse soup", "crowded soup", "bumpy sphere"],
)
def test_traversal_finds_the_closest_hit_of_brute_force(triangles: np.ndarray) -> None:
    tree = build_bvh(triangles, use_cache=False)
    check_structure(tree, triangles)
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(120):
        origin = rng.uniform(-2, 2, 3)
        direction = rng.uniform(-0.5, 1, 3) - origin
        direction /= np.linalg.norm(direction)
        expected = hit_distances(triangles, origin, direction).min()
        found, height = traverse(tree, triangles, origin, direction)
        assert found == expected
        assert height <= MAX_DEPTH
        hits += np.isfinite(found)
    assert 20 < hits < 120 or len(triangles) < 400  # the rays both hit and miss


def one(corners: list[list[float]], copies: int = 1) -> np.ndarray:
    return np.repeat(np.array([corners], np.float32), copies, axis=0)


HARD_SHAPES = {
    "one triangle": one([[0, 0, 0], [1, 0, 0], [0, 1, 0]]),
    "leaf and a half": soup(5),
    "10000 copies": one([[0, 0, 0], [1, 0, 0], [0, 1, 0]], 10_000),
    "10000 points": one([[1, 2, 3]] * 3, 10_000),
    "slivers": soup(3000, 1.0) * np.float32([1, 1e-7, 1e-7]),
    "flat": soup(3000, 0.05) * np.float32([1, 1, 0]),
    "one axis": soup(3000, 0.001) * np.float32([0, 0, 1]),
    "tiny": soup(500) * np.float32(1e-38),
    "huge": soup(500) * np.float32(1e30),
    "far away": soup(2000, 0.01) + np.float32(1e4),
}


@pytest.mark.parametrize("name", HARD_SHAPES)
def test_hard_shapes_give_a_sound_tree(name: str) -> None:
    triangles = HARD_SHAPES[name]
    check_structure(build_bvh(triangles, use_cache=False), triangles)


def test_depth_is_bounded_where_surface_area_alone_would_peel_one_by_one() -> None:
    # Each triangle is a third the size of the one before: the cheapest split takes off one at a time.
    scale = (3.0 ** -np.arange(75.0))[:, None, None]
    nest = (scale * (np.eye(3) + 0.5)).astype(np.float32)
    triangles = np.concatenate([nest, nest[::-1] * np.float32(0.9)] * 20)
    tree = build_bvh(triangles, use_cache=False)
    check_structure(tree, triangles)
    assert tree.depth > np.log2(len(triangles))  # the bound is what this shape tests


def test_surface_area_splits_beat_halving() -> None:
    triangles = bumpy_sphere(100, 100)
    tree = build_bvh(triangles, use_cache=False)
    cost = _sah_cost(tree)
    # Halving along the longest axis, in closed recursion, as the yardstick.
    halved = _halving_cost(triangles)
    assert cost < 0.9 * halved
    assert cost < 40.0


def _sah_cost(tree: Bvh, node_cost: float = 1.0, triangle_cost: float = 1.0) -> float:
    """Expected work of a random line that meets the root (Goldsmith and Salmon 1987)."""
    extent = tree.nodes["bounds_max"].astype(np.float64) - tree.nodes["bounds_min"]
    area = extent[:, 0] * extent[:, 1] + extent[:, 1] * extent[:, 2] + extent[:, 2] * extent[:, 0]
    count = tree.nodes["count"]
    return float((area * np.where(count > 0, triangle_cost * count, node_cost)).sum() / area[0])


def _halving_cost(triangles: np.ndarray) -> float:
    def half_area(t: np.ndarray) -> float:
        x, y, z = np.ptp(t.reshape(-1, 3).astype(np.float64), axis=0)
        return x * y + y * z + z * x

    def work(t: np.ndarray) -> float:
        if len(t) <= MAX_LEAF:
            return half_area(t) * len(t)
        centres = t.mean(1)
        order = np.argsort(centres[:, np.ptp(centres, axis=0).argmax()])
        middle = len(t) // 2
        return half_area(t) + work(t[order[:middle]]) + work(t[order[middle:]])

    return work(triangles) / half_area(triangles)


def test_node_layout_is_what_the_shaders_read() -> None:
    assert bvh.NODE.itemsize == 32
    assert [bvh.NODE.fields[name][1] for name in bvh.NODE.names] == [0, 12, 16, 28]


@pytest.fixture
def cache_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(paths, "cache_dir", lambda: tmp_path)
    return tmp_path / "bvh"


def same(a: Bvh, b: Bvh) -> bool:
    return np.array_equal(a.nodes, b.nodes) and np.array_equal(a.order, b.order) and a.depth == b.depth


def test_the_cache_answers_without_building(cache_folder, monkeypatch) -> None:
    triangles = soup(1000)
    built = build_bvh(triangles)
    monkeypatch.setattr(bvh, "_build", lambda _: pytest.fail("built although cached"))
    assert same(build_bvh(triangles), built)
    assert len(list(cache_folder.iterdir())) == 1


def test_a_changed_corner_is_another_tree(cache_folder) -> None:
    triangles = soup(100)
    build_bvh(triangles)
    triangles[50, 1, 2] = 9.0
    assert build_bvh(triangles).nodes["bounds_max"][0, 2] == 9.0


@pytest.mark.parametrize(
    "triangles", [np.zeros((0, 3, 3)), np.zeros((4, 3)), np.full((2, 3, 3), np.nan), np.full((2, 3, 3), np.inf)]
)
def test_wrong_input_is_refused(triangles: np.ndarray) -> None:
    with pytest.raises(ValueError, match="triangles_xyz"):
        build_bvh(triangles)
