"""The scene as the GPU sees it: what is in it (`SceneGeometry`), objects' records, spectra.

Everything is moved and scaled into GPU space first (`GpuSpace`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import moderngl
import numpy as np

from ..base.errors import UserError
from ..features.features import Features
from ..model.contacts import overlapping_solids
from ..model.film_stacks import film_tables, film_thickness, scene_media
from ..model.materials.grating import WAVELENGTH
from ..model.optics import rough_surfaces
from ..model.optics.colorimetry import VISIBLE_NM, mirror_reflectance
from ..model.optics.glass import Dispersion
from ..model.optics.spectral_tables import (
    CumulativeSpectrum,
    SpectralAxis,
    cumulative,
    wavelength_cdf,
)
from ..model.scene import Grating, Light, Polariser, Scene, SceneObject
from ..model.scene_checks import contains
from ..model.tint_bands import tint_curves
from ..model.tint_levels import TintLevels, tint_levels
from . import bindings, shader
from .gpu_space import GpuSpace
from .records import NONE
from .scene_geometry import SceneGeometry
from .scene_motion import MovingTriangles, ObjectPlaces, WorldMeshes
from .scene_records import CRYSTAL, OBJECT, PIECE, WEDGE, grating_tables, grating_texels
from .scene_texels import SceneTexels, spectra_texture
from .spectral_groups import SAMPLES, Groups, index_slope, samples_of
from .texture_store import textured_objects

UNBOUNDED = 1e30
"""Size of an object whose facets are all flat, for footprints on it: they grow no faster than the way is long."""


@dataclass(frozen=True)
class SpectraLayout:
    """Row offsets in the one float buffer of spectral tables (each row SAMPLES long)."""

    index_row: int
    slope_row: int
    variable_row: int
    weight_row: int
    power_row: int
    """First of one row per light and level of its tint: cumulative radiant power over x, W per unit weight."""
    brightness_row: int
    """Likewise, where wavelengths are drawn at random: share of the draws below x (`wavelength_cdf`)."""
    rough_row: int
    """`rough_surfaces.glass_tables`."""
    film_row: int
    """`film_stacks.film_tables`."""
    grating_row: int
    """`grating_tables`."""
    rows: int


_CRYSTAL_TEXELS = CRYSTAL.stride // 16
_LOBES = 4
"""MOST_LOBES of shaders/path/crystal.glsl."""


class SceneBuffers:
    """Owns the scene's textures and storage buffers; `bind()` before every dispatch that reads them."""

    def __init__(
        self,
        ctx: moderngl.Context,
        scene: Scene,
        features: Features,
        axis: SpectralAxis,
    ) -> None:
        self.ctx = ctx
        self.scene = scene
        self.features = features
        self.axis = axis
        self.space = GpuSpace.of(scene)
        self.groups = Groups.of(scene, features)
        self.receivers = [i for i, o in enumerate(scene.objects) if o.material.receives for _ in range(2)]
        """Object of each side of a receiver: the front, where the mesh's normal points, then the back."""
        self.traced_glasses = [o.material.dispersions for o in scene.objects]
        """Each object's glasses as the records number them, whatever `scene` is replaced by to be shown."""
        self.world_meshes = WorldMeshes(scene)
        self.places = ObjectPlaces(ctx, scene, self.space)
        self._motion: MovingTriangles | None = None
        self.geometry: SceneGeometry
        self.geometry, self._sections = SceneGeometry.of(scene, self.world_meshes.packed, self.space, features)
        """As it was packed, wherever objects have moved."""
        self.triangle_count = len(self._sections.get("TRIANGLES", ()))
        """Those that rays are tested with one by one: none of half-space solids."""
        self._buffers: dict[int, moderngl.Buffer] = {}
        self.defines: dict[str, int | str] = {**bindings.SCENE_DEFINES, "SPECTRAL_SAMPLES": SAMPLES}
        self._pack_geometry()
        self._pack_objects()
        self._pack_profiles()
        self.texels = SceneTexels(ctx, self._sections)
        self._sections.clear()
        self.defines |= self.texels.defines

    def primitive_of(self, index: np.ndarray, triangle: np.ndarray) -> np.ndarray:
        """Shaders' numbers of triangles, given by object `index` and place in its own order: uint32 (N,)."""
        return self.primitives[self.first_triangle[index] + triangle]

    def media_of(self, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Medium stack, and the solid outside it or NONE, uint32 (N,) each, from a bit per object, uint64 (N,)."""
        mask, other = np.zeros(len(inside), np.uint32), np.full(len(inside), NONE, np.uint32)
        bits = {index: bit for bit, index in enumerate(self.stack_objects)}
        for index in range(min(len(self.scene.objects), 64)):
            is_inside = (inside >> np.uint64(index)) & np.uint64(1) != 0
            if index in bits:
                mask[is_inside] |= np.uint32(1 << bits[index])
            else:
                other[is_inside] = index
        return mask, other

    def media_at(self, point: np.ndarray) -> tuple[int, int]:
        """Medium stack, and the solid outside it or NONE, of a place in the world."""
        mask, other = 0, NONE
        for index, item in enumerate(self.scene.objects):
            if item.material.is_solid and contains(item, point):
                if index in self.stack_objects:
                    mask |= 1 << self.stack_objects.index(index)
                else:
                    other = index
        return mask, other

    def bind(self) -> None:
        """Bind every scene texture and buffer to its place."""
        self.texels.bind()
        self.texels.bind_spectra(self._spectra)
        self.places.bind()
        for binding, buffer in self._buffers.items():
            if self._in_storage or binding == bindings.PROFILES:
                buffer.bind_to_storage_buffer(binding)
            else:
                buffer.bind_to_uniform_block(binding)

    def release(self) -> None:
        """Free buffers and textures."""
        self.texels.release()
        self._spectra.release()
        shader.release(*self._buffers.values(), self.places.texture, self._motion)
        self._buffers.clear()

    @property
    def bytes(self) -> int:
        """GPU memory held."""
        pixels = (self.texels.texture, 16), (self._spectra, 8)
        moving = 0 if self._motion is None else self._motion.bytes
        return moving + sum(b.size for b in self._buffers.values()) + sum(t.width * t.height * s for t, s in pixels)

    def _pack_profiles(self) -> None:
        """Intensity tables of lights that have one, each once."""
        tables = list(dict.fromkeys(light.profile for light in self.scene.lights if light.profile is not None))
        packed = [table.packed() for table in tables]
        starts = np.cumsum([0] + [len(table) for table in packed])
        self._profile_start = dict(zip(tables, starts.tolist(), strict=False))
        if packed:
            self._buffers[bindings.PROFILES] = self.ctx.buffer(np.concatenate(packed).astype("f4"))

    @cached_property
    def tints(self) -> np.ndarray:
        """`tint_curves` of the scene: every pass needs them, and a mean chord takes all of a mesh's triangles."""
        levels = self.tint_levels
        return tint_curves(self.scene, None if levels is None else levels.coefficient)

    @cached_property
    def tint_levels(self) -> TintLevels | None:
        """The glass whose way photons tell, where they do."""
        return tint_levels(self.scene) if self.features.tint_levels else None

    @cached_property
    def primitives(self) -> np.ndarray:
        """uint32 (T,): what a ray that left each triangle has as `last_primitive`; T counts all objects' triangles."""
        return self.geometry.primitives(self.world_meshes.packed, self.space)

    @property
    def corner_turn(self) -> np.ndarray:
        """int (T, 3): which of its own corners each triangle's first, second and third are on the GPU; T counts all
        objects' triangles."""
        return self.geometry.triangles.corner_turn

    @property
    def first_triangle(self) -> np.ndarray:
        """int (objects + 1,): each object's first one among the triangles of all."""
        return self.geometry.first_triangle

    def profile_start(self, light: Light) -> int:
        """Where the light's intensity table begins among the profiles; 0 without one."""
        return 0 if light.profile is None else self._profile_start[light.profile]

    def move(self, scene: Scene) -> bool:
        """Take over `scene`, in which objects have moved and nothing else differs that buffers hold, in the GPU space
        that there is. False, and nothing done, where one was mirrored. Raises `UserError` where one was flattened."""
        pairs = enumerate(zip(self.scene.objects, scene.objects, strict=True))
        moved = [(i, b) for i, (a, b) in pairs if a.object_to_world is not b.object_to_world]
        turns = [
            np.linalg.det(self.scene.objects[i].object_to_world) * b.mesh.determinant(b.object_to_world)
            for i, b in moved
        ]
        if any(turn < 0.0 for turn in turns):
            return False
        self.scene = scene
        self.__dict__.pop("tints", None)
        for index, item in moved:
            self.world_meshes.move(index, item)
            matrix = self.places.move(index, item.object_to_world)
            if (planes := self.geometry.solids.moved(index, matrix)) is not None:
                self._buffers[bindings.PLANES].write(planes[1], offset=16 * planes[0])
            if (pieces := self.geometry.curved.moved(index, matrix)) is not None:
                self.texels.write("PIECES", PIECE.stride // 16 * pieces[0], pieces[1])
            self._move_record(index, item)
        if self.triangle_count and moved:
            if self._motion is None:
                tree = self.geometry.triangles.tree
                self._motion = MovingTriangles(self.ctx, self.texels, tree, self.triangle_count)
            self.places.bind()
            self._motion.run()
        return True

    def _move_record(self, index: int, item: SceneObject) -> None:
        record = self._records[index : index + 1].copy()
        sizes = record["colour"][:, 2]
        sized = item.material.is_mirror or item.material.dispersion is not None
        if sized and sizes[0] < UNBOUNDED:
            sides = np.abs(self.places.matrices[index, :, :3]) @ self.world_meshes.half_size(index)
            sizes[:] = self.space.scale * np.linalg.norm(sides)
            self.texels.write("OBJECTS", OBJECT.stride // 16 * index, record)
        if isinstance(item.material, Grating):
            self.texels.write(
                "GRATINGS", int(record["weight_row"][0]), grating_texels(item, self.grating_rows.get(index))
            )
        if record["colour"][0, 0] < 0.0:
            self.texels.write("WEDGES", int(-1.0 - record["colour"][0, 0]), self._wedge(item))
        if item.material.polarises:
            number = int(record["receiver"][0]) // _CRYSTAL_TEXELS
            self._crystals["axis"][number] = item.material.axis_in_world(item.object_to_world)
            self.texels.write("CRYSTALS", _CRYSTAL_TEXELS * number, self._crystals[number : number + 1])

    def _pack_geometry(self) -> None:
        solids, tree = self.geometry.solids, self.geometry.triangles.tree
        self.defines["PLANE_COUNT"] = len(solids.planes)
        largest = max(solids.planes.nbytes, solids.records.nbytes)
        self._in_storage = largest > self.ctx.info["GL_MAX_UNIFORM_BLOCK_SIZE"]
        if self._in_storage:
            self.defines["SOLIDS_IN_STORAGE"] = 1
        if len(solids.records):
            self._buffers = {
                bindings.SOLIDS: self.ctx.buffer(solids.records),
                bindings.PLANES: self.ctx.buffer(solids.planes),
            }
        if tree is not None:
            self.defines["TREE_STACK"] = max(tree.depth, 1)
        self.defines |= {
            "TRIANGLE_COUNT": self.triangle_count,
            "SOLID_COUNT": len(solids.records),
            "PIECE_COUNT": len(self.geometry.curved.faces),
        }

    def _pack_objects(self) -> None:
        self.media = media = scene_media(self.scene)
        weights: list[np.ndarray] = []
        gratings: list[np.ndarray] = []
        wedges: list[np.ndarray] = []
        self._crystals = CRYSTAL.zeros(sum(item.material.polarises for item in self.scene.objects))
        crystals = 0
        absorbers: dict[bytes, int] = {}
        """Row of each curve."""
        widths = rough_surfaces.distinct_widths(item.material.microfacet_width for item in self.scene.objects)
        nm, x = samples_of(self.axis)
        films = film_tables(self.scene, nm, self.features.polarised)
        self.grating_rows, of_gratings = grating_tables(self.scene, SAMPLES)
        stack_bits = _stack_bits(self.scene) if self.features.medium_stack else {}
        records = OBJECT.zeros(len(self.scene.objects))
        for name in ("medium", "weight_row", "stack_bit", "receiver", "group", "texture"):
            records[name] = NONE
        textured = textured_objects(self.scene)
        records["texture"][textured] = np.arange(len(textured))
        for index, (record, item) in enumerate(zip(records, self.scene.objects, strict=True)):
            record["first_triangle"] = self.first_triangle[index]
            material = item.material
            record["kind"] = material.met_as
            if material.receives:
                record["colour"][:3] = material.reflectance_rgb
                record["receiver"] = self.receivers.index(index)
            size = UNBOUNDED
            if material.is_specular and (material.is_rough or material.polarises or not item.mesh.is_faceted):
                size = self.space.scale * 0.5 * float(np.linalg.norm(np.ptp(self.world_meshes[index].vertices, axis=0)))
            if material.is_specular:
                width = material.microfacet_width
                table = rough_surfaces.first_row_of(width, widths, material.is_mirror) if width > 0.0 else 0
                if material.film is not None and material.film.profile is not None:
                    width = -1.0 - WEDGE.stride // 16 * len(wedges)
                    wedges.append(self._wedge(item))
                record["colour"] = width, films.number.get(index, 0), size, table
            if material.is_mirror:
                record["weight_row"] = len(weights)
                weights.append(mirror_reflectance(material.reflectance_rgb, nm))
            if material.dispersion is None and (self.features.environment_lights or self.features.bounces):
                record["medium"] = 0 if item.whole.mesh.is_closed else NONE
            if isinstance(material, Grating):
                record["weight_row"] = sum(len(texels) for texels in gratings)
                gratings.append(grating_texels(item, self.grating_rows.get(index)))
            if material.dispersion is not None:
                record["medium"] = media.index(material.dispersion)
                if index in stack_bits:
                    record["stack_bit"] = stack_bits[index]
                if material.dispersion in self.groups.glasses and self.groups.count and not material.thin:
                    record["group"] = self.groups.group[self.groups.glasses.index(material.dispersion)]
            if material.polarises:
                record["receiver"] = _CRYSTAL_TEXELS * crystals
                self._pack_crystal(self._crystals[crystals], item, media)
                crystals += 1
            if material.filters:
                record["texture"] = len(weights)
                weights.append(np.interp(nm, VISIBLE_NM, material.surface_filter))
            if material.absorption is not None and material.is_solid:
                alpha = material.absorption.coefficient
                row = absorbers.setdefault(alpha.tobytes(), len(weights))
                record["weight_row"] = row
                if row == len(weights):
                    weights.append(np.interp(nm, VISIBLE_NM, alpha) / self.space.scale)
        self._sections["OBJECTS"] = self._records = records
        if gratings:
            self._sections["GRATINGS"] = np.concatenate(gratings)
        if wedges:
            self._sections["WEDGES"] = np.concatenate(wedges)
        if crystals:
            self._sections["CRYSTALS"] = self._crystals
        orders = [len(item.material.orders) for item in self.scene.objects if isinstance(item.material, Grating)]
        self.most_orders = max([_LOBES * self.features.crystals, *orders])
        """Orders of the grating that has most; lobes of a crystal."""
        # bit -> (medium, weight row) for the medium stack.
        by_bit = {bit: index for index, bit in stack_bits.items()}
        self.stack_objects: list[int] = [by_bit[bit] for bit in range(len(by_bit))]

        variables = self.groups.variables(nm, x)
        slopes = [
            index_slope(self.groups, self.groups.glasses.index(g) if g in self.groups.glasses else None, nm, x)
            for g in media
        ]
        rows = [
            np.array([glass.index(nm) for glass in media]).reshape(-1, SAMPLES),
            np.array(slopes).reshape(-1, SAMPLES),
            variables,
            np.array(weights).reshape(-1, SAMPLES),
        ]
        self.light_power: list[CumulativeSpectrum] = [
            cumulative(self.axis, light.spectral_power) for light in self.scene.lights
        ]
        levels, powers = self.tint_levels, self.light_power
        self.tint_row = NONE if levels is None else absorbers[levels.coefficient.tobytes()]
        """Row of the spectra: absorption of the glass in which photons count their way."""
        if levels is not None:
            behind = [spectrum for light in self.scene.lights for spectrum in levels.all_behind(light.spectral_power)]
            powers = [cumulative(self.axis, spectrum) for spectrum in behind]
            self.tint_halfway = [levels.halfway(light.spectral_power).reshape(-1, 4) for light in self.scene.lights]
        rows.append(np.array([power.at(x)[:, 3] for power in powers]).reshape(-1, SAMPLES))
        rows += [self._draws(), rough_surfaces.glass_tables(widths, SAMPLES), films.rows, of_gratings]
        counts = np.cumsum([0] + [len(r) for r in rows])
        self.layout = SpectraLayout(*counts.tolist())
        self.variables = variables
        """Each spectral group's variable over x, float64 (groups, SAMPLES)."""
        self.variable_table = variables.astype("f4")
        self._spectra = spectra_texture(self.ctx, np.concatenate(rows) if counts[-1] else np.ones((1, SAMPLES)))
        self.defines |= {
            "INDEX_ROW": self.layout.index_row,
            "SLOPE_ROW": self.layout.slope_row,
            "VARIABLE_ROW": self.layout.variable_row,
            "WEIGHT_ROW": self.layout.weight_row,
            "BRIGHTNESS_ROW": self.layout.brightness_row,
            "STACK_SIZE": max(1, len(self.stack_objects)),
            "STACK_OBJECTS": "uint[](" + ", ".join(f"{o}u" for o in (self.stack_objects or [0])) + ")",
        }
        if self.features.films:
            self.defines |= {**films.defines, "FILM_ROW": self.layout.film_row}
        if self.features.gratings:
            self.defines["GRATING_ROW"] = self.layout.grating_row
        if self.features.rough:
            self.defines |= rough_surfaces.glass_defines(self.layout.rough_row)

    def _pack_crystal(self, record: np.ndarray, item: SceneObject, media: list[Dispersion]) -> None:
        """What a crystal, or a polariser, has besides an object's record."""
        material = item.material
        other = material.extraordinary if material.is_crystal else WAVELENGTH
        if other not in media:
            media.append(other)
        record["axis"] = material.axis_in_world(item.object_to_world)
        record["extraordinary"], record["group"] = media.index(other), NONE
        if isinstance(material, Polariser):
            record["passed_along"], record["passed_across"] = material.transmittance, material.crossed_transmittance
            record["retardance_um"] = material.retardance_nm / 1000.0
        elif other.is_dispersive and self.groups.count:
            record["group"] = self.groups.group[self.groups.glasses.index(other)]

    def _wedge(self, item: SceneObject) -> np.ndarray:
        """How thick an object's film is where."""
        record = WEDGE.zeros(1)
        origin, bend, slope, least = film_thickness(item)
        record["origin"], record["bend"] = self.space.to_gpu(origin), bend / self.space.scale**2
        record["slope"], record["least"] = slope / self.space.scale, least
        return record

    def _draws(self) -> np.ndarray:
        """Each light's density of random wavelengths as a running integral, (lights, SAMPLES); none where none are
        drawn."""
        rows = []
        for light, power in zip(self.scene.lights, self.light_power, strict=True):
            # The range that a plan's single band has (`Planner`).
            lo_nm, hi_nm = light.spectral_power.support_nm()
            support = float(self.axis.x_of_nm(lo_nm - 0.5)), float(self.axis.x_of_nm(hi_nm + 0.5))
            rows.append(wavelength_cdf(power, SAMPLES, support, self.features.draws_by_power))
        return np.array(rows if self.features.random_wavelength else []).reshape(-1, SAMPLES)


def _stack_bits(scene: Scene) -> dict[int, int]:
    """Object → bit in a ray's inside mask; a higher bit wins. Raises UserError beyond 32 solids.

    Where no two solids meet, yet a stack is wanted (to measure it), all of them are on it."""
    overlapping = overlapping_solids(scene) or [i for i, o in enumerate(scene.objects) if o.material.is_solid]
    if len(overlapping) > 32:
        raise UserError(
            f"scene '{scene.name}': {len(overlapping)} transparent solids nest or touch and at most 32 may; "
            "move some apart or join their meshes"
        )
    ranked = sorted(overlapping, key=lambda i: (scene.objects[i].material.priority, i))
    return {index: bit for bit, index in enumerate(ranked)}
