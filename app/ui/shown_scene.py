"""The picture lags behind an edit that must be traced: what is pointed at in it is an object of the scene that it still
shows."""

from __future__ import annotations

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


def has_same_objects(scene: Scene, shown: Scene) -> bool:
    """Whether indices mean the same in both."""
    return len(scene.objects) == len(shown.objects)
