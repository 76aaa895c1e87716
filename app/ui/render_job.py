"""A picture rendered in the window: size, photons or seconds, samples, layers; as `spectrasplat render` makes it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.atomic import check_writable
from ..base.errors import UserError
from ..base.image_io import SHOWN_SUFFIXES, SPECTRAL_SUFFIXES, check_finite, check_suffix, write_image
from ..base.memory import check_picture_memory
from ..edit.requests import RenderPicture
from ..model.settings import RenderSettings
from ..render.notices import FrameNotices, frame_notices

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..edit.parameters import Stage
    from ..gpu.context import Context

    Develop = Callable[[Path, np.ndarray], None]

_CAUSTIC_SHARE = 0.2
"""Of the time, for the layer of the caustics alone: light is traced once, and their camera samples are cheap."""


@dataclass
class Course:
    """What the rendering tells while it works, and what it is told."""

    phase: str = "preparing"
    """What it is at."""
    is_stopped: bool = False
    """Somebody waited long enough: what is done by then becomes the picture."""

    def stops(self) -> bool:
        """`is_stopped`, to be asked."""
        return self.is_stopped


def layer_path(path: Path, layer: str) -> Path:
    """Where another layer of the picture at `path` goes: a.png, a_caustic.png."""
    return path.with_name(f"{path.stem}_{layer}{path.suffix}")


def render_picture(
    context: Context,
    request: RenderPicture,
    stage: Stage,
    settings: RenderSettings,
    write_shown: Develop,
    notices: FrameNotices,
    course: Course,
) -> Iterator[float]:
    """Shares of the work from 0 to 1; files are written whole at its end. `write_shown`: writes a linear picture as the
    window shows it. Raises `UserError` before the first share for what cannot be rendered or written."""
    suffix = check_suffix(request.path)
    if request.bins is not None and suffix not in SPECTRAL_SUFFIXES:
        names = " or ".join(SPECTRAL_SUFFIXES)
        raise UserError(f"cannot write spectral bins to {request.path.name}: choose a name that ends in {names}")
    if request.caustic and request.seconds is not None:
        raise UserError("a caustic layer needs a number of photons, not a time: its samples come on top")
    targets = [request.path, *([layer_path(request.path, "caustic")] if request.caustic else [])]
    for target in targets:
        check_writable(target)
    settings = replace(
        settings,
        photons=None if request.seconds is not None else request.photons,
        seconds=request.seconds,
        spp=request.samples,
        bins=request.bins,
    )
    check_picture_memory(settings.width, settings.height, settings.bins)
    return _work(context, request, targets, stage, settings, write_shown, notices, course)


def _work(
    context: Context,
    request: RenderPicture,
    targets: list[Path],
    stage: Stage,
    settings: RenderSettings,
    write_shown: Develop,
    notices: FrameNotices,
    course: Course,
) -> Iterator[float]:
    from ..render.frames import FrameRenderer

    # From the first dispatch on: who asks for a minute waits for a minute.
    renderer = FrameRenderer(context, settings, [stage], time.perf_counter())
    try:
        own = 0.98 - (_CAUSTIC_SHARE if request.caustic else 0.0)
        for share in renderer.steps(stage, course.stops):
            course.phase = renderer.phase
            yield own * share
        pictures = [renderer.picture]
        notices.take(frame_notices(renderer.light, stage.camera, settings, pictures[0].rgb))
        if request.caustic:
            for share in renderer.steps_of_layer("caustic", stage, course.stops):
                yield own + _CAUSTIC_SHARE * share
            pictures.append(renderer.picture)
    finally:
        renderer.release()
    course.phase = "writing the picture"
    yield 0.98
    for target, picture in zip(targets, pictures, strict=True):
        if target.suffix.lower() in SHOWN_SUFFIXES:
            check_finite(target.name, picture.rgb)
            write_shown(target, picture.rgb)
        else:
            write_image(target, picture.rgb, spectral=picture.spectral, bin_edges_nm=picture.bin_edges_nm)
