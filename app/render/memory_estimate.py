"""The memory that a rendering will take, estimated before its buffers are made, so that what does not fit is refused in
a sentence and not by a driver that fails or a kernel that kills."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.errors import UserError
from ..base.memory import available_bytes, picture_bytes, resident_bytes
from ..model.settings import RenderSettings
from ..passes.map_layout import MapLayout
from .light_pass import LightPass
from .pass_rounds import BEAM_ROUND

_MIB = 1 << 20
_SPLAT_PROGRAMS = 130 * _MIB
"""Programs that splat, compiled on the processor, with their tables and lists."""
_ALL_PROGRAMS = 170 * _MIB
"""Programs that splat and the camera's, likewise."""
_BEAMS = 80 * _MIB
"""Half a million photons' worth of beams, with what they leave."""
_TEXEL_BYTES = 16
_SPARE = 0.02


@dataclass(frozen=True)
class MemoryEstimate:
    """Bytes of the processor's memory, where that also holds what a device would."""

    now: int
    """Held when maps are about to be made: interpreter, driver, programs that trace, queue of photons."""
    light: int
    """More while photons are traced: maps, their scratch textures, programs."""
    camera: int
    """More while the camera's samples are taken: maps, the picture's sums, what is read of them. Mesa holds released
    scratch textures until it is closed."""

    @property
    def peak(self) -> int:
        """Most that is held at once."""
        return self.now + max(self.light, self.camera)


def estimate(light: LightPass, layout: MapLayout, settings: RenderSettings) -> MemoryEstimate:
    """Estimate for a rendering whose maps are about to be laid out so. On a device with memory of its own only what is
    read back counts."""
    shows_map = settings.layer.startswith("map:")
    now = resident_bytes()
    texture = _TEXEL_BYTES * layout.size[0] * layout.size[1]
    targets = light.features.targets
    if shows_map:
        # Read as it is, then divided by what a texel covers, a portion at a time.
        picture = settings.width * settings.height * (24 if settings.bins is None else 4 * settings.bins + 24)
    else:
        picture = picture_bytes(settings.width, settings.height, settings.bins)
    if not light.context.is_software:
        return MemoryEstimate(now, 0, picture)
    scratched = 1 if light.features.map_tents else targets
    # Charts are folded into textures of their own while the sums are still there.
    resolved = targets if layout.charts else 0
    maps = texture * (targets + max(scratched, resolved))
    beams = 0
    if light.survey.has_beams:
        beams = int(_BEAMS * min(settings.photons or BEAM_ROUND, BEAM_ROUND) / BEAM_ROUND)
    return MemoryEstimate(now, maps + beams + _SPLAT_PROGRAMS, maps + (0 if shows_map else _ALL_PROGRAMS) + picture)


def check_room(expected: MemoryEstimate, settings: RenderSettings) -> None:
    """Raise `UserError` where that is more than there is."""
    available = available_bytes()
    needed = expected.peak - expected.now
    if needed * (1.0 - _SPARE) > available:
        raise UserError(
            f"this rendering needs about {expected.peak / _MIB:.0f} MiB, {needed / _MIB:.0f} MiB more than it has "
            f"taken, and {available / _MIB:.0f} MiB are left: choose a smaller --size than "
            f"{settings.width}x{settings.height}" + (" or fewer --bins" if settings.bins else "")
        )
