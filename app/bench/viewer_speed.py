"""How fast the viewer answers: frame times while light gathers, while walking round, while the dispersion is dragged
and while the glass is turned.

The whole interface is drawn without a window and gets synthetic input, so that the figures can be repeated on any
machine. Every frame is finished on the device before its time is taken; no screen is waited for.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import UserError
from ..edit.glass import set_dispersion_gain
from ..edit.state import Selection
from ..model.placement import rotation_about
from ..passes.sample_picture import SamplePicture
from ..render.viewer.engine import LiveEngine
from ..ui.headless import HeadlessInterface
from ..ui.session import Session
from ..ui.viewer import Viewer, headless_viewer

if TYPE_CHECKING:
    from ..gpu.context import Context

ORBIT_PX = 3.0
"""Of the mouse in a frame."""
TURN_DEG = 1.0
"""Of the glass in a frame."""
PATIENCE_S = 120.0
NUDGES = 8
"""Single inputs whose answers are timed."""
REST_S = 1.0
"""Most time that is waited for before each until nothing changes; a slow machine would take minutes."""
ANSWER_S = 2.0
"""An input that no picture shows by then is counted as missed."""
_CHROME = (1.85, 1.6)
"""Window over viewport, first guess."""


Figures = dict[str, float]
"""With units in their names. Of a phase: `photons_per_s` traced, `pictures_per_s` new ones, what is seen to move;
`frame_photons` of the last frame that had any; `processor_ms` of a frame on all cores, which other programs change less
than they change the clock's time; `direct_side` and `glass_side`, the picture's side over the wanted one, on average,
for what is seen directly and by way of glass and mirrors; `whole_s` from the last input until every pixel has its own
path again, and `whole_processor_s` on all cores; `…_device_ms` of a frame, by pass and the device's own timers, where
these work."""


def run(
    context: Context, scene: Path, size: tuple[int, int], seconds: float, frames: float = math.inf
) -> Iterator[tuple[str, Figures]]:
    """What was done and its figures, as they are measured: `seconds` for each phase, a viewport of `size` pixels. With
    `frames` only what is moved, for so many at most."""
    bench = _Bench(context, scene, size)
    try:
        first = bench.wait_for_picture()
        whole = first + bench.wait_for_whole()
        yield "first picture", {"first_s": round(first, 3), "whole_s": round(whole, 3)}
        if frames == math.inf:
            yield "accumulating", bench.phase(seconds, bench.rest)
        for name, hold, act in (
            ("orbiting", bench.holding_middle_button, bench.orbit),
            ("dragging dispersion", bench.holding_gain, bench.drag_gain),
            ("turning the glass", bench.holding_gain, bench.turn_glass),
        ):
            yield name, bench.phase(seconds, act, hold, frames)
            for _ in range(30):
                bench.interface.frame()
        yield "device memory", {"mib": round(bench.session.picture.stats.bytes / 2**20)}
        if frames == math.inf:
            yield "a step of the camera", bench.latency(bench.nudge_camera)
            yield "a step of dispersion", bench.latency(bench.nudge_gain)
    finally:
        bench.release()


class _Bench:
    """A viewer and its synthetic input."""

    def __init__(self, context: Context, scene: Path, size: tuple[int, int]) -> None:
        self._context = context
        self.session = Session(context, scene)
        self.session.jobs.gallery.release()
        self.viewer = Viewer(self.session)
        objects = self.session.state.scene.objects
        glass = next((i for i, o in enumerate(objects) if o.material.transmits), None)
        if glass is None:
            raise UserError(f"{scene}: nothing in it is glass, so there is no dispersion to drag")
        self._glass = glass
        self.session.state = replace(self.session.state, selection=Selection("object", glass)).with_panels(
            start_page=False
        )
        self.interface = self._fitted(size)
        self._sampler = SamplePicture(context)
        self._turn = 0

    def release(self) -> None:
        """Free everything."""
        self._sampler.release()
        self.interface.release()
        self.session.autosave.close()
        self.session.release()

    @property
    def viewport(self) -> tuple[int, int]:
        """Pixels."""
        return self.session.state.viewport_size

    def _fitted(self, size: tuple[int, int]) -> HeadlessInterface:
        """An interface whose viewport has `size`: panels take their share of the window."""
        window = (round(size[0] * _CHROME[0]), round(size[1] * _CHROME[1]))
        for _ in range(6):
            interface = headless_viewer(self.viewer, window)
            interface.frame(2)  # before the engine starts
            got = self.viewport
            if abs(got[0] - size[0]) <= 2 and abs(got[1] - size[1]) <= 2:
                break
            self.session.frames = 0
            interface.release()
            window = (window[0] + size[0] - got[0], window[1] + size[1] - got[1])
        else:
            interface = headless_viewer(self.viewer, window)
        return interface

    def wait_for_picture(self) -> float:
        """Seconds until the first picture."""
        return self._wait(lambda: self.session.picture.stats.camera_samples >= 1)

    def wait_for_whole(self) -> float:
        """Seconds until every pixel has its own path."""
        return self._wait(lambda: self.session.picture.stats.resolution_scale >= 1)

    def _wait(self, done: Callable[[], bool]) -> float:
        started = time.perf_counter()
        while not done():
            self.interface.frame()
            engine = self.session.picture.engine
            if engine is None or engine.problem:
                raise UserError(f"the viewer stopped: {engine.problem if engine is not None else 'see its messages'}")
            if time.perf_counter() - started > PATIENCE_S:
                raise UserError(f"no picture after {PATIENCE_S:.0f} s")
        return time.perf_counter() - started

    def phase(
        self,
        seconds: float,
        act: Callable[[], None],
        hold: Callable[[], AbstractContextManager[None]] = nullcontext,
        frames: float = math.inf,
    ) -> Figures:
        """Frames for `seconds`, `frames` at most, with `act` before each and `hold` held; then until the picture is
        whole again."""
        times: list[float] = []
        direct, glass = [], []
        engine = self.session.picture.engine
        assert engine is not None
        pictures, before = 0, self.session.picture.stats
        on_device = dict(self._context.timers.seconds)
        with hold():
            version = engine.picture_version
            started, worked = time.perf_counter(), time.process_time()
            while time.perf_counter() - started < seconds and len(times) < frames:
                act()
                self.interface.frame()
                times.append(self.session.frame_ms[-1])
                direct.append(self.session.picture.stats.direct_scale)
                glass.append(self.session.picture.stats.resolution_scale)
                pictures += engine.picture_version != version
                version = engine.picture_version
            elapsed, worked = time.perf_counter() - started, time.process_time() - worked
            rays = self.session.picture.stats.rays_traced - before.rays_traced
            spent = self._context.timers.since(on_device)
            photons = self.session.picture.stats.frame_photons
        ended = time.process_time()
        whole_s = self.wait_for_whole()
        found = {
            "frames": len(times),
            "median_ms": float(np.median(times)),
            "p95_ms": float(np.percentile(times, 95)),
            "longest_ms": max(times),
            "processor_ms": 1e3 * worked / len(times),
            "pictures_per_s": pictures / elapsed,
            "frame_photons": photons,
            "photons_per_s": rays / elapsed,
            "direct_side": float(np.mean(direct)),
            "glass_side": float(np.mean(glass)),
            "whole_s": whole_s,
            "whole_processor_s": time.process_time() - ended,
        } | {f"{name}_device_ms": 1e3 * seconds / len(times) for name, seconds in spent.items()}
        return {name: float(f"{figure:.4g}") for name, figure in found.items()}

    def rest(self) -> None:
        """Do nothing."""

    @contextmanager
    def held(self, place: tuple[float, float], button: int) -> Iterator[None]:
        """A mouse button is down at a place."""
        self.interface.move(place)
        self.interface.press(button)
        try:
            yield
        finally:
            self.interface.let_go(button)

    def holding_middle_button(self) -> AbstractContextManager[None]:
        """The viewport is held to orbit."""
        return self.held(self.interface.find("Picture").centre, 2)

    def orbit(self) -> None:
        """Turn a little, in a slow circle of the mouse."""
        self._turn += 1
        x, y = self.interface.find("Picture").centre
        angle = 0.05 * self._turn
        self.interface.put_mouse(
            (x + ORBIT_PX / 0.05 * math.sin(angle), y + 0.3 * ORBIT_PX / 0.05 * (1 - math.cos(angle)))
        )

    def holding_gain(self) -> AbstractContextManager[None]:
        """The slider of the dispersion gain is held."""
        return self.held(self.interface.find("Dispersion gain").at(0.1), 0)

    def drag_gain(self) -> None:
        """Move the slider to and fro."""
        self._turn += 1
        self.interface.put_mouse(self.interface.find("Dispersion gain").at(0.25 + 0.15 * math.sin(0.1 * self._turn)))

    def turn_glass(self) -> None:
        """Turn the object a little about the vertical axis through its middle, as the gizmo does."""
        state = self.session.state
        item = state.scene.objects[self._glass]
        matrix = item.object_to_world.copy()
        matrix[:3, :3] = rotation_about((0.0, 0.0, 1.0), math.radians(TURN_DEG)) @ matrix[:3, :3]
        objects = list(state.scene.objects)
        objects[self._glass] = replace(item, object_to_world=matrix)
        self.session.state = replace(state, scene=replace(state.scene, objects=tuple(objects)))

    def pause(self) -> None:
        """Trace no more and wait until the picture no longer changes, `REST_S` at most."""
        self.session.state = replace(
            self.session.state,
            playing=False,
            preferences=replace(self.session.state.preferences, refine_when_still=False),
        )
        deadline = time.perf_counter() + REST_S
        while not self.session.picture.stats.converged and time.perf_counter() < deadline:
            self.interface.frame()

    def nudge_camera(self) -> None:
        """Step aside by a hundredth."""
        state = self.session.state
        x, y, z = state.camera.position
        self.session.state = replace(state, camera=replace(state.camera, position=(x + 0.01 * abs(z) + 1e-3, y, z)))

    def nudge_gain(self) -> None:
        """A little more dispersion."""
        state = self.session.state
        material = state.scene.objects[self._glass].material
        gain = material.dispersion.gain
        self.session.state = replace(state, scene=set_dispersion_gain(state.scene, self._glass, min(gain * 1.07, 10.0)))

    def latency(self, nudge: Callable[[], None]) -> Figures:
        """From single inputs to the end of the first frame whose picture shows each: the median, where those that were
        missed (no such picture within `ANSWER_S`) took all that time, and how many these are.

        Pictures are finished after one camera sample from now on: what is timed begins at rest where the machine comes
        to it in time. Where it does not, pictures change by themselves: only one that was made after the engine took
        the input counts."""
        engine = self.session.picture.engine
        assert isinstance(engine, LiveEngine)
        engine.camera_samples = 1
        found: list[float] = []
        for _ in range(NUDGES):
            self.pause()
            before, shown = self._look(), engine.inputs
            nudge()
            spent, deadline = 0.0, time.perf_counter() + ANSWER_S
            while time.perf_counter() < deadline:
                taken, version = engine.inputs is not shown, engine.picture_version
                self.interface.frame()
                spent += self.session.frame_ms[-1]
                made = engine.picture_version != version and (taken or engine.inputs is not shown)
                if made and not np.array_equal(self._look(), before):
                    found.append(spent)
                    break
        missed = NUDGES - len(found)
        return {"answered_ms": round(float(np.median(found + [1e3 * ANSWER_S] * missed)), 1), "missed": missed}

    def _look(self) -> np.ndarray:
        radiance = self.session.picture.radiance
        assert radiance is not None
        return self._sampler.run(radiance)
