"""OpenEXR pictures of other programs: which of their layers is the picture, and in which colours.

Layers are channels with a common name before the last dot, in one part or in several ("ViewLayer.Combined.R").
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .errors import UserError
from .primaries import XYZ, to_rec709

MAX_VALUES = 1 << 28
"""Of all channels of all parts; 1 GB as float32."""
_USUAL = ("combined", "composite", "rgba", "rgb", "beauty", "color", "colour", "image")
"""What programs call the layer that is the finished picture."""


@dataclass(frozen=True)
class ExrPicture:
    """One layer, and what belongs to it."""

    rgb: np.ndarray
    """float32 (H, W, 3), linear Rec.709."""
    others: dict[str, np.ndarray]
    """float32 (H, W): the rest of the part's channels, by name."""
    texts: dict[str, str]
    notes: tuple[str, ...]
    is_converted: bool
    """Colours came from other primaries, so that some may lie outside of Rec.709."""


@dataclass(frozen=True)
class _Layer:
    name: str
    part: int
    channels: tuple[str, ...]
    """Red, green and blue, X, Y and Z, or luminance alone."""
    is_xyz: bool = False


def read_exr_layer(path: Path, wanted: str, max_pixels: int) -> ExrPicture:
    """The layer `wanted`, or the one that is the picture ("").

    Raises UserError, which lists the layers, where that is open, and ValueError, RuntimeError and the like for a
    damaged file.
    """
    import OpenEXR

    with _silent(), OpenEXR.File(str(path), header_only=True) as file:
        headers = [dict(part.header) for part in file.parts]
        names = [str(part.name() or "") for part in file.parts]
    values = 0
    for header in headers:
        for window in ("dataWindow", "displayWindow"):
            width, height = (int(side) for side in _size(header[window]))
            if width * height > max_pixels:
                raise ValueError(f"{width} × {height} pixels are more than {max_pixels >> 20} million")
        values += width * height * len(header["channels"])
    if values > MAX_VALUES:
        raise ValueError("its layers together are too large; export the picture alone")
    layers = [layer for i, header in enumerate(headers) for layer in _layers(i, names[i], header)]
    layer, notes = _chosen(path, layers, wanted, headers)
    with _silent(), OpenEXR.File(str(path), separate_channels=True) as file:
        # Copies: what the file hands out dies with it.
        pixels = {name: np.array(c.pixels, np.float32) for name, c in file.channels(layer.part).items()}
    header = headers[layer.part]
    rgb = np.stack([pixels.pop(name) for name in layer.channels], axis=-1)
    rgb, framed = _framed(np.broadcast_to(rgb, (*rgb.shape[:2], 3)), header)
    chromaticities = XYZ if layer.is_xyz else header.get("chromaticities")
    matrix = None if chromaticities is None else to_rec709(tuple(chromaticities))
    if matrix is not None:
        with np.errstate(over="ignore", invalid="ignore"):
            rgb = (rgb @ matrix.T).astype(np.float32)
    said = [
        *notes,
        *(["is cropped; black was put where it lacks pixels"] if framed else []),
        *(["has primaries of its own; its colours were converted to Rec.709"] if matrix is not None else []),
        *(["holds luminance only and is shown in grey"] if len(layer.channels) == 1 else []),
        *_luminance_of_white(header),
    ]
    texts = {key: value for key, value in header.items() if isinstance(value, str)}
    return ExrPicture(rgb, pixels, texts, tuple(f"{path.name} {note}." for note in said), matrix is not None)


def _layers(part: int, part_name: str, header: dict[str, Any]) -> Iterator[_Layer]:
    groups: dict[str, dict[str, str]] = {}
    for channel in header["channels"]:
        prefix, _, last = channel.name.rpartition(".")
        groups.setdefault(prefix, {})[last.upper()] = channel.name
    for prefix, group in groups.items():
        name = prefix if not part_name or prefix.startswith(part_name) else f"{part_name}.{prefix}".rstrip(".")
        if {"R", "G", "B"} <= group.keys():
            yield _Layer(name, part, tuple(group[c] for c in "RGB"))
        elif {"X", "Y", "Z"} <= group.keys():
            if not prefix:  # a named one holds positions or normals
                yield _Layer(name, part, tuple(group[c] for c in "XYZ"), is_xyz=True)
        elif "Y" in group:
            yield _Layer(name, part, (group["Y"],))


def _chosen(
    path: Path, layers: list[_Layer], wanted: str, headers: list[dict[str, Any]]
) -> tuple[_Layer, tuple[str, ...]]:
    key = wanted.casefold()
    coloured = [layer for layer in layers if len(layer.channels) == 3] or layers
    if wanted:
        found = [layer for layer in layers if layer.name.casefold() == key]
        found = found or [layer for layer in layers if layer.name.casefold().endswith(f".{key}")]
    else:
        unnamed = [layer for layer in coloured if not layer.name]
        usual = [layer for layer in coloured if layer.name.casefold().rpartition(".")[2] in _USUAL]
        found = unnamed or (coloured if len(coloured) == 1 else usual)
    if len(found) == 1:
        rest = ", ".join(f"'{layer.name}'" for layer in coloured if layer is not found[0])
        told = (f"has several layers and '{found[0].name}' was taken; there are also {rest}",)
        return found[0], told if rest and not wanted and found[0].name else ()
    if not layers:
        listed = ", ".join(channel.name for header in headers for channel in header["channels"][:12])
        raise UserError(f"{path} holds no colours, only the channels {listed}; export one with R, G and B")
    listed = ", ".join(f"'{layer.name}'" for layer in layers[:12])
    raise UserError(
        f"{path} has {'no such layer' if wanted else 'several layers'}; name one of {listed}, as in "
        f'"{path.name}:{layers[-1].name}"'
    )


def _size(window: Any) -> np.ndarray:
    low, high = (np.asarray(corner, np.int64) for corner in window)
    return high - low + 1


def _framed(rgb: np.ndarray, header: dict[str, Any]) -> tuple[np.ndarray, bool]:
    """`rgb` of the data window as the display window shows it, and whether that is larger."""
    data, display = header["dataWindow"], header["displayWindow"]
    width, height = (int(side) for side in _size(display))
    left, top = (int(v) for v in np.asarray(data[0], np.int64) - np.asarray(display[0], np.int64))
    if (left, top) == (0, 0) and rgb.shape[:2] == (height, width):
        return rgb, False
    frame = np.zeros((height, width, 3), np.float32)
    rows, columns = slice(max(top, 0), max(top + rgb.shape[0], 0)), slice(max(left, 0), max(left + rgb.shape[1], 0))
    seen = rgb[max(-top, 0) :, max(-left, 0) :]
    target = frame[rows, columns]
    target[:] = seen[: target.shape[0], : target.shape[1]]
    return frame, target.shape[:2] != (height, width)


def _luminance_of_white(header: dict[str, Any]) -> list[str]:
    white = header.get("whiteLuminance")
    if not isinstance(white, int | float) or not 0.0 < white < 1e9 or white == 1.0:
        return []
    return [f"says that its 1 is {white:g} cd/m², which intensity = {white:g} makes it"]


@contextmanager
def _silent() -> Iterator[None]:
    """Within the block nothing is printed: OpenEXR writes to stderr, past Python, and to stdout, before it raises."""
    before, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    os.close(nowhere)
    try:
        with redirect_stdout(io.StringIO()):
            yield
    finally:
        os.dup2(before, 2)
        os.close(before)
