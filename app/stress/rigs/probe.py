"""One small rendering for the stress sweep, with everything it made examined: photons, maps, picture, flux.

The product's own light pass and camera pass do the work. What is added only reads: every photon
record of every batch, every texel of every map, every pixel.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...gpu import records
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
    from ...model.scene import Scene
    from ...passes.trace import Batch
    from ...render.photon_records import RoundOf
    from ...render.shown_spectra import PassTables, ShownSpectra

SMALL = RenderSettings(width=160, height=90, photons=32_768, spp=16, method="srd-photons")
"""What a sweep renders unless the case is about just that. Fewer than 16 samples a pixel would miss texels of a sharp
focus. By photons: beams have cases of their own."""
CAUSTIC = replace(SMALL, layer="caustic")
LOST_TO_NUMERICS = 1e-3
"""Largest share of the flux that may end for numerical reasons (cracks, overflows): a tenth of what a picture shows."""
SAME_PICTURE = 0.01
"""nRMSE of a picture whose photons are the same but for rounding: one photon in a thousand may choose otherwise
(√(2·1e-3) of its own contrast of about a fifth)."""
SAME_ENERGY = 1e-3
"""The same, summed over the picture: one photon in a thousand."""
NOISE = 3.0
"""A picture drawn anew may differ by as much as two seeds do, times this: two seeds still share the lattice's shape and
the texels."""
TEXELS = 0.05
"""nRMSE of a picture read from maps whose texels (half a pixel) lie otherwise: where an edge crosses a pixel half a
texel more or less of blur is a quarter of the contrast, and in so small a picture some 4 % of the pixels lie on edges:
0.25 √0.04."""


class WatchedRecords:
    """`PhotonRecords` that are read after every batch."""

    takes_tails = True

    def __init__(self, groups: int) -> None:
        self._dtype = records.photon_record(groups).dtype
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
        """Examine the batch."""
        if batch.photons:
            self._watch(np.frombuffer(photons.read(batch.photons * stride), self._dtype))

    def _watch(self, photons: np.ndarray) -> None:
        self.watched += len(photons)
        dropped = (photons["flags"] & records.FLAG_FOOTPRINT_DROPPED) != 0
        self.dropped += int(dropped.sum())
        # A dropped footprint's columns are never read again, everything else always is.
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
    """What one rendering made."""

    picture: np.ndarray
    """float64 (H, W, 3), linear Rec.709."""
    stats: LightStats
    nonfinite: int
    """Photon records, texel values and pixel values that are NaN or infinite."""
    dropped: int
    """Photon records whose flag says that the footprint was dropped."""
    map_flux_w: float
    """What the maps hold where they are read, per pass weight."""

    @property
    def shares(self) -> dict[str, float]:
        """Where flux ended, as shares of what was emitted; empty where no light reaches glass."""
        tally = self.stats.tally
        return {name: flux / tally.emitted for name, flux in tally.ended.items()} if tally.emitted else {}

    @property
    def map_error(self) -> float:
        """|what maps hold + what lies outside all of them − deposited| / deposited."""
        deposited = self.stats.tally.ended["deposited"]
        return abs(self.map_flux_w + self.stats.outside_map_w - deposited) / deposited if deposited else 0.0


@contextmanager
def light_pass(context: Context, scene: Scene, settings: RenderSettings) -> Iterator[tuple[LightPass, WatchedRecords]]:
    """The prepared light pass of `scene` and its photons; everything is freed afterwards."""
    buffers = scene_buffers(context, scene, settings)
    watched = WatchedRecords(buffers.features.spectral_groups)
    light = LightPass(context, scene, settings, buffers.features, buffers, photon_records=watched)
    try:
        light.prepare()
        yield light, watched
    finally:
        light.release()
        buffers.release()


def probe(context: Context, scene: Scene, settings: RenderSettings = SMALL) -> Probe:
    """Render `scene` in one pass and examine everything."""
    photons = settings.photons or scene.render.photons
    with light_pass(context, scene, settings) as (light, photon_records):
        light.begin(photons, settings.seed)
        light.run_pass(0, photons, lambda _: True)
        light.finish()
        if photon_records.watched != light.stats.splats:
            raise RuntimeError(f"{photon_records.watched} of {light.stats.splats} photon records were seen")
        camera_pass = CameraPass(context, light.buffers, settings.layer, light.reflectances, light.map_channels)
        try:
            view = scene.camera, settings.width, settings.height
            camera_pass.run(*view, settings.spp or 1, 0, light.caustic_maps(), settings.seed)
            picture = camera_pass.read_rgb()
            spectral = camera_pass.read_spectral() if settings.bins else None
        finally:
            camera_pass.release()
        seen = (picture, read_maps(light), *([] if spectral is None else [spectral]))
        bad = photon_records.nonfinite_photons + not_finite(seen)
        return Probe(picture.astype(float), light.stats, bad, photon_records.dropped, light.map_flux())


def read_maps(light: LightPass) -> np.ndarray:
    """All maps as they are looked up, float32 (targets, height, width, 4)."""
    width, height = light.atlas.size
    textures = light.resolved_textures()
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
    """Means of `side` × `side` pixels; what does not fill a block is left out."""
    height, width = (n // side * side for n in picture.shape[:2])
    cut = picture[:height, :width]
    return cut.reshape(height // side, side, width // side, side, -1).mean(axis=(1, 3))


def compared(found: Probe, base: Probe, picture: float, energy: float) -> Held:
    """A rendering against another of the same light, each within its bound."""
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
    """A rendering's measurement: finite, flux closed, every dropped footprint counted, little lost to numerics."""
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
    """The default method against `stochastic` (one random wavelength a photon, no spectral column) on blocks of ten
    pixels.

    Its bound is the difference between two seeds of `stochastic`, which is what chance alone makes, and 3 % of the
    picture for the kernel's tails across the blocks' borders, and `smeared`; the energy's is 3 %.
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
