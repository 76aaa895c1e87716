"""Reports as pages: the templates of assets/templates, filled in; every text is escaped unless it is `Markup`."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cache

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from ...base.paths import assets_dir
from .style import PALETTE, inline_svg


@dataclass(frozen=True)
class Table:
    """A table; the first cell of each row is its heading."""

    headings: Sequence[str]
    rows: Iterable[Sequence[object]]
    caption: str = ""
    title: str = ""
    numbers: Collection[str] | None = None
    """Headings of the columns that are flush right; None: all but the first."""

    def is_number(self, column: int) -> bool:
        """Whether a column is flush right."""
        return column > 0 if self.numbers is None else self.headings[column] in self.numbers


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
