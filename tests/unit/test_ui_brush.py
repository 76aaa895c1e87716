"""The dispersion brush: what a stroke lays on a receiver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.edit import brush as brushes
from spectrasplat.edit.state import Brush
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.local_dispersion import gain_at
from spectrasplat.model.optics import glass
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Scene, SceneObject

BRUSH = Brush(radius=0.2, strength=1.0, falloff=0.5)
CORNERS = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
QUAD = make_mesh("quad", CORNERS, np.array([[0, 1, 2], [0, 2, 3]]))


def receiver(matrix: np.ndarray | None = None) -> SceneObject:
    return SceneObject("table", QUAD, Diffuse(), np.eye(4) if matrix is None else matrix)


def scene(matrix: np.ndarray | None = None) -> Scene:
    lump = SceneObject("glass", QUAD, Dielectric(glass.constant(1.5)))
    return Scene("test", Camera((0, 0, 5), (0, 0, 0)), (), (receiver(matrix), lump))


def painted(brush: Brush, places, dt: float, where: Scene | None = None) -> brushes.Stroke:
    world = where or scene()
    stroke = brushes.begin(world, 0, brush, tuple(places[0]))
    for place in places[1:]:
        stroke = brushes.extend(stroke, world, tuple(place), dt)
    return stroke


def line(start: float, end: float, count: int) -> np.ndarray:
    return np.column_stack([np.linspace(start, end, count), np.zeros(count), np.zeros(count)])


def test_a_still_cursor_doubles_the_gain_every_second() -> None:
    stroke = painted(BRUSH, np.zeros((91, 3)), 0.01)
    assert len(stroke.dabs) == 1
    assert gain_at(stroke.dabs, np.zeros((1, 3)))[0] == pytest.approx(2.0)
    narrow = painted(replace(BRUSH, mode="narrow"), np.zeros((91, 3)), 0.01)
    assert gain_at(narrow.dabs, np.zeros((1, 3)))[0] == pytest.approx(0.5)


def test_a_line_is_spaced_and_does_not_depend_on_the_frame_rate() -> None:
    slow, fast = painted(BRUSH, line(0.0, 1.0, 11), 0.1), painted(BRUSH, line(0.0, 1.0, 201), 0.005)
    spacing = brushes.SPACING * BRUSH.radius
    for stroke in (slow, fast):
        x = np.sort([dab.position[0] for dab in stroke.dabs])
        assert np.diff(x).min() > 0.99 * spacing
        assert np.diff(x).max() < 2.01 * spacing
        assert sum(dab.log2_gain for dab in stroke.dabs) == pytest.approx(1.0 + brushes.FIRST_TOUCH_S)
    at = line(0.25, 0.75, 9)
    assert np.log2(gain_at(slow.dabs, at)) == pytest.approx(np.log2(gain_at(fast.dabs, at)), rel=0.15)


def test_scrubbing_for_long_does_not_make_thousands_of_dabs() -> None:
    there_and_back = np.concatenate([line(0.0, 0.5, 30), line(0.5, 0.0, 30)] * 40)
    stroke = painted(BRUSH, there_and_back, 1 / 60)
    assert len(stroke.dabs) < 25
    assert sum(dab.log2_gain for dab in stroke.dabs) == pytest.approx(
        (len(there_and_back) - 1) / 60 + brushes.FIRST_TOUCH_S
    )


def test_dabs_lie_in_the_receivers_own_coordinates() -> None:
    angle = 0.7
    matrix = np.eye(4)
    matrix[:3, :3] = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    ) @ np.diag([4.0, 4.0, 0.3])
    matrix[:3, 3] = 5.0, -2.0, 1.0
    place = (matrix @ np.array([0.3, -0.2, 0.0, 1.0]))[:3]
    stroke = painted(BRUSH, [place], 0.1, scene(matrix))
    assert stroke.dabs[0].position == pytest.approx([0.3, -0.2, 0.0])
    # The plane is stretched four times whatever is done to heights above it.
    assert stroke.dabs[0].radius == pytest.approx(BRUSH.radius / 4.0)
    bowl = replace(
        receiver(np.diag([2.0, 2.0, 2.0, 1.0])),
        mesh=make_mesh("bent", [*CORNERS, [0, 0, 0.5], [0, 0, 0], [0, 0, 0], [0, 0, 0]], QUAD.triangles),
    )
    assert brushes.object_radius(bowl, 0.2) == pytest.approx(0.1)


def test_the_eraser_takes_away_what_lies_beneath_and_no_more() -> None:
    widened = painted(BRUSH, np.zeros((101, 3)), 0.01)
    dabs = widened.dabs
    eraser = painted(replace(BRUSH, mode="erase"), np.zeros((301, 3)), 0.01)
    after = gain_at(dabs + eraser.dabs, np.zeros((1, 3)))[0]
    assert 1.0 <= after < 1.001
    assert all(0.0 < dab.erase <= 1.0 and dab.log2_gain == 0.0 for dab in eraser.dabs)


def test_modifiers_and_radius() -> None:
    assert brushes.mode_held(BRUSH, True, False).mode == "erase"
    assert brushes.mode_held(BRUSH, False, True).mode == "narrow"
    assert brushes.mode_held(replace(BRUSH, mode="narrow"), False, True).mode == "widen"
    assert brushes.mode_held(BRUSH, False, False) == BRUSH
    assert brushes.resized(BRUSH, 2.0, 10.0).radius == pytest.approx(BRUSH.radius * brushes.RADIUS_STEP**2)
    assert brushes.resized(BRUSH, 1000.0, 10.0).radius == pytest.approx(10.0 * brushes.MAX_RADIUS)
    assert brushes.resized(BRUSH, -1000.0, 10.0).radius == pytest.approx(10.0 * brushes.MIN_RADIUS)


def test_the_ring_lies_on_the_tangent_plane() -> None:
    normal = np.array([0.6, 0.0, 0.8])
    points = brushes.ring((1.0, 2.0, 3.0), tuple(normal), 0.5) - [1.0, 2.0, 3.0]
    assert points @ normal == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.norm(points, axis=1) == pytest.approx(0.5)


def test_a_stroke_is_added_to_what_was_there() -> None:
    first = painted(BRUSH, line(0.0, 0.3, 5), 0.1)
    once = brushes.applied(scene(), first)
    second = brushes.begin(once, 0, BRUSH, (0.5, 0.5, 0.0))
    twice = brushes.applied(once, second)
    assert twice.objects[0].local_dispersion == first.dabs + second.dabs
    assert twice.objects[1] is once.objects[1]
