"""Drives the live engine as a hand on the mouse does, frame by frame, on a device taken for a GPU: what every frame
asks of OpenGL, and how long its Python takes.

Python's time is the thread's own in frames whose dispatches, draws, waits and copies are left out; all other calls
(binding, uniforms, uploads) count. It is given as on a machine with nothing else to do: a piece of work of the same
kind is timed beside every frame.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from unittest import mock

import moderngl
import numpy as np
from gl_counts import Counts, counted
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.edit.camera_controls import orbit
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.edit.state import Display as DisplaySettings
from spectrasplat.gpu import device_traits
from spectrasplat.gpu.context import Context, create_context
from spectrasplat.gpu.device_traits import Budget, DeviceTraits
from spectrasplat.gpu.linker import Linker
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics.glass import with_gain
from spectrasplat.model.scene import Scene
from spectrasplat.passes.display import Display
from spectrasplat.render.viewer.engine import LiveEngine

SIZE = (160, 90)
FRAME_S = 1 / 60
PATIENCE_S = 300.0
QUIET_MS = 0.65
"""What `_same_work` takes on the machine that the bounds are for, with nothing else to do there."""
_WORK = (
    *((moderngl.ComputeShader, name) for name in ("run", "run_indirect")),
    *((moderngl.VertexArray, name) for name in ("render", "render_indirect")),
    *((moderngl.Context, name) for name in ("finish", "memory_barrier", "copy_buffer", "copy_framebuffer")),
    (moderngl.Framebuffer, "clear"),
)
"""What makes a software renderer draw, wait or copy."""
_TEXTURES = moderngl.Texture, moderngl.TextureArray, moderngl.Texture3D, moderngl.TextureCube
_DRIVER = (
    *_WORK,
    *((owner, "read") for owner in (moderngl.Buffer, *_TEXTURES, moderngl.Framebuffer)),
    *((moderngl.Context, name) for name in ("buffer", "texture", "compute_shader", "program")),
    *((Linker, name) for name in ("_begin", "adopted", "compiled_by")),
)
"""That and what it does in the caller's thread where a GPU's driver has threads, memory and a device of its own."""


@dataclass
class Frame:
    """One frame."""

    counts: Counts
    python_ms: float
    version: int
    """Of the picture."""


@contextmanager
def without_work() -> Iterator[None]:
    """Nothing is drawn or waited for within the block: a software renderer draws in the caller's thread, or leaves it
    cold caches."""
    with ExitStack() as stack:
        for owner, name in _WORK:
            stack.enter_context(mock.patch.object(owner, name, lambda *_, **__: None))
        yield


@contextmanager
def beside_driver() -> Iterator[Callable[[], float]]:
    """Gives a clock of the thread's own seconds that stands still in what a driver does."""
    inside, depth = 0.0, 0

    def apart(real: Callable[..., object]) -> Callable[..., object]:
        def called(*arguments: object, **named: object) -> object:
            nonlocal inside, depth
            started, depth = time.thread_time(), depth + 1
            try:
                return real(*arguments, **named)
            finally:
                depth -= 1
                inside += 0.0 if depth else time.thread_time() - started

        return called

    with ExitStack() as stack:
        for owner, name in _DRIVER:
            stack.enter_context(mock.patch.object(owner, name, apart(getattr(owner, name))))
        yield lambda: time.thread_time() - inside


class ViewerRig:
    """The live engine on a scene, and the picture on its way to the window."""

    def __init__(self, context: Context, scene: Scene, size: tuple[int, int] = SIZE, photons: int = 1 << 14) -> None:
        self.engine = LiveEngine(context, Budget(photons, photons, photons, 1 << 26))
        self.engine.target_photons = photons
        self.engine.refine_when_still = False
        self._display = Display(context)
        self._settings = DisplaySettings()
        self.wanted = LiveInputs(scene, scene.camera, *size)

    def settle(self) -> None:
        """Until nothing is left to do."""
        self.engine.set(self.wanted)
        end = time.monotonic() + PATIENCE_S
        while not self.engine.is_idle:
            assert self.engine.problem is None, self.engine.problem
            assert time.monotonic() < end, "it took too long"
            self.engine.advance(0.1)

    def frames(self, count: int, change: Callable[[LiveInputs, int], LiveInputs]) -> list[Frame]:
        """So many frames, with `change` before each: first as they are, counted, then without their work, timed."""
        found = []
        start = self.wanted
        for number in range(count):
            self.wanted = change(start, number + 1)
            with counted() as counts:
                self._frame()
            took, beside = [], []
            for step in range(4):
                self.wanted = change(start, number + 1.2 + 0.2 * step)
                with without_work():
                    took.append(_seconds(self._frame))
                beside.append(_seconds(_same_work))
            assert self.engine.problem is None, self.engine.problem
            found.append(Frame(counts, QUIET_MS * min(took) / min(beside), self.engine.picture_version))
        return found

    def steps(self, wanted: Iterable[LiveInputs]) -> Iterator[Counts]:
        """What a frame of each asks for, from the third picture on."""
        shown = set()
        for self.wanted in wanted:
            with counted() as counts:
                self._frame()
            assert self.engine.problem is None, self.engine.problem
            shown.add(self.engine.picture_version)
            if len(shown) > 3:
                yield counts

    def python_ms(self, wanted: LiveInputs, frames: int) -> list[float]:
        """Of the engine in each of so many frames while the camera goes round in what is `wanted` now, and then in each
        until nothing is left to do."""
        found: list[float] = []
        with beside_driver() as clock:
            while len(found) < frames or not self.engine.is_idle:
                is_held = len(found) < frames
                self.wanted = orbiting(wanted, min(len(found), frames))
                started = clock()
                self.engine.set(self.wanted)
                self.engine.advance(FRAME_S, interacting=is_held)
                found.append(QUIET_MS * (clock() - started) / _seconds(_same_work))
                assert self.engine.problem is None and len(found) < 10_000, self.engine.problem
        return found

    def _frame(self) -> None:
        self.engine.set(self.wanted)
        self.engine.advance(FRAME_S, interacting=True)
        picture = self.engine.picture
        assert picture is not None
        self._display.run(picture, self._settings, 0.0, (self.wanted.width, self.wanted.height))

    def release(self) -> None:
        """Free everything."""
        self._display.release()
        self.engine.release()


def _seconds(work: Callable[[], None]) -> float:
    began = time.thread_time()
    work()
    return time.thread_time() - began


def _same_work() -> None:
    """Small arrays, values replaced and looked up, as frames have them."""
    x, light = np.linspace(0.0, 1.0, 402), {}
    for step in range(40):
        y = np.interp(x, x, np.cumsum(np.clip(x - 0.1, 0.0, 1.0)))
        light[replace(DisplaySettings(), exposure_ev=0.1 * step)] = np.array_equal(x, y), y.astype("f4").tobytes()


def with_gains(scene: Scene, gains: Iterable[float]) -> Scene:
    """Glasses whose dispersion is so many times what it is, one after the other."""
    glasses = dict.fromkeys(o.material.dispersion for o in scene.objects if o.material.transmits)
    gain_of = dict(zip(glasses, gains, strict=False))
    objects = (
        replace(o, material=replace(o.material, dispersion=with_gain(d, gain_of[d])))
        if (d := o.material.dispersion) in gain_of
        else o
        for o in scene.objects
    )
    return replace(scene, objects=tuple(objects))


def orbiting(before: LiveInputs, step: float) -> LiveInputs:
    """The camera goes round."""
    return replace(before, camera=orbit(before.camera, 3.0 * step, 0.3 * step))


def dragging(before: LiveInputs, step: float) -> LiveInputs:
    """The slider of the first dispersive glass is moved."""
    objects = list(before.scene.objects)
    at = next(i for i, o in enumerate(objects) if o.material.transmits and o.material.dispersion.is_dispersive)
    material = objects[at].material
    gain = material.dispersion.gain * (1.0 + 0.05 * step)
    objects[at] = replace(objects[at], material=replace(material, dispersion=with_gain(material.dispersion, gain)))
    return replace(before, scene=replace(before.scene, objects=tuple(objects)))


def turning(before: LiveInputs, step: float) -> LiveInputs:
    """The first glass is turned about the vertical axis through its middle."""
    objects = list(before.scene.objects)
    at = next(i for i, o in enumerate(objects) if o.material.transmits)
    angle, matrix, turn = np.radians(step), objects[at].object_to_world.copy(), np.eye(4)
    turn[:2, :2] = (np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))
    middle = matrix[:3, 3].copy()
    matrix[:3, 3] = 0.0
    matrix = turn @ matrix
    matrix[:3, 3] = middle
    objects[at] = replace(objects[at], object_to_world=matrix)
    return replace(before, scene=replace(before.scene, objects=tuple(objects)))


def pulling(before: LiveInputs, step: float | np.ndarray) -> LiveInputs:
    """The first glass is dragged along x, or by a vector, of hundredths."""
    objects = list(before.scene.objects)
    at = next(i for i, o in enumerate(objects) if o.material.transmits)
    matrix = objects[at].object_to_world.copy()
    matrix[:3, 3] += 0.01 * (step if np.ndim(step) else np.array([step, 0.0, 0.0]))
    objects[at] = replace(objects[at], object_to_world=matrix)
    return replace(before, scene=replace(before.scene, objects=tuple(objects)))


def roughened(before: LiveInputs) -> LiveInputs:
    """The first glass is ground."""
    objects = list(before.scene.objects)
    at = next(i for i, o in enumerate(objects) if o.material.transmits)
    objects[at] = replace(objects[at], material=replace(objects[at].material, roughness=0.2))
    return replace(before, scene=replace(before.scene, objects=tuple(objects)))


def doubled(before: LiveInputs) -> LiveInputs:
    """There is another one like the first glass beside it."""
    item = next(o for o in before.scene.objects if o.material.transmits)
    matrix = item.object_to_world.copy()
    matrix[0, 3] += 0.8
    objects = (*before.scene.objects, replace(item, name=f"{item.name} 2", object_to_world=matrix))
    return replace(before, scene=replace(before.scene, objects=objects))


MOVEMENTS = {"orbit": orbiting, "drag": dragging, "turn": turning}


def table(frames: list[Frame]) -> str:
    """What each frame asked for."""
    lines = ["made programs up_KiB down_B reads finishes dispatches draws python_ms"]
    for frame in frames:
        c = frame.counts
        lines.append(
            f"{len(c.made):4} {c.programs:8} {c.written_bytes / 1024:6.1f} {c.read_bytes:6} {c.reads:5} "
            f"{c.finishes:8} {c.dispatches:10} {c.draws:5} {frame.python_ms:9.2f}"
        )
    return "\n".join(lines)


@contextmanager
def viewer(name: str, size: tuple[int, int] = SIZE) -> Iterator[ViewerRig]:
    """A shipped scene, settled, on a device taken for a GPU."""
    with (
        device_traits.assumed(DeviceTraits(splats_by_compute=True)),
        create_context() as context,
    ):
        rig = ViewerRig(context, load_scene(shipped_scenes()[name]), size)
        try:
            rig.settle()
            yield rig
        finally:
            rig.release()


def main() -> None:
    """`viewer_rig.py [scene …]`: counts and times of all movements."""
    import sys
    from collections import Counter

    for name in sys.argv[1:] or ["prism", "default", "ball"]:
        with viewer(name) as rig:
            for movement, change in MOVEMENTS.items():
                frames = rig.frames(8, change)
                median = float(np.median([frame.python_ms for frame in frames[2:]]))
                print(f"{name} {movement}: Python {median:.2f} ms a frame\n{table(frames)}")
                print("  made in the last:", dict(Counter(frames[-1].counts.made)), flush=True)
                rig.settle()


if __name__ == "__main__":
    main()
