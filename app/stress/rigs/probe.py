"""Renders a small picture for a stress case and checks every result of it: photons, caustic maps, picture, flux.

The program's own light pass and camera pass do the work. This only reads what they produce: every photon record of
every batch, every texel of every map, every pixel.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...gpu import records
from ...gpu.packed_records import read_records
from ...model.settings import RenderSettings
from ...passes.camera import CameraPass
from ...render.device_scene import scene_buffers
from ...render.light_pass import LightPass
from ...render.light_stats import LightStats
from ...render.photon_records import NoRecords
from ..case import Held, Measurement, judged, not_finite

if TYPE_CHECKING:
    import moderngl

    from ...gpu.context import Context
    from ...gpu.reindex import Spans
    from ...gpu.schema import Struct
    from ...model.scene import Scene
    from ...passes.trace import Batch
    from ...render.photon_records import RoundOf
    from ...render.shown_spectra import PassTables, ShownSpectra

SMALL = RenderSettings(width=160, height=90, photons=32_768, spp=16, method="srd-photons")
"""Settings of every stress case that is not about one of them. Fewer than 16 samples a pixel would miss texels of a
sharp focus. The method traces photons, without beams, which have cases of their own."""
CAUSTIC = replace(SMALL, layer="caustic")
LOST_TO_NUMERICS = 1e-3
"""Largest share of the flux that may end for numerical reasons (cracks, overflows): a tenth of what a picture shows."""
SAME_PICTURE = 0.01
"""Largest nRMSE between pictures whose photons differ by rounding only, which makes one photon in a thousand choose
another path: √(2·1e-3) of the picture's own contrast of about a fifth."""
SAME_ENERGY = 1e-3
"""Largest relative error of the summed picture in that case: one photon in a thousand."""
NOISE = 3.0
"""A picture from other samples may differ by this times the difference of two seeds, which still share the shape of the
lattice and the texels."""
TEXELS = 0.05
"""Largest nRMSE between pictures whose maps have their texels (half a pixel) in other positions. In a pixel on an edge
half a texel of blur changes a quarter of the contrast, and some 4 % of the pixels of so small a picture are on edges:
0.25 √0.04."""


class WatchedRecords:
    """`PhotonRecords` that checks every batch of photons for non-finite values and counts dropped footprints."""

    keeps = takes_tails = True

    def __init__(self, photon: Struct) -> None:
        self._photon = photon
        self._forgotten = NoRecords()
        self.nonfinite_photons = 0
        self.dropped = 0
        self.watched = 0

    @property
    def tables(self) -> PassTables:
        """See `PhotonRecords`."""
        return self._forgotten.tables

    def begin(self, shown: ShownSpectra, spans: Spans, photons: int) -> None:
        """See `PhotonRecords`."""
        self._forgotten.begin(shown, spans, photons)

    def release(self) -> None:
        """Free the tables."""
        self._forgotten.release()

    def keep(self, photons: moderngl.Buffer, batch: Batch, stride: int, of: RoundOf) -> None:
        """Check the batch; nothing is kept."""
        if batch.photons:
            self._watch(read_records(self._photon, photons, batch.photons))

    def _watch(self, photons: np.ndarray) -> None:
        self.watched += len(photons)
        dropped = (photons["flags"] & records.FLAG_FOOTPRINT_DROPPED) != 0
        self.dropped += int(dropped.sum())
        # A dropped footprint's columns (position derivatives) are never read; every other value is.
        names = photons.dtype.names or ()
        columns = [name for name in names if name.startswith("dposition")]
        floats = [name for name in names if photons.dtype[name].base == np.float32 and name not in columns]
        bad = np.zeros(len(photons), bool)
        for name in (*floats, *columns):
            finite = np.isfinite(photons[name]).reshape(len(photons), -1).all(axis=1)
            bad |= ~finite & ~dropped if name in columns else ~finite
        self.nonfinite_photons += int(bad.sum())


@dataclass(frozen=True)
class Probe:
    """Results of one rendering, checked."""

    picture: np.ndarray
    """float64 (H, W, 3), linear Rec.709."""
    stats: LightStats
    nonfinite: int
    """Photon records, texel values and pixel values that are NaN or infinite."""
    dropped: int
    """Photon records flagged as having lost their footprint."""
    map_flux_w: float
    """Flux in the part of the maps that lookups use (`LightMaps.flux`), per pass weight."""

    @property
    def shares(self) -> dict[str, float]:
        """Where flux ended, as shares of what was emitted; empty where no light reaches glass."""
        tally = self.stats.tally
        return {name: flux / tally.emitted for name, flux in tally.ended.items()} if tally.emitted else {}

    @property
    def map_error(self) -> float:
        """|flux in the maps + flux outside all of them − flux deposited| / flux deposited."""
        deposited = self.stats.tally.ended["deposited"]
        return abs(self.map_flux_w + self.stats.outside_map_w - deposited) / deposited if deposited else 0.0


@contextmanager
def light_pass(context: Context, scene: Scene, settings: RenderSettings) -> Iterator[tuple[LightPass, WatchedRecords]]:
    """The prepared light pass of `scene` and the checks of its photons; everything is freed afterwards."""
    buffers = scene_buffers(context, scene, settings)
    watched = WatchedRecords(records.photon_record_of(buffers.features, context.traits.packs_records))
    light = LightPass(context, scene, settings, buffers.features, buffers, photon_records=watched)
    try:
        light.prepare()
        yield light, watched
    finally:
        light.release()
        buffers.release()


def probe(context: Context, scene: Scene, settings: RenderSettings = SMALL) -> Probe:
    """Render `scene` in one pass and check all results."""
    photons = settings.photons or scene.render.photons
    with light_pass(context, scene, settings) as (light, photon_records):
        light.begin(photons, settings.seed)
        light.run_pass(0, photons, lambda _: True)
        light.finish()
        if photon_records.watched != light.stats.splats:
            raise RuntimeError(f"{photon_records.watched} of {light.stats.splats} photon records were seen")
        camera_pass = CameraPass(context, light.buffers, settings.layer, light.shown.reflectances, light.shown.channels)
        try:
            view = scene.camera, settings.width, settings.height
            camera_pass.run(*view, settings.spp or 1, 0, light.caustic_maps(), settings.seed)
            picture = camera_pass.read_rgb()
            spectral = camera_pass.read_spectral() if settings.bins else None
        finally:
            camera_pass.release()
        seen = (picture, read_maps(light), *([] if spectral is None else [spectral]))
        bad = photon_records.nonfinite_photons + not_finite(seen)
        return Probe(picture.astype(float), light.stats, bad, photon_records.dropped, light.maps.flux())


def read_maps(light: LightPass) -> np.ndarray:
    """All caustic maps as the camera pass reads them, float32 (targets, height, width, 4)."""
    width, height = light.maps.atlas.size
    textures = light.maps.resolved_textures()
    values = np.empty((len(textures), height, width, 4), np.float32)
    for texture, layer in zip(textures, values, strict=True):
        texture.read_into(layer)
    return values


def picture_error(picture: np.ndarray, expected: np.ndarray) -> float:
    """nRMSE: root of Σ(a − b)² over root of Σb²; infinite where only one of them is dark."""
    with np.errstate(all="ignore"):
        return _ratio(float(np.sqrt(np.sum((picture - expected) ** 2))), float(np.sqrt(np.sum(expected**2))))


def energy_error(picture: np.ndarray, expected: np.ndarray) -> float:
    """|Σa − Σb| / Σb."""
    with np.errstate(all="ignore"):
        return _ratio(abs(float(picture.sum() - expected.sum())), abs(float(expected.sum())))


def blocks(picture: np.ndarray, side: int = 10) -> np.ndarray:
    """Means over blocks of `side` × `side` pixels; incomplete blocks at the borders are left out."""
    height, width = (n // side * side for n in picture.shape[:2])
    cut = picture[:height, :width]
    return cut.reshape(height // side, side, width // side, side, -1).mean(axis=(1, 3))


def compared(found: Probe, base: Probe, picture: float, energy: float) -> Held:
    """Errors of a rendering against another of the same light, with the bounds `picture` and `energy`."""
    return {
        "picture": (picture_error(found.picture, base.picture), picture),
        "energy": (energy_error(found.picture, base.picture), energy),
    }


def rendered(
    severity: float,
    label: str,
    found: Probe,
    held: Held | None = None,
    note: str = "",
    lost: float = LOST_TO_NUMERICS,
) -> Measurement:
    """The measurement of a rendering: its own promises (no uncounted drop, little flux lost) and those of `held`."""
    tally = found.stats.tally
    uncounted = max(0, found.dropped - tally.fallbacks["footprint_dropped"])
    promised = {"uncounted": (uncounted, 0.0), "lost": (found.shares.get("lost_numeric", 0.0), lost)}
    fallbacks = {**tally.fallbacks, "splat_footprint_dropped": found.stats.footprints_dropped}
    errors, bounds = judged({**promised, **(held or {})})
    return Measurement(
        severity, label, found.nonfinite, errors, bounds, tally.imbalance, fallbacks, found.dropped, note
    )


def against_single_wavelengths(
    context: Context, scene: Scene, severity: float, label: str, smeared: float = 0.0
) -> Measurement:
    """Compare photons with spectral derivatives to `stochastic` (one random wavelength a photon, no derivatives) on
    blocks of ten by ten pixels.

    The bound is the sum of the difference between two seeds of `stochastic` (its noise), 3 % of the picture for splats
    that reach across the blocks' borders, and `smeared`; the bound of the energy is 3 %.
    """
    found = probe(context, scene, CAUSTIC)
    one, other = (probe(context, scene, replace(CAUSTIC, method="stochastic", seed=seed)).picture for seed in (1, 2))
    chance, mean = picture_error(blocks(other), blocks(one)), 0.5 * (one + other)
    held: Held = {
        "blocks": (picture_error(blocks(found.picture), blocks(mean)), chance + 0.03 + smeared),
        "energy": (energy_error(found.picture, mean), 0.03),
    }
    return rendered(severity, label, found, held)


def with_photons(photons: int) -> RenderSettings:
    """`SMALL` with another number of photons."""
    return replace(SMALL, photons=photons)


def _ratio(difference: float, size: float) -> float:
    if size == 0.0:
        return 0.0 if difference == 0.0 else float("inf")
    return difference / size
