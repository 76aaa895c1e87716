"""Saves a scene as .glb or .gltf, by editing the original document where there is one.

What did not change is not touched, so textures, animations, unknown extensions, extras and
other nodes stay. What glTF has no word for is kept exactly under `extras.spectrasplat`.
"""

from __future__ import annotations

import copy
import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import UserError
from ..fields import write_fields
from ..geometry.mesh import Mesh
from ..lights import DirectionalLight, PointLight, SpotLight
from ..lights.light_file import light_values
from ..scene import Camera, Light, Material, Scene, SceneObject
from ..scene_camera import LENS
from ..vectors import frame_about, unit
from .gltf import LIGHTS, Origins, open_document, read_scene
from .gltf_document import Additions, GltfDocument, save_document
from .gltf_materials import EXTRAS, write_gltf_material, write_node_dabs, write_scene_extras
from .gltf_textures import TextureWriter, turned_over

_SUFFIXES = (".glb", ".gltf")


def save_gltf(scene: Scene, path: str | os.PathLike[str], original: str | os.PathLike[str] | None = None) -> None:
    """Write `scene` to `path` (.glb or .gltf, self-contained), atomically.

    `original`: the glTF file the scene was loaded from; parts are matched by their names, and
    only what differs is changed. Raises UserError for another suffix or an unwritable path.
    """
    path = Path(path)
    if path.suffix.lower() not in _SUFFIXES:
        raise UserError(f"{path}: a glTF scene must end in .glb or .gltf")
    if original is None:
        asset = {"version": "2.0", "generator": "SpectraSplat"}
        document = GltfDocument(path, {"asset": asset, "scene": 0, "scenes": [{"nodes": []}]})
        _Writer(document, path, None, Origins()).write(scene)
    else:
        document = open_document(original)
        before, origins = read_scene(document)
        _Writer(document, path, before, origins).write(scene)
    save_document(document, path)


class _Writer:
    def __init__(self, document: GltfDocument, path: Path, before: Scene | None, origins: Origins) -> None:
        self.document = document
        self.path = path
        self.json = document.json = copy.deepcopy(document.json)
        self.origins = origins
        self.old = {o.name: o for o in before.objects} if before else {}
        self.old_lights = {light.name: light for light in before.lights} if before else {}
        self.old_camera = before.camera if before else None
        self._new = Additions(self.json, buffer=-1)
        self._textures = TextureWriter(self._new, origins.textures)
        self._materials: dict[str, int] = {}
        self._meshes: dict[tuple[int, int | None], int] = {}
        self._geometry: dict[int, dict[str, Any]] = {}
        self._keep: list[Mesh] = []
        self._used: set[str] = set()

    def write(self, scene: Scene) -> None:
        """Bring the document in line with `scene`."""
        self._materials_in_place(scene)
        new = {o.name: o for o in scene.objects}
        names: dict[int, dict[int, str]] = {}
        for name, (node, number) in self.origins.objects.items():
            names.setdefault(node, {}).update(dict.fromkeys(self.origins.parts.get((node, number), [number]), name))
        for node in sorted(names):
            self._update_node(node, names[node], new)
        for item in scene.objects:
            if item.name not in self.origins.objects:
                entry = {"name": item.name, "mesh": self._mesh(item)}
                write_node_dabs(entry, {0: item.local_dispersion})
                self._add_node(entry, item.object_to_world)
        self._lights(scene)
        write_scene_extras(self.json, scene, self.path)
        if scene.camera != self.old_camera or self.origins.camera is None:
            self._camera(scene.camera)
        self._close_buffer()
        if self._used:
            self.json["extensionsUsed"] = sorted({*self.json.get("extensionsUsed", []), *self._used})

    # -- objects --------------------------------------------------------------------------

    def _update_node(self, node: int, names: dict[int, str], new: dict[str, SceneObject]) -> None:
        """Rewrite a node's mesh, transform or both where its objects changed; `names`: primitive -> object."""
        entry = self.json["nodes"][node]
        primitives = self.json["meshes"][entry["mesh"]]["primitives"]
        kept: dict[int, dict[str, Any]] = {}
        moved: dict[int, SceneObject] = {}
        for number, primitive in enumerate(primitives):
            name = names.get(number)
            if name is None:  # points, lines: not ours
                kept[number] = primitive
                continue
            item, old = new.get(name), self.old[name]
            if item is None:
                continue
            if number != self.origins.objects[name][1] and not _same_mesh(item.mesh, old.mesh):
                continue  # a part of one solid, whose first part now has all of it
            if not np.array_equal(item.object_to_world, old.object_to_world):
                moved[number] = item
            kept[number] = self._updated(primitive, item, old)
        if moved and self._moves_as_one(entry, kept, moved):
            self._set_world(node, next(iter(moved.values())).object_to_world)
        else:
            # The node also carries something that stays: the moved parts get nodes of their own.
            for number, item in moved.items():
                mesh = self._new.append("meshes", {"name": item.name, "primitives": [kept.pop(number)]})
                own = {"name": item.name, "mesh": mesh}
                write_node_dabs(own, {0: item.local_dispersion})
                self._add_node(own, item.object_to_world)
        write_node_dabs(
            entry, {at: new[names[number]].local_dispersion for at, number in enumerate(kept) if number in names}
        )
        remaining = list(kept.values())
        if not remaining:
            del entry["mesh"]
        elif len(remaining) != len(primitives) or any(a is not b for a, b in zip(remaining, primitives, strict=True)):
            clone = self.json["meshes"][entry["mesh"]] | {"primitives": remaining}
            entry["mesh"] = self._new.append("meshes", clone)

    def _updated(self, primitive: dict[str, Any], item: SceneObject, old: SceneObject) -> dict[str, Any]:
        """The primitive with the object's geometry and material; itself when neither changed."""
        changed = primitive
        if not _same_mesh(item.mesh, old.mesh):
            changed = {k: v for k, v in primitive.items() if k not in ("attributes", "indices", "mode", "targets")}
            changed |= self._primitive(item.mesh)
        material = self._material(item.material, primitive.get("material"), old.material, item.mesh)
        if material != primitive.get("material"):
            changed = changed | {"material": material}
        return changed

    @staticmethod
    def _moves_as_one(entry: dict[str, Any], kept: dict[int, Any], moved: dict[int, SceneObject]) -> bool:
        """Whether a node can simply take a new matrix: all of it moves alike, without children, camera, skin
        or light."""
        places = {item.object_to_world.tobytes() for item in moved.values()}
        carries = entry.get("children") or entry.keys() & {"camera", "skin"} or LIGHTS in entry.get("extensions", {})
        return len(places) == 1 and len(moved) == len(kept) and not carries

    def _mesh(self, item: SceneObject) -> int:
        """Number of a glTF mesh with the object's geometry and material; instances share it."""
        material = self._material(item.material, None, None, item.mesh)
        key = (id(item.mesh), material)
        if key not in self._meshes:
            primitive = self._primitive(item.mesh) | {"material": material}
            self._meshes[key] = self._new.append("meshes", {"name": item.mesh.name, "primitives": [primitive]})
        return self._meshes[key]

    def _primitive(self, mesh: Mesh) -> dict[str, Any]:
        """Attributes and indices of a mesh, written once."""
        if id(mesh) not in self._geometry:
            self._keep.append(mesh)  # so that no other mesh takes its id
            uv = None if mesh.uv is None else turned_over(mesh.uv)
            self._geometry[id(mesh)] = self._new.primitive(mesh.corners(), mesh.corner_normals, uv)
        return self._geometry[id(mesh)]

    # -- materials ------------------------------------------------------------------------

    def _materials_in_place(self, scene: Scene) -> None:
        """A material whose objects all changed in the same way is edited in place."""
        wanted: dict[int, dict[str, SceneObject]] = {}
        original: dict[int, Material] = {}
        for item in scene.objects:
            if item.name not in self.origins.objects:
                continue
            node, number = self.origins.objects[item.name]
            index = self.json["meshes"][self.json["nodes"][node]["mesh"]]["primitives"][number].get("material")
            if index is not None:
                wanted.setdefault(index, {})[_key(item.material)] = item
                original[index] = self.old[item.name].material
        for index, choices in wanted.items():
            key = _key(original[index])
            if len(choices) == 1 and key not in choices:
                key, item = next(iter(choices.items()))
                self._write_material(self.json["materials"][index], item)
            self._materials.setdefault(key, index)

    def _material(self, material: Material, index: int | None, before: Material | None, mesh: Mesh) -> int | None:
        """Number of a glTF material that shows `material`: the one it had, an equal one, or a new one."""
        key = _key(material)
        if before is not None and key == _key(before):
            return index
        if key not in self._materials:
            base = copy.deepcopy(self.json["materials"][index]) if index is not None else {}
            values = base or {"name": f"material {len(self.json.get('materials', []))}"}
            self._write_material(values, SceneObject("", mesh, material))
            self._materials[key] = self._new.append("materials", values)
        return self._materials[key]

    def _write_material(self, values: dict[str, Any], item: SceneObject) -> None:
        low, high = item.mesh.bounds()
        texture = item.material.texture
        number = None if texture is None else self._textures.number(texture)
        self._used |= write_gltf_material(values, item.material, float((high - low).min()) or 1e-3, number)

    # -- lights and camera ----------------------------------------------------------------

    def _lights(self, scene: Scene) -> None:
        left = {light.name for light in scene.lights}
        for name, index in self.origins.lights.items():
            if name not in left:
                del self.json["nodes"][index]["extensions"][LIGHTS]
        for light in scene.lights:
            node = self.origins.lights.get(light.name)
            old = self.old_lights.get(light.name)
            if node is None or old is None:
                self._add_light(light, {})
            elif light != old:
                link = self.json["nodes"][node]["extensions"][LIGHTS]
                entry = copy.deepcopy(self.json["extensions"][LIGHTS]["lights"][link["light"]])
                if _world_of_light(light).tobytes() == _world_of_light(old).tobytes():
                    link["light"] = self._light_entry(light, entry)
                else:
                    del self.json["nodes"][node]["extensions"][LIGHTS]
                    self._add_light(light, entry)

    def _add_light(self, light: Light, entry: dict[str, Any]) -> None:
        link = {LIGHTS: {"light": self._light_entry(light, entry)}}
        self._add_node({"name": light.name, "extensions": link}, _world_of_light(light))

    def _light_entry(self, light: Light, entry: dict[str, Any]) -> int:
        """Append a punctual light: what others can show, with the exact one in its extras."""
        from ..optics.colorimetry import xyz_to_rgb709

        xyz = light.spectral_power.xyz()
        rgb = np.maximum(xyz_to_rgb709(xyz), 0.0)
        brightest = float(rgb.max())
        # A beam is nearest to a sun; a glowing surface to a spot that shines as widely.
        kind = DirectionalLight.kind if light.is_parallel else PointLight.kind
        entry |= {"name": light.name, "type": kind, "intensity": brightest}
        entry["color"] = (rgb / brightest if brightest > 0.0 else np.ones(3)).tolist()
        inner, outer = light.cone
        if not light.is_parallel and not light.is_intensity:
            inner, outer = 0.0, 0.5 * math.pi
            entry["intensity"] = brightest * light.area
        if not light.is_parallel and outer < math.pi:
            # glTF wants inner < outer: a hard edge keeps its exact angles in the extras.
            cone = {"innerConeAngle": min(inner, outer - 1e-6), "outerConeAngle": outer}
            entry |= {"type": SpotLight.kind, "spot": cone}
        own = {k: v for k, v in light_values(light, self.path).items() if k not in ("position", "direction", "tangent")}
        extras = entry.get("extras")
        entry["extras"] = (extras if isinstance(extras, dict) else {}) | {EXTRAS: {"light": own}}
        self._used.add(LIGHTS)
        lights = self.json.setdefault("extensions", {}).setdefault(LIGHTS, {}).setdefault("lights", [])
        lights.append(entry)
        return len(lights) - 1

    def _camera(self, camera: Camera) -> None:
        offset = np.subtract(camera.target, camera.position)
        distance, aspect = float(np.linalg.norm(offset)), 16.0 / 9.0
        if camera.kind == "orthographic":
            half = 0.5 * camera.vertical_extent
            kind, seen = "orthographic", {"xmag": half * aspect, "ymag": half, "znear": 0.0, "zfar": 100.0 * distance}
        else:
            yfov = math.radians(camera.vertical_fov_deg)
            kind, seen = "perspective", {"yfov": yfov, "znear": 1e-3 * distance, "aspectRatio": aspect}
        lens: dict[str, Any] = {"type": kind, kind: seen}
        world = _look_world(camera.position, offset, camera.up)
        node = self.origins.camera
        entry: dict[str, Any] = {"name": "camera"}
        if node is not None:
            old = self.json["nodes"][node]
            lens = {**self.json["cameras"][old["camera"]], **lens}
            del old["camera"]
        entry["camera"] = self._new.append("cameras", lens)
        entry["extras"] = {EXTRAS: {"target_distance": distance} | write_fields(LENS, camera)}
        # First in the scene, so that it is the camera a reader finds.
        self._add_node(entry, world, first=True)

    # -- low level ------------------------------------------------------------------------

    def _add_node(self, entry: dict[str, Any], world: np.ndarray, first: bool = False) -> None:
        if not np.array_equal(world, np.eye(4)):
            entry["matrix"] = world.T.ravel().tolist()
        node = self._new.append("nodes", entry)
        scenes = self.json.setdefault("scenes", [])
        if not scenes:  # a file without scenes shows every root node
            children = {child for other in self.json["nodes"] for child in other.get("children", [])}
            scenes.append({"nodes": [i for i in range(len(self.json["nodes"])) if i not in children]})
            self.json["scene"] = 0
            return
        roots = scenes[self.json.get("scene", 0)].setdefault("nodes", [])
        roots.insert(0 if first else len(roots), node)

    def _set_world(self, node: int, world: np.ndarray) -> None:
        """Give a node without children a new place in the world."""
        entry = self.json["nodes"][node]
        parent = next((i for i, other in enumerate(self.json["nodes"]) if node in other.get("children", [])), None)
        above = np.eye(4) if parent is None else self.origins.world[parent]
        for key in ("translation", "rotation", "scale"):
            entry.pop(key, None)
        entry["matrix"] = np.linalg.solve(above, world).T.ravel().tolist()

    def _close_buffer(self) -> None:
        """Put new bytes behind the GLB's own chunk, or into a buffer of their own."""
        if not self._new.data:
            return
        buffers = self.json.setdefault("buffers", [])
        if not buffers:
            buffers.append({"byteLength": 0})
            self.document.binary = b""
        into = 0 if "uri" not in buffers[0] else len(buffers)
        if into == 0:
            old = (self.document.binary or b"")[: buffers[0]["byteLength"]]
            old += b"\0" * (-len(old) % 4)
        else:
            old = b""
            buffers.append({})
        data = old + bytes(self._new.data)
        buffers[into]["byteLength"] = len(data)
        self.document.set_buffer(into, data)
        for view in self.json["bufferViews"]:
            if view["buffer"] == -1:
                view["buffer"] = into
                view["byteOffset"] += len(old)


def _key(material: Material) -> str:
    return json.dumps(material.values(), sort_keys=True)


def _same_mesh(a: Mesh, b: Mesh) -> bool:
    def equal(x: np.ndarray | None, y: np.ndarray | None) -> bool:
        return (x is None and y is None) or (x is not None and y is not None and np.array_equal(x, y))

    arrays = ("vertices", "triangles", "corner_normals", "uv")
    return a is b or all(equal(getattr(a, n), getattr(b, n)) for n in arrays)


def _look_world(position: Any, forward: Any, up: Any) -> np.ndarray:
    """World matrix of a node that looks along its -z with +y towards `up`."""
    z = -unit(forward)
    right = np.cross(np.asarray(up, dtype=np.float64), z)
    world = np.eye(4)
    world[:3, :3] = frame_about(z, right if np.linalg.norm(right) >= 1e-9 else None).T
    world[:3, 3] = position
    return world


def _world_of_light(light: Light) -> np.ndarray:
    """World matrix of a light's node: it shines along -z, and a rectangle's width runs along x."""
    helper = np.eye(3)[int(np.argmin(np.abs(light.direction)))]
    if light.has_roll:
        helper = np.cross(-np.array(light.direction), light.axes()[:, 0])
    return _look_world((0.0, 0.0, 0.0) if not light.has_place else light.position, light.direction, helper)
