"""The eye's reference renderer against closed forms: furnaces, lights, textures, slabs and prisms before edges, caustics under glass.

What is seen without glass is exact but for the pixel's area. Behind glass pictures are estimates: z is the distance
from the closed form in the picture's own standard deviations (8 parts, so Student's t with 7 degrees of freedom: the mean of
z² over many values is 7/5 = 1.4), and mutants of the closed forms must be told apart by it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.errors import UserError
from app.model import primitives
from app.model.colorimetry import (
    K_M,
    VISIBLE_NM,
    cmf_xyz,
    daylight_per_lumen,
    rgb709_to_xyz,
    rgb_basis,
)
from app.model.glass import Dispersion, from_abbe
from app.model.glass import constant as constant_index
from app.model.primitives_round import sphere
from app.model.scene import (
    Absorption,
    Black,
    Camera,
    Dielectric,
    Diffuse,
    Light,
    Material,
    Mirror,
    Scene,
    SceneObject,
)
from app.model.spectrum import Spectrum, cmf_at, illuminant, laser
from app.model.texture import Environment, Texture
from app.truth import eye_answers
from app.truth.direct_view import seen_directly
from app.truth.eye_reference import (
    cached_eye_reference,
    eye_scene_key,
    render_eye_reference,
)
from app.truth.eye_run import EyePicture, EyeRun
from app.truth.photon_reference import render_reference
from app.truth.spectral_caustic import CausticPlan, build_caustic

FLINT = from_abbe(1.7, 25.0)
D65 = illuminant("D65").scaled_to_luminous(1.0)
ABOVE = Camera((0.0, 0.0, 9.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), kind="orthographic", vertical_extent=1.0)
WHITE = rgb709_to_xyz(np.ones(3))


def place(mesh, material: Material, at=(0.0, 0.0, 0.0), rotation: np.ndarray | None = None) -> SceneObject:
    matrix = np.eye(4)
    matrix[:3, :3] = np.eye(3) if rotation is None else rotation
    matrix[:3, 3] = at
    return SceneObject(mesh.name, mesh, material, matrix)


def scene_of(*things: Light | SceneObject, camera: Camera = ABOVE, **more) -> Scene:
    lights = tuple(t for t in things if isinstance(t, Light))
    return Scene("test", camera, lights, tuple(t for t in things if isinstance(t, SceneObject)), **more)


def plate(material: Material | None = None, size: float = 40.0) -> SceneObject:
    return place(primitives.plane(size, size), material or Diffuse((0.8, 0.8, 0.8)))


def z_squared(picture: EyePicture, expected: np.ndarray) -> float:
    """Mean of z² on Y where the picture has noise."""
    noisy = picture.variance[..., 1] > 0.0
    return float(np.mean((picture.xyz[..., 1] - expected[..., 1])[noisy] ** 2 / picture.variance[..., 1][noisy]))


# ---- what is seen straight: exact ------------------------------------------------------------


def test_a_plate_under_a_point_light_is_lamberts_law() -> None:
    light = Light("l", "point", D65.scaled(5.0), (0.3, -0.2, 1.5))
    picture = render_eye_reference(scene_of(light, plate(Diffuse((0.8, 0.4, 0.1)))), 33, 33, samples=256)
    middle = (np.arange(33) + 0.5) / 33 - 0.5
    x, y = np.meshgrid(middle, -middle)
    lux = 5.0 * 1.5 / ((x - 0.3) ** 2 + (y + 0.2) ** 2 + 1.5**2) ** 1.5
    np.testing.assert_allclose(picture.rgb(), lux[..., None] * np.array([0.8, 0.4, 0.1]) / math.pi, rtol=2e-3)
    assert picture.lost == {"depth": 0.0, "numeric": 0.0}


def test_a_spectral_reflectance_meets_the_lights_spectrum() -> None:
    curve = np.where(np.abs(VISIBLE_NM - 600.0) < 30.0, 0.9, 0.1)
    light = Light("l", "directional", D65 + laser(532.0, 0.01), direction=(0.0, 0.0, -1.0))
    picture = render_eye_reference(scene_of(light, plate(Diffuse(reflectance=curve))), 3, 3, samples=8)
    expected = K_M * ((D65.density * curve) @ cmf_xyz() + 0.01 * 0.1 * cmf_at(532.0)) / math.pi
    np.testing.assert_allclose(picture.xyz, np.broadcast_to(expected, (3, 3, 3)), rtol=1e-9)


@pytest.mark.parametrize(
    ("light", "expected"),
    [
        (Light("sun", "directional", D65, direction=(0.6, 0.0, -0.8), angular_diameter_deg=4.0), 0.8),
        (Light("beam", "collimated", D65, (0.0, 0.0, 2.0), radius=0.9), 1.0),
        (Light("away", "collimated", D65, (3.0, 0.0, 2.0), radius=0.9), 0.0),
        (Light("spot", "spot", D65, (0.0, 0.0, 2.0), inner_half_angle_deg=40.0, outer_half_angle_deg=50.0), 0.25),
        (Light("soft", "spot", D65, (0.0, 0.0, 2.0), (math.sin(0.3), 0.0, -math.cos(0.3)), inner_half_angle_deg=0.0, outer_half_angle_deg=math.degrees(0.6)), 0.125),
        (Light("disc", "area", D65, (0.0, 0.0, 2.0), radius=1.0), math.pi * 0.2),
        (Light("turned", "area", D65, (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), radius=1.0), 0.0),
    ],
    ids=lambda value: value.name if isinstance(value, Light) else "",
)
def test_every_kind_of_light_gives_its_irradiance(light: Light, expected: float) -> None:
    """On a plate below its middle: r²/(r² + h²) of the hemisphere for a disc, half a smoothstep half way down a spot's edge."""
    camera = Camera((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), kind="orthographic", vertical_extent=1e-3)
    picture = render_eye_reference(scene_of(light, plate(Diffuse((1.0, 1.0, 1.0))), camera=camera), 3, 3, samples=2048)
    assert picture.xyz[1, 1, 1] * math.pi == pytest.approx(expected, rel=1e-3, abs=1e-12)


def test_lights_are_seen_from_the_front_through_each_other_and_hide_nothing() -> None:
    front = Light("a", "area", D65, (0.0, 0.0, 3.0), (0.0, 0.0, 1.0), radius=0.2)
    through = Light("b", "area", D65.scaled(2.0), (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), shape="rectangle", width=0.2, height=0.8)
    from_behind = Light("c", "area", D65.scaled(4.0), (0.0, 0.0, 4.0), radius=3.0)
    below = replace(front, position=(0.0, 0.0, -1.0))
    picture = render_eye_reference(scene_of(front, through, from_behind, below, plate(Black())), 21, 21, samples=8)
    y = picture.xyz[..., 1]
    assert y[10, 10] == pytest.approx(3.0) and y[10, 13] == pytest.approx(1.0) and y[4, 10] == pytest.approx(2.0) and y[4, 4] == 0.0


def test_the_suns_disc_is_seen_where_nothing_hides_it() -> None:
    sun = Light("sun", "directional", D65, direction=(0.0, 0.0, -1.0), angular_diameter_deg=8.0)
    up = Camera((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), up=(0.0, 1.0, 0.0), vertical_fov_deg=8.0)
    half = place(primitives.plane(1.0, 1.0), Black(), (0.5, 0.0, 0.5))
    picture = render_eye_reference(scene_of(sun, half, camera=up), 40, 40, samples=64)
    columns = picture.xyz[..., 1].sum(axis=0)
    hidden, seen = sorted([columns[:20].sum(), columns[20:].sum()])
    # Solid angle on the film: π tan² r of 4 tan² r, halved; its radiance 1/(π sin² r).
    assert hidden == 0.0 and seen == pytest.approx(0.5 * math.pi / 4 * 1600 / (math.pi * math.sin(math.radians(4.0)) ** 2), rel=3e-3)


def test_shadow_rays_stop_at_glass() -> None:
    light = Light("l", "directional", D65, direction=(0.0, 0.0, -1.0))
    pane = place(primitives.box((0.5, 0.5, 0.1)), Dielectric(constant_index(1.0)), (0.25, 0.0, 4.0))
    camera = replace(ABOVE, position=(0.0, 0.0, 3.0))
    y = render_eye_reference(scene_of(light, plate(), pane, camera=camera), 20, 20, samples=8).xyz[..., 1]
    assert y[10, 12] == 0.0 and y[10, 8] == pytest.approx(0.8 / math.pi)


# ---- textures and what lies beyond -----------------------------------------------------------


def test_a_texture_lies_upright_and_is_interpolated() -> None:
    rgb = np.random.default_rng(3).random((4, 6, 3)).astype(np.float32)
    light = Light("l", "directional", D65, direction=(0.0, 0.0, -1.0))
    camera = replace(ABOVE, vertical_extent=1.0)
    for wrap in ("clamp", "repeat"):
        page = place(primitives.plane(1.5, 1.0), Diffuse((1.0, 0.5, 1.0), texture=Texture(rgb, wrap)))
        picture = render_eye_reference(scene_of(light, page, camera=camera), 60, 40, samples=32)
        rows, columns = (np.arange(40) + 0.5) / 10 - 0.5, (np.arange(60) + 0.5) / 10 - 0.5
        expected = np.zeros((40, 60, 3))
        for i, y in enumerate(rows):
            for j, x in enumerate(columns):
                for dy in range(2):
                    for dx in range(2):
                        r, c = math.floor(y) + dy, math.floor(x) + dx
                        r, c = (r % 4, c % 6) if wrap == "repeat" else (min(max(r, 0), 3), min(max(c, 0), 5))
                        expected[i, j] += (1 - abs(y - math.floor(y) - dy)) * (1 - abs(x - math.floor(x) - dx)) * rgb[r, c]
        # The mean over a pixel of a bilinear patch is its middle; 32 samples leave a little of the slope.
        np.testing.assert_allclose(picture.rgb() * math.pi, expected * [1.0, 0.5, 1.0], atol=0.012)


def test_the_environment_is_seen_the_way_its_picture_lies() -> None:
    rgb = np.zeros((64, 128, 3), np.float32)
    rgb[:, :, 0] = np.arange(128)
    rgb[:, :, 1] = np.arange(64)[:, None]
    to_local = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # local x is the world's y
    env = Environment(rgb, to_local)
    thing = place(primitives.plane(0.1, 0.1), Black(), (0.0, 0.0, -50.0))

    def looks(direction: tuple[float, float, float], up=(0.0, 0.0, 1.0)) -> np.ndarray:
        camera = Camera((0.0, 0.0, 0.0), direction, up=up, vertical_fov_deg=0.01)
        return render_eye_reference(scene_of(thing, camera=camera, environment=env), 1, 1, samples=8).rgb()[0, 0, :2]

    np.testing.assert_allclose(looks((0.0, 1.0, 0.0)), [63.5, 31.5], atol=0.01)  # the middle
    np.testing.assert_allclose(looks((1.0, 0.0, 0.0)), [95.5, 31.5], atol=0.01)  # to the right of local x is −local y
    np.testing.assert_allclose(looks((-1.0, 0.0, 0.0)), [31.5, 31.5], atol=0.01)
    np.testing.assert_allclose(looks((0.0, 1.0, 1.0))[1], 15.5, atol=0.01)  # 45° up: a quarter from the top
    assert looks((0.0, 0.001, 1.0), up=(0.0, 1.0, 0.0))[1] == pytest.approx(0.0, abs=0.01)
    # The seam joins the last column and the first.
    assert looks((0.0, -1.0, 0.0))[0] == pytest.approx(63.5, abs=1.0)


def test_a_constant_environment_is_exact() -> None:
    rgb = np.array([0.2, 0.7, 1.9])
    thing = place(primitives.plane(0.1, 0.1), Black(), (0.0, 0.0, -50.0))
    camera = Camera((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    flat = Environment(np.broadcast_to(rgb.astype(np.float32), (8, 16, 3)).copy())
    for more in ({"background_rgb": tuple(rgb)}, {"environment": flat}):
        picture = render_eye_reference(scene_of(thing, camera=camera, **more), 4, 4, samples=8)
        np.testing.assert_allclose(picture.xyz, np.broadcast_to(rgb709_to_xyz(rgb), (4, 4, 3)), rtol=1e-6)


# ---- furnaces --------------------------------------------------------------------------------


def ball_scene(*more: SceneObject, material: Material | None = None) -> Scene:
    camera = Camera((0.0, -4.0, 0.3), (0.0, 0.0, 0.0), vertical_fov_deg=32.0)
    ball = place(sphere(1.0, 5120), material or Dielectric(FLINT))
    return scene_of(ball, *more, camera=camera, background_rgb=(1.0, 1.0, 1.0))


def nested() -> Scene:
    inner = place(primitives.box((0.5, 0.6, 0.7)), Dielectric(from_abbe(1.4, 60.0), None, 1), (0.2, 0.0, 0.1))
    mirror = place(sphere(0.4, 320), Mirror((1.0, 1.0, 1.0)), (-1.0, 0.5, 1.0))
    return ball_scene(inner, mirror)


def unit_run(scene: Scene) -> EyeRun:
    """A run in which every wavelength answers with one over the daylight's own power: white is 1 in each path."""
    run = EyeRun(scene, 48, 36)
    spectra = run._spectra
    return_one = np.repeat(1.0 / spectra.daylight[:, None], 3, axis=1)
    run._spectra = spectra._replace(response=return_one, beyond_xyz=np.full_like(spectra.beyond_xyz, 1.0 / 3.0))
    return run


@pytest.mark.parametrize("scene", [ball_scene(), nested()], ids=["ball", "nested"])
def test_glass_in_a_white_room_is_white_path_by_path(scene: Scene) -> None:
    run = unit_run(scene)
    run.advance()
    picture = run.picture()
    lost = picture.lost["depth"] + picture.lost["numeric"]
    assert lost < 1e-5
    assert np.abs(picture.xyz - 1.0).max() < 1e-12 or lost > 0.0 and np.mean(np.abs(picture.xyz - 1.0) > 1e-12) <= lost * picture.samples * 3


def test_glass_in_a_white_room_is_white_in_colour() -> None:
    picture = render_eye_reference(nested(), 32, 24, samples=512)
    assert z_squared(picture, np.broadcast_to(WHITE, picture.xyz.shape)) == pytest.approx(1.4, abs=0.4)
    # 32 × 24 pixels of 512 samples: a hundredth of one per cent of too much or too little light would show.
    np.testing.assert_allclose(picture.xyz.mean(axis=(0, 1)), WHITE, rtol=2e-4)


def test_a_camera_inside_an_absorbing_ball_sees_the_room_by_way_of_its_radius() -> None:
    """From the middle all rays meet the surface upright: T e^(−αR) Σ (R e^(−2αR))^k of the room's light."""
    alpha, n = 0.4, 1.5
    ball = place(sphere(1.0, 20480), Dielectric(constant_index(n), Absorption(np.full(401, alpha))))
    camera = Camera((0.0, 0.0, 0.0), (0.3, 1.0, 0.2), vertical_fov_deg=50.0)
    picture = render_eye_reference(scene_of(ball, camera=camera, background_rgb=(1.0, 1.0, 1.0)), 24, 24, samples=512)
    reflectance = ((n - 1) / (n + 1)) ** 2
    expected = (1 - reflectance) * math.exp(-alpha) / (1 - reflectance * math.exp(-2 * alpha))
    mean, error = picture.xyz[..., 1].mean(), math.sqrt(picture.variance[..., 1].mean() / 576)
    assert abs(mean - expected) < 5.0 * error + 2e-4
    assert abs(mean - math.exp(-alpha)) > 20.0 * error  # the mutant without Fresnel


def test_a_mirrors_tint_is_its_colour() -> None:
    mirror = place(primitives.plane(9.0, 9.0), Mirror((0.9, 0.5, 0.2)))
    picture = render_eye_reference(scene_of(mirror, background_rgb=(2.0, 2.0, 2.0)), 16, 16, samples=512)
    np.testing.assert_allclose(picture.rgb().mean(axis=(0, 1)), [1.8, 1.0, 0.4], rtol=2e-3)


# ---- a slab before an edge -------------------------------------------------------------------

THICKNESS, TILT = 1.0, math.radians(45.0)
GRAZING = math.radians(5.0)
"""The light comes in under the slab."""


def slab_scene(glass: Dispersion) -> Scene:
    """White for x > 0, black elsewhere; seen at 45° through a slab, which shades neither."""
    light = Light("low", "directional", D65.scaled(1.0 / math.sin(GRAZING)), direction=(0.0, math.cos(GRAZING), -math.sin(GRAZING)))
    white = place(primitives.plane(4.0, 8.0), Diffuse((1.0, 1.0, 1.0)), (2.0, 0.0, 0.0))
    black = place(primitives.plane(4.0, 8.0), Black(), (-2.0, 0.0, 0.0))
    slab = place(primitives.box((9.0, 2.0, THICKNESS)), Dielectric(glass), (0.0, 0.0, 2.0))
    edge = float(np.mean(eye_answers.slab_displacement(glass.index(VISIBLE_NM), THICKNESS, TILT)))
    camera = Camera((-10.0 + edge, 0.0, 10.0), (edge, 0.0, 0.0), kind="orthographic", up=(1.0, 0.0, 0.0), vertical_extent=0.06)
    return scene_of(light, white, black, slab, camera=camera)


def slab_column(glass: Dispersion, rows: int, fresnel: str = "exact", sign: float = 1.0) -> np.ndarray:
    """XYZ of a column of pixels, (rows, 3): the edge, once for each wavelength and number of reflections inside."""
    n = glass.index(VISIBLE_NM)
    centre = float(np.mean(eye_answers.slab_displacement(n, THICKNESS, TILT)))
    n = glass.n_d + sign * (n - glass.n_d)
    cosine, inner = math.cos(TILT), np.sqrt(1.0 - (math.sin(TILT) / n) ** 2)
    if fresnel == "exact":
        reflectance = 0.5 * (((cosine - n * inner) / (cosine + n * inner)) ** 2 + ((n * cosine - inner) / (n * cosine + inner)) ** 2)
    else:  # Schlick 1994
        reflectance = ((n - 1) / (n + 1)) ** 2
        reflectance = reflectance + (1 - reflectance) * (1 - cosine) ** 5
    # Along x, row 0 on top is the largest x; a film's length is cos 45° of the plate's.
    border = centre + 0.06 / cosine * (0.5 - np.arange(rows + 1) / rows)
    total = np.zeros((rows, 3))
    offset = eye_answers.slab_offset(n, THICKNESS, TILT)
    for k in range(6):  # 2k reflections inside lead the ray on by 2k offsets: it meets the plate farther along
        # Without glass the pixel at `border` sees x = border; with it x − displacement + 2k offset.
        seen = border[:, None] - eye_answers.slab_displacement(n, THICKNESS, TILT) + 2 * k * offset
        white = np.clip(seen[:-1], 0.0, None) - np.clip(seen[1:], 0.0, None)
        share = white / (border[:-1] - border[1:])[:, None] * (1 - reflectance) ** 2 * reflectance ** (2 * k)
        total += K_M * (share * D65.density) @ cmf_xyz() / math.pi
    return total


@pytest.fixture(scope="module")
def slab_picture() -> EyePicture:
    return render_eye_reference(slab_scene(FLINT), 12, 48, samples=1024)


def slab_z_squared(picture: EyePicture, expected: np.ndarray) -> float:
    """Mean of z² over rows and channels; a row's twelve variances together have 84 degrees of freedom, so that 1.02 is right."""
    variance = picture.variance.sum(axis=1) / 144
    return float(np.mean((picture.xyz.mean(axis=1) - expected) ** 2 / variance))


def test_an_edge_behind_a_slab_has_the_fringe_of_snells_law(slab_picture: EyePicture) -> None:
    """48 rows of three channels that go together: the mean of z² scatters by √(2/48) = 0.2."""
    expected = slab_column(FLINT, 48)
    assert slab_z_squared(slab_picture, expected) < 1.02 + 4 * 0.2
    np.testing.assert_allclose(slab_picture.xyz.mean(axis=1), expected, atol=6e-3 * expected.max())


@pytest.mark.parametrize("mutant", [{"fresnel": "schlick"}, {"sign": -1.0}], ids=str)
def test_wrong_optics_would_show_in_the_fringe(slab_picture: EyePicture, mutant: dict) -> None:
    assert slab_z_squared(slab_picture, slab_column(FLINT, 48, **mutant)) > 4.0


def test_a_pane_of_air_changes_nothing() -> None:
    """Behind a pane of n = 1 every path carries one wavelength, without it all of them: both ways of adding must agree."""
    rgb = np.random.default_rng(5).random((5, 5, 3)).astype(np.float32)
    curve = np.linspace(0.1, 0.9, 401)
    lights = (
        Light("lamp", "area", D65, (0.5, 0.2, 1.0), radius=0.3),
        Light("line", "point", laser(560.0, 0.004), (-0.4, 0.3, 0.8)),
        Light("lines", "point", Spectrum(np.zeros(401), ((450.0, 0.003), (640.0, 0.002))), (0.0, -0.4, 0.8)),
    )
    things = (
        place(primitives.plane(1.0, 1.0), Diffuse((0.9, 0.8, 1.0), texture=Texture(rgb)), (-0.5, 0.0, 0.0)),
        place(primitives.plane(1.0, 1.0), Diffuse(reflectance=curve), (0.5, 0.0, 0.0)),
    )
    pane = place(primitives.box((4.0, 4.0, 0.1)), Dielectric(constant_index(1.0)), (0.0, 0.0, 5.0))
    straight = render_eye_reference(scene_of(*lights, *things), 16, 16, samples=2048)
    behind = render_eye_reference(scene_of(*lights, *things, pane), 16, 16, samples=2048)
    assert behind.relmse > 3.0 * straight.relmse  # which is why
    np.testing.assert_allclose(behind.xyz, straight.xyz, rtol=0.03)
    for half in (np.s_[:, :8], np.s_[:, 8:]):  # texture; spectral reflectance: means to 6e-4, so 3e-3 too much would show
        error = np.sqrt((behind.variance + straight.variance)[half].sum(axis=(0, 1))) / 128
        mean = straight.xyz[half].mean(axis=(0, 1))
        assert (error < 6e-4 * mean).all()
        assert (np.abs(behind.xyz[half].mean(axis=(0, 1)) - mean) < 4.5 * error).all()


# ---- a prism before an edge, against the exact trace -----------------------------------------


def test_an_edge_behind_a_prism_stands_where_the_exact_trace_puts_it() -> None:
    """Two laser lines through 20° of flint: each line's edge, from the share of white it leaves, to a fiftieth of a pixel."""
    apex, rows, lines = math.radians(20.0), 64, (486.1327, 656.2725)
    faces = eye_answers.prism_faces(apex, 5.0, 1.2)
    angle = {nm: eye_answers.viewing_angle(faces, (float(FLINT.index(nm)), 1.0), 9.0, 0.0, 0.0, 0.3) for nm in lines}
    middle = 0.5 * sum(angle.values())
    c, s = math.cos(apex / 2), math.sin(apex / 2)
    outline = np.array([(0.0, 0.6 / math.tan(apex / 2)), (-0.6 - 2 * s / c, -2.0), (0.6 + 2 * s / c, -2.0)])
    vertices = np.concatenate([np.column_stack([outline[:, 0] + 5.6, np.full(3, w), outline[:, 1]]) for w in (-2.0, 2.0)])
    triangles = [(0, 1, 2), (3, 5, 4), (0, 3, 1), (1, 3, 4), (1, 4, 2), (2, 4, 5), (2, 5, 0), (0, 5, 3)]
    mesh = primitives.make_mesh("wedge", vertices, triangles)
    mesh = mesh if mesh.volume() > 0.0 else mesh.flipped()
    turn = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])  # the plane's front to −x, its x to z
    white = place(primitives.plane(2.0, 4.0), Diffuse((1.0, 1.0, 1.0)), (9.0, 0.0, 1.0), turn)
    black = place(primitives.plane(2.0, 4.0), Black(), (9.0, 0.0, -1.0), turn)
    camera = Camera((0.0, 0.0, 0.0), (math.cos(middle), 0.0, math.sin(middle)), vertical_fov_deg=3.0)
    # Even light from between prism and screen.
    lit = [Light("l", "directional", laser(nm, 1.0), direction=(math.sin(0.35), 0.0, -math.cos(0.35))) for nm in lines]
    edges = []
    for light in lit:
        glass = place(mesh, Dielectric(FLINT))
        y = render_eye_reference(scene_of(light, glass, white, black, camera=camera), 3, rows, samples=2048).xyz[..., 1].mean(axis=1)
        whole = np.polyval(np.polyfit(np.arange(20), y[:20], 1), np.arange(rows))  # Fresnel's share changes a little
        at = 1.0 - 2.0 / rows * float(np.sum(y / whole))
        edges.append(middle + math.atan(at * math.tan(math.radians(1.5))))
    pixel = math.radians(3.0) / rows
    errors = np.array([edge - angle[nm] for edge, nm in zip(edges, lines, strict=True)])
    assert (np.abs(errors) < 0.1 * pixel).all()
    fringe = edges[0] - edges[1]
    assert fringe == pytest.approx(angle[lines[0]] - angle[lines[1]], abs=0.03 * pixel) and fringe > 4.0 * pixel


def test_closed_forms_agree_with_each_other() -> None:
    n = np.array([1.5168, 1.62])
    # T2 of the known answers: N-BK7 at minimum deviation; a thin prism's limit is the thin formula.
    assert math.degrees(eye_answers.prism_deviation(1.5168, math.pi / 3, math.radians(49.32335))) == pytest.approx(38.6467, abs=1e-5)
    np.testing.assert_allclose(eye_answers.prism_deviation(n, 1e-4, 0.0), eye_answers.thin_prism_deviation(n, 1e-4), rtol=1e-6)
    assert np.isnan(eye_answers.prism_deviation(1.7847, math.pi / 2, 0.0))
    apex = math.radians(0.2)
    low, high = (eye_answers.height_on_screen(eye_answers.prism_faces(apex, 5.0, 0.001), (k, 1.0), 0.0, 15.0) for k in n)
    assert low - high == pytest.approx(eye_answers.thin_prism_fringe(n[1], n[0], apex, 10.0), rel=1e-3)
    # T3: a slab at 45°.
    assert eye_answers.slab_offset(1.5168, 1.0, TILT) == pytest.approx(0.526946, abs=1e-6)
    assert eye_answers.slab_lateral_shift(1.5168, 1.0, TILT) == pytest.approx(0.334499, abs=1e-6)
    assert eye_answers.slab_displacement_derivative(1.5168, -0.041799e-3, 1.0, TILT) == pytest.approx(-0.018554e-3, abs=1e-8)
    # A lens: matrices against the trace near the axis, thin against thick.
    faces = eye_answers.plano_convex_faces(10.0, 8.0, 0.5)
    for k in n:
        seen = math.tan(eye_answers.viewing_angle(faces, (k, 1.0), 11.0, 1e-4, 0.0, 0.2)) / 1e-4
        assert seen == pytest.approx(eye_answers.thick_seen_tangent(k, 10.0, 0.5, 8.0, 2.5, 1.0), rel=1e-6)
        thin = eye_answers.seen_tangent(eye_answers.plano_convex_focal_length(k, 10.0), 8.0, 3.0, 1.0)
        assert thin == pytest.approx(eye_answers.thick_seen_tangent(k, 10.0, 1e-9, 8.0, 3.0, 1.0), rel=1e-8)
    with pytest.raises(ValueError, match="total reflection"):
        eye_answers.trace(eye_answers.prism_faces(math.pi / 2, 5.0, 1.0), (1.7847, 1.0), (0.0, 0.0), 0.0)


# ---- caustics --------------------------------------------------------------------------------


def caustic_scene(*more: SceneObject) -> Scene:
    """A beam through a prism on to a plate that the camera sees from above."""
    light = Light("beam", "collimated", D65.scaled(3.0), (-0.2, 0.0, 3.0), (0.0, 0.0, -1.0), shape="rectangle", width=0.3, height=0.6)
    prism = place(primitives.prism(50.0, 1.0, 1.0), Dielectric(FLINT), (0.0, 0.0, 1.6))
    camera = Camera((0.9, -3.0, 4.0), (1.2, 0.0, 0.0), vertical_fov_deg=38.0)
    return scene_of(light, prism, plate(size=8.0), *more, camera=camera)


PLAN = CausticPlan(photons=1 << 18, bins=40)


def test_the_caustic_is_that_of_the_light_reference() -> None:
    """Where it is seen directly: the sums of blocks of both pictures, of 2.6e5 and 1e6 photons, agree to 3 % of the
    brightest (half a texel at a border is 2.5 % of a block) and to 0.4 % in all."""
    scene = caustic_scene()
    caustic = build_caustic(scene, 36, 24, replace(PLAN, texel_size=0.02))
    assert caustic.relmse < 0.01 and caustic.outside_w < 0.5 * caustic.landed_w
    lit = render_eye_reference(scene, 36, 24, samples=256, caustic=caustic)
    dark = render_eye_reference(scene, 36, 24, samples=256)
    light = render_reference(scene, 36, 24, photons=1 << 20)
    seen = seen_directly(scene, 36, 24)
    blocks = [(np.where(seen[..., None], p, 0.0)).reshape(12, 2, 18, 2, 3).mean(axis=(1, 3)) for p in (lit.xyz - dark.xyz, light.xyz())]
    assert blocks[1].max() > 0.1
    np.testing.assert_allclose(blocks[0], blocks[1], atol=0.03 * blocks[1].max())
    np.testing.assert_allclose(blocks[0].sum(axis=(0, 1)), blocks[1].sum(axis=(0, 1)), rtol=4e-3)


def test_a_caustic_behind_a_pane_of_air_is_the_same() -> None:
    """One wavelength at a time from its bin, or all bins at once."""
    pane = place(primitives.box((8.0, 8.0, 0.02)), Dielectric(constant_index(1.0)), (0.0, 0.0, 3.4))
    scene, behind = caustic_scene(), caustic_scene(pane)
    caustic = build_caustic(scene, 24, 16, PLAN)
    straight = render_eye_reference(scene, 24, 16, samples=2048, caustic=caustic)
    through = EyeRun(behind, 24, 16, caustic=replace(caustic, tables=caustic.tables._replace(side=np.vstack([caustic.tables.side, [[-1, -1]]]).astype(np.int32))))
    while through.samples < 2048:
        through.advance()
    picture = through.picture()
    # The pane is below the camera and above the beam, so it hides nothing that is lit.
    # A caustic has dark places where few samples find light, so blocks are compared: to 2 % of the brightest.
    blocks = [p.xyz.reshape(8, 2, 12, 2, 3).mean(axis=(1, 3)) for p in (picture, straight)]
    np.testing.assert_allclose(blocks[0], blocks[1], atol=0.02 * blocks[1].max())
    error = np.sqrt((picture.variance + straight.variance).sum(axis=(0, 1)))
    total = straight.xyz.sum(axis=(0, 1))
    assert (error < 0.01 * total).all()
    assert (np.abs(picture.xyz.sum(axis=(0, 1)) - total) < 4.5 * error).all()


def test_every_line_of_a_laser_has_a_bin_of_its_own() -> None:
    scene = caustic_scene()
    red_and_blue = Spectrum(np.zeros(401), ((450.0, 1.0), (640.0, 1.0)))
    scene = replace(scene, lights=(replace(scene.lights[0], spectral_power=red_and_blue),))
    caustic = build_caustic(scene, 24, 16, replace(PLAN, photons=1 << 14, bins=8))
    assert caustic.tables.bins == 10
    side = int(np.flatnonzero(np.prod(caustic.tables.size[:, 1], axis=1))[0])
    bins = caustic.irradiance(side, 1).sum(axis=(0, 1))
    assert (bins[:8] == 0.0).all() and (bins[8:] > 0.0).all()


def test_a_curved_receiver_is_refused_by_name() -> None:
    scene = caustic_scene(place(sphere(0.4, 320), Diffuse(), (1.1, 0.0, 0.4)))
    with pytest.raises(UserError, match="sphere.*not flat"):
        build_caustic(scene, 12, 8, PLAN)


# ---- its own error, limits, the cache --------------------------------------------------------


def test_its_own_error_is_true() -> None:
    """The scatter of ten whole pictures is the variance they claim: over 200 pixels behind glass the ratio's 4 σ is 0.3."""
    runs = [render_eye_reference(slab_scene(FLINT), 10, 20, samples=64, seed=seed) for seed in range(10)]
    observed = np.var([run.xyz[..., 1] for run in runs], axis=0, ddof=1).sum()
    claimed = np.mean([run.variance[..., 1] for run in runs], axis=0).sum()
    assert observed / claimed == pytest.approx(1.0, abs=0.3)


def test_the_picture_grows_in_the_cache(tmp_path: Path) -> None:
    scene = slab_scene(FLINT)
    first = cached_eye_reference(scene, 8, 12, samples=16, folder=tmp_path)
    again = cached_eye_reference(scene, 8, 12, samples=8, folder=tmp_path)
    assert first.samples == again.samples == 16 and np.array_equal(first.xyz, again.xyz)
    more = cached_eye_reference(scene, 8, 12, samples=64, folder=tmp_path)
    at_once = render_eye_reference(scene, 8, 12, samples=64)
    np.testing.assert_allclose(more.xyz, at_once.xyz, rtol=1e-9, atol=1e-15)
    good_enough = cached_eye_reference(scene, 8, 12, target_relmse=more.relmse * 1.01, folder=tmp_path)
    assert good_enough.samples == 64
    (stored,) = tmp_path.glob("*.npz")
    stored.write_bytes(stored.read_bytes()[:500])
    assert cached_eye_reference(scene, 8, 12, samples=16, folder=tmp_path).samples == 16


def test_limits() -> None:
    with pytest.raises(ValueError, match="limit"):
        render_eye_reference(slab_scene(FLINT), 4, 4)
    rough = render_eye_reference(slab_scene(FLINT), 8, 12, target_relmse=0.01)
    assert 0.0 < rough.relmse <= 0.01
    assert render_eye_reference(slab_scene(FLINT), 8, 12, seconds=0.05).samples > 0
    stopped = render_eye_reference(slab_scene(FLINT), 8, 12, samples=10**9, cancelled=iter([False, True]).__next__)
    assert 0 < stopped.samples < 10**9


def test_the_key_knows_textures_and_what_lies_beyond() -> None:
    rgb = np.ones((2, 2, 3), np.float32)
    scene = scene_of(Light("l", "point", D65, (0, 0, 1)), plate(Diffuse(texture=Texture(rgb))))
    other_texture = replace(scene, objects=(plate(Diffuse(texture=Texture(0.5 * rgb))),))
    room = Environment(rgb)
    keys = [
        eye_scene_key(scene, 8, 8, 64, None),
        eye_scene_key(scene, 8, 8, 64, CausticPlan()),
        eye_scene_key(scene, 8, 8, 64, CausticPlan(photons=5)),
        eye_scene_key(other_texture, 8, 8, 64, None),
        eye_scene_key(replace(scene, objects=(plate(Diffuse(texture=Texture(rgb, "clamp"))),)), 8, 8, 64, None),
        eye_scene_key(replace(scene, background_rgb=(0.1, 0.1, 0.1)), 8, 8, 64, None),
        eye_scene_key(replace(scene, environment=room), 8, 8, 64, None),
        eye_scene_key(replace(scene, environment=replace(room, world_to_local=np.diag([-1.0, -1.0, 1.0]))), 8, 8, 64, None),
        eye_scene_key(replace(scene, environment=replace(room, rgb=2.0 * rgb)), 8, 8, 64, None),
    ]
    assert len(set(keys)) == len(keys)
    assert eye_scene_key(replace(scene, name="other", environment=replace(room, source="elsewhere")), 8, 8, 64, None) == keys[6]
    np.testing.assert_allclose(K_M * (rgb_basis() @ np.ones(3) * daylight_per_lumen()) @ cmf_xyz(), WHITE, rtol=1e-9)
