"""The viewer's engine without its window: photons of one pass are kept, every picture is waited for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from ...base.errors import UserError
from ...gpu.context import Context
from ...model.settings import RenderSettings
from .engine import LiveEngine

DEFAULT_SAMPLES = 32
_STEP_S = 0.25
_RECORD_BYTES = 256
"""A photon record with several spectral columns, rounded up."""
_COARSER = 16
"""How many times fewer photons the first of several passes has; as many represent the light of beams in queries."""
_PER_PHOTON = 4
"""Landings that one emitted photon leaves at most, nearly."""


def still_engine(context: Context, settings: RenderSettings, exact: bool, coarse_first: bool = False) -> LiveEngine:
    """One that traces all photons in one pass and keeps them; `coarse_first`: after coarser passes, to be seen sooner.
    `exact`: trace again where an edit would be followed to first order only."""
    photons = settings.photons or 1
    live = context.traits.viewer
    room = max(live.store_bytes, photons * _PER_PHOTON * _RECORD_BYTES)
    first = min(photons, max(live.first_photons, photons // _COARSER)) if coarse_first else photons
    budget = replace(live, first_photons=first, largest_photons=photons, finest_photons=photons, store_bytes=room)
    engine = LiveEngine(context, budget)
    # A pass emits a few photons more or less than requested: one is enough in any case.
    engine.target_photons, engine.camera_samples = 1, settings.spp or DEFAULT_SAMPLES
    engine.refine_when_still = exact
    return engine


def finish(engine: LiveEngine, photons: int, report: Callable[[float, str], None], stopped: Callable[[], bool]) -> None:
    """Work until what is wanted is shown, or `stopped()`. Raises `UserError` where it cannot be."""
    for share in finishing(engine, photons):
        if stopped():
            break
        report(share, "taking camera samples" if engine.stats.photons >= photons else "tracing photons")
    report(1.0, "done")


def finishing(engine: LiveEngine, photons: int) -> Iterator[float]:
    """Work until what is wanted is shown, pausing with the share done. Raises `UserError` where it cannot be."""
    samples = engine.camera_samples
    while True:
        engine.advance(_STEP_S)
        if engine.problem is not None:
            raise UserError(engine.problem)
        if engine.is_idle:
            break
        stats = engine.stats
        yield min(0.8 * stats.photons / photons + 0.2 * stats.camera_samples / samples, 0.99)


def picture_of(engine: LiveEngine) -> np.ndarray | None:
    """What is shown: float32 (H, W, 3), linear Rec.709, top row first; None before there is anything."""
    texture = engine.picture
    if texture is None:
        return None
    return np.frombuffer(texture.read(), np.float32).reshape(texture.height, texture.width, 4)[..., :3].copy()
