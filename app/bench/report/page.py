"""Reports as pages: tables, the templates of assets/templates filled in, and what the bench's page says of methods,
metrics and protocol.

Every text is escaped unless it is `Markup`."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from ...base.paths import assets_dir
from .style import PALETTE, inline_svg

if TYPE_CHECKING:
    import rich.table

_ESCAPED_BAR = r"\|"


@dataclass(frozen=True)
class Table:
    """A table; the first cell of each row is its heading."""

    headings: Sequence[str]
    rows: Sequence[Sequence[object]]
    caption: str = ""
    title: str = ""
    words: Collection[str] = ()
    """Headings of columns that hold words and are flush left, as the first one is."""

    def is_number(self, column: int) -> bool:
        """Whether a column is flush right."""
        return column > 0 and self.headings[column] not in self.words

    def markdown(self) -> str:
        """The rows for a document; what would end a cell is escaped."""
        lines = [self.headings, ["---"] * len(self.headings), *self.rows]
        return "\n".join(f"| {' | '.join(str(c).replace('|', _ESCAPED_BAR) for c in line)} |" for line in lines)

    def on_screen(self, leave_out: Collection[str] = ()) -> rich.table.Table:
        """The table on a terminal, without columns that would make it too wide."""
        import rich.table

        shown = rich.table.Table(title=self.title or None, title_justify="left")
        kept = [column for column, heading in enumerate(self.headings) if heading not in leave_out]
        for column in kept:
            is_number = self.is_number(column)
            shown.add_column(self.headings[column], justify="right" if is_number else "left", overflow="fold")
        for row in self.rows:
            shown.add_row(*(str(row[column]) for column in kept))
        return shown


@cache
def _environment() -> Environment:
    made = Environment(
        loader=FileSystemLoader(assets_dir() / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.globals["palette"] = PALETTE
    return made


def render(template: str, **values: object) -> str:
    """The page by a template's name, "bench.html" say. Raises jinja2.UndefinedError where a value is missing."""
    return _environment().get_template(template).render(values)


def inlined(document: str, prefix: str, label: str) -> Markup:
    """An SVG document as an element of the page; `label` says what it shows."""
    return Markup(inline_svg(document, prefix, str(Markup.escape(label))))


@dataclass(frozen=True)
class Prose:
    """One pass's explanations: assets/templates/bench_prose.toml, which a writer may edit."""

    methods: Mapping[str, str]
    metrics: Mapping[str, str]
    stages: Mapping[str, str]
    protocol: tuple[str, ...]
    not_covered: Mapping[str, str]


def _prose() -> dict[str, Prose]:
    held = tomllib.loads((assets_dir() / "templates" / "bench_prose.toml").read_text(encoding="utf-8"))
    common = held["light"]["metrics"]
    return {name: Prose(**(entry | {"metrics": common | entry["metrics"]})) for name, entry in held.items()}


PROSE = _prose()
"""By the name of the measured pass; metrics that a pass does not describe are the light pass's."""
