"""What the interface holds between frames: one document, one engine's picture, messages, settings, and side jobs.

`frame` passes it to the panels and back; `session_requests` carries out what they request.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import UserError
from ..edit.autosave import Autosave, Recovery, recoveries
from ..edit.brush import USUAL_RADIUS
from ..edit.document import Document
from ..edit.drawn import Drawn
from ..edit.opening import Opening
from ..edit.preferences import Settings, config_dir, load_settings, save_settings
from ..edit.projection import View
from ..edit.state import Brush, Display, Selection, State
from ..gpu.context_thread import no_thread
from ..model.staging import Staging
from ..render.notices import loss_notices
from . import layout
from .background_jobs import BackgroundJobs, OpenThread
from .crash_log import write_crash
from .live_picture import EngineError, LivePicture
from .message_box import MessageBox, brief

if TYPE_CHECKING:
    from ..edit.lessons import Lesson
    from ..gpu.context import Context
    from ..model.scene import Scene
    from ..render.viewer.threaded_engine import Engine

FRAMES_REMEMBERED = 120
IDLE_S = 0.5
"""How long the window may sleep when nothing moves."""
LAYOUT_FRAMES = 3
"""Frames until docked windows have their sizes: maps fitted to another view would have to be made anew."""


class Session:
    """All of the interface but its window. Raises `UserError` when `path` cannot be opened."""

    def __init__(
        self,
        context: Context,
        path: Path | None = None,
        make_engine: Callable[[Context], Engine] | None = None,
        clock: Callable[[], float] = time.monotonic,
        opening: Opening | None = None,
        open_thread: OpenThread = no_thread,
    ) -> None:
        """`open_thread`: as of `BackgroundJobs`."""
        self.context = context
        self.settings, notice = load_settings()
        self._kept_settings = self.settings
        """As they are on the disk."""
        self.document = Document.new() if path is None else self.opened(path, opening)
        self.messages = MessageBox(clock)
        self._shown_losses: tuple[str, ...] = ()
        self.autosave = Autosave(config_dir())
        self.recovery: Recovery | None = next(iter(recoveries(config_dir())), None)
        self.picture = LivePicture(context, make_engine)
        self.drawn = Drawn()
        self.jobs = BackgroundJobs(context, open_thread)
        self.window_picture: Path | None = None
        """Where a picture of the whole window is to be written once this frame is drawn."""
        self.interface_scale = self.framebuffer_scale = 1.0
        self.asks_to_quit = self.asks_about_export = False
        self.quits_after_export = False
        """The user wants to quit once the running export is finished."""
        self._panels_before = self.settings.preferences.panels
        """Open before the lesson that is shown."""
        self._discarded: Scene | None = None
        """The scene whose changes the user agreed to lose."""
        self.is_full_screen = False
        """Wanted of the window."""
        self.wants_to_close = False
        self.frame_ms: deque[float] = deque(maxlen=FRAMES_REMEMBERED)
        self.interface_s = 0.0
        self.engine_s = self.jobs_s = 0.0
        self.clock = clock
        self.input_waits: Callable[[], bool] = lambda: False
        """Whether there is input that the next frame will see."""
        self.awaited: dict[type, Callable[[], object]] = {}
        """Questions of requests to the renderer, by the type of the request: `NOT_YET` until there is an answer."""
        self.dropped: list[Path] = []
        """Files to be opened in the next frame."""
        self.was_interacting = False
        """In the last frame."""
        self.frames = 0
        """Since the layout last changed."""
        self.reported: dict[str, str | None] = {}
        """What is wrong with the autosave and the picture, as far as the user has been shown it."""
        self.wanted_hz = 60.0
        self._frame_started = self._last_start = clock()
        self.delta_s = 1 / 60
        self.state = _first_state(
            self.document.scene, self.settings, welcome=path is None and self.recovery is not None
        )
        if notice:
            self.messages.show(notice, is_error=True)
        if path is not None and self.recovery is not None:
            self.messages.show("Work of a session that ended badly can be recovered: File, Start page.")
        if path is not None:  # the scene to begin with has no notes that matter
            self.show_notes()
        self._remember_file(path)

    # The frame

    def prepare(self) -> None:
        """Before a frame, while imgui draws nothing: what textures are made of may change now."""
        now = self.clock()
        self.delta_s = min(max(now - self._last_start, 1e-4), 0.25)
        self._frame_started = self._last_start = now
        self.picture.resize(self.state, self.jobs.comparison)
        if self.state.preferences.panels.start_page:
            self.jobs.gallery.step()

    def finished(self) -> None:
        """After the frame is on the screen."""
        self._keep_settings()
        if self.quits_after_export and self.jobs.exports.job is None:
            self.quits_after_export = False
            self.quit()
        self.frame_ms.append(1000.0 * (self.clock() - self._frame_started))

    def wait_s(self) -> float:
        """Seconds the window may sleep when no event comes; 0 while anything moves."""
        state = self.state
        moves = (
            state.interacting
            or (state.preferences.panels.start_page and self.jobs.gallery.is_busy)
            or self.jobs.is_busy
            or self.messages.is_fading
            or self.picture.is_busy
            or bool(self.awaited)
            or (state.display.auto_exposure and self.picture.is_settling)
            or (state.playing and self.picture.engine is not None and not self.picture.stats.converged)
        )
        return 0.0 if moves else IDLE_S

    def renderer_stopped(self, error: Exception) -> None:
        """The picture cannot go on: keep the work and say so."""
        self.save_from_crash("rendering", error)
        self.messages.show(
            f"The renderer stopped ({brief(error)}). Your work is kept; press F5 to try again.",
            is_error=True,
            stays=True,
        )

    # What requests use

    def opened(self, path: Path, opening: Opening | None = None) -> Document:
        """The document in the file at `path`, with what its user said of it before. Raises `UserError`."""
        return Document.open(path, opening or Opening(Staging(up=self.settings.up_of(path))))

    def toggle_full_screen(self) -> None:
        """The window over the whole screen, or back."""
        self.is_full_screen = not self.is_full_screen

    def show_scene(self, scene: Scene) -> None:
        """Another scene of the same document, as after undo; what was selected stays if it is still there."""
        selection = self.state.selection
        things = {"object": scene.objects, "light": scene.lights, "camera": (scene.camera,), None: ()}[selection.kind]
        if selection.index >= len(things):
            selection = Selection()
        # A view through the scene's camera stays one.
        camera = scene.camera if self.state.camera == self.state.scene.camera else self.state.camera
        self.state = replace(self.state, scene=scene, camera=camera, selection=selection, pull=None)

    def welcome(self) -> None:
        """Open the start page for somebody who has never seen it."""
        if self.settings.is_new:
            self.state = self.state.with_panels(start_page=True)
            self.settings = replace(self.settings, is_new=False)

    def show_document(self, document: Document) -> None:
        """Take up another document. Preferences stay as they are, and of the display what belongs to no scene."""
        self.document = document
        kept, display = self.state, self.state.display
        if kept.lesson:  # the panels that were opened for it close with it
            preferences = replace(kept.preferences, panels=self._panels_before)
            kept = replace(kept, preferences=preferences, compare=replace(kept.compare, mode="off"))
        self.state = State(
            document.scene,
            document.scene.camera,
            display=Display(
                tone=display.tone,
                false_colour_stops=display.false_colour_stops,
                ray_wavelengths=display.ray_wavelengths,
                ray_labels=display.ray_labels,
            ),
            brush=kept.brush,
            compare=kept.compare,
            preferences=kept.preferences,
            method=kept.method,
            smoothing=kept.smoothing,
            playing=kept.playing,
            viewport_size=kept.viewport_size,
            clipboard=kept.clipboard,
        ).with_panels(start_page=False)
        self.awaited.clear()
        self.picture.new_scene()
        self.show_notes()
        self._remember_file(document.source)

    def show_lesson(self, lesson: Lesson) -> None:
        """A lesson's scene, with what it is about selected and its rays drawn. Raises `UserError`."""
        self.show_document(Document.open(lesson.path))
        self._panels_before = self.state.preferences.panels
        names = [item.name for item in self.state.scene.objects]
        chosen = Selection("object", names.index(lesson.select)) if lesson.select in names else Selection()
        if lesson.rays:
            layout.raise_panel("rays")
        state = replace(self.state, lesson=lesson.name, selection=chosen).with_display(
            ray_overlay=lesson.rays, ray_count=lesson.ray_count, ray_reflections=lesson.reflections
        )
        if lesson.target:
            state = replace(state, solve=replace(state.solve, plate_target=lesson.path.parent / lesson.target))
        self.state = state.with_panels(lesson=True, rays=lesson.rays or self._panels_before.rays)

    def show_losses(self) -> None:
        """Once a picture is whole, show what of its light was lost."""
        stats = self.picture.stats
        if stats.converged and stats.photons:
            lost = tuple(loss_notices(stats.lost))
            for notice in lost:
                if notice not in self._shown_losses:
                    self.messages.show(notice)
            self._shown_losses = lost

    def show_notes(self) -> None:
        """Show what was assumed while loading."""
        for note in self.document.scene.notes:
            self.messages.show(note)

    def reload_shaders(self) -> None:
        """Compile the shaders from disk; the last good programs stay when that fails."""
        try:
            self.picture.reload_shaders()
        except EngineError as error:
            self.renderer_stopped(error)

    def save_from_crash(self, doing: str, error: BaseException) -> None:
        """Write autosave and crash log."""
        if self.document.unsaved:
            self.autosave.write_now(self.document.scene, self.document.title, self.document.source)
        write_crash(config_dir(), doing, error.__cause__ or error, self.context.renderer)

    def drop(self, paths: list[Path]) -> None:
        """Files were dropped on the window: the first one is opened in the next frame."""
        self.dropped = paths[:1]

    def quit(self, discard: bool = False) -> None:
        """Close, or ask first where work is unsaved and not to be discarded, or an export is not finished."""
        if discard:
            self._discarded, self.asks_to_quit = self.document.scene, False
        if self.document.unsaved and self.document.scene is not self._discarded:
            self.asks_to_quit = True
        elif self.jobs.exports.job is not None:
            self.asks_about_export = True
        else:
            self.wants_to_close = True

    def stay(self) -> None:
        """Do not close after all; ask again next time."""
        self.asks_to_quit = self.asks_about_export = self.quits_after_export = False
        self._discarded = None

    def _remember_file(self, path: Path | None) -> None:
        if path is not None:
            self.settings = self.settings.opened(path)

    def close(self) -> list[str]:
        """The end in good order: settings are remembered, nothing is left to recover. As `release`."""
        self.autosave.close()
        self._keep_settings()
        return self.release()

    def _keep_settings(self) -> None:
        """Write what is remembered as soon as it changes, but not while something is dragged: a crash costs none of
        it."""
        if self.settings != self._kept_settings and not self.state.interacting:
            self._kept_settings = self.settings
            with suppress(UserError):
                save_settings(self.settings)

    def release(self) -> list[str]:
        """Free what the device holds, once exports are written; sentences about what could not be."""
        problems = self.jobs.release()
        self.picture.release()
        return problems


def _first_state(scene: Scene, settings: Settings, welcome: bool) -> State:
    view = View.of(scene.camera, 1.0)
    brush = Brush(radius=USUAL_RADIUS * view.height_at(view.target_distance))
    state = State(scene=scene, camera=scene.camera, preferences=settings.preferences, brush=brush)
    # Opening Compare begins a second picture, which is not wanted at a start.
    return state.with_panels(start_page=welcome, compare=False)
