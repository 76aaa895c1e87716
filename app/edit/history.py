"""Undo: the scenes that were, each with the name of what led to it.

Scenes are immutable and share what did not change, so a step costs little. While something is
being dragged, the steps of one label are one; `settle` ends that.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..model.scene import Scene

MAX_STEPS = 500


@dataclass(frozen=True)
class HistoryEntry:
    """One step of undo."""

    label: str
    is_present: bool


@dataclass(frozen=True)
class Step:
    """A scene and the edit that made it."""

    label: str
    scene: Scene


class History:
    """The steps from the oldest that is kept to the newest, one of them the present."""

    def __init__(self, scene: Scene, label: str = "Open", max_steps: int = MAX_STEPS) -> None:
        self._steps: list[Step] = [Step(label, scene)]
        self._at = 0
        self._saved: Scene | None = scene
        self._open = False
        self._max_steps = max_steps

    @property
    def present(self) -> Scene:
        """The scene now."""
        return self._steps[self._at].scene

    def push(self, label: str, scene: Scene, merge: bool = False) -> None:
        """Make `scene` the present, undone as `label`; what was undone before is forgotten.

        `merge`: a drag is going on. Its steps of one label become one, until `settle` or another label.
        """
        if scene is self.present:
            return
        joins = merge and self._open and self._at > 0 and self._steps[self._at].label == label
        del self._steps[self._at + (0 if joins else 1) :]
        self._steps.append(Step(label, scene))
        if len(self._steps) > self._max_steps + 1:
            del self._steps[: len(self._steps) - self._max_steps - 1]
        self._at = len(self._steps) - 1
        self._open = merge

    def settle(self) -> None:
        """The drag is over: the next push is a step of its own, whatever it is called."""
        self._open = False

    def undo(self) -> Scene:
        """One step back, if there is one; returns the present."""
        return self.go_to(max(self._at - 1, 0))

    def redo(self) -> Scene:
        """One step forward again, if there is one; returns the present."""
        return self.go_to(min(self._at + 1, len(self._steps) - 1))

    def go_to(self, index: int) -> Scene:
        """To entry `index` of `entries`; returns the present. Raises IndexError for one that is not there."""
        if not 0 <= index < len(self._steps):
            raise IndexError(f"the history has entries 0 to {len(self._steps) - 1}, not {index}")
        self._at = index
        self.settle()
        return self.present

    @property
    def undo_label(self) -> str | None:
        """What undo would take back; None at the start."""
        return self._steps[self._at].label if self._at > 0 else None

    @property
    def redo_label(self) -> str | None:
        """What redo would do again; None at the end."""
        following = self._at + 1
        return self._steps[following].label if following < len(self._steps) else None

    @property
    def entries(self) -> tuple[HistoryEntry, ...]:
        """Every step, oldest first, for the history panel."""
        return tuple(HistoryEntry(step.label, i == self._at) for i, step in enumerate(self._steps))

    @property
    def unsaved(self) -> bool:
        """Whether the present differs from what was last saved (undoing back to that is saved again)."""
        return self.present is not self._saved

    def mark_saved(self, scene: Scene | None = None) -> None:
        """`scene` (the present, if not given) is what the file holds."""
        self._saved = self.present if scene is None else scene
        self.settle()

    def mark_unsaved(self) -> None:
        """No file holds any of this, as after a recovery."""
        self._saved = None
