"""A glTF 2.0 file as its JSON and its bytes: containers, buffers and accessors, nothing about scenes.

The JSON stays the dictionary it was, so that saving keeps what this program does not
understand. Every length a file states is held against the bytes it has before use.
"""

from __future__ import annotations

import base64
import binascii
import json
import os
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any
from urllib.parse import unquote

import numpy as np

from ...base import files
from ...base.errors import UserError
from ..geometry.mesh_health import welded_corners

GLB_MAGIC = b"glTF"
JSON_CHUNK, BIN_CHUNK = 0x4E4F534A, 0x004E4942
MAX_ELEMENTS = 100_000_000
"""Most elements of all accessors that are read together; many may show the same bytes."""
MAX_UNSTORED = 1_000_000
"""Most elements of an accessor of zeros, for which the file holds no bytes."""

_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


@dataclass
class GltfDocument:
    """An opened file."""

    path: Path
    json: dict[str, Any]
    binary: bytes | None = None
    """The BIN chunk of a GLB."""
    other_chunks: list[tuple[int, bytes]] = field(default_factory=list)
    """GLB chunks of unknown type, kept for saving."""
    _buffers: dict[int, bytes] = field(default_factory=dict)
    _unpacked: dict[int, bytes] = field(default_factory=dict)
    _checked: dict[str, list] = field(default_factory=dict)
    _elements_read: int = 0

    def fail(self, message: str) -> UserError:
        """The one sentence about this file."""
        return UserError(f"{self.path.name}: {message}")

    def items(self, key: str) -> list[dict[str, Any]]:
        """A top-level array such as "nodes"; empty when absent."""
        values = self.json.get(key, [])
        if values is not self._checked.get(key):  # once: a file may have tens of thousands
            if not isinstance(values, list) or not all(isinstance(v, dict) for v in values):
                raise self.fail(f"'{key}' must be an array of objects; export the file again")
            self._checked[key] = values
        return values

    def item(self, key: str, index: Any) -> dict[str, Any]:
        """Entry `index` of a top-level array."""
        values = self.items(key)
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(values):
            raise self.fail(f"refers to {key}[{index}], but there are {len(values)}; export the file again")
        return values[index]

    def accessor(self, index: Any) -> np.ndarray:
        """Elements of an accessor, (count,) or (count, width): ints as stored, normalised ones as float64."""
        accessor = self.item("accessors", index)
        label = f"accessors[{index}]"
        kind, component, count = accessor.get("type"), accessor.get("componentType"), accessor.get("count")
        if kind not in _WIDTHS or component not in _COMPONENTS:
            raise self.fail(f"{label} has an unknown type; export the file again")
        if not isinstance(count, int) or not 0 < count <= MAX_ELEMENTS:
            raise self.fail(f"{label}.count must be from 1 to {MAX_ELEMENTS}, not {count}; export the file again")
        self._elements_read += count
        if self._elements_read > MAX_ELEMENTS:
            raise self.fail(f"its accessors hold more than {MAX_ELEMENTS} elements together; export a simpler scene")
        dtype, width = np.dtype(_COMPONENTS[component]), _WIDTHS[kind]
        if "bufferView" in accessor:
            values = self._view(label, accessor["bufferView"], accessor.get("byteOffset", 0), dtype, width, count)
        elif count > MAX_UNSTORED:
            raise self.fail(f"{label} promises {count} elements that no buffer holds; export the file again")
        else:
            values = np.zeros((count, width), dtype)
        if "sparse" in accessor:
            values = self._with_sparse(label, accessor["sparse"], values, dtype, width)
        if accessor.get("normalized") and dtype.kind in "iu":
            values = np.maximum(values.astype(np.float64) / np.iinfo(dtype).max, -1.0)
        return values[:, 0] if width == 1 else values

    def _with_sparse(
        self, label: str, sparse: dict[str, Any], values: np.ndarray, dtype: np.dtype, width: int
    ) -> np.ndarray:
        count, indices, data = sparse["count"], sparse["indices"], sparse["values"]
        index_type = np.dtype(_COMPONENTS[indices["componentType"]])
        where = self._view(label, indices["bufferView"], indices.get("byteOffset", 0), index_type, 1, count)[:, 0]
        if count and int(where.max()) >= len(values):
            raise self.fail(f"{label}.sparse names element {int(where.max())} of {len(values)}; export the file again")
        values = values.copy()
        values[where] = self._view(label, data["bufferView"], data.get("byteOffset", 0), dtype, width, count)
        return values

    def _view(self, label: str, index: Any, offset: int, dtype: np.dtype, width: int, count: int) -> np.ndarray:
        view = self.item("bufferViews", index)
        how = meshopt_of(view)
        if how is not None and meshopt_of(self.item("buffers", view.get("buffer"))) is None:
            how = None  # its buffer is no placeholder: the bytes are there uncompressed too
        data = self.buffer(view.get("buffer")) if how is None else self._decompressed(index, how)
        start, length = view.get("byteOffset", 0) if how is None else 0, view.get("byteLength", -1)
        stride = view.get("byteStride") or width * dtype.itemsize
        numbers = (start, length, stride, offset, count)
        if not all(isinstance(n, int) and n >= 0 for n in numbers) or stride < width * dtype.itemsize:
            raise self.fail(f"bufferViews[{index}] is not valid; export the file again")
        if start + length > len(data):
            raise self.fail(
                f"bufferViews[{index}] ends at byte {start + length}, but its buffer has {len(data)}; "
                f"the file is truncated, copy or export it again"
            )
        if count and offset + (count - 1) * stride + width * dtype.itemsize > length:
            raise self.fail(
                f"{label} promises {count} elements, more than bufferViews[{index}] holds; export the file again"
            )
        return np.ndarray((count, width), dtype, data, start + offset, (stride, dtype.itemsize))

    def _decompressed(self, index: int, how: dict[str, Any]) -> bytes:
        if index not in self._unpacked:
            start = int(how.get("byteOffset", 0))
            data = self.buffer(how.get("buffer"))[start : start + int(how["byteLength"])]
            self._unpacked[index] = meshopt_bytes(how, data, f"{self.path.name}: bufferViews[{index}]")
        return self._unpacked[index]

    def view_bytes(self, index: Any) -> bytes:
        """All bytes of a buffer view, such as an image's file."""
        length = self.item("bufferViews", index).get("byteLength")
        if not isinstance(length, int) or length < 1:
            raise self.fail(f"bufferViews[{index}] is not valid; export the file again")
        return self._view(f"bufferViews[{index}]", index, 0, np.dtype("u1"), length, 1).tobytes()

    def buffer(self, index: Any) -> bytes:
        """Bytes of a buffer: the BIN chunk, a data URI, or a file next to this one."""
        entry = self.item("buffers", index)
        if index not in self._buffers:
            uri = entry.get("uri")
            if uri is None:
                if index != 0 or self.binary is None:
                    raise self.fail(f"buffers[{index}] has neither a uri nor a binary chunk; the file is truncated")
                data = self.binary
            else:
                data = self.resource(uri, f"buffers[{index}]")
            if len(data) < entry.get("byteLength", 0):
                raise self.fail(
                    f"buffers[{index}] promises {entry['byteLength']} bytes, but has {len(data)}; "
                    f"the file is truncated, copy or export it again"
                )
            self._buffers[index] = data
        return self._buffers[index]

    def set_buffer(self, index: int, data: bytes) -> None:
        """Replace a buffer's bytes, for saving."""
        self._buffers[index] = data

    def resource(self, uri: str, what: str) -> bytes:
        """Content of a data URI or of a file relative to this one."""
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except (binascii.Error, ValueError):
                raise self.fail(f"the data URI of {what} is not base64; export the file again") from None
        if "://" in uri:
            raise self.fail(f"{what} lies at '{uri[:60]}'; download it and refer to a file beside this one")
        target = self.path.parent / unquote(uri)
        if not files.may_read(target, self.path.parent):
            raise self.fail(f"{what} names {target}, which {files.OUTSIDE}")
        try:
            return files.read_bytes(target, files.DATA_BYTES)
        except OSError as error:
            raise self.fail(f"{what} needs {target}, which cannot be read ({error.strerror}); copy it there") from None


class Additions:
    """What is put into a document: entries of its top-level arrays, and bytes at the end of one buffer."""

    def __init__(self, json: dict[str, Any], buffer: int) -> None:
        """`buffer`: number of the buffer that will hold `data`."""
        self._json, self._buffer = json, buffer
        self.data = bytearray()

    def append(self, key: str, entry: dict[str, Any]) -> int:
        """Number of a new entry of a top-level array."""
        values = self._json.setdefault(key, [])
        values.append(entry)
        return len(values) - 1

    def view(self, data: bytes, **more: int) -> int:
        """Number of a new buffer view that holds `data`."""
        self.data += b"\0" * (-len(self.data) % 4)
        view = {"buffer": self._buffer, "byteOffset": len(self.data), "byteLength": len(data)} | more
        self.data += data
        return self.append("bufferViews", view)

    def primitive(self, corners: np.ndarray, normals: np.ndarray | None, uv: np.ndarray | None) -> dict[str, Any]:
        """Attributes and indices of triangles (T, 3, 3), whose corners are one vertex where float32 cannot tell them
        apart; `uv` runs down, as in glTF."""
        given = {"POSITION": corners, "NORMAL": normals, "TEXCOORD_0": uv}
        columns = {name: each.astype("<f4") for name, each in given.items() if each is not None}
        vertices, triangles = welded_corners([*columns.values()])
        attributes = {
            name: self._accessor(values, f"VEC{values.shape[1]}", bounds=name == "POSITION")
            for name, values in zip(columns, vertices, strict=True)
        }
        return {"attributes": attributes, "indices": self._accessor(triangles.astype("<u4").reshape(-1, 1), "SCALAR")}

    def _accessor(self, values: np.ndarray, kind: str, bounds: bool = False) -> int:
        is_index = values.dtype.kind == "u"
        view = self.view(np.ascontiguousarray(values).tobytes(), target=34963 if is_index else 34962)
        entry: dict[str, Any] = {"bufferView": view, "componentType": 5125 if is_index else 5126}
        entry |= {"count": len(values), "type": kind}
        if bounds:
            entry |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self.append("accessors", entry)


def open_document(path: str | os.PathLike[str]) -> GltfDocument:
    """Open a .glb or .gltf. Raises UserError for anything that is not a valid glTF 2.0 container."""
    path = Path(path)
    with files.reading(path, "check the path and its permissions"):
        data = files.read_bytes(path, files.DATA_BYTES)
    if data[:4] == GLB_MAGIC:
        document = _open_glb(path, data)
    elif path.suffix.lower() == ".glb":
        raise UserError(
            f"{path.name}: not a GLB file (it does not begin with 'glTF'); check the suffix or export it again"
        )
    else:
        document = GltfDocument(path, _parsed(path, data))
    asset = document.json.get("asset")
    version = str(asset.get("version", "")) if isinstance(asset, dict) else ""
    if not version.startswith("2."):
        raise document.fail(f"glTF version '{version}' is not supported; export it as glTF 2.0")
    return document


def _open_glb(path: Path, data: bytes) -> GltfDocument:
    def refuse(message: str) -> UserError:
        return UserError(f"{path.name}: {message}; the file is truncated or damaged, copy or export it again")

    if len(data) < 20:
        raise refuse(f"{len(data)} bytes are too few for a GLB file")
    version, length = np.frombuffer(data, "<u4", 2, 4).tolist()
    if version != 2:
        raise UserError(f"{path.name}: GLB version {version} is not supported; export it as glTF 2.0")
    if length != len(data):
        raise refuse(f"the GLB header promises {length} bytes, but the file has {len(data)}")
    chunks: list[tuple[int, bytes]] = []
    at = 12
    while at < length:
        if at + 8 > length:
            raise refuse("a chunk header is cut off")
        size, kind = np.frombuffer(data, "<u4", 2, at).tolist()
        if at + 8 + size > length:
            raise refuse(f"a chunk promises {size} bytes, but {length - at - 8} are left")
        chunks.append((kind, data[at + 8 : at + 8 + size]))
        at += 8 + size
    if not chunks or chunks[0][0] != JSON_CHUNK:
        raise refuse("the first chunk is not JSON")
    has_binary = len(chunks) > 1 and chunks[1][0] == BIN_CHUNK
    binary = chunks[1][1] if has_binary else None
    return GltfDocument(path, _parsed(path, chunks[0][1]), binary, chunks[2 if has_binary else 1 :])


def _parsed(path: Path, data: bytes) -> dict[str, Any]:
    try:
        values = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        reason = str(error).partition("\n")[0][:80]
        raise UserError(f"{path.name}: its JSON is not valid ({reason}); copy or export the file again") from None
    if not isinstance(values, dict):
        raise UserError(f"{path.name}: its JSON is not an object; this is not a glTF file")
    return values


def save_document(document: GltfDocument, path: str | os.PathLike[str]) -> None:
    """Write .glb or .gltf by the suffix of `path`, atomically, with every buffer embedded that something refers to.

    A file that nothing refers to stays what it is: a name.
    """
    from ...base.atomic import atomic_output

    with atomic_output(path) as temporary:
        write_document(document, Path(path), temporary)


def write_document(document: GltfDocument, path: Path, into: Path) -> None:
    """As `save_document`, into a file that the caller got from `atomic_outputs` and that becomes `path`."""
    as_glb = path.suffix.lower() == ".glb"
    content = dict(document.json)
    content["buffers"] = buffers = []
    binary = b""
    used = _used_buffers(document)
    for index, entry in enumerate(document.items("buffers")):
        if index not in used and is_file_name(entry.get("uri")):
            buffers.append(entry)
            continue
        data = document.buffer(index)
        kept = {k: v for k, v in entry.items() if k not in ("uri", "byteLength")} | {"byteLength": len(data)}
        if as_glb and index == 0:
            binary = data
        else:
            kept["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
        buffers.append(kept)
    if not buffers:
        del content["buffers"]
    if path.parent.resolve() != document.path.parent.resolve():
        content = _with_embedded_images(document, content)
    text = json.dumps(
        content, ensure_ascii=False, separators=(",", ":") if as_glb else None, indent=None if as_glb else 1
    )
    into.write_bytes(_glb(text.encode(), binary, document.other_chunks) if as_glb else text.encode())


def is_file_name(uri: Any) -> bool:
    """Whether a uri names a file next to the document (neither data nor something on the net)."""
    return isinstance(uri, str) and not uri.startswith("data:") and "://" not in uri


def _used_buffers(document: GltfDocument) -> set[int]:
    """Buffers that meshes, skins, animations, shown images and extensions refer to."""
    accessors: set[int] = set()
    for key, names in (("meshes", _ACCESSORS_OF_MESHES), ("skins", ("inverseBindMatrices",))):
        accessors |= _numbers_at(document.json.get(key), names)
    accessors |= _numbers_at(document.json.get("animations"), ("input", "output"))
    holders: list[Any] = [document.items("accessors")[i] for i in accessors if i < len(document.items("accessors"))]
    shown = _shown_images(document)
    holders += [image for i, image in enumerate(document.items("images")) if i in shown]
    holders += [document.json.get("meshes"), document.json.get("extensions")]  # compressed ones name views themselves
    views = document.items("bufferViews")
    used = [views[i] for i in _numbers_at(holders, ("bufferView",)) if i < len(views)]
    return _numbers_at(used, ("buffer",))  # also a second one, of EXT_meshopt_compression


def _shown_images(document: GltfDocument) -> set[int]:
    """Images that textures, or lights made of pictures (EXT_lights_image_based), refer to."""
    holders = [document.json.get("textures"), document.json.get("extensions")]
    return _numbers_at(holders, ("source", "specularImages"))


_ACCESSORS_OF_MESHES = ("attributes", "indices", "targets")


def _numbers_at(values: Any, names: tuple[str, ...]) -> set[int]:
    """All whole numbers below the keys `names`, at any depth."""
    found: set[int] = set()
    waiting = [(values, False)]
    while waiting:
        value, counts = waiting.pop()
        if isinstance(value, dict):
            waiting += [(each, counts or key in names) for key, each in value.items()]
        elif isinstance(value, list):
            waiting += [(each, counts) for each in value]
        elif counts and type(value) is int and value >= 0:
            found.add(value)
    return found


def _with_embedded_images(document: GltfDocument, content: dict[str, Any]) -> dict[str, Any]:
    """Images embedded whose files would not be found from the new place; only those that are pictures."""
    images = [dict(image) for image in document.items("images")]
    shown = _shown_images(document)
    for index, image in enumerate(images):
        if index not in shown or not is_file_name(image.get("uri")):
            continue
        data = document.resource(image["uri"], f"images[{index}]")
        kind = next((kind for start, kind in _IMAGES.items() if data.startswith(start)), None)
        if kind is not None:
            image["uri"] = f"data:{image.get('mimeType', kind)};base64," + base64.b64encode(data).decode()
    return content | ({"images": images} if images else {})


_IMAGES = {
    b"\x89PNG": "image/png",
    b"\xff\xd8\xff": "image/jpeg",
    b"RIFF": "image/webp",
    b"\xabKTX 20": "image/ktx2",
    b"DDS ": "image/vnd-ms.dds",
}
"""How files of pictures begin."""


def _glb(text: bytes, binary: bytes, others: list[tuple[int, bytes]]) -> bytes:
    chunks = [(JSON_CHUNK, text + b" " * (-len(text) % 4))]
    if binary:
        chunks.append((BIN_CHUNK, binary + b"\0" * (-len(binary) % 4)))
    body = b"".join(np.array([len(d), kind], "<u4").tobytes() + d for kind, d in chunks + others)
    return GLB_MAGIC + np.array([2, 12 + len(body)], "<u4").tobytes() + body


DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
COMPRESSION = frozenset({DRACO, *MESHOPT})


def decoder(package: str, method: str, where: str) -> ModuleType:
    """The package that reads a method of compression. Raises UserError where it is not installed."""
    try:
        return import_module(package)
    except ImportError:
        raise UserError(
            f"{where} is compressed by {method}, and the package that reads it is not installed: run pip install "
            "'.[gltf]' in the program's checkout, or export the file without compression"
        ) from None


def meshopt_of(view: dict[str, Any]) -> dict[str, Any] | None:
    """How a buffer view's bytes are compressed, or None."""
    extensions = view.get("extensions", {})
    return next((extensions[name] for name in MESHOPT if name in extensions), None)


def meshopt_bytes(how: dict[str, Any], data: bytes, where: str) -> bytes:
    """The elements, `count` of `byteStride` bytes, that `data` hold. Raises UserError for damaged ones."""
    package = decoder("meshoptimizer", "meshoptimizer", where)
    count, stride = int(how["count"]), int(how["byteStride"])
    if not 0 < count * stride <= MAX_ELEMENTS:
        raise UserError(f"{where} promises {count} elements of {stride} bytes; export the file again")
    try:
        decode = {
            "ATTRIBUTES": package.decode_vertex_buffer,
            "TRIANGLES": package.decode_index_buffer,
            "INDICES": package.decode_index_sequence,
        }[how["mode"]]
        found = np.frombuffer(bytearray(decode(count, stride, data).tobytes()[: count * stride]), np.uint8)
        turn = {
            "OCTAHEDRAL": package.decode_filter_oct,
            "QUATERNION": package.decode_filter_quat,
            "EXPONENTIAL": package.decode_filter_exp,
        }.get(how.get("filter", "NONE"))
        if turn is not None:
            turn(found, count, stride)
    except (KeyError, ValueError, RuntimeError) as error:
        raise UserError(f"{where}: its meshoptimizer data cannot be read ({error}); export the file again") from error
    return found.tobytes()


def draco_mesh(how: dict[str, Any], data: bytes, where: str) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Attributes by name, float64 (V, N), and the vertex numbers of all corners, (3 T,). Raises UserError for damaged
    data."""
    package = decoder("DracoPy", "Draco", where)
    try:
        mesh = package.decode(data)
        arrays = {
            name: np.asarray(mesh.get_attribute_by_unique_id(number)["data"], np.float64)
            for name, number in how["attributes"].items()
        }
        return arrays, np.asarray(mesh.faces, np.int64).ravel()
    except (KeyError, TypeError, ValueError, RuntimeError, AttributeError, package.FileTypeException) as error:
        raise UserError(f"{where}: its Draco data cannot be read ({error}); export the file again") from error
