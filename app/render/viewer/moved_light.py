"""The light of a scene while something in it is held and moved: photons traced anew for every place.

Programs, spectral tables, the division of photons and the tiles of the maps stay those of the scene that was built, or
first moved; only places differ. What is built when the drag ends replaces all of it.
"""

from __future__ import annotations

import time
from dataclasses import replace

import moderngl
import numpy as np

from ...base.generators import finished
from ...features.features import Features
from ...gpu import shader
from ...gpu.context import Context
from ...model.geometry.mesh import Mesh
from ...model.scene import Scene
from ...passes.emission_domain import EmissionDomain, emission_domain
from ...passes.footprint import Photons, SplatSpectra
from ...passes.landings import ChosenLandings
from ...passes.lattice_slice import every
from ...passes.map_layout import MapLayout
from ...passes.moving_layout import followed
from ...passes.trace import Batch, Sent
from ..light_maps import LightMaps
from ..light_pass import LightPass
from ..light_plan import LightPlan
from ..shown_spectra import PassTables
from .frame_plan import FramePlan

SECONDS = 0.05
"""What tracing and splatting should take where the processor draws."""
FIRST_PHOTONS, FEWEST, MOST = 1 << 12, 1 << 11, 1 << 20
MOST_PARTS = 64
DEPTH = 8
"""Specular events; what comes after them is for when things are still."""


class MovedLight:
    """Owns maps of photons. `light_pass` must be the one whose buffers are moved (`SceneBuffers.move`)."""

    def __init__(self, context: Context, light_pass: LightPass, features: Features) -> None:
        """`features`: of the maps, which hold colour only."""
        self._context, self._light_pass, self._features = context, light_pass, features
        self.photons = FIRST_PHOTONS
        self._plans: list[LightPlan] | None = None
        self._tables: PassTables | None = None
        self._boxes: list[Mesh] = []
        """About objects, each in its own frame."""
        self._sent: list[Sent] = []
        """Batches of the frame before."""
        self._parts, self._overflows = 1, False
        self._landed = ChosenLandings(context.ctx, light_pass.trace.photon)
        self._scene: Scene | None = None
        """Whose light the maps hold."""
        self._side = 1.0
        self.maps: LightMaps | None = None

    def follow(self, scene: Scene, widening: float = 1.0, plan: FramePlan | None = None) -> LightMaps:
        """Photons through `scene`, with footprints so much wider, in maps that are fitted to where those of the frame
        before have landed. Without a `plan` there are as many as took about `SECONDS` before."""
        started = time.perf_counter()
        # What found no room was not drawn. The next batch is given more; where that does not help, they become smaller.
        before, self._overflows = self._overflows, bool(sum(sent.batch().overflow for sent in self._sent))
        self._parts = min(2 * self._parts, MOST_PARTS) if before and self._overflows else self._parts
        self._sent.clear()
        wished, depth, side = (self.photons, DEPTH, 1.0) if plan is None else (plan.photons, plan.depth, plan.side)
        photons = _steady(wished)
        plans = self._plans_for(scene)
        if self._scene is None:
            self._trace(plans, FIRST_PHOTONS, depth, None, widening)
        maps = self._fitted(scene, side)
        maps.clear()
        self._trace(plans, photons, depth, maps, widening)
        maps.photon_weight = float(photons)
        took = time.perf_counter() - started
        if plan is None and not self._context.traits.work_is_queued:  # else it says nothing
            self.photons = int(np.clip(wished * np.clip(SECONDS / max(took, 1e-4), 0.5, 2.0), FEWEST, MOST))
        return maps

    def _trace(self, plans: list[LightPlan], photons: int, depth: int, maps: LightMaps | None, widening: float) -> None:
        """Trace about so many photons into `maps`, and choose some of them."""
        light_pass, trace = self._light_pass, self._light_pass.trace
        pieces, parts = [], [plan.part(light_pass.settings.seed, 0, photons) for plan in plans]
        rounds = trace.rounds(parts) * self._parts
        for j in range(rounds):
            rest = every(rounds, j, parts)
            while rest:
                some, rest = trace.fill(rest, trace.batch)
                pieces.append(some)

        def landed(number: int, count: int, held: tuple[moderngl.Buffer, int] | None = None) -> None:
            self._landed.choose(trace.photons, count, held, number, len(pieces))
            if maps is not None:
                assert self._tables is not None
                tables, shown, smoothing = self._tables.preview, light_pass.shown, light_pass.smoothing * widening
                spectra = SplatSpectra(shown.variables, tables.tables, shown.gains, tables.reindex)
                with self._context.timers.timing("splat"):
                    photons = Photons(trace.photons, count, held=held)
                    maps.splatter.run(photons, spectra, maps.atlas, maps.receivers, smoothing)

        for number, some in enumerate(pieces):

            def kept(batch: Batch, _: bool, number: int = number) -> None:
                landed(number, batch.photons)

            with self._context.timers.timing("trace"):
                sent = trace.send(some, depth)
            if sent is None:
                finished(trace.whole(some, kept, depth))
            else:
                self._sent.append(sent)
                landed(number, sent.most, sent.held)

    def _fitted(self, scene: Scene, side: float) -> LightMaps:
        """Maps for what was chosen of the last photons: those that there are, unless a curved receiver has moved."""
        light_pass, landings = self._light_pass, self._landed.read()
        layout: MapLayout | None = None
        if self.maps is not None and self._scene is not None and side == self._side:
            pairs = enumerate(zip(self._scene.objects, scene.objects, strict=True))
            moved = {i for i, (a, b) in pairs if a.object_to_world is not b.object_to_world}
            layout = followed(self.maps.layout, scene, light_pass.buffers, landings, moved)
        self._scene, self._side = scene, side
        if layout is None or self.maps is None or not self.maps.follow(layout):
            shader.release(self.maps)
            layout = light_pass.layout_about(landings, light_pass.fit.preview(side))
            self.maps = LightMaps(self._context.ctx, layout, self._features)
        return self.maps

    def _plans_for(self, scene: Scene) -> list[LightPlan]:
        """Divided as at first, from where lights and glass are now."""
        light_pass = self._light_pass
        if self._plans is None:
            self._plans = finished(light_pass.sample_plans(FIRST_PHOTONS))
            limits = {plan.index: [(b.x_lo, b.x_hi) for b in plan.bands] for plan in self._plans}
            self._tables = PassTables(light_pass.shown, [limits.get(i, [(0.0, 1.0)]) for i in range(len(scene.lights))])
            self._boxes = [_box(item.mesh) for item in scene.objects]
        boxes = [replace(item, mesh=box) for item, box in zip(scene.objects, self._boxes, strict=True)]
        space, specular = light_pass.buffers.space, [b.world_vertices[_SIDES] for b in boxes if b.material.is_specular]
        triangles = space.to_gpu(np.concatenate(specular)) if specular else np.zeros((0, 3, 3))
        boxed = replace(scene, objects=tuple(boxes))
        domains: dict[int, EmissionDomain | None] = {
            plan.index: emission_domain(scene.lights[plan.index], boxed, space, triangles) for plan in self._plans
        }
        return [replace(p, domain=d) for p in self._plans if (d := domains[p.index]) is not None]

    def release(self) -> None:
        """Free everything."""
        shader.release(self.maps, self._landed)
        if self._tables is not None:
            self._tables.forget()


def _steady(photons: int) -> int:
    """About so many, of a few numbers only: each has orders of emission of its own."""
    return int(2.0 ** (np.floor(2.0 * np.log2(max(photons, 2))) / 2.0))


def _box(mesh: Mesh) -> Mesh:
    """A box about it, in its own frame: a ray that meets the mesh meets the sides."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return Mesh("box", np.where(np.indices((2, 2, 2)).reshape(3, 8).T, high, low), _SIDES)


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
