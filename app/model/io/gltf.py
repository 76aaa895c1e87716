"""Opens a .glb or .gltf file directly as a scene: geometry, transforms, camera, lights and glass.

Coordinates stay as they are (y is up, one unit is one metre), but for those of textures, which run down in glTF. What
the file lacks is fitted to its bounds and noted in `Scene.notes`, and so is everything that is ignored.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...base.errors import UserError
from ..fields import read_fields
from ..geometry.mesh import Mesh, make_mesh
from ..geometry.mesh_health import examine, forms_of, joined, repair, warnings_of
from ..lights import LIGHT_KINDS, DirectionalLight, PointLight, SpotLight
from ..lights.light import made
from ..lights.light_file import read_light
from ..naming import Names, Unshown
from ..placement import Surroundings, rotation_about
from ..scene import Camera, Light, Material, Scene, SceneObject
from ..scene_camera import LENS
from ..scene_defaults import (
    default_table,
    environment_of,
    framing_camera,
    parts_of,
    studio_environment,
    studio_lights,
    surroundings_of,
)
from ..staging import AS_FOUND, Y_UP_TO_Z_UP, Staging, opaque_note, with_glass
from ..vectors import Vec3, frozen, unit, vec3
from .gltf_document import COMPRESSION, DRACO, GltfDocument, draco_mesh, open_document
from .gltf_materials import (
    EXTRAS,
    UNDERSTOOD_MATERIALS,
    formed,
    own_extras,
    read_gltf_material,
    read_node_dabs,
    read_scene_extras,
)
from .gltf_textures import GltfTextures, turned_over
from .mesh_raw import as_float64
from .scene_table import MAX_MAGNITUDE, SceneTable

LIGHTS = "KHR_lights_punctual"
UNDERSTOOD = UNDERSTOOD_MATERIALS | COMPRESSION | {LIGHTS, "KHR_mesh_quantization"}
_CAN_BE_LEFT_OUT = ("KHR_texture_", "KHR_materials_", "EXT_texture_", "KHR_xmp", "MSFT_", "EXT_lights_image_based")
CAMERA_ADDED = "No camera in the file: one that sees the objects was added."
_DEFAULT_DISTANCE = 1.0
_READ = ("NORMAL", "TEXCOORD_0")
_PUNCTUAL = tuple(cls.kind for cls in (PointLight, SpotLight, DirectionalLight))


@dataclass
class Origins:
    """Where in the document each part of the scene came from; names are unique."""

    world: dict[int, np.ndarray] = field(default_factory=dict)
    """Node -> world matrix."""
    objects: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Object -> (node, primitive of the node's mesh)."""
    parts: dict[tuple[int, int], list[int]] = field(default_factory=dict)
    """(Node, first primitive) -> all primitives of one solid, which are one object."""
    lights: dict[str, int] = field(default_factory=dict)
    """Light -> node."""
    camera: int | None = None
    textures: dict[str, int] = field(default_factory=dict)
    """Content of a texture (`gltf_textures.texture_key`) -> its number."""


def load_gltf(path: str | os.PathLike[str], staging: Staging = AS_FOUND) -> Scene:
    """The scene in a glTF file, opened as `staging` says. Raises UserError for files that are truncated, contradictory
    or need extensions this program lacks, and for objects and glasses that there are not."""
    return read_scene(open_document(path), staging)[0]


def read_scene(document: GltfDocument, staging: Staging = AS_FOUND) -> tuple[Scene, Origins]:
    """The scene and where its parts lie in the document."""
    try:
        return _Reader(document, staging).read()
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError) as error:
        # The document breaks glTF's schema somewhere we had no sentence of its own for.
        reason = f"{type(error).__name__}: {error}".partition("\n")[0][:80]
        raise document.fail(f"the file does not follow glTF 2.0 ({reason}); export it again") from error


class _Reader:
    def __init__(self, document: GltfDocument, staging: Staging) -> None:
        self.document = document
        self.staging = staging
        self._to_z_up = np.eye(4) if staging.up == "z" else Y_UP_TO_Z_UP
        self.notes: list[str] = []
        self._unshown = Unshown()
        self.origins = Origins()
        self.objects: list[SceneObject] = []
        self._material_names: list[str] = []
        self.lights: list[tuple[int, dict[str, Any], np.ndarray]] = []
        self.camera: Camera | None = None
        self._meshes: dict[str, Mesh | None] = {}
        self._materials: dict[int | None, Material] = {}
        self._forms: dict[int, tuple[dict[int, str], Mesh | None]] = {}
        self._textures = GltfTextures(document, self.notes)
        self.origins.textures = self._textures.numbers
        self._names = Names()

    def read(self) -> tuple[Scene, Origins]:
        self._check_extensions()
        for index, world in self._nodes():
            self._node(index, world)
        self.notes += self._unshown.notes()
        if not self.objects:
            raise self.document.fail("the file holds no triangles; check that the scene was exported")
        if self.document.items("animations") or self.document.items("skins"):
            self.notes.append("Animations and skins are not played (they are kept when saving).")
        self.objects = with_glass(self.objects, self.staging, self.document.path.name, self._material_names)
        is_whole = self.camera is not None and bool(self.lights)
        if not is_whole and (note := opaque_note(self.objects)) is not None:
            self.notes.append(note)
        background, environment, render = read_scene_extras(self.document, self.notes)
        upright = [replace(o, object_to_world=self._to_z_up @ o.object_to_world) for o in self.objects]
        around = environment_of(upright)
        lights = self._read_lights(Surroundings(self._to_z_up[:3, :3].T @ around.centre, around.radius))
        # An environment shows glass and mirrors without a light and without anything it falls on.
        receives = any(o.material.receives for o in self.objects)
        is_bare = self.camera is None and not self.lights and environment is None and not any(background)
        if (environment is None and not receives) or (is_bare and len(parts_of(upright)) == len(upright)):
            table = default_table(upright)
            matrix = self._to_z_up.T @ table.object_to_world
            self.objects.append(replace(table, name=self._names.unique("table"), object_to_world=matrix))
            self.notes.append("Nothing in the file to stand on: a grey table was put below the objects.")
            receives = True
        if not lights and (environment is None or receives):
            lights = tuple(self._as_in_file(light) for light in studio_lights(surroundings_of(parts_of(upright))))
            self.notes.append(
                "No light in the file: a lamp from behind on the left and weak light from above were added."
            )
        if is_bare:
            environment = studio_environment(self._turned((0.0, 0.0, 1.0)))
            self.notes.append("A quiet studio was put round it; --environment sky, or a panorama, shows another.")
        camera = self.camera
        if camera is None:
            fitted = framing_camera(upright)
            camera = replace(
                fitted,
                position=self._turned(fitted.position),
                target=self._turned(fitted.target),
                up=self._turned(fitted.up),
            )
            self.notes.append(CAMERA_ADDED)
        name = self.document.path.stem
        notes = tuple(dict.fromkeys(self.notes))
        return Scene(name, camera, lights, tuple(self.objects), background, environment, render, notes), self.origins

    # -- structure ------------------------------------------------------------------------

    def _check_extensions(self) -> None:
        required = self.document.json.get("extensionsRequired", [])
        for name in required:
            if name not in UNDERSTOOD and not str(name).startswith(_CAN_BE_LEFT_OUT):
                raise self.document.fail(f"needs the extension {name}, which is not supported; export it without")
        unknown = sorted(set(map(str, self.document.json.get("extensionsUsed", []))) - UNDERSTOOD)
        if unknown:
            self.notes.append(f"Not understood and left aside (kept when saving): {', '.join(unknown)}.")

    def _nodes(self) -> Iterator[tuple[int, np.ndarray]]:
        """Nodes of the default scene with their world matrices, parents first."""
        nodes = self.document.items("nodes")
        if self.document.items("scenes"):
            roots = self.document.item("scenes", self.document.json.get("scene", 0)).get("nodes", [])
        else:
            children = {child for node in nodes for child in node.get("children", [])}
            roots = [index for index in range(len(nodes)) if index not in children]
        stack = [(root, np.eye(4)) for root in reversed(roots)]
        seen: set[int] = set()
        while stack:
            index, parent = stack.pop()
            node = self.document.item("nodes", index)
            if index in seen:
                raise self.document.fail(
                    f"nodes[{index}] has two parents or is its own ancestor; export the file again"
                )
            seen.add(index)
            world = parent @ self._local(node, index)
            if np.abs(world).max() > MAX_MAGNITUDE:
                raise self.document.fail(
                    f"nodes[{index}] has a transform beyond {MAX_MAGNITUDE:g}; export the file in larger units"
                )
            yield index, world
            stack += [(child, world) for child in reversed(node.get("children", []))]

    def _local(self, node: dict[str, Any], index: int) -> np.ndarray:
        if "matrix" in node:
            matrix = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T  # stored column by column
        else:
            matrix = np.eye(4)
            with np.errstate(invalid="ignore", over="ignore"):  # refused below
                matrix[:3, :3] = _rotation(node.get("rotation", (0, 0, 0, 1))) * np.array(
                    node.get("scale", (1, 1, 1)), float
                )
            matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
        if not (np.abs(matrix) <= MAX_MAGNITUDE).all():
            raise self.document.fail(
                f"nodes[{index}] has a transform that is not finite, or beyond {MAX_MAGNITUDE:g}; export the file again"
            )
        return matrix

    def _node(self, index: int, world: np.ndarray) -> None:
        node = self.document.item("nodes", index)
        self.origins.world[index] = world
        if abs(np.linalg.det(world[:3, :3])) <= 1e-30 * np.linalg.norm(world[:3, :3]) ** 3:
            if node.keys() & {"mesh", "camera"} or LIGHTS in node.get("extensions", {}):
                label = node.get("name") or f"node {index}"
                self.notes.append(f"node '{label}' is flattened by a scale of 0 and is left out.")
            return
        if "mesh" in node:
            self._place(index, node, world)
        if "camera" in node and self.camera is None:
            self.camera = self._camera(node, world)
            self.origins.camera = index
        light = node.get("extensions", {}).get(LIGHTS, {}).get("light")
        if light is not None:
            entries = self.document.json.get("extensions", {}).get(LIGHTS, {}).get("lights", [])
            if not isinstance(light, int) or not 0 <= light < len(entries):
                raise self.document.fail(
                    f"nodes[{index}] refers to light {light} of {len(entries)}; export the file again"
                )
            self.lights.append((index, entries[light], world))

    # -- geometry -------------------------------------------------------------------------

    def _place(self, index: int, node: dict[str, Any], world: np.ndarray) -> None:
        entry = self.document.item("meshes", node["mesh"])
        label = str(node.get("name") or entry.get("name") or f"node {index}")
        for number, primitive in enumerate(entry["primitives"]):
            mesh = self._mesh(node["mesh"], number, primitive, entry)
            if mesh is None:
                continue
            material = self._wearable(self._material(primitive.get("material")), mesh, label)
            if material.is_solid:
                forms, of_parts = self._form(node["mesh"], entry)
                if forms[number] == "part" and of_parts is not None:
                    mesh = of_parts
                    parts = [i for i, form in forms.items() if form == "part"]
                    if number != parts[0]:
                        continue
                    self.origins.parts[(index, number)] = parts
                    if len({entry["primitives"][i]["material"] for i in parts}) > 1:
                        self._unshown.add("Parts that make one solid together take the glass of the first", label)
                self.notes += [] if forms[number] == "sheet" else warnings_of(mesh)
                material = formed(
                    self.document, primitive["material"], material, forms[number] == "sheet", self._unshown
                )
            name = self._names.unique(label)
            dabs = read_node_dabs(self.document, index, number, material)
            self.objects.append(SceneObject(name, mesh, material, frozen(world.copy()), dabs))
            self._material_names.append(self._material_name(primitive.get("material")))
            self.origins.objects[name] = (index, number)

    def _material(self, index: int | None) -> Material:
        if index not in self._materials:
            self._materials[index] = read_gltf_material(self.document, index, self._textures, self._unshown)
        return self._materials[index]

    def _material_name(self, index: int | None) -> str:
        return "" if index is None else str(self.document.item("materials", index).get("name", ""))

    def _form(self, number: int, entry: dict[str, Any]) -> tuple[dict[int, str], Mesh | None]:
        """Form of each part of glass of the document's mesh `number`, and the parts of one solid as one mesh."""
        if number not in self._forms:
            parts = {
                i: mesh
                for i, each in enumerate(entry["primitives"])
                if self._material(each.get("material")).is_solid
                and (mesh := self._mesh(number, i, each, entry)) is not None
            }
            forms = dict(zip(parts, forms_of(list(parts.values())), strict=True))
            of_one = [mesh for i, mesh in parts.items() if forms[i] == "part"]
            self._forms[number] = forms, joined(of_one) if of_one else None
        return self._forms[number]

    def _wearable(self, material: Material, mesh: Mesh, label: str) -> Material:
        """`material`, without its texture where the mesh cannot say where it goes."""
        if material.texture is None or mesh.uv is not None:
            return material
        self.notes.append(
            f"node '{label}' has no texture coordinates; its texture is not shown (it is kept when saving)."
        )
        return material.changed(texture=None)

    def _mesh(self, index: int, number: int, primitive: dict[str, Any], entry: dict[str, Any]) -> Mesh | None:
        """One primitive as a repaired mesh; None when it has no triangles.

        Everything that shows the same accessors shares one mesh, whatever its material.
        """
        key = json.dumps([primitive.get(k) for k in ("attributes", "indices", "mode", "extensions")], sort_keys=True)
        if key not in self._meshes:
            self._meshes[key] = self._read_primitive(index, number, primitive, entry)
        return self._meshes[key]

    def _read_primitive(self, index: int, number: int, primitive: dict[str, Any], entry: dict[str, Any]) -> Mesh | None:
        where = f"{self.document.path.name}: meshes[{index}].primitives[{number}]"
        mode = primitive.get("mode", 4)
        attributes = primitive["attributes"]
        if mode in (0, 1, 2, 3) or "POSITION" not in attributes:
            self.notes.append(f"meshes[{index}].primitives[{number}] holds points or lines and is left out.")
            return None
        if primitive.get("targets"):
            self.notes.append(f"meshes[{index}].primitives[{number}]: its morph targets are not applied.")
        how, indices = primitive.get("extensions", {}).get(DRACO), primitive.get("indices")
        if how is not None and "bufferView" not in self.document.item("accessors", attributes["POSITION"]):
            arrays, order = draco_mesh(how, self.document.view_bytes(how["bufferView"]), where)
            positions, mode = arrays["POSITION"], 4
        else:
            positions = as_float64(self.document.accessor(attributes["POSITION"]))
            arrays = {n: self._attribute(attributes, n, len(positions)) for n in _READ if n in attributes}
            order = np.arange(len(positions)) if indices is None else self.document.accessor(indices).astype(np.int64)
        if positions.ndim != 2 or positions.shape[1] != 3 or order.ndim != 1:
            raise UserError(f"{where}: POSITION must be triples and indices single numbers; export the file again")
        triangles = _triangles(order, mode, where)
        if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(positions):
            make_mesh("", positions, triangles, source=where)  # raises, naming the face
        normals, uv = (arrays.get(name) for name in _READ)
        raw = make_mesh(
            str(entry.get("name") or f"mesh {index}"),
            positions,
            triangles,
            None if normals is None else normals[triangles],
            None if uv is None else turned_over(uv)[triangles],
            source=where,
        )
        mesh, notes = repair(raw, examine(raw), solid=False)
        self.notes.extend(notes)
        mesh = self.staging.settled(mesh, self.notes, self.document.path.name)
        return replace(mesh, source=str(self.document.path))

    def _attribute(self, attributes: dict[str, Any], name: str, count: int) -> np.ndarray:
        values = as_float64(self.document.accessor(attributes[name]))
        if len(values) != count:
            raise self.document.fail(f"{name} has {len(values)} elements for {count} positions; export the file again")
        return values

    # -- camera and lights ----------------------------------------------------------------

    def _camera(self, node: dict[str, Any], world: np.ndarray) -> Camera:
        entry = self.document.item("cameras", node["camera"])
        self._check_turn(world, f"camera '{node.get('name', entry.get('name', 'camera'))}'")
        own = own_extras(node)
        distance = float(own.get("target_distance", _DEFAULT_DISTANCE))
        position, forward, up = world[:3, 3], -unit(world[:3, 2]), unit(world[:3, 1])
        given = {field.attribute: own[field.attribute] for field in LENS if field.attribute in own}
        lens = read_fields(LENS, SceneTable(given, self.document.path, f"camera.extras.{EXTRAS}"))
        camera = Camera(vec3(position), vec3(position + distance * forward), vec3(up), **lens)
        if entry.get("type") == "orthographic":
            extent = 2.0 * float(entry["orthographic"]["ymag"])
            if not extent > 0.0:
                raise self.document.fail("an orthographic camera has no height (ymag); export the file again")
            return replace(camera, kind="orthographic", vertical_extent=extent)
        fov = math.degrees(float(entry["perspective"]["yfov"]))
        if not 0.0 < fov < 180.0:
            raise self.document.fail(f"a camera's yfov is {fov:g} degrees; it must lie between 0 and 180")
        return replace(camera, vertical_fov_deg=fov)

    def _check_turn(self, world: np.ndarray, label: str) -> None:
        """Refuse a place whose axes have no direction."""
        lengths = np.linalg.norm(world[:3, :3], axis=0)
        if not (np.isfinite(world).all() and (lengths > 1e-30).all()):
            raise self.document.fail(
                f"{label} stands under a scale of zero and looks nowhere; give its nodes a scale above 0"
            )

    def _read_lights(self, around: Surroundings) -> tuple[Light, ...]:
        lights = []
        for index, entry, world in self.lights:
            label = str(entry.get("name") or self.document.item("nodes", index).get("name") or f"light {index}")
            light = self._light(entry, label, world, around)
            if light is None:
                self.notes.append(f"light '{label}' gives no light and is left out.")
                continue
            light = replace(light, name=self._names.unique(light.name))
            self.origins.lights[light.name] = index
            lights.append(light)
        return tuple(lights)

    def _turned(self, vector: Vec3) -> Vec3:
        """A z-up vector in the file's own axes."""
        turned = self._to_z_up[:3, :3].T @ np.array(vector)
        return vec3(turned + 0.0)  # no −0

    def _as_in_file(self, light: Light) -> Light:
        """A light of a z-up world in the file's own axes."""
        placed: dict[str, Any] = {"name": self._names.unique(light.name), "direction": self._turned(light.direction)}
        return light.changed(**placed | ({"position": self._turned(light.position)} if light.has_place else {}))

    def _light(self, entry: dict[str, Any], label: str, world: np.ndarray, around: Surroundings) -> Light | None:
        from ..optics.colorimetry import illuminant_table, rgb709_to_xyz_matrix, rgb_basis
        from ..optics.spectrum import Spectrum

        self._check_turn(world, f"light '{label}'")
        position, direction = vec3(world[:3, 3]), vec3(-unit(world[:3, 2]))
        own = own_extras(entry).get("light")
        if own is not None:
            cls = LIGHT_KINDS.get(own.get("kind", "point"), Light)
            placed: dict[str, Any] = {"position": list(position)} if cls.has_place else {}
            placed |= {"direction": list(direction)} if cls.has_direction else {}
            has_tangent = "size" in own or cls.has_roll is True
            placed |= {"tangent": list(vec3(unit(world[:3, 0])))} if has_tangent else {}
            table = SceneTable(own | placed, self.document.path, f"{LIGHTS}.extras.{EXTRAS}.light")
            return read_light(table, 0, around)
        kind = entry.get("type")
        if kind not in _PUNCTUAL:
            raise self.document.fail(f"light '{label}' has the unknown type '{kind}'; use point, spot or directional")
        rgb = np.array(entry.get("color", (1.0, 1.0, 1.0)), dtype=np.float64)
        intensity = float(entry.get("intensity", 1.0))
        if rgb.shape != (3,) or not np.isfinite(rgb).all() or (rgb < 0.0).any() or not 0.0 <= intensity < math.inf:
            raise self.document.fail(f"light '{label}' needs three colours and an intensity of 0 or more")
        luminance = float(rgb709_to_xyz_matrix()[1] @ rgb) * intensity
        if luminance == 0.0:
            return None
        tinted = Spectrum(illuminant_table()["D65"] * (rgb_basis() @ rgb)).scaled_to_luminous(luminance)
        placed = {"name": label, "spectral_power": tinted, "position": position, "direction": direction}
        if kind == SpotLight.kind:
            cone = entry.get("spot", {})
            inner, outer = float(cone.get("innerConeAngle", 0.0)), float(cone.get("outerConeAngle", math.pi / 4.0))
            if not (0.0 <= inner <= outer and 0.0 < outer <= 0.5 * math.pi + 1e-6):
                raise self.document.fail(f"light '{label}' needs cone angles with 0 <= inner <= outer <= 90 degrees")
            placed |= {"inner_half_angle_deg": math.degrees(inner)}
            placed |= {"outer_half_angle_deg": min(90.0, math.degrees(outer))}
        return made(LIGHT_KINDS[kind], placed)


def _triangles(order: np.ndarray, mode: int, where: str) -> np.ndarray:
    """Vertex numbers (T, 3) of a triangle list (4), strip (5) or fan (6)."""
    if mode == 4:
        if len(order) % 3:
            raise UserError(f"{where}: {len(order)} indices are no whole number of triangles; export the file again")
        return order.reshape(-1, 3)
    if mode == 5:
        strip = np.stack([order[:-2], order[1:-1], order[2:]], axis=1)
        strip[1::2] = strip[1::2, [1, 0, 2]]
        return strip
    if mode == 6:
        return np.stack([order[1:-1], order[2:], np.full(max(len(order) - 2, 0), order[0])], axis=1)
    raise UserError(f"{where}: unknown mode {mode}; export the file again")


def _rotation(quaternion: Any) -> np.ndarray:
    """Rotation matrix (3, 3) of a quaternion x, y, z, w."""
    *vector, real = np.array(quaternion, dtype=np.float64)
    sine = math.hypot(*vector)
    if not 0.0 < math.hypot(sine, real) < math.inf:
        raise ValueError("a rotation quaternion is zero or not finite")
    return rotation_about(vec3(np.array(vector) / max(sine, 1e-300)), 2.0 * math.atan2(sine, real))
