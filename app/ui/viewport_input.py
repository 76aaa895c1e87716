"""What the mouse and the keys do in the viewport: walk the camera, select, paint, pull, shift the wipe.

`ViewportInput` remembers what a drag that is under way holds; that is memory of the interface, like a scroll position,
and no part of the state. The gizmo has its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from imgui_bundle import imgui

from ..base.errors import UserError
from ..edit import brush as brushes
from ..edit import camera_controls as controls
from ..edit import measuring
from ..edit import pull as pulling
from ..edit.picking import pick_in
from ..edit.projection import View
from ..edit.requests import BeginPull, Notice, SelectAt
from ..edit.state import State
from ..model.scene import Scene
from .measure_marks import point_at
from .overlay import Canvas
from .view_model import ViewModel

Grip = Literal["orbit", "pan", "dolly", "fly", "click", "measure", "brush", "pull", "wipe"]
CLICK_PX = 4.0
"""A press that moved no farther is a click, logical pixels."""
WIPE_REACH_PX = 6.0
FLY_SPEED = 0.6
"""Shares of the target's distance a second."""
FLY_STEP = 1.25
"""Factor on the flying speed by a notch of the wheel."""
_Key = imgui.Key


@dataclass(frozen=True)
class Mouse:
    """The mouse over the picture in this frame."""

    x: float
    y: float
    """Place in the picture, 0..1 from its top left; outside of that while a drag leaves it."""
    is_over: bool
    """Over the picture itself: not over another window, a button or a handle."""
    dx: float
    dy: float
    """Since the last frame, picture heights."""


class ViewportInput:
    """Carries out drags, wheel and keys."""

    def __init__(self) -> None:
        self.grip: Grip | None = None
        self.fly_speed = 1.0
        """Factor, by the wheel while flying."""
        self._button = 0
        self._travelled_px = 0.0
        self._pivot: np.ndarray | None = None
        self._stroke: brushes.Stroke | None = None
        self._pulled_to: tuple[np.ndarray, np.ndarray] | None = None
        """The ray on which the button was released before the renderer had found the colour."""

    @property
    def is_free(self) -> bool:
        """Nothing is being dragged."""
        return self.grip is None

    def act(self, state: State, view_model: ViewModel, canvas: Canvas, mouse: Mouse) -> State:
        """Carry out this frame's mouse and keys."""
        if self.grip is not None and not imgui.is_mouse_down(self._button):
            state = self._let_go(state, view_model, canvas, mouse)
        if state.pull is not None and self.grip != "pull":
            state = replace(state if self._pulled_to is None else _pulled(state, *self._pulled_to), pull=None)
            self._pulled_to = None
        if self.grip is None and mouse.is_over:
            state = self._take(state, view_model, canvas, mouse)
        state = self._wheel(state, canvas, mouse) if mouse.is_over or self.grip == "fly" else state
        state = self._keys(state, canvas, mouse)
        return state if self.grip is None else self._hold(state, view_model, canvas, mouse)

    # ---- beginning and end of a drag --------------------------------------------------------

    def _take(self, state: State, view_model: ViewModel, canvas: Canvas, mouse: Mouse) -> State:
        io = imgui.get_io()
        if not any(imgui.is_mouse_clicked(button) for button in range(3)):
            return state
        hit = pick_in(state, mouse.x, mouse.y)
        position = None if hit is None else np.asarray(hit.position)
        if imgui.is_mouse_clicked(2) or (io.key_alt and imgui.is_mouse_clicked(0)):
            grip: Grip = "pan" if io.key_shift else "dolly" if io.key_ctrl else "orbit"
            return self._grip(state, grip, 2 if imgui.is_mouse_clicked(2) else 0, position)
        if imgui.is_mouse_clicked(1):
            self.fly_speed = 1.0
            return self._grip(state, "fly", 1, position)
        if (
            state.compare.mode == "wipe"
            and abs(mouse.x - state.compare.wipe) * canvas.width < WIPE_REACH_PX * canvas.scale
        ):
            return self._grip(state, "wipe", 0, position)
        if state.tool == "brush":
            return self._begin_stroke(self._grip(state, "brush", 0, position), view_model, mouse)
        if state.tool == "pull":
            self._pulled_to = None
            return self._grip(state, "pull", 0, position).asking(BeginPull(mouse.x, mouse.y, io.key_shift))
        return self._grip(state, "measure" if state.tool == "measure" else "click", 0, position)

    def _grip(self, state: State, grip: Grip, button: int, position: np.ndarray | None) -> State:
        self.grip, self._button, self._travelled_px, self._pivot, self._stroke = grip, button, 0.0, position, None
        return state

    def _let_go(self, state: State, view_model: ViewModel, canvas: Canvas, mouse: Mouse) -> State:
        grip, self.grip, self._stroke = self.grip, None, None
        if grip == "measure" and self._travelled_px <= CLICK_PX and mouse.is_over:
            point = point_at(state, view_model, canvas, mouse.x, mouse.y)
            return state if point is None else measuring.with_point(state, point)
        if grip == "pull" and state.pull is None and self._travelled_px > CLICK_PX:
            self._pulled_to = canvas.view.ray(mouse.x, mouse.y)
        if grip == "click" and self._travelled_px <= CLICK_PX and mouse.is_over:
            return state.asking(SelectAt(mouse.x, mouse.y, imgui.get_io().key_ctrl, imgui.get_io().key_shift))
        return state

    # ---- while it lasts ---------------------------------------------------------------------

    def _hold(self, state: State, view_model: ViewModel, canvas: Canvas, mouse: Mouse) -> State:
        delta = imgui.get_io().mouse_delta
        self._travelled_px += (abs(delta.x) + abs(delta.y)) / canvas.scale
        if self.grip in ("click", "measure"):
            return state
        state = replace(state, interacting=True)
        camera = state.camera
        match self.grip:
            case "orbit":
                return replace(state, camera=controls.orbit(camera, mouse.dx, mouse.dy, self._pivot))
            case "pan":
                depth = None if self._pivot is None else float(canvas.view.depth(self._pivot))
                shown = _share_shown(state, canvas)
                return replace(state, camera=controls.pan(camera, shown * mouse.dx, shown * mouse.dy, depth))
            case "dolly":
                return replace(state, camera=controls.dolly(camera, mouse.dy))
            case "fly":
                return replace(state, camera=self._flown(controls.look(camera, mouse.dx, mouse.dy), view_model.delta_s))
            case "wipe":
                return replace(state, compare=replace(state.compare, wipe=float(np.clip(mouse.x, 0.0, 1.0))))
            case "brush":
                return self._paint(state, view_model, mouse)
        moved = self._travelled_px > CLICK_PX
        return _pulled(state, *canvas.view.ray(mouse.x, mouse.y)) if moved else state

    def _flown(self, camera: controls.Camera, dt: float) -> controls.Camera:
        io, down = imgui.get_io(), imgui.is_key_down
        keys = (
            float(down(_Key.d)) - float(down(_Key.a)),
            float(down(_Key.e)) - float(down(_Key.q)),
            float(down(_Key.w)) - float(down(_Key.s)),
        )
        haste = controls.FAST if io.key_shift else controls.SLOW if io.key_ctrl else 1.0
        return controls.fly(camera, keys, self.fly_speed * haste * FLY_SPEED * View.of(camera, 1.0).target_distance, dt)

    def _begin_stroke(self, state: State, view_model: ViewModel, mouse: Mouse) -> State:
        hit = pick_in(state, mouse.x, mouse.y)
        if hit is None or not hit.is_receiver:
            return state.asking(Notice("The brush paints on diffuse surfaces, where colours land."))
        # What is painted must be seen.
        return self._paint(replace(state, physical=False, interacting=True), view_model, mouse)

    def _paint(self, state: State, view_model: ViewModel, mouse: Mouse) -> State:
        hit, io = pick_in(state, mouse.x, mouse.y), imgui.get_io()
        if hit is None or not hit.is_receiver:
            return state
        brush = brushes.mode_held(state.brush, io.key_shift, io.key_ctrl)
        stroke = self._stroke
        if stroke is None or (stroke.object_index, stroke.brush) != (hit.object_index, brush):
            stroke = brushes.begin(state.scene, hit.object_index, brush, hit.position)
        else:
            stroke = brushes.extend(stroke, state.scene, hit.position, view_model.delta_s)
        self._stroke = stroke
        return _edited(state, lambda: (brushes.applied(state.scene, stroke), brushes.LABEL))

    # ---- wheel and keys ---------------------------------------------------------------------

    def _wheel(self, state: State, canvas: Canvas, mouse: Mouse) -> State:
        io = imgui.get_io()
        notches = io.mouse_wheel + io.mouse_wheel_h
        if notches == 0.0:
            return state
        if self.grip == "fly":
            self.fly_speed = float(np.clip(self.fly_speed * FLY_STEP**notches, 0.02, 50.0))
            return state
        hit = pick_in(state, mouse.x, mouse.y)
        position = None if hit is None else np.asarray(hit.position)
        if io.key_shift:
            return replace(state, brush=brushes.resized(state.brush, notches, visible_height(canvas.view, position)))
        shown = _share_shown(state, canvas)
        cursor = (0.5 + shown * (mouse.x - 0.5), 0.5 + shown * (mouse.y - 0.5))
        camera = controls.zoom_to(state.camera, notches, cursor, canvas.view.aspect, position)
        return replace(state, camera=camera, interacting=True)

    def _keys(self, state: State, canvas: Canvas, mouse: Mouse) -> State:
        if imgui.get_io().want_text_input or not (mouse.is_over or self.grip == "brush"):
            return state
        steps = float(imgui.is_key_pressed(_Key.right_bracket)) - float(imgui.is_key_pressed(_Key.left_bracket))
        return (
            replace(state, brush=brushes.resized(state.brush, steps, visible_height(canvas.view, None)))
            if steps
            else state
        )


def _share_shown(state: State, canvas: Canvas) -> float:
    """Height of the picture over that of the camera's own frame, in which it moves."""
    return canvas.view.half_height / View.of(state.camera, 1.0).half_height


def visible_height(view: View, position: np.ndarray | None) -> float:
    """Scene units that the picture's height shows at a world `position`, else at the target."""
    depth = view.target_distance if position is None else max(float(view.depth(position)), 1e-9)
    return view.height_at(depth)


def _pulled(state: State, origin: np.ndarray, direction: np.ndarray) -> State:
    """With the held colour, if there is one, where a camera ray says."""
    pull = state.pull
    if pull is None:
        return state
    point = pulling.nearest_on_line(pull, origin, direction)
    return _edited(state, lambda: pulling.apply(state.scene, pull, point, state.brush.radius, state.brush.falloff))


def _edited(state: State, edit: Callable[[], tuple[Scene, str]]) -> State:
    """With an edit done; one that is refused becomes a sentence."""
    try:
        scene, label = edit()
    except UserError as error:
        text = str(error)
        return state.asking(Notice(text[:1].upper() + text[1:] + ".", is_error=True))
    return state if scene is state.scene else state.edited(scene, label)
