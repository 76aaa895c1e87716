"""What an edit of a material costs in the viewer, without a device."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.model.geometry.primitives import plane
from spectrasplat.model.materials import MATERIAL_KINDS, Material, Mirror
from spectrasplat.model.scene import SceneObject
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.invalidation import _object

MESH = plane(1.0, 1.0)


def cost(old: Material, new: Material) -> DirtyLevel:
    return _object(*(SceneObject("thing", MESH, material, np.eye(4)) for material in (old, new)))


def test_another_colour_of_a_mirror_builds_anew() -> None:
    grey, red = Mirror((0.5, 0.5, 0.5)), Mirror((0.9, 0.1, 0.1))
    assert cost(grey, Mirror((0.5, 0.5, 0.5))) == DirtyLevel.NOTHING
    assert cost(grey, red) == DirtyLevel.BUILD


@pytest.mark.parametrize("old", MATERIAL_KINDS)
@pytest.mark.parametrize("new", MATERIAL_KINDS)
def test_every_kind_can_become_every_other(old: str, new: str) -> None:
    level = cost(MATERIAL_KINDS[old].usual(), MATERIAL_KINDS[new].usual())
    assert level == (DirtyLevel.NOTHING if old == new else DirtyLevel.BUILD)
