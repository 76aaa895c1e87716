"""The camera's pass through glass and over mirrors, against radiances that can be written down.

Where light is thrown to and fro between surfaces a camera sees all of it: expectations sum up every inner reflection. A
constant background seen through clear glass tells nothing of Fresnel's weights (glass then vanishes, which
`test_camera_furnace.py` asks for), so these scenes have a black side.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.lights import DirectionalLight, PointLight
from spectrasplat.model.optics import glass
from spectrasplat.model.optics.colorimetry import attenuation_from_colour, rgb_basis
from spectrasplat.model.scene import (
    Absorption,
    Black,
    Camera,
    Dielectric,
    Mirror,
    SceneObject,
)

from tests.gpu.camera_rig import (
    ABOVE,
    DOWN,
    WHITE,
    at,
    floor,
    floor_points,
    horizontal,
    point_light_radiance,
    quad,
    render,
    white_through,
)

EVERY_PART = 1e-7
"""Split threshold at which chance decides over less than float32 can tell."""
BLACK_FLOOR = horizontal(-9, 9, -9, 9, -2.0, Black(), "black")


def slab(n: float, thickness=0.5, absorption=None, z=0.0, name="slab") -> SceneObject:
    return SceneObject(name, primitives.box((8, 8, thickness)), Dielectric(glass.constant(n), absorption), at(0, 0, z))


def fresnel(n: float, incidence_rad: float = 0.0) -> float:
    """Reflectance of unpolarised light from air, by Fresnel's formulas for the angles."""
    if incidence_rad == 0.0:
        return ((n - 1) / (n + 1)) ** 2
    r = np.arcsin(np.sin(incidence_rad) / n)
    s, p = np.sin(incidence_rad - r) / np.sin(incidence_rad + r), np.tan(incidence_rad - r) / np.tan(incidence_rad + r)
    return 0.5 * (s**2 + p**2)


def stack_reflectance(surfaces: list[float], kept: list[float]) -> float:
    """Reflectance of surfaces behind each other, `kept` of the light left after each gap: incoherent sums over all
    inner reflections."""
    total = surfaces[-1]
    for surface, left in zip(surfaces[-2::-1], kept[::-1], strict=True):
        behind = total * left**2
        total = surface + (1 - surface) ** 2 * behind / (1 - surface * behind)
    return total


@pytest.mark.core
def test_slab_before_a_black_floor_reflects_from_both_faces(gl):
    rgb = render(gl, [slab(1.5), BLACK_FLOOR], background=(1, 2, 3), split_threshold=EVERY_PART)
    assert rgb[5, 5] == pytest.approx(np.array([1, 2, 3]) * stack_reflectance([0.04, 0.04], [1.0]), rel=1e-4)
    assert stack_reflectance([0.04, 0.04], [1.0]) == pytest.approx(2 * 0.04 / 1.04)  # the textbook's pile of one plate


def test_chance_for_the_weak_parts_leaves_the_mean_as_it_is(gl):
    """The usual threshold: what chance decides of a sample weighs 0.0384² / 0.96, so that 12 288 samples tell the mean
    to 6e-5 (one sigma).

    Without the factor for what was not chosen the slab would be 4e-4 darker for each reflection that is lost.
    """
    rgb = render(gl, [slab(1.5), BLACK_FLOOR], background=(1, 1, 1), samples=16)
    spread = 0.0384 * np.sqrt(0.04 * 0.96) / np.sqrt(rgb[..., 1].size * 16)
    assert rgb[..., 1].mean(dtype=float) == pytest.approx(stack_reflectance([0.04, 0.04], [1.0]), abs=4.0 * spread)


@pytest.mark.core
def test_absorption_follows_beers_law(gl):
    clear = slab(1.5, absorption=Absorption(np.full(401, 1.3)))
    kept = np.exp(-1.3 * 0.5)
    rgb = render(gl, [clear], background=(1, 1, 1), split_threshold=EVERY_PART)
    through = 0.96**2 * kept / (1 - (0.04 * kept) ** 2)
    assert rgb[5, 5] == pytest.approx(through + stack_reflectance([0.04, 0.04], [kept]), rel=1e-4)


def test_coloured_glass_takes_away_wavelength_by_wavelength(gl):
    """Two thicknesses of strongly coloured glass: what is seen is D65 · exp(−α(λ) d) over the observer, not each
    channel's own power law."""
    alpha = attenuation_from_colour((0.9, 0.4, 0.1), 0.5)
    one = slab(1.0 + 1e-6, absorption=Absorption(alpha))
    thick = replace(one, mesh=primitives.box((8, 8, 1.5)))
    for item, distance in ((one, 0.5), (thick, 1.5)):
        rgb = render(gl, [item], background=(1, 1, 1))[5, 5]
        # 48 stretches of the spectrum are told apart, each by what its middle lets through.
        assert rgb == pytest.approx(white_through(np.exp(-alpha * distance)), abs=4e-3)
    per_channel = np.array([0.9, 0.4, 0.1]) ** 3
    assert np.abs(per_channel - white_through(np.exp(-alpha * 1.5))).max() > 0.03  # what the old way would have shown


def test_a_camera_may_stand_in_glass(gl):
    solid = slab(1.5, absorption=Absorption(np.full(401, 1.3)))
    camera = replace(ABOVE, position=(0.3, 0.1, 0), target=(0.3, 0.1, 1))
    rgb = render(gl, [solid], background=(1, 1, 1), camera=camera, split_threshold=EVERY_PART)
    near, across = np.exp(-1.3 * 0.25), np.exp(-1.3 * 0.5)
    assert rgb[5, 5] == pytest.approx(0.96 * near / (1 - 0.04 * across), rel=1e-4)


def test_cemented_solids_have_no_film_of_air(gl):
    """Two touching slabs of n 1.5 and 1.6: the middle surface reflects (0.1/3.1)², not 4 + 5 %."""
    objects = [slab(1.5, name="low"), slab(1.6, z=0.5, name="high"), BLACK_FLOOR]
    rgb = render(gl, objects, background=(1, 1, 1), split_threshold=EVERY_PART)
    surfaces = [(0.6 / 2.6) ** 2, (0.1 / 3.1) ** 2, 0.04]
    assert rgb[5, 5] == pytest.approx(stack_reflectance(surfaces, [1.0, 1.0]), rel=1e-3)
    assert stack_reflectance([surfaces[0], (0.6 / 2.6) ** 2, 0.04, 0.04], [1.0] * 3) > 1.5 * stack_reflectance(
        surfaces, [1.0, 1.0]
    )


def test_a_smooth_glass_ball_is_a_lens(gl):
    """Through a smooth ball the ray at height h leaves by δ = 2 (i − r) and lands where optics says.

    After one reflection inside it leaves upwards; after two, a thousandth of it lands on the floor: within the
    tolerance.
    """
    n, height = 1.5168, 2.0
    ball = SceneObject("ball", primitives.sphere(1.0, 20_480), Dielectric(glass.constant(n)), at(0, 0, height))
    camera = replace(ABOVE, vertical_extent=1.1)
    lamp = PointLight("lamp", WHITE, position=(2.5, 0, 0.6))
    rgb = render(gl, [floor(0.8), ball], [lamp], size=(24, 24), camera=camera, split_threshold=EVERY_PART)[..., 1]
    points = floor_points((24, 24), camera)
    h = np.linalg.norm(points[..., :2], axis=-1)
    outward = points[..., :2] / h[..., None]
    i, r = np.arcsin(h), np.arcsin(h / n)
    turn = 2 * (i - r)  # towards the axis
    exit_angle = i - turn  # polar angle of the exit point, on the lower side
    exit_h, exit_z = np.sin(exit_angle), height - np.cos(exit_angle)
    landing = exit_h - exit_z * np.tan(turn)
    lit = np.concatenate([outward * landing[..., None], np.zeros((24, 24, 1))], axis=-1)
    through = (1 - np.vectorize(fresnel)(n, i)) ** 2
    visible = h < 0.7
    expected = through * point_light_radiance(lit, lamp.position)
    # 20 480 facets bend the exit point by up to 1e-3 of the radius; what the lamp's shadow ray meets is glass or not.
    unshadowed = visible & (rgb > 0.1 * expected.min())
    assert unshadowed.sum() > 0.9 * visible.sum()
    assert rgb[unshadowed] == pytest.approx(expected[unshadowed], rel=0.01)


def test_refraction_shifts_what_lies_behind(gl):
    """A point light's floor through a slab seen at 45°: shifted by the slab, and again, fainter, for every two
    reflections inside."""
    n = 1.5168
    plate = SceneObject("slab", primitives.box((30, 30, 1.0)), Dielectric(glass.constant(n)), at(0, 0, 2.0))
    camera = Camera(position=(0, -8, 10), target=(0, -1, 3), up=(0, 0, 1), kind="orthographic", vertical_extent=1.0)
    lamp = PointLight("lamp", WHITE, position=(0, 3.0, 0.8))
    rgb = render(gl, [floor(20), plate], [lamp], camera=camera, split_threshold=EVERY_PART)[..., 1]
    direct = floor_points((32, 24), camera)
    inside = np.arcsin(np.sin(np.radians(45)) / n)
    r = fresnel(n, np.radians(45))
    expected = 0.0
    for order in range(4):
        points = direct.copy()
        # Each passage advances by tan of the angle inside, where without the slab it would be one unit for one passage.
        points[..., 1] += (2 * order + 1) * np.tan(inside) - 1.0
        expected = expected + (1 - r) ** 2 * r ** (2 * order) * point_light_radiance(points, lamp.position)
    assert rgb == pytest.approx(expected, rel=2e-4)


def test_total_reflection_loses_nothing(gl):
    """A right-angle prism turns the view by 90° with only two Fresnel losses."""
    corners = np.array([[-1, -1, -1], [1, -1, -1], [-1, -1, 1], [-1, 1, -1], [1, 1, -1], [-1, 1, 1]], float)
    faces = np.array([[0, 1, 2], [3, 5, 4], [0, 3, 4], [0, 4, 1], [0, 2, 5], [0, 5, 3], [1, 4, 5], [1, 5, 2]])
    prism = SceneObject("prism", make_mesh("prism", corners, faces), Dielectric(glass.constant(1.6)))
    screen = quad([[-4, -6, -6], [-4, 6, -6], [-4, 6, 6], [-4, -6, 6]], Mirror((0, 0, 0)), "black mirror")
    camera = Camera(position=(0, 0, -10), target=(0, 0, 0), up=(0, 1, 0), kind="orthographic", vertical_extent=1.0)
    background = render(gl, [prism], camera=camera, background=(1, 1, 1), split_threshold=EVERY_PART)[..., 1]
    assert background == pytest.approx(1.0, rel=1e-4)
    # It looks towards -x, where the black mirror now stands: what is left went back at one of the two faces that light
    # passes, as from a plate.
    turned = render(gl, [prism, screen], camera=camera, background=(1, 1, 1), split_threshold=EVERY_PART)[..., 1]
    r = fresnel(1.6)
    assert turned == pytest.approx(stack_reflectance([r, r], [1.0]), rel=1e-3)


def test_a_mirror_has_its_colour(gl):
    rgb = render(gl, [horizontal(-6, 6, -6, 6, 0, Mirror((0.9, 0.5, 0.25)), "mirror")], background=(1, 1, 1))
    assert rgb[12, 16] == pytest.approx([0.9, 0.5, 0.25], abs=5e-3)


def test_mirrors_chain_and_tint(gl):
    """Over the first, the second and the first again: their spectra multiply, wavelength by wavelength."""
    first, second = (0.9, 0.5, 0.25), (1.0, 0.5, 1.0)
    tilted = quad([[-3, -3, -3], [3, -3, 3], [3, 3, 3], [-3, 3, -3]], Mirror(first), "first")
    facing = quad([[-6, -9, -9], [-6, 9, -9], [-6, 9, 9], [-6, -9, 9]], Mirror(second), "second")
    rgb = render(gl, [tilted, facing], background=(1, 1, 1))[12, 16]
    basis = rgb_basis()
    expected = white_through((basis @ np.array(first)) ** 2 * (basis @ np.array(second)))
    # Stretches of the spectrum, each by its middle.
    assert rgb == pytest.approx(expected, abs=5e-3)
    assert np.abs(np.array(first) ** 2 * second - expected).max() > 0.05  # channel by channel would be told from this


def test_the_sun_glints_in_a_mirror(gl):
    flat = horizontal(-6, 6, -6, 6, 0, Mirror((0.5, 0.5, 0.5)), "mirror")
    sun = DirectionalLight("sun", WHITE, direction=DOWN, angular_diameter_deg=2.0)
    camera = Camera(position=(0, 0, 4), target=(0, 0, 0), up=(0, 1, 0), vertical_fov_deg=4.0)
    rgb = render(gl, [flat], [sun], size=(48, 48), camera=camera)[..., 1]
    solid_angle = np.pi * np.sin(np.radians(1.0)) ** 2
    assert rgb[24, 24] == pytest.approx(0.5 * 1000 / solid_angle, rel=1e-4)
    # Radiance over the picture adds up to the reflected irradiance.
    pixel = (2 * np.tan(np.radians(2.0)) / 48) ** 2
    assert rgb.sum() * pixel == pytest.approx(0.5 * 1000, rel=0.005)
