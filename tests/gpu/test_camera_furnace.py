"""Clear glass in a world of one brightness cannot be seen, whatever its shape: nothing is lost, nothing is made, no ray
ends at nothing.

Also textures seen through glass, whose mean must be kept when pixels are far larger than their texels.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import Mesh, make_mesh
from spectrasplat.model.geometry.primitives_gem import brilliant
from spectrasplat.model.lights import DirectionalLight
from spectrasplat.model.materials.coating import Coating
from spectrasplat.model.optics.glass import constant, from_abbe
from spectrasplat.model.optics.thin_films import Film, Layer
from spectrasplat.model.scene import (
    Black,
    Camera,
    Dielectric,
    Diffuse,
    SceneObject,
)
from spectrasplat.model.texture import Environment, Texture
from spectrasplat.passes.spectrum_choice import Spectrum
from spectrasplat.stress.rigs.gpu_paths import glass

from tests.gpu.camera_rig import WHITE, at, opened_camera_pass, released, render

FLINT = Dielectric(from_abbe(1.7, 20.0))
NEAR = Camera((0.3, -2.6, 1.1), (0, 0, 0), vertical_fov_deg=32.0)
SIZE = (24, 24)


@cache
def ball(radius: float, triangles: int = 5120) -> Mesh:
    return primitives.sphere(radius, triangles)


def solids(name: str) -> list[SceneObject]:
    turned = np.eye(4)
    turned[:3, :3] = np.linalg.qr(np.array([[0.9, 0.2, 0.1], [-0.3, 1.1, 0.4], [0.2, -0.5, 0.8]]))[0]
    turned[:3, :3] *= np.sign(np.linalg.det(turned[:3, :3]))
    match name:
        case "ball":
            return [SceneObject("ball", ball(0.6), FLINT)]
        case "prism":
            return [SceneObject("prism", primitives.prism(60.0, 1.0, 1.0), glass("N-SF11"), turned)]
        case "slab":
            return [SceneObject("slab", primitives.box((1.2, 0.3, 1.0)), FLINT, turned)]
        case "coated":
            film = Coating(Film((Layer(constant(2.3), 60.0), Layer(constant(1.38), 100.0))))
            return [SceneObject("ball", ball(0.6), Dielectric(from_abbe(1.7, 10.0), coating=film))]
        case "brilliant":
            return [SceneObject("gem", brilliant(1.2), glass("diamond"), turned)]
        case _:
            water = SceneObject("water", ball(0.3), Dielectric(glass("water").dispersion, priority=1))
            return [SceneObject("ball", ball(0.6), Dielectric(FLINT.dispersion, priority=0)), water]


APART = 30.0
"""Between the middles of solids of one scene, which one program sees."""


def beside(objects: list[SceneObject], place: int) -> list[SceneObject]:
    move = at(APART * place, 0.0, 0.0)
    return [replace(o, name=f"{o.name} {place}", object_to_world=move @ o.object_to_world) for o in objects]


@pytest.mark.parametrize(
    ("sky", "seen"),
    [
        ("background", [("ball", 4), ("prism", 1), ("slab", 4), ("brilliant", 1), ("nested", 1)]),
        ("map", [("coated", 4)]),
    ],
    ids=["background", "map"],
)
def test_clear_glass_vanishes_in_a_closed_white_room(gl, sky: str, seen: list[tuple[str, int]]) -> None:
    """Solids, each in so many bands. The mean to 1e-3 (one band: 4e-4), no pixel off by more than 1 % at 64 samples:
    chance moves light between branches, and every branch ends in white.

    With several bands the bands' samples lie at different places of a pixel. Where glass covers only a part of it, or
    reflects more and more toward its rim, they do not see the same share of it, and what is left at 64 samples is
    colour grain; the mean is as good.
    """
    surrounding = Environment(np.ones((8, 16, 3), np.float32)) if sky == "map" else None
    objects = [o for place, (name, _) in enumerate(seen) for o in beside(solids(name), place)]
    behind = (1.0, 1.0, 1.0) if sky == "background" else (0.0, 0.0, 0.0)
    glassy = opened_camera_pass(gl, objects, background=behind, camera=NEAR, environment=surrounding)
    black = opened_camera_pass(gl, [replace(o, material=Black()) for o in objects], background=(1, 1, 1), camera=NEAR)
    for place, (name, bands) in enumerate(seen):
        camera = replace(NEAR, position=(NEAR.position[0] + APART * place, *NEAR.position[1:]))
        camera = replace(camera, target=(APART * place, 0.0, 0.0))
        glassy.spectrum, before = Spectrum(bands), glassy.fallbacks
        glassy.run(camera, *SIZE, 64)
        black.run(camera, *SIZE, 64)
        rgb, share = glassy.read_rgb().astype(float), 1.0 - black.read_rgb()[..., 1]
        off = np.abs(rgb - 1.0).max(axis=-1)
        outline = (share > 0.0) & (share < 1.0)
        assert (share == 1.0).mean() > 0.05 and outline.any()
        assert np.abs(rgb.mean(axis=(0, 1)) - 1.0).max() < 1e-3, name
        if bands == 1:
            assert off.max() < 0.01 and np.abs(rgb.mean(axis=(0, 1)) - 1.0).max() < 4e-4, name
        else:
            assert np.quantile(off[share == 1.0], 0.9) < 0.02, name
            rim = np.abs(rgb[outline].mean(axis=0) - 1.0).max()
            assert off[~outline].max() < 0.08 and off.max() < 0.15 and rim < 0.02, name
        assert glassy.fallbacks["columns_dropped"] == before["columns_dropped"] or name == "brilliant"
    released(glassy)
    released(black)


def test_nothing_is_counted_twice_from_under_water(gl) -> None:
    """Where total reflection begins (Snell's window), a path that nothing has dispersed yet is cut as the one band that
    it becomes there: as the whole spectrum, 1 % were off."""
    inside = Camera((0.0, 0.0, -0.4), (0.0, 0.05, 1.0), vertical_fov_deg=90.0)
    block = [SceneObject("block", primitives.box((2.0, 2.0, 2.0)), glass("water"))]
    rgb = render(gl, block, background=(1, 1, 1), camera=inside, size=SIZE, samples=64)
    assert np.abs(rgb.mean(axis=(0, 1), dtype=float) - 1.0).max() < 3e-3


@pytest.mark.parametrize("roughness", [0.2, 0.5, 1.0])
def test_rough_glass_vanishes_too(gl, roughness: float) -> None:
    """What microfacets throw at each other comes out again: the mean to 1 %, where following one of them alone leaves
    0.98, 0.88 and 0.59. Nothing is coated here: what coats share with rough surfaces is there without them."""
    objects = [SceneObject("ball", ball(0.6), Dielectric(from_abbe(1.5, 50.0), roughness=roughness))]
    inside = replace(NEAR, vertical_fov_deg=10.0)
    rgb = render(gl, objects, background=(1, 1, 1), camera=inside, size=(16, 16), samples=256, method="srd-lambda")
    assert np.abs(rgb.mean(axis=(0, 1), dtype=float) - 1.0).max() < 0.01


def colour_noise(gl) -> float:
    """Of a ball of flint in white, seen by 64 single wavelengths a pixel: root mean square about each pixel's mean."""
    near = replace(NEAR, vertical_fov_deg=6.0)
    rgb = render(
        gl, solids("ball"), background=(1, 1, 1), camera=near, size=(12, 12), samples=64, method="stochastic-even"
    )
    return float(np.sqrt(np.mean((rgb - rgb.mean(axis=-1, keepdims=True)) ** 2)))


def test_single_wavelengths_hardly_colour_a_pixel(gl) -> None:
    """0.7 % of white; 3.1 % where wavelengths are a sequence of their own."""
    assert colour_noise(gl) < 0.012


# ---- textures behind glass ---------------------------------------------------------------------


def checkered(cells: int, texels: int = 512) -> SceneObject:
    """A square of side 4 at z = 0 with black and white cells."""
    row = (np.arange(texels) * cells // texels) % 2
    grey = (row[:, None] ^ row[None, :]).astype(np.float32)
    mesh = make_mesh(
        "paper",
        np.array([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], float),
        np.array([[0, 1, 2], [0, 2, 3]]),
        uv=np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], np.float32),
    )
    return SceneObject("paper", mesh, Diffuse((1, 1, 1), texture=Texture(np.repeat(grey[..., None], 3, axis=2))))


@pytest.mark.parametrize("solid", ["none", pytest.param("slab", marks=pytest.mark.slow), "ball"])
def test_a_checker_finer_than_pixels_is_grey_through_glass(gl, solid: str) -> None:
    """Cells of an eighth of a pixel: one sample a pixel shows their mean to 2 %; a texture looked up without its
    footprint shows black or white."""
    lamp = DirectionalLight("low", WHITE, direction=(0.0, 0.98, -0.2))
    glassy = {
        "none": [],
        "slab": [SceneObject("slab", primitives.box((3, 3, 0.4)), FLINT, at(0, 0, 1.5))],
        "ball": [SceneObject("ball", ball(0.5, 20_480), Dielectric(from_abbe(1.5, 50.0)), at(0, 0, 1.5))],
    }[solid]
    camera = Camera((0, 0, 9), (0, 0, 0), up=(0, 1, 0), kind="orthographic", vertical_extent=0.5)
    pictures = []
    for cells in (256, 1):
        # 4 / 256 of a unit is an eighth of 0.5 / 4: a pixel holds 8² cells.
        paper = checkered(cells)
        if cells == 1:
            paper = SceneObject("paper", paper.mesh, Diffuse((0.5, 0.5, 0.5)))  # what they average to
        pictures.append(render(gl, [*glassy, paper], [lamp], size=(4, 4), camera=camera, split_threshold=1e-4)[..., 1])
    assert pictures[1].min() > 0.5 * pictures[1].max() > 0.0
    assert pictures[0] == pytest.approx(pictures[1], rel=0.02)
