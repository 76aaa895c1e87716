"""A scene that stays on the device: photons are kept, and an edit redoes only what depends on it.

This is the viewer's engine without its window: the same store of photons, the same decision what an edit costs.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..base.errors import UserError
from ..base.not_yet import NotYet
from ..edit.stored_photons import StoredPhotons
from .arguments import Count, Size, settings_of, whole
from .device import Cancel, Device, Progress, Report
from .picture import Picture, Statistics
from .scene import Scene
from .view import View

if TYPE_CHECKING:
    from ..gpu.context import Context
    from ..render.viewer.engine import LiveEngine

DEFAULT_SAMPLES = 32
_ALL = 10**12


@dataclass(frozen=True)
class _State:
    """What the engine has shown last."""

    photons: int
    rays: int
    samples: int


class Session:
    """Renders one scene again and again; use it with `with`. `scene` is a copy of its own: edit that.

    Only what an edit concerns is done again: a camera that moved traces nothing; a glass whose index at the d line
    stays (its `dispersion_gain`, another V_d, a glass of the same n_d) traces nothing either, and is followed to first
    order in the change of its index, as in the viewer; anything else traces its photons anew.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        size: Size | None = None,
        photons: Count | None = None,
        spp: int = DEFAULT_SAMPLES,
        seed: int | None = None,
        method: str | None = None,
        exact: bool = False,
    ) -> None:
        """`exact`: trace again after an edit that would be followed to first order only. The rest as for `render`.
        Raises `UserError`, also where there is no OpenGL."""
        self._settings = settings_of(scene, size=size, photons=photons, seed=seed, method=method, spp=spp)
        self._scene = scene.copy()
        self._exact = exact
        self._device: Device | None = Device()
        self._engine: LiveEngine | None = None
        self._before = _State(0, 0, 0)
        self._view: View | None = None

    @property
    def scene(self) -> Scene:
        """What is rendered: edit it."""
        return self._scene

    # ---- work --------------------------------------------------------------------------------

    def render(self, *, progress: Progress | None = None, cancel: Cancel | None = None) -> Picture:
        """The scene as it is now. Raises `UserError`.

        `stats.photons_traced` says whether photons were traced for it. Callbacks as for `spectrasplat.render`; the next
        call goes on where `cancel` stopped."""
        from ..render.viewer.still_engine import picture_of

        started = time.perf_counter()

        def work(context: Context, report: Report, stopped: Cancel) -> Picture:
            rays = self._before.rays
            self._follow(context, report, stopped)
            engine, stats = self._live, self._live.stats
            rgb = picture_of(engine)
            if rgb is None:
                raise UserError("the rendering was stopped before there was a picture: let it go on for longer")
            self._before = _State(stats.photons, stats.rays_traced, int(stats.camera_samples))
            shown = Statistics(
                stats.photons,
                stats.photons if stats.rays_traced > rays else 0,
                int(stats.camera_samples),
                time.perf_counter() - started,
                stats.renderer,
                stats.is_software,
                not engine.is_idle,
                (engine.problem,) if engine.problem else (),
            )
            return Picture(rgb, None, None, shown, {"beauty": rgb}, self._settings.exposure_ev or 0.0)

        return self._running.run(work, progress, cancel)

    def set_glass(self, name: str, glass: str | None = None, **keys: Any) -> None:
        """Make object `name` of another catalogue glass, or change keys of its table (`dispersion_gain`, `priority`).

        The same as `session.scene.objects[name].update(…)`; raises `UserError`."""
        if glass is not None:
            keys = {"material": None, "glass": glass} | keys
        self.scene.objects[name].update(**keys)

    def photons(
        self, limit: int | None = None, *, progress: Progress | None = None, cancel: Cancel | None = None
    ) -> StoredPhotons:
        """The photons that the picture is made of, as arrays in world space; see `Photons`.

        `limit`: about so many, evenly chosen and each standing for more light. Raises `UserError`."""

        def work(context: Context, report: Report, stopped: Cancel) -> StoredPhotons:
            self._follow(context, report, stopped)
            found = self._live.stored_photons(_ALL)
            if isinstance(found, NotYet):
                raise UserError(f"the session's photons are {found.value}: ask again")
            every = 1 if limit is None else -(-len(found.flux_w) // limit)
            # Records follow a space-filling curve over the lattice: every n-th of them is nearly a lattice again.
            chosen = found.chosen(np.arange(0, len(found.flux_w), max(every, 1)))
            # A record holds its share of the light times the photons of the pass.
            share = len(found.flux_w) / max(len(chosen.flux_w), 1)
            return replace(chosen, flux_w=chosen.flux_w * share / (self._settings.photons or 1))

        if limit is not None:
            whole("limit", limit, 1, _ALL)
        return self._running.run(work, progress, cancel)

    def view(self) -> View:
        """The session live in a notebook, to walk round and to stretch its dispersion; needs the extra `notebook`, and
        is a picture without it. Needs no `render` before. Raises `UserError`."""
        self._running  # noqa: B018 - a closed one says so
        if self._view is None or not self._view.is_live:
            self._view = View(self)
        return self._view

    def close(self) -> None:
        """Free the device. A session that is closed renders nothing more."""
        if self._view is not None:
            self._view.close()
            self._view = None
        device, self._device = self._device, None
        if device is None:
            return
        if self._engine is not None:
            device.run(lambda context, report, stopped: self._live.release())
            self._engine = None
        device.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ---- private -----------------------------------------------------------------------------

    @property
    def _running(self) -> Device:
        if self._device is None:
            raise UserError("this session is closed: open another one with Session(scene)")
        return self._device

    @property
    def _live(self) -> LiveEngine:
        assert self._engine is not None
        return self._engine

    def _follow(self, context: Context, report: Report, stopped: Cancel) -> None:
        """Work, in the device's thread, until what is wanted is shown."""
        from ..render.viewer.still_engine import finish

        finish(self._wanting(context), self._settings.photons or 1, report, stopped)

    @property
    def _size(self) -> tuple[int, int]:
        return self._settings.width, self._settings.height

    def _advance(self, context: Context, budget_s: float, is_moving: bool) -> LiveEngine:
        """For a view: work for a while, in the device's thread; coarse pictures come first."""
        engine = self._wanting(context, coarse_first=True)
        engine.preview_seconds = budget_s
        engine.advance(budget_s, is_moving)
        stats = engine.stats
        self._before = _State(stats.photons, stats.rays_traced, int(stats.camera_samples))
        return engine

    def _wanting(self, context: Context, coarse_first: bool = False) -> LiveEngine:
        """The engine, with the scene as it is now."""
        from ..edit.parameters import Stage
        from ..render.frame_fit import inputs_of
        from ..render.viewer.still_engine import still_engine

        settings, model = self._settings, self.scene._model
        if self._engine is None:
            self._engine = still_engine(context, settings, self._exact, coarse_first)
        self._engine.set(inputs_of(Stage(model, model.camera), settings))
        return self._engine
