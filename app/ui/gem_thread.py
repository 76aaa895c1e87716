"""Figures of the stone that the Gem panel shows, found in a thread: for an edited stone the search begins again."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from threading import Event

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
        self._pool = ThreadPoolExecutor(1, "gem")
        self._item: SceneObject | None = None
        self._found: Future[GemReading] | None = None
        self._stopped = Event()

    @property
    def is_busy(self) -> bool:
        """The panel waits for figures."""
        return self._found is not None and not self._found.done()

    def reading(self, state: State) -> GemReading:
        """Of the selected stone, or the scene's first; asked in every frame in which the panel is open."""
        index = state.selection.index if state.selection.kind == "object" else None
        selected = None if index is None else state.scene.objects[index]
        name = None if selected is None or selected.material.receives else selected.name
        try:
            item = chosen_stone(state.scene, name)
        except UserError as error:
            return str(error)
        if item is not self._item or self._found is None:
            self._stopped.set()
            self._item, self._stopped = item, Event()
            self._found = self._pool.submit(_found, item.name, state.scene, self._stopped)
        return self._found.result() if self._found.done() else NOT_YET

    def release(self) -> None:
        """Stop, and wait until then."""
        self._stopped.set()
        self._pool.shutdown()


def _found(name: str, scene: Scene, stopped: Event) -> GemReading:
    try:
        found = figures(stone_in(scene, name), count=_COUNT, cancelled=stopped.is_set)
        return NOT_YET if found is None else (name, found)
    except UserError as error:
        return str(error)
    except (ImportError, MemoryError, RuntimeError, ValueError, ArithmeticError, LookupError) as error:
        return own_fault(f"the stone's figures could not be found ({type(error).__name__}: {error})")
