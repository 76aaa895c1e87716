"""Polygons of the picture by camera beams: they fill it together with what is seen directly, and show what paths show.

The polygons are those of a plain recursion in float64 (`tests/reference/screen_beams.py`). Under an orthographic camera
they are exact, so what differs is chance of the paths, or wrong.
"""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from spectrasplat.beams.screen_pairs import pixel_parts
from spectrasplat.beams.screen_polygons import PIXEL_BITS, ScreenPolygons
from spectrasplat.model.environment import gradient
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import DirectionalLight
from spectrasplat.model.optics import glass
from spectrasplat.model.optics.colorimetry import xyz_to_rgb709
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, SceneObject
from spectrasplat.passes.pixel_lattice import pixel_lattice, shared_places
from spectrasplat.passes.screen_beams import by_pixel, largest_divisor, ordered

from tests.gpu.camera_rig import DOWN, WHITE, at, horizontal, opened_camera_pass, released
from tests.reference.screen_beams import screen_polygons

pytestmark = pytest.mark.slow  # camera beams are off unless asked for

SIZE = (48, 36)
BESIDE = Camera(position=(2.1, -3.4, 3.0), target=(0.0, 0.0, 0.0), kind="orthographic", vertical_extent=1.9)
PRISM = SceneObject("prism", primitives.prism(), Dielectric(glass.from_abbe(1.7847, 10.0)))
PANE = SceneObject("pane", primitives.box((1.2, 1.0, 0.1)), Dielectric(glass.constant(1.5)), at(0.0, 0.0, 0.3))
SKY = gradient((0.2, 0.4, 2.0), (1.0, 1.0, 1.0), (0.1, 0.6, 0.2))


def polygons_of(camera_pass, threshold=1e-4, bands=1) -> ScreenPolygons:
    scene = camera_pass.scene
    return screen_polygons(
        scene.scene, scene.space, scene.axis, *SIZE, threshold=threshold, bands=bands, cell_px=1000.0
    )


def by_beams(camera_pass, polygons: ScreenPolygons, samples=16, maps=None, size=SIZE) -> np.ndarray:
    objects = np.zeros(len(camera_pass.scene.scene.objects), bool)
    objects[0] = True
    camera_pass.take_beams(polygons, objects)
    assert camera_pass.shows_beams
    assert camera_pass.run(camera_pass.scene.scene.camera, *size, samples, maps=maps)
    picture = camera_pass.read_rgb()
    camera_pass.take_beams(None)
    return picture


def by_paths(camera_pass, samples: int, size=SIZE) -> np.ndarray:
    camera_pass.choose_spectrum(camera_pass.scene.scene.camera, *size, samples)
    assert camera_pass.run(camera_pass.scene.scene.camera, *size, samples)
    return camera_pass.read_rgb()


def relative(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(((a - b) ** 2).mean() / (b**2).mean()))


@pytest.fixture(scope="module")
def prism_pass(gl):
    camera_pass = opened_camera_pass(gl, [PRISM], camera=BESIDE, environment=SKY)
    yield camera_pass
    released(camera_pass)


def test_in_a_white_room_nothing_is_seen(gl):
    """All polygons and what is seen directly fill every pixel, outlines included, whatever the number of samples."""
    still = replace(PRISM, material=Dielectric(glass.constant(1.5)))
    camera_pass = opened_camera_pass(gl, [still], background=(1, 1, 1), camera=BESIDE)
    polygons = polygons_of(camera_pass, threshold=1e-6)
    for samples in (4, 9, 16):
        off = np.abs(by_beams(camera_pass, polygons, samples) - 1.0).max(axis=-1)
        # A point may lie within float32's error of an outline.
        assert np.sum(off > 2e-5) <= 2 and off.max() < 1.1 / min(4 * samples, 64)
    # It would not be so without one of the first polygons' edges.
    edges = polygons.edges.copy()
    strong = int(np.argmax(polygons.throughput[:, 1] * (np.diff(polygons.edge_start) > 2)))
    edges[polygons.edge_start[strong], [2, 5]] += 3.0
    assert by_beams(camera_pass, replace(polygons, edges=edges)).max() > 1.02
    released(camera_pass)


@pytest.mark.parametrize("bands", [1, 4])
def test_beams_show_what_paths_show(prism_pass, bands):
    """Under a coloured sky, with strong dispersion: the mean of 512 samples of single wavelengths' paths."""
    paths = by_paths(prism_pass, 512)
    beams = by_beams(prism_pass, polygons_of(prism_pass, bands=bands))
    assert relative(beams, paths) < 6e-3
    np.testing.assert_allclose(beams.mean((0, 1)), paths.mean((0, 1)), rtol=1e-3)


def test_a_sweep_is_the_sum_of_narrow_bands(prism_pass):
    """Edges that move over the whole spectrum at once, or in 24 steps that hardly move."""
    swept = by_beams(prism_pass, polygons_of(prism_pass, bands=2))
    stepped = by_beams(prism_pass, polygons_of(prism_pass, bands=24))
    assert relative(swept, stepped) < 4e-3
    still = polygons_of(prism_pass, bands=2)
    middle = 0.5 * (still.edges[:, :3] + still.edges[:, 3:])
    still = replace(still, edges=np.concatenate([middle, middle], axis=1))
    assert relative(by_beams(prism_pass, still), stepped) > 2 * relative(swept, stepped)


def test_beams_agree_with_the_reference(gl):
    """Against float64 paths that share no code: colours of a prism under a sky, outlines included."""
    pytest.importorskip("numba")
    from spectrasplat.reference.camera_reference import render_camera_reference

    camera_pass = opened_camera_pass(gl, [PRISM], camera=BESIDE, environment=SKY)
    reference = render_camera_reference(camera_pass.scene.scene, *SIZE, samples=2048)
    beams = by_beams(camera_pass, polygons_of(camera_pass, bands=4))
    noise = np.sqrt(reference.relmse)
    assert noise < 3e-3
    assert relative(beams, xyz_to_rgb709(reference.xyz)) < 6e-3
    released(camera_pass)


def test_a_textured_floor_through_a_pane(gl):
    """What lies behind is a lit surface with an edge: every part of a pixel looks for itself, as other samples do."""
    boards = [
        horizontal(-2.0 + i, -1.0 + i, -2.0, 2.0, -0.4, Diffuse((0.2 + 0.6 * (i % 2),) * 3), f"board {i}")
        for i in range(4)
    ]
    sun = DirectionalLight("sun", WHITE, direction=DOWN)
    camera_pass = opened_camera_pass(gl, [PANE, *boards], [sun], camera=BESIDE, background=(0.3, 0.3, 0.3))
    converged, paths = by_paths(camera_pass, 256), by_paths(camera_pass, 16)
    beams = by_beams(camera_pass, polygons_of(camera_pass))
    assert relative(beams, converged) < 1.1 * relative(paths, converged)
    released(camera_pass)


def test_the_order_of_polygons_and_repeats(prism_pass):
    """The same polygons give the same picture to the bit; another order of them only rounds otherwise."""
    polygons = polygons_of(prism_pass)
    first, again = by_beams(prism_pass, polygons), by_beams(prism_pass, polygons)
    assert np.array_equal(first, again)
    turned = by_beams(prism_pass, polygons.take(np.arange(len(polygons))[::-1]))
    np.testing.assert_allclose(turned, first, rtol=1e-5, atol=1e-6)


def test_a_larger_picture_has_the_same_polygons(prism_pass):
    polygons = polygons_of(prism_pass)
    small = by_beams(prism_pass, polygons)
    large = by_beams(prism_pass, polygons.scaled(2.0), size=(2 * SIZE[0], 2 * SIZE[1]))
    halved = large.reshape(SIZE[1], 2, SIZE[0], 2, 3).mean((1, 3))
    assert relative(halved, small) < 8e-3


def test_pixels_that_a_polygon_touches():
    """All pixels with a place inside at either end of the band, and those alone whose neighbours have one."""
    rng = np.random.default_rng(5)
    edges, hulls = [], []
    for _ in range(30):
        corners = rng.uniform(-2, 14, (3, 2))
        first, second = corners[1] - corners[0], corners[2] - corners[0]
        corners = corners if first[0] * second[1] > first[1] * second[0] else corners[::-1]
        along = np.roll(corners, -1, axis=0) - corners
        normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
        line = np.column_stack([normal, -np.einsum("ij,ij->i", normal, corners)])
        edges.append(np.concatenate([line, line - [0, 0, 0.5]], axis=1))
        hulls.append(corners)
    blank = {field.name: np.zeros(30) for field in fields(ScreenPolygons)}
    starts = np.arange(0, 91, 3)
    polygons = ScreenPolygons(
        **blank
        | {"hulls": np.concatenate(hulls), "hull_start": starts, "edges": np.concatenate(edges), "edge_start": starts}
    )
    parts = np.where(np.arange(30) % 2, 4, 1)
    entries = pixel_parts(polygons, (12, 9), 0.5, parts)
    y, x = np.mgrid[0:9, 0:12]
    fine = (np.arange(16) + 0.5) / 16
    for number in range(30):
        mine = entries[entries[:, 0] == number, 1]
        pixels, counts = np.unique(mine & ((1 << PIXEL_BITS) - 1), return_counts=True)
        assert np.all(counts == parts[number]) and np.all(np.bincount(mine >> PIXEL_BITS) == len(pixels))
        px = x[..., None, None] + fine[:, None]
        py = y[..., None, None] + fine
        h = np.einsum("ek,k...->e...", edges[number][:, :3], np.stack(np.broadcast_arrays(px, py, 1.0)))
        inside = np.all(h >= 0.0, axis=0).any((2, 3))
        listed = np.zeros((9, 12), bool)
        listed.flat[pixels] = True
        assert np.all(listed >= inside)
        assert listed.sum() <= inside.sum() + 25


def test_entries_by_pixel():
    pixels = np.array([7, 3, 7, 7, 2, 3], np.uint32)
    order, runs = by_pixel(pixels)
    assert order.tolist() == [4, 1, 5, 0, 2, 3]
    assert runs[:, :3].tolist() == [[2, 0, 1], [3, 1, 3], [7, 3, 6]]


def test_points_of_a_pixel():
    """Polygons' edges are told where a first launch looks at what is seen directly; a quarter of the points in order
    lies in about a quarter of the pixel."""
    assert len(shared_places(16, 4)) == 64 and len(shared_places(16, 1)) == 16 and len(shared_places(5, 4)) == 20
    assert len(shared_places(3, 4)) == len(shared_places(1000, 1)) == len(shared_places(17, 1)) == 64
    off = shared_places(16, 1) - pixel_lattice(16, 0)
    assert np.all((off > 0) & (off < 2e-3))
    assert largest_divisor(20, 16) == 10 and largest_divisor(64, 16) == 16
    for quarter in ordered(shared_places(16, 4)).reshape(4, 16, 2):
        assert np.all(np.std(quarter, axis=0) < 0.3)
