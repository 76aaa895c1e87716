"""Whether the maps still fit what the camera sees.

Walking round traces nothing and keeps what is accumulated, so maps are only fitted again where that shows: the window
has another size, the camera has come so near that texels are larger than pixels, or it sees light next to the fine
window that only the coarse one holds."""

from __future__ import annotations

import numpy as np

from ...edit.live_inputs import LiveInputs
from ...passes.map_layout import MapLayout, Window
from .live_light import LiveLight

PAYS = 1.5
"""Texels must get so many times smaller."""
BESIDE = 0.25
"""Share of the window that would be fitted now that may be outside of the present one."""


def is_judged(light: LiveLight, inputs: LiveInputs) -> bool:
    """Whether `needs_new_maps` has judged this view."""
    return light.judged_view == (inputs.camera, inputs.width, inputs.height)


def needs_new_maps(light: LiveLight, inputs: LiveInputs) -> bool:
    """Whether new maps would show more of what the camera of `inputs` sees."""
    if is_judged(light, inputs):
        return False
    light.judged_view = (inputs.camera, inputs.width, inputs.height)
    light_pass = light.light_pass
    if (inputs.width, inputs.height) != (light_pass.fit.width, light_pass.fit.height):
        return True
    now, then = light_pass.layout, light_pass.layout_for(light.fit_of(inputs))
    return any(_pays(now, then, receiver) for receiver in range(len(now.receivers)))


def _pays(now: MapLayout, then: MapLayout, receiver: int) -> bool:
    side = [
        float(np.sqrt(layout.placements["texel_area"][layout.receivers[receiver]["placement"]]))
        for layout in (now, then)
    ]
    if side[0] > PAYS * side[1]:
        return True
    old, new = ([w for w in layout.windows.get(receiver, ()) if isinstance(w, Window)] for layout in (now, then))
    if not new or len(old) < 2:
        return False
    overlap = np.minimum(old[0].high, new[0].high) - np.maximum(old[0].low, new[0].low)
    covered = float(np.prod(np.clip(overlap, 0.0, None)) / max(float(np.prod(new[0].size)), 1e-30))
    return covered < 1.0 - BESIDE
