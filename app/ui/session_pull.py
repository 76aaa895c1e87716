"""Takes hold of a colour of the caustic: from a pixel of the viewport to what `pull` solves with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..base.errors import UserError
from ..base.not_yet import NOT_YET, NotYet
from ..edit.picking import pick_in
from ..edit.pull import begin_pull
from ..edit.requests import BeginPull
from ..model.optics.colorimetry import rgb709_to_xyz
from .session import Session

PHOTONS = 400_000
RADIUS = 0.01
"""Of what is taken hold of, share of the picture's height at that distance."""


def begin_pull_at(session: Session, request: BeginPull) -> Callable[[], NotYet | None]:
    """Find the surface at the pixel of `request`; what is returned asks for its light and takes hold of that.

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
