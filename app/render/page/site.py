"""A site of pages: the page that lists them, and the project's documents as HTML."""

from __future__ import annotations

import html
import os
import re
import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

from ...base.atomic import atomic_output
from ...base.paths import assets_dir

_PICTURES = (".png", ".jpg", ".svg")
_STYLE = """
.cards { display: grid; grid-template-columns: repeat(auto-fill, minmax(260px, 1fr)); gap: 18px; padding: 0; }
.cards li { list-style: none; } .cards img { width: 100%; border-radius: 6px; display: block; }
.cards a { color: inherit; text-decoration: none; } .cards b { display: block; margin-top: 6px; }
h2 { font-size: 1.2rem; } a { color: var(--accent); }
article { max-width: 90ch; overflow-x: auto; } article img { max-width: 100%; }
table { border-collapse: collapse; } td, th { border: 1px solid var(--line); padding: 4px 8px; text-align: left; }
pre { overflow-x: auto; background: var(--field); padding: 8px 12px; } td img { max-width: 260px; }
"""


@dataclass(frozen=True)
class Card:
    """One scene of the list."""

    title: str
    words: str
    picture: str | None
    """Path in the site, as the next."""
    page: str | None
    """None where it has no page; `words` say why."""


def write_index(folder: Path, parts: dict[str, list[Card]], documents: str | None) -> None:
    """`parts`: cards by the heading over them; `documents`: path of the first one."""
    text = "<h1>Caustics to play with</h1><p>Every picture opens a page whose light can be changed.</p>"
    text += f'<p><a href="{documents}">About SpectraSplat</a></p>' if documents else ""
    for heading, cards in parts.items():
        text += f'<h2>{html.escape(heading)}</h2><ul class="cards">{"".join(map(_card, cards))}</ul>'
    _write(folder / "index.html", "Caustics to play with", text)


def _card(card: Card) -> str:
    title, words = html.escape(card.title), html.escape(card.words[:1].upper() + card.words[1:])
    picture = f'<img src="{card.picture}" alt="" loading="lazy">' if card.picture else ""
    inside = f"{picture}<b>{title}</b>"
    inside = f'<a href="{card.page}">{inside}</a>' if card.page else inside
    return f"<li>{inside}{words}</li>"


def _write(path: Path, title: str, content: str) -> None:
    style = (assets_dir() / "page" / "page.css").read_text(encoding="utf-8") + _STYLE
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_output(path) as temporary:
        temporary.write_text(
            '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f"<title>{html.escape(title)}</title><style>{style}</style></head><body>{content}</body></html>\n",
            encoding="utf-8",
        )


def write_documents(root: Path, folder: Path) -> str | None:
    """The Markdown documents of the project in `root` as HTML with their pictures, at the same places in `folder`;
    path of the first one. None where there are none: an installed program has no documents."""
    sources = [*root.glob("*.md"), *(root / "docs").glob("*.md")] if (root / "docs").is_dir() else []
    names = {source.relative_to(root).as_posix() for source in sources}
    for source in sources:
        tokens = MarkdownIt("commonmark").enable("table").parse(source.read_text(encoding="utf-8"))
        here = source.parent.relative_to(root)
        for before, token in pairwise(tokens):
            if before.type == "heading_open":
                before.attrSet("id", re.sub(r"[^\w\- ]", "", token.content.lower()).replace(" ", "-"))
        _point_to_copies([child for token in tokens for child in token.children or ()], root, folder, here, names)
        renderer = MarkdownIt("commonmark").enable("table")
        title = next((t.content for b, t in pairwise(tokens) if b.type == "heading_open"), here.name)
        up = "../" * len(here.parts)
        content = f'<p><a href="{up}index.html">All pages</a></p>'
        content += f"<article>{renderer.renderer.render(tokens, renderer.options, {})}</article>"
        _write(folder / here / f"{source.stem}.html", title, content)
    return "README.html" if "README.md" in names else None


def _point_to_copies(tokens: Iterable[Token], root: Path, folder: Path, here: Path, names: set[str]) -> None:
    """Links and pictures of a document in `here`: other documents are HTML now, pictures are copied, and what else is
    not in the site is no link."""
    for token in tokens:
        key = {"link_open": "href", "image": "src"}.get(token.type)
        target = str(token.attrGet(key)) if key else ""
        if not key or re.match(r"[a-z]+:|#", target):
            continue
        path, _, part = target.partition("#")
        place = os.path.normpath(here / path)
        if place in names:
            token.attrSet(key, f"{path.removesuffix('.md')}.html" + (f"#{part}" if part else ""))
        elif (root / place).suffix in _PICTURES and (root / place).is_file():
            (folder / place).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(root / place, folder / place)
        elif key == "href":
            token.attrs.pop("href")
