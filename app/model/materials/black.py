"""A perfect absorber."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .material import Material


@dataclass(frozen=True)
class Black(Material):
    """A perfect absorber."""

    kind: ClassVar = "black"
    title: ClassVar = "Black"
    gpu_code: ClassVar = 0
