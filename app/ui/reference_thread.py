"""The independent reference in a thread of low priority: float64 light tracing that shares no code with the shaders.

It computes the caustic layer on what the camera sees directly. Snapshots come as its error shrinks; `pause` and `stop`
work after the round it is in.
"""

from __future__ import annotations

import contextlib
import math
import os
import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import UserError

if TYPE_CHECKING:
    from ..model.scene import Scene
    from ..reference.rounds import Picture

TARGET_RELMSE = 2e-4
MAX_SECONDS = 900.0
MEASURED_FROM = 6.0
"""Photons a pixel from which on its error is known: before, most lit pixels have none, which would count as
certain."""
_GROWTH = 1.4
"""Photons from one snapshot to the next."""
_NICENESS = 4
"""Drawing has priority; on a busy processor the reference gets a third as much time."""


@dataclass(frozen=True)
class Snapshot:
    """The reference as far as it is; row 0 on top."""

    number: int
    caustic_rgb: np.ndarray
    """float32 (H, W, 3), linear Rec.709 radiance: caustics on what is seen directly."""
    directly: np.ndarray
    """bool (H, W): pixels for which that is all there is of caustics."""
    photons: int
    relmse: float
    """Its own error as an estimate; too small while it is not known."""

    @property
    def known(self) -> float:
        """How far its error is known, 0 to 1, by the photons that pixels have."""
        return min(self.photons / (MEASURED_FROM * self.directly.size), 1.0)


class ReferenceThread:
    """Starts at once. `snapshot`, `problem` and `is_done` may be read at any time."""

    def __init__(self, scene: Scene, width: int, height: int) -> None:
        """`scene.camera` is what it is seen by."""
        self.snapshot: Snapshot | None = None
        self.problem: str | None = None
        """Why there will be no reference."""
        self.is_done = False
        self._scene, self._size = scene, (width, height)
        self._stopped = threading.Event()
        self._going = threading.Event()
        self._going.set()
        self._thread = threading.Thread(target=self._run, name="reference", daemon=True)
        self._thread.start()

    @property
    def fraction(self) -> float:
        """How far it is on the way to `TARGET_RELMSE`, in decades of its error."""
        if self.is_done:
            return 1.0
        if self.snapshot is None or self.snapshot.relmse <= 0.0:
            return 0.0
        decades = math.log(self.snapshot.relmse) / math.log(TARGET_RELMSE)
        return min(max(decades * self.snapshot.known, 0.0), 0.99)

    def pause(self) -> None:
        """Leave the processor alone until `resume`."""
        self._going.clear()

    def resume(self) -> None:
        """Go on."""
        self._going.set()

    def stop(self, wait: bool = False) -> None:
        """End after the round it is in; `wait` until then."""
        self._stopped.set()
        self._going.set()
        if wait:
            self._thread.join()

    def _run(self) -> None:
        with contextlib.suppress(OSError, AttributeError):  # then it only takes more of the processor
            # Linux: of this thread and of those it starts, not of the program.
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICENESS)
        try:
            self._compute()
        except UserError as error:
            self.problem = str(error)
        except MemoryError:
            self.problem = "there is not enough memory for a reference of this size"
        except (ImportError, RuntimeError, ValueError, ArithmeticError, LookupError) as error:
            # A fault of ours must not end unseen in a thread.
            self.problem = f"the reference renderer failed ({type(error).__name__}: {error})"

    def _compute(self) -> None:
        from ..reference.direct_light import seen_directly
        from ..reference.photon_reference import ReferenceRun

        width, height = self._size
        directly = seen_directly(self._scene, width, height)
        run = ReferenceRun(self._scene, width, height, self._scene.render.max_depth)
        reported = 0
        while not self._stopped.is_set():
            self._going.wait()
            if not run.exhausted:
                run.advance()
            over = run.exhausted or run.seconds > MAX_SECONDS
            if run.amount >= _GROWTH * reported or over:
                reported = run.amount
                picture = run.picture()
                self._publish(picture, directly)
                if over or picture.is_within(TARGET_RELMSE):
                    self.is_done = True
                    return

    def _publish(self, picture: Picture, directly: np.ndarray) -> None:
        number = 1 if self.snapshot is None else self.snapshot.number + 1
        self.snapshot = Snapshot(
            number,
            picture.rgb.astype(np.float32),
            directly,
            picture.amount,
            picture.relmse,
        )
