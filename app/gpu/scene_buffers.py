"""The scene as the GPU sees it: triangles with their tree, half-space solids, objects, spectra.

Everything is moved and scaled into "GPU space" first (`GpuSpace`), so that float32 resolves the
glass equally well in a scene of micrometres and in one that stands ten kilometres off the origin.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import moderngl
import numpy as np

from ..base.errors import UserError
from ..model.contacts import overlapping_solids, world_bounds
from ..model.features import (
    MAX_GROUPS,
    Features,
    dispersive_materials,
    half_spaces,
)
from ..model.geometry.bvh import Bvh, build_bvh
from ..model.geometry.mesh import Mesh
from ..model.optics import rough_glass
from ..model.optics.colorimetry import VISIBLE_NM, mirror_reflectance
from ..model.optics.glass import Dispersion
from ..model.optics.spectral_tables import (
    CumulativeSpectrum,
    SpectralAxis,
    cumulative,
    index_table,
    wavelength_cdf,
)
from ..model.scene import Grating, Light, Scene
from ..model.tint_bands import tint_curves
from ..model.tint_levels import TintLevels, tint_levels
from . import bindings
from .records import NONE
from .scene_texels import SceneTexels, spectra_texture, tree_texels
from .schema import Field, Struct
from .texture_store import textured_objects

SAMPLES = 1025
"""Equally spaced samples of every spectral table over x in [0, 1]; linear interpolation errs below 2e-7 in n."""
_PLANE_BIT = 0x80000000
"""Of a primitive's number: a plane of a half-space solid, not a triangle (shaders/lib/intersect.glsl)."""


TRIANGLE = Struct(
    "Triangle",
    (
        Field("vertex", "vec3", "first corner, GPU space"),
        Field("object", "uint", "scene object index"),
        Field("edge1", "vec3", "second corner minus first"),
        Field("normals", "uint", "first of three corner normals, or NONE for a flat facet"),
        Field("edge2", "vec3", "third corner minus first"),
        Field("source", "uint", "global index before the tree reordered them: objects in scene order"),
    ),
    texels=True,
)
SOLID = Struct(
    "Solid",
    (Field("first_plane", "uint"), Field("plane_count", "uint"), Field("object", "uint"), Field("reserved", "uint")),
)
OBJECT = Struct(
    "Object",
    (
        Field("kind", "uint", "0 black, 1 diffuse, 2 mirror, 3 dielectric, 4 grating"),
        Field("medium", "uint", "row of the index table (dielectric, grating: its wavelength)"),
        Field(
            "weight_row", "uint", "row of absorption (1/GPU unit) or reflectance over x, texel of a grating, or NONE"
        ),
        Field(
            "stack_bit", "uint", "bit of this solid in a ray's inside mask, by priority; NONE where it overlaps nothing"
        ),
        Field("receiver", "uint", "receiver index, or NONE"),
        Field("group", "uint", "spectral group of the glass, or NONE"),
        Field("first_triangle", "uint", "global source index of its first triangle"),
        Field("texture", "uint", "its picture in the texture store, or NONE"),
        Field(
            "colour",
            "vec4",
            "linear Rec.709 reflectance (diffuse, mirror); dielectric: GGX's width, its table's row, 0, n_d",
        ),
    ),
    texels=True,
)
GRATING = Struct(
    "Grating",
    (
        Field("lines", "vec3", "unit, along the lines"),
        Field("orders", "uint", "how many follow it in the same section, one GratingOrder each"),
    ),
    texels=True,
)
GRATING_ORDER = Struct(
    "GratingOrder",
    (
        Field("shift_per_um", "float", "added to a direction's tangential part, per micrometre of wavelength: m / Λ"),
        Field("efficiency", "float", "share of the light"),
        Field("left", "float", "share that the orders before have left"),
        Field("reflects", "uint"),
    ),
    texels=True,
)
SCENE_STRUCTS = (TRIANGLE, SOLID, OBJECT, GRATING, GRATING_ORDER)


@dataclass(frozen=True)
class GpuSpace:
    """p_gpu = (p_world - centre) * scale, scale a power of two."""

    centre: np.ndarray
    scale: float

    @staticmethod
    def of(scene: Scene) -> GpuSpace:
        """The space in which the specular objects (else everything) have about unit radius."""
        chosen = [o for o in scene.objects if o.material.is_specular] or list(scene.objects)
        bounds = np.stack([world_bounds(o) for o in chosen])
        low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
        radius = 0.5 * float(np.linalg.norm(high - low))
        return GpuSpace(0.5 * (low + high), 2.0 ** -float(np.round(np.log2(radius))) if radius > 0 else 1.0)

    def to_gpu(self, points: np.ndarray) -> np.ndarray:
        """World positions (..., 3) → GPU space, float64."""
        return (np.asarray(points, float) - self.centre) * self.scale

    def to_world(self, points: np.ndarray) -> np.ndarray:
        """GPU space positions (..., 3) → world, float64."""
        return np.asarray(points, float) / self.scale + self.centre


@dataclass(frozen=True)
class Groups:
    """How dispersive glasses share the spectral columns of a photon."""

    glasses: tuple[Dispersion, ...]
    """Distinct dispersive glasses."""
    group: tuple[int, ...]
    """Group of each glass."""
    count: int
    by_wavelength: bool
    """The single group's variable is the wavelength (the paper's λ-column)."""

    @staticmethod
    def of(scene: Scene, features: Features) -> Groups:
        glasses = tuple(scene.objects[i].material.dispersion for i in dispersive_materials(scene))
        count = features.spectral_groups
        group = tuple(min(i, count - 1) for i in range(len(glasses))) if count else ()
        return Groups(glasses, group, count, features.merged_groups and len(glasses) <= MAX_GROUPS)

    def variables(self, axis: SpectralAxis) -> np.ndarray:
        """var_g over x, float64 (count, SAMPLES): n of the glass, or a shared variable."""
        x = np.linspace(0.0, 1.0, SAMPLES)
        nm = axis.nm_of_samples(SAMPLES)
        rows = []
        for g in range(self.count):
            members = [glass for glass, owner in zip(self.glasses, self.group, strict=True) if owner == g]
            if self.by_wavelength:
                rows.append(nm / 1000.0)
            elif len(members) == 1:
                rows.append(members[0].index(nm))
            else:
                rows.append(x)
        return np.array(rows).reshape(self.count, SAMPLES)


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
    """`rough_glass.tables`."""
    rows: int


class SceneBuffers:
    """Owns the scene's textures and storage buffers; `bind()` before every dispatch that reads them."""

    def __init__(
        self,
        ctx: moderngl.Context,
        scene: Scene,
        features: Features,
        axis: SpectralAxis,
        like: SceneBuffers | None = None,
    ) -> None:
        """`like`: of a scene whose objects only stood elsewhere: GPU space, corners' turns, the tree's shape and what
        nests in what are taken from there."""
        self.ctx = ctx
        self.scene = scene
        self.features = features
        self.axis = axis
        self.space: GpuSpace = GpuSpace.of(scene) if like is None else like.space
        self.groups = Groups.of(scene, features)
        self.receivers = [i for i, o in enumerate(scene.objects) if o.material.receives]
        self.traced_glasses = [o.material.dispersion for o in scene.objects]
        """Each object's glass as the records number it, whatever `scene` is replaced by to be shown."""
        self.first_triangle = np.cumsum([0] + [len(o.mesh.triangles) for o in scene.objects])
        self.world_meshes: list[Mesh] = [
            like.world_meshes[i]
            if like is not None and like.scene.objects[i].object_to_world is o.object_to_world
            else o.mesh.transformed(o.object_to_world)
            for i, o in enumerate(scene.objects)
        ]
        self.corner_turn: np.ndarray = (
            np.tile(np.arange(3), (self.first_triangle[-1], 1)) if like is None else like.corner_turn
        )
        """int (T, 3): which of its own corners each triangle's first, second and third are on the GPU; T counts all
        objects' triangles."""
        self._tree: Bvh | None = None
        self._buffers: dict[int, moderngl.Buffer] = {}
        self._sections: dict[str, np.ndarray] = {}
        self.defines: dict[str, int | str] = {**bindings.SCENE_DEFINES, "SPECTRAL_SAMPLES": SAMPLES}
        self._pack_geometry(like)
        self._pack_objects(like)
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

    def bind(self) -> None:
        """Bind every scene texture and buffer to its place."""
        self.texels.bind()
        self.texels.bind_spectra(self._spectra)
        for binding, buffer in self._buffers.items():
            if self._in_storage or binding == bindings.PROFILES:
                buffer.bind_to_storage_buffer(binding)
            else:
                buffer.bind_to_uniform_block(binding)

    def release(self) -> None:
        """Free buffers and textures."""
        self.texels.release()
        self._spectra.release()
        for buffer in self._buffers.values():
            buffer.release()
        self._buffers.clear()

    @property
    def bytes(self) -> int:
        """GPU memory held."""
        pixels = (self.texels.texture, 16), (self._spectra, 8)
        return sum(buffer.size for buffer in self._buffers.values()) + sum(
            t.width * t.height * size for t, size in pixels
        )

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
        """`tint_curves` of the scene: every pass asks, and a mean chord takes all of a mesh's triangles."""
        levels = self.tint_levels
        return tint_curves(self.scene, None if levels is None else levels.coefficient)

    @cached_property
    def tint_levels(self) -> TintLevels | None:
        """The glass whose way photons tell, where they do."""
        return tint_levels(self.scene) if self.features.tint_levels else None

    @cached_property
    def primitives(self) -> np.ndarray:
        """uint32 (T,): what a ray that left each triangle has as `last_primitive`; T counts all objects' triangles."""
        numbers = np.full(self.first_triangle[-1], NONE, np.uint32)
        numbers[self._triangle_order] = np.arange(len(self._triangle_order))
        for first, count, index, _ in self._solids:
            planes = self._planes[first : first + count].astype(float)
            corners = self.space.to_gpu(self.world_meshes[index].corners())
            off = np.abs(corners @ planes[:, :3].T - planes[:, 3]).max(axis=1)
            start = self.first_triangle[index]
            numbers[start : start + len(corners)] = _PLANE_BIT | (first + off.argmin(axis=1))
        return numbers

    def profile_start(self, light: Light) -> int:
        """Where the light's intensity table begins among the profiles; 0 without one."""
        return 0 if light.profile is None else self._profile_start[light.profile]

    def move(self, scene: Scene) -> bool:
        """Take over `scene`, in which other objects stand elsewhere and nothing else differs that buffers hold, in the
        GPU space that there is. False, and nothing done, where programs made for these buffers do not fit it."""
        moved = SceneBuffers(self.ctx, scene, self.features, self.axis, self)
        if moved.defines != self.defines:
            moved.release()
            return False
        self.release()
        for kept in ("primitives", "tints"):
            self.__dict__.pop(kept, None)
        self.__dict__.update(moved.__dict__)
        return True

    def _pack_geometry(self, like: SceneBuffers | None) -> None:
        corners, owner, source = [], [], []
        normals: list[np.ndarray] = []
        solids: list[tuple[int, int, int, int]] = []
        planes: list[np.ndarray] = []
        plane_count, known_meshes, convex = 0, set(), half_spaces(self.scene)
        for index, item in enumerate(self.scene.objects):
            mesh = self.world_meshes[index]
            untransformed = convex.get(index)
            if untransformed is not None:
                # Of a mesh that stands in many places, they are found once.
                own = mesh.convex_planes if like is None and id(item.mesh) not in known_meshes else None
                known_meshes.add(id(item.mesh))
                if own is None:  # a transform may push a borderline solid over the tolerance
                    own = _transformed_planes(untransformed, item.object_to_world)
                solids.append((plane_count, len(own), index, 0))
                plane_count += len(own)
                offset = own[:, 3] - own[:, :3] @ self.space.centre
                planes.append(np.column_stack([own[:, :3], offset * self.space.scale]))
                continue
            corners.append(self.space.to_gpu(mesh.corners()))
            owner.append(np.full(len(mesh.triangles), index))
            source.append(self.first_triangle[index] + np.arange(len(mesh.triangles)))
            known = mesh.corner_normals if item.material.is_specular or item.material.has_coat else None
            normals.append(np.full((len(mesh.triangles), 3, 3), np.nan) if known is None else known)

        solid_records = SOLID.zeros(len(solids))
        for record, values in zip(solid_records, solids, strict=True):
            record["first_plane"], record["plane_count"], record["object"], _ = values
        self.solid_count = len(solids)
        self._solids, self._triangle_order = solids, np.zeros(0, int)
        all_planes = np.ascontiguousarray(np.concatenate(planes), "f4") if planes else np.zeros((0, 4), "f4")
        self.defines["PLANE_COUNT"] = len(all_planes)
        self._in_storage = max(all_planes.nbytes, solid_records.nbytes) > self.ctx.info["GL_MAX_UNIFORM_BLOCK_SIZE"]
        if self._in_storage:
            self.defines["SOLIDS_IN_STORAGE"] = 1
        self._planes = all_planes
        if planes:
            self._buffers = {
                bindings.SOLIDS: self.ctx.buffer(solid_records),
                bindings.PLANES: self.ctx.buffer(all_planes),
            }

        self.triangle_count = sum(len(c) for c in corners)
        if not corners:
            self.defines |= {"TRIANGLE_COUNT": 0, "SOLID_COUNT": self.solid_count}
            return
        all_corners = np.concatenate(corners).astype("f4")
        if like is None:
            turned = _best_corner_first(all_corners)
            self.corner_turn[np.concatenate(source)] = turned[..., 0]
        else:
            turned = self.corner_turn[np.concatenate(source)][..., None]
        all_corners = np.take_along_axis(all_corners, turned, axis=1)
        order = np.arange(len(all_corners))
        if self.features.tree:
            before = None if like is None else like._tree
            bvh = self._tree = build_bvh(all_corners) if before is None else before.refitted(all_corners)
            order = bvh.order
            self._sections["TREE"] = tree_texels(bvh.nodes)
            self.defines |= {"TREE_STACK": max(bvh.depth, 1)}
        all_corners = all_corners[order]
        records = TRIANGLE.zeros(len(order))
        records["vertex"] = all_corners[:, 0]
        records["edge1"] = all_corners[:, 1] - all_corners[:, 0]
        records["edge2"] = all_corners[:, 2] - all_corners[:, 0]
        records["object"] = np.concatenate(owner)[order]
        records["source"] = self._triangle_order = np.concatenate(source)[order]
        all_normals = np.take_along_axis(np.concatenate(normals), turned, axis=1)[order]
        smooth = np.isfinite(all_normals).all(axis=(1, 2)) & (np.abs(all_normals).sum(axis=2) > 0).all(axis=1)
        # A facet whose three corner normals agree is flat: its normal has no derivative to compute.
        records["normals"] = NONE
        records["normals"][smooth] = 3 * np.arange(np.count_nonzero(smooth))
        packed = np.zeros((3 * np.count_nonzero(smooth), 4), "f4")
        packed[:, :3] = all_normals[smooth].reshape(-1, 3)
        self._sections |= {"TRIANGLES": records, "NORMALS": packed}
        self.defines |= {"TRIANGLE_COUNT": self.triangle_count, "SOLID_COUNT": self.solid_count}

    def _pack_objects(self, like: SceneBuffers | None) -> None:
        media: list[Dispersion] = []
        weights: list[np.ndarray] = []
        gratings: list[np.ndarray] = []
        absorbers: dict[bytes, int] = {}
        """Row of each curve."""
        widths = rough_glass.distinct(item.material.microfacet_width for item in self.scene.objects)
        x = np.linspace(0.0, 1.0, SAMPLES)
        nm = self.axis.nm_of_samples(SAMPLES)
        stack_bits: dict[int, int] = {}
        if like is not None:
            stack_bits = {index: bit for bit, index in enumerate(like.stack_objects)}
        elif self.features.medium_stack:
            stack_bits = _stack_bits(self.scene)
        records = OBJECT.zeros(len(self.scene.objects))
        for name in ("medium", "weight_row", "stack_bit", "receiver", "group", "texture"):
            records[name] = NONE
        textured = textured_objects(self.scene)
        records["texture"][textured] = np.arange(len(textured))
        for index, (record, item) in enumerate(zip(records, self.scene.objects, strict=True)):
            record["first_triangle"] = self.first_triangle[index]
            material = item.material
            record["kind"] = material.gpu_code
            record["colour"][:3] = material.reflectance_rgb
            if material.receives:
                record["receiver"] = self.receivers.index(index)
            if material.is_mirror:
                record["weight_row"] = len(weights)
                weights.append(mirror_reflectance(material.reflectance_rgb, nm))
            if isinstance(material, Grating):
                record["weight_row"] = sum(len(texels) for texels in gratings)
                gratings.append(_grating_texels(material, item.object_to_world))
            if material.dispersion is not None:
                if material.dispersion not in media:
                    media.append(material.dispersion)
                record["medium"] = media.index(material.dispersion)
                record["colour"][3] = material.dispersion.n_d
                if material.is_rough:
                    width = material.microfacet_width
                    record["colour"][:2] = width, rough_glass.ROWS * widths.index(width)
                if index in stack_bits:
                    record["stack_bit"] = stack_bits[index]
                if material.dispersion in self.groups.glasses and self.groups.count:
                    record["group"] = self.groups.group[self.groups.glasses.index(material.dispersion)]
            if material.absorption is not None:
                alpha = material.absorption.coefficient
                row = absorbers.setdefault(alpha.tobytes(), len(weights))
                record["weight_row"] = row
                if row == len(weights):
                    weights.append(np.interp(nm, VISIBLE_NM, alpha) / self.space.scale)
        self._sections["OBJECTS"] = records
        if gratings:
            self._sections["GRATINGS"] = np.concatenate(gratings)
        self.most_orders = max((len(texels) - 1 for texels in gratings), default=0)
        """Orders of the grating that has most."""
        # bit -> (medium, weight row) for the medium stack.
        by_bit = {bit: index for index, bit in stack_bits.items()}
        self.stack_objects: list[int] = [by_bit[bit] for bit in range(len(by_bit))]

        index_rows = index_table(self.axis, media, SAMPLES) if media else np.ones((0, SAMPLES))
        variables = self.groups.variables(self.axis)
        slopes = [
            index_slope(
                self.groups, self.groups.glasses.index(g) if g in self.groups.glasses else None, self.axis, variables
            )
            for g in media
        ]
        rows = [
            np.asarray(index_rows, float),
            np.array(slopes).reshape(-1, SAMPLES),
            variables,
            np.array(weights).reshape(-1, SAMPLES),
        ]
        self.light_power: list[CumulativeSpectrum] = [
            cumulative(self.axis, light.spectral_power) for light in self.scene.lights
        ]
        levels, powers = self.tint_levels, self.light_power
        self.tint_row = NONE if levels is None else absorbers[levels.coefficient.tobytes()]
        """Of the spectra: absorption of the glass whose way photons tell."""
        if levels is not None:
            behind = [spectrum for light in self.scene.lights for spectrum in levels.all_behind(light.spectral_power)]
            powers = [cumulative(self.axis, spectrum) for spectrum in behind]
        rows.append(np.array([power.at(x)[:, 3] for power in powers]).reshape(-1, SAMPLES))
        rows += [self._draws(), rough_glass.tables(widths, SAMPLES)]
        counts = np.cumsum([0] + [len(r) for r in rows])
        self.layout = SpectraLayout(*counts.tolist())
        self.variables = variables
        """Each spectral group's variable over x, float64 (groups, SAMPLES)."""
        self.variable_table = variables.astype("f4")
        self.media = media
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
        if self.features.rough:
            self.defines |= rough_glass.row_defines(self.layout.rough_row)

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


def _grating_texels(grating: Grating, object_to_world: np.ndarray) -> np.ndarray:
    """A GRATING and one GRATING_ORDER an order: uint32 (1 + orders, 4)."""
    head = GRATING.zeros(1)
    head["lines"] = grating.lines_in_world(object_to_world)
    head["orders"] = len(grating.orders)
    orders = GRATING_ORDER.zeros(len(grating.orders))
    orders["shift_per_um"], orders["efficiency"] = grating.shift_per_um, grating.efficiency
    orders["left"], orders["reflects"] = grating.left, grating.reflects
    return np.concatenate([record.view("<u4").reshape(-1, 4) for record in (head, orders)])


def index_slope(groups: Groups, glass: int | None, axis: SpectralAxis, variables: np.ndarray) -> np.ndarray:
    """dn/dvar over x of a glass (its number in `groups`) with respect to its group's variable: 1 where n is the
    variable, 0 without a group."""
    if glass is None or not groups.count:
        return np.zeros(SAMPLES)
    variable = variables[groups.group[glass]]
    n = groups.glasses[glass].index(axis.nm_of_samples(SAMPLES))
    if np.array_equal(n, variable):
        return np.ones(SAMPLES)
    return np.gradient(n, variable, edge_order=2)


def _best_corner_first(corners: np.ndarray) -> np.ndarray:
    """Order (T, 3, 1) of each triangle's corners, turned so that the edges at the first are nearest to a right angle.

    A needle then has its short edge there. Between its two long ones the normal and the place on the facet would
    lose as many digits as the needle is thin.
    """
    to_next = (np.roll(corners, -1, axis=1) - corners).astype(np.float64)
    from_last = np.roll(to_next, 1, axis=1)
    along = np.einsum("tcj,tcj->tc", to_next, from_last)
    size = np.linalg.norm(to_next, axis=2) * np.linalg.norm(from_last, axis=2)
    cosine = np.abs(np.divide(along, size, out=np.ones_like(along), where=size > 0.0))
    return ((cosine.argmin(axis=1)[:, None] + np.arange(3)) % 3)[..., None]


def _transformed_planes(planes: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Half-spaces n·x <= d under an affine map."""
    covectors = np.linalg.inv(matrix).T @ np.column_stack([planes[:, :3], -planes[:, 3]]).T
    covectors = covectors.T / np.linalg.norm(covectors[:3], axis=0)[:, None]
    return np.column_stack([covectors[:, :3], -covectors[:, 3]])


def _stack_bits(scene: Scene) -> dict[int, int]:
    """Object → bit in a ray's inside mask; a higher bit wins. Raises UserError beyond 32 solids.

    Where no two solids meet, yet a stack is wanted (to measure it), all of them are on it."""
    overlapping = overlapping_solids(scene) or [i for i, o in enumerate(scene.objects) if o.material.transmits]
    if len(overlapping) > 32:
        raise UserError(
            f"scene '{scene.name}': {len(overlapping)} transparent solids nest or touch and at most 32 may; "
            "move some apart or join their meshes"
        )
    ranked = sorted(overlapping, key=lambda i: (scene.objects[i].material.priority, i))
    return {index: bit for bit, index in enumerate(ranked)}
