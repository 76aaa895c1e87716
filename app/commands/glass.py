"""The glass command: one hit is shown in full, several as a table; a plot on request."""

from __future__ import annotations

from ..base.errors import UserError
from ..model.optics.catalogue import Entry, is_guess, search, search_key
from .glass_report import describe, list_glasses, plot
from .printing import show
from .table import Glass

MAX_PLOTTED = 6
"""Curves that can be distinguished in one plot."""


def glass(options: Glass) -> int:
    """Show what a query finds, and plot it where that is asked for. Raises `UserError`."""
    hits, plot_file = _hits(options.query), options.plot
    if plot_file is not None and len(hits) > MAX_PLOTTED:
        raise UserError(
            f"--plot shows at most {MAX_PLOTTED} glasses and {len(hits)} match: give more of the name, for example "
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
