"""The reference renderer against closed forms: places, Fresnel, Beer, every light's power, the pixel's measure, its own
error.

Counts are about 1e5 photons of a scrambled Sobol sequence: fluxes scatter by 1e-4 to 2e-3, and each
test's tolerance is at least four of its own standard deviations; the mutants at the end must fail.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reference.lamps import cosine, isotropic, lamp, lopsided
from spectrasplat.base.paths import assets_dir
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.primitives_round import sphere
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.lights import AreaLight, CollimatedLight, DirectionalLight, PointLight, SpotLight
from spectrasplat.model.lights.point import spot_solid_angle_sr
from spectrasplat.model.optics.colorimetry import K_M, rgb709_to_xyz, xyz_to_rgb709
from spectrasplat.model.optics.glass import constant as constant_index
from spectrasplat.model.optics.spectrum import cmf_at, constant, laser
from spectrasplat.model.scene import (
    Absorption,
    Black,
    Camera,
    Dielectric,
    Diffuse,
    Light,
    Mirror,
    Scene,
    SceneObject,
)
from spectrasplat.model.texture import Texture
from spectrasplat.reference import photon_emission, photon_emit, photon_reference, sampling
from spectrasplat.reference.photon_reference import cached_reference, reference_key, render_reference

from tests.unit.camera_scenes import ABOVE, place, scene_of

N_SLAB = 1.5168
SINK = Mirror((0.0, 0.0, 0.0))
"""A specular object that swallows light: what it absorbs is the flux that falls on it."""


@pytest.fixture(autouse=True)
def short_pilot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photon_reference, "_PILOT_PHOTONS", 1 << 12)


def turned(axis: int, angle_deg: float) -> np.ndarray:
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    rotation = np.eye(3)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    rotation[[i, i, j, j], [i, j, i, j]] = c, -s, s, c
    return rotation


# ---- one slab: place, Fresnel, Beer -------------------------------------------------------


def slab_scene(absorption: Absorption | None = None) -> tuple[Scene, float, float]:
    """A pencil of laser light meets a slab at 45°; the camera sees 0.01 units round the landing point of T3.

    Returns the scene, the pixel area and the length of the way through the glass.
    """
    light = CollimatedLight(
        "pencil",
        laser(550.0, 1.0 / (math.pi * 1e-12)),
        (-6.0, 0.0, 8.0),
        (math.sqrt(0.5), 0.0, -math.sqrt(0.5)),
        radius=1e-6,
    )
    slab = place(primitives.box((4.0, 4.0, 1.0)), Dielectric(constant_index(N_SLAB), absorption), (0.0, 0.0, 2.5))
    floor = place(primitives.plane(40.0, 40.0), Diffuse((0.8, 0.8, 0.8)))
    sine = math.sqrt(0.5) / N_SLAB
    lands = -6.0 + (8.0 - 1.0) + math.tan(math.asin(sine))
    camera = Camera((lands, 0.0, 1.5), (lands, 0.0, 0.0), up=(0.0, 1.0, 0.0), kind="orthographic", vertical_extent=0.01)
    return scene_of(light, slab, floor, camera=camera), (0.01 / 11) ** 2, 1.0 / math.sqrt(1.0 - sine**2)


def through_slab(absorption: Absorption | None = None) -> tuple[np.ndarray, float, float]:
    scene, area, way = slab_scene(absorption)
    return render_reference(scene, 11, 11, photons=1 << 17).xyz, area, way


def test_a_pencil_lands_where_the_slab_sends_it_with_fresnels_share() -> None:
    xyz, area, _ = through_slab()
    assert np.count_nonzero(xyz[..., 1]) == 1 and xyz[5, 5, 1] > 0.0
    cosine_i, cosine_t = math.sqrt(0.5), math.sqrt(1.0 - 0.5 / N_SLAB**2)
    s = (cosine_i - N_SLAB * cosine_t) / (cosine_i + N_SLAB * cosine_t)
    p = (N_SLAB * cosine_i - cosine_t) / (N_SLAB * cosine_i + cosine_t)
    transmitted = (1.0 - 0.5 * (s * s + p * p)) ** 2
    expected = K_M * cmf_at(550.0) * transmitted * 0.8 / math.pi / area
    np.testing.assert_allclose(xyz[5, 5], expected, rtol=4e-3)


def test_absorption_is_beers_law_over_the_way_in_the_glass() -> None:
    clear, _, way = through_slab()
    tinted, _, _ = through_slab(Absorption(np.full(401, 0.7)))
    # The same photons in both, so the ratio has no noise.
    assert tinted[5, 5, 1] / clear[5, 5, 1] == pytest.approx(math.exp(-0.7 * way), rel=1e-9)


def test_a_texture_counts_where_the_photon_lands() -> None:
    plain, _, _ = slab_scene()
    red = np.array([0.5, 0.25, 0.125], np.float32)
    # The pencil lands on a strip of that colour.
    rgb = np.ones((1, 40, 3), np.float32)
    tile = math.floor(plain.camera.target[0] + 20.0)
    rgb[0, tile - 1 : tile + 2] = red
    floor = plain.objects[1]
    worn = replace(floor, material=Diffuse((0.8, 0.8, 0.8), texture=Texture(rgb)))
    without, with_it = (
        render_reference(scene, 11, 11, photons=1 << 15).rgb[5, 5]
        for scene in (plain, replace(plain, objects=(plain.objects[0], worn)))
    )
    np.testing.assert_allclose(with_it, red * without, rtol=1e-6)
    assert without.max() > 0.0


# ---- every light's power -----------------------------------------------------------------


def flux_on_sink(light: Light, *objects: SceneObject) -> float:
    """W, for a light of 1 W (per quantity) in the visible."""
    picture = render_reference(scene_of(light, *objects), 4, 4, photons=1 << 17)
    return picture.fates["absorbed"]


ONE = constant(1.0 / 401.0)
PLATE = place(primitives.plane(2.0, 2.0), SINK)
DOWN = {"position": (0.0, 0.0, 1.5), "direction": (0.0, 0.0, -1.0)}


def square_factor(side: float, distance: float) -> float:
    """Form factor of two equal coaxial squares (Howell, configuration C-11)."""
    x = side / distance
    q = math.sqrt(1.0 + x * x)
    return (
        2.0
        / (math.pi * x * x)
        * (math.log(q * q / math.sqrt(1.0 + 2.0 * x * x)) + 2.0 * x * q * math.atan(x / q) - 2.0 * x * math.atan(x))
    )


def test_lamps_have_their_files_power(tmp_path: Path) -> None:
    box = place(primitives.box((3.0, 2.0, 4.0)), SINK, (0.3, 0.1, -0.4))
    for text in (isotropic(), cosine(), lopsided()):
        light = lamp(tmp_path, ONE, text, position=(0.2, 0.3, 0.1), direction=(0.6, 0.0, -0.8), rotation_deg=50.0)
        assert flux_on_sink(light, box) == pytest.approx(light.profile.integral_sr, rel=4e-3)
    # A Lambertian point over a square: π times the form factor of four quarters (Howell, configuration B-4).
    side = 1.0 / 1.5
    root = math.sqrt(1.0 + side * side)
    seen = 4.0 * (side / root) * math.atan(side / root) / math.pi
    assert flux_on_sink(lamp(tmp_path, ONE, cosine(), **DOWN), PLATE) == pytest.approx(math.pi * seen, rel=4e-3)


@pytest.mark.parametrize(
    ("light", "expected"),
    [
        (PointLight("point", ONE, (0.0, 0.0, 1.5)), 4.0 * math.atan(1.0 / (1.5 * math.sqrt(1.5**2 + 2.0)))),
        (
            SpotLight("spot", ONE, **DOWN, inner_half_angle_deg=10.0, outer_half_angle_deg=30.0),
            spot_solid_angle_sr(10.0, 30.0),
        ),
        (
            SpotLight("hard", ONE, **DOWN, inner_half_angle_deg=25.0, outer_half_angle_deg=25.0),
            spot_solid_angle_sr(25.0, 25.0),
        ),
        (DirectionalLight("slanted", ONE, direction=(0.6, 0.0, -0.8)), 4.0 * 0.8),
        (DirectionalLight("sun", ONE, direction=(0.0, 0.0, -1.0), angular_diameter_deg=8.0), 4.0),
        (CollimatedLight("beam", ONE, **DOWN, radius=0.7), math.pi * 0.49),
        (CollimatedLight("sheet", ONE, **DOWN, shape="rectangle", width=0.3, height=3.0), 0.6),
        (
            AreaLight("panel", ONE, **DOWN, shape="rectangle", width=2.0, height=2.0),
            math.pi * 4.0 * square_factor(2.0, 1.5),
        ),
    ],
    ids=lambda value: value.name if isinstance(value, Light) else "",
)
def test_every_light_has_its_power(light: Light, expected: float) -> None:
    assert flux_on_sink(light, PLATE) == pytest.approx(expected, rel=4e-3)


def test_a_point_among_mirrors_shines_all_round() -> None:
    """The cube of planes: inside a closed box every photon is swallowed."""
    box = place(primitives.box((3.0, 2.0, 4.0)), SINK, (0.3, 0.1, -0.4))
    assert flux_on_sink(PointLight("lamp", ONE, (0.2, 0.3, 0.1)), box) == pytest.approx(4.0 * math.pi, rel=2e-3)


def test_light_that_nothing_specular_can_meet_is_none() -> None:
    scene = scene_of(CollimatedLight("away", ONE, (0.0, 0.0, 5.0), (1.0, 0.0, 0.0), radius=0.5), PLATE)
    picture = render_reference(scene, 4, 4, photons=1000)
    assert picture.amount == 0 and not picture.rgb.any() and picture.relmse == 0.0


# ---- the pixel's measure -----------------------------------------------------------------


@pytest.mark.parametrize("kind", ["pinhole", "orthographic"])
def test_an_evenly_lit_floor_is_even_in_a_slanted_picture(kind: str) -> None:
    """Sunlight that a large tilted mirror throws straight down: radiance E ρ/π in every pixel, wherever the camera
    stands."""
    light = DirectionalLight("sun", ONE.scaled_to_luminous(100.0), direction=(1.0, 0.0, 0.0))
    mirror = place(primitives.plane(30.0, 30.0), Mirror(), (0.0, 0.0, 14.0), turned(1, 45.0))
    floor = place(primitives.plane(100.0, 100.0), Diffuse((0.5, 0.25, 0.75)))
    camera = Camera((1.0, -6.0, 2.0), (0.0, 0.0, 0.0), kind=kind, vertical_fov_deg=50.0, vertical_extent=3.0)  # type: ignore[arg-type]
    picture = render_reference(scene_of(light, mirror, floor, camera=camera), 16, 12, photons=400_000, seed=3)
    white = ONE.scaled_to_luminous(100.0).xyz()
    expected = rgb709_to_xyz(xyz_to_rgb709(white) * (0.5, 0.25, 0.75) / math.pi)
    lower = picture.xyz[4:]  # below the horizon
    assert lower.mean(axis=(0, 1)) == pytest.approx(expected, rel=3e-3)
    z = (lower - expected) / np.sqrt(picture.variance[4:])
    assert np.sqrt(np.mean(z**2)) < 1.6  # 8 parts: Student's t of 7 degrees has 1.18
    rows = lower.mean(axis=1) / expected
    assert np.abs(rows - 1.0).max() < 0.02


def test_light_on_the_far_side_of_a_sheet_is_not_seen() -> None:
    light = CollimatedLight("up", ONE, (0.0, 0.0, -3.0), (0.0, 0.0, 1.0), radius=0.3)
    pane = place(primitives.box((1.0, 1.0, 0.2)), Dielectric(constant_index(1.5)), (0.0, 0.0, -1.0))
    sheet = place(primitives.plane(4.0, 4.0), Diffuse())
    above = render_reference(scene_of(light, pane, sheet), 8, 8, photons=20_000)
    below = render_reference(
        scene_of(light, pane, sheet, camera=replace(ABOVE, position=(0.0, 0.0, -0.5))), 8, 8, photons=20_000
    )
    assert above.fates["deposited"] > 0.1 and not above.rgb.any() and below.rgb.any()


def test_glass_hides_what_lies_behind_it() -> None:
    light = CollimatedLight("down", ONE, (0.0, 0.0, 5.0), (0.0, 0.0, -1.0), radius=0.3)
    pane = place(primitives.box((1.0, 1.0, 0.2)), Dielectric(constant_index(1.5)), (0.0, 0.0, 1.0))
    floor = place(primitives.plane(4.0, 4.0), Diffuse())
    assert not render_reference(scene_of(light, pane, floor), 8, 8, photons=20_000).rgb.any()


# ---- flux, depth, error --------------------------------------------------------------------


@pytest.fixture(scope="module")
def busy() -> Scene:
    """Nested, touching, absorbing, mirrored, smooth: everything at once."""
    tint = Absorption(np.full(401, 0.3))
    light = PointLight("lamp", constant(1.0), (0.4, -1.0, 4.0))
    return scene_of(
        light,
        DirectionalLight("sun", laser(600.0), direction=(0.3, 0.2, -0.9), angular_diameter_deg=3.0),
        place(sphere(0.8, 1280), Dielectric(constant_index(1.5), None, 1), (0.0, 0.0, 1.0)),
        place(sphere(0.4, 1280), Dielectric(constant_index(1.33), tint, 2), (0.1, 0.0, 1.0)),
        place(primitives.box((0.6, 0.6, 0.6)), Dielectric(constant_index(1.7), tint, 0), (1.2, 0.0, 1.0)),
        place(primitives.box((0.6, 0.6, 0.6)), Dielectric(constant_index(1.6), None, 0), (1.8, 0.0, 1.0)),
        place(sphere(0.4, 320), Mirror((0.9, 0.5, 0.2)), (-1.2, 0.3, 0.6)),
        place(sphere(0.2, 320), Black(), (0.0, 1.2, 0.6)),
        place(primitives.plane(9.0, 9.0), Diffuse(), (0.0, 0.0, 0.0)),
        camera=Camera((0.0, -6.0, 5.0), (0.0, 0.0, 0.0)),
    )


def test_flux_closes_and_none_slips_through_cracks(busy: Scene) -> None:
    balance = render_reference(busy, 32, 24, photons=60_000).fates
    fates = [name for name in balance if name != "emitted"]
    assert sum(balance[name] for name in fates) == pytest.approx(balance["emitted"], rel=1e-10)
    assert all(balance[name] > 0.0 for name in ("deposited", "direct", "absorbed", "escaped"))
    assert balance["lost_numeric"] < 1e-6 * balance["emitted"]


def test_depth_counts_as_the_program_counts_it(busy: Scene) -> None:
    """A pane takes two events: with one allowed, all that enters is lost."""
    light = CollimatedLight("beam", ONE, (0.0, 0.0, 5.0), (0.0, 0.0, -1.0), radius=0.3)
    pane = place(primitives.box((1.0, 1.0, 0.2)), Dielectric(constant_index(1.5)), (0.0, 0.0, 1.0))
    scene = scene_of(light, pane, place(primitives.plane(4.0, 4.0), Diffuse()))
    one, two = (render_reference(scene, 4, 4, photons=20_000, max_depth=depth).fates for depth in (1, 2))
    assert one["lost_depth"] == pytest.approx(0.96 * one["emitted"], rel=5e-3) and one["deposited"] == 0.0
    assert two["deposited"] == pytest.approx(0.96**2 * two["emitted"], rel=5e-3)


def test_touching_blocks_of_one_glass_are_one_block() -> None:
    """No film of air between coincident faces: a beam along the axis of two passes loses only two surfaces."""
    light = CollimatedLight("beam", ONE, (0.0, 0.0, 5.0), (0.0, 0.0, -1.0), radius=0.3)
    glass = Dielectric(constant_index(1.5))
    measured_passes = [place(primitives.box((1.0, 1.0, 0.5)), glass, (0.0, 0.0, z)) for z in (1.0, 1.5)]
    balance = render_reference(
        scene_of(light, *measured_passes, place(primitives.plane(4.0, 4.0), Diffuse())), 4, 4, photons=20_000
    ).fates
    rest = 0.04
    assert balance["deposited"] / balance["emitted"] == pytest.approx((1 - rest) ** 2 / (1 - rest**2), rel=3e-3)


def test_a_lamp_on_a_face_stands_outside_of_the_glass() -> None:
    block = place(primitives.box((1.6, 1.6, 0.6)), Dielectric(constant_index(1.5)), (0.0, 0.0, 0.7))
    table = place(primitives.plane(8.0, 8.0), Diffuse())
    landed = []
    for z in (1.0 + 1e-6, 1.0):
        lamp = PointLight("lamp", ONE, (0.1, 0.1, z))
        balance = render_reference(scene_of(lamp, block, table), 4, 4, photons=20_000).fates
        landed.append(balance["deposited"])
        assert balance["lost_numeric"] < 1e-3 * balance["emitted"]
    assert landed[1] == pytest.approx(landed[0], rel=0.02)


def test_its_own_error_is_true(busy: Scene) -> None:
    """The scatter of eight whole runs is the variance they claim: the ratio's 4 σ is 25 % over 768 pixels and three
    seeds' noise."""
    runs = [render_reference(busy, 32, 24, photons=16_000, seed=seed) for seed in range(8)]
    observed = np.var([run.xyz[..., 1] for run in runs], axis=0, ddof=1).sum()
    claimed = np.mean([run.variance[..., 1] for run in runs], axis=0).sum()
    assert observed / claimed == pytest.approx(1.0, abs=0.3)


# ---- the sampler's own promises --------------------------------------------------------------


def test_the_sequence_is_a_net_in_its_first_two_dimensions_and_stratified_in_all() -> None:
    sequence = sampling.scrambled(5, 0, 0)
    bits = (np.arange(256)[:, None] >> np.arange(32)) & 1
    words = np.zeros((sampling.DIMENSIONS, 256), np.uint32)
    for d in range(sampling.DIMENSIONS):
        words[d] = (
            np.bitwise_xor.reduce(np.where(bits == 1, sequence.directions[d], np.uint32(0)), axis=1) ^ sequence.shift[d]
        )
        assert len(np.unique(words[d] >> 24)) == 256
    for k in range(9):  # one point in each of the 256 boxes of 2^k × 2^(8−k)
        assert len(np.unique((words[0].astype(np.uint64) >> (32 - k) << 8) | (words[1] >> np.uint64(24 + k)))) == 256


def _lamp_domain() -> photon_emission.Domain:
    triangles = np.array([[[-1, -1, 0], [1, -1, 0], [1, 1, 0]], [[-1, -1, 0], [1, 1, 0], [-1, 1, 0]]], float)
    return photon_emission.domains(
        SpotLight("spot", ONE, **DOWN, inner_half_angle_deg=10.0, outer_half_angle_deg=30.0),
        triangles,
        np.zeros(3),
        2.0,
    )[0]


def emitted(domain: photon_emission.Domain, count: int = 20_000) -> float:
    numbers = np.random.default_rng(2).random((count, 4))
    return float(np.mean([photon_emit.emit(domain, *row)[2] for row in numbers]))


def test_an_aimed_density_leaves_the_flux_alone_and_a_wrong_one_does_not() -> None:
    domain = _lamp_domain()
    aim = np.zeros((photon_emit.GRID, photon_emit.GRID))
    aim[20:30, 40:44] = 1.0
    aimed = photon_emission.refined(domain, aim)
    expected = spot_solid_angle_sr(10.0, 30.0)
    assert emitted(domain) == pytest.approx(expected, rel=0.03)
    assert emitted(aimed) == pytest.approx(expected, rel=0.08)
    # A mutant that draws by the aimed density and weighs by the even one.
    ratio = photon_emission.density(aimed) / np.maximum(photon_emission.density(domain), 1e-300)
    photons = [photon_emit.emit(aimed, *row) for row in np.random.default_rng(2).random((20_000, 4))]
    assert np.mean([p[2] * ratio[p[3], p[4]] for p in photons]) != pytest.approx(expected, rel=0.08)


# ---- limits and the cache --------------------------------------------------------------------


@pytest.fixture
def small(busy: Scene) -> Scene:
    return replace(busy, objects=busy.objects[:1] + busy.objects[-1:], lights=busy.lights[:1])


def test_a_stored_reference_is_reused_and_grows(small: Scene, tmp_path: Path) -> None:
    first = cached_reference(small, 16, 12, photons=16_000, folder=tmp_path)
    again = cached_reference(small, 16, 12, photons=10_000, folder=tmp_path)
    assert again.amount == first.amount and np.array_equal(again.rgb, first.rgb)
    more = cached_reference(small, 16, 12, photons=64_000, folder=tmp_path)
    at_once = render_reference(small, 16, 12, photons=more.amount)
    assert more.amount == at_once.amount > first.amount and more.relmse < first.relmse
    np.testing.assert_allclose(more.rgb, at_once.rgb, rtol=1e-9, atol=1e-12)
    good_enough = cached_reference(small, 16, 12, target_relmse=more.relmse * 1.01, folder=tmp_path)
    assert good_enough.amount == more.amount


def test_a_damaged_store_is_ignored(small: Scene, tmp_path: Path) -> None:
    first = cached_reference(small, 16, 12, photons=4000, folder=tmp_path)
    (stored,) = tmp_path.glob("*.npz")
    stored.write_bytes(stored.read_bytes()[:900])
    assert np.array_equal(cached_reference(small, 16, 12, photons=4000, folder=tmp_path).rgb, first.rgb)


def test_an_interrupt_keeps_what_is_done(small: Scene, tmp_path: Path) -> None:
    calls = []

    def interrupt(fraction: float, text: str) -> None:
        calls.append(fraction)
        if len(calls) == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cached_reference(small, 16, 12, photons=10**9, progress=interrupt, folder=tmp_path)
    kept = cached_reference(small, 16, 12, photons=1, folder=tmp_path)
    assert kept.amount > 0 and kept.rgb.any()


def test_limits(tmp_path: Path) -> None:
    scene = load_scene(assets_dir() / "scenes" / "prism.toml")
    with pytest.raises(ValueError, match="limit"):
        cached_reference(scene, 24, 16, folder=tmp_path)
    rough = cached_reference(scene, 24, 16, target_relmse=0.05, folder=tmp_path)
    assert 0.0 < rough.relmse <= 0.05
    assert cached_reference(scene, 24, 16, seconds=0.2, folder=tmp_path).seconds < 5.0 + rough.seconds


def test_the_key_distinguishes_pictures_and_nothing_else(small: Scene) -> None:
    light, glass = small.lights[0], small.objects[0]

    def key(height: int = 12, depth: int = 64, **changes: object) -> str:
        return reference_key(replace(small, **changes), 16, height, depth)  # type: ignore[arg-type]

    def with_glass(**changes: object) -> str:
        return key(objects=(replace(glass, **changes), small.objects[1]))  # type: ignore[arg-type]

    keys = [
        key(),
        key(height=13),
        key(depth=63),
        key(camera=replace(small.camera, vertical_fov_deg=35.1)),
        key(lights=(replace(light, spectral_power=light.spectral_power.scaled(2.0)),)),
        key(lights=(replace(light, position=(0.4, -1.0, 4.1)),)),
        with_glass(material=Dielectric(constant_index(1.51), None, 1)),
        with_glass(object_to_world=np.diag([1.0, 1.0, 1.01, 1.0])),
    ]
    assert len(set(keys)) == len(keys)
    assert key(name="other", notes=("note",), background_rgb=(1.0, 0.0, 0.0)) == keys[0]
    assert photon_reference.PARTS >= 8
