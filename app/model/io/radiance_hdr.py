"""Radiance pictures (.hdr, .pic): four bytes a pixel, three mantissas with one exponent, flat or run-length coded.

Panoramas are passed round in this format more than in any other, and an 8-bit library does not read it.
G. Ward: Real Pixels, Graphics Gems II (1991), and the file format's description that comes with Radiance.
Runs of bytes cannot be decoded by whole arrays, so their loops are compiled (`radiance_rows`).
"""

from __future__ import annotations

import numpy as np

from ...base.errors import UserError
from ...base.primaries import XYZ, to_rec709

_MAX_SIDE = 1 << 16
_RGB_FORMAT = "32-bit_rle_rgbe"
_FORMATS = (_RGB_FORMAT, "32-bit_rle_xyze")


def read_hdr(data: bytes, where: str, max_pixels: int) -> tuple[np.ndarray, tuple[str, ...], bool]:
    """Linear Rec.709 float32 (H, W, 3), row 0 the top, notes, and whether it had other primaries; `where` opens every
    sentence.

    New-style and old run-length coding and flat pixels are understood, in all eight orders of rows and columns, RGB and
    XYZ. What EXPOSURE and COLORCORR lines say was multiplied in is divided out again. Raises UserError for anything
    else, naming the remedy.
    """
    header, body = _header(data, where)
    factor, chromaticities, notes = _said(header, where)
    axes, height, width, body = _resolution(data, body, where)
    if width * height > max_pixels:
        raise UserError(f"{where}: {width} × {height} pixels are more than {max_pixels >> 20} million; make it smaller")
    coded = np.frombuffer(data, np.uint8, offset=body)
    rgbe = _flat(coded, height, width)
    if rgbe is None:
        from .radiance_rows import DAMAGED, decode

        rgbe = np.empty((height, width, 4), np.uint8)
        rows, end = decode(coded, rgbe)
        if rows < height:
            reason = "holds a run that leaves its row" if end == DAMAGED else "ends"
            raise UserError(f"{where}: the file {reason} in row {rows + 1} of {height}; copy or export it again")
    rgb = _radiance(rgbe) / factor.astype(np.float32)
    # Lines are rows or columns, and either may run backwards.
    rgb = rgb if axes[0][1] == "Y" else rgb.swapaxes(0, 1)
    rgb = rgb[:: 1 if "-Y" in axes else -1, :: 1 if "+X" in axes else -1]
    try:
        matrix = None if chromaticities is None else to_rec709(chromaticities)
    except ValueError as error:
        raise UserError(f"{where}: {error}; take its line PRIMARIES out") from error
    if matrix is None:
        return np.ascontiguousarray(rgb), notes, False
    with np.errstate(over="ignore", invalid="ignore"):
        rgb = (rgb @ matrix.T).astype(np.float32)
    return rgb, (*notes, f"{where}: it has primaries of its own; its colours were converted to Rec.709."), True


def _flat(coded: np.ndarray, height: int, width: int) -> np.ndarray | None:
    """Pixels without any runs, uint8 (height, width, 4); None where there may be some."""
    if len(coded) != 4 * height * width:
        return None
    pixels = coded.reshape(height, width, 4)
    opens_row = (pixels[:, 0, :2] == 2).all(axis=1) & (pixels[:, 0, 2] < 128)
    repeats = (pixels[..., :3] == 1).all(axis=2)
    return None if opens_row.any() or repeats.any() else pixels


def _header(data: bytes, where: str) -> tuple[list[str], int]:
    """Lines of the header and where the resolution line begins."""
    end = data.find(b"\n\n", 0, 1 << 16)
    if not data.startswith(b"#?") or end < 0:
        raise UserError(
            f"{where}: this is not a Radiance picture (it does not begin with '#?' and a header); check the suffix"
        )
    return data[:end].decode("ascii", "replace").split("\n"), end + 2


def _said(header: list[str], where: str) -> tuple[np.ndarray, tuple[float, ...] | None, tuple[str, ...]]:
    """Product of all EXPOSURE and COLORCORR lines, float64 (3,), primaries other than the usual ones, and notes."""
    product, chromaticities, notes = np.ones(3), None, []
    for line in header[1:]:
        key, _, value = (part.strip() for part in line.partition("="))
        if key == "FORMAT" and value not in _FORMATS:
            raise UserError(f"{where}: its format is not {_RGB_FORMAT}; convert it to RGB")
        if key == "FORMAT" and value != _RGB_FORMAT:
            chromaticities = XYZ
        if key not in ("EXPOSURE", "COLORCORR", "PRIMARIES"):
            continue
        try:
            numbers = np.array([float(word) for word in value.split()])
        except ValueError:
            numbers = np.zeros(1)
        with np.errstate(all="ignore"):
            multiplied = product * numbers if len(numbers) in (1, 3) else np.zeros(3)
        if key == "PRIMARIES":
            chromaticities = tuple(numbers) if chromaticities is None else chromaticities
        elif ((multiplied > 1e-30) & (multiplied < 1e30)).all():
            product = multiplied
        else:
            notes.append(f"{where}: its line {key} is not a number above 0 and was left aside.")
    return product, chromaticities, tuple(notes)


def _resolution(data: bytes, start: int, where: str) -> tuple[tuple[str, str], int, int, int]:
    """Which ways lines and pixels within them run, how many there are, and where they begin."""
    end = data.find(b"\n", start, start + 80)
    words = data[start : max(end, start)].decode("ascii", "replace").split()
    if len(words) != 4 or not (words[1].isdecimal() and words[3].isdecimal()):
        raise UserError(f"{where}: the line that gives its size is missing; copy or export it again")
    axes = words[0], words[2]
    if sorted(axis[1:] for axis in axes) != ["X", "Y"] or any(axis[0] not in "+-" for axis in axes):
        raise UserError(f"{where}: the line that gives its size has no X and Y; copy or export it again")
    height, width = int(words[1]), int(words[3])
    if not (0 < height <= _MAX_SIDE and 0 < width <= _MAX_SIDE):
        raise UserError(f"{where}: its size is {width} × {height}; each side must be 1 to {_MAX_SIDE} pixels")
    return axes, height, width, end + 1


def _radiance(rgbe: np.ndarray) -> np.ndarray:
    """Mantissa · 2^(exponent − 136), and black for exponent 0; float32 holds every value of the format exactly."""
    exponent = rgbe[..., 3:].astype(np.int32)
    # In two passes: 2^-135 alone would be below float32's normal numbers.
    scale = np.ldexp(np.float32(1.0), exponent - 128)
    scale[exponent == 0] = 0.0
    return rgbe[..., :3].astype(np.float32) / np.float32(256.0) * scale
