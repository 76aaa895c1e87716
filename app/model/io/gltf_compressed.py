"""Compressed meshes of glTF: Draco (KHR_draco_mesh_compression) and meshoptimizer (EXT_meshopt_compression).

Both decoders are packages of the extra "gltf"; without them a file that needs one is refused in a sentence.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

from ...base.errors import UserError

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
COMPRESSION = frozenset({DRACO, *MESHOPT})
_MOST_ELEMENTS = 100_000_000


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
    if not 0 < count * stride <= _MOST_ELEMENTS:
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
