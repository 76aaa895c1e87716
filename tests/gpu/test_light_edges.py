"""Where a light's emission ends at a hard edge (`Features.light_edges`): the pure part against float64, and footprints
that are cut off there."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.stats import norm
from spectrasplat.base.paths import assets_dir
from spectrasplat.features.features import Features
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.still import render
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

REACH, SPREAD = 1.0, 0.42


def test_the_pure_part_against_float64(gl) -> None:
    """An edge goes into a word and comes out of it, to half a step of 12 bits; the lit share is a normal
    distribution's."""
    rng = np.random.default_rng(3)
    spacings, change = as_f32(rng.uniform(-1.6, 1.6, 4000)), as_f32(rng.normal(size=(4000, 2)))
    body = "inside = spacings_inside(d, c); lit = lit_share(d); back = unpacked_edge(packed_edge(d, c));"
    outputs = {"inside": "float", "lit": "float", "back": "vec3"}
    got = evaluate(gl.ctx, ["lib/edge.glsl"], body, {"d": spacings, "c": change}, outputs)
    d, c = np.asarray(spacings, float), np.asarray(change, float)
    length = np.linalg.norm(c, axis=1)
    np.testing.assert_allclose(np.asarray(got["inside"]).reshape(-1), d / length, rtol=1e-5)
    wanted = np.where(d <= -REACH, 0.0, np.where(d >= REACH, 1.0, norm.cdf(d / SPREAD)))
    assert np.abs(np.asarray(got["lit"]).reshape(-1) - wanted).max() < 1e-6
    near = np.abs(d) < REACH
    back = np.asarray(got["back"], float).reshape(-1, 3)
    assert not back[~near].any()
    assert np.abs(back[near, 2] - d[near]).max() < REACH / 4095.0 + 1e-5
    assert np.abs(back[near, :2] - c[near] / length[near, None]).max() < np.pi / 4096.0 + 1e-5


def rim(picture: np.ndarray) -> np.ndarray:
    """Radii (pixels) at which light begins below a ball, by angle: what the rim of a beam throws by reflection."""
    luminance = picture @ [0.2126, 0.7152, 0.0722]
    angle, radius = np.meshgrid(np.linspace(0.6, 2.2, 200), np.linspace(10.0, 55.0, 900), indexing="ij")
    rays = map_coordinates(luminance, [75.0 + radius * np.sin(angle), 130.0 + radius * np.cos(angle)], order=1)
    return radius[0][np.argmax(rays > 0.4 * np.median(rays[:, -1]), axis=1)]


def test_the_rim_of_a_beam_throws_a_clean_border(gl) -> None:
    """Pixels by which the border strays from a smooth curve, root mean square: 0.10, and 0.75 where a lattice thinned
    out towards the rim drew it."""
    scene = load_scene(assets_dir() / "scenes" / "ball.toml")
    settings = RenderSettings(240, 135, photons=20_000, layer="caustic", spp=4, max_depth=1)
    assert Features.of(scene, settings).light_edges
    radii = rim(render(scene, settings, context=gl).rgb.astype(float))
    turn = np.linspace(-1.0, 1.0, len(radii))
    away = radii - np.polyval(np.polyfit(turn, radii, 6), turn)
    assert np.sqrt(np.mean(away**2)) < 0.25
