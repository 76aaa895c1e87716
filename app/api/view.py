"""A session seen live in a notebook: the mouse walks round, sliders stretch the dispersion, the cursor reads spectra.

Messages from the browser come in the kernel's own thread, as cells do, and edit the session's scene there; a thread of
the view's own lets the engine follow, in short steps between which the session's other work has its turn.
"""

from __future__ import annotations

import base64
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from ..base.errors import UserError
from ..edit import camera_controls
from ..model.scene_camera import camera_values
from .device import Cancel, Device, Report
from .pages import page
from .picture import Picture
from .scene import Scene
from .widget import Front, lack_of_front_end

if TYPE_CHECKING:
    from ..gpu.context import Context
    from ..render.viewer.engine import LiveEngine
    from .frames import Frames

MAX_GAIN = 10.0
"""Largest gain of the sliders."""
_MOVING_S = 0.2
"""Something moves until so long after the last message that moved it."""
_STEP_S, _STILL_STEP_S = 0.05, 0.08
_STILL_FRAME_S = 0.3
"""Between pictures that only get smoother."""
_UNSEEN_S = 2.0
"""A picture that the browser has not confirmed after so long is taken for lost."""
_SPECTRUM_S = 0.12
_NAP_S = 0.2
"""How often a view at rest checks whether a cell has edited the scene."""
_FIRST_S = 30.0
"""How long a cell waits for its first picture, which stays where widgets are not shown."""
_PAGE_AFTER_S = 3.0
"""The page that stays in a saved notebook is made when nothing has moved for so long."""
PAGE_SIZE, PAGE_PHOTONS = (480, 270), 20_000
"""Size and photons of that page, which every saving of the notebook writes."""


class Viewed(Protocol):
    """What a view needs of its session."""

    @property
    def scene(self) -> Scene:
        """What is shown."""

    @property
    def _size(self) -> tuple[int, int]:
        """Width and height, pixels."""

    @property
    def _running(self) -> Device:
        """Raises `UserError` once the session is closed."""

    def _advance(self, context: Context, budget_s: float, is_moving: bool) -> LiveEngine:
        """Work for a while towards the scene as it is now."""

    def render(self) -> Picture:
        """The scene as it is now."""

    def set_glass(self, name: str, glass: str | None = None, **keys: Any) -> None:
        """Edit a glass."""


class View:
    """A live picture of a session; a notebook shows it where it is a cell's last value.

    Drag to walk round, with Shift to move across, turn the wheel to come nearer, double-click to go back; each object
    of glass has a slider for its dispersion, which traces nothing; the spectrum under the cursor is that of the caustic
    and of direct light, W/(unit² nm). What is done in the view is done to the session's `scene`, and what cells do to
    that is shown. In a saved notebook it is a page whose dispersion can be dragged; so it is without anywidget or a
    kernel, with a sentence that says so.
    """

    def __init__(self, session: Viewed, front: Callable[..., Front] | None = None) -> None:
        """Made by `Session.view`; `front`: what replaces the browser's part."""
        self._session = session
        self._first_camera = session.scene._model.camera
        self._why = None if front else lack_of_front_end()
        self._front: Front | None = None
        self._frames: Frames | None = None
        self._shown = threading.Event()
        self._ending, self._woken = threading.Event(), threading.Event()
        self._picture = b""
        self._sent = self._seen = 0
        self._sent_s = self._moved_s = self._spectrum_s = -1e9
        self._version: tuple[object, ...] = ()
        self._hover: tuple[float, float] | None = None
        self._answered: tuple[object, ...] = ()
        self._light: dict[str, Any] = {}
        self._pager: threading.Thread | None = None
        self._paged: object = None
        """What the page that is kept shows, or could not."""
        if self._why is None:
            self._front = (front or Front)(self._handle, session._size)
            self._front.glasses(self._glasses())
            self._thread = threading.Thread(target=self._live, name="spectrasplat view", daemon=True)
            self._thread.start()

    @property
    def is_live(self) -> bool:
        """Whether it follows; false for a mere picture, and once it is closed."""
        return self._front is not None and not self._ending.is_set()

    # ---- messages from the browser -----------------------------------------------------------

    def _handle(self, message: dict[str, Any]) -> None:
        """Do what a message of the widget says; a mistake becomes a sentence below the picture."""
        kind = message.get("kind")
        try:
            if kind == "seen":
                self._seen = max(self._seen, int(message["number"]))
            elif kind == "hello":  # another cell shows it, or the page was loaded again
                self._seen, self._version, self._answered, self._light = self._sent, (), (), {}
            elif kind == "hover":
                place = message.get("place")
                self._hover = None if place is None else (float(place[0]), float(place[1]))
            elif kind == "gain":
                self._moved_s = time.monotonic()
                gain = min(max(float(message["value"]), 0.0), MAX_GAIN)
                self._session.set_glass(str(message["object"]), dispersion_gain=gain)
            else:
                self._move(kind, message)
        except UserError as error:
            if self._front is not None:
                self._front.tell(str(error))
        self._woken.set()

    def _move(self, kind: object, message: dict[str, Any]) -> None:
        camera = self._session.scene._model.camera
        match kind:
            case "orbit":
                camera = camera_controls.orbit(camera, float(message["dx"]), float(message["dy"]))
            case "pan":
                camera = camera_controls.pan(camera, float(message["dx"]), float(message["dy"]))
            case "zoom":
                width, height = self._session._size
                cursor = (float(message["x"]), float(message["y"]))
                camera = camera_controls.zoom_to(camera, float(message["amount"]), cursor, width / height)
            case "home":
                camera = self._first_camera
            case _:
                return
        self._moved_s = time.monotonic()
        self._session.scene.camera.update(**camera_values(camera))

    # ---- the thread --------------------------------------------------------------------------

    def _live(self) -> None:
        while not self._ending.is_set():
            try:
                rests = self._session._running.run(self._step)
            except Exception as error:  # noqa: BLE001 - a thread's last words; the session's own calls raise it
                if self._front is not None and not self._ending.is_set():
                    self._front.tell(f"The view has stopped: {error}")
                break
            if rests:
                self._woken.wait(_NAP_S)
                self._woken.clear()
        self._ending.set()
        self._shown.set()

    def _step(self, context: Context, report: Report, stopped: Cancel) -> bool:
        """One short stretch of work; whether nothing is left to do."""
        front, now = self._front, time.monotonic()
        if front is None or self._ending.is_set():
            return True
        if self._frames is None:
            from .frames import Frames

            self._frames = Frames(context)
        is_moving = now - self._moved_s < _MOVING_S
        engine = self._session._advance(context, _STEP_S if is_moving else _STILL_STEP_S, is_moving)
        front.glasses(self._glasses())
        front.tell(engine.problem or "")
        is_sent = self._send_picture(front, engine, is_moving)
        is_answered = is_moving or self._answer_hover(front, engine)
        rests = engine.is_idle and is_sent and is_answered and not is_moving
        if rests:
            self._keep_page(engine, front)
        return rests

    def _keep_page(self, engine: LiveEngine, front: Front) -> None:
        """Let a thread with a context of its own make the page of what is shown, unless it is kept or being made."""
        at_rest_s = time.monotonic() - self._moved_s
        if engine.inputs is self._paged or at_rest_s < _PAGE_AFTER_S or (self._pager and self._pager.is_alive()):
            return
        self._paged, scene = engine.inputs, self._session.scene.copy()
        self._pager = threading.Thread(target=lambda: self._make_page(scene, front), daemon=True)
        self._pager.start()

    def _make_page(self, scene: Scene, front: Front) -> None:
        def moves() -> bool:
            return self._ending.is_set() or time.monotonic() - self._moved_s < _PAGE_AFTER_S

        try:
            made = page(scene, size=PAGE_SIZE, photons=PAGE_PHOTONS, cancel=moves).html
        except (UserError, RuntimeError):  # given up, the interpreter ends, or of this scene there can be none
            made = ""
            self._paged = None if moves() else self._paged
        if not self._ending.is_set():
            front.keep(made)

    def _send_picture(self, front: Front, engine: LiveEngine, is_moving: bool) -> bool:
        """Whether the browser has, or is being sent, the picture as it is."""
        assert self._frames is not None
        version = (engine.picture_version, engine.is_idle)
        if version == self._version and not self._frames.is_settling:
            return True
        now = time.monotonic()
        if self._sent > self._seen and now - self._sent_s < _UNSEEN_S:
            return False
        if not (is_moving or engine.is_idle) and now - self._sent_s < _STILL_FRAME_S:
            return False
        exposure = self._session.scene._model.render.exposure_ev
        frame = self._frames.develop(engine, exposure, is_moving)
        if frame is None:
            return False
        self._version, self._picture, self._sent_s = version, frame.data, now
        self._sent += 1
        front.send({"kind": "picture", "number": self._sent} | frame.facts, frame.data)
        self._shown.set()
        return not self._frames.is_settling

    def _answer_hover(self, front: Front, engine: LiveEngine) -> bool:
        """Whether the browser knows what is under its cursor."""
        assert self._frames is not None
        place, now = self._hover, time.monotonic()
        question = (place, id(engine.inputs), engine.stats.photons)
        if place is None or engine.picture is None or question == self._answered:
            return True
        if now - self._spectrum_s < _SPECTRUM_S:
            return False
        facts, is_all = self._frames.light_at(engine, *place)
        self._spectrum_s = time.monotonic()
        facts |= {"kind": "light", "place": list(place)}
        if facts != self._light:
            self._light = facts
            front.send(facts)
        if is_all:
            self._answered = question
        return is_all

    def _glasses(self) -> list[dict[str, Any]]:
        scene = self._session.scene
        listed = []
        for name, entry in zip(scene.objects.names, scene.objects, strict=True):
            amounts = scene._amounts(entry._values)
            if "dispersion_gain" in amounts:
                gain = float(amounts["dispersion_gain"])
                listed.append({"object": name, "gain": gain, "most": MAX_GAIN})
        return listed

    # ---- as a cell's output ------------------------------------------------------------------

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, Any]:
        """The widget, with a picture for where the notebook is read without a kernel."""
        if self._front is not None:
            self._shown.wait(_FIRST_S)
            bundle = self._front.mimebundle()
            if self._picture:
                bundle["image/jpeg"] = base64.b64encode(self._picture).decode()
            return bundle | {"text/plain": repr(self)}
        png, caption = base64.b64encode(self._session.render()._repr_png_()).decode(), repr(self)
        try:
            shown = page(self._session.scene, size=PAGE_SIZE, photons=PAGE_PHOTONS)._repr_html_()
        except UserError:  # this scene can be no page
            shown = f'<img src="data:image/png;base64,{png}" alt="The rendered scene"/>'
        return {"text/html": f"{shown}<p><small>{caption}</small></p>", "image/png": png, "text/plain": caption}

    def __repr__(self) -> str:
        name = self._session.scene.name
        return f"View of '{name}'" + (f": {self._why}" if self._why else "" if self.is_live else ", closed")

    def close(self) -> None:
        """End it; the session stays."""
        if self._front is None:
            return
        self._ending.set()
        self._woken.set()
        self._thread.join()
        if self._pager is not None:
            self._pager.join()
        frames, self._frames = self._frames, None
        if frames is not None:
            self._session._running.run(lambda context, report, stopped: frames.release())
            self._front.close()
