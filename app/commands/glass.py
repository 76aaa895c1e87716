"""The glass command: one hit is shown in full, several as a table; a plot on request."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.atomic import atomic_output
from ..base.errors import UserError
from ..model.optics.catalogue import Entry, entries, is_guess, search, search_key
from ..model.optics.crystals import crystals
from ..model.optics.glass import LINE_C_NM, LINE_D_NM, LINE_F_NM
from .printing import show, table
from .table import Glass

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from rich.table import Table

_LINES = (("F", LINE_F_NM, "#2f7fd0"), ("d", LINE_D_NM, "#c99a00"), ("C", LINE_C_NM, "#c0392b"))
_COLOURS = ("#1b2a49", "#d1495b", "#2a9d8f", "#edae49", "#7b5ea7", "#5c946e")
"""More curves than these cannot be distinguished in one plot."""


def glass(options: Glass) -> int:
    """Show what a query finds, and plot it where that is asked for. Raises `UserError`."""
    hits, plot_file = _hits(options.query), options.plot
    if plot_file is not None and len(hits) > len(_COLOURS):
        raise UserError(
            f"--plot shows at most {len(_COLOURS)} glasses and {len(hits)} match: give more of the name, for example "
            "N-BK7"
        )
    if plot_file is not None:
        plot(hits, plot_file)  # first, so that a refused file name is all that is said
    if hits and is_guess(options.query):
        show(f"Nothing in the catalogue is called '{options.query}'. A guess by its letters:")
    if len(hits) == 1:
        show(describe(hits[0]))
    else:
        show(list_glasses(options.query))
    if plot_file is not None:
        show(f"plot: {plot_file.resolve()}")
    return 0


def _hits(query: str) -> list[Entry]:
    """What matches; an exact name is the only hit, however many names contain it."""
    hits = search(query)
    if hits and search_key(query) in (search_key(hits[0].name), search_key(hits[0].qualified_name)):
        return hits[:1]
    return hits


def list_glasses(query: str) -> Table:
    """A table of the glasses that match `query` ("" = all): name, maker, n_d, V_d, range.

    Raises `UserError` when nothing resembles the query.
    """
    found = search(query)
    if not found:
        raise UserError(f"no glass resembles '{query}'; 'spectrasplat glass' without a name lists all")
    what = "similar names among" if is_guess(query) else "of"
    rows = []
    for entry in found:
        glass = entry.dispersion
        also = ", ".join(entry.aliases)
        rows.append((entry.name, entry.maker, f"{glass.n_d:.5f}", _abbe(glass.V_d), _range(entry), also))
    title = f"{len(found)} {what} {len(entries())} glasses and materials"
    return table(title, ("name", "maker", ">n_d", ">V_d", ">range nm", "also"), rows)


def describe(entry: Entry) -> str:
    """Everything known of one glass, several lines of plain text."""
    glass = entry.dispersion
    n_f, n_c = float(glass.index(LINE_F_NM)), float(glass.index(LINE_C_NM))
    crystal = next((each for each in crystals().values() if each.ordinary == glass), None)
    lines = [entry.qualified_name]
    facts = {
        "maker": entry.maker if entry.maker != "Materials" else "",
        "also called": ", ".join(entry.aliases),
        "status": entry.status,
        "remark": entry.note,
        "range": f"{_range(entry)} nm",
        f"n_F  {LINE_F_NM:.2f} nm": f"{n_f:.6f}",
        f"n_d  {LINE_D_NM:.2f} nm": f"{glass.n_d:.6f}",
        f"n_C  {LINE_C_NM:.2f} nm": f"{n_c:.6f}",
        "n_F - n_C": f"{n_f - n_c:.6f}",
        "V_d": _abbe(glass.V_d, digits=3),
        "as a crystal": f'crystal = "{crystal.substance}", n_e {crystal.extraordinary.n_d:.6f} at d' if crystal else "",
        "dn/dλ at d": f"{float(glass.derivative(LINE_D_NM)):.6f} per µm",
        "source": entry.source,
        "licence": entry.licence,
    }
    lines += [f"  {label:<17}{value}" for label, value in facts.items() if value]
    lines.append("  formula (λ in µm)")
    lines += [f"    {row}" for row in glass.formula_text().splitlines()]
    lines += [f"  note: {note}" for note in glass.notes()]
    return "\n".join(lines)


def plot(shown: Sequence[Entry], path: Path) -> None:
    """Draw n(λ) of one or several glasses, and their place in the Abbe diagram, to a PNG.

    Raises `UserError` when the path does not end in .png or cannot be written.
    """
    if path.suffix.lower() != ".png":
        raise UserError(f"the plot {path} must end in .png; choose such a name")
    if not shown:
        raise UserError("there is no glass to plot; name one, such as N-BK7")
    from ..bench.report.style import new_figure, plot_style

    with plot_style(), atomic_output(path) as temporary:
        figure = new_figure(12.0, 5.2)
        figure.set_layout_engine("constrained")
        left, right = figure.subplots(1, 2, width_ratios=(1.15, 1.0))
        _draw_dispersion(left, shown)
        _draw_abbe_diagram(right, shown)
        figure.savefig(temporary, format="png")


def _draw_dispersion(axes: Axes, shown: Sequence[Entry]) -> None:
    wavelength = np.linspace(380.0, 780.0, 801)
    _draw_rainbow(axes)
    for entry, colour in zip(shown, _COLOURS, strict=False):
        glass, (lo, hi) = entry.dispersion, entry.range_nm
        n = glass.index(wavelength)
        inside = (wavelength >= lo) & (wavelength <= hi)
        axes.plot(wavelength, np.where(inside, n, np.nan), color=colour, lw=2.0, label=entry.qualified_name)
        if not inside.all():
            axes.plot(wavelength, np.where(inside, np.nan, n), color=colour, lw=1.4, ls=(0, (1, 1.5)))
        for _, line_nm, _ in _LINES:
            axes.plot(line_nm, float(glass.index(line_nm)), "o", ms=4.5, color=colour, mec="white", mew=0.7, zorder=4)
    for name, line_nm, colour in _LINES:
        axes.axvline(line_nm, color=colour, lw=0.9, ls="--", zorder=1)
        axes.annotate(
            name,
            (line_nm, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(3, -4),
            textcoords="offset points",
            va="top",
            color=colour,
            fontweight="bold",
        )
    axes.set(xlim=(380.0, 780.0), xlabel="wavelength λ (nm)", ylabel="refractive index n")
    axes.margins(y=0.12)
    axes.ticklabel_format(axis="y", useOffset=False)
    if len(shown) == 1:
        glass = shown[0].dispersion
        axes.set_title(f"{shown[0].qualified_name}    n_d = {glass.n_d:.5f}    V_d = {_abbe(glass.V_d)}", loc="left")
    else:
        axes.set_title("refractive index", loc="left")
        axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.12), ncols=3)


def _draw_rainbow(axes: Axes) -> None:
    """A strip of the spectrum's colours under the wavelength axis."""
    from ..model.optics.colorimetry import VISIBLE_NM, cmf_xyz, xyz_to_rgb709

    rgb = np.clip(xyz_to_rgb709(cmf_xyz()), 0.0, None)
    rgb = (rgb / rgb.max(axis=0)) ** (1.0 / 2.2)
    strip = axes.inset_axes((0.0, 0.0, 1.0, 0.03), zorder=3)
    strip.imshow(rgb[None], aspect="auto", extent=(VISIBLE_NM[0], VISIBLE_NM[-1], 0.0, 1.0))
    strip.set_axis_off()


def _draw_abbe_diagram(axes: Axes, shown: Sequence[Entry]) -> None:
    """n_d over V_d, V_d falling to the right as glass makers draw it."""
    for maker, colour, size in (("makers", "#b9c0c9", 6.0), ("Materials", "#8d79a8", 16.0)):
        places = np.array(
            [
                (entry.dispersion.V_d, entry.dispersion.n_d)
                for entry in entries()
                if (entry.maker == "Materials") == (maker == "Materials")
            ]
        )
        label = "optical glasses" if maker == "makers" else "other materials"
        axes.scatter(places[:, 0], places[:, 1], s=size, color=colour, lw=0, label=label)
    v_limits, n_limits = [10.0, 100.0], [1.28, 2.1]
    for entry, colour in zip(shown, _COLOURS, strict=False):
        glass = entry.dispersion
        if not math.isfinite(glass.V_d):
            continue
        axes.plot(glass.V_d, glass.n_d, "o", ms=9, color=colour, mec="black", mew=0.8, zorder=5)
        axes.annotate(
            entry.name,
            (glass.V_d, glass.n_d),
            xytext=(8, 7),
            textcoords="offset points",
            zorder=6,
            fontweight="bold",
            bbox={"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.8},
        )
        v_limits = [min(v_limits[0], glass.V_d - 5.0), max(v_limits[1], glass.V_d + 5.0)]
        n_limits = [min(n_limits[0], glass.n_d - 0.05), max(n_limits[1], glass.n_d + 0.1)]
    axes.set(xlim=v_limits[::-1], ylim=n_limits, xlabel="Abbe number V_d", ylabel="n_d")
    axes.set_title("Abbe diagram", loc="left")
    axes.legend(loc="upper left", markerscale=1.5)


def _abbe(v_d: float, digits: int = 2) -> str:
    return "none" if math.isinf(v_d) else f"{v_d:.{digits}f}"


def _range(entry: Entry) -> str:
    lo, hi = entry.range_nm
    return "all" if hi >= 1e9 else f"{lo:.0f}-{hi:.0f}"
