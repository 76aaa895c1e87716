"""One light pass and one camera pass, one frame, and what drives it.

Python gives a package and a function of one name one place: `spectrasplat.render` is this package, and calling it is
the Python interface's `render`.
"""

import sys
from types import ModuleType
from typing import Any


class _Package(ModuleType):
    def __call__(self, *arguments: Any, **options: Any) -> Any:
        from .. import called_render

        return called_render(*arguments, **options)  # type: ignore[operator]


sys.modules[__name__].__class__ = _Package
