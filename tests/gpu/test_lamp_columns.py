"""How far the light of a lamp's other points lands beside a photon's (`Features.lamp_columns`): against photons that
start elsewhere on the lamp, and an image of the sun against f tan α."""

from __future__ import annotations

import math

import numpy as np
import pytest
from spectrasplat.model.geometry.primitives import box
from spectrasplat.model.geometry.primitives_lens import lens
from spectrasplat.model.lights import AreaLight, DirectionalLight
from spectrasplat.model.optics.spectrum import constant
from spectrasplat.model.scene import Diffuse, Light
from spectrasplat.stress.rigs.gpu_paths import glass, placed, trace_light

from tests.gpu.test_columns_gpu import ball, room

NM = [(580.0, 580.0)]
COUNT = 1024
TOWARDS = (0.9701425, 0.0, -0.2425356)
ASIDE = 0.2
"""Of a light's extent in [0, 1]: how far beside its middle photons start that the columns are compared with."""
LIGHTS: dict[str, tuple[Light, float]] = {
    "sun": (DirectionalLight("light", constant(1.0), direction=TOWARDS, angular_diameter_deg=0.4), 1.0 / 4.0),
    "disc": (AreaLight("light", constant(1.0), position=(-5, 0, 1), direction=TOWARDS, radius=0.02), 1.0 / 4.0),
    "rectangle": (
        AreaLight(
            "light", constant(1.0), position=(-5, 0, 1), direction=TOWARDS, shape="rectangle", width=0.03, height=0.05
        ),
        1.0 / 3.0,
    ),
}
"""And the variance of a coordinate of their points, over half their extent squared."""


def covariance(*sides: np.ndarray) -> np.ndarray:
    """Of footprints of these sides (n, 3): (n, 3, 3)."""
    return np.einsum("kni,knj->nij", np.stack(sides).astype(float), np.stack(sides).astype(float))


@pytest.mark.parametrize("name", LIGHTS)
def test_columns_say_where_the_rest_of_a_light_lands(gl, name: str) -> None:
    light, variance = LIGHTS[name]
    # So broad beside the lattice that of its own footprint nothing is left.
    step = 1e4
    starts = [(0.5, 0.5), *((0.5 + x * ASIDE, 0.5 + y * ASIDE) for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)))]
    traces = [trace_light(gl, (ball(), room()), light, NM, COUNT, place=starts[0], lamp_step=step).records]
    traces += [trace_light(gl, (ball(), room()), light, NM, COUNT, place=start).records for start in starts[1:]]
    keys = [(t["photon_id"].astype(np.uint64) << np.uint64(32)) | t["branch_key"].astype(np.uint64) for t in traces]
    common = keys[0]
    for other in keys[1:]:
        common = np.intersect1d(common, other)
    assert len(common) > 300
    told, right, left, up, down = (
        t[np.argsort(k)][np.isin(np.sort(k), common)] for t, k in zip(traces, keys, strict=True)
    )
    shifts = [(a["position"].astype(float) - b["position"]) / (4.0 * ASIDE) for a, b in ((right, left), (up, down))]
    wanted = variance * step**2 * covariance(*shifts)
    made = covariance(told["dposition_ds"], told["dposition_dt"])
    error = np.abs(made - wanted).max(axis=(1, 2)) / np.trace(wanted, axis1=1, axis2=2)
    assert np.median(error) < 0.005
    assert np.quantile(error, 0.85) < 0.05


def test_footprints_in_the_focal_plane_are_as_broad_as_the_image_of_the_sun(gl) -> None:
    material = glass("N-BK7")
    n, radius, thickness = float(material.dispersion.index(np.array([580.0]))[0]), 12.0, 0.02
    made = lens(radius, -radius, 0.5, thickness, triangles=6000)
    focal = 1.0 / ((n - 1.0) * (2.0 / radius - (n - 1.0) * thickness / (n * radius**2)))
    principal = focal * (n - 1.0) * thickness / (n * radius)
    floor = np.eye(4)
    floor[2, 3] = -(0.5 * thickness - principal + focal) - 0.5
    sun = DirectionalLight("light", constant(1.0), direction=(0.0, 0.0, -1.0), angular_diameter_deg=1.0)
    objects = (placed("lens", made, material), placed("floor", box((4.0, 4.0, 1.0)).transformed(floor), Diffuse()))
    smoothing = 0.45
    photons = trace_light(gl, objects, sun, NM, max_depth=2, lamp_step=1.0 / smoothing)
    photons = photons.of_depth(2)
    bright = photons.records["flux_w"] > 0.5 * photons.records["flux_w"].max()
    assert bright.sum() > 100
    records = photons.records[bright]
    sides = [smoothing * records[name] / photons.emitter.space.scale for name in ("dposition_ds", "dposition_dt")]
    spread = np.sqrt(np.linalg.eigvalsh(covariance(*sides))[:, 1:])
    wanted = 0.5 * focal * math.tan(math.radians(0.5))
    assert np.abs(np.median(spread, axis=0) / wanted - 1.0).max() < 0.02
