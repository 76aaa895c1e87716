"""How much of a lamp a blurred camera ray sees (shaders/lib/lights.glsl): no light is lost, however wide the blur."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.passes.camera_records import CAMERA_LIGHT
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

COUNT = 2048


def soft_amounts(gl, body: str, offset: np.ndarray, blur: float) -> np.ndarray:
    """What a soft look at the offsets sees, by the shader."""
    inputs = {"offset": offset, "blur": np.full(len(offset), blur)}
    declared = "layout(std430, binding = 8) readonly buffer Lights { CameraLight lights[]; };"
    got = evaluate(
        gl.ctx,
        ["lib/lights.glsl"],
        body,
        inputs,
        {"seen": "float"},
        structs=[CAMERA_LIGHT],
        buffers={8: CAMERA_LIGHT.zeros(1)},
        declarations=declared,
    )
    return got["seen"]


@pytest.mark.parametrize("blur", [0.0, 0.01, 0.3, 0.99, 1.0, 1.01, 3.0, 40.0])
def test_a_soft_look_keeps_what_the_light_sends(gl, blur: float) -> None:
    """Summed over all offsets it is the disc's area, or the stretch's length, however wide the look: no light is lost
    in small far lamps."""
    edge = max(1.0, blur) + blur
    offset = as_f32((np.arange(COUNT) + 0.5) / COUNT * 1.05 * edge)
    step = 1.05 * edge / COUNT
    disc = soft_amounts(gl, "seen = disc_seen(offset, blur);", offset, blur)
    stretch = soft_amounts(gl, "seen = stretch_seen(offset, 0.7, 0.7 * blur);", 0.7 * offset, blur)
    # A sharp edge falls between two of 2048 places; the trapezoids themselves are summed up exactly enough.
    room = 2.0 * step if blur == 0.0 else 1e-3
    assert 2.0 * np.pi * (disc * offset).sum() * step == pytest.approx(np.pi, rel=room)
    assert 2.0 * stretch.sum() * 0.7 * step == pytest.approx(1.4, rel=room)
    assert (np.diff(disc) <= 1e-7).all() and (np.diff(stretch) <= 1e-7).all()
    assert disc[-1] == stretch[-1] == 0.0


@pytest.mark.parametrize("radius", [0.02, 0.3, 0.5, 1.0])
def test_where_a_small_light_lies_between_looks_hardly_matters(gl, radius: float) -> None:
    """Looks a unit apart, each as wide: their sum over a light's places is its area to some per cent of it."""
    rng = np.random.default_rng(7)
    middle, grid = rng.random((64, 1, 2)), np.stack(np.meshgrid(*[np.arange(-6.0, 7.0)] * 2), axis=-1).reshape(-1, 2)
    offset = as_f32(np.linalg.norm(grid - middle, axis=-1).ravel() / radius)
    seen = soft_amounts(gl, "seen = disc_seen(offset, softened(blur));", offset, 0.5 / radius).reshape(64, -1)
    assert np.abs(seen.sum(axis=1) / (np.pi * radius**2) - 1.0).max() < 0.05
