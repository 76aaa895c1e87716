"""A glass ball, a prism and a table in Blender: baked by the installed program, put back, and rendered.

Run by a Python that has `bpy`: `python round_trip.py ADD_ON PROGRAM FOLDER`. Writes pictures and told.json into FOLDER.
"""

from __future__ import annotations

import importlib.util
import json
import math
import sys
from pathlib import Path

import bpy
import numpy as np

ADD_ON, PROGRAM, FOLDER = (Path(argument).resolve() for argument in sys.argv[1:4])
SUN_W_M2, REFLECTANCE = 4.0, (0.8, 0.6, 0.4)
BALL, RADIUS = (0.4, -0.2, 1.2), 0.5
PIXELS, SPAN = 120, 6.0


def material(name: str, **inputs: object) -> bpy.types.Material:
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    node = made.node_tree.nodes["Principled BSDF"]
    for key, value in inputs.items():
        node.inputs[key.replace("_", " ")].default_value = value
    return made


def add_prism() -> None:
    """At its minimum deviation, 66°, for the sun as it stands in the picture: bent to the left and down."""
    turned = [math.radians(angle - 18.4) for angle in (0.0, 120.0, 240.0)]
    places = [(0.5 * math.cos(angle), y, 0.5 * math.sin(angle)) for y in (-0.5, 0.5) for angle in turned]
    mesh = bpy.data.meshes.new("prism")
    mesh.from_pydata(places, [], [(0, 1, 2), (5, 4, 3), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)])
    item = bpy.data.objects.new("prism", mesh)
    item.location = (0.6, 1.0, 1.3)
    bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item


def build() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=SPAN)
    bpy.context.object.name = "table"
    bpy.context.object.data.materials.append(
        material("wood", Base_Color=(*REFLECTANCE, 1.0), Roughness=1.0, Specular_IOR_Level=0.0)
    )
    bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=64, radius=RADIUS, location=BALL)
    bpy.ops.object.shade_smooth()
    bpy.context.object.name = "ball"
    bpy.context.object.data.materials.append(material("clear", Transmission_Weight=1.0, IOR=1.5168, Roughness=0.0))
    add_prism()
    bpy.context.object.data.materials.append(material("flint", Transmission_Weight=1.0, IOR=1.78, Roughness=0.0))
    bpy.ops.object.light_add(type="SUN", location=(0.0, 0.0, 5.0))
    bpy.context.object.data.energy, bpy.context.object.data.angle = SUN_W_M2, 0.0
    camera = bpy.data.cameras.new("camera")
    item = bpy.data.objects.new("camera", camera)
    scene.collection.objects.link(item)
    scene.camera = item
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.use_denoising = "CPU", False
    scene.cycles.caustics_refractive = scene.cycles.caustics_reflective = False
    scene.view_settings.view_transform = "Standard"


def look(position: tuple[float, float, float], target: tuple[float, float, float], ortho: bool) -> None:
    from mathutils import Vector

    item = bpy.context.scene.camera
    item.location = position
    item.rotation_euler = (Vector(target) - Vector(position)).to_track_quat("-Z", "Y").to_euler()
    item.data.type, item.data.ortho_scale = ("ORTHO" if ortho else "PERSP"), SPAN


def render(name: str, size: tuple[int, int], samples: int, linear: bool) -> np.ndarray:
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.cycles.samples = samples
    scene.render.image_settings.file_format = "OPEN_EXR" if linear else "PNG"
    scene.render.filepath = str(FOLDER / f"{name}{'.exr' if linear else '.png'}")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    if not linear:
        return np.zeros(0)
    return np.array(image.pixels[:]).reshape(size[1], size[0], 4)[..., :3]


def main() -> None:
    build()
    described = importlib.util.spec_from_file_location("spectrasplat_blender", ADD_ON)
    add_on = importlib.util.module_from_spec(described)
    sys.modules[described.name] = add_on
    described.loader.exec_module(add_on)
    add_on.register()
    add_on._wished_program = lambda context: str(PROGRAM)
    bpy.data.materials["clear"].spectrasplat.glass = "N-BK7"
    bpy.data.materials["flint"].spectrasplat.abbe = 12.0
    scene, told = bpy.context.scene, {}

    look((0.0, 0.0, 8.0), (0.0, 0.0, 0.0), ortho=True)
    ball, prism = bpy.data.objects["ball"], bpy.data.objects["prism"]
    ball.visible_camera = False
    prism.hide_render = True
    prism.hide_set(True)
    before = render("before", (PIXELS, PIXELS), 4, linear=True)
    try:
        bpy.ops.spectrasplat.bake()
    except RuntimeError as error:
        told["without a receiver"] = str(error)
    scene.spectrasplat.receiver = bpy.data.objects["table"]
    scene.spectrasplat.texels, scene.spectrasplat.photons = 512, 300_000
    told["result"] = list(bpy.ops.spectrasplat.bake())
    after = render("after", (PIXELS, PIXELS), 4, linear=True)

    light = (after - before)[::-1]  # row 0 on top
    x = (np.arange(PIXELS) + 0.5) / PIXELS * SPAN - 0.5 * SPAN
    east, north = np.meshgrid(x, -x)
    weight = light[..., 1]
    told["middle"] = [float((weight * c).sum() / weight.sum()) for c in (east, north)]
    lit = float(np.median(before[..., 1]))  # the table in plain sun
    told["plain sun"] = lit / (REFLECTANCE[1] * SUN_W_M2 / math.pi)
    told["through the ball"] = float(weight.sum()) * (SPAN / PIXELS) ** 2 / (lit * math.pi * RADIUS**2)
    told["colours"] = (light.sum(axis=(0, 1)) / light.sum() * sum(REFLECTANCE) / REFLECTANCE).tolist()

    ball.visible_camera = True
    prism.hide_render = False
    prism.hide_set(False)
    bpy.data.objects["Sun"].rotation_euler = (0.0, math.radians(-14.5), 0.0)
    told["again"] = list(bpy.ops.spectrasplat.bake())
    told["objects"] = sorted(o.name for o in scene.objects)
    look((0.6, -5.6, 4.6), (-0.3, 0.2, 0.3), ortho=False)
    scene.view_settings.exposure = -1.0
    render("picture", (480, 270), 48, linear=False)
    (FOLDER / "told.json").write_text(json.dumps(told, indent=1))
    add_on.unregister()


main()
