"""Rough glass in both passes: shares of light by quadrature over microfacets, the lobe of a reflection in closed form,
patterns and pictures against the float64 references, which draw microfacets in another way.

Smallest errors these can detect: shares to 0.3 %, rings of a lobe to 3 %, blocks of a picture to 2 % of the brightest
one (root mean square). The mutants (no shadowing, another width) are several times as far off.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference import microfacet
from spectrasplat.gpu.context import Context
from spectrasplat.model.environment import gradient
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import AreaLight, CollimatedLight
from spectrasplat.model.materials import Absorption
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.optics.colorimetry import VISIBLE_NM, rgb709_to_xyz
from spectrasplat.model.optics.glass import Dispersion, from_abbe
from spectrasplat.model.optics.spectrum import constant, laser
from spectrasplat.model.placement import rotation_about
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, RenderDefaults, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes import trace
from spectrasplat.reference.camera_reference import cached_camera_reference
from spectrasplat.reference.photon_reference import cached_reference
from spectrasplat.render.still import RenderResult, render

from tests.gpu.test_beam_tails import held, passed

INDEX = 1.5
GLASS = from_abbe(INDEX, np.inf)
BLACK_GLASS = Absorption(np.full(len(VISIBLE_NM), 200.0))
ABOVE = Camera((0.0, 0.0, 9.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), kind="orthographic", vertical_extent=6.0)


def thing(name: str, mesh, material, at=(0.0, 0.0, 0.0), turn_deg: float = 0.0, axis=(0.0, 1.0, 0.0)) -> SceneObject:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_about(axis, np.radians(turn_deg))
    matrix[:3, 3] = at
    return SceneObject(name, mesh, material, matrix)


def shares_of(result: RenderResult) -> dict[str, float]:
    """Shares of the emitted flux by fate."""
    rows = [line.split() for line in result.stats.lines()]
    return {
        row[0]: float(row[1]) for row in rows if row and row[0] in ("deposited", "absorbed", "escaped", "unaccounted")
    }


def caustic(gl: Context, scene: Scene, photons: int, size: tuple[int, int] = (64, 64), **more) -> RenderResult:
    settings = RenderSettings(*size, photons=photons, spp=16, layer="caustic", tally=True, **more)
    return render(scene, settings, context=gl)


def black_block(angle: float, roughness: float) -> Scene:
    """A pencil of light onto a block that lets nothing out again, and a screen all round above."""
    direction = (np.sin(angle), 0.0, -np.cos(angle))
    start = tuple(-4.0 * np.array(direction))
    light = CollimatedLight("pencil", laser(550.0), start, direction, radius=0.02)
    block = thing("block", primitives.box((8.0, 8.0, 2.0)), Dielectric(GLASS, BLACK_GLASS, 0, roughness), (0, 0, -1))
    screen = thing("screen", primitives.box((60.0, 60.0, 60.0)), Diffuse(), (0.0, 0.0, 29.0))
    return Scene("block", ABOVE, (light,), (block, screen))


@pytest.mark.parametrize(("angle_deg", "roughness"), [(0.0, 0.5), (45.0, 0.3), (70.0, 0.6)])
def test_one_surface_reflects_what_its_microfacets_do(gl: Context, angle_deg: float, roughness: float) -> None:
    angle = np.radians(angle_deg)
    found = shares_of(caustic(gl, black_block(angle, roughness), 40_000, (8, 8)))
    reflected, transmitted = microfacet.shares(angle, roughness**2, 1.0 / INDEX)
    # What others throw on is shared out as what is seen of one.
    assert found["deposited"] == pytest.approx(reflected / (reflected + transmitted), rel=0.01)
    assert abs(found["unaccounted"]) < 1e-5


@pytest.mark.parametrize("roughness", [0.25, 0.6])
def test_a_slab_lets_through_what_the_reference_does(gl: Context, roughness: float) -> None:
    """Both surfaces, all reflections between them; the microfacets keep nothing."""
    scene = lit_slab(roughness)
    found = shares_of(caustic(gl, scene, 60_000, (8, 8)))
    balance = cached_reference(scene, 4, 4, photons=400_000).fates
    emitted = balance["emitted"]
    assert found["deposited"] == pytest.approx(balance["deposited"] / emitted, rel=4e-3)
    assert found["absorbed"] == pytest.approx(balance["absorbed"] / emitted, abs=4e-3)
    assert abs(found["unaccounted"]) < 1e-5
    assert abs(found["absorbed"]) < 6e-3 and abs(balance["absorbed"] / emitted) < 6e-3


def ring_of_sapphire() -> Scene:
    """Light is thrown about in it many times, and leaves it at grazing angles."""
    light = AreaLight("lamp", constant(1.0), position=(0.0, 0.0, 4.0), direction=(0.0, 0.0, -1.0), radius=0.2)
    glass = Dielectric(find("sapphire"), roughness=0.26)
    ring = thing("ring", primitives.torus(0.58, 0.27, 20_000), glass, (0.0, 0.0, 0.9), 60.0, (1.0, 0.0, 0.0))
    table = thing("table", primitives.plane(8.0, 8.0), Diffuse())
    return Scene("ring", ABOVE, (light,), (ring, table), render=RenderDefaults(max_depth=16))


def kept_by_ring(gl: Context) -> tuple[float, float, float]:
    """Of the light that went through the ring: what its microfacets kept. And of what landed: what the map holds, and
    what landed where it does not reach."""
    with passed(gl, ring_of_sapphire(), photons=60_000) as light:
        ended = light.stats.tally.ended
        sent_on = ended["deposited"] + ended["escaped"]
        return ended["absorbed"] / sent_on, held(light), light.stats.outside_map_w / ended["deposited"]


def test_steep_derivatives_by_wavelength_take_no_light(gl: Context) -> None:
    kept, drawn, outside = kept_by_ring(gl)
    assert abs(kept) < 1.5e-3
    assert drawn + outside == pytest.approx(1.0, abs=4e-3) and outside < 0.025


@pytest.mark.slow
def test_ends_of_bands_believed_would_leave_the_scene(gl: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trace, "WIDEST_SWEEP", 1e6)
    assert kept_by_ring(gl)[2] > 0.025


def lit_slab(roughness: float, radius: float = 0.05, dispersion: Dispersion = GLASS, tilt_deg: float = 0.0) -> Scene:
    light = CollimatedLight("pencil", laser(550.0), (0.0, 0.0, 3.0), (0.0, 0.0, -1.0), radius=radius)
    slab = primitives.box((6.0, 6.0, 0.2))
    objects = (
        thing("slab", slab, Dielectric(dispersion, roughness=roughness), (0, 0, 1), tilt_deg),
        thing("floor", primitives.plane(40.0, 40.0), Diffuse(), (0, 0, -1)),
    )
    under = Camera((0.0, 0.0, 0.5), (0.0, 0.0, -1.0), up=(0.0, 1.0, 0.0), kind="orthographic", vertical_extent=3.0)
    return Scene("slab", under, (light,), objects)


def rings(picture: np.ndarray, extent: float, edges: np.ndarray) -> np.ndarray:
    """Means of green over rings about the middle of a square picture."""
    size = picture.shape[0]
    at = (np.arange(size) + 0.5) * extent / size - 0.5 * extent
    ring = np.digitize(np.hypot(*np.meshgrid(at, at)), edges) - 1
    inside = (ring >= 0) & (ring < len(edges) - 1)
    sums = np.bincount(ring[inside], picture[..., 1][inside], len(edges) - 1)
    return sums / np.bincount(ring[inside], minlength=len(edges) - 1)


def reflected_lobe(gl: Context, roughness: float) -> np.ndarray:
    """Rings of a pencil's reflection on a ceiling two units above a block, over their sum."""
    start, down = (0.0, 0.0, 1.9), (0.0, 0.0, -1.0)
    light = CollimatedLight("pencil", laser(550.0), start, down, radius=0.01)
    block = thing("block", primitives.box((8.0, 8.0, 2.0)), Dielectric(GLASS, BLACK_GLASS, 0, roughness), (0, 0, -1))
    ceiling = thing("ceiling", primitives.plane(60.0, 60.0), Diffuse(), (0.0, 0.0, 2.0))
    camera = Camera((0, 0, 1.8), (0, 0, 2.0), up=(0, 1, 0), kind="orthographic", vertical_extent=EXTENT)
    return rings(caustic(gl, Scene("lobe", camera, (light,), (block, ceiling)), 100_000, (96, 96)).rgb, EXTENT, EDGES)


EXTENT = 6.0
EDGES = np.array([0.0, 0.2, 0.4, 0.6, 0.9, 1.3, 1.8, 2.4, 3.0])


def known_lobe(roughness: float) -> np.ndarray:
    fine = np.linspace(0.0, EDGES[-1], 3001)
    middle = 0.5 * (fine[1:] + fine[:-1])
    share = microfacet.lobe_on_plane(middle, 2.0, roughness**2, INDEX) * middle
    ring = np.digitize(middle, EDGES) - 1
    return np.bincount(ring, share) / np.bincount(ring, middle)


@pytest.mark.slow
def test_the_lobe_of_a_reflection_is_ggx(gl: Context) -> None:
    """In rings from the middle of the lobe to a hundredth of it: the footprints do not blur it, and lose nothing."""
    found, wanted = reflected_lobe(gl, 0.5), known_lobe(0.5)
    scale = found[:4].sum() / wanted[:4].sum()
    np.testing.assert_allclose(found / scale, wanted, rtol=0.05)
    assert np.abs(known_lobe(0.53) / known_lobe(0.53)[:4].sum() * wanted[:4].sum() / wanted - 1.0).max() > 0.15


def blocks(picture: np.ndarray, size: int = 8) -> np.ndarray:
    height, width = picture.shape[:2]
    return picture.reshape(height // size, size, width // size, size, 3).mean(axis=(1, 3))


def error(picture: np.ndarray, reference: np.ndarray) -> float:
    """nRMSE of blocks."""
    a, b = blocks(picture), blocks(reference)
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


@pytest.mark.slow
def test_the_pattern_behind_a_slab_is_the_references(gl: Context) -> None:
    """Blocks within the errors of both: the reference's own, by its independent parts, and 2 % of the photons'."""
    scene = lit_slab(0.4)
    reference = cached_reference(scene, 64, 64, photons=1_000_000)
    found = caustic(gl, scene, 60_000).rgb
    known, sigma = blocks(reference.xyz)[..., 1], np.sqrt(blocks(reference.variance)[..., 1]) / 8.0
    allowed = np.hypot(sigma, 0.02 * known + 2e-3 * known.max())
    z = (blocks(rgb709_to_xyz(found))[..., 1] - known) / allowed
    assert abs(z).max() < 5.0 and np.sqrt((z**2).mean()) < 1.5
    assert error(found, reference.rgb) < 0.025
    assert error(caustic(gl, lit_slab(0.43), 60_000).rgb, reference.rgb) > 0.025


def prism(roughness: float, polarisation: bool = False, smooth: bool = False) -> Scene:
    """A narrow beam of white light through flint onto a wall: a spectrum, blurred; or one aside of a ball's middle."""
    rise = 0.0 if smooth else np.radians(33.0)
    way = np.array([np.cos(rise), 0.0, np.sin(rise)])
    start = np.array([-0.25, 0.0, 0.2 * smooth]) - 2.0 * way
    light = CollimatedLight("beam", constant(1.0), tuple(start), tuple(way), radius=0.05)
    mesh = primitives.sphere(0.6, 20000) if smooth else primitives.prism(60.0, 1.0, 2.0)
    height = -0.3 if smooth else -1.0
    objects = (
        thing("prism", mesh, Dielectric(find("N-SF11"), roughness=roughness)),
        thing("wall", primitives.plane(6.0, 6.0), Diffuse(), (2.0, 0.0, height), -90.0 if smooth else -60.0),
    )
    camera = Camera((0.7, 0.0, 0.5 * height), (2.0, 0.0, height), up=(0.0, 1.0, 0.0), vertical_fov_deg=80.0)
    return Scene("prism", camera, (light,), objects, render=RenderDefaults(polarisation=polarisation))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "polarisation", "smooth"),
    [("srd", False, False), ("srd", True, False), ("srd", False, True), ("hero", False, False)],
)
def test_spectra_through_ground_flint(gl: Context, method: str, polarisation: bool, smooth: bool) -> None:
    """One microfacet for all of a band: its spectral column carries on through it."""
    scene = prism(0.2, polarisation, smooth)
    reference = cached_reference(scene, 64, 64, photons=600_000).rgb
    found = caustic(gl, scene, 60_000, method=method).rgb
    assert found.sum(axis=(0, 1)) == pytest.approx(reference.sum(axis=(0, 1)), rel=0.02)
    assert error(found, reference) < 0.05


@pytest.mark.slow
def test_hardly_rough_is_polished(gl: Context) -> None:
    """A ten-thousandth of a radian is nothing to see, and the lattice's footprints serve."""
    rough, polished = (caustic(gl, prism(roughness), 10_000, method="srd-photons").rgb for roughness in (0.01, 0.0))
    assert error(rough, polished) < 0.01
    assert rough.sum() == pytest.approx(polished.sum(), rel=3e-3)


def seen_through(roughness: float, dispersion: Dispersion, smooth: bool) -> Scene:
    """A lamp and a sky behind a slanted block, or a ball; nothing receives."""
    lamp = AreaLight("lamp", constant(1.0).scaled_to_luminous(40.0), (0.3, 3.0, 0.4), (0.0, -1.0, 0.0), radius=0.7)
    mesh = primitives.sphere(0.7, 20000) if smooth else primitives.box((1.4, 0.8, 1.2))
    solid = thing("solid", mesh, Dielectric(dispersion, roughness=roughness), turn_deg=25.0, axis=(0.0, 0.0, 1.0))
    sky = replace(gradient((0.2, 0.4, 1.0), (1.0, 0.8, 0.5), (0.1, 0.1, 0.1)), lights=False)
    camera = Camera((0.0, -3.0, 0.3), (0.0, 0.0, 0.0), vertical_fov_deg=32.0)
    return Scene("seen", camera, (lamp,), (solid,), environment=sky)


@pytest.mark.slow
@pytest.mark.parametrize("smooth", [False, True], ids=["block", "ball"])
@pytest.mark.parametrize("dispersion", [GLASS, find("N-SF11")], ids=["one index", "dispersive"])
def test_the_camera_sees_through_rough_glass(gl: Context, dispersion: Dispersion, smooth: bool) -> None:
    scene = seen_through(0.4, dispersion, smooth)
    reference = cached_camera_reference(scene, 48, 32, samples=1500).rgb
    found = render(scene, RenderSettings(48, 32, photons=1000, spp=64), context=gl).rgb
    assert found.sum(axis=(0, 1)) == pytest.approx(reference.sum(axis=(0, 1)), rel=0.01)
    assert error(found, reference) < 0.03
    polished = render(seen_through(0.0, dispersion, smooth), RenderSettings(48, 32, photons=1000, spp=64), context=gl)
    assert error(polished.rgb, reference) > 0.06


@pytest.mark.slow
def test_the_environment_lights_through_rough_glass(gl: Context) -> None:
    """A floor under a frosted pane that hides all of the sky, against paths."""
    pane = thing("pane", primitives.box((8.0, 8.0, 0.2)), Dielectric(GLASS, roughness=0.4), (0.0, 0.0, 1.0))
    floor = thing("floor", primitives.plane(3.0, 3.0), Diffuse((0.7, 0.7, 0.7)))
    sky = gradient((2.0, 2.0, 2.0), (0.1, 0.1, 0.1), (0.0, 0.0, 0.0))
    camera = Camera((0.0, 0.0, 0.8), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), vertical_fov_deg=60.0)
    scene = Scene("pane", camera, (), (pane, floor), environment=sky)
    reference = cached_camera_reference(scene, 16, 16, samples=6000).rgb.mean()
    found = render(scene, RenderSettings(16, 16, photons=1000, spp=4), context=gl).rgb.mean()
    assert found == pytest.approx(reference, rel=0.01)
