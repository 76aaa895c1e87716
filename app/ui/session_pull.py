"""Takes hold of a colour of the caustic: from a pixel of the viewport to what `pull` solves with."""

from __future__ import annotations

import numpy as np

from ..base.errors import UserError
from ..edit.projection import View
from ..edit.pull import begin_pull
from ..edit.requests import BeginPull, Pull
from ..model.optics.colorimetry import rgb709_to_xyz
from .session import Session
from .shown_scene import has_same_objects

PHOTONS = 400_000
RADIUS = 0.01
"""Of what is taken hold of, share of the picture's height at that distance."""


def begin_pull_at(session: Session, request: BeginPull) -> Pull:
    """What lies at the pixel of `request`. Raises `UserError` with the reason where there is nothing to pull."""
    engine, state = session.picture.engine, session.state
    hit = session.picture.pick((request.x, request.y))
    inputs = None if engine is None else engine.inputs
    if inputs is not None and not has_same_objects(state.scene, inputs.scene):
        raise UserError("the picture is being made anew; try again in a moment")
    if engine is None or hit is None or not hit.is_receiver:
        raise UserError("there is no caustic here; take hold of a coloured part of one")
    rgb = np.array(session.picture.pixel((request.x, request.y)) or (0.0, 0.0, 0.0))
    return begin_pull(
        engine.stored_photons(PHOTONS),
        state.scene,
        hit.position,
        hit.normal,
        RADIUS * View.of(state.camera, 1.0).height_at(hit.distance),
        hit.object_index,
        wavelength_nm=state.solo_nm,
        xyz=rgb709_to_xyz(rgb),
        prefer=state.selection.index if state.selection.kind == "object" else None,
        local=request.local,
    )
