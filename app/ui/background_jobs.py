"""What works in a frame in addition to the engine, each with its share of the time: comparison, exports, ray overlay,
cursor."""

from __future__ import annotations

import time
from collections.abc import Callable

from ..base.errors import UserError
from ..base.paths import shipped_scenes
from ..edit import requests
from ..edit.state import State
from ..gpu.context import Context
from ..gpu.context_thread import ContextThread, no_thread
from ..render.viewer.rehearsal import Rehearsals
from .compare import Comparison, engine_beside
from .cursor_info import Cursor
from .export import Exports, Shown
from .gallery import Gallery, best_first
from .live_picture import LivePicture
from .ray_overlay import RayOverlay

JOB_SHARE = 0.6
"""Share of a frame's budget that a running export gets."""
RENDER_SHARE = 0.95
"""The share of a finished picture, for which somebody waits."""
OpenThread = Callable[[str], "ContextThread | None"]

COMPARE_SHARE = 0.4
"""The share of what is compared with."""
FIRST_COMPARE_SHARE = 0.8
"""The same until there is something to compare with."""
REFERENCE_WAIT_S = 0.06
"""Left free in every frame for the reference until it shows something: it is compiled in Python, whose lock drawing
holds."""


class BackgroundJobs:
    """Owns them, and their threads."""

    def __init__(self, context: Context, open_thread: OpenThread = no_thread) -> None:
        """`open_thread`: opens a thread of that name, which has a context that shares `context`'s objects."""
        self._open_thread = open_thread
        self._threads: dict[str, ContextThread | None] = {}
        self.comparison = Comparison(
            context,
            lambda context: engine_beside(context, open_thread("comparison")),
            lambda: self._thread("reference"),
        )
        self.exports = Exports(context, lambda: self._thread("export"))
        self._rehearsals = Rehearsals(lambda: self._thread("rehearsal"))
        self.overlay = RayOverlay(context)
        self.cursor = Cursor()
        self.gallery = Gallery(context, best_first(shipped_scenes()))
        self.engine_rests = False
        """In the last frame it left all time to an export."""
        self.notes: list[tuple[str, bool]] = []
        """What was finished or failed: a sentence, and whether it is an error."""

    @property
    def is_busy(self) -> bool:
        """The window must not sleep."""
        return self.exports.is_busy or self.comparison.is_busy

    def _thread(self, name: str) -> ContextThread | None:
        """The thread of that name, opened when it is first wanted."""
        if name not in self._threads:
            self._threads[name] = self._open_thread(name)
        return self._threads[name]

    def work(self, state: State, picture: LivePicture, budget_s: float) -> float:
        """Let exports and comparison work; returns what is left of `budget_s` for the engine: nothing while an
        export runs, nobody touches anything, and the picture on the screen lacks nothing but photons."""
        started = time.perf_counter()
        self.export_on(budget_s)
        left = budget_s - (time.perf_counter() - started)
        share = COMPARE_SHARE if picture.engine is not None and not picture.stats.converged else 1.0
        if self.comparison.picture is None:
            share = max(share, FIRST_COMPARE_SHARE)
        elif not picture.is_presentable:
            share = 0.0  # a picture in blocks is compared with nothing
        self.comparison.advance(state, picture.engine, share * max(left, 0.0))
        if self.comparison.is_waiting and not state.interacting:
            time.sleep(REFERENCE_WAIT_S)
        inputs = None if picture.engine is None else picture.engine.inputs
        if inputs is not None and picture.is_presentable and not (state.interacting or self.is_busy):
            self._rehearsals.follow(inputs)
        is_exporting = self.exports.job is not None
        self.engine_rests = is_exporting and not state.interacting and picture.is_presentable
        if self.engine_rests:
            return 0.0
        return max(budget_s - (time.perf_counter() - started), 0.2 * budget_s)

    def export_on(self, budget_s: float) -> None:
        """Let exports work, and note what became of them."""
        if not self.exports.is_busy:
            return
        try:
            self._note(self.exports.step((RENDER_SHARE if self.exports.is_rendering else JOB_SHARE) * budget_s))
        except UserError as error:
            self.notes.append((str(error), True))

    def _note(self, sentence: str | None) -> None:
        if sentence is not None:
            self.notes.append((sentence, False))

    def follow(self, state: State, drawn: State, picture: LivePicture, now_s: float) -> None:
        """After the picture is made: what is under the cursor, and the paths of rays. `drawn`: the state as the picture
        shows it. Raises `UserError`."""
        self.cursor.update(state, picture, now_s)
        self.overlay.update(drawn)

    def export(self, request: requests.Export, state: State, picture: LivePicture) -> None:
        """Begin what `request` asks for. Raises `UserError`."""
        if picture.shown is None:
            raise UserError("there is no picture yet; wait a moment")
        shown = Shown(picture.shown, picture.radiance, picture.exposure_ev, picture.stats.photons)
        self.exports.begin(request, state, shown)

    def finish_export(self) -> None:
        """End the running export with what is done by now, and wait for that."""
        if not self.exports.is_stopped:
            self.cancel_export()
        while self.exports.job is not None:
            self.export_on(0.1)

    def cancel_export(self) -> None:
        """Stop the running export; what is finished stays."""
        self._note(self.exports.stop())

    def release(self) -> list[str]:
        """End and free everything, before the engine is released; sentences about what could not be written."""
        self._rehearsals.release()
        self.cursor.release()
        problems = self.exports.release()
        self.comparison.release()
        self.overlay.release()
        self.gallery.release()
        for thread in self._threads.values():
            if thread is not None:
                thread.close()
        self._threads.clear()
        return problems
