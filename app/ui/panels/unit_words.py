"""Lengths by the name that the scene's file gives them.

Labels and tooltips are written once, with "units" in them; who edits a scene in millimetres reads millimetres.
"""

from __future__ import annotations

import re

_UNITS = re.compile(r"unit²|\b(?:scene )?units\b")
_label = {"now": ""}


def use(label: str) -> None:
    """Call units so from now on; empty where the scene does not say."""
    _label["now"] = label


def named(text: str) -> str:
    """`text` with the scene's label in place of "units", "scene units" and "unit²". A "scene unit" stays: what is said
    of one is true of any."""
    label = _label["now"]
    if not label or "unit" not in text:
        return text
    return _UNITS.sub(lambda found: label + "²" * found[0].endswith("²"), text)
