"""All cases of the camera pass, in the order of the report."""

from __future__ import annotations

from ..case import Case
from .camera_chain_cases import CASES as CHAINS
from .camera_edge_cases import CASES as EDGES
from .camera_glass_cases import CASES as GLASSES
from .camera_light_cases import CASES as LIGHTS
from .camera_solid_cases import CASES as SOLIDS

CASES: tuple[Case, ...] = (*EDGES, *CHAINS, *SOLIDS, *GLASSES, *LIGHTS)
