"""What a page may show a caustic by: the lights' spectra, and glasses whose indices its data hold."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...edit.presets import light_presets
from ...features.facts import dispersive_glasses
from ...features.features import Features
from ...model.optics import catalogue
from ...model.optics.colorimetry import VISIBLE_NM
from ...model.optics.glass import Dispersion, with_gain
from ...model.optics.spectrum import Spectrum, illuminant
from ...model.scene import Scene
from ...model.settings import RenderSettings

GAIN_MAX = 2.0
"""Gains of the scene's own dispersion up to which a page holds its light."""
CHOICES = 6
"""Glasses of other dispersion that are offered."""
_LIKE = 0.02
"""Largest difference of n_d from the scene's glass."""
_APART = 0.02
"""Least relative difference of two glasses' V_d."""
_FIRST_NM = 400.0
"""Fits that begin later say too little of violet light."""
_LAMPS = ("Sodium lamp", "Mercury lamp")


def offered_spectra() -> dict[str, Spectrum]:
    """Spectra that a reader may choose, relative, by name."""
    standard = {"Daylight (D65)": "D65", "Incandescent (A)": "A", "White LED": "LED-B3"}
    found = {title: illuminant(name) for title, name in standard.items()}
    lamps = {preset.name: preset.value for preset in light_presets()}
    return found | {name: Spectrum(lines=lamps[name]) for name in _LAMPS}  # type: ignore[arg-type]  # they have lines


@dataclass(frozen=True)
class Glasses:
    """The glass of a page: what the scene has, what is traced, what may be shown."""

    own: Dispersion | None
    """The one whose index tells where light lands; None: it lands by wavelength, through each glass as it is."""
    traced: Dispersion | None
    """`own` with the widest dispersion that may be shown."""
    others: tuple[Dispersion, ...] = ()
    """From the catalogue, of indices that `traced` has, by falling V_d."""

    @classmethod
    def of(cls, scene: Scene) -> Glasses:
        """What a page of `scene` holds."""
        settings = RenderSettings(editable=True, any_view=True)
        found = dispersive_glasses(scene)
        if not Features.of(scene, settings).reindexed or len(found) != 1:
            return cls(None, None)
        traced = with_gain(found[0], GAIN_MAX * found[0].gain)
        return cls(found[0], traced, others_like(found[0], traced))

    def widened(self, scene: Scene) -> Scene:
        """`scene` as it is traced: through the wider glass, in the light of all wavelengths."""
        daylight = illuminant("D65")
        lights = tuple(
            replace(light, spectral_power=daylight.scaled_to_luminous(light.spectral_power.luminous()))
            if light.spectral_power.luminous() > 0.0
            else light
            for light in scene.lights
        )
        objects = tuple(
            replace(item, material=item.material.changed(dispersion=self.traced))
            if self.own is not None and item.material.dispersion == self.own
            else item
            for item in scene.objects
        )
        return replace(scene, lights=lights, objects=objects)


def others_like(own: Dispersion, traced: Dispersion) -> tuple[Dispersion, ...]:
    """Catalogue glasses of about the n_d of `own`, evenly over their V_d, whose indices `traced` has."""
    ends = np.array([VISIBLE_NM[0], VISIBLE_NM[-1]])
    high, low = traced.index(ends)
    held: dict[float, Dispersion] = {}
    for glass in sorted((entry.dispersion for entry in catalogue.entries()), key=lambda g: abs(g.n_d - own.n_d)):
        if abs(glass.n_d - own.n_d) > _LIKE:
            break
        if not glass.is_dispersive or glass.range_nm[0] > _FIRST_NM or glass.range_nm[1] < VISIBLE_NM[-1]:
            continue
        blue, red = glass.index(ends)
        if blue <= high and red >= low and all(abs(glass.V_d / known - 1.0) > _APART for known in (own.V_d, *held)):
            held[glass.V_d] = glass
    values = sorted(held, reverse=True)
    chosen = {round(i) for i in np.linspace(0, len(values) - 1, CHOICES)} if values else set()
    return tuple(held[values[i]] for i in sorted(chosen))
