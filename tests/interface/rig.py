"""A whole viewer without a window: real engine, real panels, a synthetic mouse, sizes that suit a test."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from imgui_bundle import imgui
from spectrasplat.base.not_yet import NotYet
from spectrasplat.edit.picking import pick_in
from spectrasplat.edit.state import Selection
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.device_traits import Budget
from spectrasplat.model.scene import Dielectric, Diffuse
from spectrasplat.render.viewer.engine import LiveEngine
from spectrasplat.ui.frame import Draw
from spectrasplat.ui.headless import HeadlessInterface
from spectrasplat.ui.session import Session
from spectrasplat.ui.shell import draw_interface
from spectrasplat.ui.viewer import Viewer, headless_viewer

PHOTONS = 1 << 14
SIZE = (760, 500)
CELLS = 40
"""Of a grid over the picture in which the caustic is looked for."""
SAMPLES = 1
"""Camera samples a pixel: what is compared is the same to the bit with any number."""


class Hands:
    """A viewer and what a user does with it."""

    escape = imgui.Key.escape

    def __init__(self, viewer: Viewer, interface: HeadlessInterface) -> None:
        self.session, self.pace, self.interface = viewer.session, viewer.pace, interface

    @property
    def engine(self) -> LiveEngine:
        engine = self.session.picture.engine
        assert engine is not None, [message.text for message in self.session.messages.messages()]
        return engine

    @property
    def rays_traced(self) -> int:
        return self.session.picture.stats.rays_traced

    def settle(self, patience_s: float = 60.0) -> np.ndarray:
        """Frames until nothing is left to do; returns the linear picture (h, w, 3)."""
        self.interface.frame(2)
        deadline = time.monotonic() + patience_s
        while not self.session.picture.stats.converged:
            self.interface.frame()
            assert time.monotonic() < deadline, f"not converged after {patience_s} s: {self.session.picture.stats}"
        return self.picture()

    def picture(self) -> np.ndarray:
        """The linear picture (h, w, 3) as it is."""
        texture = self.engine.picture
        assert texture is not None
        return np.frombuffer(texture.read(), np.float32).reshape(texture.height, texture.width, 4)[..., :3].copy()

    def glass(self) -> int:
        """Index of the first glass."""
        return next(i for i, o in enumerate(self.session.state.scene.objects) if isinstance(o.material, Dielectric))

    def receiver(self) -> int:
        """Index of the first receiver."""
        return next(i for i, o in enumerate(self.session.state.scene.objects) if isinstance(o.material, Diffuse))

    def caustic_place(self, share: float = 0.5) -> tuple[float, float]:
        """Where on the screen the light that came through the glass lands: its middle, or another percentile along its
        length."""
        photons = self.engine.stored_photons(100_000)
        assert not isinstance(photons, NotYet)
        state = self.session.state
        mine = (photons.source == self.glass()) & (photons.receiver == self.receiver())
        seen, depth = state.view.project(photons.position[mine])
        inside = (depth > 0) & ((seen > 0.1) & (seen < 0.9)).all(axis=1)
        assert inside.sum() > 50, "the caustic is not in view"
        seen, flux = seen[inside], photons.flux_w[mine][inside]
        cells = np.floor(seen * CELLS).astype(int) @ [1, CELLS]
        brightness = np.bincount(cells, flux, CELLS * CELLS)
        seen = seen[brightness[cells] > 0.3 * brightness.max()]  # the caustic itself, not stray light
        # A photon itself, not a mean of places, which may lie beside a bent caustic; and none that glass hides.
        ordered = seen[np.argsort(seen[:, 0])]
        for at in ordered[int(share * (len(ordered) - 1)) :]:
            hit = pick_in(state, float(at[0]), float(at[1]))
            if hit is not None and hit.object_index == self.receiver():
                return self.interface.find("Picture").at(float(at[0]), float(at[1]))
        raise AssertionError("the caustic is hidden by glass")


def target(photons: int) -> int:
    """Photons that one pass of `photons` reaches for certain: a lattice may hold a few less."""
    return int(0.9 * photons)


def small_engine(photons: int) -> type[LiveEngine]:
    """Makes engines of sizes that converge within seconds on the software renderer."""

    def make(context: Context) -> LiveEngine:
        engine = LiveEngine(context, Budget(1 << 13, photons, photons, 64 << 20))
        engine.camera_samples = SAMPLES
        return engine

    return make  # type: ignore[return-value]


@contextmanager
def viewer(
    context: Context,
    scene: Path,
    photons: int = PHOTONS,
    size: tuple[int, int] = SIZE,
    refine: bool = False,
    draw: Draw = draw_interface,
) -> Iterator[Hands]:
    """A viewer of `scene`; `photons` is the target."""
    session = Session(context, scene, make_engine=small_engine(photons))
    session.jobs.gallery.release()
    preferences = replace(session.state.preferences, target_photons=target(photons), refine_when_still=refine)
    session.state = replace(session.state, preferences=preferences, selection=Selection())
    guest = Viewer(session, draw)
    interface = headless_viewer(guest, size)
    try:
        yield Hands(guest, interface)
    finally:
        interface.release()
        session.autosave.close()
        session.release()
