"""What the tests of the camera's pass share: small scenes, pictures of them, and what simple surfaces should look
like."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from spectrasplat.features.features import Features
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.map_channels import MapChannels
from spectrasplat.gpu.records import NONE, PLACEMENT, RECEIVER
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.geometry.primitives import plane
from spectrasplat.model.lights import DirectionalLight
from spectrasplat.model.optics import spectrum
from spectrasplat.model.optics.colorimetry import K_M, cmf_xyz, daylight_per_lumen, rgb709_to_xyz, xyz_to_rgb709
from spectrasplat.model.placement import rotation_about
from spectrasplat.model.scene import Camera, Diffuse, Material, Scene, SceneObject
from spectrasplat.model.scene_camera import camera_frame
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.camera import CameraPass
from spectrasplat.passes.caustic_maps import CausticMaps
from spectrasplat.render import still
from spectrasplat.render.device_scene import spectral_axis
from spectrasplat.stress.rigs import camera_probe

REFLECTANCE = 0.5
WHITE = spectrum.illuminant("D65").scaled_to_luminous(1000.0)  # R = G = B = 1000
ABOVE = Camera(position=(0, 0, 10), target=(0, 0, 0), up=(0, 1, 0), kind="orthographic", vertical_extent=4.0)
DOWN = (0.0, 0.0, -1.0)
XYZ = MapChannels()


def quad(corners, material, name="quad") -> SceneObject:
    return SceneObject(name, make_mesh(name, np.array(corners, float), np.array([[0, 1, 2], [0, 2, 3]])), material)


def horizontal(x0, x1, y0, y1, z, material, name="quad") -> SceneObject:
    return quad([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]], material, name)


def floor(half=12.0) -> SceneObject:
    return horizontal(-half, half, -half, half, 0.0, Diffuse((REFLECTANCE,) * 3), "floor")


def opened_camera_pass(
    gl,
    objects,
    lights=(),
    background=(0.0, 0.0, 0.0),
    camera=ABOVE,
    charts=False,
    environment=None,
    method="srd",
    split_threshold=None,
    channels=XYZ,
    **options,
) -> CameraPass:
    """A pass of its own buffers. `split_threshold` near 0 follows every part of a split path that weighs anything: no
    chance is left in the picture."""
    scene = Scene("test", camera, tuple(lights), tuple(objects), background, environment)
    features = Features.of(
        scene, RenderSettings(method=method, bins=channels.count if channels.edges_nm else None, any_view=True)
    )
    features = replace(features, charts=charts or features.charts)
    camera_pass = CameraPass(
        gl, SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features)), maps=channels, **options
    )
    if not camera_pass.disperses:
        # Whoever asks for one sample knows where it looks.
        camera_pass.primary_samples = 1
    if split_threshold is not None:
        camera_pass.split_threshold = split_threshold
    return camera_pass


def released(camera_pass: CameraPass) -> None:
    """Free the pass and its scene."""
    camera_pass.scene.release()
    camera_pass.release()


def render(gl, objects, lights=(), size=(32, 24), samples=1, camera=ABOVE, maps=None, **options) -> np.ndarray:
    """Linear Rec.709 picture (H, W, 3); `maps`: caustic maps."""
    camera_pass = opened_camera_pass(gl, objects, lights, camera=camera, **options)
    camera_pass.run(camera, *size, samples, maps=maps)
    rgb = camera_pass.read_rgb()
    released(camera_pass)
    return rgb


def white_through(transmission: np.ndarray) -> np.ndarray:
    """Linear Rec.709 of white light (1, 1, 1) of which (401,) is left: D65 times it over the observer, nanometre by
    nanometre."""
    return (daylight_per_lumen() * transmission) @ xyz_to_rgb709(K_M * cmf_xyz())


def picture_points(size, camera) -> tuple[np.ndarray, np.ndarray]:
    """Ray origins and unit directions of pixel centres, (H, W, 3), by the textbook."""
    width, height = size
    right, up, forward = camera_frame(camera)
    x = (2 * (np.arange(width) + 0.5) / width - 1) * width / height
    y = 1 - 2 * (np.arange(height) + 0.5) / height
    across = x[None, :, None] * right + y[:, None, None] * up
    position = np.array(camera.position, float)
    if camera.kind == "orthographic":
        return position + 0.5 * camera.vertical_extent * across, np.broadcast_to(forward, across.shape)
    direction = forward + np.tan(np.radians(camera.vertical_fov_deg / 2)) * across
    return np.broadcast_to(position, across.shape), direction / np.linalg.norm(direction, axis=-1, keepdims=True)


def floor_points(size, camera, height=0.0) -> np.ndarray:
    origin, direction = picture_points(size, camera)
    return origin + ((height - origin[..., 2]) / direction[..., 2])[..., None] * direction


def point_light_radiance(points, position, intensity=1000.0) -> np.ndarray:
    way = np.asarray(position) - points
    r2 = (way**2).sum(axis=-1)
    return REFLECTANCE / np.pi * intensity * way[..., 2] / np.sqrt(r2) / r2


def at(x, y, z) -> np.ndarray:
    """Object to world: moved there."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def tilted(degrees: float) -> np.ndarray:
    """Object to world: turned about x."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_about((1.0, 0.0, 0.0), np.radians(degrees))
    return matrix


def sheets_in_a_furnace(
    gl: Context,
    sheets: Sequence[tuple[Material, float]],
    polarised: bool = False,
    settings: RenderSettings = camera_probe.FEW,
) -> list[np.ndarray]:
    """(3,) of each sheet of a material, turned by so many degrees: what it throws back and lets through of white light
    from everywhere. They are one scene, so far apart that none sees another, and one program."""
    objects, cameras = [], []
    for i, (material, degrees) in enumerate(sheets):
        x = 20.0 * i
        objects.append(SceneObject(f"sheet {i}", plane(1.0, 1.0), material, at(x, 0.0, 0.0) @ tilted(degrees)))
        cameras.append(replace(ABOVE, position=(x, 0.0, 4.0), target=(x, 0.0, 0.0), vertical_extent=0.05))
    scene = camera_probe.white_furnace(*objects, camera=cameras[0])
    scene = replace(scene, render=replace(scene.render, polarisation=polarised))
    with camera_probe.opened_camera_pass(gl, scene, settings) as camera_pass:
        return [camera_probe.look_with(camera_pass, camera, settings).mean for camera in cameras]


def in_the_sun(*above: SceneObject) -> Scene:
    """A grey floor in sunlight from straight above and what stands over it, seen from below that."""
    camera = replace(ABOVE, position=(0.0, 0.0, 0.6), vertical_extent=2.0)
    return Scene("in the sun", camera, (DirectionalLight("sun", WHITE, direction=DOWN),), (floor(), *above))


def shares_of_the_sun(gl: Context, stands: Sequence[Sequence[SceneObject]], method: str = "srd") -> np.ndarray:
    """(n, 3): share of the sun that lands under each of what stands beside each other, a unit square in outline and
    higher than 0.6."""
    row = []
    for i, stand in enumerate(stands):
        move = at(2.0 * i + 1.0 - len(stands), 0.0, 0.0)
        row += [replace(o, name=f"{o.name} {i}", object_to_world=move @ o.object_to_world) for o in stand]
    settings = RenderSettings(8 * len(stands), 8, photons=20_000 * len(stands), spp=16, method=method)
    rgb = still.render(in_the_sun(*row), settings, context=gl).rgb.astype(float)
    middles = rgb.reshape(8, len(stands), 8, 3)[3:5, :, 3:5]
    return middles.mean(axis=(0, 2)) / (REFLECTANCE * 1000.0 / np.pi)


def flat_maps(gl, scene: SceneBuffers, windows, channels: np.ndarray, scale=1.0) -> CausticMaps:
    """Maps of one flat receiver: `windows` are (x0, y0, world side, atlas x, atlas y, texels a side), finest first."""
    placements = PLACEMENT.zeros(len(windows))
    placements["blurred"], placements["row_w"] = NONE, (0.0, 0.0, 0.0, 1.0)
    for i, (x0, y0, side, ax, ay, count) in enumerate(windows):
        per_unit = count / side
        to_world = 1.0 / scene.space.scale  # rows act on GPU space
        placements[i]["row_u"] = per_unit * to_world, 0, 0, ax + per_unit * (scene.space.centre[0] - x0)
        placements[i]["row_v"] = 0, per_unit * to_world, 0, ay + per_unit * (scene.space.centre[1] - y0)
        placements[i]["rect"] = ax, ay, ax + count, ay + count
        placements[i]["texel_area"] = 1 / per_unit**2
        placements[i]["next"] = i + 1 if i + 1 < len(windows) else NONE
    receivers = RECEIVER.zeros(1)
    receivers["reflectance_rgb"] = REFLECTANCE
    height, width = channels.shape[:2]
    textures = [
        gl.ctx.texture(
            (width, height), 4, np.ascontiguousarray(channels[..., 4 * t : 4 * t + 4], np.float32).tobytes(), dtype="f4"
        )
        for t in range(channels.shape[2] // 4)
    ]
    return CausticMaps(textures, gl.ctx.buffer(receivers.tobytes()), gl.ctx.buffer(placements.tobytes()), scale)


def white_texels(luminous: np.ndarray) -> np.ndarray:
    """XYZW texels (H, W, 4) of D65 with the given lumens."""
    xyz = rgb709_to_xyz(luminous[..., None] * np.ones(3))
    return np.concatenate([xyz, luminous[..., None] / 200], axis=-1)
