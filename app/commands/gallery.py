"""The gallery command: a static site of all shipped scenes and lessons, a page each; what is there is kept."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import UserError, suggestion
from ..base.interrupts import Interruption, interrupt_flag
from ..base.paths import assets_dir, shipped_scenes
from ..base.version import __version__
from .opened import finished
from .printing import note
from .table import Gallery

if TYPE_CHECKING:
    from ..gpu.context import Context

_MADE = "made.json"
_MAKERS = (assets_dir() / "page", Path(__file__).parents[1] / "render" / "page")
"""Folders of what a page is made with and shown by."""


@dataclass(frozen=True)
class _Entry:
    """One page of the site."""

    name: str
    part: str
    path: Path
    title: str = ""
    words: str = ""
    steps: Sequence[Any] = ()

    @property
    def page(self) -> str:
        """Its path in the site."""
        return f"{self.part.lower()}/{self.name}.html"


def gallery(options: Gallery) -> int:
    """Make what is missing; returns the exit code. Raises `UserError`."""
    from ..base.atomic import atomic_output, make_output_folder
    from ..base.progress import ProgressReporter
    from ..gpu.context import create_context
    from ..render.page.site import write_documents

    folder, entries = options.output, list(_entries(options.scenes))
    make_output_folder(folder, "index.html", _MADE)
    for part in {entry.page.partition("/")[0] for entry in entries}:
        make_output_folder(folder / part)
    made = _made(folder)
    documents = write_documents(assets_dir().parent, folder)
    _write_index(folder, made, documents)
    todo = [entry for entry in entries if made.get(entry.page, {}).get("key") != _key(entry, options)]
    with create_context() as context, interrupt_flag() as interrupted, ProgressReporter("gallery") as progress:
        for number, entry in enumerate(todo):

            def report(share: float, name: str, done: int = number) -> None:
                progress((done + share) / len(todo), name)

            found = _make(context, entry, options, folder, report, interrupted)
            made[entry.page] = found | {"key": _key(entry, options)}
            with atomic_output(folder / _MADE) as temporary:
                temporary.write_text(json.dumps(made, indent=1, ensure_ascii=False), encoding="utf-8")
            _write_index(folder, made, documents)
    print(f"{folder.resolve()}: {sum(bool(m['page']) for m in made.values())} pages; open index.html, or upload it all")
    return 0


def _entries(wanted: Sequence[str]) -> Iterator[_Entry]:
    """All, or those that are named. Raises `UserError` for unknown names."""
    from ..edit.lessons import lessons

    found = [_Entry(each.name, "Lessons", each.path, each.title, each.words, each.page) for each in lessons()]
    found += [_Entry(name, "Scenes", path) for name, path in shipped_scenes().items()]
    names = [entry.name for entry in found]
    for name in wanted:
        if name not in names:
            raise UserError(
                f"there is no shipped scene or lesson '{name}'{suggestion(name, names) or ','} there are "
                f"{', '.join(names)}"
            )
    yield from (entry for entry in found if not wanted or entry.name in wanted)


def _key(entry: _Entry, options: Gallery) -> str:
    """Another one where the page would be another."""
    said = [__version__, options.photons, entry.title, entry.words, list(entry.steps)]
    makers = b"".join(path.read_bytes() for folder in _MAKERS for path in sorted(folder.glob("*.*")))
    return hashlib.sha256(entry.path.read_bytes() + makers + json.dumps(said).encode()).hexdigest()[:16]


def _made(folder: Path) -> dict[str, dict[str, Any]]:
    try:
        known = json.loads((folder / _MADE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return {page: entry for page, entry in known.items() if not entry["page"] or (folder / entry["page"]).is_file()}


def _make(
    context: Context,
    entry: _Entry,
    options: Gallery,
    folder: Path,
    report: Callable[[float, str], None],
    interrupted: Interruption,
) -> dict[str, Any]:
    """A page and its picture; what the list says of them."""
    from ..edit.parameters import Stage
    from ..model.io.scene_file import load_scene
    from ..model.settings import RenderSettings
    from ..render.page.page import page_size, page_steps, words_of

    scene = load_scene(entry.path)
    words = words_of(scene, entry.path)
    if entry.words:
        words = replace(words, title=entry.title, description=entry.words, steps=entry.steps)
    width, height = page_size(scene)
    settings = RenderSettings(
        width=width, height=height, max_depth=scene.render.max_depth, photons=options.photons,
        exposure_ev=scene.render.exposure_ev, glare=scene.render.glare,
    )  # fmt: skip
    steps = page_steps(context, Stage(scene, scene.camera), settings, None, words)
    card = {"part": entry.part, "title": words.title, "words": "", "picture": None, "page": None}
    try:
        page = finished(steps, report, entry.name, interrupted, "the same command goes on with what is missing")
    except UserError as error:
        note(f"{entry.name}: {error}")
        return card | {"words": str(error)}
    picture = Path(entry.page).with_suffix(".jpg").as_posix()
    page.to_html(folder / entry.page)
    (folder / picture).write_bytes(np.asarray(page.arrays["still"]).tobytes())
    return card | {"page": entry.page, "picture": picture}


def _write_index(folder: Path, made: dict[str, dict[str, Any]], documents: str | None) -> None:
    from ..render.page.site import Card, write_index

    parts: dict[str, list[Card]] = {"Lessons": [], "Scenes": []}
    for entry in made.values():
        parts[entry["part"]].append(Card(*(entry[name] for name in ("title", "words", "picture", "page"))))
    write_index(folder, {heading: cards for heading, cards in parts.items() if cards}, documents)
