"""An animation, frame after frame, into a sink; can be driven in small steps while a window is drawn."""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Callable, Generator, Mapping
from dataclasses import astuple

import numpy as np

from ..base.glare import with_glare
from ..base.image_io import check_finite
from ..base.movie import Frames, Sink
from ..base.tone_map import auto_exposure, tone_map_8bit
from ..edit.animation import Animation
from ..gpu.context import Context
from ..model.scene import RenderDefaults, Scene
from ..model.scene_key import scene_key
from ..model.settings import RenderSettings
from .frames import FrameRenderer
from .notices import FrameNotices, frame_notices

Develop = Callable[[np.ndarray, float, RenderDefaults], np.ndarray]
"""(linear Rec.709 (H, W, 3), absolute exposure in EV, the scene's lens and highlights) → sRGB codes uint8 (H, W, 3)."""


def developed(rgb: np.ndarray, exposure_ev: float, look: RenderDefaults) -> np.ndarray:
    """A display-ready picture, with the glare of its lens."""
    return tone_map_8bit(with_glare(rgb, look.glare), exposure_ev, look.antialias_highlights)


def render_animation(
    context: Context,
    animation: Animation,
    settings: RenderSettings,
    sink: Sink,
    base_ev: float | None = None,
    develop: Develop = developed,
    notices: FrameNotices | None = None,
    only: range | None = None,
) -> Generator[float]:
    """Render all frames that `sink` lacks (`only` those numbers), pausing with the share done; the sink is closed
    however it ends. Frames that another process is making are left to it, and made where it gives them up.
    What is noticed about frames is added to `notices`. Raises `BrokenPictureError` at a frame that is not finite.

    All frames share one exposure: `base_ev` plus the stage's own; `base_ev` None takes the automatic one of the first
    frame. Leaving the iteration early (`close()`) keeps the frames that are done.
    """
    stages = [animation.frame(i) for i in range(len(animation.times_s))]
    frames = range(len(stages)) if only is None else only
    shared = sink if isinstance(sink, Frames) else None
    renderer = FrameRenderer(context, settings, stages)
    try:
        if shared is not None:
            fixed = shared.exposure() if base_ev is None else shared.fix_exposure(base_ev)
            base_ev = base_ev if fixed is None else fixed
        done, due, came = 0, deque(frames), 0
        while due and came < len(due):  # as long as another process may give up its frame
            index = due.popleft()
            with sink.claimed(index) as is_ours:
                if is_ours:
                    if base_ev is None and shared is not None:
                        base_ev = shared.exposure()
                    if base_ev is None and index > 0:
                        # All share the first frame's exposure, whichever process makes that.
                        for _ in renderer.steps(stages[0]):
                            yield done / len(frames)
                        base_ev = _agreed(shared, auto_exposure(renderer.picture.rgb))
                    stage = stages[index]
                    for share in renderer.steps(stage):
                        yield (done + 0.99 * share) / len(frames)  # the rest is developing and writing
                    rgb = renderer.picture.rgb
                    check_finite(f"frame {index + 1} of {len(stages)}", rgb)
                    if notices is not None:
                        notices.take(frame_notices(renderer.light, stage.camera, settings, rgb), index + 1)
                    if base_ev is None:
                        base_ev = _agreed(shared, auto_exposure(rgb))
                    sink.write(index, develop(rgb, base_ev + stage.exposure_ev, stage.scene.render))
            if is_ours or sink.has(index):
                done, came = done + 1, 0
                yield done / len(frames)
            else:
                due.append(index)
                came += 1
    finally:
        renderer.release()
        sink.close()


def _agreed(shared: Frames | None, base_ev: float) -> float:
    """The exposure of all frames, where several processes may have worked it out."""
    return base_ev if shared is None else shared.fix_exposure(base_ev)


def description(animation: Animation, settings: RenderSettings, fps: float, photons: int) -> Mapping[str, object]:
    """All that decides how the frames look, as plain values: what must be the same in a resumed folder."""
    start = animation.start
    return {
        "scene": start.scene.name,
        "content": scene_key(start.scene, settings.width, settings.height, settings.max_depth),
        "dabs": repr([item.local_dispersion for item in start.scene.objects]),
        "background": list(start.scene.background_rgb),
        "pictures": _pictures(start.scene),
        "camera": list(astuple(start.camera)),
        "exposure_ev": start.exposure_ev,
        "glare": start.scene.render.glare,
        "antialias_highlights": start.scene.render.antialias_highlights,
        "solo_nm": start.solo_nm,
        "size": [settings.width, settings.height],
        "photons": photons,
        "samples": settings.spp,
        "method": settings.method,
        "camera_method": settings.camera_method,
        "seed": settings.seed,
        "fps": fps,
        "frames": len(animation.times_s),
        "tracks": [list(astuple(track)) for track in animation.tracks],
    }


def _pictures(scene: Scene) -> list[str]:
    """Hashes of the environment and of every texture, which `scene_key` does not know."""
    found = [item.material.texture for item in scene.objects if item.material.receives]
    hashes = [
        "" if t is None else hashlib.sha256(np.ascontiguousarray(t.rgb).tobytes() + t.wrap.encode()).hexdigest()
        for t in found
    ]
    if scene.environment is not None:
        turned = np.asarray(scene.environment.world_to_local, float).tobytes()
        hashes.append(hashlib.sha256(np.ascontiguousarray(scene.environment.rgb).tobytes() + turned).hexdigest())
    return hashes
