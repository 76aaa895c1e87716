"""The picture lags behind an edit that must be traced: its photons met the objects of the scene that it still shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..edit.stored_photons import StoredPhotons
from ..model.scene import Scene


def index_in(scene: Scene, shown: Scene, index: int) -> int | None:
    """Index in `scene` of what is object `index` of the `shown` scene; None for one that is no longer there."""
    if not 0 <= index < len(shown.objects):
        return None
    thing, objects = shown.objects[index], scene.objects
    if len(objects) == len(shown.objects):  # nothing was added or taken away: it may have been edited or renamed
        return index
    by_identity = next((i for i, other in enumerate(objects) if other is thing), None)
    if by_identity is not None:
        return by_identity
    return next((i for i, other in enumerate(objects) if other.name == thing.name), None)


def photons_in(scene: Scene, shown: Scene, photons: StoredPhotons) -> StoredPhotons:
    """Photons of the `shown` scene with the numbers that its objects have in `scene`; -1 for what is gone."""
    found = [index_in(scene, shown, i) for i in range(len(shown.objects))]
    there = np.array([-1 if i is None else i for i in found] + [-1])  # -1, no object, stays -1
    return replace(
        photons,
        source=there[photons.source],
        receiver=there[photons.receiver],
        group_of_object={i: g for k, g in photons.group_of_object.items() if (i := found[k]) is not None},
    )
