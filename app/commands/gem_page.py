"""A stone's report as one page of HTML: pictures, figures, tilt curves; nothing is loaded from elsewhere."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence

import numpy as np

from ..model.gems.report import PICTURES, GemReport

_STYLE = """
body { font: 16px/1.45 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
figure { display: inline-block; width: 46%; margin: 0 1% 1.5rem 1%; vertical-align: top; }
figure img { width: 100%; } figcaption, .note { color: #555; font-size: 0.9em; }
table { border-collapse: collapse; } td { padding: 0.15rem 1rem 0.15rem 0; border-bottom: 1px solid #ddd; }
td:nth-child(2) { text-align: right; font-variant-numeric: tabular-nums; }
svg text { font: 12px system-ui, sans-serif; fill: #444; }
"""
_WIDTH, _HEIGHT, _LEFT, _BELOW = 460, 260, 46, 34
_COLOURS = ("#1b6ca8", "#c8502d", "#3a8f4b")


def page(found: GemReport) -> str:
    """The page's text."""
    stone = found.stone
    name, glass = html.escape(stone.name), html.escape(stone.glass.name or "glass")
    index = f"n_d {stone.glass.n_d:.5f}, n_F − n_C {stone.dn:.5f}"
    notes = "".join(f"<p class='note'>{html.escape(sentence)}.</p>" for sentence in stone.notes)
    rows = "".join(f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>" for row in found.rows())
    pictures = "".join(_figure(found.pictures[key], PICTURES[key]) for key in PICTURES if key in found.pictures)
    curves = ""
    for axis, about in enumerate("xy"):
        lines = {
            "ISO": found.tilt_iso[axis],
            "COS": found.tilt_cos[axis],
            f"ISO, head {found.figures.head_deg:g}°": found.tilt_head[axis],
        }
        chart = plot(found.tilts_deg, lines)
        curves += f"<figure>{chart}<figcaption>Light return, tilted about {about}.</figcaption></figure>"
    table = ""
    if found.table is not None:
        words = f"On a table, ten diameters wide: {100.0 * found.table.coloured:.1f} % of that light is coloured."
        table = _figure(_exposed(found.table.picture), words)
    return (
        f"<!doctype html>\n<html lang='en'><head><meta charset='utf-8'><title>{name}</title><style>{_STYLE}</style>"
        f"</head><body><h1>{name}</h1><p>{glass}, {index}. Seen from above its table.</p>{notes}"
        f"<section>{pictures}{table}</section><table>{rows}</table><section>{curves}</section></body></html>"
    )


def png(rgb: np.ndarray) -> bytes:
    """A PNG file of linear Rec.709 (H, W, 3), as it is: 1 is white."""
    from PIL import Image

    from ..base.tone_map import srgb_oetf

    buffer = io.BytesIO()
    codes = np.round(255.0 * srgb_oetf(np.clip(rgb, 0.0, 1.0)))
    Image.fromarray(codes.astype(np.uint8)).save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def _exposed(rgb: np.ndarray) -> np.ndarray:
    """So bright that hardly anything is more than white."""
    from ..base.tone_map import into_gamut

    brightest = float(np.percentile(rgb.max(axis=-1), 99.7))
    return into_gamut(np.asarray(rgb, np.float32)) / max(brightest, 1e-30)


def _figure(rgb: np.ndarray, words: str) -> str:
    data = base64.b64encode(png(rgb)).decode()
    return (
        f"<figure><img alt='{html.escape(words)}' src='data:image/png;base64,{data}'>"
        f"<figcaption>{html.escape(words)}</figcaption></figure>"
    )


def plot(x: Sequence[float] | np.ndarray, curves: dict[str, np.ndarray]) -> str:
    """Shares against degrees as an SVG; what is not finite is left out."""
    low, high = float(np.min(x)), float(np.max(x))

    def place(at: float, value: float) -> tuple[float, float]:
        across = _LEFT + (at - low) / (high - low) * (_WIDTH - _LEFT - 8)
        return across, (1.0 - value) * (_HEIGHT - _BELOW - 8) + 8

    parts = []
    for value in (0.0, 0.25, 0.5, 0.75, 1.0):
        left, y = place(low, value)
        parts.append(f"<line x1='{left}' x2='{_WIDTH - 8}' y1='{y:.1f}' y2='{y:.1f}' stroke='#ddd'/>")
        parts.append(f"<text x='{left - 6}' y='{y + 4:.1f}' text-anchor='end'>{100 * value:.0f} %</text>")
    for at in np.linspace(low, high, 5):
        across, y = place(float(at), 0.0)
        parts.append(f"<text x='{across:.1f}' y='{y + 16:.1f}' text-anchor='middle'>{at:g}°</text>")
    for i, (name, values) in enumerate(curves.items()):
        known = [(float(a), float(v)) for a, v in zip(x, values, strict=True) if np.isfinite(v)]
        points = " ".join("{:.1f},{:.1f}".format(*place(*pair)) for pair in known)
        parts.append(f"<polyline points='{points}' fill='none' stroke='{_COLOURS[i % 3]}' stroke-width='2'/>")
        below = _HEIGHT - 4
        parts.append(
            f"<text x='{_LEFT + 130 * i}' y='{below}' style='fill:{_COLOURS[i % 3]}'>{html.escape(name)}</text>"
        )
    return f"<svg viewBox='0 0 {_WIDTH} {_HEIGHT}' role='img'>{''.join(parts)}</svg>"
