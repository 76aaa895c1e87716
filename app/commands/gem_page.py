"""A stone's report as one page of HTML: pictures, figures, tilt curves; nothing is loaded from elsewhere."""

from __future__ import annotations

import base64

import numpy as np

from ..base.image_io import png_bytes
from ..bench.report.page import Table, inlined, render
from ..bench.report.style import PALETTE, panels, plot_style, svg_text
from ..model.gems.report import PICTURES, GemReport
from ..model.io.scene_pictures import nearest_levels

_COLOURS = ("srd-lambda", "srd", "progressive")
"""Colours of the curves, among those of every report."""


def page(found: GemReport) -> str:
    """The page's text."""
    glass = found.stone.glass
    pictures = [(found.pictures[key], words) for key, words in PICTURES.items() if key in found.pictures]
    if found.table is not None:
        words = f"On a table, ten diameters wide: {100.0 * found.table.coloured:.1f} % of that light is coloured."
        pictures.append((_exposed(found.table.picture), words))
    return render(
        "gem.html",
        name=found.stone.name,
        notes=[f"{sentence}." for sentence in found.stone.notes],
        facts={"glass": glass.name or "glass", "n_d": f"{glass.n_d:.5f}", "n_F − n_C": f"{found.stone.dn:.5f}"},
        pictures=[(base64.b64encode(png_bytes(nearest_levels(rgb))).decode(), words) for rgb, words in pictures],
        figures=Table(("figure", "value", "what it is"), found.rows(), words=("what it is",)),
        curves=inlined(_curves(found), "tilt", "light return of the stone tilted about x, and about y"),
    )


def _exposed(rgb: np.ndarray) -> np.ndarray:
    """So bright that hardly anything is more than white."""
    from ..base.tone_map import into_gamut

    brightest = float(np.percentile(rgb.max(axis=-1), 99.7))
    return into_gamut(np.asarray(rgb, np.float32)) / max(brightest, 1e-30)


def _curves(found: GemReport) -> str:
    """Light return against the tilt about x, and about y, as an SVG document; what is not finite is left out."""
    curves = {"ISO": found.tilt_iso, "COS": found.tilt_cos, f"ISO, head {found.figures.head_deg:g}°": found.tilt_head}
    with plot_style():
        figure, both = panels(2, 2, (4.0, 2.6), (0.7, 0.2, 0.9, 0.3))
        for axis, axes in enumerate(both):
            for colour, (name, values) in zip(_COLOURS, curves.items(), strict=True):
                axes.plot(found.tilts_deg, 100.0 * values[axis], color=PALETTE[colour][0], label=name)
            axes.set_ylim(0.0, 100.0)
            axes.set_xlabel(f"tilt about {'xy'[axis]}, °")
        both[0].set_ylabel("light return, %")
        figure.legend(*both[0].get_legend_handles_labels(), loc="lower center", ncol=3)
        return svg_text(figure)
