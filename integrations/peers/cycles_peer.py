"""Blender Cycles: N grey renderings, each with the index of one wavelength, since its glass does not disperse.

    python cycles_peer.py FOLDER OUT.npy WAVELENGTHS SAMPLES_A_PIXEL [MODE]

MODE: `path` (path tracing with caustics on, clamping and filtering off) or `mnee` (shadow caustics: manifold next event
estimation from lamps marked for it, which follows refraction through up to four surfaces and no reflection).
"""

from __future__ import annotations

import sys
from math import pi, radians
from pathlib import Path

import bpy
import neutral
import numpy as np
from mathutils import Matrix, Vector

BOUNCES = 66
WATTS_PER_INTENSITY = 4 * pi
"""Blender's power of a lamp at one point whose radiant intensity is 1 W/sr."""


def look(position: list[float], target: list[float], roll_up: str = "Y") -> Matrix:
    """The placement of a camera or a lamp: along its own −z."""
    way = Vector(target) - Vector(position)
    return Matrix.Translation(position) @ way.to_track_quat("-Z", roll_up).to_matrix().to_4x4()


def material(name: str, kind: str, inputs: dict[str, object]):
    """A material of one shader node, and that node."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    node, out = tree.nodes.new(kind), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], out.inputs["Surface"])
    for key, value in inputs.items():
        node.inputs[key].default_value = value
    return made, node


def add(name: str, data, placement: Matrix | None = None):
    """An object of the scene."""
    made = bpy.data.objects.new(name, data)
    made.matrix_world = placement or Matrix()
    bpy.context.scene.collection.objects.link(made)
    return made


def build(scene: dict, mode: str, with_glass: bool = True):
    """Blender's scene; returns the glass's node, or None."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    camera, lamp = scene["camera"], scene["lamp"]
    grey, _ = material("grey", "ShaderNodeBsdfDiffuse", {"Color": (*[scene["albedo"]] * 3, 1.0), "Roughness": 0.0})
    table = bpy.data.meshes.new("receiver")
    table.from_pydata(neutral.receiver_corners(scene).tolist(), [], [(0, 1, 2, 3)])
    table.materials.append(grey)
    receiver = add("receiver", table)
    node = None
    if with_glass:
        glass, node = material("glass", "ShaderNodeBsdfGlass", {"Color": (1.0, 1.0, 1.0, 1.0), "Roughness": 0.0})
        corners = scene["corners"].reshape(-1, 3)
        points, numbers = np.unique(corners, axis=0, return_inverse=True)
        mesh = bpy.data.meshes.new("glass")
        mesh.from_pydata(points.tolist(), [], numbers.reshape(-1, 3).tolist())
        if scene["smooth"]:
            mesh.shade_smooth()
            mesh.normals_split_custom_set(scene["normals"].reshape(-1, 3).tolist())
        else:
            mesh.shade_flat()
        mesh.materials.append(glass)
        solid = add("glass", mesh)
        solid.cycles.is_caustics_caster = mode == "mnee"
    receiver.cycles.is_caustics_receiver = mode == "mnee"
    if lamp["is_area"]:
        light = bpy.data.lights.new("lamp", "AREA")
        light.shape, light.size, light.size_y = "RECTANGLE", *lamp["size"]
        light.energy = pi * lamp["size"][0] * lamp["size"][1]
        rows = np.column_stack([lamp["tangent"], -np.array(lamp["bitangent"]), -np.array(lamp["direction"])])
        placement = Matrix.Translation(lamp["position"]) @ Matrix(rows.tolist()).to_4x4()
    else:
        light = bpy.data.lights.new("lamp", "SPOT")
        light.spot_size, light.spot_blend, light.shadow_soft_size = radians(2 * lamp["half_angle_deg"]), 0.0, 0.0
        light.energy = WATTS_PER_INTENSITY
        placement = look(lamp["position"], lamp["target"])
    light.cycles.is_caustics_light = mode == "mnee"
    add("lamp", light, placement)
    eye = bpy.data.cameras.new("camera")
    eye.sensor_fit, eye.angle = "VERTICAL", radians(camera["vertical_fov_deg"])
    bpy.context.scene.camera = add("camera", eye, look(camera["position"], camera["target"]))
    return node


def settle(scene: dict, samples: int) -> None:
    """Cycles' settings: all bounces, nothing clamped, filtered, blurred or denoised; a box for a pixel."""
    stage = bpy.context.scene
    stage.render.engine = "CYCLES"
    stage.render.resolution_x, stage.render.resolution_y = scene["size"]
    stage.render.image_settings.file_format = "OPEN_EXR"
    stage.render.image_settings.color_depth = "32"
    stage.render.film_transparent = False
    cycles = stage.cycles
    cycles.device, cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = "CPU", samples, False, False
    cycles.pixel_filter_type = "BOX"
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.max_bounces = cycles.glossy_bounces = cycles.transmission_bounces = BOUNCES
    cycles.diffuse_bounces, cycles.min_light_bounces = 1, BOUNCES
    stage.render.use_persistent_data = True


def main() -> None:
    """Renders and saves X, Y, Z."""
    folder, out, count, samples = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    scene = neutral.load(folder)
    node = build(scene, sys.argv[5] if len(sys.argv) > 5 else "path")
    settle(scene, samples)
    width, height = scene["size"]
    file = out.with_suffix(".exr")

    def render(number: int, n: float) -> np.ndarray:
        node.inputs["IOR"].default_value = n
        bpy.context.scene.cycles.seed = number
        bpy.context.scene.render.filepath = str(file)
        bpy.ops.render.render(write_still=True)
        picture = bpy.data.images.load(str(file))
        picture.colorspace_settings.name = "Linear Rec.709"
        pixels = np.array(picture.pixels[:], dtype=np.float32).reshape(height, width, picture.channels)
        bpy.data.images.remove(picture)
        return pixels[::-1, :, :3].mean(axis=2)

    np.save(out, neutral.accumulate(scene, count, render).astype(np.float32))
    file.unlink(missing_ok=True)


if __name__ == "__main__":
    main()
