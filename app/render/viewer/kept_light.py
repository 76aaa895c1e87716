"""The finest light of all wavelengths, kept while one alone is shown or an edit is tried, so that it is there
again when that is undone.

Stored photons are splatted again, whatever is shown. Beams are not stored: where they carry everything, they would be
searched for anew, from the coarsest on, and minutes of light be lost for a look at one wavelength.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass

import moderngl

from ...edit.live_inputs import LiveInputs
from ...gpu import shader
from ..light_maps import LightMaps
from ..light_pass import LightPass
from ..light_stats import LightStats
from .dirty_level import DirtyLevel
from .invalidation import dirty_level


@dataclass
class _Kept:
    inputs: LiveInputs
    maps: LightMaps
    """Whose sums they are."""
    sums: list[moderngl.Texture]
    photon_weight: float
    stats: LightStats
    photons: int
    """Photons of the last pass."""
    number: int
    """Passes of that size."""


class KeptLight:
    """What maps held when they were last shown in all wavelengths; owns copies of their sums."""

    def __init__(self) -> None:
        self._kept: _Kept | None = None

    def keep(self, light_pass: LightPass, shown: LiveInputs, photons: int, number: int) -> None:
        """Remember what the maps hold after `number` passes of `photons`, where all wavelengths are shown."""
        maps, kept = light_pass.maps, self._kept
        if shown.solo_nm is not None:
            return
        if kept is not None and kept.maps is maps and number * photons < kept.number * kept.photons:
            return  # what an edit may be undone to is finer
        reused = kept.sums if kept is not None and kept.maps is maps else None
        if reused is None:
            self.release()
        sums, stats = maps.copied_sums(reused), deepcopy(light_pass.stats)
        self._kept = _Kept(shown, maps, sums, maps.photon_weight, stats, photons, number)

    def holds(self, light_pass: LightPass, wanted: LiveInputs) -> bool:
        """Whether what was kept is the light of `wanted`."""
        kept = self._kept
        if kept is None or kept.maps is not light_pass.maps:
            return False
        return dirty_level(kept.inputs, kept.inputs, wanted) < DirtyLevel.SPLAT

    def bring_back(self, light_pass: LightPass) -> tuple[int, int]:
        """Make maps and counts what they were; returns photons of the last pass, and the number of such passes."""
        kept = self._kept
        assert kept is not None
        light_pass.go_on_from(kept.photons, deepcopy(kept.stats))  # which empties the maps
        kept.maps.bring_back(kept.sums, kept.photon_weight)
        return kept.photons, kept.number

    @property
    def bytes(self) -> int:
        """Device memory of the copies."""
        return 0 if self._kept is None else sum(16 * s.width * s.height for s in self._kept.sums)

    def release(self) -> None:
        """Forget it."""
        if self._kept is not None:
            shader.release(*self._kept.sums)
        self._kept = None
