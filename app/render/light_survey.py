"""What is found out about a scene's light before anything is deposited: where it starts, where it lands, and what of it
goes as beams.

The pilot is a few thousand photons per light, traced at several wavelengths. It says where light lands (so the maps
are fitted before anything is deposited) and how far the spectral columns are from the reference (so the spectrum is cut
into as few bands as that error allows).
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import TYPE_CHECKING

import numpy as np

from ..gpu import shader
from ..passes.emission_domain import EmissionDomain, emission_domain
from ..passes.guided_emission import guided
from ..passes.pilot import Pilot, landings_of, pilot_steps, split_threshold

if TYPE_CHECKING:
    from ..features.features import Features
    from ..gpu.context import Context
    from ..gpu.scene_buffers import SceneBuffers
    from ..model.scene import Scene
    from ..passes.landings import Landings
    from ..passes.trace import TracePass
    from .beam_light import BeamLight
    from .light_plan import Division
    from .map_fit import MapFit
    from .sampling import MovingBeams
    from .shown_spectra import ShownSpectra


class LightSurvey:
    """Pilots of one scene, and its beams."""

    def __init__(
        self,
        context: Context,
        scene: Scene,
        features: Features,
        buffers: SceneBuffers,
        trace: TracePass,
        shown: ShownSpectra,
        division: Division,
        moving: MovingBeams | None,
    ) -> None:
        """`moving`: see `LightPass`."""
        self.buffers = buffers
        self.domains: dict[int, EmissionDomain] = {}
        """Domains of lights that may meet glass or mirrors."""
        self.pilots: dict[int, Pilot] = {}
        """Pilots of those; empty where beams carry everything and maps are fitted to them."""
        self.tells_lattices = False
        """Pilots say how lattices of photons are to be divided; else beams draw all but what is weak."""
        self.beam_light: BeamLight | None = None
        """Also where it has found that beams do not pay."""
        self._sample_pilots: dict[int, Pilot] = {}
        """Pilots that only `sample_pilots` needs."""
        self._context = context
        self._scene = scene
        self._features = features
        self._trace = trace
        self._shown = shown
        self._division = division
        self._moving = moving

    # ---- once for a scene --------------------------------------------------------------------

    def steps(self) -> Iterator[str | None]:
        """Find out everything, pausing often with what it is at (None: as before)."""
        self.domains = self._domains()
        if self._features.beams and self.domains:
            from .beam_light import SEARCHING, BeamLight

            yield SEARCHING
            self.beam_light = BeamLight(
                self._context,
                self._scene,
                self.buffers,
                self._shown,
                self._trace.max_depth,
                in_thread=self._moving is not None,
            )
            yield None
            yield from self.beam_light.surveying(self._moving)
            yield "following the first photons"
        if self._moving is None or not self.only_beams:
            # Photons that carry on what is weak take any part of the spectrum.
            beams = self.beams if self.only_beams and self._features.band_cuts else None
            self.tells_lattices = beams is None or beams.leaves_strong
            self.pilots = yield from self._pilot_steps(for_maps=not self.tells_lattices)

    def _domains(self) -> dict[int, EmissionDomain]:
        space = self.buffers.space
        specular = [
            space.to_gpu(m.corners())
            for m, o in zip(self.buffers.world_meshes, self._scene.objects, strict=True)
            if o.material.is_specular
        ]
        triangles = np.concatenate(specular) if specular else np.zeros((0, 3, 3))
        found = {i: emission_domain(li, self._scene, space, triangles) for i, li in enumerate(self._scene.lights)}
        return {i: domain for i, domain in found.items() if domain is not None}

    def _pilot_steps(self, *, for_maps: bool = False) -> Generator[str | None, None, dict[int, Pilot]]:
        pilots: dict[int, Pilot] = {}
        spectral = bool(self._features.spectral_groups) or self._features.point_spectrum
        for i, domain in self.domains.items():
            yield None
            # Radiant power of the whole spectrum per unit weight, W.
            power_w = float(self.buffers.light_power[i].band(0.0, 1.0)[3])
            pilots[i] = yield from pilot_steps(
                self._trace, self._scene, i, domain, power_w, spectral, for_maps=for_maps
            )
        if not (for_maps or self._division.counts):
            # Frames of an animation have to agree about it.
            self._trace.split_threshold = split_threshold(pilots.values())
            self.domains = {i: guided(domain, pilots[i]) for i, domain in self.domains.items()}
        return pilots

    def sample_pilots(self) -> Generator[str | None, None, dict[int, Pilot]]:
        """Pilots also where beams carry everything."""
        if self.tells_lattices:
            return self.pilots
        self._sample_pilots = self._sample_pilots or (yield from self._pilot_steps())
        return self._sample_pilots

    # ---- what was found ----------------------------------------------------------------------

    def landings(self, fit: MapFit) -> dict[int, Landings]:
        """Where the light lands that maps of `fit` are for, by receiver."""
        if self.beam_light is not None and not self.pilots:
            return self.beam_light.landings()
        return landings_of(fit.landings(list(self.pilots.values()), self.buffers.space))

    @property
    def lit_receivers(self) -> list[int]:
        """Receivers that pilot photons landed on."""
        return sorted(landings_of(self.pilots.values()))

    @property
    def beams(self) -> BeamLight | None:
        """What finds and draws beams; None where there are none."""
        return self.beam_light if self.has_beams else None

    @property
    def has_beams(self) -> bool:
        """Beams carry part of the light."""
        return self.beam_light is not None and bool(self.beam_light.carried)

    @property
    def only_beams(self) -> bool:
        """No light needs photons but for what beams leave to them."""
        return self.has_beams and all(self.is_carried(i) for i in self.domains)

    def is_carried(self, light: int) -> bool:
        """Beams carry all of a light, in a scene that was searched for them: no photon is needed at its first
        surface."""
        assert self.beam_light is not None
        carried = self.beam_light.carried.get(light, ())
        return all(i in carried for i, item in enumerate(self._scene.objects) if item.material.is_specular)

    def release(self) -> None:
        """Free everything."""
        shader.release(self.beam_light)
