"""Traces and splats one fixed set of photons with programs of given features, and times it.

The plan (lattices, bands, points on lights), the maps and the spectral axis come from one rendering of the
scene as it is, so that two rigs do the same work but for what their programs hold.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...gpu.map_channels import MapChannels, tents
from ...gpu.scene_buffers import SceneBuffers
from ...passes.border_maps import border_texture
from ...passes.footprint import Photons, SpectralVariables, SplatSpectra
from ...passes.map_atlas import MapAtlas
from ...passes.splat import Splatter
from ...passes.trace import LatticeSlice, TracePass
from ...render.shown_spectra import traced_tables
from .variants import Variant

if TYPE_CHECKING:
    from ...gpu.context import Context
    from ...passes.emission_domain import EmissionDomain
    from ...render.light_pass import LightPass

_SEED = 1


@dataclass(frozen=True)
class Work:
    """What a rig does in one run."""

    light: LightPass
    """Begun: its plans, maps and tables are shared."""
    slices: tuple[tuple[LatticeSlice, EmissionDomain], ...]

    @staticmethod
    def of(light: LightPass, whole: int, photons: int) -> Work:
        """About `photons` points, evenly taken from lattices of `whole` points, so that footprints have their usual
        size."""
        slices = []
        for plan in light.plans:
            lattice = max(1, round(whole * plan.share / plan.lattices / plan.domain.active_share))
            stride = max(1, round(whole / photons))
            points = len(range(0, lattice, stride))
            piece = LatticeSlice(
                plan.index,
                plan.bands,
                lattice,
                0,
                stride,
                points,
                (0, 0),
                (0, 0),
                0,
                _SEED,
                plan.light_points,
                weight=float(whole),
            )
            slices.append((piece, plan.domain))
        return Work(light, tuple(slices))

    @property
    def batch(self) -> int:
        """Rays emitted at once, at most."""
        return max(64, *(piece.count for piece, _ in self.slices))


@dataclass(frozen=True)
class Cost:
    """Time of one run, s: processor time on a software renderer, else wall clock."""

    trace: float
    splat: float


class Rig:
    """Owns the programs and buffers of one variant."""

    def __init__(self, context: Context, variant: Variant, work: Work) -> None:
        light = work.light
        self._context = context
        self._work = work
        self._clock = context.traits.clock
        ctx, scene = context.ctx, light.scene
        self._buffers = SceneBuffers(ctx, variant.scene, variant.features, light.buffers.axis)
        self._trace = TracePass(context, variant.features, self._buffers, work.batch, light.settings.max_depth)
        # Its maps have no pixels for lines of contact to lie in.
        self._splatter = Splatter(ctx, replace(variant.features, contact_lines=False))
        self._atlas = MapAtlas(ctx, light.layout.size, light.layout.placements, variant.features.targets)
        if variant.features.border_images:
            self._atlas.borders = border_texture(ctx, light.layout)
        self._variables = SpectralVariables.build(ctx, self._buffers.variables)
        spans = {plan.index: [(band.x_lo, band.x_hi) for band in plan.bands] for plan in light.plans}
        bins = variant.features.bins
        edges = tuple(np.linspace(380.0, 780.0, bins + 1).tolist()) if bins else None
        channels = (
            tents(light.buffers.axis, variant.features.map_tents)
            if edges is None and variant.features.map_tents
            else MapChannels(edges)
        )
        spectra = [lamp.spectral_power for lamp in scene.lights]
        self._tables = traced_tables(
            ctx,
            self._buffers,
            spectra,
            light.shown.reflectances,
            [spans.get(i, [(0.0, 1.0)]) for i in range(len(spectra))],
            channels,
        )

    def run(self) -> Cost:
        """Trace and splat everything once; deposits add up."""
        traced = splatted = 0.0
        for piece, domain in self._work.slices:
            self._context.finish()
            started = self._clock()
            batch = self._trace.run(piece, domain)
            self._context.finish()
            middle = self._clock()
            self._splatter.run(
                Photons(self._trace.photons, batch.photons),
                SplatSpectra(self._variables, self._tables),
                self._atlas,
                self._work.light.maps.receivers,
                self._work.light.settings.smoothing,
            )
            self._context.finish()
            splatted += self._clock() - middle
            traced += middle - started
        return Cost(traced, splatted)

    def map(self) -> np.ndarray:
        """Everything deposited since the start, in all channels and windows."""
        return self._atlas.read_total()

    def release(self) -> None:
        """Free everything."""
        for owned in (self._trace, self._splatter, self._atlas, self._variables, self._tables, self._buffers):
            owned.release()


def map_difference(a: np.ndarray, b: np.ndarray) -> float:
    """Σ|a − b| / Σ|a| over two maps; bins are compared by their sum with the radiant power of XYZ maps."""
    if a.shape != b.shape:
        a, b = (m[..., 3] if m.shape[-1] == 4 else m.sum(axis=-1) for m in (a, b))
    total = float(np.abs(a, dtype=float).sum())
    return float(np.abs(a.astype(float) - b).sum()) / total if total else 0.0
