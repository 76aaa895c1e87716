"""Opening and closing panels, and what goes with that.

Who opens Compare wants to see two pictures, and who closes it one again: nothing else would take the wipe away.
Hiding all panels (H) is neither: it leaves the pictures alone with each other.
"""

from __future__ import annotations

from dataclasses import replace

from ..edit.state import CompareMode, State


def set_open(state: State, field: str, is_open: bool) -> State:
    """The panel `Panels.<field>` opened or closed by somebody."""
    state = state.with_panels(**{field: is_open})
    if field != "compare":
        return state
    compare = state.compare
    mode: CompareMode = "off" if not is_open else "wipe" if compare.mode == "off" else compare.mode
    return replace(state, compare=replace(compare, mode=mode))
