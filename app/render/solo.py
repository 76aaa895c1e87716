"""The light of one wavelength only: spectra and scenes as they are seen through a narrow window."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model.optics.colorimetry import VISIBLE_NM
from ..model.optics.spectrum import Spectrum
from ..model.scene import Camera, Scene

SOLO_WIDTH_NM = 4.0
"""Standard deviation of the window that a single wavelength is seen through."""
SOLO_GAIN_NM = 100.0
"""A continuous spectrum is shown as bright as if so many nanometres of it had this wavelength."""


def solo(spectrum: Spectrum, wavelength_nm: float) -> Spectrum:
    """The part of `spectrum` about one wavelength; a continuum is shown as bright as `SOLO_GAIN_NM` of it, a line as
    itself."""
    window = np.exp(-0.5 * ((VISIBLE_NM - wavelength_nm) / SOLO_WIDTH_NM) ** 2)
    density = spectrum.density * window * (SOLO_GAIN_NM / window.sum())
    lines = tuple(
        (nm, power * float(np.exp(-0.5 * ((nm - wavelength_nm) / SOLO_WIDTH_NM) ** 2))) for nm, power in spectrum.lines
    )
    return Spectrum(density, lines)


def solo_scene(scene: Scene, wavelength_nm: float | None) -> Scene:
    """`scene` as seen in the light of one wavelength: lights narrowed, the background dark; itself for
    None."""
    if wavelength_nm is None:
        return scene
    lights = tuple(replace(light, spectral_power=solo(light.spectral_power, wavelength_nm)) for light in scene.lights)
    return replace(scene, lights=lights, background_rgb=(0.0, 0.0, 0.0), environment=None)


def scene_seen(scene: Scene, camera: Camera, solo_nm: float | None) -> Scene:
    """`scene` as `camera` sees it, with the light of one wavelength only where `solo_nm` says so."""
    return replace(solo_scene(scene, solo_nm), camera=camera)
