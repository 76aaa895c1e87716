"""What the camera's reference sees through glass: fringes by slabs and prisms against closed forms, caustics against
the light's reference.

Mutants of the closed forms (another Fresnel, dispersion the other way round) must be told apart.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from reference import camera_answers
from spectrasplat.base.errors import UserError
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.primitives_round import sphere
from spectrasplat.model.lights import AreaLight, CollimatedLight, PointLight
from spectrasplat.model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz
from spectrasplat.model.optics.glass import Dispersion
from spectrasplat.model.optics.glass import constant as constant_index
from spectrasplat.model.optics.spectrum import Spectrum, laser
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Scene, SceneObject
from spectrasplat.model.texture import Texture
from spectrasplat.reference import photon_reference
from spectrasplat.reference.camera_reference import CameraRun, render_camera_reference
from spectrasplat.reference.direct_light import seen_directly
from spectrasplat.reference.photon_reference import render_reference
from spectrasplat.reference.rounds import Picture
from spectrasplat.reference.spectral_caustic import CausticPlan, build_caustic

from tests.unit.camera_scenes import D65, FLINT, THICKNESS, TILT, place, plate, scene_of, slab_scene

# ---- a slab before an edge -------------------------------------------------------------------


def slab_column(glass: Dispersion, rows: int, fresnel: str = "exact", sign: float = 1.0) -> np.ndarray:
    """XYZ of a column of pixels, (rows, 3): the edge, once for each wavelength and number of reflections inside."""
    n = glass.index(VISIBLE_NM)
    centre = float(np.mean(camera_answers.slab_displacement(n, THICKNESS, TILT)))
    n = glass.n_d + sign * (n - glass.n_d)
    cosine, inner = math.cos(TILT), np.sqrt(1.0 - (math.sin(TILT) / n) ** 2)
    if fresnel == "exact":
        reflectance = 0.5 * (
            ((cosine - n * inner) / (cosine + n * inner)) ** 2 + ((n * cosine - inner) / (n * cosine + inner)) ** 2
        )
    else:  # Schlick 1994
        reflectance = ((n - 1) / (n + 1)) ** 2
        reflectance = reflectance + (1 - reflectance) * (1 - cosine) ** 5
    # Along x, row 0 on top is the largest x; a film's length is cos 45° of the plate's.
    border = centre + 0.06 / cosine * (0.5 - np.arange(rows + 1) / rows)
    total = np.zeros((rows, 3))
    offset = camera_answers.slab_offset(n, THICKNESS, TILT)
    for k in range(6):  # 2k reflections inside lead the ray on by 2k offsets: it meets the plate farther along
        # Without glass the pixel at `border` sees x = border; with it x − displacement + 2k offset.
        seen = border[:, None] - camera_answers.slab_displacement(n, THICKNESS, TILT) + 2 * k * offset
        white = np.clip(seen[:-1], 0.0, None) - np.clip(seen[1:], 0.0, None)
        share = white / (border[:-1] - border[1:])[:, None] * (1 - reflectance) ** 2 * reflectance ** (2 * k)
        total += K_M * (share * D65.density) @ cmf_xyz() / math.pi
    return total


@pytest.fixture(scope="module")
def slab_picture() -> Picture:
    return render_camera_reference(slab_scene(FLINT), 12, 48, samples=1024)


def slab_z_squared(picture: Picture, expected: np.ndarray) -> float:
    """Mean of z² over rows and channels; a row's twelve variances together have 84 degrees of freedom, so that 1.02 is
    right."""
    variance = picture.variance.sum(axis=1) / 144
    return float(np.mean((picture.xyz.mean(axis=1) - expected) ** 2 / variance))


def test_an_edge_behind_a_slab_has_the_fringe_of_snells_law(slab_picture: Picture) -> None:
    """48 rows of three channels that go together: the mean of z² scatters by √(2/48) = 0.2."""
    expected = slab_column(FLINT, 48)
    assert slab_z_squared(slab_picture, expected) < 1.02 + 4 * 0.2
    np.testing.assert_allclose(slab_picture.xyz.mean(axis=1), expected, atol=6e-3 * expected.max())


def test_a_pane_of_air_changes_nothing() -> None:
    """Behind a pane of n = 1 every path carries one wavelength, without it all of them: both ways of adding must
    agree."""
    rgb = np.random.default_rng(5).random((5, 5, 3)).astype(np.float32)
    curve = np.linspace(0.1, 0.9, 401)
    lights = (
        AreaLight("lamp", D65, (0.5, 0.2, 1.0), radius=0.3),
        PointLight("line", laser(560.0, 0.004), (-0.4, 0.3, 0.8)),
        PointLight("lines", Spectrum(np.zeros(401), ((450.0, 0.003), (640.0, 0.002))), (0.0, -0.4, 0.8)),
    )
    things = (
        place(primitives.plane(1.0, 1.0), Diffuse((0.9, 0.8, 1.0), texture=Texture(rgb)), (-0.5, 0.0, 0.0)),
        place(primitives.plane(1.0, 1.0), Diffuse(reflectance=curve), (0.5, 0.0, 0.0)),
    )
    pane = place(primitives.box((4.0, 4.0, 0.1)), Dielectric(constant_index(1.0)), (0.0, 0.0, 5.0))
    straight = render_camera_reference(scene_of(*lights, *things), 16, 16, samples=2048)
    behind = render_camera_reference(scene_of(*lights, *things, pane), 16, 16, samples=2048)
    assert behind.relmse > 3.0 * straight.relmse  # which is why
    np.testing.assert_allclose(behind.xyz, straight.xyz, rtol=0.03)
    for half in (
        np.s_[:, :8],
        np.s_[:, 8:],
    ):  # texture; spectral reflectance: means to 6e-4, so 3e-3 too much would show
        error = np.sqrt((behind.variance + straight.variance)[half].sum(axis=(0, 1))) / 128
        mean = straight.xyz[half].mean(axis=(0, 1))
        assert (error < 6e-4 * mean).all()
        assert (np.abs(behind.xyz[half].mean(axis=(0, 1)) - mean) < 4.5 * error).all()


# ---- a prism before an edge, against the exact trace -----------------------------------------


# ---- caustics --------------------------------------------------------------------------------


def caustic_scene(*more: SceneObject) -> Scene:
    """A beam through a prism on to a plate that the camera sees from above."""
    light = CollimatedLight(
        "beam", D65.scaled(3.0), (-0.2, 0.0, 3.0), (0.0, 0.0, -1.0), shape="rectangle", width=0.3, height=0.6
    )
    prism = place(primitives.prism(50.0, 1.0, 1.0), Dielectric(FLINT), (0.0, 0.0, 1.6))
    camera = Camera((0.9, -3.0, 4.0), (1.2, 0.0, 0.0), vertical_fov_deg=38.0)
    return scene_of(light, prism, plate(size=8.0), *more, camera=camera)


@pytest.fixture(autouse=True)
def short_pilot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photon_reference, "_PILOT_PHOTONS", 1 << 14)


PLAN = CausticPlan(photons=1 << 18, bins=40)


def test_the_caustic_is_that_of_the_light_reference() -> None:
    """Where it is seen directly: the sums of blocks of both pictures, of 2.6e5 and 1e6 photons, agree to 3 % of the
    brightest (half a texel at a border is 2.5 % of a block) and to 0.4 % in all."""
    scene = caustic_scene()
    caustic = build_caustic(scene, 36, 24, replace(PLAN, texel_size=0.02))
    assert caustic.relmse < 0.01 and caustic.outside_w < 0.5 * caustic.landed_w
    lit = render_camera_reference(scene, 36, 24, samples=256, caustic=caustic)
    dark = render_camera_reference(scene, 36, 24, samples=256)
    light = render_reference(scene, 36, 24, photons=1 << 20)
    seen = seen_directly(scene, 36, 24)
    blocks = [
        (np.where(seen[..., None], p, 0.0)).reshape(12, 2, 18, 2, 3).mean(axis=(1, 3))
        for p in (lit.xyz - dark.xyz, light.xyz)
    ]
    assert blocks[1].max() > 0.1
    np.testing.assert_allclose(blocks[0], blocks[1], atol=0.03 * blocks[1].max())
    np.testing.assert_allclose(blocks[0].sum(axis=(0, 1)), blocks[1].sum(axis=(0, 1)), rtol=4e-3)


def test_a_caustic_behind_a_pane_of_air_is_the_same() -> None:
    """One wavelength at a time from its bin, or all bins at once."""
    pane = place(primitives.box((8.0, 8.0, 0.02)), Dielectric(constant_index(1.0)), (0.0, 0.0, 3.4))
    scene, behind = caustic_scene(), caustic_scene(pane)
    caustic = build_caustic(scene, 24, 16, PLAN)
    straight = render_camera_reference(scene, 24, 16, samples=1024, caustic=caustic)
    through = CameraRun(
        behind,
        24,
        16,
        caustic=replace(
            caustic, tables=caustic.tables._replace(side=np.vstack([caustic.tables.side, [[-1, -1]]]).astype(np.int32))
        ),
    )
    while through.amount < 1024:
        through.advance()
    picture = through.picture()
    # The pane is below the camera and above the beam, so it hides nothing that is lit.
    # A caustic has dark places where few samples find light, so blocks are compared: to 3 % of the brightest.
    blocks = [p.xyz.reshape(8, 2, 12, 2, 3).mean(axis=(1, 3)) for p in (picture, straight)]
    np.testing.assert_allclose(blocks[0], blocks[1], atol=0.03 * blocks[1].max())
    error = np.sqrt((picture.variance + straight.variance).sum(axis=(0, 1)))
    total = straight.xyz.sum(axis=(0, 1))
    assert (error < 0.015 * total).all()
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
