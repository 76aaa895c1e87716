"""Wavefront OBJ: positions, texture coordinates, normals and polygons, and what they belong to; everything else is
passed over.

Almost every file writes all its faces in one form with positive numbers; that form is read
in bulk. Any other, and any mistake, goes line by line, so that a sentence can name the line.
"""

from __future__ import annotations

import numpy as np

from ...base.errors import UserError
from .mesh_raw import Groups, RawMesh, triangles_of

_POSITION, _TEXTURE, _NORMAL = range(3)
_LARGEST = 1 << 40
"""Number of a vertex that no file can hold."""
_WIDTHS = {"v": 3, "vt": 2, "vn": 3}
_STATEMENTS = (*_WIDTHS, "f", "o", "g", "usemtl", "mtllib")


def read_obj(data: bytes, path: str) -> RawMesh:
    """The file's triangles, all in one; `groups` says which object, group and material each belongs to."""
    lines = data.decode("utf-8", "replace").replace("\\\r\n", " ").replace("\\\n", " ").split("\n")
    kinds: dict[str, list[tuple[int, str]]] = {word: [] for word in _STATEMENTS}
    for number, line in enumerate(lines, start=1):
        word, _, rest = line.strip().replace("\t", " ").partition(" ")
        if word in kinds:
            kinds[word].append((number, rest.partition("#")[0]))
    tables = [_numbers(kinds[word], width, path) for word, width in _WIDTHS.items()]
    if not kinds["v"]:
        raise UserError(f"{path}: the OBJ file has no vertices; check that it is a mesh")
    if not kinds["f"]:
        raise UserError(f"{path}: the OBJ file has no faces; a point cloud cannot be rendered")
    sizes, corners = _uniform_faces([rest for _, rest in kinds["f"]]) or _faces(kinds, path)
    # Numbers are from 1 here; 0 means left out (texture, normal).
    for column, (table, what) in enumerate(zip(tables, ("vertex", "texture coordinate", "normal"), strict=True)):
        low = 1 if column == _POSITION else 0
        wrong = (corners[:, column] > len(table)) | (corners[:, column] < low)
        if wrong.any():
            face = int(np.searchsorted(np.cumsum(sizes), np.argmax(wrong), side="right"))
            raise UserError(
                f"{path}: line {kinds['f'][face][0]}: the face names {what} {corners[np.argmax(wrong), column]}, "
                f"but the file has {len(table)} (numbered from 1); export the mesh again"
            )
    triangles = triangles_of(sizes, tables[_POSITION][corners[:, _POSITION] - 1])
    picked = corners[triangles] - 1
    return RawMesh(
        tables[_POSITION],
        picked[..., _POSITION],
        _looked_up(tables[_NORMAL], picked[..., _NORMAL]),
        _looked_up(tables[_TEXTURE], picked[..., _TEXTURE]),
        _groups(kinds, np.maximum(sizes - 2, 0)),
    )


def _groups(kinds: dict[str, list[tuple[int, str]]], triangles: np.ndarray) -> Groups:
    """What each face, of so many `triangles`, belongs to: its object, or its group where there is only one object,
    and its material."""
    lines = np.array([number for number, _ in kinds["f"]])

    def last_above(word: str) -> tuple[np.ndarray, list[str]]:
        """For each face the last such statement above it, 0 for none, and their texts."""
        texts = ["", *(" ".join(rest.split()) for _, rest in kinds[word])]
        distinct = {text: i for i, text in enumerate(dict.fromkeys(texts))}
        place = np.searchsorted(np.array([number for number, _ in kinds[word]], np.int64), lines)
        return np.array([distinct[text] for text in texts])[place], list(distinct)

    (objects, object_names), (groups, group_names) = last_above("o"), last_above("g")
    by_object = len(np.unique(objects)) > 1
    which, names = (objects, object_names) if by_object else (groups, group_names)
    materials, material_names = last_above("usemtl")
    pairs, of_face = np.unique(np.stack([which, materials], axis=1), axis=0, return_inverse=True)
    return Groups(
        np.repeat(of_face.reshape(-1), triangles),
        tuple(names[i] or object_names[objects[0]] for i in pairs[:, 0]),
        tuple(material_names[i] or None for i in pairs[:, 1]),
        tuple(dict.fromkeys(name for _, rest in kinds["mtllib"] for name in [rest.strip()] if name)),
    )


def _looked_up(table: np.ndarray, index: np.ndarray) -> np.ndarray | None:
    """Values at corners; zeros where a corner names none, None when no corner does."""
    if not len(table) or (index < 0).all():
        return None
    return np.where((index >= 0)[..., None], table[index], 0.0)


def _numbers(rows: list[tuple[int, str]], width: int, path: str) -> np.ndarray:
    """The first `width` numbers of each row, float64 (N, width); a `vt` may have one only."""
    if not rows:
        return np.zeros((0, width))
    words = [rest.split() for _, rest in rows]
    try:
        if min(map(len, words)) >= width:
            flat = [w for row in words for w in row[:width]]
            return np.array(flat, dtype=np.float64).reshape(-1, width)
        if width == 2 and min(map(len, words)) == 1:
            return np.array([(*row, "0")[:2] for row in words], dtype=np.float64)
    except ValueError:
        pass
    for (number, _), row in zip(rows, words, strict=True):
        try:
            if len(list(map(float, row[:width]))) >= width:
                continue
        except ValueError:
            pass
        raise UserError(f"{path}: line {number}: expected {width} numbers; export the mesh again")
    raise UserError(f"{path}: the OBJ file's numbers cannot be read; export the mesh again")


def _uniform_faces(rows: list[str]) -> tuple[np.ndarray, np.ndarray] | None:
    """Polygon sizes (F,) and corner numbers (N, 3) when all faces have one size and one form, else None."""
    sample = rows[0].split()
    if not sample:
        return None
    size, parts = len(sample), sample[0].split("/")
    text = " ".join(rows)
    if "-" in text or text.count("/") != len(rows) * size * (len(parts) - 1):
        return None
    columns: tuple[int, ...] = tuple(range(len(parts)))
    if len(parts) == 3 and parts[1] == "":
        text, columns = text.replace("//", " "), (_POSITION, _NORMAL)
        if "/" in text:
            return None
    elif "//" in text:
        return None
    else:
        text = text.replace("/", " ")
    try:
        values = np.array(text.split(), dtype=np.int64)
    except (ValueError, OverflowError):
        return None
    if values.size != len(rows) * size * len(columns) or any(len(row.split()) != size for row in rows):
        return None
    corners = np.zeros((len(rows) * size, 3), dtype=np.int64)
    corners[:, columns] = values.reshape(-1, len(columns))
    return np.full(len(rows), size), corners


def _faces(kinds: dict[str, list[tuple[int, str]]], path: str) -> tuple[np.ndarray, np.ndarray]:
    """As `_uniform_faces`, line by line: mixed polygons, relative (negative) numbers, mistakes."""
    defined = [np.array([number for number, _ in kinds[word]]) for word in _WIDTHS]
    sizes, corners = [], []
    for number, rest in kinds["f"]:
        words = rest.split()
        sizes.append(len(words))
        for word in words:
            corner = [0, 0, 0]
            try:
                for column, part in enumerate(word.split("/")):
                    corner[column] = int(part) if part or column == _POSITION else 0
                    if abs(corner[column]) > _LARGEST:
                        raise ValueError
            except (ValueError, IndexError):
                raise UserError(f"{path}: line {number} holds what is no face corner; export the mesh again") from None
            for column, index in enumerate(corner):
                if index < 0:  # counts back from the last one defined so far
                    corner[column] = max(index + 1 + int(np.searchsorted(defined[column], number)), -1)
            corners.append(corner)
    return np.array(sizes), np.array(corners, dtype=np.int64).reshape(-1, 3)
