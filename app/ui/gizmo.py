"""The gizmo that moves, turns and scales the selected object or light: ImGuizmo between two of our own matrices.

ImGuizmo works in float32 on row vectors (its arrays are the transposes of ours, read row by row). It is given a frame
whose origin is where the drag began, so that a scene ten kilometres off the origin moves as finely as any.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from imgui_bundle import imgui, imguizmo

from ..base.errors import UserError
from ..edit import placing, selecting
from ..edit.placing import Operation
from ..edit.projection import View
from ..edit.state import Selection, State
from ..model.scene import Scene
from . import item_rects

_IM = imguizmo.im_guizmo
_OPERATION_OF: dict[str, Operation] = {"move": "move", "rotate": "rotate", "scale": "scale"}
"""By tool; the others have no handles."""
_OPERATIONS = {"move": _IM.OPERATION.translate, "rotate": _IM.OPERATION.rotate, "scale": _IM.OPERATION.scale}
_LABELS = {"move": "Move", "rotate": "Turn", "scale": "Scale"}
ROTATION_SNAP_DEG = 15.0
SCALE_SNAP = 0.1
_SIZE = 0.14
"""Size of the gizmo in clip space."""


@dataclass
class _Drag:
    """What is dragged."""

    scene: Scene
    """When it began."""
    shown: Scene
    """As the last frame of the drag left it."""
    selection: Selection
    operation: Operation
    before: np.ndarray
    """Frame, world."""
    now: np.ndarray
    """The same frame as ImGuizmo moved it."""

    def continues(self, state: State) -> bool:
        """Whether scene, selection and tool are still those of the drag."""
        return state.scene is self.shown and (state.selection, state.tool) == (self.selection, self.operation)


class Gizmo:
    """Remembers, from frame to frame, what is being dragged and whose axes are shown; nothing of it is part of the
    scene."""

    def __init__(self) -> None:
        self.is_local = False
        self.is_snapping = False
        """In steps without Ctrl, freely with it."""
        self._drag: _Drag | None = None
        self._is_drawn = False

    @property
    def is_held(self) -> bool:
        """A handle is being dragged."""
        return self._drag is not None

    def is_in_the_way(self) -> bool:
        """The mouse belongs to the gizmo: it is over a handle or holds one."""
        # ImGuizmo keeps the answer of the frame in which it was last drawn.
        return self.is_held or (self._is_drawn and bool(_IM.is_over()))

    def draw(self, state: State, view: View, rect: tuple[float, float, float, float]) -> State:
        """Draw it over the picture in `rect` (left, top, width, height in pixels) and follow its handles."""
        operation = _OPERATION_OF.get(state.tool)
        if (
            operation is None
            or selecting.is_locked(state, state.selection)
            or not placing.can_do(state.scene, state.selection, operation)
        ):
            self._drag, self._is_drawn = None, False
            return state
        self._is_drawn = True
        if self._drag is not None and not self._drag.continues(state):
            self._drag = None
        _IM.begin_frame()
        _IM.set_drawlist(imgui.get_window_draw_list())
        _IM.set_rect(*rect)
        _IM.set_orthographic(view.is_orthographic)
        _IM.set_gizmo_size_clip_space(_SIZE)
        _IM.get_style().hatched_axis_line_thickness = 0.0
        frame = placing.frame_of(state.scene, state.selection, self.is_local) if self._drag is None else self._drag.now
        origin = frame[:3, 3] if self._drag is None else self._drag.before[:3, 3]
        after = self._manipulate(operation, view, frame, origin)
        self._note(view, frame, rect)
        if not _IM.is_using():
            self._drag = None
            return state
        if self._drag is None:
            self._drag = _Drag(state.scene, state.scene, state.selection, operation, frame, frame)
        self._drag.now = after
        return self._edited(state)

    def _manipulate(self, operation: Operation, view: View, frame: np.ndarray, origin: np.ndarray) -> np.ndarray:
        depth = max(float(view.depth(frame[:3, 3])), 1e-6)
        near, far = (
            (-1e3 * view.half_height, 1e3 * view.half_height) if view.is_orthographic else (1e-3 * depth, 1e3 * depth)
        )
        model = _to_guizmo(_shifted(frame, -origin))
        mode = _IM.MODE.local if self.is_local or operation == "scale" else _IM.MODE.world
        _IM.manipulate(
            _to_guizmo(view.view_matrix(origin)),
            _to_guizmo(view.projection_matrix(near, far)),
            _OPERATIONS[operation],
            mode,
            model,
            None,
            self._snap(operation, view.height_at(depth)),
        )
        return _shifted(_from_guizmo(model), origin)

    def _snap(self, operation: Operation, visible_height: float) -> _IM.Matrix3 | None:
        """Steps while Ctrl is held; with snapping on, while it is not."""
        if imgui.get_io().key_ctrl == self.is_snapping:
            return None
        step = {"move": move_snap(visible_height), "rotate": ROTATION_SNAP_DEG, "scale": SCALE_SNAP}[operation]
        return _IM.Matrix3([step, step, step])

    def _edited(self, state: State) -> State:
        assert self._drag is not None
        drag, state = self._drag, replace(state, interacting=True)
        delta = placing.change(drag.before, drag.now, drag.operation)
        if drag.shown is drag.scene and np.allclose(delta, np.eye(4), atol=1e-9):
            return state
        try:
            shown = placing.changed(drag.scene, drag.selection, delta)
            others = [each for each in selecting.everything(state)[1:] if not selecting.is_locked(state, each)]
            for each in others:
                shown = placing.changed(shown, each, delta)
            drag.shown = shown
        except UserError:
            return state  # a place where it may not be, such as a light inside glass: it stays at the border
        name = selecting.name_of(drag.scene, drag.selection)
        more = f" and {len(others)} more" if others else ""
        return state.edited(drag.shown, f"{_LABELS[drag.operation]} {name}{more}")

    def _note(self, view: View, frame: np.ndarray, rect: tuple[float, float, float, float]) -> None:
        """Record for tests where the gizmo is: its middle, as an item without size."""
        (x, y), _ = view.project(frame[:3, 3])
        if np.isfinite(x) and 0.0 < x < 1.0 and 0.0 < y < 1.0:
            at = imgui.get_cursor_screen_pos()
            imgui.set_cursor_screen_pos(imgui.ImVec2(rect[0] + x * rect[2], rect[1] + y * rect[3]))
            imgui.dummy(imgui.ImVec2(0, 0))
            item_rects.note("Gizmo")
            imgui.set_cursor_screen_pos(at)


def move_snap(visible_height: float) -> float:
    """A round step (1, 2 or 5 times a power of ten) of about a fortieth of the picture's height."""
    wanted = max(visible_height, 1e-9) / 40.0
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * min((1.0, 2.0, 5.0, 10.0), key=lambda m: abs(np.log(m * power / wanted))))


def _shifted(matrix: np.ndarray, by: np.ndarray) -> np.ndarray:
    shifted = matrix.copy()
    shifted[:3, 3] += by
    return shifted


def _to_guizmo(matrix: np.ndarray) -> _IM.Matrix16:
    return _IM.Matrix16(matrix.T.ravel().tolist())


def _from_guizmo(matrix: _IM.Matrix16) -> np.ndarray:
    return np.asarray(matrix.values, float).reshape(4, 4).T
