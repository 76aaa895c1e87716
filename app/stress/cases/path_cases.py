"""All cases of whole paths through the real emit and trace passes, in the order of the report."""

from __future__ import annotations

from ..case import Case
from .beam_cases import CASES as BEAMS
from .caustic_cases import CASES as CAUSTICS
from .chain_cases import CASES as CHAINS
from .grating_cases import CASES as GRATINGS
from .material_cases import CASES as MATERIALS
from .mesh_cases import CASES as MESHES
from .polarisation_cases import CASES as POLARISATION

CASES: tuple[Case, ...] = (*MATERIALS, *CAUSTICS, *CHAINS, *GRATINGS, *POLARISATION, *MESHES, *BEAMS)
