"""Marks over the picture that follow the cursor: the brush's ring, the held colour, lights, selection, wipe,
magnifier; the axes of the world in a corner."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from imgui_bundle import ImVec2, imgui
from imgui_bundle import icons_fontawesome_6 as icons

from ..edit import brush as brushes
from ..edit import placing, pull, selecting
from ..edit.camera_controls import look_along
from ..edit.picking import PickHit
from ..edit.projection import View
from ..edit.state import Brush, Selection, State
from ..model.scene import Camera, Scene, SceneObject
from . import item_rects, theme
from .compared_with import glass_object
from .message_box import broken
from .overlay import Canvas, box_corners, draw_box, draw_cross, draw_label, draw_outlined, lines
from .panels.methods import METHOD_NAMES
from .panels.rows import tooltip
from .panels.spectrum_strip import colour_of_nm
from .view_model import ViewModel

RADIUS_EM = 2.7
"""Radius of the axes in the corner, text heights."""
_BALL_EM = 0.56
_COLOURS = ((0.88, 0.36, 0.36, 1.0), (0.50, 0.74, 0.32, 1.0), (0.36, 0.56, 0.90, 1.0))
_NAMES = "XYZ"


def draw_axes(state: State, view: View, right: float, top: float) -> State:
    """Draw the axes of the world with their upper right corner at (right, top), pixels."""
    radius, ball = theme.em(RADIUS_EM), theme.em(_BALL_EM)
    centre = np.array([right - radius, top + radius])
    ends = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            way = sign * np.eye(3)[axis]
            place = centre + (radius - ball) * np.array([way @ view.right, -(way @ view.up)])
            ends.append((float(way @ view.forward), axis, sign, place))
    ends.sort(key=lambda end: end[0])  # nearest first: it gets the mouse
    hovered = None
    for _, axis, sign, place in ends:
        name = f"{'+' if sign > 0 else '−'}{_NAMES[axis]}"
        imgui.set_cursor_screen_pos(ImVec2(place[0] - ball, place[1] - ball))
        pressed = imgui.invisible_button(f"##view {name}", ImVec2(2 * ball, 2 * ball))
        item_rects.note(f"View from {name}")
        tooltip(f"View from {name}: look at the target along this axis, from the same distance.")
        if imgui.is_item_hovered():
            hovered = (axis, sign)
        if pressed:
            state = replace(state, camera=look_along(state.camera, -sign * np.eye(3)[axis]))
    _draw(ends, centre, ball, hovered)
    return state


def _draw(
    ends: list[tuple[float, int, float, np.ndarray]], centre: np.ndarray, ball: float, hovered: tuple[int, float] | None
) -> None:
    drawing, scale = imgui.get_window_draw_list(), theme.em(1.0) / theme.FONT_SIZE
    dark = theme.packed((0.06, 0.06, 0.06, 0.9))
    if hovered is not None:
        ground = theme.packed((0.0, 0.0, 0.0, 0.28))
        drawing.add_circle_filled(ImVec2(*centre), theme.em(RADIUS_EM), ground, 48)
    for depth, axis, sign, place in reversed(ends):
        opacity = 0.95 - 0.35 * (depth + 1.0) / 2.0
        colour = theme.packed(_COLOURS[axis], opacity)
        at = ImVec2(*place)
        if sign > 0:
            drawing.add_line(ImVec2(*centre), at, colour, 2.0 * scale)
            drawing.add_circle_filled(at, ball, colour, 24)
        else:
            drawing.add_circle_filled(at, 0.72 * ball, theme.packed(_COLOURS[axis], 0.30 * opacity), 24)
            drawing.add_circle(at, 0.72 * ball, colour, 24, 1.2 * scale)
        if sign > 0 or hovered == (axis, sign):
            text = _NAMES[axis] if sign > 0 else f"−{_NAMES[axis]}"
            size = imgui.calc_text_size(text)
            drawing.add_text(
                ImVec2(at.x - 0.5 * size.x, at.y - 0.5 * size.y),
                dark if sign > 0 else theme.packed((0.92, 0.92, 0.92, 1.0)),
                text,
            )
        if hovered == (axis, sign):
            drawing.add_circle(at, ball + 1.0 * scale, theme.packed((0.95, 0.95, 0.95, 0.9)), 24, 1.4 * scale)


_RING_COLOURS = {"widen": (1.0, 0.84, 0.45, 0.95), "narrow": (0.55, 0.80, 1.0, 0.95), "erase": (1.0, 0.55, 0.50, 0.95)}
_MAGNIFIER_EM = 11.0
_LIGHT_EM = 0.85
_ARROW_EM = 3.2


def draw_marks(canvas: Canvas, state: State, view_model: ViewModel, is_painting: bool) -> None:
    """Marks in the scene: selection, the ring of the brush, a colour being pulled."""
    if state.preview_s is None:
        seen = None if view_model.picture is None else view_model.shown
        for item in state.scene.objects if seen is None else not_shown(state.scene, seen):
            if ("object", item.name) not in state.hidden:
                _draw_proxy(canvas, item)
    _draw_selection(canvas, state)
    if state.tool == "brush" and view_model.cursor is not None and view_model.cursor.hit is not None:
        _draw_ring(canvas, state, view_model.cursor.hit, is_painting)
    if state.pull is not None:
        _draw_pull(canvas, state)


def not_shown(scene: Scene, shown: Scene) -> list[SceneObject]:
    """Objects that `scene` has and a picture of `shown` lacks: added, or placed elsewhere."""
    there = {(id(item.mesh), item.object_to_world.tobytes()) for item in shown.objects}
    return [item for item in scene.objects if (id(item.mesh), item.object_to_world.tobytes()) not in there]


def _draw_proxy(canvas: Canvas, item: SceneObject) -> None:
    """The outline of what the picture does not show yet, filled like clear glass."""
    places = canvas.pixels(item.mesh.vertices @ item.object_to_world[:3, :3].T + item.object_to_world[:3, 3])
    outline = outline_of(places[np.isfinite(places).all(axis=1)])
    if len(outline) < 3:
        return
    points: list[ImVec2 | tuple[int | float, int | float] | list[int | float]]
    points = [ImVec2(float(x), float(y)) for x, y in outline]
    canvas.drawing.add_convex_poly_filled(points, theme.packed((0.75, 0.85, 0.95, 0.22)))
    edges = np.stack([outline, np.roll(outline, -1, axis=0)], axis=1)
    lines(canvas, edges, theme.packed((0.9, 0.95, 1.0, 0.75)), 1.4)


def outline_of(places: np.ndarray) -> np.ndarray:
    """Corners of the convex hull of `places` (n, 2), in order, by 48 directions."""
    if not len(places):
        return places
    angles = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    farthest = (places @ np.stack([np.cos(angles), np.sin(angles)])).argmax(axis=0)
    return places[farthest[np.diff(farthest, prepend=farthest[-1]) != 0]]


def _draw_selection(canvas: Canvas, state: State) -> None:
    accent = theme.DARK.accent  # over the picture, which is dark in either theme
    for chosen in selecting.everything(state):
        if chosen.kind == "object":
            item = state.scene.objects[chosen.index]
            opacity = 0.8 if chosen == state.selection else 0.45
            draw_box(canvas, box_corners(item.mesh.vertices, item.object_to_world), (*accent[:3], opacity))
    if state.selection.kind == "camera":
        for line in camera_lines(state.scene.camera, state.frame_aspect):
            draw_outlined(canvas, line, (*accent[:3], 0.8), 1.4, closed=False)


def camera_lines(camera: Camera, aspect: float) -> list[np.ndarray]:
    """World polylines (n, 3) of a camera: what it sees at a fifth of its target's distance, and from where."""
    view = View.of(camera, aspect)
    corners = []
    for x, y in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)):
        origin, direction = view.ray(x, y)
        corners.append(origin + 0.2 * view.target_distance * direction)
    frame = np.array(corners)
    position = np.asarray(camera.position, float)
    return [np.vstack([frame, frame[:1]]), *(np.stack([position, corner]) for corner in frame)]


def _draw_ring(canvas: Canvas, state: State, hit: PickHit, is_painting: bool) -> None:
    if not hit.is_receiver:
        imgui.set_mouse_cursor(imgui.MouseCursor_.not_allowed)
        return
    io = imgui.get_io()
    brush: Brush = brushes.mode_held(state.brush, io.key_shift, io.key_ctrl)
    red, green, blue, opacity = _RING_COLOURS[brush.mode]
    draw_outlined(
        canvas,
        brushes.ring(hit.position, hit.normal, brush.radius),
        (red, green, blue, opacity),
        2.2 if is_painting else 1.6,
    )
    inner = brush.radius * (1.0 - brush.falloff)
    if 0.05 < 1.0 - brush.falloff < 0.95:
        draw_outlined(canvas, brushes.ring(hit.position, hit.normal, inner), (red, green, blue, 0.4), 1.0)


def _draw_pull(canvas: Canvas, state: State) -> None:
    """From the d line's landing point, which stays, to where the held colour is now."""
    held = state.pull
    assert held is not None
    gain = _present_gain(state)
    start, reference = np.asarray(held.start), np.asarray(held.reference)
    now = reference + (start - reference) * gain / max(held.gain_at_start, 1e-9)
    draw_outlined(canvas, np.stack([reference, now]), (1.0, 1.0, 1.0, 0.8), 1.4, closed=False)
    radius = 0.5 * theme.em(1.0)
    for point, colour in ((reference, theme.packed((1.0, 0.86, 0.3, 1.0))), (now, colour_of_nm(held.wavelength_nm))):
        x, y = canvas.pixels(point)
        if np.isfinite(x):
            canvas.drawing.add_circle_filled(ImVec2(x, y), radius, theme.packed((0.0, 0.0, 0.0, 0.6)), 24)
            canvas.drawing.add_circle_filled(ImVec2(x, y), 0.68 * radius, colour, 24)
    x, y = canvas.pixels(now)
    if np.isfinite(x):
        what = f"local gain × {gain:.2f}" if held.local else f"gain × {gain:.2f}"
        text = f"{held.wavelength_nm:.0f} nm   {what}"
        draw_label(canvas, x + theme.em(0.9), y - theme.em(1.6), text, is_kept=True)


def _present_gain(state: State) -> float:
    held = state.pull
    assert held is not None
    if held.local:
        return pull.local_gain(state.scene.objects[held.receiver_index], held)
    material = state.scene.objects[held.object_index].material
    return float(getattr(getattr(material, "dispersion", None), "gain", held.gain_at_start))


def draw_lights(canvas: Canvas, state: State) -> State:
    """A small lamp where each light is: faint, and clickable."""
    if state.tool in ("brush", "pull"):
        return state
    for index, light in enumerate(state.scene.lights):
        chosen = selecting.is_selected(state, Selection("light", index))
        if (not light.has_place and not chosen) or selecting.key_of(
            state.scene, Selection("light", index)
        ) in state.hidden:
            continue  # it has no place
        place = placing.light_place(state.scene, light)
        x, y = canvas.pixels(place)
        inside = (
            np.isfinite(x)
            and canvas.left < x < canvas.left + canvas.width
            and canvas.top < y < canvas.top + canvas.height
        )
        if not inside:
            continue
        half = theme.em(_LIGHT_EM)
        imgui.set_cursor_screen_pos(ImVec2(x - half, y - half))
        pressed = imgui.invisible_button(f"##light {index}", ImVec2(2 * half, 2 * half))
        item_rects.note(f"Light: {light.name}")
        tooltip(f"Light: {light.name} ({light.kind})", "Click to select it.")
        _draw_light(canvas, state, index, place, float(x), float(y), chosen, imgui.is_item_hovered())
        if pressed:
            state = selecting.chosen(state, Selection("light", index), imgui.get_io().key_shift)
    return state


def _draw_light(
    canvas: Canvas, state: State, index: int, place: np.ndarray, x: float, y: float, chosen: bool, hovered: bool
) -> None:
    light = state.scene.lights[index]
    colour = theme.DARK.accent if chosen else (1.0, 0.92, 0.7, 1.0)
    opacity = 1.0 if chosen or hovered else 0.5
    if (chosen or hovered) and light.has_direction:
        length = canvas.view.height_at(max(float(canvas.view.depth(place)), 1e-9)) * theme.em(_ARROW_EM) / canvas.height
        tip = place + length * light.axes()[:, 2]
        draw_outlined(canvas, np.stack([place, tip]), (*colour[:3], 0.9), 1.6, closed=False)
    canvas.drawing.add_circle_filled(
        ImVec2(x, y), theme.em(0.78), theme.packed((0.0, 0.0, 0.0, 1.0), 0.5 * opacity), 24
    )
    icon = icons.ICON_FA_SUN if not light.has_place else icons.ICON_FA_LIGHTBULB
    size = imgui.calc_text_size(icon)
    canvas.drawing.add_text(ImVec2(x - 0.5 * size.x, y - 0.5 * size.y), theme.packed(colour, opacity), icon)


def draw_wipe(canvas: Canvas, state: State, view_model: ViewModel) -> None:
    """The handle on the wipe's line, with what is on either side; while C is held there is one picture, and a badge
    names it."""
    if state.compare.mode != "wipe" or state.compare.holding or view_model.picture is None:
        return
    x = canvas.left + state.compare.wipe * canvas.width
    middle, radius = canvas.top + 0.5 * canvas.height, theme.em(0.8)
    mouse = imgui.get_io().mouse_pos
    near = imgui.is_window_hovered() and abs(mouse.x - x) < 6.0 * canvas.scale
    if near:
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
    palette = theme.palette()
    canvas.drawing.add_circle_filled(ImVec2(x, middle), radius, theme.packed(palette.window, 0.9), 32)
    canvas.drawing.add_circle(
        ImVec2(x, middle), radius, theme.packed(palette.accent if near else palette.text, 0.9), 32, 1.6 * canvas.scale
    )
    size = imgui.calc_text_size(icons.ICON_FA_LEFT_RIGHT)
    canvas.drawing.add_text(
        ImVec2(x - 0.5 * size.x, middle - 0.5 * size.y), theme.packed(palette.text), icons.ICON_FA_LEFT_RIGHT
    )
    y = canvas.top + theme.em(0.8)
    left = own_label(state)
    # Without the other picture both sides are this one: it must not carry the other's name.
    lacks_file = state.compare.method == "file" and state.compare.file is None
    missing = "No picture chosen: this is the same one" if lacks_file else "On its way: this is the same picture"
    right = view_model.compare_label if view_model.compare_ready else missing
    gap, end = theme.em(1.0), canvas.left + canvas.width - theme.em(2.0 * RADIUS_EM + 2.0)
    draw_label(canvas, x - gap - imgui.calc_text_size(left).x, y, left, is_kept=True)
    # Not under the axes in the corner: its parts are below each other where there is no room in a line.
    right = broken(right, end - x - gap, lambda text: imgui.calc_text_size(text).x, at=", ")
    draw_label(canvas, min(x + gap, end - imgui.calc_text_size(right).x), y, right, is_kept=True)


def own_label(state: State) -> str:
    """What this picture is, beside another: its method, or its glass."""
    swapped = glass_object(state.scene, state.selection) if state.compare.method == "glass" else None
    dispersion = None if swapped is None else state.scene.objects[swapped].material.dispersion
    return METHOD_NAMES.get(state.method, state.method) if dispersion is None else dispersion.name


def draw_magnifier(canvas: Canvas, view_model: ViewModel) -> None:
    """The pixels round the cursor, enlarged, beside it; a cross marks the one that is read out."""
    cursor, mouse = view_model.cursor, imgui.get_io().mouse_pos
    if cursor is None or cursor.magnified is None:
        return
    side, gap, palette = theme.em(_MAGNIFIER_EM), theme.em(1.6), theme.palette()
    text = f"{cursor.pixel[0]}, {cursor.pixel[1]}   " + (
        "…" if cursor.rgb is None else "R {:.3g}  G {:.3g}  B {:.3g}".format(*cursor.rgb)
    )
    foot = imgui.get_text_line_height() + theme.em(0.5)
    width = max(side, imgui.calc_text_size(text).x + theme.em(0.8))
    x = mouse.x + gap if mouse.x + gap + width < canvas.left + canvas.width else mouse.x - gap - width
    y = mouse.y + gap if mouse.y + gap + side + foot < canvas.top + canvas.height else mouse.y - gap - side - foot
    low, high = ImVec2(x, y), ImVec2(x + width, y + side + foot)
    canvas.drawing.add_rect_filled(low, high, theme.packed(palette.window, 0.95), 4.0)
    left = x + 0.5 * (width - side)
    canvas.drawing.add_image(imgui.ImTextureRef(cursor.magnified), ImVec2(left, y), ImVec2(left + side, y + side))
    canvas.drawing.add_rect(low, high, theme.packed(palette.border), 4.0)
    middle, reach = ImVec2(left + 0.5 * side, y + 0.5 * side), theme.em(0.45)
    draw_cross(canvas, middle, reach, theme.packed((1, 1, 1, 0.9)), 1.0)
    canvas.drawing.add_text(ImVec2(x + theme.em(0.4), y + side + theme.em(0.2)), theme.packed(palette.text), text)
