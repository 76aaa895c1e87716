"""SpectraSplat: dispersive caustics by spectral ray differentials and swept splats.

`import spectrasplat as ss`, then `ss.render(ss.load("prism"))`: see docs/python.md.
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING

from .base.version import __version__ as __version__

# The matrix products here are small. Shared out over threads they wait for each other, and on a software renderer for
# its threads: a spectral table then takes ten times as long. Only counts where numpy is imported after this.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

if TYPE_CHECKING:
    from .api import *  # noqa: F403 - the names of its `__all__`


def __getattr__(name: str) -> object:
    """What `api` offers, imported when it is first asked for: the command line starts without it."""
    api = None if name.startswith("_") else import_module(".api", __name__)
    if api is None or name not in api.__all__:
        raise AttributeError(f"module 'spectrasplat' has no attribute '{name}'")
    return globals().get(name) or getattr(api, name)  # `render` is the package, which `api` makes callable


def __dir__() -> list[str]:
    return sorted({*globals(), *import_module(".api", __name__).__all__})
