"""Emission guided to where light lands against closed forms: nothing is lost, and fewer photons are wasted.

A beam falls on a black sheet with a slit, behind it lies a plate of glass, then the floor. What lands is
E·A·(1−R)/(1+R) for the area A of all openings and Fresnel's R at normal incidence, reflections within the plate
included. Besides the slit the sheet has a hole that is smaller than a cell of the emission domain and lies between the
pilot's points: its cells are thinned, and what it lets through, a fourteenth of the light, must be there on average all
the same. By Student's t a right renderer is refused once in 10,000 runs; a mutant that leaves thinned cells out fails.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy import stats
from scipy.spatial import KDTree
from spectrasplat.features.features import Features
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.lights import DirectionalLight
from spectrasplat.model.optics.spectrum import laser
from spectrasplat.model.scene import Black, Camera, Diffuse, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.emission_domain import EmissionDomain
from spectrasplat.reference.emission import lattice_point
from spectrasplat.reference.glasses import index
from spectrasplat.render.device_scene import spectral_axis
from spectrasplat.render.light_pass import LightPass
from spectrasplat.stress.rigs.gpu_paths import glass, screen

from tests.statistical.emitted import box

Opening = tuple[float, float, float, float]
pytestmark = pytest.mark.slow

ALPHA = 1e-4
LINE_NM, POWER = 550.0, 3.0
HALF = 3.2
"""Of the plate; a cell of the domain is a tenth of a unit."""
SLIT = (-0.01, 0.01, -2.0, 2.0)
"""x_lo, x_hi, y_lo, y_hi."""
HOLE = 0.08
"""Side of it."""
SEEDS, PHOTONS = 192, 8192


def sheet(hole: Opening) -> SceneObject:
    """A black sheet, four times as wide as the plate, without its two openings."""
    openings = (SLIT, hole)
    xs, ys = (sorted({-4 * HALF, 4 * HALF, *(at for o in openings for at in o[i : i + 2])}) for i in (0, 2))
    corners, triangles = [], []
    for x0, x1 in pairwise(xs):
        for y0, y1 in pairwise(ys):
            if any(o[0] <= x0 and x1 <= o[1] and o[2] <= y0 and y1 <= o[3] for o in openings):
                continue
            first = len(corners)
            corners += [(x0, y0, 3.0), (x1, y0, 3.0), (x1, y1, 3.0), (x0, y1, 3.0)]
            triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return SceneObject("sheet", make_mesh("sheet", np.array(corners), np.array(triangles)), Black())


def scene(hole: Opening) -> Scene:
    plate = box(1.0)
    plate = make_mesh("plate", plate.vertices * [HALF, HALF, 0.1], plate.triangles)
    light = DirectionalLight("sun", laser(LINE_NM, POWER), direction=(0.0, 0.0, -1.0))
    objects = (
        sheet(hole),
        SceneObject("plate", plate, glass("N-BK7")),
        SceneObject("floor", screen((0, 0, -1), (0, 0, 1), half=8.0), Diffuse()),
    )
    return Scene("slit", Camera((0, -6, 6), (0, 0, -1)), (light,), objects)


def prepared(gl: Context, hole: Opening) -> LightPass:
    question, settings = scene(hole), RenderSettings(24, 16, method="srd-photons", layer="map:floor")
    features = Features.of(question, settings)
    buffers = SceneBuffers(gl.ctx, question, features, spectral_axis(question, features))
    light = LightPass(gl, question, settings, features, buffers)
    light.prepare()
    return light


def between_points(light: LightPass) -> Opening:
    """A hole in the sheet through which no point of the pilot passes: as far from all as there is, and from the
    slit."""
    domain, count = light.survey.domains[0], light.survey.pilots[0].lattice_count
    unit = lattice_point(np.arange(count), count, (0, 0))
    places = domain.origin + (domain.rect[:2] + unit * domain.rect[2:]) @ np.stack([domain.tangent, domain.bitangent])
    points = light.buffers.space.to_world(places)[:, :2]
    tried = np.stack(np.meshgrid(np.linspace(1.5, 2.5, 201), np.linspace(-1.0, 1.0, 401)), axis=-1).reshape(-1, 2)
    distance, _ = KDTree(points).query(tried, p=np.inf)
    x, y = tried[np.argmax(distance)]
    assert distance.max() > 0.5 * HOLE
    return x - 0.5 * HOLE, x + 0.5 * HOLE, y - 0.5 * HOLE, y + 0.5 * HOLE


@pytest.fixture(scope="module")
def light(gl: Context) -> Iterator[LightPass]:
    first = prepared(gl, (1.9, 2.0, 1.9, 2.0))
    hole = between_points(first)
    light = prepared(gl, hole)
    yield light
    for each in (first, light):
        each.release()
        each.buffers.release()


def renderings(light: LightPass, domain: EmissionDomain) -> tuple[np.ndarray, np.ndarray]:
    """What lands and what is emitted in each of SEEDS renderings, W."""
    guided, sums = light.survey.domains, []
    light.survey.domains = {0: domain}
    for seed in range(SEEDS):
        light.begin(PHOTONS, 1 + seed)
        light.run_pass(0, PHOTONS, lambda _: True)
        tally = light.stats.tally
        sums.append(np.array([tally.ended["deposited"], tally.emitted]) * light.maps.scale)
    light.survey.domains = guided
    return tuple(np.array(sums).T)


def p_value(found: np.ndarray, expected: float) -> float:
    return float(stats.ttest_1samp(found, expected).pvalue)


def transmitted_w() -> float:
    n = float(index("N-BK7", LINE_NM))
    reflectance = ((n - 1.0) / (n + 1.0)) ** 2
    area = (SLIT[1] - SLIT[0]) * (SLIT[3] - SLIT[2]) + HOLE**2
    return POWER * area * (1.0 - reflectance) / (1.0 + reflectance)


def test_a_blocked_beam_lands_whole(light: LightPass) -> None:
    domain = light.survey.domains[0]
    assert domain.thinned is not None and domain.active_share < 0.4 * domain.mask.mean()
    found, emitted = renderings(light, domain)
    assert p_value(found, transmitted_w()) > ALPHA
    assert p_value(emitted, POWER * domain.measure * float(domain.mask.mean())) > ALPHA
    # What would be seen with probability 0.99 is less than what the hole lets through.
    smallest = (stats.t.ppf(1 - ALPHA / 2, SEEDS - 1) + 2.33) * found.std(ddof=1) / SEEDS**0.5
    through_hole = HOLE**2 / (HOLE**2 + (SLIT[1] - SLIT[0]) * (SLIT[3] - SLIT[2]))
    assert smallest < through_hole * transmitted_w(), (smallest / transmitted_w(), through_hole)
    # A mutant: thinned cells are left out.
    left_out = replace(domain, mask=domain.mask & ~domain.thinned, thinned=None, thinned_chance=1.0)
    assert p_value(renderings(light, left_out)[0], transmitted_w()) < ALPHA


def test_more_of_the_photons_land(light: LightPass) -> None:
    guided = light.survey.domains[0]
    landed = []
    for domain in (guided, replace(guided, thinned=None, thinned_chance=1.0)):
        found, _ = renderings(light, domain)
        assert p_value(found, transmitted_w()) > ALPHA
        assert light.stats.photons == pytest.approx(PHOTONS, rel=0.05)
        landed.append(light.stats.splats)
    assert landed[0] > 2.0 * landed[1], landed
