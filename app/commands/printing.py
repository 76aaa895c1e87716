"""What commands print: text as it is, tables, and notes."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from ..base.errors import plain, visible

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text as RichText

PIPE_WIDTH = 200
"""Columns where no terminal sets a limit: tables are then not cut."""


def note(sentence: str) -> None:
    """Report on stderr what was assumed or met."""
    print(f"note: {plain(sentence)}", file=sys.stderr)


def table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """A table to `show`; a heading that begins with ">" is that of a column of numbers."""
    from rich.table import Table

    made = Table(title=title, title_justify="left")
    for heading in headings:
        made.add_column(heading.lstrip(">"), justify="right" if heading[0] == ">" else "left", overflow="fold")
    for row in rows:
        made.add_row(*row)
    return made


def show(content: object) -> None:
    """Print text as it is, and rich's tables in colour where the terminal has it."""
    if isinstance(content, str):
        print(visible(content))
        return
    from rich.console import Console

    class PlainConsole(Console):
        """Names out of a file are shown as they are: they neither choose colours nor command the terminal."""

        def render_str(self, text: str, **more: Any) -> RichText:
            return super().render_str(visible(text), **more)

    console = PlainConsole(highlight=False, markup=False, emoji=False)
    if not console.is_terminal:
        console.width = PIPE_WIDTH
    console.print(content)
