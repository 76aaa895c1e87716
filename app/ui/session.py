"""The host of the interface: one document, one engine, and the frame that goes round between them.

`frame` tells the panels what there is (`Facts`), takes the state they return, records what they
edited, carries their requests out and lets the engine work on it, so that the picture drawn in a
frame already answers the input of that frame. No window is needed; `window` and `headless` show it.
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
from ..edit import requests
from ..edit.autosave import Autosave, Recovery, recoveries
from ..edit.document import Document
from ..edit.preferences import Settings, config_dir, load_settings, save_settings
from ..edit.state import Selection, State
from ..gpu.shader_watch import ShaderWatch
from . import session_requests
from .background_jobs import BackgroundJobs
from .crash_log import write_crash
from .export import write_codes
from .live_picture import EngineError, LivePicture
from .message_box import MessageBox
from .sentences import brief, sentence, words
from .view_model import ViewModel

if TYPE_CHECKING:
    import numpy as np

    from ..gpu.context import Context
    from ..model.scene import Scene
    from ..render.viewer.engine import LiveEngine

Draw = Callable[[State, ViewModel], State]
DEFAULT_BUDGET_S = 0.03
FRAMES_REMEMBERED = 120
IDLE_S = 0.5
"""How long the window may sleep when nothing moves: shaders on disk are looked at then."""
LAYOUT_FRAMES = 3
"""Frames until docked windows have their sizes: maps fitted to another view would have to be made anew."""
THUMBNAIL_S = 0.1
"""How long it may sleep while thumbnails are made."""


class Session:
    """Everything but the window. Raises `UserError` when `path` cannot be opened."""

    def __init__(
        self,
        context: Context,
        path: Path | None = None,
        make_engine: Callable[[Context], LiveEngine] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.context = context
        self.document = Document.new() if path is None else Document.open(path)
        self.settings, notice = load_settings()
        self.messages = MessageBox(clock)
        self.autosave = Autosave(config_dir())
        self.recovery: Recovery | None = next(iter(recoveries(config_dir())), None)
        self.picture = LivePicture(context, make_engine)
        self.companions = BackgroundJobs(context, config_dir())
        self.window_picture: Path | None = None
        """Where a picture of the whole window is to be written once this frame is drawn."""
        self.interface_scale = self.framebuffer_scale = 1.0
        self.asks_to_quit = False
        self.wants_to_close = False
        self.frame_ms: deque[float] = deque(maxlen=FRAMES_REMEMBERED)
        self.interface_s = 0.0
        self.engine_s = 0.0
        self._clock = clock
        self._watch = ShaderWatch(clock=clock)
        self._dropped: list[Path] = []
        self._was_interacting = False
        self._frames = 0
        self._told: str | None = None
        self._frame_started = self._last_start = clock()
        self.delta_s = 1 / 60
        self.state = _first_state(
            self.document.scene, self.settings, welcome=path is None and self.recovery is not None
        )
        if notice:
            self.messages.tell(notice, is_error=True)
        if path is not None and self.recovery is not None:
            self.messages.tell("Work of a session that ended badly can be recovered: File, Start page.")
        self.tell_notes()
        self._remember_file(path)

    # The frame

    def prepare(self) -> None:
        """Before a frame, while imgui draws nothing: what textures are made of may change now."""
        now = self._clock()
        self.delta_s = min(max(now - self._last_start, 1e-4), 0.25)
        self._frame_started = self._last_start = now
        self.picture.resize(self.state, self.companions.comparison)
        if self._watch.changed():
            self.reload_shaders()
        if self._may_make_thumbnails():
            self.companions.gallery.step()

    def frame(self, draw: Draw, budget_s: float = DEFAULT_BUDGET_S) -> None:
        """Draw the interface with `draw`, within imgui's frame, and answer it; the engine works for about
        `budget_s`."""
        from .view_model_builder import view_model_of

        view_model = view_model_of(self)
        before = replace(self.state, interacting=False, hover=None, requests=())
        started = self._clock()
        after = self._with_dropped(draw(before, view_model), view_model)
        self.interface_s = self._clock() - started
        self._accept(before, after)
        for request in after.requests:
            self._carry_out(request)
        self.autosave.update(self.document.scene, self.document.title, self.document.source, self.document.unsaved)
        self._work(budget_s)
        self._was_interacting = self.state.interacting

    def wait_for_layout(self) -> None:
        """The window's size has changed before anything was made for it: leave the engine alone for some frames
        more."""
        self._frames = 0

    def finished(self) -> None:
        """After the frame is on the screen."""
        self.frame_ms.append(1000.0 * (self._clock() - self._frame_started))

    def wait_s(self) -> float:
        """Seconds the window may sleep when no event comes; 0 while anything moves."""
        state = self.state
        if self.companions.gallery.is_busy and self._may_make_thumbnails():
            return THUMBNAIL_S
        moves = (
            state.interacting
            or self.companions.is_busy
            or self.messages.is_fading
            or (state.display.auto_exposure and self.picture.is_settling)
            or (state.playing and self.picture.engine is not None and not self.picture.stats.converged)
        )
        return 0.0 if moves else IDLE_S

    def _may_make_thumbnails(self) -> bool:
        """While they are looked for, or when there is nothing else to do."""
        return self.state.preferences.panels.start_page or self.picture.stats.converged

    def _accept(self, before: State, after: State) -> None:
        """Take over what the panels returned; an edited scene is a step of undo."""
        self.state = replace(after, requests=())
        if after.scene is not before.scene:
            self.document.history.push(
                after.edit_label or "Edit", after.scene, merge=after.interacting or self._was_interacting
            )
        if not after.interacting:
            self.document.history.settle()
        if after.preferences != self.settings.preferences:
            self.settings = replace(self.settings, preferences=after.preferences)

    def _carry_out(self, request: requests.Request) -> None:
        """One request; whatever goes wrong becomes a sentence."""
        try:
            session_requests.carry_out(self, request)
        except UserError as error:
            self.messages.tell(sentence(str(error)), is_error=True)
        except Exception as error:  # noqa: BLE001 - a bug: the work and the window outlive it
            self.save_from_crash(f"{type(request).__name__}", error)
            self.messages.tell(
                f"{words(request)} failed by a fault of the program ({brief(error)}); your work is kept.", is_error=True
            )

    def _work(self, budget_s: float) -> None:
        """Let the engine work and show its picture."""
        self.engine_s = 0.0
        self._frames += 1
        if self._frames <= LAYOUT_FRAMES or self.state.preferences.panels.start_page:  # which covers the picture
            return
        left = self._work_beside(budget_s)
        started = self._clock()
        try:
            self.picture.advance(self.state, left)
        except EngineError as error:
            self._renderer_stopped(error)
            return
        finally:
            self.engine_s = self._clock() - started
        problem = self.picture.problem
        if problem is not None and problem != self._told and self.picture.shader_error is None:
            self.messages.tell(sentence(problem), is_error=True)
        self._told = problem
        now = self._clock()
        try:
            self.picture.show(self.state, now, self.delta_s, self.companions.comparison)
            self.companions.look(self.state, self.picture, now)
        except UserError as error:
            self.messages.tell(sentence(str(error)), is_error=True)
        except Exception as error:  # noqa: BLE001 - a bug, or the device is lost
            self.picture.give_up()
            self._renderer_stopped(error)

    def _work_beside(self, budget_s: float) -> float:
        """Exports and comparison; returns the time that is left."""
        try:
            return self.companions.work(self.state, self.picture, budget_s)
        except Exception as error:  # noqa: BLE001 - a bug in a side line must not stop the picture
            self.companions.exports.cancel()
            self.save_from_crash("exporting or comparing", error)
            self.messages.tell(
                f"Comparing or exporting failed by a fault of the program ({brief(error)}).", is_error=True
            )
            self.state = replace(self.state, compare=replace(self.state.compare, mode="off", plot=False))
            return budget_s
        finally:
            for text, is_error in self.companions.told:
                self.messages.tell(sentence(text), is_error)
            self.companions.told.clear()

    def _renderer_stopped(self, error: Exception) -> None:
        self.save_from_crash("rendering", error)
        self.messages.tell(
            f"The renderer stopped ({brief(error)}). Your work is kept; press F5 to try again.", is_error=True
        )

    # What requests use

    def show_scene(self, scene: Scene) -> None:
        """Another scene of the same document, as after undo; what was selected stays if it is still there."""
        selection = self.state.selection
        things = {"object": scene.objects, "light": scene.lights, None: ()}[selection.kind]
        if selection.index >= len(things):
            selection = Selection()
        self.state = replace(self.state, scene=scene, selection=selection, pull=None)

    def show_document(self, document: Document) -> None:
        """Take up another document; preferences and display stay as they are."""
        self.document = document
        kept = self.state
        self.state = replace(
            kept,
            scene=document.scene,
            camera=document.scene.camera,
            views=State(document.scene, document.scene.camera).views,
            selection=Selection(),
            pull=None,
            animation=(),
            solo_nm=None,
            edit_label="",
        ).with_panels(start_page=False)
        self.picture.new_scene()
        self.tell_notes()
        self._remember_file(document.source)

    def tell_notes(self) -> None:
        """What was assumed while loading."""
        for note in self.document.scene.notes:
            self.messages.tell(note)

    def reload_shaders(self) -> None:
        """Compile the shaders from disk; the last good programs stay when that fails."""
        try:
            self.picture.reload_shaders()
        except EngineError as error:
            self._renderer_stopped(error)

    def save_from_crash(self, doing: str, error: BaseException) -> None:
        """Write autosave and crash log."""
        if self.document.unsaved:
            self.autosave.write_now(self.document.scene, self.document.title, self.document.source)
        write_crash(config_dir(), doing, error.__cause__ or error, self.context.renderer)

    def drop(self, paths: list[Path]) -> None:
        """Files were dropped on the window: the first one is opened in the next frame."""
        self._dropped = paths[:1]

    def ask_to_close(self) -> None:
        """The window's close button was pressed."""
        self._carry_out(requests.Quit())

    def _with_dropped(self, state: State, view_model: ViewModel) -> State:
        if not self._dropped:
            return state
        from .panels import dialogs

        path, self._dropped = self._dropped[0], []
        return dialogs.open_path(state, view_model, path)

    def _remember_file(self, path: Path | None) -> None:
        if path is not None:
            self.settings = self.settings.opened(path)

    def write_window_picture(self, path: Path, codes: np.ndarray) -> None:
        """Write the whole window, uint8 (h, w, 3), as a PNG."""
        try:
            write_codes(path, codes)
        except UserError as error:
            self.messages.tell(sentence(str(error)), is_error=True)
        else:
            self.messages.tell(f"Saved {path.name}.")

    def close(self) -> None:
        """The end in good order: settings are remembered, nothing is left to recover."""
        self.autosave.close()
        with suppress(UserError):
            save_settings(self.settings)
        self.release()

    def release(self) -> None:
        """Free what the device holds."""
        self.companions.release()
        self.picture.release()


def _first_state(scene: Scene, settings: Settings, welcome: bool) -> State:
    state = State(scene=scene, camera=scene.camera, preferences=settings.preferences)
    return state.with_panels(start_page=welcome)
