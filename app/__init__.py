"""SpectraSplat: dispersive caustics by spectral ray differentials and swept splats."""

__version__ = "0.1.0"
