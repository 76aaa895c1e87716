"""The light of a scene while something in it is held and moved: a few photons, traced anew for every place.

Programs, spectral tables and the division of photons stay those of the scene that was built; only their places
differ. What is built when the drag ends replaces all of it.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...base.generators import finished
from ...gpu import shader
from ...model.scene import Scene, SceneObject
from ...passes.emission_domain import EmissionDomain, emission_domain
from ...passes.pilot import Pilot, landings_of
from ..light_maps import LightMaps
from ..photon_batches import traced_besides
from ..shown_spectra import PassTables
from .photon_store import PhotonStore

if TYPE_CHECKING:
    from ...features.features import Features
    from ...gpu.context import Context
    from ..light_pass import LightPass
    from ..light_plan import LightPlan
    from .frame_plan import FramePlan

SECONDS = 0.05
"""What tracing and splatting should take."""
FIRST_PHOTONS, FEWEST, MOST = 1 << 12, 1 << 11, 1 << 20
DEPTH = 8
"""Specular events; what comes after them is for when things are still."""
_BYTES = 64 << 20


class MovedLight:
    """Owns the photons and their maps. `light_pass` must be the one whose buffers are moved (`SceneBuffers.move`)."""

    def __init__(self, context: Context, light_pass: LightPass, features: Features) -> None:
        """`features`: of the maps, which hold colour only."""
        self._context, self._light_pass, self._features = context, light_pass, features
        self.photons = FIRST_PHOTONS
        self._plans: list[LightPlan] | None = None
        self._tables: PassTables | None = None
        self._store = PhotonStore(context.ctx, _BYTES)
        self.maps: LightMaps | None = None

    def follow(self, scene: Scene, widening: float = 1.0, plan: FramePlan | None = None) -> LightMaps:
        """Photons through `scene`, in maps that are fitted to where they land, with footprints so much wider. Without a
        `plan` there are as many as took about `SECONDS` before."""
        light_pass, started = self._light_pass, time.perf_counter()
        photons, depth = (self.photons, DEPTH) if plan is None else (plan.photons, plan.depth)
        plans = self._plans_for(scene)
        self._store.clear()
        tracing = traced_besides(light_pass.trace, light_pass.settings.seed, plans, photons, self._store.keep, depth)
        with self._context.timers.timing("trace"):
            for _ in tracing:
                pass
        slabs = self._store.of_rounds(0, self._store.rounds)
        records = self._store.read(len(slabs) and 1 << 30, light_pass.trace.photon.dtype)
        layout = light_pass.layout_about(
            landings_of([Pilot(1, records, [], [])]), light_pass.fit.preview(1.0 if plan is None else plan.side)
        )
        shader.release(self.maps)
        self.maps = LightMaps(self._context.ctx, layout, self._features)
        self.maps.clear()
        assert self._tables is not None
        for slab in slabs:
            for _ in light_pass.splat_steps(slab.buffer, slab.count, widening, self._tables.preview, self.maps):
                pass
        self.maps.photon_weight = float(photons)
        took = time.perf_counter() - started
        if plan is None:
            self.photons = int(np.clip(photons * np.clip(SECONDS / max(took, 1e-4), 0.5, 2.0), FEWEST, MOST))
        return self.maps

    def _plans_for(self, scene: Scene) -> list[LightPlan]:
        """Divided as at first, from where lights and glass are now."""
        light_pass = self._light_pass
        if self._plans is None:
            self._plans = finished(light_pass.sample_plans(FIRST_PHOTONS))
            limits = {plan.index: [(b.x_lo, b.x_hi) for b in plan.bands] for plan in self._plans}
            self._tables = PassTables(light_pass.shown, [limits.get(i, [(0.0, 1.0)]) for i in range(len(scene.lights))])
        boxes = [_box(o) for o in scene.objects if o.material.is_specular]
        triangles = light_pass.buffers.space.to_gpu(np.concatenate(boxes)) if boxes else np.zeros((0, 3, 3))
        domains: dict[int, EmissionDomain | None] = {
            plan.index: emission_domain(scene.lights[plan.index], scene, light_pass.buffers.space, triangles)
            for plan in self._plans
        }
        return [replace(p, domain=d) for p in self._plans if (d := domains[p.index]) is not None]

    def release(self) -> None:
        """Free everything."""
        self._store.clear()
        shader.release(self.maps)
        if self._tables is not None:
            self._tables.forget()


def _box(item: SceneObject) -> np.ndarray:
    """The sides of the object's own box as triangles (12, 3, 3) in the world: a ray that meets the object meets
    them."""
    low, high = item.mesh.vertices.min(axis=0), item.mesh.vertices.max(axis=0)
    corners = np.where(np.indices((2, 2, 2)).reshape(3, 8).T, high, low)
    corners = corners @ item.object_to_world[:3, :3].T + item.object_to_world[:3, 3]
    return corners[_SIDES]


_SIDES = np.array(
    [
        [0, 1, 3],
        [0, 3, 2],
        [4, 5, 7],
        [4, 7, 6],
        [0, 1, 5],
        [0, 5, 4],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 3, 7],
        [1, 7, 5],
    ]
)
"""Corners of a box, numbered by their bits, x first."""
