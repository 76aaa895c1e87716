"""All cases of the eye half, in the order of the report."""

from __future__ import annotations

from app.stress.case import Case
from app.stress.eye_chain_cases import CASES as CHAINS
from app.stress.eye_edge_cases import CASES as EDGES
from app.stress.eye_glass_cases import CASES as GLASSES
from app.stress.eye_light_cases import CASES as LIGHTS
from app.stress.eye_solid_cases import CASES as SOLIDS

CASES: tuple[Case, ...] = (*EDGES, *CHAINS, *SOLIDS, *GLASSES, *LIGHTS)
