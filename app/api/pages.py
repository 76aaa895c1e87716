"""Pages: a caustic in one file, whose dispersion is dragged in any browser."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from .arguments import Count, Size, check_scene, settings_of
from .device import Cancel, Progress, worked_out
from .scene import Scene

if TYPE_CHECKING:
    from ..render.page.page import Page


def page(
    scene: Scene,
    receiver: str | None = None,
    *,
    size: Size | None = None,
    photons: Count | None = None,
    seed: int | None = None,
    title: str | None = None,
    description: str | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Page:
    """The light on `receiver` (default: that on which most lands) as a page: `page(scene).to_html("page.html")`.

    `size`: pixels of its picture. `photons`: how many it is made of, 100,000 by default. `title`, `description`: words
    of the page; default: the scene's name and what its file begins by saying. Once `cancel()` returns true, `UserError`
    says so. Raises `UserError`.
    """
    from ..edit.parameters import Stage
    from ..render.page.page import DEFAULT_PHOTONS, page_size, page_steps, words_of

    check_scene(scene)
    model = scene._model
    settings = settings_of(scene, size=size or page_size(model), photons=photons or DEFAULT_PHOTONS, seed=seed)
    words = words_of(model, scene._file)
    said = words.description if description is None else description
    words = replace(words, title=title or words.title, description=said)

    stage = Stage(model, model.camera)
    return worked_out(
        "making the page",
        lambda context: page_steps(context, stage, settings, receiver, words),
        progress,
        cancel,
        "the page was given up before it was whole",
    )
