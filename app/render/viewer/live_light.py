"""The light pass of a live rendering: photons are stored, and shown through an edited scene without being traced
again."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...gpu.dispatch_budget import DispatchBudget
from ...gpu.gain_buffers import GainBuffers
from ...gpu.map_channels import MapChannels
from ...gpu.reindex import Reindexing, Spans
from ...model.optics.colorimetry import VISIBLE_NM
from ...model.optics.spectrum import Spectrum
from ...passes.accumulate import ROWS, Accumulate
from ...passes.footprint import SpectralVariables
from ...passes.map_layout import layout_maps
from ...passes.pilot import landings_of
from ...passes.splat import CHUNK, FLUSH_SHARE
from ...passes.trace import Batch
from ..light_maps import LightMaps
from ..light_pass import LightPass, RoundOf, ShownTables
from .invalidation import shown_glasses
from .photon_store import PhotonStore
from .spectrum_guess import SpectrumGuess

if TYPE_CHECKING:
    import moderngl

    from ...gpu.context import Context
    from ...gpu.scene_buffers import SceneBuffers
    from ...model.features import Features
    from ...model.optics.glass import Dispersion
    from ...model.scene import Camera, Scene
    from ...model.settings import RenderSettings
    from ...passes.map_atlas import MapAtlas
    from .inputs import LiveInputs

QUICK = 8
"""Pixels to a texel's side in the maps that answer a drag."""
QUICK_TILE_MAX = (288, 144)
"""Longest sides of their windows, texels."""
QUICK_WIDTH = 64
"""Samples of their spectral tables."""
FLUSH_AHEAD = 0.9
"""Of the photons after which a splat pass sums its maps up by itself."""
FIRST_SUMMED = 256
"""Rows of a map that are summed up at first, before it is known how long they take."""
SUMMING_SECONDS = 0.01
"""What one piece of it may take."""
SOLO_WIDTH_NM = 4.0
"""Standard deviation of the window that a single wavelength is seen through."""
SOLO_GAIN_NM = 100.0
"""A continuous spectrum is shown as bright as if so many nanometres of it had this wavelength."""


@dataclass
class Stored:
    """The stored photons of one pass, with the spectral tables of its plan."""

    store: PhotonStore
    spans: Spans
    pass_photons: int
    """Photons the pass was asked for: the weight that its records carry."""
    tables: ShownTables | None = None
    """Made when they are needed: an edit that is followed by the next one needs only the quick ones."""
    quick_tables: ShownTables | None = None

    def forget_tables(self) -> None:
        """They show another glass or light than what is wanted now."""
        for tables in (self.tables, self.quick_tables):
            if tables is not None:
                tables.release()
        self.tables = self.quick_tables = None

    def release(self) -> None:
        """Free photons and tables."""
        self.store.clear()
        self.forget_tables()


class LiveLight(LightPass):
    """Photons of one traced scene and how they are shown.

    Batches are small, so that they take little of a frame; extended lights make do with as many points. A pass that has
    only begun holds fewer photons than the one before it: until it has as many, the older ones stay.
    """

    min_batch = 1024
    tile_max = QUICK_TILE_MAX

    def __init__(
        self,
        context: Context,
        scene: Scene,
        settings: RenderSettings,
        features: Features,
        buffers: SceneBuffers,
        capacity_bytes: int,
    ) -> None:
        super().__init__(context, scene, settings, features, buffers)
        self.capacity_bytes = capacity_bytes
        self.waits = True
        self.splat_part = context.traits.viewer_splat_photons
        self.first_order = False
        """What is shown has another dispersion than what was traced."""
        self.view = scene.camera
        """What the maps are laid out for."""
        self.judged_view: object = None
        """The view for which `refit` last looked whether the maps fit."""
        self._changed: dict[Dispersion, Dispersion] = {}
        """Glasses that are shown otherwise than they were traced."""
        self._running: Stored | None = None
        self._older: Stored | None = None
        self._quick: LightMaps | None = None
        self._guess: SpectrumGuess | None = None
        self._accumulate = Accumulate(context.ctx)
        self.is_coarse = True
        """The maps are those of a first answer: `fit_to` makes proper ones."""

    def begin(self, photons: int, seed: int) -> None:
        """As in `LightPass`; the photons of the pass before stay until there are as many new ones."""
        fuller = max(self._bundles, key=lambda s: s.store.photons, default=None)
        for bundle in self._bundles:
            if bundle is not fuller:
                bundle.release()
        self._older, self._running = fuller, None
        # Its tables stay with it: the new plan gets its own.
        self._tables, self._spans = None, []
        super().begin(photons, seed)
        self._running = Stored(PhotonStore(self.context.ctx, self.capacity_bytes), self._spans, photons, self._tables)
        self._tables = None

    @property
    def tables(self) -> ShownTables:
        """Of the pass that runs."""
        if self._running is None:
            return super().tables
        return self._full_tables(self._running)

    def _full_tables(self, bundle: Stored) -> ShownTables:
        if bundle.tables is None:
            bundle.tables = self._tables_of(bundle.spans)
        return bundle.tables

    def _quick_tables(self, bundle: Stored) -> ShownTables:
        if bundle.tables is not None and not self.features.map_tents:
            return bundle.tables
        if bundle.quick_tables is None:
            # In colour only, like the maps that they are for.
            channels = self.map_channels
            self.map_channels = MapChannels(channels.edges_nm)
            try:
                bundle.quick_tables = self._tables_of(bundle.spans, QUICK_WIDTH)
            finally:
                self.map_channels = channels
        return bundle.quick_tables

    @property
    def _quick_features(self) -> Features:
        return replace(self.features, map_tents=0, targets=1) if self.features.map_tents else self.features

    def maps_for(
        self,
        camera: Camera,
        width: int,
        height: int,
        tile_max: tuple[int, int] = LightPass.tile_max,
        features: Features | None = None,
    ) -> LightMaps:
        """As in `LightPass`; `features` that the maps' channels follow, where they are not the light pass's own."""
        seen = replace(self.scene, camera=camera)
        layout = layout_maps(
            seen,
            self.buffers,
            landings_of(self.pilots.values()),
            (width, height),
            self.reflectance_class,
            tile_max=tile_max,
        )
        # Mesa's software renderer compiles what reads a texture once more, for seconds, where a side becomes a power of
        # two.
        size = tuple(side + (side & (side - 1) == 0) for side in layout.size)
        return LightMaps(self.context.ctx, replace(layout, size=size), features or self.features)

    def camera_textures(self, maps: LightMaps) -> list[moderngl.Texture]:
        """`maps`, this light pass's, as `map_channels` says: what was splatted in colour only gets a likely
        spectrum."""
        textures = maps.resolved_textures()
        if maps is not self._quick or not self.features.map_tents:
            return textures
        if self._guess is None:
            self._guess = SpectrumGuess(self.context.ctx, self.map_channels, self.scene.lights, maps.atlas.size)
        self._guess.run(textures[0])
        return [*textures, *self._guess.textures]

    def keep(self, batch: Batch, of: RoundOf) -> None:
        """Store the batch."""
        assert self._running is not None
        self._running.store.keep(self.trace.photons, batch.photons, self.trace.photon.stride, of)
        if self._older is not None and self._running.store.photons >= self._older.store.photons:
            self._older.release()
            self._older = None

    @property
    def _bundles(self) -> list[Stored]:
        return [bundle for bundle in (self._older, self._running) if bundle is not None]

    @property
    def _fuller(self) -> Stored | None:
        """The stored photons that show most."""
        return max(self._bundles, key=lambda s: s.store.photons, default=None)

    @property
    def photons_stored(self) -> int:
        """Records that can be splatted again."""
        return self._fuller.store.photons if self._fuller else 0

    @property
    def rounds_running(self) -> int:
        """Whole rounds stored of the pass that runs."""
        return self._running.store.rounds if self._running else 0

    def show(self, inputs: LiveInputs) -> None:
        """Take over dispersion, spectra, solo and local gain of `inputs`; maps keep what was deposited until they are
        splatted again.

        `inputs.scene` must be one that these photons can follow (`difference.redo` below TRACE).
        """
        glasses = shown_glasses(self.scene, inputs.scene)
        if glasses is None:
            raise ValueError("these photons cannot follow the scene: it must be traced")
        changed = {a: b for a, b in glasses.items() if a != b}
        spectra = [
            light.spectral_power if inputs.solo_nm is None else solo(light.spectral_power, inputs.solo_nm)
            for light in inputs.scene.lights
        ]
        stale = spectra != self._shown_spectra
        self._shown_spectra = spectra
        self._show_gains(inputs)
        if changed != self._changed:
            self._changed = changed
            stale = self._show_glass(changed) or stale
        if stale:
            for bundle in self._bundles:
                bundle.forget_tables()

    def _show_glass(self, changed: dict[Dispersion, Dispersion]) -> bool:
        """Follow an edit of n(λ); True where the spectral tables follow too."""
        self.first_order = bool(changed)
        table, axis = self.buffers.variables, self.buffers.axis
        self.variables.release()
        if self.features.reindexed:
            (traced,) = axis.glasses
            reindexing = Reindexing.of(traced, changed.get(traced, traced))
            if reindexing is not None:
                self._reindexing = reindexing
                self.variables = SpectralVariables.build(self.context.ctx, table)
                return True
            self._reindexing = Reindexing.of(traced, traced)
        groups = self.buffers.groups
        shown = replace(groups, glasses=tuple(changed.get(glass, glass) for glass in groups.glasses)).variables(axis)
        self.variables = SpectralVariables.build(self.context.ctx, shown, table if changed else None)
        return self.features.reindexed

    def fit_to(self, inputs: LiveInputs) -> None:
        """Maps laid out for the camera and picture size of `inputs`; empty, to be filled from the stored photons."""
        self.view = inputs.camera
        self.is_coarse = False
        self.tile_max = LightPass.tile_max
        self.settings = replace(self.settings, width=inputs.width, height=inputs.height)
        for owned in (self._quick, self._guess, self.maps):
            if owned is not None:
                owned.release()
        self._quick = self._guess = self.maps = None
        self.lay_out(self.view)

    def _show_gains(self, inputs: LiveInputs) -> None:
        wanted = (
            inputs.local_gain
            and self.features.spectral_groups > 0
            and any(o.local_dispersion for o in inputs.scene.objects)
        )
        if wanted != self.features.local_gain:
            self.features = replace(self.features, local_gain=wanted)
            self._maps.take(self.features)
            if self._quick is not None:
                self._quick.take(self._quick_features)
            if self.gains is not None:
                self.gains.release()
                self.gains = None
        if not wanted:
            return
        if self.gains is None:
            buffers = self.buffers
            self.gains = GainBuffers(self.context.ctx, inputs.scene, buffers.receivers, buffers.space, buffers.axis)
        else:
            self.gains.update(inputs.scene)

    def splat_steps(
        self,
        photons: moderngl.Buffer,
        count: int,
        coarsening: float = 1.0,
        tables: ShownTables | None = None,
        maps: LightMaps | None = None,
        stride: int = 1,
    ) -> Iterator[None]:
        """As in `LightPass`; maps of several textures are summed up one by one before it has to be, as all together
        take longer than a frame."""
        atlas = (maps or self._maps).atlas
        if atlas.targets > 1 and atlas.pending + count >= FLUSH_AHEAD * min(
            CHUNK, atlas.size[0] * atlas.size[1] / FLUSH_SHARE
        ):
            yield from self._summing(atlas)
        yield from super().splat_steps(photons, count, coarsening, tables, maps, stride)

    def settling(self) -> Iterator[None]:
        """Sum up what is pending, so that the maps can be shown at once."""
        if self._maps.atlas.pending:
            yield from self._summing(self._maps.atlas)

    def _summing(self, atlas: MapAtlas) -> Iterator[None]:
        """`atlas.flush` with pauses."""
        width, height = atlas.size
        dispatch_budget = DispatchBudget(FIRST_SUMMED, ROWS, -(-height // ROWS) * ROWS)
        for scratch, total in zip(atlas.scratch_textures, atlas.total_textures, strict=True):
            row = 0
            while row < height:
                started = time.perf_counter()
                rows = min(dispatch_budget.units, height - row)
                self._accumulate.run_rows(scratch, total, row, rows)
                if self.waits:
                    self.context.finish()
                took = time.perf_counter() - started
                dispatch_budget.learn(rows, took, SUMMING_SECONDS)
                self.stats.splat_seconds += took
                row += rows
                yield
        atlas.pending = 0

    def splat_stored(self, *, of_running: bool = False) -> Iterator[None]:
        """Empty maps, then the stored photons as they are shown now, pausing after every slab.

        Where only the first rounds are stored, footprints are as much wider. `of_running`: those of the running pass as
        they are, so that it can go on. Nothing is shown where nothing is stored.
        """
        bundle = self._running if of_running else self._fuller
        maps = self._maps
        maps.clear()
        if bundle is None:
            return
        store = bundle.store
        if of_running:
            store.drop_unfinished()
        share = store.rounds / store.rounds_of_pass
        for slab in store.of_rounds(0, store.rounds):
            yield from self.splat_steps(
                slab.buffer, slab.count, 1.0 if of_running else share**-0.5, self._full_tables(bundle)
            )
            yield
        maps.photon_weight = bundle.pass_photons * share

    def splat_quickly(self, photons: int) -> LightMaps | None:
        """About so many stored photons as they are shown now, in maps of their own with texels `QUICK` times as wide;
        None where none are stored.

        For answers while something is dragged: the maps that accumulate are left alone.
        """
        bundle = self._fuller
        if bundle is None or not bundle.store.rounds:
            return None
        if self._quick is None:
            self._quick = self.maps_for(
                self.view, *quick_size(self.settings.width, self.settings.height), QUICK_TILE_MAX, self._quick_features
            )
        self._quick.clear()
        rounds = bundle.store.first_rounds(photons)
        slabs = bundle.store.of_rounds(0, rounds)
        # Records follow a space-filling curve over the lattice: every so manieth is nearly a lattice again.
        stride = max(1, sum(slab.count for slab in slabs) // photons)
        share = rounds / bundle.store.rounds_of_pass / stride
        tables = self._quick_tables(bundle)
        for slab in slabs:
            for _ in self.splat_steps(slab.buffer, -(-slab.count // stride), share**-0.5, tables, self._quick, stride):
                pass
        self._quick.photon_weight = bundle.pass_photons * share
        return self._quick

    def stored_records(self, limit: int) -> np.ndarray:
        """About `limit` stored records (`gpu.records.photon_record`)."""
        dtype = self.trace.photon.dtype
        return self._fuller.store.read(limit, dtype) if self._fuller else np.zeros(0, dtype)

    @property
    def bytes(self) -> int:
        """Device memory of photons, queues, maps and scene."""
        stored = sum(bundle.store.bytes for bundle in self._bundles)
        return (
            stored
            + self.trace.bytes
            + self.buffers.bytes
            + sum(maps.bytes for maps in (self.maps, self._quick) if maps is not None)
        )

    def release(self) -> None:
        """Free everything, the stored photons and the scene's buffers too."""
        for bundle in self._bundles:
            bundle.release()
        self._tables = self._running = self._older = None
        for owned in (self._quick, self._guess):
            if owned is not None:
                owned.release()
        self._accumulate.release()
        super().release()
        self.buffers.release()


def quick_size(width: int, height: int) -> tuple[int, int]:
    """Picture size for which maps of a first answer are laid out."""
    return max(16, round(width / QUICK)), max(16, round(height / QUICK))


def solo(spectrum: Spectrum, wavelength_nm: float) -> Spectrum:
    """The part of `spectrum` about one wavelength; a continuum is shown as bright as `SOLO_GAIN_NM` of it, a line as
    itself."""
    window = np.exp(-0.5 * ((VISIBLE_NM - wavelength_nm) / SOLO_WIDTH_NM) ** 2)
    density = spectrum.density * window * (SOLO_GAIN_NM / window.sum())
    lines = tuple(
        (nm, power * float(np.exp(-0.5 * ((nm - wavelength_nm) / SOLO_WIDTH_NM) ** 2))) for nm, power in spectrum.lines
    )
    return Spectrum(density, lines)
