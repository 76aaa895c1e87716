"""How methods look in every plot and on the page, and what the plots have in common.

`srd` has the only strong colour; the others are muted and differ by dash and marker as well, so that plots can be
read in grey print and by the colour-blind. Every colour that a plot may use has a name here: `inline_svg` writes
`var(--name)` for it, and the page gives that another value on a dark screen.
"""

from __future__ import annotations

import io
import math
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base.atomic import atomic_output

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PAPER, INK, MUTED, GRID, WASH = "#fefefe", "#1c1e21", "#5b6068", "#e2e4e7", "#f3f4f6"
PALETTE = {
    "paper": (PAPER, "#15171a"),
    "ink": (INK, "#e9eaec"),
    "muted": (MUTED, "#a4aab3"),
    "grid": (GRID, "#33373d"),
    "wash": (WASH, "#1f2226"),
    "srd": ("#c8380c", "#ff7a4d"),
    "srd-photons": ("#a8552f", "#d99a78"),
    "srd-lambda": ("#2f6f9f", "#74b3e0"),
    "stochastic": ("#3d4147", "#c3c7cd"),
    "stochastic-even": ("#575b62", "#aeb3bb"),
    "stochastic-point": ("#72777f", "#8d939c"),
    "regular-7": ("#9a72a6", "#c39bcf"),
    "regular-16": ("#6a4c7d", "#a583b8"),
    "progressive": ("#4d7f5f", "#86bf9b"),
    "progressive-stochastic": ("#7f8a3a", "#b9c46f"),
    "hero": ("#a0527a", "#d98fb5"),
    "other-1": ("#8a6d3b", "#c9a96b"),
    "other-2": ("#2f8080", "#6fc0c0"),
    "other-3": ("#7d4c4c", "#c48d8d"),
    "good": ("#1f6f43", "#6fcf97"),
    "bad": ("#a3241b", "#ff8a80"),
}
"""Name: (on paper, on a dark screen). Every colour on paper occurs once: it is the key for the exchange."""

Settings = dict[str, Any]
"""Keywords of a drawing call."""
Dash = str | tuple[float, tuple[float, ...]]


@dataclass(frozen=True)
class MethodStyle:
    """How a method is drawn."""

    colour: str
    width_pt: float
    dash: Dash
    marker: str
    rank: int
    """Order in lists and in depth: larger is drawn over smaller."""


_STYLES: dict[str, tuple[float, Dash, str, int]] = {
    "stochastic-point": (1.4, (0.0, (2.0, 1.6)), "x", 0),
    "regular-7": (1.4, (0.0, (5.0, 2.0)), "v", 1),
    "regular-16": (1.4, (0.0, (5.0, 1.5, 1.0, 1.5)), "^", 2),
    "stochastic": (1.7, "-", "s", 4),
    "stochastic-even": (1.4, (0.0, (3.0, 1.2)), "o", 3),
    "progressive-stochastic": (1.4, (0.0, (1.0, 1.0)), "p", 3),
    "hero": (1.4, (0.0, (4.0, 1.0, 1.0, 1.0)), "h", 3),
    "srd-lambda": (1.7, "-", "D", 5),
    "progressive": (1.7, "-", "P", 6),
    "srd-photons": (1.7, (0.0, (6.0, 1.5)), "p", 7),
    "srd": (2.6, "-", "o", 8),
}
"""Width, dash, marker and rank."""


def method_style(name: str) -> MethodStyle:
    """The style of a method; one that is not known gets a muted colour by its name."""
    if name in _STYLES:
        return MethodStyle(PALETTE[name][0], *_STYLES[name])
    choice = 1 + sum(name.encode()) % 3
    return MethodStyle(PALETTE[f"other-{choice}"][0], 1.4, (0.0, (4.0, 1.5)), "*", 3)


def by_rank(names: Sequence[str]) -> list[str]:
    """Method names, the most interesting first."""
    return sorted(names, key=lambda name: (-method_style(name).rank, name))


# -- figures ------------------------------------------------------------------------------


@contextmanager
def plot_style() -> Iterator[None]:
    """Matplotlib's settings for drawing and for saving; figures must be made and saved inside. No text is parsed as
    mathematics."""
    import matplotlib

    settings: dict[Any, object] = {
        "font.family": "sans-serif",
        "font.sans-serif": ["DejaVu Sans"],
        "font.size": 9.0,
        "text.color": INK,
        "axes.labelcolor": INK,
        "axes.edgecolor": MUTED,
        "axes.linewidth": 0.8,
        "axes.facecolor": PAPER,
        "figure.facecolor": PAPER,
        "savefig.facecolor": PAPER,
        "xtick.color": MUTED,
        "ytick.color": MUTED,
        "xtick.labelcolor": INK,
        "ytick.labelcolor": INK,
        "xtick.labelsize": 8.5,
        "ytick.labelsize": 8.5,
        "axes.labelsize": 9.0,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.grid.which": "major",
        "axes.axisbelow": True,
        "grid.color": GRID,
        "grid.linewidth": 0.7,
        "legend.frameon": False,
        "legend.fontsize": 8.0,
        "legend.handlelength": 1.8,
        "legend.columnspacing": 1.3,
        "xtick.minor.size": 0.0,
        "ytick.minor.size": 0.0,
        "xtick.major.size": 3.0,
        "ytick.major.size": 3.0,
        "text.parse_math": False,
        "svg.fonttype": "none",
        "svg.hashsalt": "spectrasplat",
    }
    with matplotlib.rc_context(settings), warnings.catch_warnings():
        # A scene may be named in any script; the SVG keeps the letters, the PNG draws a box.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield


def new_figure(width_in: float, height_in: float) -> Figure:
    """A figure of its own: no pyplot, no global state, no window system."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=100)
    FigureCanvasAgg(figure)
    return figure


def panels(
    count: int, columns: int, panel_in: tuple[float, float], margins_in: tuple[float, float, float, float]
) -> tuple[Figure, list[Axes]]:
    """A figure of `count` panels that share both axes, `columns` in a row; `margins_in`: left, right, bottom, top."""
    rows = max(math.ceil(count / columns), 1)
    left, right, bottom, top = margins_in
    width, height = max(panel_in[0] * columns + left + right, 4.2), panel_in[1] * rows + bottom + top
    figure = new_figure(width, height)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    figure.subplots_adjust(left / width, bottom / height, 1 - right / width, 1 - top / height, 0.1, 0.3)
    for axes in grid.flat[count:]:
        axes.set_visible(False)
    return figure, list(grid.flat[:count])


def label_panels(drawn: Sequence[Axes], columns: int, x: str, y: str) -> None:
    """Names the axes of `panels`: below the lowest and left of the first ones."""
    for index, axes in enumerate(drawn):
        lowest = index + columns >= len(drawn)
        axes.set(xlabel=x if lowest else "", ylabel=y if index % columns == 0 else "")
        axes.tick_params(labelbottom=lowest)


def plain(value: float) -> str:
    """A tick's number as people write it."""
    return f"{value:.3g}"


def log_axis(axes: Axes, name: str, limits: tuple[float, float], words: Callable[[float], str]) -> None:
    """Makes axis "x" or "y" logarithmic, without minor ticks: ticks at powers of ten and, where these are few, at three
    times them."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axes.set(**{f"{name}scale": "log", f"{name}lim": limits})
    axis = axes.xaxis if name == "x" else axes.yaxis
    decades = math.log10(limits[1] / limits[0])
    subs = (1.0, 3.0) if decades < 3.2 else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs, numticks=30 if decades < 15.0 else 9))
    axis.set_major_formatter(FuncFormatter(lambda value, _: words(value)))
    axis.set_minor_locator(NullLocator())


def note(axes: Axes, words: str, at: tuple[float, float], rise_pt: float = 0.0, **more: Any) -> None:
    """Small text so many points above a place, which is in data coordinates unless `xycoords` says otherwise."""
    settings: Settings = {"textcoords": "offset points", "fontsize": 8.0, "zorder": 13, "annotation_clip": False} | more
    axes.annotate(words, at, xytext=(0.0, rise_pt), **settings)


def title(axes: Axes, words: str, detail: str = "") -> None:
    """A bold title, flush left, and a muted line of detail under it."""
    place: Settings = {"xycoords": "axes fraction", "va": "bottom"}
    note(axes, words, (0, 1), 20.0 if detail else 8.0, fontsize=10.5, fontweight="bold", **place)
    note(axes, detail, (0, 1), 7.0, fontsize=8.5, color=MUTED, **place)


def floor_marks(axes: Axes, x: Any, colour: str) -> None:
    """Hollow triangles on the floor of the axes: an error too small to be known."""
    if len(x):
        floor = [axes.get_ylim()[0]] * len(x)
        axes.plot(x, floor, "v", ms=5.5, mfc=PAPER, mec=colour, mew=1.1, clip_on=False, zorder=12)


# -- files --------------------------------------------------------------------------------


def svg_text(figure: Figure) -> str:
    """The figure as an SVG document."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()


def save(figure: Figure, stem: Path) -> str:
    """Write `stem`.png (160 dpi) and `stem`.svg, each whole or not at all; returns the SVG document."""
    with atomic_output(stem.with_name(stem.name + ".png")) as temporary:
        figure.savefig(temporary, format="png", dpi=160)
    document = svg_text(figure)
    with atomic_output(stem.with_name(stem.name + ".svg")) as temporary:
        temporary.write_text(document, encoding="utf-8")
    return document


def inline_svg(document: str, prefix: str, label: str) -> str:
    """An SVG document as an element for an HTML page: no name spaces, ids made unique by `prefix`, colours as CSS
    variables.

    label: what the plot shows, for those who cannot see it; must already be escaped.
    """
    text = document[document.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", text)
    text = text.replace("xlink:href=", "href=")
    text = re.sub(r'\b(id|href)="(#?)', rf'\1="\g<2>{prefix}-', text)
    text = text.replace("url(#", f"url(#{prefix}-")
    # `patch_1` and similar ids are not used.
    referenced = set(re.findall(r'(?:href="#|url\(#)([^")]+)', text))
    text = re.sub(r' id="([^"]*)"', lambda found: found[0] if found[1] in referenced else "", text)
    for name, (on_paper, _) in PALETTE.items():
        text = text.replace(on_paper, f"var(--{name})")
    return text.replace("<svg", f'<svg role="img" aria-label="{label}"', 1)
