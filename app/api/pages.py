"""Pages: a caustic in one file, whose dispersion is dragged in any browser."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from typing import TYPE_CHECKING

from ..base.errors import UserError
from ..base.generators import finished
from .arguments import Count, Size, check_scene, settings_of
from .device import Cancel, Progress, Report, run
from .scene import Scene

if TYPE_CHECKING:
    from ..gpu.context import Context
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

    def work(context: Context, report: Report, stopped: Cancel) -> Page:
        def told(share: float) -> None:
            if stopped():
                raise UserError("the page was given up before it was whole")
            report(share, "making the page")

        with closing(page_steps(context, Stage(model, model.camera), settings, receiver, words)) as steps:
            return finished(steps, told)

    return run(work, progress, cancel)
