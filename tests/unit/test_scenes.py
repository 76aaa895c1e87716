"""The shipped scenes: each loads, says why it is there, and holds the geometry its comment promises."""

from __future__ import annotations

import itertools
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.features.facts import dispersive_glasses
from spectrasplat.features.features import Features
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Black, Dielectric, Diffuse, Scene
from spectrasplat.model.settings import RenderSettings

SCENES = sorted((assets_dir() / "scenes").glob("*.toml"))
LINES_NM = {"F": 486.1327, "d": 587.5618, "C": 656.2725}


def shipped(name: str) -> Scene:
    return load_scene(assets_dir() / "scenes" / f"{name}.toml")


def test_the_collection_is_complete() -> None:
    names = {path.stem for path in SCENES}
    wanted = {
        "default",
        "prism",
        "prism_case",
        "ball",
        "ball_plain",
        "brilliant",
        "lens",
        "achromat",
        "amici",
        "water",
        "wine_glass",
    }
    wanted |= {"brilliant_studio", "prism_edge", "lens_text", "ball_caustic", "calcite"}
    assert wanted <= names


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_a_scene_loads_and_can_be_rendered(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.startswith("# ") and "\n\nname = " in text, "a scene opens with why it is there"
    assert not {"lights", "camera"} - set(tomllib.loads(text)), "shipped scenes leave nothing to defaults"
    scene = load_scene(path)
    solids = [o for o in scene.objects if isinstance(o.material, Dielectric) and o.material.is_solid]
    assert all(o.mesh.is_closed and o.mesh.volume() > 0.0 for o in solids)
    assert any(o.material.dispersion is not None for o in scene.objects)
    assert scene.environment is not None or any(isinstance(o.material, Diffuse) for o in scene.objects)
    # Every glass stands in the picture.
    forward = np.subtract(scene.camera.target, scene.camera.position)
    forward /= np.linalg.norm(forward)
    aspect = scene.render.width / scene.render.height
    if path.stem == "prism_case" or scene.camera.kind == "orthographic":
        return  # these look at the screen alone, on purpose
    for item in solids:
        middle = (item.object_to_world @ np.append(np.mean(item.mesh.bounds(), axis=0), 1.0))[:3]
        ray = middle - scene.camera.position
        depth = ray @ forward
        assert depth > 0.0
        half = math.tan(math.radians(scene.camera.vertical_fov_deg / 2.0))
        assert np.linalg.norm(ray - depth * forward) < depth * half * aspect


def _through(
    planes: np.ndarray, n: float, point: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Place and direction behind a convex solid that refracts a ray twice; None where it does not."""
    for ratio in (1.0 / n, n):
        facing = planes[:, :3] @ direction
        distance = (planes[:, 3] - planes[:, :3] @ point) / np.where(np.abs(facing) < 1e-12, np.nan, facing)
        entering = ratio < 1.0
        face = int(
            np.nanargmax(np.where(facing < 0.0, distance, -np.inf))
            if entering
            else np.nanargmin(np.where(facing > 0.0, distance, np.inf))
        )
        point = point + distance[face] * direction
        normal = planes[face, :3] * -np.sign(facing[face])
        cosine = direction @ normal
        transmitted = 1.0 - ratio**2 * (1.0 - cosine**2)
        if transmitted < 0.0 or (planes[:, :3] @ point > planes[:, 3] + 1e-9).any():
            return None
        direction = ratio * direction - (ratio * cosine + math.sqrt(transmitted)) * normal
    return point, direction


def test_prism_case_sends_seven_wavelengths_where_the_reference_found_them() -> None:
    """Straight lines and Snell's law through the scene's own prism, float64, against the reference's list (cm)."""
    expected = {
        400: 14.507781,
        450: 18.587992,
        500: 20.922858,
        550: 22.456213,
        600: 23.542016,
        650: 24.350626,
        700: 24.975810,
    }
    scene = shipped("prism_case")
    prism, slit, floor = scene.objects
    assert isinstance(slit.material, Black) and floor.material.reflectance_rgb == (0.18, 0.18, 0.18)
    light = scene.lights[0]
    assert light.spectral_power.luminous() == pytest.approx(1e7, rel=1e-12)
    assert light.inner_half_angle_deg == light.outer_half_angle_deg == 0.65
    planes = prism.mesh.convex_planes
    for wavelength, x in expected.items():
        n = float(prism.material.dispersion.index(wavelength))
        left = _through(planes, n, np.array(light.position), np.array(light.direction))
        assert left is not None
        point, direction = left
        landing = point - direction * (point[2] / direction[2])
        # The PLY's coordinates hold six decimals, half a metre above the floor.
        assert landing[0] == pytest.approx(x, abs=3e-4) and landing[1] == pytest.approx(0.0, abs=1e-9)


def test_the_plain_ball_is_the_balls_twin_without_dispersion() -> None:
    ball, plain = shipped("ball"), shipped("ball_plain")
    assert (ball.camera, ball.render) == (plain.camera, plain.render)
    np.testing.assert_array_equal(ball.objects[0].mesh.vertices, plain.objects[0].mesh.vertices)
    one, two = (scene.objects[0].material.dispersion for scene in (ball, plain))
    assert two.n_d == pytest.approx(one.n_d, abs=1e-6)
    assert one.is_dispersive and not two.is_dispersive
    assert Features.of(plain, RenderSettings()).spectral_groups == 0


def power_of_lens(surfaces: list[tuple[float, float, float, float]]) -> float:
    """Back vertex power -c' of a paraxial ray (y = 1, u = 0) through (radius, n before, n after, thickness after)."""
    y, nu = 1.0, 0.0
    for radius, before, after, thickness in surfaces:
        nu -= y * (after - before) / radius
        y += thickness * nu / after
    return -nu


def test_the_achromat_corrects_what_its_singlet_does_not() -> None:
    scene = shipped("achromat")
    crown, flint = (o.material.dispersion for o in scene.objects[:2])
    powers, single = {}, {}
    for line, wavelength in LINES_NM.items():
        n1, n2 = float(crown.index(wavelength)), float(flint.index(wavelength))
        powers[line] = power_of_lens([(0.92, 1.0, n1, 0.30), (-0.92, n1, n2, 0.08), (-30.0, n2, 1.0, 0.0)])
        single[line] = (n2 - 1.0) / 1.3021
    assert 1.0 / powers["d"] == pytest.approx(2.1, rel=0.03) and 1.0 / single["d"] == pytest.approx(2.1, rel=1e-4)
    assert abs(powers["F"] / powers["C"] - 1.0) < 2e-3
    assert single["F"] / single["C"] - 1.0 == pytest.approx(1.0 / 36.366, rel=0.02)
    # The cemented faces share their vertices to the last bit.
    front, back = (set(map(tuple, o.mesh.vertices)) for o in scene.objects[:2])
    assert len(front & back) > 1000
    np.testing.assert_array_equal(scene.objects[0].object_to_world, scene.objects[1].object_to_world)


def test_the_ball_shows_its_second_rainbow_and_the_stop_leaves_it_alone() -> None:
    """Two reflections inside: deviation 2π + 2i − 6r is stationary where sin²i = (9 − n²)/8."""
    scene = shipped("ball")
    ball, stop, table = scene.objects
    n = ball.material.dispersion.n_d
    height = math.sqrt((9.0 - n * n) / 8.0)
    assert isinstance(stop.material, Black)
    assert np.max(np.hypot(*stop.mesh.vertices[:, :2].T)) < height - 0.05 and scene.lights[0].radius > height + 0.05
    # The stop stands across the beam, on its axis.
    direction = np.array(scene.lights[0].direction)
    assert abs(stop.object_to_world[:3, 2] @ direction) == pytest.approx(1.0, abs=1e-6)
    assert np.linalg.norm(np.cross(stop.object_to_world[:3, 3], direction)) < 1e-2
    # The comment's angle, and a ring that falls on the table inside the picture's width.
    deviation = 360.0 + 2.0 * math.degrees(math.asin(height)) - 6.0 * math.degrees(math.asin(height / n))
    assert 360.0 - deviation == pytest.approx(41.4, abs=0.3)
    assert table.object_to_world[2, 3] == pytest.approx(-1.001)


def test_the_lenses_colours_cross_in_order_on_the_table() -> None:
    """f = R/(n − 1), and the beam's upper edge comes down well behind the last focus."""
    scene = shipped("lens")
    glass, light = scene.objects[0].material.dispersion, scene.lights[0]
    foci = {line: 1.3 / (float(glass.index(nm)) - 1.0) for line, nm in LINES_NM.items()}
    assert foci["F"] < foci["d"] < foci["C"] and foci["d"] == pytest.approx(1.41, abs=0.005)
    assert (foci["C"] - foci["F"]) / foci["d"] == pytest.approx(1.0 / 20.9, rel=0.05)
    dx, _, dz = light.direction
    top_at_lens = light.position[2] + 0.375 * dx - (light.position[0] + 0.375 * dz) / dx * dz
    assert top_at_lens * dx / -dz > 2.0 * foci["C"]


def test_the_amici_prism_lets_yellow_through_straight() -> None:
    """T12 of the known answers, from the scene's own faces."""
    scene = shipped("amici")
    parts = [o for o in scene.objects if isinstance(o.material, Dielectric)]
    # x of the four faces at y = ±1/2, from the vertices.
    faces = [parts[0].mesh.vertices[[0, 3]]] + [p.mesh.vertices[[1, 2]] for p in parts]
    tilts = [math.atan2(f[1, 0] - f[0, 0], 1.0) for f in faces]
    np.testing.assert_allclose(np.degrees(tilts), [31.388079, -45.0, 45.0, -31.388079], atol=1e-6)
    deviation = {}
    for line, wavelength in LINES_NM.items():
        indices = [1.0] + [float(p.material.dispersion.index(wavelength)) for p in parts] + [1.0]
        angle = 0.0
        for tilt, before, after in zip(tilts, indices, indices[1:], strict=False):
            # The face x = y tan(tilt) has its normal turned by -tilt.
            angle = math.asin(before / after * math.sin(angle + tilt)) - tilt
        deviation[line] = math.degrees(angle)
    assert deviation["d"] == pytest.approx(0.0, abs=1e-5)
    assert abs(deviation["F"]) == pytest.approx(2.21096, abs=1e-4)
    assert abs(deviation["C"]) == pytest.approx(0.82305, abs=1e-4)
    # Neighbours share the vertices of their common face.
    for left, right in itertools.pairwise(parts):
        assert len(set(map(tuple, left.mesh.vertices)) & set(map(tuple, right.mesh.vertices))) == 4


def test_the_slit_of_the_prism_scene_meets_it_near_minimum_deviation() -> None:
    scene = shipped("prism")
    glass = scene.objects[0].material.dispersion
    x, y, _ = scene.lights[0].direction
    plan = math.atan2(y, x)
    # Apex towards +y: minimum deviation enters at half the deviation above the x axis.
    half_deviation = math.asin(glass.n_d * 0.5) - math.radians(30.0)
    assert plan == pytest.approx(half_deviation, abs=math.radians(2.0))
    assert len(dispersive_glasses(scene)) == 1


def test_the_wine_reaches_into_the_wall_and_the_glass_has_priority() -> None:
    glass, wine = shipped("wine_glass").objects[:2]
    assert glass.material.priority > wine.material.priority
    assert wine.material.absorption is not None
    inner = glass.mesh.vertices[np.hypot(*glass.mesh.vertices[:, :2].T) > 0.5]
    assert np.ptp(wine.mesh.vertices[:, 2]) < np.ptp(inner[:, 2])


def test_the_studio_lights_the_brilliant_alone() -> None:
    """Values from 0.05 to 50, whatever the coding: the reader is ours, the file was written by a script."""
    scene = shipped("brilliant_studio")
    assert scene.lights == () and len(scene.objects) == 1 and scene.environment is not None
    assert scene.notes == ("diamond: data reach from 226 to 760 nm; above 760 nm the nearest value is used.",)
    rgb = scene.environment.rgb
    assert rgb.shape == (512, 1024, 3)
    assert rgb.min() == pytest.approx(0.05, rel=0.02) and rgb.max() == pytest.approx(50.0, rel=0.01)


def test_the_page_is_print_under_a_lens_and_upright() -> None:
    page = next(o for o in shipped("lens_text").objects if o.name == "page")
    ink = 1.0 - page.material.texture.rgb[..., 0]
    assert 0.03 < ink.mean() < 0.2
    # The heading stands at the top left: row 0 is the top, and v = 1 lies at +y.
    height, width = ink.shape
    assert ink[: height // 8, : width // 2].mean() > 2.0 * ink[-height // 8 :].mean()
    assert page.mesh.uv[page.mesh.corners()[..., 1] > 0.0][:, 1].min() == 1.0


def _through_prism(scene: Scene, wavelength_nm: float, angle_rad: float) -> float | None:
    """x on the cards of the camera's level ray `angle_rad` left of y, refracted twice by the prism, or None when it is
    not."""
    prism = next(o for o in scene.objects if o.name == "prism")
    n = float(prism.material.dispersion.index(wavelength_nm))
    planes = prism.mesh.transformed(prism.object_to_world).convex_planes
    direction = np.array([-math.sin(angle_rad), math.cos(angle_rad), 0.0])
    left = _through(planes, n, np.array(scene.camera.position), direction)
    if left is None:
        return None
    point, direction = left
    return float(point[0] + direction[0] * (3.0 - point[1]) / direction[1])


def test_the_prisms_fringe_is_as_wide_as_promised_and_the_edge_in_its_middle() -> None:
    """Where each wavelength puts the cards' edge, by bisection over the camera's rays: 20 to 60 pixels of 480 apart."""
    scene = shipped("prism_edge")
    cards = {o.name: o.mesh.transformed(o.object_to_world).bounds() for o in scene.objects if o.name != "prism"}
    edge = cards["black card"][1][0]
    assert cards["white card"][0][0] == edge == pytest.approx(_through_prism(scene, 587.5618, 0.0), abs=5e-3)
    seen = {}
    for nm in (430.0, 587.5618, 680.0):
        low, high = math.radians(-8.0), math.radians(8.0)
        assert _through_prism(scene, nm, low) > edge > _through_prism(scene, nm, high)
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if _through_prism(scene, nm, middle) > edge else (low, middle)
        seen[nm] = low
    forward = np.subtract(scene.camera.target, scene.camera.position)
    axis = math.atan2(-forward[0], forward[1])
    pixels = 135.0 / math.tan(math.radians(0.5 * scene.camera.vertical_fov_deg))
    at = {nm: pixels * math.tan(axis - angle) for nm, angle in seen.items()}
    assert at[680.0] < at[587.5618] < at[430.0] and 20.0 < at[430.0] - at[680.0] < 60.0
    # The lamp is too high for what passes the prism to reach the part of the cards the camera sees.
    direction = scene.lights[0].direction
    prism = next(o for o in scene.objects if o.name == "prism")
    top = prism.mesh.transformed(prism.object_to_world).bounds()[1]
    assert top[2] + (3.0 - top[1]) * direction[2] / direction[1] < -5.0 * math.tan(
        math.radians(0.5 * scene.camera.vertical_fov_deg)
    )


def test_all_of_the_beam_meets_the_ball_before_its_caustic() -> None:
    scene = shipped("ball_caustic")
    ball, light = scene.objects[0], scene.lights[0]
    centre = ball.object_to_world[:3, 3]
    away = np.subtract(centre, light.position)
    miss = np.linalg.norm(np.cross(away, light.direction))
    assert miss + light.radius < 0.75
    # The caustic falls on the far side, within the ball's width of the line of sight and beyond.
    toward = away @ np.array(light.direction) * np.array(light.direction) + light.position
    landing = toward + np.array(light.direction) * (toward[2] / -light.direction[2])
    sight = np.subtract(centre, scene.camera.position)[:2]
    assert (landing[:2] - centre[:2]) @ sight > 0.0
