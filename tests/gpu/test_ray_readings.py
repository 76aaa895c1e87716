"""What the Rays panel says, against closed forms: deviation of a prism, focal lengths of a ball and a lens, orders of a
grating."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.edit.lessons import lesson
from spectrasplat.edit.state import Selection, State
from spectrasplat.gpu.context import Context
from spectrasplat.model.geometry import primitives_round
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.lights import DirectionalLight
from spectrasplat.model.optics import glass, spectrum
from spectrasplat.model.scene import Camera, Dielectric, Scene, SceneObject
from spectrasplat.ui.ray_overlay import RayOverlay
from spectrasplat.ui.ray_readings import RayReading, least_deviation_deg

WHITE = spectrum.illuminant("D65").scaled_to_luminous(1000.0)


def read(gl: Context, scene: Scene, index: int, rays: int = 5) -> tuple[RayReading, ...]:
    state = State(scene, scene.camera, selection=Selection("object", index))
    overlay = RayOverlay(gl)
    try:
        overlay.update(replace(state, display=replace(state.display, ray_overlay=True, ray_count=rays)))
        return overlay.readings
    finally:
        overlay.release()


def with_ball(n_d: float, radius: float) -> Scene:
    mesh = primitives_round.sphere(radius, triangles=81_920)
    ball = SceneObject("ball", mesh, Dielectric(glass.from_abbe(n_d, float("inf"))), np.eye(4))
    light = DirectionalLight("sun", WHITE, direction=(0.0, 0.0, -1.0))
    return Scene("ball", Camera((0.0, -5.0, 0.0), (0.0, 0.0, 0.0)), (light,), (ball,))


def test_the_lessons_prism_stands_at_minimum_deviation(gl: Context) -> None:
    scene = load_scene(lesson("minimum_deviation").path)
    found = read(gl, scene, 0)
    assert len(found) == 9
    for reading in found:
        index = float(scene.objects[0].material.dispersion.index(reading.wavelength_nm))
        closed = 2.0 * np.degrees(np.arcsin(index * np.sin(np.radians(30.0)))) - 60.0
        assert reading.apex_deg == pytest.approx(60.0, abs=0.01)
        assert reading.least_deg == pytest.approx(closed, abs=0.01)
        assert closed - 0.01 < reading.deviation_deg < closed + 0.02


def test_a_prism_turned_deviates_more_by_what_snell_says(gl: Context) -> None:
    scene = load_scene(lesson("minimum_deviation").path)
    turned = scene.objects[0]
    turn = np.radians(8.0)
    about_z = np.eye(4)
    about_z[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    turned = replace(turned, object_to_world=about_z @ turned.object_to_world)
    (reading, *_) = read(gl, replace(scene, objects=(turned, *scene.objects[1:])), 0)
    index = float(turned.material.dispersion.index(reading.wavelength_nm))
    # Symmetric for n_d = 1.5168 at (60° + 38.651°)/2 = 49.3255° on the first face.
    for incidence in (49.3255 + 8.0, 49.3255 - 8.0):
        inside = np.arcsin(np.sin(np.radians(incidence)) / index)
        leaving = np.degrees(np.arcsin(index * np.sin(np.radians(60.0) - inside)))
        if abs(incidence + leaving - 60.0 - reading.deviation_deg) < 0.02:
            break
    else:
        raise AssertionError(f"{reading} is neither")
    assert reading.deviation_deg > reading.least_deg + 0.3


@pytest.mark.parametrize("n_d", [1.5, 1.8])
def test_a_balls_focal_length(gl: Context, n_d: float) -> None:
    found = read(gl, with_ball(n_d, 0.5), 0)
    for reading in found:
        assert reading.apex_deg is None and reading.least_deg is None  # its faces are not flat
        assert reading.focal_length == pytest.approx(n_d * 0.5 / (2.0 * (n_d - 1.0)), rel=0.01)
        # From the back of the ball: f − R.
        assert reading.focus_distance == pytest.approx(reading.focal_length - 0.5, abs=0.01)
        assert reading.focus == pytest.approx((0.0, 0.0, -reading.focal_length), abs=0.01)


def test_a_lens_focuses_violet_before_red(gl: Context) -> None:
    scene = load_scene(lesson("achromat").path)
    names = [item.name for item in scene.objects]
    singlet = read(gl, scene, names.index("singlet"))
    for reading in singlet:  # plano-convex: f = R/(n − 1)
        assert reading.focal_length == pytest.approx(1.3021 / (reading.index - 1.0), rel=0.02)
    spread = singlet[-1].focal_length - singlet[0].focal_length
    achromat = read(gl, scene, names.index("crown"))
    assert spread > 0.1
    assert abs(achromat[-1].focal_length - achromat[0].focal_length) < 0.4 * spread


def test_without_a_prism_there_is_no_least_deviation() -> None:
    assert least_deviation_deg(2.4, 60.0) is None
    assert least_deviation_deg(1.0, 60.0) == pytest.approx(0.0, abs=1e-9)
