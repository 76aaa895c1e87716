"""What the host does for each request: a table by its type."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, get_args

import numpy as np

from ..base.atomic import check_writable
from ..base.errors import UserError
from ..base.not_yet import NOT_YET, NotYet
from ..edit import camera_controls, requests, selecting
from ..edit.document import Document
from ..edit.lessons import lesson
from ..edit.picking import PickHit, pick_in
from ..edit.pull import begin_pull
from ..edit.state import Selection
from ..edit.stored_photons import index_in
from ..model.optics.colorimetry import rgb709_to_xyz
from ..model.scene_defaults import bounds_of
from ..model.vectors import vec3
from .session import Session

Answer = Callable[[], NotYet | None]
"""What asks the renderer; called in every frame until it is not `NOT_YET`."""
PHOTONS = 400_000
"""Stored photons that are read for whose caustic is at a point, and for a colour."""
REACH = 0.03
"""Radius about the point within which photons count, share of the extent of the glass's light on that receiver."""
MIN_BRIGHTNESS = 0.25
"""Irradiance within that radius over the mean within the extent: fainter is stray light, not a caustic."""
MIN_SHARE = 0.2
"""Share of the flux near the point that must have come through one object."""


def source_at(
    point: np.ndarray,
    receiver: int,
    position: np.ndarray,
    flux_w: np.ndarray,
    source: np.ndarray,
    photon_receiver: np.ndarray,
) -> int | None:
    """Index of the object that most of the light came through near a world `point` of object `receiver`, or None.

    Photons: `position` (n, 3) world, `flux_w` (n,), `source` (n,) the object met first (negative:
    straight from a light), `photon_receiver` (n,).
    """
    through_glass = (photon_receiver == receiver) & (source >= 0) & (flux_w > 0.0)
    if not through_glass.any():
        return None
    places, flux, origins = position[through_glass], flux_w[through_glass], source[through_glass]
    extent = float(np.linalg.norm(np.percentile(places, 95, axis=0) - np.percentile(places, 5, axis=0)))
    radius = REACH * max(extent, 1e-12)
    near = np.linalg.norm(places - np.asarray(point, float), axis=1) <= radius
    mean = flux.sum() / max(extent, 1e-12) ** 2
    if not near.any() or flux[near].sum() < MIN_BRIGHTNESS * mean * math.pi * radius**2:
        return None
    totals = np.bincount(origins[near], weights=flux[near])
    best = int(totals.argmax())
    return best if totals[best] >= MIN_SHARE * totals.sum() else None


RADIUS = 0.01
"""Radius of the light whose colour is dragged, share of the picture's height at that distance."""


def begin_pull_at(session: Session, request: requests.BeginPull) -> Answer:
    """Find the surface at the pixel of `request`; what is returned finds its light and begins the drag.

    Both raise `UserError` with the reason where there is nothing to pull."""
    clicked = session.state.scene
    hit = pick_in(session.state, request.x, request.y)
    if hit is None or not hit.is_receiver:
        raise UserError("there is no caustic here; take hold of a coloured part of one")

    def ask() -> NotYet | None:
        state, picture = session.state, session.picture
        if len(state.scene.objects) != len(clicked.objects):
            return None  # indices mean something else
        view = state.view
        x, y = view.project(np.asarray(hit.position))[0]
        rgb, photons = picture.pixel((x, y)), picture.stored_photons(state.scene, PHOTONS)
        if rgb is None or isinstance(photons, NotYet):
            return NOT_YET
        pull = begin_pull(
            photons,
            state.scene,
            hit.position,
            hit.normal,
            RADIUS * view.height_at(hit.distance),
            hit.object_index,
            wavelength_nm=state.solo_nm,
            xyz=rgb709_to_xyz(np.array(rgb)),
            prefer=state.selection.index if state.selection.kind == "object" else None,
            local=request.local,
        )
        session.state = replace(state, pull=pull)
        return None

    return ask


def carry_out(session: Session, request: requests.Request) -> None:
    """Do what `request` says; what the renderer cannot answer yet is repeated in later frames (`ask_again`). Raises
    `UserError`, and NotImplementedError for one that is unknown."""
    kind = type(request)
    handler = _HANDLERS.get(kind)
    if handler is None:
        raise NotImplementedError(f"unknown request {kind.__name__}")
    session.awaited.pop(kind, None)  # the one before is no longer wanted
    ask = handler(session, request)
    if ask is not None and ask() is NOT_YET:
        session.awaited[kind] = ask
        session.messages.show(f"{_AWAITED[kind]} is {NOT_YET.value} …")


def ask_again(session: Session, kind: type) -> None:
    """Ask what the last request of that kind awaits. Raises `UserError`."""
    ask = session.awaited.pop(kind)
    if ask() is NOT_YET:
        session.awaited[kind] = ask


def _stand_up(session: Session, request: requests.StandUp) -> None:
    document = session.document.stood_up(request.up)
    assert document.source is not None
    session.settings = session.settings.said_up(document.source, request.up)
    session.show_document(document)


def _save(session: Session, request: requests.Save) -> None:
    path = session.document.save(request.path)
    session.settings = session.settings.opened(path)
    session.messages.show(f"Saved {path.name} in {path.parent}.")


def _quit_after_export(session: Session, request: requests.QuitAfterExport) -> None:
    session.asks_about_export, session.quits_after_export = False, True
    if request.stop and not session.jobs.exports.is_stopped:
        session.jobs.cancel_export()


def _recover(session: Session, request: requests.Recover) -> None:
    recovery = session.recovery
    if recovery is None:
        return
    if request.discard:
        recovery.discard()
        session.recovery = None
        return
    session.show_document(Document.recovered(recovery.load(), recovery.original))
    # This session's own autosave covers the work from here on.
    session.autosave.write_now(session.document.scene, session.document.title, session.document.source)
    recovery.discard()
    session.recovery = None
    session.messages.show(f"Recovered {recovery.note.title}. Save it to keep it.")


def _select_at(session: Session, request: requests.SelectAt) -> Answer | None:
    hit = pick_in(session.state, request.x, request.y)
    if hit is None:
        session.state = replace(session.state, selection=Selection(), also=())
        return None
    if not request.itself and hit.is_receiver:
        return _select_source(session, hit, request.add)
    _select(session, hit.object_index, request.add)
    return None


def _select(session: Session, index: int, add: bool) -> None:
    chosen = Selection("object", index)
    if selecting.is_locked(session.state, chosen):
        name = session.state.scene.objects[index].name
        session.messages.show(f"{name} is locked: unlock it in the outliner to select it here.")
    else:
        session.state = selecting.chosen(session.state, chosen, add)


def _select_source(session: Session, hit: PickHit, add: bool) -> Answer:
    """Select the receiver at `hit`; what is returned finds whose caustic is there, and selects that instead."""
    clicked, receiver = session.state, Selection("object", hit.object_index)
    if not selecting.is_locked(clicked, receiver):
        _select(session, receiver.index, add)
    meanwhile = session.state.selection, session.state.also

    def ask() -> NotYet | None:
        state = session.state
        index = index_in(state.scene, clicked.scene, hit.object_index)
        if index is None or (state.selection, state.also) != meanwhile:
            return None
        photons = session.picture.stored_photons(state.scene, PHOTONS)
        if isinstance(photons, NotYet):
            return photons
        landed = photons.position, photons.flux_w, photons.source, photons.receiver
        source = source_at(np.asarray(hit.position), index, *landed)
        if source is not None:
            session.state = replace(state, selection=clicked.selection, also=clicked.also)
        if source is not None or selecting.is_locked(state, receiver):
            _select(session, index if source is None else source, add)
        return None

    return ask


def _frame_selection(session: Session, _request: requests.FrameSelection) -> None:
    state = session.state
    chosen = list(state.scene.objects)
    if state.selection.kind == "object":
        chosen = [state.scene.objects[state.selection.index]]
    elif state.selection.kind == "light":
        target = vec3(state.scene.lights[state.selection.index].position)
        session.state = replace(state, camera=replace(state.camera, target=target))
        return
    if not chosen:
        raise UserError("the scene is empty: there is nothing to frame")
    low, high = bounds_of(chosen)
    if state.selection.kind is None:
        low, high = _without_endless_receivers(session, low, high)
    width, height = state.viewport_size
    aspect = max(width / height, state.frame_aspect)  # that of what `camera_for` makes room for
    session.state = replace(state, camera=camera_controls.frame(state.camera, low, high, aspect))


def _without_endless_receivers(session: Session, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The box without what is large and of little interest: a table forty times as wide as the prism on it."""
    interesting = [o for o in session.state.scene.objects if not o.material.receives]
    if not interesting:
        return low, high
    inner_low, inner_high = bounds_of(interesting)
    room = 1.5 * float(np.linalg.norm(inner_high - inner_low))
    return np.maximum(low, inner_low - room), np.minimum(high, inner_high + room)


def _retrace(session: Session, _request: requests.Retrace) -> None:
    if session.picture.engine is None:
        session.picture.restart()
    else:
        session.picture.engine.retrace()


def _export(session: Session, request: requests.Export) -> None:
    if isinstance(request, requests.Screenshot) and request.with_interface:
        if request.path.suffix.lower() != ".png":
            raise UserError(f"cannot write {request.path.name}: a picture of the whole window is a .png")
        check_writable(request.path)
        session.window_picture = request.path
        return
    session.jobs.export(request, session.drawn.visible(session.state), session.picture)


def _copy_material(session: Session, request: requests.CopyMaterial) -> None:
    thing = session.state.scene.objects[request.index]
    session.state = replace(session.state, clipboard=thing.material)
    session.messages.show(f"Copied the material of {thing.name}.")


_AWAITED = {requests.SelectAt: "What made this light", requests.BeginPull: "The glass of this colour"}
"""What a request asks the renderer."""
_HANDLERS: dict[type, Callable[[Session, Any], Answer | None]] = {
    requests.NewScene: lambda session, _: session.show_document(Document.new()),
    requests.Open: lambda session, request: session.show_document(session.opened(request.path)),
    requests.OpenLesson: lambda session, request: session.show_lesson(lesson(request.name)),
    requests.StandUp: _stand_up,
    requests.Save: _save,
    requests.Undo: lambda session, _: session.show_scene(session.document.history.undo()),
    requests.Redo: lambda session, _: session.show_scene(session.document.history.redo()),
    requests.GoTo: lambda session, request: session.show_scene(session.document.history.go_to(request.index)),
    requests.Quit: lambda session, request: session.quit(request.discard),
    requests.CancelQuit: lambda session, _: session.stay(),
    requests.QuitAfterExport: _quit_after_export,
    requests.FullScreen: lambda session, _: session.toggle_full_screen(),
    requests.Recover: _recover,
    requests.SelectAt: _select_at,
    requests.BeginPull: begin_pull_at,
    requests.FrameSelection: _frame_selection,
    requests.Retrace: _retrace,
    requests.ReloadShaders: lambda session, _: session.reload_shaders(),
    requests.Screenshot: _export,
    requests.RenderPicture: _export,
    requests.Bake: _export,
    requests.Animate: _export,
    **dict.fromkeys(get_args(requests.Solving), _export),
    requests.CancelJob: lambda session, _: session.jobs.cancel_export(),
    requests.ComputeReference: lambda session, _: session.jobs.comparison.restart(),
    requests.CopyMaterial: _copy_material,
    requests.Notice: lambda session, request: session.messages.show(request.text, request.is_error),
    requests.DismissMessage: lambda session, request: session.messages.close(request.text),
}
