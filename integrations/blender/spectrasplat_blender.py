"""Dispersive caustics for Blender: SpectraSplat bakes what glass throws on an object, and it is put back as light.

One file: Edit, Preferences, Add-ons, Install from Disk. It calls the installed program (`pip install .` in its
checkout), so nothing is installed into Blender. Docs: docs/blender.md of SpectraSplat. Licence: MIT.
"""

import json
import math
import os
import re
import shutil
import struct
import subprocess
import tempfile
import threading
from pathlib import Path

import bpy

bl_info = {
    "name": "SpectraSplat caustics",
    "author": "SpectraSplat",
    "version": (1, 0, 0),
    "blender": (4, 2, 0),
    "location": "Properties, Scene, SpectraSplat; Properties, Material, SpectraSplat glass",
    "description": "Bakes dispersive caustics of glass onto a flat object and puts them back as emission",
    "category": "Render",
}

LUMENS_PER_WATT = 683.0
"""Blender's glTF exporter turns watts into lumens by this."""
LIFT = 2e-4
"""Of the caustic's size: how far its plane lies before the receiver."""
MARK = "spectrasplat_of"
"""Custom property of what was put back: the receiver's name."""
GLTF_FROM_BLENDER = ((1, 0, 0), (0, 0, 1), (0, -1, 0))
"""Rows: glTF's x, y (up), z by Blender's x, y, z (up)."""


# ---- without Blender: files and the program ---------------------------------------------------


def blender_place(place):
    """A place of glTF's coordinates in Blender's."""
    x, y, z = place
    return (x, -z, y)


def gltf_matrix(world):
    """A Blender world matrix as glTF has it: the columns one after the other; lights and cameras look along -z in
    both."""
    rows = [[sum(a * world[k][j] for k, a in enumerate(turn)) for j in range(4)] for turn in GLTF_FROM_BLENDER]
    rows.append([0.0, 0.0, 0.0, 1.0])
    return [float(rows[i][j]) for j in range(4) for i in range(4)]


def read_glb(path):
    """The JSON of a .glb and its other chunks, (type, bytes)."""
    data = Path(path).read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    if magic != b"glTF" or version != 2 or length != len(data):
        raise ValueError(f"{path} is no glTF 2.0 binary file")
    at, chunks = 12, []
    while at < length:
        size, kind = struct.unpack_from("<II", data, at)
        chunks.append((kind, data[at + 8 : at + 8 + size]))
        at += 8 + size
    return json.loads(chunks[0][1]), chunks[1:]


def write_glb(path, document, chunks):
    """Write what `read_glb` gave."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = b"".join(struct.pack("<II", len(d), k) + d for k, d in [(0x4E4F534A, text), *chunks])
    Path(path).write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)


def add_glass(document, glasses):
    """Give the materials named in `glasses` what Blender's exporter leaves out.

    Each is {"ior", "abbe" (0: no dispersion), "glass" (a catalogue name, or ""), "colour", "distance" (0: clear)}.
    """
    used = set(document.get("extensionsUsed", []))
    for material in document.get("materials", []):
        glass = glasses.get(material.get("name"))
        if glass is None:
            continue
        given = material.setdefault("extensions", {})
        given["KHR_materials_transmission"] = {"transmissionFactor": 1.0}
        given["KHR_materials_ior"] = {"ior": glass["ior"]}
        volume = given.setdefault("KHR_materials_volume", {})
        volume["thicknessFactor"] = volume.get("thicknessFactor") or 1.0
        if glass["distance"] > 0.0:
            volume["attenuationColor"] = list(glass["colour"])
            volume["attenuationDistance"] = glass["distance"]
        if glass["abbe"] > 0.0:
            given["KHR_materials_dispersion"] = {"dispersion": 20.0 / glass["abbe"]}
        if glass["glass"]:
            extras = material.setdefault("extras", {})
            extras["spectrasplat"] = {**extras.get("spectrasplat", {}), "glass": glass["glass"]}
        surface = material.setdefault("pbrMetallicRoughness", {})
        surface["metallicFactor"], surface["roughnessFactor"] = 0.0, 0.0
        used.update(given)
    if used:
        document["extensionsUsed"] = sorted(used)


def leave_out(document, names):
    """Take the root nodes of these names out of the scene."""
    nodes = document.get("nodes", [])
    for scene in document.get("scenes", []):
        scene["nodes"] = [i for i in scene.get("nodes", []) if nodes[i].get("name") not in names]


def add_area_lights(document, lights):
    """Area lamps, which the exporter leaves out: each {"name", "matrix" (glTF's), "light" (a scene file's table)}."""
    if not lights:
        return
    link = "KHR_lights_punctual"
    listed = document.setdefault("extensions", {}).setdefault(link, {}).setdefault("lights", [])
    nodes = document.setdefault("nodes", [])
    for light in lights:
        entry = {"name": light["name"], "type": "spot", "intensity": light["light"]["flux_lm"] / math.pi}
        entry["color"] = light["colour"]
        entry["spot"] = {"innerConeAngle": 0.0, "outerConeAngle": 0.5 * math.pi}
        entry["extras"] = {"spectrasplat": {"light": {"name": light["name"], **light["light"]}}}
        listed.append(entry)
        nodes.append(
            {"name": light["name"], "matrix": light["matrix"], "extensions": {link: {"light": len(listed) - 1}}}
        )
        document["scenes"][document.get("scene", 0)].setdefault("nodes", []).append(len(nodes) - 1)
    document["extensionsUsed"] = sorted({*document.get("extensionsUsed", []), link})


def find_program(wished):
    """The command line of the program: `wished`, or what lies on the path; None where there is none."""
    found = shutil.which(wished or "spectrasplat")
    if found is None and wished and Path(wished).is_file():
        found = wished
    return None if found is None else [found]


class Job:
    """The program at work on one bake; `poll` as often as you like."""

    def __init__(self, program, scene, receiver, output, texels, photons, seed):
        self.output = Path(output)
        command = [*program, "bake", str(scene), receiver, "-o", str(output), "--size", f"{texels}x{texels}"]
        command += ["--seed", str(seed)] + (["--photons", str(photons)] if photons else [])
        self.share, self.lines = 0.0, []
        # Blender's own Python must not be found by the program's.
        around = {k: v for k, v in os.environ.items() if k not in ("PYTHONHOME", "PYTHONPATH")}
        self._process = subprocess.Popen(
            command, env=around, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, encoding="utf-8"
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self._process.stdout:
            progress = re.match(r".*: (\d+) % after \d+ s", line)
            if progress:
                self.share = int(progress[1]) / 100.0
            else:
                self.lines.append(line.strip())

    def _end(self):
        code = self._process.wait()
        self._reader.join()
        self._process.stdout.close()
        return code

    @property
    def is_running(self):
        return self._process.poll() is None

    def cancel(self):
        """Stop it; it writes nothing."""
        self._process.terminate()
        self._end()

    def result(self):
        """The placement of what was written. Raises RuntimeError with the program's own sentence where it failed."""
        code = self._end()
        if code != 0:
            told = next((line for line in reversed(self.lines) if line), "it gave no reason")
            raise RuntimeError(f"SpectraSplat failed (exit code {code}): {told}")
        return json.loads(self.output.with_suffix(".json").read_text(encoding="utf-8"))

    @property
    def notes(self):
        """What the program assumed, one sentence each."""
        return [line.removeprefix("note: ") for line in self.lines if line.startswith("note: ")]


# ---- what Blender holds -----------------------------------------------------------------------


def _shader(material):
    """The node that makes a material's surface; None where there is none."""
    if material is None or not material.use_nodes or material.node_tree is None:
        return None
    for node in material.node_tree.nodes:
        if node.type == "OUTPUT_MATERIAL" and node.is_active_output and node.inputs["Surface"].is_linked:
            return node.inputs["Surface"].links[0].from_node
    return None


def glass_of(material):
    """What `add_glass` takes of a Blender material; None where it is not glass."""
    node = _shader(material)
    if node is None:
        return None
    if node.type == "BSDF_PRINCIPLED":
        weight = node.inputs.get("Transmission Weight") or node.inputs.get("Transmission")
        if weight is None or weight.default_value < 0.5:
            return None
    elif node.type not in ("BSDF_GLASS", "BSDF_REFRACTION"):
        return None
    own = material.spectrasplat
    told = {"ior": float(node.inputs["IOR"].default_value), "abbe": own.abbe, "glass": own.glass.strip()}
    return {**told, "colour": [float(c) for c in own.colour], "distance": own.distance}


def area_light(item):
    """What `add_area_lights` takes of a lamp."""
    data = item.data
    scale = item.matrix_world.to_scale()
    is_disc = data.shape in ("DISK", "ELLIPSE")
    high = data.size_y if data.shape in ("RECTANGLE", "ELLIPSE") else data.size
    light = {"kind": "area", "flux_lm": data.energy * LUMENS_PER_WATT}
    if is_disc:
        light |= {"shape": "disc", "radius": 0.25 * (data.size * abs(scale[0]) + high * abs(scale[1]))}
    else:
        light |= {"shape": "rectangle", "size": [data.size * abs(scale[0]), high * abs(scale[1])]}
    world = item.matrix_world.normalized()
    matrix = gltf_matrix([list(row) for row in world])
    return {"name": item.name, "matrix": matrix, "colour": [float(c) for c in data.color], "light": light}


def export_scene(context, path):
    """Write what is visible as .glb, with dispersion; names of materials of glass. Raises RuntimeError."""
    visible = [o for o in context.scene.objects if o.visible_get()]
    materials = {slot.material for o in visible for slot in o.material_slots if slot.material}
    glasses = {m.name: glass for m in materials if (glass := glass_of(m)) is not None}
    bpy.ops.export_scene.gltf(
        filepath=str(path),
        export_format="GLB",
        use_visible=True,
        export_apply=True,
        export_yup=True,
        export_cameras=True,
        export_lights=True,
        export_import_convert_lighting_mode="SPEC",
        export_animations=False,
    )
    document, chunks = read_glb(path)
    add_glass(document, glasses)
    leave_out(document, {o.name for o in visible if MARK in o})
    add_area_lights(document, [area_light(o) for o in visible if o.type == "LIGHT" and o.data.type == "AREA"])
    write_glb(path, document, chunks)
    return sorted(glasses)


def reflectance_of(item):
    """Linear colour of an object's surface, and whether that is all there is to it."""
    node = _shader(item.active_material)
    names = {"BSDF_PRINCIPLED": "Base Color", "BSDF_DIFFUSE": "Color"}
    if node is None or node.type not in names:
        return (0.8, 0.8, 0.8), item.active_material is None
    socket = node.inputs[names[node.type]]
    return ((1.0, 1.0, 1.0), False) if socket.is_linked else (tuple(socket.default_value)[:3], True)


def put_back(context, receiver, picture, placement):
    """A plane before `receiver` that adds the baked light to what is below; replaces an earlier one. Raises
    RuntimeError for a curved receiver."""
    if placement["kind"] != "rectangle":
        raise RuntimeError(f"'{receiver.name}' is curved: only flat objects can take a caustic back")
    for old in [o for o in context.scene.objects if o.get(MARK) == receiver.name]:
        mesh = old.data
        bpy.data.objects.remove(old)
        bpy.data.meshes.remove(mesh)
    corner = placement["corners_world"]
    names = ("bottom_left", "bottom_right", "top_right", "top_left")
    places = [blender_place(corner[name]) for name in names]
    normal = blender_place(placement["normal_world"])
    centre = [sum(p[i] for p in places) / 4.0 for i in range(3)]
    others = [o.matrix_world.translation for o in context.scene.objects if _is_glass(o)]
    ahead = sum(sum(n * (p[i] - centre[i]) for i, n in enumerate(normal)) for p in others)
    lift = math.copysign(LIFT * max(placement["size_units"]), ahead or 1.0)
    mesh = bpy.data.meshes.new(f"{receiver.name} caustic")
    mesh.from_pydata([[p[i] + lift * normal[i] for i in range(3)] for p in places], [], [(0, 1, 2, 3)])
    layer = mesh.uv_layers.new(name="caustic")
    for loop, uv in zip(layer.data, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
        loop.uv = uv
    item = bpy.data.objects.new(f"{receiver.name} caustic", mesh)
    item[MARK] = receiver.name
    for ray in ("diffuse", "glossy", "transmission", "shadow"):
        setattr(item, f"visible_{ray}", ray in ("glossy", "transmission"))
    context.scene.collection.objects.link(item)
    mesh.materials.append(_caustic_material(receiver, picture))
    return item


def _is_glass(item):
    return any(slot.material is not None and glass_of(slot.material) is not None for slot in item.material_slots)


def _caustic_material(receiver, picture):
    """Emission of the picture times reflectance over π and lumens per watt, added to what lies behind."""
    name = f"{receiver.name} caustic"
    old = bpy.data.materials.get(name)
    if old is not None:
        bpy.data.materials.remove(old)
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    image = bpy.data.images.load(str(picture))
    image.name = name
    # As the EXR is: linear Rec.709, whatever the scene's view.
    image.colorspace_settings.name = "Linear Rec.709"
    image.pack()
    made = {
        kind: tree.nodes.new(f"ShaderNode{kind}")
        for kind in ("UVMap", "TexImage", "VectorMath", "Emission", "BsdfTransparent", "AddShader", "OutputMaterial")
    }
    for column, node in enumerate(made.values()):
        node.location = (220 * column, 0)
    made["UVMap"].uv_map = "caustic"
    made["TexImage"].image, made["TexImage"].extension = image, "CLIP"
    made["VectorMath"].operation = "MULTIPLY"
    colour, _ = reflectance_of(receiver)
    made["VectorMath"].inputs[1].default_value = colour
    made["Emission"].inputs["Strength"].default_value = 1.0 / (math.pi * LUMENS_PER_WATT)
    links = tree.links.new
    links(made["UVMap"].outputs["UV"], made["TexImage"].inputs["Vector"])
    links(made["TexImage"].outputs["Color"], made["VectorMath"].inputs[0])
    links(made["VectorMath"].outputs["Vector"], made["Emission"].inputs["Color"])
    links(made["Emission"].outputs["Emission"], made["AddShader"].inputs[0])
    links(made["BsdfTransparent"].outputs["BSDF"], made["AddShader"].inputs[1])
    links(made["AddShader"].outputs["Shader"], made["OutputMaterial"].inputs["Surface"])
    if hasattr(material, "surface_render_method"):
        material.surface_render_method = "BLENDED"
    return material


# ---- the interface ----------------------------------------------------------------------------


class SpectraSplatGlass(bpy.types.PropertyGroup):
    """What Blender's materials lack."""

    glass: bpy.props.StringProperty(
        name="Glass", description="A glass of the catalogue, such as N-SF11; empty: by IOR and Abbe number"
    )
    abbe: bpy.props.FloatProperty(
        name="Abbe number", description="V_d; small is dispersive, 20 to 90 for glass; 0: no dispersion", min=0.0
    )
    colour: bpy.props.FloatVectorProperty(
        name="Colour",
        description="What is left of white after the distance",
        subtype="COLOR",
        size=3,
        min=0.0,
        max=1.0,
        default=(1.0, 1.0, 1.0),
    )
    distance: bpy.props.FloatProperty(
        name="Distance", description="After which the glass has that colour; 0: it is clear", min=0.0, unit="LENGTH"
    )


class SpectraSplatScene(bpy.types.PropertyGroup):
    """How to bake."""

    receiver: bpy.props.PointerProperty(
        name="Receiver", description="The flat object that the caustic falls on", type=bpy.types.Object
    )
    texels: bpy.props.IntProperty(name="Texels", description="Side of the baked map", default=1024, min=16, max=8192)
    photons: bpy.props.IntProperty(name="Photons", description="To be traced", default=4_000_000, min=1000)
    seed: bpy.props.IntProperty(name="Seed", default=1, min=0)


class SpectraSplatPreferences(bpy.types.AddonPreferences):
    bl_idname = __name__

    program: bpy.props.StringProperty(
        name="Program", description="The spectrasplat command; empty: the one on the path", subtype="FILE_PATH"
    )

    def draw(self, context):
        self.layout.prop(self, "program")
        found = find_program(self.program)
        told = f"Found {found[0]}" if found else "Not found: pip install . in its checkout, or name its command here"
        self.layout.label(text=told, icon="CHECKMARK" if found else "ERROR")


def _wished_program(context):
    entry = context.preferences.addons.get(__name__)
    return bpy.path.abspath(entry.preferences.program) if entry is not None and entry.preferences.program else ""


class SPECTRASPLAT_OT_bake(bpy.types.Operator):
    """Trace the light through the glass, and put the caustic on the receiver"""

    bl_idname = "spectrasplat.bake"
    bl_label = "Bake Caustic"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 - as Blender wants it

    _job = _timer = _folder = None

    def _start(self, context):
        settings = context.scene.spectrasplat
        if settings.receiver is None:
            raise RuntimeError("Choose a receiver first: the flat object that the caustic falls on")
        if not settings.receiver.visible_get():
            raise RuntimeError(f"The receiver '{settings.receiver.name}' is hidden: show it first")
        program = find_program(_wished_program(context))
        if program is None:
            raise RuntimeError("The program is not found: pip install . in its checkout, or name it in the preferences")
        self._folder = tempfile.TemporaryDirectory(prefix="spectrasplat_")
        scene = Path(self._folder.name) / "scene.glb"
        if not export_scene(context, scene):
            raise RuntimeError("Nothing visible is glass: raise Transmission of a Principled BSDF, or use a Glass BSDF")
        for item in context.scene.objects:
            if item.visible_get() and item.type == "LIGHT" and item.data.type == "AREA" and min(item.data.color) < 0.99:
                self.report({"WARNING"}, f"The area lamp '{item.name}' is taken as white")
        output = Path(self._folder.name) / "caustic.exr"
        name, texels = settings.receiver.name, settings.texels
        self._job = Job(program, scene, name, output, texels, settings.photons, settings.seed)

    def _finish(self, context):
        receiver = context.scene.spectrasplat.receiver
        item = put_back(context, receiver, self._job.output, self._job.result())
        for note in self._job.notes:
            self.report({"INFO"}, note)
        if not reflectance_of(receiver)[1]:
            self.report({"WARNING"}, f"'{receiver.name}' has no plain colour: its caustic is as bright as on white")
        self.report({"INFO"}, f"The caustic is on '{item.name}'")

    def _clean(self, context):
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            context.window_manager.progress_end()
            context.workspace.status_text_set(None)
        if self._folder is not None:
            self._folder.cleanup()
        self._timer = self._folder = None

    def execute(self, context):
        """At once, as scripts and background jobs want it."""
        try:
            self._start(context)
            self._finish(context)
        except (RuntimeError, ValueError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        finally:
            self._clean(context)
        return {"FINISHED"}

    def invoke(self, context, event):
        """Beside the interface, which goes on; Esc stops it."""
        try:
            self._start(context)
        except (RuntimeError, ValueError, OSError) as error:
            self.report({"ERROR"}, str(error))
            self._clean(context)
            return {"CANCELLED"}
        manager = context.window_manager
        self._timer = manager.event_timer_add(0.2, window=context.window)
        manager.progress_begin(0, 100)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """Look now and then."""
        if event.type == "ESC":
            self._job.cancel()
            self._clean(context)
            self.report({"INFO"}, "The bake was stopped; nothing has changed")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._job.is_running:
            context.window_manager.progress_update(100 * self._job.share)
            context.workspace.status_text_set(f"SpectraSplat: {100 * self._job.share:.0f} % (Esc stops it)")
            return {"PASS_THROUGH"}
        try:
            self._finish(context)
        except (RuntimeError, ValueError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        finally:
            self._clean(context)
        return {"FINISHED"}


class SPECTRASPLAT_PT_scene(bpy.types.Panel):
    bl_label = "SpectraSplat"
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "scene"

    def draw(self, context):
        layout, settings = self.layout, context.scene.spectrasplat
        layout.use_property_split = True
        for name in ("receiver", "texels", "photons", "seed"):
            layout.prop(settings, name)
        layout.operator("spectrasplat.bake", icon="LIGHT_SPOT")


class SPECTRASPLAT_PT_material(bpy.types.Panel):
    bl_label = "SpectraSplat glass"
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "material"

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.active_material is not None

    def draw(self, context):
        layout, material = self.layout, context.object.active_material
        layout.use_property_split = True
        if glass_of(material) is None:
            layout.label(text="Not glass: raise Transmission, or use a Glass BSDF", icon="INFO")
            return
        for name in ("glass", "abbe", "colour", "distance"):
            layout.prop(material.spectrasplat, name)


CLASSES = (
    SpectraSplatGlass,
    SpectraSplatScene,
    SpectraSplatPreferences,
    SPECTRASPLAT_OT_bake,
    SPECTRASPLAT_PT_scene,
    SPECTRASPLAT_PT_material,
)


def register():
    """Blender calls it when the add-on is switched on."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Material.spectrasplat = bpy.props.PointerProperty(type=SpectraSplatGlass)
    bpy.types.Scene.spectrasplat = bpy.props.PointerProperty(type=SpectraSplatScene)


def unregister():
    """And off."""
    del bpy.types.Material.spectrasplat, bpy.types.Scene.spectrasplat
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)


if __name__ == "__main__":
    register()
