"""A page's picture: the still without the caustic that its camera sees directly, and where that is to be added."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...gpu import bindings, shader
from ...gpu.context import Context
from ...gpu.scene_buffers import SceneBuffers
from ...model.scene import Camera
from ...model.scene_camera import camera_frame
from ...model.staging import UpAxis
from ...passes.camera_records import camera_parameters
from ...passes.first_surfaces import FirstSurfaces
from ...passes.plane_frame import PlaneFrame

SUBPIXELS = 4
_GAMMA = 2.4
_HEADROOM = 4.0
"""How many times display white the base may be."""


@dataclass(frozen=True)
class PagePicture:
    """Arrays and the entry `camera` of a page's head."""

    arrays: dict[str, np.ndarray]
    head: dict[str, Any]


def page_picture(
    rgb: np.ndarray, caustic: np.ndarray, weight: np.ndarray, exposure_ev: float, still: bytes
) -> PagePicture:
    """`rgb` (H, W, 3): the still; `caustic`: of it, what receivers send of caustics; `weight`: `weight_of`; `still`: a
    JPEG file of it."""
    seen = weight.max(axis=2, keepdims=True) / max(float(weight.max()), 1e-12)
    base = np.maximum(rgb - seen * caustic, 0.0)
    white, most = _HEADROOM * 2.0**-exposure_ev, max(float(weight.max()), 1e-12)
    shaken = np.random.default_rng(1).random(base.shape)  # steps of 8 bits become grain
    codes = np.floor(255.0 * np.clip(base / white, 0.0, 1.0) ** (1.0 / _GAMMA) + shaken)
    arrays = {
        "still": np.frombuffer(still, np.uint8),
        "base": _png(np.minimum(codes, 255.0)),
        "weight": _png(np.rint(255.0 * weight / most)),
    }
    height, width = rgb.shape[:2]
    return PagePicture(arrays, {"width": width, "height": height, "base_white": white, "weight_white": most})


def _png(codes: np.ndarray) -> np.ndarray:
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(codes.astype(np.uint8)).save(file, format="PNG", optimize=True)
    return np.frombuffer(file.getvalue(), np.uint8)


def pixels_to_plane(camera: Camera, width: int, height: int, frame: PlaneFrame, buffers: SceneBuffers) -> np.ndarray:
    """(3, 3): homogeneous (u, v) of a plane, scene units, by those of pixels, centres at one half, rows downwards."""
    right, up, forward = camera_frame(camera)
    flat = camera.kind == "orthographic"
    half = 0.5 * camera.vertical_extent if flat else np.tan(np.radians(0.5 * camera.vertical_fov_deg))
    points = np.stack([*frame.axes, buffers.space.to_world(frame.origin) - np.asarray(camera.position, float)], axis=1)
    depth = np.array([0.0, 0.0, 1.0]) if flat else forward @ points
    x, y = right @ points / (half * width / height), up @ points / half
    inverse: np.ndarray = np.linalg.inv(np.stack([0.5 * width * (depth + x), 0.5 * height * (depth - y), depth]))
    return inverse / np.abs(inverse).max()


def weight_of(context: Context, buffers: SceneBuffers, camera: Camera, size: tuple[int, int], item: int) -> np.ndarray:
    """What a pixel shows of a unit of irradiance on object `item`: reflectance over π where the camera sees it
    directly, (H, W, 3)."""
    width, height = (SUBPIXELS * side for side in size)
    surfaces = FirstSurfaces(context.ctx, buffers)
    parameters = camera_parameters(buffers, camera, width, height)
    uniform = context.ctx.buffer(parameters.tobytes())
    try:
        uniform.bind_to_uniform_block(bindings.PARAMETERS)
        seen = np.frombuffer(surfaces.run(parameters).read(), np.uint32).reshape(height, width, 2)[..., 1] == item
    finally:
        context.ctx.detect_framebuffer(0).use()
        shader.release(surfaces, uniform)
    material = buffers.scene.objects[item].material
    # Spectra of the caustic hold a reflectance that is a spectrum.
    colour = np.ones(3) if material.reflectance is not None else np.asarray(material.reflectance_rgb, float)
    weight: np.ndarray = seen.reshape(size[1], SUBPIXELS, size[0], SUBPIXELS).mean(axis=(1, 3))[..., None] * colour
    return weight / np.pi


def first_look(
    camera: Camera, up: UpAxis, frame: PlaneFrame, lit: dict[str, Any], buffers: SceneBuffers
) -> dict[str, Any]:
    """What a look all round begins with: the camera's own framing, `radius` to either side of a `target` in its middle,
    as far away as the light: `turn` and `lift` of the eye, radians, about `axes`, two of the horizon and up."""
    _, _, forward = camera_frame(camera)
    position = np.asarray(camera.position, float)
    light = buffers.space.to_world(frame.origin) + np.asarray(lit["centre"]) @ frame.axes
    away = max(float(forward @ (light - position)), 0.5 * lit["across"])
    flat = camera.kind == "orthographic"
    radius = 0.5 * camera.vertical_extent if flat else away * np.tan(np.radians(0.5 * camera.vertical_fov_deg))
    axes = [[0, 0, 1], [1, 0, 0], [0, 1, 0]] if up == "y" else [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    side, ahead, above = np.array(axes) @ -forward
    turns = {"turn": float(np.arctan2(ahead, side)), "lift": float(np.arcsin(np.clip(above, -0.99, 0.99)))}
    return {"target": (position + away * forward).tolist(), "axes": axes, "radius": float(radius)} | turns
