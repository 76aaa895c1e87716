"""Keys of all that a camera sees by content: equal scenes give equal keys, whatever objects hold them."""

from __future__ import annotations

import numpy as np

from .content_key import ContentKey, scene_key
from .scene import Diffuse, Scene


def picture_key(scene: Scene, *more: object) -> str:
    """`content_key.scene_key` over everything that a camera sees: textures and what lies beyond count as well."""
    key = ContentKey(scene_key(scene, *more))
    if scene.environment is None:
        key.add("background", *(float(v) for v in scene.background_rgb))
    else:
        key.add("environment", scene.environment.rgb, np.asarray(scene.environment.world_to_local, float))
    for index, item in enumerate(scene.objects):
        if isinstance(item.material, Diffuse) and item.material.texture is not None:
            key.add("texture", index, item.material.texture.rgb, item.material.texture.wrap, item.mesh.uv)
    return key.hexdigest()
