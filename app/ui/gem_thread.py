"""Figures of the stone that the Gem panel shows, found in a thread: for an edited stone the search begins again."""

from __future__ import annotations

import threading

from ..base.errors import UserError, own_fault
from ..base.not_yet import NOT_YET, NotYet
from ..edit.state import State
from ..model.gems.figures import GemFigures, figures
from ..model.gems.in_scene import chosen_stone, stone_in
from ..model.scene import Scene, SceneObject

GemReading = tuple[str, GemFigures] | str | NotYet
"""What the panel shows: the stone's name and its figures, or why there are none."""
_COUNT = 96
"""Rays along a side: a panel shows three digits."""


class GemThread:
    """One search at a time."""

    def __init__(self) -> None:
        self._item: SceneObject | None = None
        self._reading: GemReading = NOT_YET
        self._thread: threading.Thread | None = None
        self._stopped = threading.Event()

    @property
    def is_busy(self) -> bool:
        """The panel waits for figures."""
        return self._thread is not None and self._thread.is_alive()

    def reading(self, state: State) -> GemReading:
        """Of the selected stone, or the scene's first; asked in every frame in which the panel is open."""
        index = state.selection.index if state.selection.kind == "object" else None
        selected = None if index is None else state.scene.objects[index]
        name = None if selected is None or selected.material.receives else selected.name
        try:
            item = chosen_stone(state.scene, name)
        except UserError as error:
            return str(error)
        if item is self._item:
            return self._reading
        self._reading = NOT_YET
        if self.is_busy:
            self._stopped.set()
            return NOT_YET
        self._item, self._stopped = item, threading.Event()
        arguments = (item, state.scene, self._stopped)
        self._thread = threading.Thread(target=self._find, args=arguments, name="gem", daemon=True)
        self._thread.start()
        return NOT_YET

    def release(self) -> None:
        """Stop, and wait until then."""
        self._stopped.set()
        if self._thread is not None:
            self._thread.join()

    def _find(self, item: SceneObject, scene: Scene, stopped: threading.Event) -> None:
        try:
            found = figures(stone_in(scene, item.name), count=_COUNT, cancelled=stopped.is_set)
            reading: GemReading = NOT_YET if found is None else (item.name, found)
        except UserError as error:
            reading = str(error)
        except (ImportError, MemoryError, RuntimeError, ValueError, ArithmeticError, LookupError) as error:
            reading = own_fault(f"the stone's figures could not be found ({type(error).__name__}: {error})")
        if stopped.is_set():
            self._item = None  # to be found again where somebody still asks
        else:
            self._reading = reading
