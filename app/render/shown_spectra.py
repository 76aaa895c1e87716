"""The glass, the spectra and the brush's gains that photons are splatted by: those they were traced through, until
another is shown in their stead.

Photons carry weights and derivatives, not watts and colours, so none of this needs tracing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import moderngl
import numpy as np

from ..gpu import shader
from ..gpu.device_tables import DeviceTables
from ..gpu.device_traits import DeviceTraits
from ..gpu.gain_buffers import GainBuffers
from ..gpu.map_channels import MapChannels, tents
from ..gpu.reindex import ReindexBuffer, Reindexing, Spans
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.spectral_groups import samples_of
from ..gpu.splat_tables import LEAST_WIDTH, SplatTables
from ..model.optics.glass import Dispersion
from ..model.optics.spectrum import Spectrum
from ..model.scene import Scene
from ..model.tint_levels import LEVELS
from ..passes.footprint import SpectralVariables

PREVIEW_WIDTH = LEAST_WIDTH
"""Samples of the spectral tables of a preview."""
LEVELS_WIDTH = 256
"""Where there are as many as a tint has levels."""


@dataclass(frozen=True)
class ShownTables:
    """The spectra as splats see them, and which wavelengths belong to which paths."""

    tables: SplatTables
    reindex: ReindexBuffer | None

    def release(self) -> None:
        """Free both."""
        self.tables.release()
        shader.release(self.reindex)


class ShownSpectra:
    """Owns each spectral group's variable and the brush's gains; makes tables."""

    def __init__(self, ctx: moderngl.Context, scene: Scene, buffers: SceneBuffers, bins: int | None) -> None:
        self._ctx = ctx
        self._buffers = buffers
        features = buffers.features
        self.reflectances, self.reflectance_class = reflectance_classes(scene, buffers)
        edges = None if bins is None else tuple(np.linspace(380.0, 780.0, bins + 1).tolist())
        self.channels = tents(buffers.axis, features.map_tents) if features.map_tents else MapChannels(edges)
        """What the maps' channels mean."""
        self.spectra: Sequence[Spectrum] = [light.spectral_power for light in scene.lights]
        self.variables = SpectralVariables.build(ctx, buffers.variables)
        self._are_traced = True
        """The variables are those of what was traced."""
        self._by_compute = DeviceTraits.of(ctx.info["GL_RENDERER"]).tables_by_compute
        self._device_tables: DeviceTables | None = None
        self.gains: GainBuffers | None = None
        self.changed: Mapping[Dispersion, Dispersion] = {}
        """Glasses that are shown otherwise than they were traced."""
        self._reindexes = features.reindexed
        self.reindexing = self._unchanged() if features.reindexed else None
        """Which index belongs to which wavelength, where photons are distinguished by the index."""
        if features.local_gain:
            self.show_gains(scene)

    def show_spectra(self, spectra: Sequence[Spectrum]) -> bool:
        """Light the scene with `spectra`; True where tables follow."""
        stale = spectra != self.spectra
        self.spectra = spectra
        if stale:
            shader.release(self._device_tables)
            self._device_tables = None
        return stale

    def show_glass(self, changed: Mapping[Dispersion, Dispersion]) -> bool:
        """Follow an edit of n(λ), glass by glass; True where tables follow."""
        if changed == self.changed:
            return False
        self.changed = changed
        table, axis = self._buffers.variables, self._buffers.axis
        if self._reindexes:
            (traced,) = axis.glasses
            reindexing = Reindexing.of(traced, changed.get(traced, traced))
            if reindexing is not None:
                self.reindexing = reindexing
                if not self._are_traced:
                    self.variables = SpectralVariables.build(self._ctx, table, into=self.variables)
                self._are_traced = True
                return True
            self.reindexing = self._unchanged()
        self._are_traced = not changed
        groups = self._buffers.groups
        groups = replace(groups, glasses=tuple(changed.get(glass, glass) for glass in groups.glasses))
        shown = groups.variables(*samples_of(axis))
        self.variables = SpectralVariables.build(self._ctx, shown, table if changed else None, self.variables)
        return self._reindexes

    def show_gains(self, scene: Scene | None) -> None:
        """The brush's dabs of `scene`; None for none."""
        if scene is None:
            shader.release(self.gains)
            self.gains = None
        elif self.gains is None:
            b = self._buffers
            self.gains = GainBuffers(self._ctx, scene, b.receivers, b.space, b.axis)
        else:
            self.gains.update(scene)

    def tables(
        self,
        spans: Spans,
        channels: MapChannels | None = None,
        width: int | None = None,
        into: ShownTables | None = None,
    ) -> ShownTables:
        """Tables for bands of `spans`, the caller's; `channels` of maps that are not the light pass's own. `into`:
        tables that are of no use any more, whose textures and buffers become these'."""
        ctx, spectra, channels = self._ctx, self.spectra, channels or self.channels
        before = None if into is None else into.tables
        if self.reindexing is None:
            return ShownTables(
                traced_tables(ctx, self._buffers, spectra, self.reflectances, spans, channels, width, before), None
            )
        supports = self.reindexing.supports(spectra)
        shown = self.reindexing.spans(spans, self._buffers.axis, supports)
        axis = self.reindexing.axis
        if width == PREVIEW_WIDTH and channels == MapChannels() and self._by_compute:
            if self._device_tables is None:
                self._device_tables = DeviceTables(ctx, spectra, self.reflectances)
            tables = self._device_tables.tables(axis, shown, before)
        else:
            tables = SplatTables.build(ctx, axis, spectra, self.reflectances, shown, channels, width, before)
        reindex = None if into is None else into.reindex
        return ShownTables(tables, ReindexBuffer(ctx, self.reindexing, spans, supports, tables.classes, reindex))

    def _unchanged(self) -> Reindexing | None:
        (traced, *_) = self._buffers.axis.glasses
        return Reindexing.of(traced, traced)

    def release(self) -> None:
        """Free what it owns."""
        self.variables.release()
        shader.release(self._device_tables)
        self.show_gains(None)


def traced_tables(
    ctx: moderngl.Context,
    buffers: SceneBuffers,
    spectra: Sequence[Spectrum],
    reflectances: Sequence[np.ndarray | None],
    spans: Sequence[Sequence[tuple[float, float]]],
    channels: MapChannels,
    width: int | None = None,
    into: SplatTables | None = None,
) -> SplatTables:
    """`SplatTables.build` for the lights' spectra: behind every level of a tint, one after the other, where photons
    tell them."""
    levels = buffers.tint_levels
    if levels is not None:
        width = width or (None if any(light.lines for light in spectra) else LEVELS_WIDTH)
        spectra = [behind for light in spectra for behind in levels.all_behind(light)]
        spans = [bands for bands in spans for _ in range(LEVELS)]
    return SplatTables.build(ctx, buffers.axis, spectra, reflectances, spans, channels, width, into)


class PassTables:
    """The spectral tables of one pass's bands, made when they are needed: an edit that is followed by the next one
    needs only those of the preview."""

    def __init__(self, shown: ShownSpectra, spans: Spans) -> None:
        self._shown = shown
        self.spans = spans
        self._full: ShownTables | None = None
        self._preview: ShownTables | None = None
        self._is_full = self._is_preview = False
        """They are of what is shown."""

    @property
    def full(self) -> ShownTables:
        """For the light pass's own maps."""
        if self._full is None or not self._is_full:
            self._full, self._is_full = self._shown.tables(self.spans, into=self._full), True
        return self._full

    @property
    def preview(self) -> ShownTables:
        """For maps in colour only."""
        channels = self._shown.channels
        if self._full is not None and self._is_full and not channels.tents_nm:
            return self._full
        if self._preview is None or not self._is_preview:
            coarse = MapChannels(channels.edges_nm), PREVIEW_WIDTH, self._preview
            self._preview, self._is_preview = self._shown.tables(self.spans, *coarse), True
        return self._preview

    def outdate(self) -> None:
        """They show another glass or light than what is wanted now."""
        self._is_full = self._is_preview = False

    def forget(self) -> None:
        """Free them."""
        shader.release(self._full, self._preview)
        self._full = self._preview = None


def reflectance_classes(scene: Scene, buffers: SceneBuffers) -> tuple[list[np.ndarray | None], dict[int, int]]:
    """Distinct spectral reflectances to fold into the tables (None: none), and each receiver's class."""
    classes: list[np.ndarray | None] = [None]
    chosen: dict[int, int] = {}
    for receiver, index in enumerate(buffers.receivers):
        material = scene.objects[index].material
        if material.reflectance is None:
            chosen[receiver] = 0
            continue
        chosen[receiver] = next(
            (i for i, known in enumerate(classes) if known is not None and np.array_equal(known, material.reflectance)),
            len(classes),
        )
        if chosen[receiver] == len(classes):
            classes.append(material.reflectance)
    return classes, chosen
