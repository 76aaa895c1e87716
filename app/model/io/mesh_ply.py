"""PLY, ASCII and binary, of either byte order (G. Turk, The PLY Polygon File Format, 1994).

The header is a promise about what follows; it is held against the file's size before
anything is allocated, and against its content while reading.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...base.errors import UserError
from .mesh_raw import RawMesh, as_float64, triangles_of

_TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
_NUMBER = "f8"
_LARGEST = 1 << 40
"""Number of a vertex, or length of a list, that no file can have."""
_FACE_LISTS = ("vertex_indices", "vertex_index")
_UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))


@dataclass
class _Property:
    name: str
    kind: str
    count_kind: str | None = None
    """Type of the count before a list; None for a scalar."""


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


def read_ply(data: bytes, path: str) -> RawMesh:
    """Vertices, triangles and, where the file has them, normals and texture coordinates."""
    order, elements, body = _header(data, path)
    if not order:
        # Words become numbers of one kind: then it is a binary file.
        for p in (p for element in elements for p in element.properties):
            p.kind, p.count_kind = _NUMBER, p.count_kind and _NUMBER
        try:
            data = np.array(data[body:].split(), dtype=f"<{_NUMBER}").tobytes()
        except ValueError:
            raise UserError(f"{path}: the PLY body holds something that is no number; export the mesh again") from None
    reader = _Body(data, body, order, path) if order else _Body(data, 0, "<", path)
    vertex = face = None
    for element in elements:
        if not element.properties:
            continue  # takes no place, whatever its number
        columns = reader.element(element)
        if element.name == "vertex":
            vertex = columns
        elif element.name == "face":
            face = columns
    reader.finish(*(("bytes", 1) if order else ("numbers", np.dtype(_NUMBER).itemsize)))
    if vertex is None or any(axis not in vertex for axis in "xyz"):
        raise UserError(f"{path}: the PLY header has no vertices with x, y, z; export the mesh again")
    corners = next((face[name] for name in _FACE_LISTS if face and name in face), None)
    if corners is None:
        raise UserError(f"{path}: the PLY header has no faces with vertex_indices; a point cloud cannot be rendered")
    sizes, indices = corners
    if not len(sizes):
        raise UserError(f"{path}: the PLY file has no faces; a point cloud cannot be rendered")
    if not (np.abs(indices) < _LARGEST).all():
        raise UserError(f"{path}: a face of the PLY file names no vertex; export the mesh again")
    vertices, indices = _stack(vertex, ("x", "y", "z")), indices.astype(np.int64)
    in_range = bool(((indices >= 0) & (indices < len(vertices))).all())
    triangles = indices[triangles_of(sizes, vertices[indices] if in_range else np.zeros((len(indices), 3)))]

    def at_corners(names: tuple[str, ...]) -> np.ndarray | None:
        # With a face out of range nothing can be looked up; make_mesh says so.
        return _stack(vertex, names)[triangles] if in_range and all(n in vertex for n in names) else None

    uv = next((found for names in _UV_NAMES if (found := at_corners(names)) is not None), None)
    return RawMesh(vertices, triangles, at_corners(("nx", "ny", "nz")), uv)


def _stack(columns: dict[str, np.ndarray], names: tuple[str, ...]) -> np.ndarray:
    return np.stack([as_float64(columns[name]) for name in names], axis=1)


def _header(data: bytes, path: str) -> tuple[str, list[_Element], int]:
    """Byte order ("" = ASCII), the promised elements, and where the body begins."""
    if not data.startswith(b"ply"):
        raise UserError(f"{path}: not a PLY file (it does not begin with 'ply'); check the suffix")
    end = data.find(b"end_header")
    line_end = data.find(b"\n", end)
    if end < 0 or line_end < 0:
        raise UserError(f"{path}: the PLY header has no end_header; the file is truncated, copy or export it again")
    order: str | None = None
    elements: list[_Element] = []
    for number, line in enumerate(data[:end].decode("ascii", "replace").splitlines(), start=1):
        try:
            match line.split():
                case ["format", kind, _]:
                    order = _ORDERS[kind]
                case ["element", name, count]:
                    elements.append(_Element(name, int(count)))
                    if elements[-1].count < 0:
                        raise ValueError
                case ["property", "list", count_kind, kind, name]:
                    elements[-1].properties.append(_Property(name, _TYPES[kind], _TYPES[count_kind]))
                case ["property", kind, name]:
                    elements[-1].properties.append(_Property(name, _TYPES[kind]))
                case ["ply"] | ["comment", *_] | ["obj_info", *_] | []:
                    pass
                case _:
                    raise ValueError
        except (KeyError, ValueError, IndexError):
            raise UserError(f"{path}: line {number} of the PLY header is not valid; export the mesh again") from None
        names = [p.name for p in elements[-1].properties] if elements else []
        if len(set(names)) < len(names):
            raise UserError(
                f"{path}: line {number} of the PLY header names a property a second time; export the mesh again"
            )
    if order is None:
        raise UserError(f"{path}: the PLY header names no format; export the mesh again")
    return order, elements, line_end + 1


Columns = dict[str, Any]
"""By name: an array for a scalar, (sizes, values) for a list."""


class _Body:
    """Elements of a file's body, in order."""

    def __init__(self, data: bytes, at: int, order: str, path: str) -> None:
        self._path, self._data, self._at, self._order = path, data, at, order

    def element(self, element: _Element) -> Columns:
        """The columns of all its rows: at once where all lists are as long as in the first row, as in most files."""
        sizes = self._first_sizes(element)
        layout = np.dtype([part for p in element.properties for part in self._fields(p, sizes.get(p.name, 0))])
        room = (len(self._data) - self._at) // layout.itemsize if layout.itemsize else element.count
        if element.count <= room:
            rows = np.frombuffer(self._data, layout, element.count, self._at)
            if all((rows[f"{name} count"] == size).all() for name, size in sizes.items()):
                self._at += element.count * layout.itemsize
                return {
                    p.name: rows[p.name]
                    if p.count_kind is None
                    else (np.full(element.count, sizes.get(p.name, 0)), rows[p.name].reshape(-1))
                    for p in element.properties
                }
        elif not sizes:
            raise self._truncated(element, room)
        return self._walk(element)

    def finish(self, unit: str, size: int) -> None:
        """Refuse what follows the promised elements: the header lied. `unit`: what of `size` bytes is counted."""
        rest = self._data[self._at :]
        if rest.strip():
            raise UserError(
                f"{self._path}: {len(rest) // size} {unit} follow what the PLY header promises; export the mesh again"
            )

    def _walk(self, element: _Element) -> Columns:
        """Row by row, for lists of differing lengths."""
        sizes: dict[str, list[int]] = {p.name: [] for p in element.properties}
        found: dict[str, list[np.ndarray]] = {p.name: [] for p in element.properties}
        for row in range(element.count):
            for p in element.properties:
                size = self._size(p, element, row)
                sizes[p.name].append(size)
                found[p.name].append(self._take(p.kind, size, element, row))
        columns: Columns = {}
        for p in element.properties:
            values = np.concatenate(found[p.name]) if found[p.name] else np.zeros(0)
            columns[p.name] = values if p.count_kind is None else (np.array(sizes[p.name], np.int64), values)
        return columns

    def _fields(self, p: _Property, size: int) -> list[tuple]:
        if p.count_kind is None:
            return [(p.name, self._order + p.kind)]
        return [(f"{p.name} count", self._order + p.count_kind), (p.name, self._order + p.kind, (size,))]

    def _first_sizes(self, element: _Element) -> dict[str, int]:
        """Lengths of the lists in the first row."""
        begin = self._at
        sizes = {}
        for p in element.properties if element.count else []:
            size = self._size(p, element, 0)
            if p.count_kind is not None:
                sizes[p.name] = size
            self._take(p.kind, size, element, 0)
        self._at = begin
        return sizes

    def _size(self, p: _Property, element: _Element, row: int) -> int:
        """How many values of a property follow: the count before a list, read; what is none is longer than any file."""
        if p.count_kind is None:
            return 1
        count = float(self._take(p.count_kind, 1, element, row)[0])
        return max(0, int(count)) if abs(count) < _LARGEST else _LARGEST

    def _take(self, kind: str, count: int, element: _Element, row: int) -> np.ndarray:
        end = self._at + count * np.dtype(kind).itemsize
        if end > len(self._data):
            raise self._truncated(element, row)
        values = np.frombuffer(self._data, self._order + kind, count, self._at)
        self._at = end
        return values

    def _truncated(self, element: _Element, held: int) -> UserError:
        what = f"of '{element.name}'" if element.name in ("vertex", "face") else "of something else"
        return UserError(
            f"{self._path}: the header promises {element.count} {what}, but the file ends after {held}; copy or export "
            "it again"
        )
