"""Objects that move where their triangles lie: a matrix each is uploaded, and the device writes triangles, normals and
the tree's boxes anew from what was packed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import moderngl
import numpy as np

from ..model.geometry.bvh import Bvh
from ..model.geometry.mesh import Mesh
from ..model.scene import Scene, SceneObject
from . import bindings, shader
from .gpu_space import GpuSpace
from .scene_records import SCENE_STRUCTS
from .scene_texels import SceneTexels

_GROUP, _MOST_GROUPS = 64, 65535
_BIND_NODES = 8


class WorldMeshes(Sequence[Mesh]):
    """A scene's meshes in the world, each made when it is asked for after its object has moved."""

    def __init__(self, scene: Scene) -> None:
        self.packed = [o.mesh.transformed(o.object_to_world) for o in scene.objects]
        """Where they were at first."""
        self._half_sizes: dict[int, np.ndarray] = {}
        self._now: list[Mesh | SceneObject] = [*self.packed]

    def __len__(self) -> int:
        return len(self._now)

    def __getitem__(self, index: int) -> Mesh:  # type: ignore[override]
        mesh = self._now[index]
        if isinstance(mesh, SceneObject):
            mesh = self._now[index] = mesh.mesh.transformed(mesh.object_to_world)
        return mesh

    def half_size(self, index: int) -> np.ndarray:
        """Half the sides of the box about object `index` where it was at first, (3,)."""
        if index not in self._half_sizes:
            self._half_sizes[index] = 0.5 * np.ptp(self.packed[index].vertices, axis=0)
        return self._half_sizes[index]

    def move(self, index: int, item: SceneObject) -> None:
        """Object `index` stands elsewhere."""
        self._now[index] = item


class ObjectPlaces:
    """Each object's matrix from where it was packed to where it is, GPU space: `matrices` float64 (objects, 3, 4), and
    a texture of their rows, three texels an object (`lib/moved.glsl`)."""

    def __init__(self, ctx: moderngl.Context, scene: Scene, space: GpuSpace) -> None:
        self._space = space
        self._packed = [item.object_to_world for item in scene.objects]
        self.matrices = np.tile(np.eye(3, 4), (max(len(self._packed), 1), 1, 1))
        rows = -(-len(self.matrices) // bindings.PLACES_A_ROW)
        texels = np.resize(self.matrices.astype("f4"), (rows * bindings.PLACES_A_ROW, 3, 4))
        self.texture = ctx.texture((3 * bindings.PLACES_A_ROW, rows), 4, texels, dtype="f4")
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def move(self, index: int, object_to_world: np.ndarray) -> np.ndarray:
        """Object `index` stands elsewhere; returns its matrix."""
        world = object_to_world @ np.linalg.inv(self._packed[index])
        linear, space = world[:3, :3], self._space
        offset = (linear @ space.centre + world[:3, 3] - space.centre) * space.scale
        self.matrices[index] = np.column_stack([linear, offset])
        row, column = divmod(index, bindings.PLACES_A_ROW)
        self.texture.write(self.matrices[index].astype("f4"), (3 * column, row, 3, 1))
        return self.matrices[index]

    def bind(self) -> None:
        """Bind the texture to its unit."""
        self.texture.use(bindings.UNIT_PLACES)


class MovingTriangles:
    """Writes a scene's texels of triangles, normals and tree anew."""

    def __init__(self, ctx: moderngl.Context, texels: SceneTexels, tree: Bvh | None, triangles: int) -> None:
        self._ctx, self._texels, self._count = ctx, texels, triangles
        self._packed = ctx.texture(texels.texture.size, 4, texels.texture.read(), dtype="u4")
        defines = bindings.SCENE_DEFINES | texels.defines | {"SCENE_IMAGE": 1, "WORKGROUP": _GROUP}
        self._triangles = shader.compute(ctx, "scene/move_triangles.comp", defines, SCENE_STRUCTS)
        self._boxes = shader.compute(ctx, "scene/move_boxes.comp", defines, SCENE_STRUCTS)
        levels = [] if tree is None else _inner_levels(tree)
        self._levels = [len(level) for level in levels]
        self._nodes = ctx.buffer(np.concatenate([*levels, np.zeros(1, int)]).astype(np.uint32))

    def run(self) -> None:
        """Write them for the matrices of `ObjectPlaces`, which is bound."""
        self._packed.bind_to_image(0, read=True, write=False)
        self._texels.texture.bind_to_image(bindings.IMAGE_SCENE, read=True, write=True)
        self._nodes.bind_to_storage_buffer(_BIND_NODES)
        self._run(self._triangles, self._count)
        first = 0
        for count in self._levels:
            self._boxes["first"].value = first
            self._run(self._boxes, count)
            first += count

    def _run(self, program: moderngl.ComputeShader, count: int) -> None:
        program["count"].value = count
        program.run(min(-(-count // _GROUP), _MOST_GROUPS))
        self._ctx.memory_barrier()

    @property
    def bytes(self) -> int:
        """GPU memory held."""
        return 16 * self._packed.width * self._packed.height + self._nodes.size

    def release(self) -> None:
        """Free everything."""
        shader.release(self._packed, self._triangles, self._boxes, self._nodes)


def _inner_levels(tree: Bvh) -> Iterable[np.ndarray]:
    """Numbers of inner nodes as `tree_texels` counts them, the deepest level first."""
    is_inner, left = tree.nodes["count"] == 0, tree.nodes["left_or_first"].astype(np.int64)
    number = np.cumsum(is_inner) - 1
    levels, found = [], np.zeros(1, np.int64)
    while len(found := found[is_inner[found]]):
        levels.append(number[found])
        found = np.concatenate([left[found], left[found] + 1])
    return levels[::-1] or [np.zeros(1, np.int64)]
