"""Radiance pictures written by hand, so that the reader is not tested with a writer of ours."""

from __future__ import annotations

import numpy as np

HEADER = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n"


def hdr_file(
    body: bytes, width: int, height: int, header: bytes = HEADER, axes: tuple[str, str] = ("-Y", "+X")
) -> bytes:
    """A whole file round `body`."""
    return header + f"\n{axes[0]} {height} {axes[1]} {width}\n".encode() + body


def random_rgbe(width: int, height: int, seed: int = 3) -> np.ndarray:
    """Pixels uint8 (H, W, 4) with runs of equal ones, that no reader can take for a marker."""
    rng = np.random.default_rng(seed)
    rgbe = rng.integers(130, 256, (height, width, 4)).astype(np.uint8)
    rgbe[..., 3] = rng.integers(120, 140, (height, width))
    rgbe[:, width // 3 : width // 2] = rgbe[:, width // 3 : width // 3 + 1]
    return rgbe


def radiance_of(rgbe: np.ndarray) -> np.ndarray:
    """Linear values float64 (H, W, 3) by the format's definition."""
    exponent = rgbe[..., 3:].astype(np.float64)
    return np.where(exponent > 0, rgbe[..., :3] * 2.0 ** (exponent - 136.0), 0.0)


def new_rows(rgbe: np.ndarray) -> bytes:
    """New-style run-length coding: planes of runs and literals."""
    out = bytearray()
    for row in rgbe:
        out += bytes([2, 2, len(row) >> 8, len(row) & 255])
        for plane in row.T:
            at = 0
            while at < len(plane):
                run = 1
                while at + run < len(plane) and run < 127 and plane[at + run] == plane[at]:
                    run += 1
                if run > 2:
                    out += bytes([128 + run, plane[at]])
                else:
                    run = 1
                    out += bytes([1, plane[at]])
                at += run
    return bytes(out)


def old_rows(rgbe: np.ndarray) -> bytes:
    """Old-style coding: a repeat is a pixel 1, 1, 1, count; counts above 255 take a second one of weight 256."""
    out = bytearray()
    for row in rgbe:
        at = 0
        while at < len(row):
            run = 1
            while at + run < len(row) and (row[at + run] == row[at]).all():
                run += 1
            out += row[at].tobytes()
            more = run - 1
            if more:
                out += bytes([1, 1, 1, more & 255])
                if more > 255:
                    out += bytes([1, 1, 1, more >> 8])
            at += run
    return bytes(out)
