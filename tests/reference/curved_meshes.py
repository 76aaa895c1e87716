"""Curved shapes that only questions need: open pieces of a surface, tessellated to any fineness."""

from __future__ import annotations

import numpy as np
from spectrasplat.model.geometry.mesh import Mesh, make_mesh


def mirror_arc(pieces: int, half_angle_rad: float = 1.4, half_height: float = 2.0) -> Mesh:
    """A part of the unit cylinder about z, round +x, with smooth outward normals: `pieces` strips of two triangles."""
    angle = np.linspace(-half_angle_rad, half_angle_rad, pieces + 1)
    outward = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(pieces + 1)])
    vertices = np.concatenate([outward + [0, 0, z] for z in (-half_height, half_height)])
    k = np.arange(pieces)
    above = k + pieces + 1
    triangles = np.concatenate([np.column_stack([k, k + 1, above + 1]), np.column_stack([k, above + 1, above])])
    return make_mesh("mirror arc", vertices, triangles, outward[triangles % (pieces + 1)])
