"""glTF's base colour textures to ours and back: images embedded or in files next to it, PNG or JPEG.

Only diffuse surfaces have them; every other texture of a glTF material is named in a note and kept when saving.
glTF's texture coordinates run down where ours run up: `gltf` turns them on reading, `gltf_write` on writing.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from ...base.image_io import png_bytes
from ..naming import Unshown
from ..texture import Texture
from ..vectors import frozen
from .gltf_document import Additions, GltfDocument
from .picture_files import decode_8bit
from .scene_pictures import nearest_levels, picture_name

_CLAMP, _MIRRORED, _REPEAT = 33071, 33648, 10497
_FORMATS = ("image/png", "image/jpeg")
_TRANSFORM = "KHR_texture_transform"
_KTX2 = "KHR_texture_basisu"


class GltfTextures:
    """The textures of a document's materials; each image is decoded once."""

    def __init__(self, document: GltfDocument, notes: list[str]) -> None:
        self._document, self._notes = document, notes
        self._pictures: dict[int, tuple[np.ndarray, str | None] | None] = {}
        self._textures: dict[tuple[int, str], Texture] = {}
        self.numbers: dict[str, int] = {}
        """Content (`texture_key`) of every texture read -> its number in the document."""

    def base_colour(self, material: dict[str, Any], name: str, unshown: Unshown) -> Texture | None:
        """What the glTF `material` shows as its base colour, or None; what is not shown goes to `unshown`.

        Raises UserError for an image that is missing or damaged.
        """
        info = material.get("pbrMetallicRoughness", {}).get("baseColorTexture")
        if info is None:
            return None
        if info.get("texCoord", 0) != 0:
            unshown.add("Textures with a second set of texture coordinates are not shown", name)
            return None
        if _TRANSFORM in info.get("extensions", {}):
            unshown.add(f"Textures are shown without their {_TRANSFORM}", name)
        entry = self._document.item("textures", info.get("index"))
        picture = self._picture(entry["source"]) if "source" in entry else None
        if picture is None:
            kind = "KTX2 (Basis Universal)" if _KTX2 in entry.get("extensions", {}) else "neither PNG nor JPEG"
            unshown.add(f"Textures that are {kind} are not shown; export them as PNG or JPEG", name)
            return None
        wrap = self._wrap(entry, name, unshown)
        key = (entry["source"], wrap)
        if key not in self._textures:
            self._textures[key] = Texture(picture[0], wrap, picture[1])  # type: ignore[arg-type]
        self.numbers.setdefault(texture_key(self._textures[key]), info["index"])
        return self._textures[key]

    def _wrap(self, entry: dict[str, Any], name: str, unshown: Unshown) -> str:
        sampler = self._document.item("samplers", entry["sampler"]) if "sampler" in entry else {}
        across, down = sampler.get("wrapS", _REPEAT), sampler.get("wrapT", _REPEAT)
        if _MIRRORED in (across, down) or across != down:
            unshown.add("Textures are repeated where they are to be mirrored, or clamped one way only", name)
            return "repeat"
        return "clamp" if across == _CLAMP else "repeat"

    def _picture(self, index: int) -> tuple[np.ndarray, str | None] | None:
        """Linear picture of an image, and its file if it has one; None for a format that is not understood."""
        if index not in self._pictures:
            entry = self._document.item("images", index)
            uri = entry.get("uri")
            kind = entry.get("mimeType") or (
                uri[5:].partition(";")[0] if uri and uri.startswith("data:") else _FORMATS[0]
            )
            self._pictures[index] = self._decoded(entry, index) if kind in _FORMATS else None
        return self._pictures[index]

    def _decoded(self, entry: dict[str, Any], index: int) -> tuple[np.ndarray, str | None]:
        uri, what = entry.get("uri"), f"images[{index}]"
        source = None
        if uri is None:
            data = self._document.view_bytes(entry.get("bufferView"))
        else:
            data = self._document.resource(uri, what)
            if not uri.startswith("data:"):
                source = str((self._document.path.parent / unquote(uri)).resolve())
        rgb, notes = decode_8bit(data, f"{self._document.path.name}: {what}")
        self._notes += notes
        return frozen(rgb), source


class TextureWriter:
    """Puts textures into a document's JSON; one that it holds already is used again."""

    def __init__(self, new: Additions, known: dict[str, int]) -> None:
        self._new, self._numbers = new, dict(known)

    def number(self, texture: Texture) -> int:
        """Number of a glTF texture with this picture and wrap."""
        key = texture_key(texture)
        if key not in self._numbers:
            data, kind = _file_of(texture)
            image = self._new.append("images", {"bufferView": self._new.view(data), "mimeType": kind})
            wrap = _CLAMP if texture.wrap == "clamp" else _REPEAT
            sampler = self._new.append("samplers", {"wrapS": wrap, "wrapT": wrap})
            self._numbers[key] = self._new.append("textures", {"source": image, "sampler": sampler})
        return self._numbers[key]


def turned_over(uv: np.ndarray) -> np.ndarray:
    """Texture coordinates (…, 2) whose v runs the other way, from glTF's to ours or back; exact for float32 in [0,
    1]."""
    return np.stack([uv[..., 0], 1.0 - uv[..., 1]], axis=-1)


def texture_key(texture: Texture) -> str:
    """The same only for textures of the same content."""
    return f"{picture_name(texture.rgb)} {texture.wrap}"


def _file_of(texture: Texture) -> tuple[bytes, str]:
    """A PNG or JPEG file of the texture and its media type: its own file as it is, else a PNG of 8 bits, rounded."""
    kinds = {".png": _FORMATS[0], ".jpg": _FORMATS[1], ".jpeg": _FORMATS[1]}
    path = Path(texture.source or "")
    if path.suffix.lower() in kinds and path.is_file():
        return path.read_bytes(), kinds[path.suffix.lower()]
    return png_bytes(nearest_levels(texture.rgb)), _FORMATS[0]
