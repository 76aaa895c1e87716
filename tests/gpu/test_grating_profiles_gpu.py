"""Gratings with a profile: GLSL functions against float64, powers of orders through both passes, energy.

What a picture must show is reckoned from `Grating.shares`, which tests/unit/test_grating_profiles.py holds to closed
forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.gpu.context import Context
from spectrasplat.model.geometry.primitives import plane
from spectrasplat.model.optics.colorimetry import VISIBLE_NM
from spectrasplat.model.scene import Camera, Grating
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.still import render
from spectrasplat.stress.rigs.camera_probe import white_furnace

from tests.gpu.camera_rig import white_through
from tests.gpu.test_grating_gpu import sheet, shone
from tests.statistical.test_grating_against_references import (
    placed,
)

KINDS = {
    "blazed": {"profile": "blazed", "blaze_nm": 550.0},
    "mirror": {"profile": "blazed", "blaze_nm": 480.0, "reflects": True},
    "lamellar": {"profile": "lamellar", "depth_nm": 640.0},
    "sinusoidal": {"profile": "sinusoidal", "depth_nm": 900.0},
}
ORDERS = (-2, -1, 0, 1, 2)


def grating(kind: str, lines: float = 300.0, orders: tuple[int, ...] = ORDERS, share: float = 0.9) -> Grating:
    return Grating(lines, orders, (share,) * len(orders), **KINDS[kind])


@pytest.mark.parametrize("method", ["srd", "hero", "regular-point"])
@pytest.mark.parametrize("kind", list(KINDS))
def test_each_order_carries_its_share(gl: Context, kind: str, method: str) -> None:
    """Slanted light of one wavelength from either side: the closed form to 2e-5, and what is left is absorbed."""
    made = grating(kind)
    for direction in ((0.2, 0.1, -1.0), (-0.15, 0.1, 1.0)):
        light = np.array(direction) / np.linalg.norm(direction)
        # `across` is lines × outward = x, along is y.
        back = made.reflects == (light[2] < 0.0)
        wall = plane(9.0, 9.0)
        wall = replace(wall, vertices=wall.vertices + np.array([0.0, 0.0, 0.9 if back else -0.9]))
        for nm in (420.0, 546.0, 690.0):
            found = shone(gl, made, nm, light, wall=wall, method=method)
            steps = (found.position - found.start)[:, 0]
            want = made.shares(np.array(nm), light)
            kept = 0.0
            for order, share in zip(ORDERS, want, strict=True):
                t = light[:2] + np.array([order * nm * 3e-4, 0.0])
                ahead = 0.9 * t / np.sqrt(1.0 - t @ t)
                before = 0.4 * light[:2]
                mine = np.abs(steps - (before + ahead)[0]) < 1e-3
                got = found.records["flux_w"][mine].sum(dtype=float) / max(found.weight[mine].sum(), 1e-300)
                assert got == pytest.approx(share, abs=3e-5), (direction, nm, order)
                kept += share
            assert found.tally.ended["absorbed"] / found.tally.emitted == pytest.approx(1.0 - kept, abs=1e-4)


@pytest.mark.parametrize("kind", ["blazed", *(pytest.param(k, marks=pytest.mark.slow) for k in KINDS if k != "blazed")])
def test_the_camera_sees_the_shares_of_light_that_comes_back(gl: Context, kind: str) -> None:
    """White all round: a pixel has of each wavelength what all orders that lead to it leave of light from there."""
    made, camera = grating(kind), Camera((0.8, 0.0, 2.0), (0, 0, 0), (0, 1, 0), "orthographic", vertical_extent=0.5)
    view = np.array([-0.8, 0.0, -2.0]) / np.hypot(0.8, 2.0)
    through = np.zeros(len(VISIBLE_NM))
    for k, order in enumerate(made.orders):
        across = view[0] + order * 3e-4 * VISIBLE_NM
        upright = np.sqrt(1.0 - across**2)
        light = np.stack([-across, 0.0 * across, -upright if made.reflects else upright], axis=-1)
        through += made.shares(VISIBLE_NM, light)[k]
    scene = white_furnace(sheet(made, 4.0), camera=camera)
    picture = render(scene, RenderSettings(width=24, height=16, spp=64), context=gl).rgb.mean(axis=(0, 1))
    assert np.abs(picture - white_through(through)).max() < 6e-3


def test_energy_of_white_light_through_two_blazed_gratings(gl: Context) -> None:
    """Nothing is counted twice or forgotten where bands are wide and shares differ over them."""
    second = placed(plane(3.0, 3.0, "second"), grating("sinusoidal"), (0.0, 0.0, -0.3), np.eye(4))
    for kind in ("blazed", "lamellar"):
        found = shone(gl, grating(kind), (400.0, 700.0), around=[second])
        tally = found.tally
        assert sum(tally.ended.values()) == pytest.approx(tally.emitted, rel=1e-4)
        assert 0.0 < tally.ended["absorbed"] < 0.6 * tally.emitted
