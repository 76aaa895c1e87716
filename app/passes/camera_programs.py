"""The programs of the camera's pass, each compiled when it is first asked for: what looks at what is seen directly, and
what follows rays beyond glass and mirrors."""

from __future__ import annotations

from collections.abc import Callable

import moderngl

from ..gpu import shader
from ..gpu.schema import Struct
from .variants import Defines, direct_defines, lens_defines, single_defines

_VARIANTS: dict[str, Callable[[Defines], Defines]] = {
    "all": lambda shown: shown,
    "direct": direct_defines,
    "single": single_defines,
}
"""Programs: beyond glass and mirrors, for what is seen directly, and beyond glass of one wavelength."""


class CameraPrograms:
    """Owns them."""

    def __init__(self, ctx: moderngl.Context, defines: Defines, structs: tuple[Struct, ...], has_lens: bool) -> None:
        """`defines`: of the program that follows listed pixels."""
        self._ctx = ctx
        self.defines, self.structs = defines, structs
        self.has_lens = has_lens
        """The camera has one; a viewer may open and close it."""
        self._compiled: dict[tuple[str, bool], moderngl.ComputeShader] = {}

    def of(self, variant: str) -> moderngl.ComputeShader:
        """One of `_VARIANTS`."""
        key = variant, self.has_lens
        if key not in self._compiled:
            shown = lens_defines(self.defines) if self.has_lens else self.defines
            variants = _VARIANTS[variant](shown)
            self._compiled[key] = shader.compute(self._ctx, "camera/camera.comp", variants, self.structs)
        return self._compiled[key]

    def release(self) -> None:
        """Free those that were compiled."""
        shader.release(*self._compiled.values())
