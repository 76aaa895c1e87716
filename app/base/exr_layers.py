"""OpenEXR pictures of other programs: which of their layers is the picture, and in which colours.

Layers are channels with a common name before the last dot, in one part or in several ("ViewLayer.Combined.R").
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .errors import UserError
from .primaries import XYZ, to_rec709

MAX_VALUES = 1 << 28
"""Most values of all channels of all parts; 1 GB as float32."""
_USUAL = ("combined", "composite", "rgba", "rgb", "beauty", "color", "colour", "image")
"""What programs call the layer that is the finished picture."""


class ExrLayer(NamedTuple):
    """One layer's pixels, and what belongs to them."""

    rgb: np.ndarray
    """float32 (H, W, 3), linear Rec.709."""
    others: dict[str, np.ndarray]
    """float32 (H, W): the rest of the part's channels, by name."""
    notes: tuple[str, ...]
    is_converted: bool
    """From other primaries, so that colours may lie outside of Rec.709."""


def read_exr_layer(path: Path, wanted: str, max_pixels: int) -> ExrLayer:
    """The layer `wanted`, or the one that is the picture ("").

    Raises UserError, which lists the layers, where that is open, and ValueError, RuntimeError and the like for a
    damaged file.
    """
    import OpenEXR

    with _silent(), OpenEXR.File(str(path), header_only=True) as file:
        parts = [(str(part.name() or ""), dict(part.header)) for part in file.parts]
    values = 0
    for _, header in parts:
        pixels = max(int(np.prod(_size(header[window]))) for window in ("dataWindow", "displayWindow"))
        if pixels > max_pixels:
            raise ValueError(f"{pixels >> 20} million pixels are more than {max_pixels >> 20} million")
        values += pixels * len(header["channels"])
    if values > MAX_VALUES:
        raise ValueError("its layers together are too large; export the picture alone")
    (number, channels), notes = _chosen(path, wanted, _layers(parts), parts)
    with _silent(), OpenEXR.File(str(path), separate_channels=True) as file:
        # Copies: what the file hands out dies with it.
        held = {name: np.array(channel.pixels, np.float32) for name, channel in file.channels(number).items()}
    header = parts[number][1]
    rgb = np.stack([held[name] for name in (channels * 3)[:3]], axis=-1)
    framed = _framed(rgb, header["dataWindow"], header["displayWindow"])
    chromaticities = XYZ if channels[0].upper() == "X" else header.get("chromaticities")
    matrix = None if chromaticities is None else to_rec709(tuple(chromaticities))
    if matrix is not None:
        with np.errstate(over="ignore", invalid="ignore"):
            framed = (framed @ matrix.T).astype(np.float32)
        notes.append("has primaries of its own; its colours were converted to Rec.709")
    if framed.shape[0] * framed.shape[1] > rgb.shape[0] * rgb.shape[1]:
        notes.append("is cropped; black was put where it lacks pixels")
    if len(channels) == 1:
        notes.append("holds luminance only and is shown in grey")
    white = header.get("whiteLuminance")
    if isinstance(white, float) and 0.0 < white < 1e9 and white != 1.0:
        notes.append(f"says that its 1 is {white:g} cd/m²; intensity = {white:g} makes it that")
    others = {name: pixels for name, pixels in held.items() if name not in channels}
    return ExrLayer(framed, others, tuple(f"{path.name} {note}." for note in notes), matrix is not None)


def _layers(parts: list[tuple[str, dict[str, Any]]]) -> dict[str, tuple[int, list[str]]]:
    """Number of the part and channels (R, G, B, or X, Y, Z, or luminance alone) of each layer, by name."""
    layers: dict[str, tuple[int, list[str]]] = {}
    for number, (part, header) in enumerate(parts):
        groups: dict[str, dict[str, str]] = {}
        for channel in header["channels"]:
            prefix, _, last = channel.name.rpartition(".")
            groups.setdefault(prefix, {})[last.upper()] = channel.name
        for prefix, group in groups.items():
            name = prefix if prefix.startswith(part) else f"{part}.{prefix}".rstrip(".")
            # X, Y and Z with a name are positions or normals.
            kinds = ("RGB", "Y") if prefix and "X" not in group else ("RGB",) if prefix else ("RGB", "XYZ", "Y")
            kind = next((kind for kind in kinds if set(kind) <= group.keys()), None)
            if kind:
                layers.setdefault(name, (number, [group[letter] for letter in kind]))
    return layers


def _chosen(
    path: Path, wanted: str, layers: dict[str, tuple[int, list[str]]], parts: list[tuple[str, dict[str, Any]]]
) -> tuple[tuple[int, list[str]], list[str]]:
    """The layer, and notes."""
    coloured = [name for name, (_, channels) in layers.items() if len(channels) == 3] or list(layers)
    if wanted:
        ends = (wanted.casefold(), f".{wanted.casefold()}")
        found = [name for name in layers if name.casefold() == ends[0] or name.casefold().endswith(ends[1])]
    else:
        usual = [name for name in coloured if name.casefold().rpartition(".")[2] in _USUAL]
        found = [""] if "" in coloured else coloured if len(coloured) == 1 else usual
    listed = ", ".join(f"'{name}'" for name in list(layers)[:12])
    if len(found) == 1:
        is_noted = not wanted and found[0] and len(coloured) > 1
        return layers[found[0]], [f"has the layers {listed}; '{found[0]}' was taken"] if is_noted else []
    if not layers:
        names = ", ".join(channel.name for _, header in parts for channel in header["channels"][:12])
        raise UserError(f"{path} holds no colours, only the channels {names}; export one with R, G and B")
    state = "no such layer" if wanted else "several layers"
    raise UserError(f'{path} has {state}; name one of {listed}, as in "{path.name}:{list(layers)[-1]}"')


def _size(window: Any) -> tuple[int, int]:
    """Width and height."""
    (left, top), (right, bottom) = (tuple(map(int, corner)) for corner in window)
    return right - left + 1, bottom - top + 1


def _framed(rgb: np.ndarray, data: Any, display: Any) -> np.ndarray:
    """`rgb` of the data window as the display window shows it, black where it has no pixels."""
    width, height = _size(display)
    left, top = (int(data[0][axis]) - int(display[0][axis]) for axis in range(2))
    if (left, top, *rgb.shape[:2]) == (0, 0, height, width):
        return rgb
    frame = np.zeros((height, width, 3), np.float32)
    target = frame[max(top, 0) : max(top + rgb.shape[0], 0), max(left, 0) : max(left + rgb.shape[1], 0)]
    target[:] = rgb[max(-top, 0) :, max(-left, 0) :][: target.shape[0], : target.shape[1]]
    return frame


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
