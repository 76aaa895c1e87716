"""What works beside the engine in a frame: comparison, exports, ray overlay, cursor, thumbnails. Each has its share of
the time."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from ..base.errors import UserError
from ..base.paths import shipped_scenes
from .compare import Comparison
from .compared_with import Histogram
from .cursor_info import Cursor
from .export import Exports, Shown
from .gallery import Gallery, best_first
from .ray_overlay import RayOverlay

if TYPE_CHECKING:
    from pathlib import Path

    from ..edit import requests
    from ..edit.state import State
    from ..gpu.context import Context
    from .live_picture import LivePicture

JOB_SHARE = 0.6
"""Of a frame's budget that a running export gets."""
RENDER_SHARE = 0.95
"""Likewise a finished picture that somebody waits for."""
HISTOGRAM_S = 1.0
"""Shortest time between two histograms: each reads two pictures."""
FIRST_COMPARE_SHARE = 0.8
"""The same until there is something to compare with."""
REFERENCE_WAIT_S = 0.06
"""Of every frame, for the reference until it shows something: it is compiled in Python, whose lock drawing holds."""
COMPARE_SHARE = 0.4
"""Likewise what is compared with."""


class BackgroundJobs:
    """Owns them. `notes` collects sentences about what was finished, for the host to show."""

    def __init__(self, context: Context, config: Path) -> None:
        self.comparison = Comparison(context)
        self.exports = Exports(context)
        self.overlay = RayOverlay(context)
        self.cursor = Cursor()
        self.gallery = Gallery(context, config, best_first(shipped_scenes()))
        self.histogram: Histogram | None = None
        """Of the picture and of what it is compared with."""
        self._histogram_s = -1e9
        self.notes: list[tuple[str, bool]] = []
        """Sentence, whether it is an error."""

    @property
    def is_busy(self) -> bool:
        """The window must not sleep."""
        return self.exports.job is not None or self.comparison.is_busy

    def work(self, state: State, picture: LivePicture, budget_s: float) -> float:
        """Let exports and comparison work; returns what is left of `budget_s` for the engine."""
        started = time.perf_counter()
        left = budget_s
        if self.exports.job is not None:
            try:
                note = self.exports.step((RENDER_SHARE if self.exports.is_rendering else JOB_SHARE) * budget_s)
            except UserError as error:
                self.notes.append((str(error), True))
            else:
                if note is not None:
                    self.notes.append((note, False))
            left = budget_s - (time.perf_counter() - started)
        share = COMPARE_SHARE if picture.engine is not None and not picture.stats.converged else 1.0
        if self.comparison.picture is None:
            share = max(share, FIRST_COMPARE_SHARE)
        self.comparison.advance(state, picture.engine, share * max(left, 0.0))
        if self.comparison.is_waiting and not state.interacting:
            time.sleep(REFERENCE_WAIT_S)
        return max(budget_s - (time.perf_counter() - started), 0.2 * budget_s)

    def follow(self, state: State, drawn: State, picture: LivePicture, now_s: float) -> None:
        """After the picture is made: what lies under the cursor, where rays go. `drawn`: the state as
        the picture shows it. Raises `UserError`."""
        self.cursor.update(state, picture, now_s)
        if not state.preferences.panels.compare:
            self.histogram = None
        elif now_s - self._histogram_s > HISTOGRAM_S:
            self._histogram_s = now_s
            self.histogram = self.comparison.histogram(picture.radiance, picture.exposure_ev)
        self.overlay.update(drawn)

    def export(self, request: requests.Export, state: State, picture: LivePicture) -> None:
        """Begin what `request` asks for. Raises `UserError`."""
        if picture.shown is None or picture.radiance is None:
            raise UserError("there is no picture yet; wait a moment")
        note = self.exports.begin(
            request, state, Shown(picture.shown, picture.radiance, picture.exposure_ev, picture.stats.photons)
        )
        if note is not None:
            self.notes.append((note, False))

    def cancel_export(self) -> None:
        """Stop the running export; what is finished stays."""
        note = self.exports.stop()
        if note is not None:
            self.notes.append((note, False))

    def release(self) -> None:
        """End and free everything; before the engine is released."""
        self.cursor.release()
        self.exports.release()
        self.comparison.release()
        self.overlay.release()
        self.gallery.release()
