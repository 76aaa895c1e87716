"""SpectraSplat: dispersive caustics by spectral ray differentials and swept splats."""

__version__ = "0.1.0"

import os

# The matrix products here are small. Shared out over threads they wait for each other, and on a software renderer for
# its threads: a spectral table then takes ten times as long. Only counts where numpy is imported after this.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
