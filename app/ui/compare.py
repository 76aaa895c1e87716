"""What the picture is compared with: the reference, or another method, computed in the time that is left over.

It belongs to the scene and view it was begun for. When those change it is kept and marked as stale; asking for
it again begins anew. The reference is the caustic layer by independent light tracing (`reference_thread`), put on the
picture without caustics; what is seen behind glass is not compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import UserError
from ..edit.live_inputs import LiveInputs
from ..edit.state import Compare, Selection
from ..gpu.context_thread import no_thread
from ..model.panorama_lights import with_panorama_lights
from ..render.solo import scene_seen
from ..render.viewer.dirty_level import DirtyLevel
from ..render.viewer.invalidation import dirty_level
from .compared_with import FilePicture, GlassSwap, with_alpha
from .direct_picture import SAMPLES, DirectPicture
from .panels.methods import METHOD_NAMES
from .reference_thread import ReferenceThread, Snapshot
from .screenshot import read_pixel, texels_of

if TYPE_CHECKING:
    import moderngl

    from ..edit.state import State
    from ..gpu.context import Context
    from ..gpu.context_thread import ContextThread
    from ..model.scene import Vec3
    from ..render.viewer.engine import LiveEngine
    from ..render.viewer.threaded_engine import Engine

REFERENCE, GLASS, FILE = "reference", "glass", "file"
_NOTHING = (0, 0)
STRIPE_PX, STRIPE_SHADE = 6, 0.25
"""Width of the stripes over what the reference does not hold, and the share of the picture's light that they leave."""


class Comparison:
    """Owns the other picture. `advance` every frame; everything else may be read at any time."""

    def __init__(
        self,
        context: Context,
        make_engine: Callable[[Context], Engine] | None = None,
        thread: Callable[[], ContextThread | None] = no_thread,
    ) -> None:
        """`thread`: where the reference's direct light is computed, called when it is first wanted; None for the
        caller's own, with `context`."""
        self._context, self._find_thread = context, thread
        self._make_engine = make_engine or _engine
        self._begun: LiveInputs | None = None
        """What it was begun for; the method is the running one's."""
        self._thread: ReferenceThread | None = None
        self._engine: Engine | None = None
        self._direct: DirectPicture | None = None
        self._composed: moderngl.Texture | None = None
        self._composed_from = _NOTHING
        self._compare = Compare()
        self.is_stale = False
        self._swap = GlassSwap()
        self._file = FilePicture(context)
        self._glass_problem: str | None = None
        self._wish: tuple[str, str] | None = None
        """Method and glass that are wanted of the engine …"""
        self._given: tuple[str, str] | None = None
        """… and those that it was last given."""
        self._version_before: int | None = None
        """Version of the engine's picture when it was given them."""
        self._size = (0, 0)
        """Size of the picture that is compared."""
        self._selection: Selection | None = None
        """What was selected when it was begun: the solid whose glass is another."""

    # ---- what there is -----------------------------------------------------------------------

    @property
    def picture(self) -> moderngl.Texture | None:
        """RGBA32F as the engine's; None while there is nothing of the window's size to show."""
        found = self._picture
        return None if found is None or found.size != self._size else found

    @property
    def _picture(self) -> moderngl.Texture | None:
        if not self._compare.is_active:
            return None
        if self._compare.method == REFERENCE:
            return self._composed
        if self._compare.method == FILE:
            return self._file.texture
        if (self._compare.method == GLASS and self._glass_problem is not None) or self._shows_another_wish:
            return None
        return self._engine.picture if self._engine is not None else None

    @property
    def _shows_another_wish(self) -> bool:
        """The engine's picture is still that of the glass or the method before: it must not carry this one's name."""
        if self._engine is None:
            return False
        return self._wish != self._given or self._engine.picture_version == self._version_before

    @property
    def label(self) -> str:
        """What `picture` is, in a few words."""
        match self._compare.method:
            case "file":
                return "" if self._compare.file is None else self._compare.file.name
            case "glass":
                return self._compare.glass
        if self._compare.method != REFERENCE:
            return METHOD_NAMES.get(self._method, self._method)
        snapshot = self._thread.snapshot if self._thread is not None else None
        return "Reference" if snapshot is None else f"Reference, {self._noise(snapshot)}"

    @property
    def progress(self) -> float | None:
        """How far the other picture is, 0 to 1."""
        if not self._compare.is_active or self._begun is None:
            return None
        if self._compare.method == REFERENCE:
            return None if self._thread is None else self._thread.fraction
        if self._engine is None:
            return None
        return min(self._engine.stats.photons / max(self._engine.target_photons, 1), 1.0)

    @property
    def text(self) -> str:
        """What the other picture is."""
        if not self._compare.is_active or self._begun is None:
            return ""
        if self._compare.method == FILE:
            return self._file_text
        if self._compare.method == REFERENCE:
            return self._reference_text(self._begun)
        photons = f"{(0 if self._engine is None else self._engine.stats.photons) / 1e6:.2f} million photons"
        if self._compare.method == GLASS:
            if self._glass_problem is not None:
                return f"There is nothing to compare with: {self._glass_problem}."
            return f"The same scene in {self._compare.glass}: {photons}."
        return f"{METHOD_NAMES.get(self._method, self._method)}: {photons}."

    def _reference_text(self, begun: LiveInputs) -> str:
        if self._thread is not None and self._thread.problem is not None:
            return f"There is nothing to compare with: {self._thread.problem}."
        snapshot = self._thread.snapshot if self._thread is not None else None
        if snapshot is None:
            return "Reference: the first photons are on their way; the first time, its code is compiled before."
        note = (
            f"Reference: light tracing in float64 without shared code, {_counted(snapshot.photons)}, "
            f"{self._noise(snapshot)}."
        )
        if not snapshot.directly.all():
            note += " Striped: what is seen behind glass or in mirrors, which is not compared."
        if begun.scene.render.bounces:
            note += " What surfaces give to each other is not in it."
        if begun.local_gain and any(item.local_dispersion for item in begun.scene.objects):
            note += " The brush's local gain is not in it: it is not physical."
        return note

    @property
    def _file_text(self) -> str:
        if self._compare.file is None:
            return "Choose a picture, or drop one on the window while this panel is open."
        return f"There is nothing to compare with: {self._file.problem}." if self._file.problem else self._file.words

    @property
    def is_busy(self) -> bool:
        """It would use more time (the window must not sleep)."""
        if not self._compare.is_active or self.is_stale:
            return False
        if self._compare.method == REFERENCE:
            return self._thread is not None and not self._thread.is_done and self._thread.problem is None
        return self._engine is not None and self._needs_engine and not self._engine.is_idle

    @property
    def is_waiting(self) -> bool:
        """The reference is wanted and has nothing to show yet."""
        thread = self._thread if self._compare.method == REFERENCE else None
        return self.is_busy and thread is not None and thread.snapshot is None

    def pixel(self, place: tuple[float, float]) -> Vec3 | None:
        """Linear Rec.709 of `picture` at a place of it, 0..1 from the top left; None while there is none."""
        picture = self.picture
        return None if picture is None else read_pixel(self._context, picture, place)

    # ---- work --------------------------------------------------------------------------------

    def restart(self) -> None:
        """Begin anew for what is wanted in the next `advance`."""
        self._stop()
        self._begun = None

    def advance(self, state: State, running: Engine | None, budget_s: float) -> None:
        """Follow `state` and work for about `budget_s`; `running` is the engine whose picture is compared. Without a
        budget there is only the processor left to leave alone, once there is something to compare with."""
        self._compare = state.compare
        if not state.compare.is_active or running is None:
            self._pause()
            return
        wanted = state.live_inputs
        before, self._size = self._size, (wanted.width, wanted.height)
        if self._begun is not None and before == self._size != (self._begun.width, self._begun.height):
            self.restart()  # the window was made larger or smaller, and keeps its size now
        if self._begun is None:
            self._stop()
            self._begun, self._selection = wanted, state.selection
        if state.compare.method == FILE and state.compare.file is not None:
            self._file.show(state.compare.file, state.viewport_size)
        assert self._begun is not None
        self.is_stale = (
            dirty_level(self._begun, self._begun, replace(wanted, method=self._begun.method)) != DirtyLevel.NOTHING
        )
        if self.is_stale:
            self._pause()
            return
        if self._compare.method == REFERENCE:
            if self._thread is None:
                self._start_reference(self._begun)
            elif budget_s > 0.0 or self._thread.snapshot is None:
                self._thread.resume()
            else:
                self._thread.pause()
            self._compose(running, budget_s)
        else:
            self._pause()
        if self._needs_engine:
            self._advance_engine(running.target_photons, budget_s)

    def release(self) -> None:
        """Stop and free everything. Before the running engine is released."""
        self._stop(wait=True)
        if self._engine is not None:
            self._engine.release()
            self._engine = None
        self._file.release()

    @property
    def _method(self) -> str:
        """The other method."""
        if self._compare.method == GLASS and self._begun is not None:
            return self._begun.method
        return self._compare.method

    @property
    def _needs_engine(self) -> bool:
        return self._compare.method not in (REFERENCE, FILE)

    def _start_reference(self, begun: LiveInputs) -> None:
        scene = scene_seen(with_panorama_lights(begun.scene), begun.camera, begun.solo_nm)
        self._thread = ReferenceThread(scene, begun.width, begun.height)
        self._direct = DirectPicture(self._context, self._find_thread(), scene, begun)

    def _pause(self) -> None:
        """Give the processor back; what there is stays."""
        if self._thread is not None:
            self._thread.pause()

    def _stop(self, wait: bool = False) -> None:
        if self._thread is not None:
            self._thread.stop(wait)
        for owned in (self._direct, self._composed):
            if owned is not None:
                owned.release()
        self._thread = self._direct = self._composed = None
        self._composed_from = _NOTHING

    def _advance_engine(self, target_photons: int, budget_s: float) -> None:
        assert self._begun is not None
        if self._engine is None:
            self._engine = self._make_engine(self._context)
        self._engine.target_photons = target_photons
        scene = self._begun.scene
        if self._compare.method == GLASS:
            self._glass_problem = None
            try:
                scene = self._swap.scene(scene, self._selection or Selection(), self._compare.glass)
            except UserError as error:
                self._glass_problem = str(error)
                return
        self._wish = self._method, self._compare.glass if self._compare.method == GLASS else ""
        if self._wish != self._given and not self._engine.is_busy:
            self._given, self._version_before = self._wish, self._engine.picture_version
        self._engine.set(replace(self._begun, method=self._method, scene=scene))
        if budget_s > 0.0:
            self._engine.advance(budget_s, False)

    def _compose(self, running: Engine, budget_s: float) -> None:
        """The reference's caustics on the picture without caustics. Behind glass there is no reference: stripes over
        the running picture say so."""
        if self._direct is None:
            return
        if budget_s > 0.0:
            self._direct.advance(budget_s)
        snapshot = self._thread.snapshot if self._thread is not None else None
        made_from = (0 if snapshot is None else snapshot.number, self._direct.version)
        if snapshot is None or self._direct.version == 0 or made_from == self._composed_from:
            return
        shown = texels_of(running.picture) if running.picture is not None else None
        height, width = snapshot.directly.shape
        whole = self._direct.rgb + snapshot.caustic_rgb
        if shown is not None and shown.shape == whole.shape:
            rows, columns = np.nonzero(~snapshot.directly)
            stripes = np.where((rows + columns) // STRIPE_PX % 2, STRIPE_SHADE, 1.0).astype(np.float32)
            whole[rows, columns] = shown[rows, columns] * stripes[:, None]
        self._composed_from = made_from
        if self._composed is None:
            self._composed = self._context.ctx.texture((width, height), 4, dtype="f4")
        self._composed.write(with_alpha(whole))

    def _is_known(self, snapshot: Snapshot) -> bool:
        """Whether the reference's own error is known, or will not be known better."""
        return snapshot.known >= 1.0 or (self._thread is not None and self._thread.is_done)

    def _noise(self, snapshot: Snapshot) -> str:
        """The reference's own error in words: that of its caustics, and while it becomes finer what its direct light is
        made of, which that error does not count."""
        words = f"relMSE of its caustics {'' if self._is_known(snapshot) else '> '}{snapshot.relmse:.1e}"
        if self._direct is None or self._direct.is_done:
            return words
        return f"{words}, direct light {self._direct.samples} of {SAMPLES[-1]} samples"


def _counted(photons: int) -> str:
    return f"{photons / 1e6:.1f} million photons" if photons >= 100_000 else f"{photons:,} photons"


def engine_beside(context: Context, thread: ContextThread | None) -> Engine:
    """An engine for what is compared with; on `thread`, where there is one."""
    from ..render.viewer.threaded_engine import ThreadedEngine

    return _engine(context) if thread is None else ThreadedEngine(context, thread, _engine)


def _engine(context: Context) -> LiveEngine:
    from ..render.viewer.engine import LiveEngine

    # It is never edited, so it need not store photons to show them again.
    return LiveEngine(context, replace(context.traits.viewer, store_bytes=1 << 20))
