"""What a light pass did, and where it may pause."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..passes.trace import FluxTally


@dataclass
class LightStats:
    """What the light pass did."""

    tally: FluxTally = field(default_factory=FluxTally)
    photons: int = 0
    splats: int = 0
    bands: dict[str, int] = field(default_factory=dict)
    light_points: dict[str, int] = field(default_factory=dict)
    trace_seconds: float = 0.0
    splat_seconds: float = 0.0
    splats_w: float = 0.0
    """Power of all splats over their bands, tinted by coloured receivers, W per pass weight."""
    polygons_w: float = 0.0
    """What beams left on receivers, untinted, W per pass weight."""
    outside_map_w: float = 0.0
    """Power of photons whose centre no map holds."""
    footprints_dropped: int = 0
    dropped_w: float = 0.0
    """Flux of those photons, splatted as one texel each."""
    buffers: dict[str, int] = field(default_factory=dict)
    """Device memory by what it is for, bytes, while photons were traced."""

    @property
    def drawn_w(self) -> float:
        """What maps should hold, but for what is outside of them."""
        return self.splats_w + self.polygons_w


@dataclass(frozen=True)
class PassStep:
    """A pause within a pass."""

    fraction: float
    """Share of the pass that is done."""
    round_done: bool
    """What is summed up is an even lattice: the maps may be shown."""
