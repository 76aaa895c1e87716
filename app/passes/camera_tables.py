"""Spectra as the camera's rays meet them: indices of the glass that is shown, absorption, and emission times the
observer.

The emission table holds running sums over the spectral coordinate x. A lookup of a stretch of the spectrum is then the
difference of two of its samples in every channel of the picture, however many wavelengths lie between them.
Where the shown glass is an edit of the one that photons were traced through, the camera follows the shown one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import moderngl
import numpy as np

from ..features.program_switches import Defines, switched
from ..gpu import shader
from ..gpu.device_traits import DeviceTraits
from ..gpu.map_channels import MapChannels
from ..gpu.running_sums import BIND_KNOTS, KNOTS, RunningSums, SumRow
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.scene_records import grating_tables
from ..gpu.scene_texels import spectra_texels
from ..gpu.spectral_groups import SAMPLES, index_slope, samples_of
from ..model.film_stacks import film_parts, film_tables
from ..model.materials.diffuse import SMOOTH_ROUGHNESS
from ..model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz, daylight_per_lumen, rgb_basis
from ..model.optics.glass import Dispersion
from ..model.optics.rough_surfaces import coat_tables, glass_defines, glass_tables
from ..model.optics.spectral_tables import CELL_EDGES_NM, SpectralAxis, cumulative
from ..model.optics.spectrum import Spectrum
from ..model.scene import Material, Scene
from .picture_channels import Channels

EMISSION_CELLS = SAMPLES - 1
"""Cells of x that a stretch of the spectrum begins and ends with; a wavelength is resolved to 1/1024 of the indices'
variation."""
_GROUP = 64


class CameraTables:
    """GPU tables of one shown scene, and the symbols by which the shader finds its rows."""

    def __init__(
        self,
        ctx: moderngl.Context,
        scene: SceneBuffers,
        channels: Channels,
        reflectances: Sequence[np.ndarray | None],
        maps: MapChannels,
    ) -> None:
        """`scene.scene` is what is shown; its geometry and its partition into glasses are those of `scene`.

        `reflectances`: classes as the splat tables were built with. `maps`: what the caustic maps' channels are."""
        self._ctx, self._of = ctx, (channels, reflectances, maps)
        by_compute = DeviceTraits.of(ctx.info["GL_RENDERER"]).tables_by_compute
        values = _Values.of(scene, channels, reflectances, maps)
        self.defines = values.defines
        self.spectra, self.emission = (
            ctx.texture(texels.shape[1::-1], texels.shape[2], texels, dtype="f4") for texels in values.textures
        )
        for texture in (self.spectra, self.emission):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.object_colours = ctx.buffer(values.object_colours)
        self.cell_cdf = ctx.buffer(values.cell_cdf)
        curves, rows = int(values.defines["QUANTILE_ROW"]), self.spectra.height
        self._device = _DeviceTables(ctx, curves, rows) if by_compute and channels.edges_nm is None else None

    def take(self, scene: SceneBuffers) -> bool:
        """Be tables of another shown scene in the same textures and buffers. False, and nothing done, where they do not
        fit or the shader would find its rows elsewhere."""
        values = _Values.of(scene, *self._of)
        rows = int(values.defines["QUANTILE_ROW"]) + len(values.sampled)
        if values.defines != self.defines or rows != self.spectra.height:
            return False
        if values.object_colours.nbytes != self.object_colours.size:
            return False
        if self._device is None:
            for texture, texels in zip((self.spectra, self.emission), values.textures, strict=True):
                texture.write(texels)
        else:
            self._device.write(values, self.spectra, self.emission)
        self.object_colours.write(values.object_colours)
        self.cell_cdf.write(values.cell_cdf)
        return True

    def release(self) -> None:
        """Free everything."""
        shader.release(self.spectra, self.emission, self.object_colours, self.cell_cdf, self._device)


class _DeviceTables:
    """Writes the textures on the device: uploaded are x of the nanometre cells' edges, and of what lies over wavelength
    what has changed at these. Owns what it reads."""

    def __init__(self, ctx: moderngl.Context, curves: int, rows: int) -> None:
        """`rows` tables, of which the first `curves` are over wavelength."""
        self._ctx = ctx
        self._held = [np.zeros(0, "f4")] * rows
        self._rows = ctx.buffer(reserve=4 * (KNOTS * curves + SAMPLES * (rows - curves)))
        self._lit: tuple[Spectrum, ...] = ()
        self._sums: RunningSums | None = None
        of_rows: Defines = {"BIND_KNOTS": BIND_KNOTS, "BIND_ROWS": 2, "SUM_KNOTS": KNOTS, "CURVES": curves}
        self._pairs = shader.compute(ctx, "camera/table_rows.comp", switched(PAIRS=True) | of_rows)

    def write(self, values: _Values, spectra: moderngl.Texture, emission: moderngl.Texture) -> None:
        """`values` into the textures."""
        if self._sums is None or any(a is not b for a, b in zip(self._lit, values.lit, strict=True)):
            shader.release(self._sums)
            rows = values.emission()
            self._lit, self._sums = values.lit, RunningSums(self._ctx, [row.sums for row in rows])
            self._emission = shader.compute(self._ctx, "camera/table_rows.comp", self._sums.defines)
        offset, curves = 0, values.curves(CELL_EDGES_NM, values.axis.cell_edges_x)
        for number, row in enumerate([*curves.astype("f4"), *values.sampled.astype("f4")]):
            if not np.array_equal(row, self._held[number]):
                self._held[number] = row
                self._rows.write(row, offset=offset)
            offset += row.nbytes
        self._ctx.memory_barrier()
        self._sums.bind(values.axis)
        self._rows.bind_to_storage_buffer(2)
        spectra.bind_to_image(0, read=False, write=True)
        self._pairs.run(-(-spectra.width // _GROUP), spectra.height)
        emission.bind_to_image(0, read=False, write=True)
        self._emission.run(-(-emission.width // _GROUP), emission.height)
        self._ctx.memory_barrier()

    def release(self) -> None:
        """Free everything."""
        if self._sums is not None:
            shader.release(self._emission)
        shader.release(self._rows, self._sums, self._pairs)


@dataclass(frozen=True)
class _Values:
    """What the tables hold."""

    curves: Callable[[np.ndarray, np.ndarray], np.ndarray]
    """Rows of `spectra_texels` over wavelength, (rows, n), by nm and x, (n,) each."""
    sampled: np.ndarray
    """The others, which follow, (rows, SAMPLES)."""
    axis: SpectralAxis
    lit: tuple[Spectrum, ...]
    """The lights'."""
    emission: Callable[[], list[_EmissionRow]]
    object_colours: np.ndarray
    cell_cdf: np.ndarray
    defines: dict[str, int | str]

    @classmethod
    def of(
        cls,
        scene: SceneBuffers,
        channels: Channels,
        reflectances: Sequence[np.ndarray | None],
        maps: MapChannels,
    ) -> _Values:
        """As of `CameraTables.build`."""
        shown = scene.scene
        glasses = _shown_media(scene)
        by_glass = scene.groups.count and not scene.groups.by_wavelength
        axis = SpectralAxis.build(list(glasses.values()) if by_glass else [])
        absorptions = _distinct_absorptions(shown, scene.space.scale)
        cell_cdf = _cell_cdf(axis, channels)
        sections = _curves(scene, glasses, absorptions, maps)
        starts = np.cumsum([0, *(rows for rows, _ in sections.values())]).tolist()
        defines: dict[str, int | str] = dict(zip([*sections, "QUANTILE_ROW"], starts, strict=True))
        widths = [item.material.microfacet_width for item in shown.objects]
        if any(width > 0.0 for width in widths):
            defines |= glass_defines(starts[-1] + 1)
        quantiles = np.interp(np.linspace(0.0, 1.0, SAMPLES), cell_cdf, np.linspace(0.0, 1.0, EMISSION_CELLS + 1))
        sampled = np.concatenate([quantiles[None], glass_tables(widths, SAMPLES)])
        if scene.features.films:
            films = film_tables(shown, axis.nm_of_samples(SAMPLES), scene.features.polarised)
            parts_row = starts[-1] + len(sampled)
            defines |= {**films.defines, "PARTS_ROW": parts_row, "FILM_ROW": parts_row + 2}
            sampled = np.concatenate([sampled, film_parts(axis, SAMPLES), films.rows])
        if scene.features.gratings:
            defines["GRATING_ROW"] = starts[-1] + len(sampled)
            sampled = np.concatenate([sampled, grating_tables(shown, SAMPLES)[1]])
        emission = partial(_emission_rows, shown, channels, reflectances, maps, scene.space.scale)
        rows = _emission_defines(len(shown.lights), len(reflectances), maps)
        finishes, coats = _finishes(shown, starts[-1] + len(sampled))
        if finishes is not None:
            sampled, rows = np.concatenate([sampled, coats]), rows | {"FINISHES_AT": len(shown.objects)}
        colours = np.zeros((len(shown.objects), 4), "f4")
        colours[:, 3] = -1.0
        for row, item in zip(colours, shown.objects, strict=True):
            row[:3] = item.material.reflectance_rgb
            if item.material.transmits:
                # Which filter its surface is, and the most of it.
                row[:2] = -1.0, item.material.surface_filter.max()
            for column, coefficient in zip((3, 0), _absorptions(item.material, scene.space.scale), strict=True):
                if coefficient is not None:
                    row[column] = next(i for i, known in enumerate(absorptions) if np.array_equal(known, coefficient))
        return cls(
            lambda nm, x: np.array([row for _, rows_of in sections.values() for row in rows_of(nm, x)]),
            sampled,
            axis,
            tuple(light.spectral_power for light in shown.lights),
            emission,
            colours if finishes is None else np.concatenate([colours, finishes]),
            cell_cdf.astype("f4"),
            {**defines, "ABSORBERS": len(absorptions), **rows},
        )

    @property
    def textures(self) -> tuple[np.ndarray, np.ndarray]:
        """Texels of spectra and emission, exact to float32."""
        rows = np.concatenate([self.curves(*samples_of(self.axis)), self.sampled])
        return spectra_texels(np.asarray(rows, "<f4")), _emission(self.emission, self.axis)


def _shown_media(scene: SceneBuffers) -> dict[Dispersion, Dispersion]:
    """Each glass that the records number, in their order, and the one that is shown in its stead."""
    pairs = zip(scene.traced_glasses, scene.scene.objects, strict=True)
    shown = [pair for traced, item in pairs for pair in zip(traced, item.material.dispersions, strict=True)]
    return {traced: next((new for old, new in shown if old == traced), traced) for traced in scene.media}


def _distinct_absorptions(scene: Scene, scale: float) -> list[np.ndarray]:
    """Distinct absorption coefficients (401,) of glasses, 1/GPU unit, of coloured mirrors, a reflection, and of
    surfaces of glass, a passage, in the order of the objects."""
    distinct: list[np.ndarray] = []
    for item in scene.objects:
        for coefficient in _absorptions(item.material, scale):
            if coefficient is not None and not any(np.array_equal(coefficient, known) for known in distinct):
                distinct.append(coefficient)
    return distinct


def _absorptions(material: Material, scale: float) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Within a solid, or by a mirror; on the way through a surface."""
    within = material.absorption.coefficient / scale if material.absorption is not None and material.is_solid else None
    if material.is_mirror and material.is_coloured:
        within = _depth(rgb_basis() @ np.asarray(material.reflectance_rgb, float))
    return within, _depth(material.surface_filter) if material.filters else None


def _depth(kept: np.ndarray) -> np.ndarray:
    return -np.log(np.maximum(kept, 1e-30))


def _finishes(scene: Scene, first_row: int) -> tuple[np.ndarray | None, np.ndarray]:
    """What camera rays know of each object's finish, float32 (O, 4): the coat's alpha (below 0: none; 0: perfectly
    smooth), its index, its first row of tables, the base's roughness; None where all is plain. The tables
    (rows, SAMPLES), over the cosine, follow `first_row` others (`optics.rough_surfaces.coat_tables`)."""
    materials = [item.material for item in scene.objects]
    if not any(m.has_coat or m.diffuse_roughness for m in materials):
        return None, np.zeros((0, SAMPLES))
    finishes, tables = np.zeros((len(materials), 4), "f4"), dict[tuple[float, float], np.ndarray]()
    for row, material in zip(finishes, materials, strict=True):
        row[:] = -1.0, 1.0, 0.0, material.diffuse_roughness
        if material.has_coat:
            alpha = material.roughness**2 if material.roughness >= SMOOTH_ROUGHNESS else 0.0
            key = alpha, material.coat_index
            if key not in tables:
                tables[key] = coat_tables(alpha, material.coat_index, SAMPLES)
            row[:3] = *key, first_row + 2 * list(tables).index(key)
    return finishes, np.concatenate([np.zeros((0, SAMPLES)), *tables.values()])


def _curves(
    scene: SceneBuffers, glasses: dict[Dispersion, Dispersion], absorptions: list[np.ndarray], maps: MapChannels
) -> dict[str, tuple[int, Callable[[np.ndarray, np.ndarray], Iterable[np.ndarray]]]]:
    """Rows over wavelength as `lib/scene.glsl` reads them, by the symbol of their first: how many, and `_Values.curves`
    of these."""
    groups = replace(scene.groups, glasses=tuple(glasses[g] for g in scene.groups.glasses))
    numbers = [scene.groups.glasses.index(g) if g in scene.groups.glasses else None for g in glasses]
    return {
        "INDEX_ROW": (len(glasses), lambda nm, _x: [shown.index(nm) for shown in glasses.values()]),
        "SLOPE_ROW": (len(glasses), lambda nm, x: [index_slope(groups, number, nm, x) for number in numbers]),
        "VARIABLE_ROW": (groups.count, groups.variables),
        "ABSORPTION_ROW": (len(absorptions), lambda nm, _x: [np.interp(nm, VISIBLE_NM, row) for row in absorptions]),
        "BASIS_ROW": (3, lambda nm, _x: [np.interp(nm, VISIBLE_NM, column) for column in rgb_basis().T]),
        "BIN_ROW": (1, lambda nm, _x: [maps.coordinate(nm)]),
    }


@dataclass(frozen=True)
class _EmissionRow:
    """A running sum over x of the spectrum times weights (401, 4·targets)."""

    spectrum: Spectrum
    weights: np.ndarray
    unit: float = 1.0

    @property
    def sums(self) -> SumRow:
        """As the device sums it up."""
        line_nm = np.array(self.spectrum.lines, float).reshape(-1, 2)[:, 0]
        at_lines = np.column_stack([np.interp(line_nm, VISIBLE_NM, column) for column in self.weights.T])
        return SumRow.of(self.spectrum, self.unit * self.weights, self.unit * at_lines)


def _emission_rows(
    scene: Scene, channels: Channels, reflectances: Sequence[np.ndarray | None], maps: MapChannels, scale: float
) -> list[_EmissionRow]:
    observer, basis, white = channels.observer(), rgb_basis(), Spectrum(daylight_per_lumen())
    seen = [observer, *(observer * column[:, None] for column in basis.T)]
    rows = [_EmissionRow(white, weights) for weights in seen]
    seen += [observer * np.asarray(reflectance)[:, None] for reflectance in reflectances[1:]]
    for light in scene.lights:
        # Intensity over distance² in GPU units needs the square of the scale; the other kinds are free of lengths.
        unit = scale**2 if light.is_intensity else 1.0
        rows += [_EmissionRow(light.spectral_power, weights, unit) for weights in seen]
    rows += [_EmissionRow(spectrum, observer) for spectrum in maps.spectra(scene.lights)]
    if channels.edges_nm is not None:
        # Mean over each bin of the reflectance basis: the last sample alone is read.
        constant = np.zeros(len(VISIBLE_NM))
        constant[0] = 1.0
        means = [channels.of_reflectance(tuple(np.eye(3)[c])) for c in range(3)]
        rows += [_EmissionRow(Spectrum(constant), np.tile(mean, (len(VISIBLE_NM), 1))) for mean in means]
    return rows


def _emission_defines(lights: int, classes: int, maps: MapChannels) -> dict[str, int]:
    """Where each kind of row begins."""
    a_light = 4 + classes - 1
    bins = 4 + lights * a_light
    return {
        "WHITE_ROW": 0,
        "LIGHT_ROW": 4,
        "ROWS_PER_LIGHT": a_light,
        "BIN_SPECTRUM_ROW": bins,
        "REFLECTANCE_ROW": bins + maps.count,
    }


def _emission(rows: Callable[[], list[_EmissionRow]], axis: SpectralAxis) -> np.ndarray:
    """float32 (rows · targets, EMISSION_CELLS + 1, 4): row r of target t at r · targets + t."""
    x = np.linspace(0.0, 1.0, EMISSION_CELLS + 1)
    sums = np.stack([row.unit * cumulative(axis, row.spectrum, row.weights).at(x) for row in rows()])
    # All of the spectrum is between the first sample and the last, a line at 380 nm too.
    sums[:, 0] = 0.0
    count, samples, columns = sums.shape
    texels = sums.reshape(count, samples, columns // 4, 4).transpose(0, 2, 1, 3).reshape(-1, samples, 4)
    return np.ascontiguousarray(texels, "f4")


def _cell_cdf(axis: SpectralAxis, channels: Channels) -> np.ndarray:
    """How much of what looks bright is below each border of the cells of x: what daylight adds to X + Y + Z there, or
    evenly to all bins.

    Random wavelengths are drawn by it, and lookups along a sweep are distributed by it."""
    x, white = np.linspace(0.0, 1.0, EMISSION_CELLS + 1), daylight_per_lumen()
    bright = white * K_M * cmf_xyz().sum(axis=1) if channels.edges_nm is None else channels.observer().sum(axis=1)
    seen = np.interp(x, axis.cell_edges_x, np.concatenate([[0.0], np.cumsum(bright)]))
    # No cell is impossible: another light may be brighter there.
    mixed = 0.98 * seen / seen[-1] + 0.02 * x
    mixed[0], mixed[-1] = 0.0, 1.0
    return mixed
