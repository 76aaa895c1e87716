"""Radiance pictures (.hdr, .pic): four bytes a pixel, three mantissas with one exponent, flat or run-length coded.

Panoramas are passed round in this format more than in any other, and an 8-bit library does not read it.
G. Ward: Real Pixels, Graphics Gems II (1991), and the file format's description that comes with Radiance.
Runs of bytes cannot be decoded by whole arrays, so their loops are compiled (`radiance_rows`).
"""

from __future__ import annotations

import numpy as np

from ...base.errors import UserError

_MAX_SIDE = 1 << 16
_RGB_FORMAT = "32-bit_rle_rgbe"


def read_hdr(data: bytes, where: str, max_pixels: int) -> tuple[np.ndarray, tuple[str, ...]]:
    """Linear radiance float32 (H, W, 3), row 0 the top, and notes; `where` opens every sentence.

    New-style and old run-length coding and flat pixels are understood, rows from the top, columns from the left. What
    EXPOSURE lines say was multiplied in is divided out again. Raises UserError for anything else, naming the remedy.
    """
    header, body = _header(data, where)
    exposure, notes = _exposure(header, where)
    height, width, body = _resolution(data, body, where)
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
    return _radiance(rgbe) / np.float32(exposure), notes


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


def _exposure(header: list[str], where: str) -> tuple[float, tuple[str, ...]]:
    """Product of all EXPOSURE lines, and notes on what else the header says."""
    exposure, notes = 1.0, []
    for line in header[1:]:
        key, _, value = (part.strip() for part in line.partition("="))
        if key == "FORMAT" and value != _RGB_FORMAT:
            raise UserError(f"{where}: its format is not {_RGB_FORMAT}; convert it to RGB")
        if key == "EXPOSURE":
            try:
                factor = float(value)
            except ValueError:
                factor = 0.0
            exposure *= factor
            if not 1e-30 < factor < 1e30 or not 1e-30 < exposure < 1e30:
                raise UserError(f"{where}: its EXPOSURE is not a number above 0; export it again")
        if key == "PRIMARIES" and not value.startswith("0.64"):
            notes.append(f"{where}: its own primaries are taken for those of Rec.709.")
    return exposure, tuple(notes)


def _resolution(data: bytes, start: int, where: str) -> tuple[int, int, int]:
    """Height, width and where the pixels begin."""
    end = data.find(b"\n", start, start + 80)
    words = data[start : max(end, start)].decode("ascii", "replace").split()
    if len(words) != 4 or not (words[1].isdecimal() and words[3].isdecimal()):
        raise UserError(f"{where}: the line that gives its size is missing; copy or export it again")
    if (words[0], words[2]) != ("-Y", "+X"):
        raise UserError(f"{where}: its pixels do not run from the top left ('-Y +X'); turn and export it again")
    height, width = int(words[1]), int(words[3])
    if not (0 < height <= _MAX_SIDE and 0 < width <= _MAX_SIDE):
        raise UserError(f"{where}: its size is {width} × {height}; each side must be 1 to {_MAX_SIDE} pixels")
    return height, width, end + 1


def _radiance(rgbe: np.ndarray) -> np.ndarray:
    """Mantissa · 2^(exponent − 136), and black for exponent 0; float32 holds every value of the format exactly."""
    exponent = rgbe[..., 3:].astype(np.int32)
    # In two passes: 2^-135 alone would be below float32's normal numbers.
    scale = np.ldexp(np.float32(1.0), exponent - 128)
    scale[exponent == 0] = 0.0
    return rgbe[..., :3].astype(np.float32) / np.float32(256.0) * scale
