"""What a rendering samples, and how finely: chosen here for stills, frames, bakes, comparisons and the viewer alike."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..model.scene import Camera, Scene
from ..model.settings import RenderSettings, camera_method_of
from ..passes.camera import CameraPass
from ..passes.caustic_maps import CausticMaps
from ..passes.spectrum_choice import MAX_BANDS, MIN_SAMPLES, SAMPLES_A_BAND, Spectrum

DEFAULT_SAMPLES = 16
"""Camera samples a pixel."""
CAUSTIC_SAMPLES = 64
"""Camera samples of a picture of the caustic alone, where outlines in front of a focus make half of the error and only
they take more than two lookups."""
LIVE_BANDS_FOR = 16
"""Samples whose error the viewer's number of bands is fitted to: not all that a still picture gets in the end, since it
should be complete within seconds."""

SURVEY = 1e-3
"""Threshold of the search that finds which objects beams carry, and what they cost."""
MOVING_COARSEST, MOVING_FINEST = 2e-3, 1e-5
"""Largest and smallest threshold in motion; a coarser search takes hardly less time."""


@dataclass
class MovingBeams:
    """How fine beams are while something is dragged: as fine as their time allows. One value for all light passes of a
    live rendering."""

    threshold: float = SURVEY

    def learn(self, took: float, seconds: float) -> None:
        """A search and its drawing took `took` seconds. The threshold keeps its value where they are nearly as wanted:
        at another one other beams would survive roulette."""
        if not 0.5 * seconds <= took <= 1.2 * seconds:
            self.threshold = float(
                np.clip(self.threshold * np.clip(took / seconds, 0.5, 2.0), MOVING_FINEST, MOVING_COARSEST)
            )


@dataclass(frozen=True)
class LightSampling:
    """What the light pass traces."""

    photons: int
    seconds: float | None
    """As many photons as this time allows, where it is given."""
    seed: int

    @staticmethod
    def of(scene: Scene, settings: RenderSettings) -> LightSampling:
        """The scene's own number where `settings` say nothing."""
        return LightSampling(settings.photons or scene.render.photons, settings.seconds, settings.seed)


@dataclass(frozen=True)
class CameraSampling:
    """How camera rays sample pixels and the spectrum."""

    budget: int = DEFAULT_SAMPLES
    """Samples a pixel, each of one band of the spectrum."""
    may_be_single: bool = True
    """Where bands serve a scene badly, wavelengths may be taken one by one, by a program of their own."""
    bands_for: int | None = None
    """Samples whose error the number of bands is fitted to; None: all."""
    whole_spectrum: bool = False
    """Every sample sees all of the spectrum, whatever the method: for what is seen directly alone one band is exact."""

    @staticmethod
    def of(settings: RenderSettings) -> CameraSampling:
        """For pictures that are waited for."""
        return CameraSampling(settings.spp or (CAUSTIC_SAMPLES if settings.layer == "caustic" else DEFAULT_SAMPLES))

    @staticmethod
    def live(samples: int) -> CameraSampling:
        """For a picture that is shown while it is made: no second program is compiled for it."""
        return CameraSampling(samples, may_be_single=False, bands_for=LIVE_BANDS_FOR)

    def fixed_bands(self, camera_pass: CameraPass) -> int | None:
        """Bands of the spectrum that nothing has to be found out for; None where the picture decides."""
        if self.whole_spectrum or not camera_pass.disperses or camera_pass.scene.features.random_wavelength:
            return 1
        return camera_pass.fixed_bands

    def choosing(
        self, camera_pass: CameraPass, camera: Camera, width: int, height: int, maps: CausticMaps | None
    ) -> Iterator[float]:
        """Set `camera_pass.spectrum` to what leaves the least error in this picture, pausing after every dispatch. For
        every picture anew: what it becomes must not depend on what was rendered before it."""
        if self.whole_spectrum:
            camera_pass.spectrum = Spectrum()
            return
        camera_pass.may_be_single = self.may_be_single
        yield from camera_pass.choosing_spectrum(camera, width, height, self.bands_for or self.budget, maps)

    def samples(self, camera_pass: CameraPass) -> int:
        """Samples a pixel in the way chosen: whole cycles, so that every band has its turn equally often, of as many
        bands as could have been chosen. Frames that choose differently have as many samples then, and what does not
        move in them stays."""
        spectrum = camera_pass.spectrum
        if spectrum.single:
            return spectrum.samples(self.budget)
        bands = spectrum.bands
        if camera_pass.chooses and not self.whole_spectrum:
            bands = max(most_bands(self.bands_for or self.budget), camera_pass.least_bands)
        return whole_cycles(self.budget, bands)


def most_bands(samples: int) -> int:
    """The largest number of bands that `choosing_spectrum` may choose for so many samples."""
    if samples < MIN_SAMPLES:
        return 1
    return min(1 << ((samples // SAMPLES_A_BAND).bit_length() - 1), MAX_BANDS)


def whole_cycles(samples: int, bands: int) -> int:
    """`samples`, or a few more, in which each of `bands` has its turn equally often."""
    return samples + -samples % bands


def camera_settings(settings: RenderSettings) -> RenderSettings:
    """`settings` with the camera's own method, where it has one."""
    method = settings.camera_method or settings.method
    return replace(settings, method=camera_method_of(method))


def has_own_method(settings: RenderSettings) -> bool:
    """Whether the camera's rays follow another method than the light's, and so need programs and tables of their
    own."""
    return (settings.camera_method or settings.method) != settings.method
