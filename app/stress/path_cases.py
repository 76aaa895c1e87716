"""All cases of whole paths through the real emit and trace passes, in the order of the report."""

from __future__ import annotations

from app.stress.case import Case
from app.stress.caustic_cases import CASES as CAUSTICS
from app.stress.chain_cases import CASES as CHAINS
from app.stress.material_cases import CASES as MATERIALS
from app.stress.mesh_cases import CASES as MESHES

CASES: tuple[Case, ...] = (*MATERIALS, *CAUSTICS, *CHAINS, *MESHES)
