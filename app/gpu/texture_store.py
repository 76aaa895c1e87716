"""The scene's pictures on the GPU: textures of its surfaces and the map of its environment, for
shaders/lib/textures.glsl.

All of them with all their levels lie in one texture, each texel a whole colour, because a software renderer gathers
a texel for eight rays at once; which level is read, and how, the shader decides, so that the filter is the same on
every device. Texture coordinates lie in a second, small texture: while a scene is edited they follow its triangles,
and the pictures stay where they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np

from ..base.errors import UserError
from ..model.scene import Scene, SceneObject
from ..model.texture import Environment, Texture
from . import shader
from .device_traits import DeviceTraits
from .mip_chain import kept_levels, level_count
from .records import NONE
from .schema import Field, Struct
from .tiles import Tile, pack

PICTURE = Struct(
    "Picture",
    (
        Field(
            "origin",
            "uvec2",
            "first texel of level 0; level k is at the right of it (level_origin in lib/textures.glsl)",
        ),
        Field("size", "uvec2", "of level 0, texels"),
        Field("repeats", "uvec2", "1 where the picture repeats across, and downwards; else its border goes on"),
        Field("levels", "uint", "down to a single texel"),
        Field(
            "corners",
            "uint",
            "texture coordinates of triangle `source` are the texels corners + 2 source (modulo 2³²) and the next",
        ),
    ),
)
ROW_TEXELS = 4096
"""Texels a row of the texture coordinates (shaders/lib/textures.glsl knows it as shift and mask)."""
MAX_BYTES = 1 << 30
"""Software renderers refuse larger textures."""


def textured_objects(scene: Scene) -> list[int]:
    """Indices of the objects that wear a texture, in order; `Object.texture` counts along this list."""
    return [i for i, o in enumerate(scene.objects) if o.material.texture is not None]


def place_defines(binding: int, unit: int) -> dict[str, int]:
    """Symbols by which the shader knows what `TextureStore.bind(binding, unit)` will bind to."""
    return {"BIND_PICTURES": binding, "UNIT_PICTURES": unit, "UNIT_CORNERS": unit + 1}


@dataclass(frozen=True)
class _Source:
    """One picture to be packed: who owns it, and its pixels float32 (H, W, 3)."""

    owner: Texture | Environment
    rgb: np.ndarray

    @property
    def cell(self) -> tuple[int, int]:
        """Width and height of all levels together: level 0, and at its right the others in a column."""
        height, width = self.rgb.shape[:2]
        last = level_count(width, height) - 1
        if last == 0:
            return width, height
        return width + max(1, width >> 1), max(height, _level_row(height, last) + max(1, height >> last))

    @property
    def name(self) -> str:
        """Its name in messages."""
        return self.owner.source or ("the environment" if isinstance(self.owner, Environment) else "a texture")


def _level_row(height: int, level: int) -> int:
    """First row of a level >= 1 in the column; shaders/lib/textures.glsl says the same."""
    return height - (height >> (level - 1)) + level - 1


class TextureStore:
    """Owns the textures and the records; where a scene has no pictures nothing is made and no symbol defined."""

    def __init__(
        self,
        ctx: moderngl.Context,
        scene: Scene,
        first_triangle: np.ndarray,
        corner_turn: np.ndarray,
        max_side: int | None = None,
        as_image: bool | None = None,
    ) -> None:
        """`first_triangle`, `corner_turn`: as in `SceneBuffers`. `max_side`: of a texture, None for what the device
        allows;
        `as_image` chooses how shaders read texels (None: what suits the renderer).

        Raises `UserError` where the pictures do not fit, or a textured mesh has no usable texture coordinates.
        """
        self.ctx = ctx
        self._max_side = min(max_side or MAX_BYTES, int(ctx.info["GL_MAX_TEXTURE_SIZE"]))
        self._as_image = DeviceTraits.of(ctx.info["GL_RENDERER"]).texels_as_images if as_image is None else as_image
        self._pictures: moderngl.Texture | None = None
        self._corners: moderngl.Texture | None = None
        self._records: moderngl.Buffer | None = None
        self._sources = _sources(scene)
        self._tiles: list[Tile] = []
        self._filled_for: tuple[list[object], np.ndarray] = [], np.zeros(0)
        self.defines: dict[str, int] = {}
        """PICTURE_COUNT, HAS_TEXTURES, HAS_ENVIRONMENT_MAP, TEXTURES_IMAGE; only what there is."""
        self.structs: tuple[Struct, ...] = (PICTURE,) if self._sources else ()
        if self._sources:
            self._pictures = self._packed()
            try:
                self._fill(scene, first_triangle, corner_turn)
            except UserError:
                self.release()
                raise

    def follow(self, scene: Scene, first_triangle: np.ndarray, corner_turn: np.ndarray) -> bool:
        """Take over an edited scene that shows the same pictures, without packing them again; the defines may change.

        False, and nothing done, where its pictures are others: then a new store is needed.
        """
        sources = _sources(scene)
        if len(sources) != len(self._sources) or not all(
            _same_picture(a.owner, b.owner) for a, b in zip(sources, self._sources, strict=True)
        ):
            return False
        worn, turn = self._filled_for
        if self._sources and (turn is not corner_turn or worn != _wearers(scene)):
            self._fill(scene, first_triangle, corner_turn)
        return True

    def bind(self, binding: int, unit: int) -> None:
        """Bind the records to the storage buffer `binding`, the pictures to `unit` and the texture coordinates to
        `unit` + 1 (image units where TEXTURES_IMAGE is defined). Shaders learn the numbers from `place_defines`."""
        if self._records is not None:
            self._records.bind_to_storage_buffer(binding)
        for place, texture in ((unit, self._pictures), (unit + 1, self._corners)):
            if texture is not None and self._as_image:
                texture.bind_to_image(place, read=True, write=False)
            elif texture is not None:
                texture.use(place)

    def release(self) -> None:
        """Free everything."""
        shader.release(self._pictures, self._corners, self._records)
        self._pictures = self._corners = self._records = None

    @property
    def bytes(self) -> int:
        """GPU memory held."""
        textures = sum(t.width * t.height * 16 for t in (self._pictures, self._corners) if t is not None)
        return textures + (self._records.size if self._records is not None else 0)

    def _packed(self) -> moderngl.Texture:
        largest = max(self._sources, key=lambda s: s.rgb.size)
        height, width = largest.rgb.shape[:2]
        remedy = (
            f"{largest.name}: its {width} x {height} pixels do not fit this device's textures with all pictures of "
            "the scene; make it smaller"
        )
        try:
            self._tiles, size = pack([s.cell for s in self._sources], self._max_side)
        except UserError as error:
            raise UserError(remedy) from error
        if size[0] * size[1] * 16 > MAX_BYTES:
            raise UserError(remedy)
        texels = np.zeros((size[1], size[0], 4), np.float32)
        for tile, source in zip(self._tiles, self._sources, strict=True):
            levels = kept_levels(source.rgb, on_sphere=isinstance(source.owner, Environment))
            for k, level in enumerate(levels):
                x, y = (
                    (tile.x, tile.y)
                    if k == 0
                    else (tile.x + levels[0].shape[1], tile.y + _level_row(len(levels[0]), k))
                )
                texels[y : y + level.shape[0], x : x + level.shape[1], :3] = level
        return _texture(self.ctx, texels)

    def _fill(self, scene: Scene, first_triangle: np.ndarray, corner_turn: np.ndarray) -> None:
        """Make the records and the texture coordinates."""
        textured = textured_objects(scene)
        records = PICTURE.zeros(len(textured) + (scene.environment is not None))
        corners: list[np.ndarray] = []
        for record, index in zip(records, textured, strict=False):
            item = scene.objects[index]
            texture = item.material.texture
            self._describe(record, texture)
            record["repeats"] = texture.wrap == "repeat"
            record["corners"] = (sum(map(len, corners)) - 2 * int(first_triangle[index])) % (1 << 32)
            turn = corner_turn[first_triangle[index] : first_triangle[index + 1]]
            corners.append(_corner_texels(item, turn, repeats=texture.wrap == "repeat"))
        if scene.environment is not None:
            self._describe(records[-1], scene.environment)
            records[-1]["repeats"] = 1, 0
            records[-1]["corners"] = NONE
        texels = _in_rows(corners, self._max_side, scene.objects[textured[0]]) if textured else None
        # Nothing is refused from here on, so that a refused edit leaves the store as it was.
        shader.release(self._records, self._corners)
        self._records = self.ctx.buffer(np.ascontiguousarray(records))
        self._corners = None if texels is None else _texture(self.ctx, texels)
        self._filled_for = _wearers(scene), corner_turn
        self.defines = {"PICTURE_COUNT": len(records)}
        switches = {
            "HAS_TEXTURES": textured,
            "HAS_ENVIRONMENT_MAP": scene.environment is not None,
            "TEXTURES_IMAGE": self._as_image,
        }
        self.defines |= {name: 1 for name, on in switches.items() if on}

    def _describe(self, record: np.void, owner: Texture | Environment) -> None:
        place = next(i for i, source in enumerate(self._sources) if _same_picture(source.owner, owner))
        height, width = owner.rgb.shape[:2]
        record["origin"] = self._tiles[place].x, self._tiles[place].y
        record["size"] = width, height
        record["levels"] = level_count(width, height)


def _sources(scene: Scene) -> list[_Source]:
    """Every picture once: of the textured objects in order, then of the environment."""
    owners: list[Texture | Environment] = [scene.objects[i].material.texture for i in textured_objects(scene)]
    owners += [scene.environment] if scene.environment is not None else []
    distinct: list[_Source] = []
    for owner in owners:
        if not any(_same_picture(owner, known.owner) for known in distinct):
            distinct.append(_Source(owner, owner.rgb))
    return distinct


def _wearers(scene: Scene) -> list[object]:
    """What the records and the texture coordinates depend on besides the pictures; compared by identity."""
    items = [(index, scene.objects[index]) for index in textured_objects(scene)]
    return [*((i, o.mesh, o.material.texture, o.object_to_world.tobytes()) for i, o in items), scene.environment]


def _same_picture(one: Texture | Environment, other: Texture | Environment) -> bool:
    """An environment's levels are others than a texture's, even of the same pixels."""
    return one.rgb is other.rgb and isinstance(one, Environment) == isinstance(other, Environment)


def _corner_texels(item: SceneObject, turn: np.ndarray, *, repeats: bool) -> np.ndarray:
    """float32 (2 T, 4): per triangle the (u, v) of the GPU's first corner, then from it to the second and to the
    third."""
    uv = item.mesh.transformed(item.object_to_world).uv
    if uv is None:
        raise UserError(
            f"object '{item.name}': it wears a texture, but its mesh has no texture coordinates; add them or give it "
            "a plain colour"
        )
    if not np.isfinite(uv).all() or np.abs(uv).max(initial=0.0) > 1e9:
        raise UserError(
            f"object '{item.name}': texture coordinates of its mesh are not finite or beyond 1e9; export the mesh again"
        )
    uv = np.take_along_axis(uv, turn[..., None], axis=1)
    if repeats:
        uv = uv - np.floor(uv.min(axis=1, keepdims=True))  # small numbers keep more digits
    texels = np.zeros((len(uv), 2, 4), np.float32)
    texels[:, 0, :2] = uv[:, 0]
    texels[:, 0, 2:] = uv[:, 1] - uv[:, 0]
    texels[:, 1, :2] = uv[:, 2] - uv[:, 0]
    return texels.reshape(-1, 4)


def _in_rows(corners: Sequence[np.ndarray], max_side: int, first: SceneObject) -> np.ndarray:
    """float32 (rows, ROW_TEXELS, 4): one after the other. Raises `UserError` where they are too many."""
    count = sum(map(len, corners))
    rows = -(-count // ROW_TEXELS)
    if rows > max_side:
        raise UserError(
            f"object '{first.name}': textured objects have more triangles than this device's textures hold; simplify "
            "their meshes"
        )
    image = np.zeros((rows * ROW_TEXELS, 4), np.float32)
    image[:count] = np.concatenate(corners)
    return image.reshape(rows, ROW_TEXELS, 4)


def _texture(ctx: moderngl.Context, texels: np.ndarray) -> moderngl.Texture:
    """RGBA32F texture of float32 (H, W, 4)."""
    texture = ctx.texture(texels.shape[1::-1], 4, texels, dtype="f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture
