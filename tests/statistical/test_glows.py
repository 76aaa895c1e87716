"""Faint wide glows: light that a diamond ellipsoid throws all over a table after many reflections, and what ground
glass does.

Columns of such light grow by a factor with every surface. What they say is kept within what light can do: directions
behind a surface (`passes.trace.WIDEST_TURN`), lobes of microfacets (`light/trace_widths.glsl`); beside a table's border
what fans out is mirrored (`light/footprint_images.glsl`). Scenes that nobody chose found them (`bench-agreement
--random`).

Smallest errors these can detect: 0.5 % of the light beside the borders, 0.002 of a picture's blocks (root mean square).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.gpu.context import Context
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.reference.photon_reference import cached_reference
from spectrasplat.render.still import render

from tests.unit.scene_texts import load

WIDTH, HEIGHT, BLOCK = 96, 54, 6
TABLE = """
[[objects]]
name = "table"
shape = "plane"
width = 8.0
height = 8.0
material = { kind = "diffuse", colour = 0.5 }
"""
ELLIPSOID = (
    """
[camera]
position = [-0.6252, -4.2173, 6.3383]
target = [-0.377, -0.3115, 0.0]
vertical_fov_deg = 26.7671

[[lights]]
name = "lamp"
spectrum = { laser = 546.1 }
kind = "area"
position = [0.654, -3.5207, 4.0278]
target = [0.2556, -0.1564, 0.3]
shape = "rectangle"
size = [0.3201, 0.1315]
flux_lm = 72000.0

[[objects]]
name = "ellipsoid"
shape = "ellipsoid"
semi_axes = [0.412, 0.6675, 0.3219]
glass = "diamond"
rotation_deg = [165.7646, 60.2826, 54.8099]
position = [-0.0307, 0.0335, 0.0]
rests_at_z = 0.001
"""
    + TABLE
)
GROUND = (
    """
[camera]
position = [-0.3, -5.5, 5.5]
target = [-0.3, -0.9, 0.0]
vertical_fov_deg = 36.0

[[lights]]
name = "lamp"
kind = "area"
position = [-0.0274, -0.4624, 3.8681]
target = [0.0692, -0.0451, 0.3]
shape = "disc"
radius = 0.1722
flux_lm = 78000.0

[[objects]]
name = "stone"
shape = "inline"
vertices = [[0.2798, 0.5083, 0.5483], [0.538, -0.5386, -0.4579], [-0.4031, 0.3606, -0.4248], [-0.3451, -0.2858, 0.2984]]
triangles = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]
glass = "diamond"
roughness = 0.5401
rotation_deg = [162.4654, 306.4464, 105.6976]
position = [-0.6246, -0.8853, 0.0]
rests_at_z = 0.2159
"""
    + TABLE
)


def loaded(text: str, folder: Path) -> Scene:
    return load(folder, text)


def blocks(picture: np.ndarray) -> np.ndarray:
    return picture.reshape(HEIGHT // BLOCK, BLOCK, WIDTH // BLOCK, BLOCK).sum(axis=(1, 3))


def reference(scene: Scene, photons: int) -> np.ndarray:
    return blocks(cached_reference(scene, WIDTH, HEIGHT, photons=photons).xyz[..., 1])


def drawn(gl: Context, scene: Scene, photons: int) -> np.ndarray:
    settings = RenderSettings(width=WIDTH, height=HEIGHT, photons=photons, layer="caustic")
    return blocks(render(scene, settings, context=gl).rgb @ np.array([0.2126, 0.7152, 0.0722]))


def deviation(found: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt(((found - truth) ** 2).sum() / (truth**2).sum()))


@pytest.fixture(scope="module")
def ellipsoid(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return loaded(ELLIPSOID, tmp_path_factory.mktemp("ellipsoid"))


@pytest.fixture(scope="module")
def truth(ellipsoid: Scene) -> np.ndarray:
    return reference(ellipsoid, 2_000_000)


@pytest.fixture(scope="module")
def stone(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return loaded(GROUND, tmp_path_factory.mktemp("stone"))


@pytest.fixture(scope="module")
def glow(stone: Scene) -> np.ndarray:
    return reference(stone, 10_000_000)


def beside_borders(picture: np.ndarray) -> float:
    """The light of the picture's outermost two blocks."""
    return float(picture.sum() - picture[2:-2, 2:-2].sum())


BESIDE = 0.987


def test_a_glow_keeps_its_light_beside_the_tables_border(gl: Context, ellipsoid: Scene, truth: np.ndarray) -> None:
    assert beside_borders(drawn(gl, ellipsoid, 40_000)) > BESIDE * beside_borders(truth)


SPREAD = 0.0245


def test_directions_are_believed_no_further_than_one_photon_stands_for(
    gl: Context, ellipsoid: Scene, truth: np.ndarray
) -> None:
    assert deviation(drawn(gl, ellipsoid, 200_000), truth) < SPREAD


GROUND_BOUND, GROUND_PHOTONS = 0.09, 40_000


def test_light_of_a_ground_diamond_stays_where_it_lands(gl: Context, stone: Scene, glow: np.ndarray) -> None:
    found = drawn(gl, stone, GROUND_PHOTONS)
    assert deviation(found, glow) < GROUND_BOUND
    assert found.sum() == pytest.approx(glow.sum(), rel=0.03)
