"""Where each labelled control was drawn last, so that tests and screenshots can aim a mouse at it by name.

Widgets call `note(label)` straight after an item. It costs one comparison unless a recorder is
installed, and it is the only place where the interface reports anything about itself outward.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple


class ItemRect(NamedTuple):
    """An item on the screen, pixels from the top left of the interface."""

    label: str
    left: float
    top: float
    right: float
    bottom: float
    window: str = ""
    """Title of the imgui window that it was drawn in."""
    is_visible: bool = True
    """Not scrolled or clipped away."""

    @property
    def centre(self) -> tuple[float, float]:
        """Where to click."""
        return (self.left + self.right) / 2, (self.top + self.bottom) / 2

    @property
    def size(self) -> tuple[float, float]:
        """Width and height, pixels."""
        return self.right - self.left, self.bottom - self.top

    def at(self, across: float, down: float = 0.5) -> tuple[float, float]:
        """The point at these shares of the width and the height."""
        return self.left + across * (self.right - self.left), self.top + down * (self.bottom - self.top)


class Recorder:
    """The items of the last frame, by label."""

    def __init__(self) -> None:
        self.items: dict[str, ItemRect] = {}
        """Last drawn wins; a label drawn in several windows is also there as "Window/Label"."""

    def clear(self) -> None:
        """Forget: called before every frame."""
        self.items.clear()

    def add(self, item: ItemRect) -> None:
        """Remember one item."""
        self.items[item.label] = item
        self.items[f"{item.window}/{item.label}"] = item


_recorder: Recorder | None = None


def note(label: str) -> None:
    """Record the last imgui item under `label` (without its "##id" part), when somebody records."""
    if _recorder is None:
        return
    # Imported here: the module is imported by pure tests that have no imgui context.
    from imgui_bundle import imgui

    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    window = imgui.internal.get_current_window_read()
    _recorder.add(
        ItemRect(
            label.split("##")[0],
            low.x,
            low.y,
            high.x,
            high.y,
            window=window.name.split("##")[0],
            is_visible=imgui.is_item_visible(),
        )
    )


@contextmanager
def recording(recorder: Recorder) -> Iterator[Recorder]:
    """Record into `recorder` within the block."""
    global _recorder
    before = _recorder
    _recorder = recorder
    try:
        yield recorder
    finally:
        _recorder = before
