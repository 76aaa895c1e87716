"""The Python interface: what `import spectrasplat as ss` offers (docs/python.md).

`spectrasplat/__init__.py` imports this package when something of it is first used.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from types import ModuleType
from typing import Any

from .. import render as render_package
from ..base.errors import UserError
from ..base.paths import shipped_scenes
from ..edit.stored_photons import StoredPhotons as Photons
from ..model.optics.lens_design import LensTable
from ..model.plate_check import PlateReport
from .catalogue import Glass, glass, glasses
from .figures import GemFigures, GemReport, gem, lens_check, lens_table
from .gradient import Gradient, gradient
from .pages import page
from .picture import CausticMap, Picture, Statistics
from .rendering import caustic, render
from .scene import Scene
from .session import Session
from .solving import Fit, Match, Ranked, fit, match
from .sweeping import SweepPoint, sweep
from .tables import Entries, Table
from .tracing import Fan, fan, trace
from .view import View

__all__ = [
    "CausticMap",
    "Entries",
    "Fan",
    "Fit",
    "GemFigures",
    "GemReport",
    "Glass",
    "Gradient",
    "LensTable",
    "Match",
    "Photons",
    "Picture",
    "PlateReport",
    "Ranked",
    "Scene",
    "Session",
    "Statistics",
    "SweepPoint",
    "Table",
    "UserError",
    "View",
    "caustic",
    "fan",
    "fit",
    "gem",
    "glass",
    "glasses",
    "gradient",
    "lens_check",
    "lens_table",
    "load",
    "match",
    "page",
    "render",
    "scenes",
    "sweep",
    "trace",
]


class _Renders(ModuleType):
    """Python gives a package and a function of one name one place: `spectrasplat.render` is the package, and calling it
    is `render` from here."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return render(*arguments, **options)


render_package.__class__ = _Renders


def load(source: str | os.PathLike[str] | Mapping[str, Any]) -> Scene:
    """The scene in a file (.toml, .glb, .gltf, a mesh: .ply, .obj, .stl, a stone: .asc, or a lens: .zmx, .csv), a
    shipped one by its name ("prism"), or one from its tables in a dictionary.

    Raises `UserError`, in one sentence with file, key and remedy, for anything that cannot be rendered.
    """
    if isinstance(source, Mapping):
        return Scene(source)
    if not isinstance(source, str | os.PathLike):
        raise UserError(f"{type(source).__name__} is no scene: give a file, a shipped scene's name or a dictionary")
    return Scene.load(source)


def scenes() -> list[str]:
    """Names of the scenes that come with the program."""
    return list(shipped_scenes())
