"""The light pass's first two stages: a batch of lattice points becomes photon records.

`emit` fills the queue, then rays are followed from surface to surface: one event after the other of all rays
(`ray_queue`), or several of each at a time (`ray_pool`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace

import moderngl
import numpy as np

from ..base.generators import finished
from ..features.features import Features
from ..features.program_switches import switched
from ..gpu import bindings, records, shader
from ..gpu.context import Context
from ..gpu.device_traits import DeviceTraits
from ..gpu.scene_buffers import UNBOUNDED, SceneBuffers
from ..gpu.scene_records import SCENE_STRUCTS
from .emission_domain import EmissionDomain
from .lattice_slice import LatticeSlice, Parts, block_of, block_orders, morton_order, points_of
from .light_programs import light_defines
from .ray_pool import STRUCTS as POOL_STRUCTS
from .ray_pool import RayPool
from .ray_queue import FLIGHT_ROOM, PHOTON_ROOM, Followed, OrderedQueue, QueueParts
from .ray_queue import STRUCTS as QUEUE_STRUCTS

SPLIT_THRESHOLD = 0.3
"""Share of a photon's power below which roulette decides whether a part of it is followed."""
_GROUP = 64
MORE_PHOTONS = 1.25
"""Photons that there is room for, over those that the last batch of the same light left for as many points."""
_MAX_ORDERS = 8
"""Emission orders kept, a light: a pass has one for its batches and one for its last, shorter one."""
_MOST_POINTS = 65535 * _GROUP
"""Points of a slice that one dispatch emits, at most."""


@dataclass
class FluxTally:
    """Where flux went, W, in float64; `merge` adds batches. What a path carries counts by its throughput over its band
    (`carried_w` in trace.comp), as it is drawn, not by what its anchor has left."""

    emitted: float = 0.0
    carried_on: float = 0.0
    """What photons carried on that beams had left (`beam_emission`), besides what lights emitted; less what beams left,
    where both are counted."""
    left_to_beams: float = 0.0
    """What photons of the emission lattice left to beams (`without_beams`)."""
    ended: dict[str, float] = field(default_factory=lambda: dict.fromkeys(records.CATEGORIES, 0.0))
    roulette: float = 0.0
    fallbacks: dict[str, int] = field(default_factory=lambda: dict.fromkeys(records.FALLBACKS, 0))

    def merge(self, other: FluxTally) -> None:
        """Add another batch."""
        self.emitted += other.emitted
        self.carried_on += other.carried_on
        self.left_to_beams += other.left_to_beams
        self.roulette += other.roulette
        for name in self.ended:
            self.ended[name] += other.ended[name]
        for name in self.fallbacks:
            self.fallbacks[name] += other.fallbacks[name]

    @property
    def without_beams(self) -> FluxTally:
        """As if lights had not emitted what photons left to beams: those count it themselves."""
        left = self.ended["beams"]
        return replace(
            self,
            emitted=self.emitted - left,
            left_to_beams=self.left_to_beams + left,
            ended=self.ended | {"beams": 0.0},
        )

    @property
    def imbalance(self) -> float:
        """|emitted + carried on − all that ended − roulette's balance|, as a share of emitted + carried on."""
        started = self.emitted + self.carried_on
        return abs(started - sum(self.ended.values()) - self.roulette) / started if started else 0.0


def queue_class(traits: DeviceTraits) -> type[OrderedQueue | RayPool]:
    """How a device holds rays between two events."""
    return RayPool if traits.ray_events else OrderedQueue


@dataclass(frozen=True)
class Batch:
    """What one batch left in the photon buffer."""

    photons: int
    emitted_photons: int
    tally: FluxTally
    steps: int
    """Dispatches that had a ray."""
    flights: int
    """Stretches of all rays, up to what they meet."""
    overflow: int
    """Rays, photons and flights that found no room. What carries their light is gone: only fewer points at once bring
    it back (`TracePass.whole`)."""

    @property
    def fullness(self) -> float:
        """Share of the room for photons that lattice points which fill a batch take up."""
        return self.photons / (PHOTON_ROOM * max(self.emitted_photons, 1))


@dataclass(frozen=True)
class Sent:
    """A batch that is traced without being waited for. Its photons are drawn by a number that the device knows: none of
    those of a batch that has to be traced again."""

    most: int
    """Photons that it leaves at most."""
    held: tuple[moderngl.Buffer, int]
    """Buffer, and offset in bytes, where a uint says how many are to be drawn."""
    batch: Callable[[], Batch]
    """What became of it; waits for the device. To be called once."""


WIDEST_TURN = 1.4
"""Radians times the sixth root of the photons, the bandwidth of a density in the plane [Silverman 1986]: how far the
directions of a footprint may differ behind a surface."""
CARRIED_ON_POINTS = 2e4
"""What rays count as that carry on what beams left, whose number is not known where they are traced."""
WIDEST_SWEEP = 0.5
"""How far a ray's direction may change over its band, radians, for its spectral columns to be believed: without a bound
some light misses all maps."""
NARROWEST_LANDING = 1 / 128
"""Part of the spectrum: a narrower band is not cut where its wavelengths meet different surfaces."""
WIDEST_ON_SURFACE = 0.06
"""As a share of an object's size (half of its bounds' diagonal): the longest side of a footprint on it, and of what a
lamp's other points add, where the lattice's own spacing is not longer."""


class TracePass:
    """Owns the programs and queue buffers of emission and tracing; `photons` is the output buffer."""

    def __init__(
        self,
        context: Context,
        features: Features,
        scene: SceneBuffers,
        batch: int,
        max_depth: int,
        split_threshold: float = SPLIT_THRESHOLD,
        widest_on_surface: float = WIDEST_ON_SURFACE,
    ) -> None:
        """`widest_on_surface`: `UNBOUNDED` where columns are wanted as derivatives, whatever is believed of them."""
        self.context = context
        self.scene = scene
        self.batch = batch
        self.max_depth = max_depth
        self.rays_traced = 0
        """Rays emitted since this pass was made, pilots and all."""
        self.split_threshold = split_threshold
        self.widest_on_surface = widest_on_surface
        # Derivatives are wanted as they are.
        packs = context.traits.packs_records and widest_on_surface < UNBOUNDED
        traits = self._traits = replace(context.traits, packs_records=packs)
        self.ray = records.ray_record_of(features, packs)
        self._parameters = records.trace_parameters(len(scene.scene.objects))
        shared = max(1, min(len(scene.scene.lights), context.limits.uniform_block_bytes // self._parameters.stride))
        self._lights = shared if context.traits.ray_events else 1
        """Lights whose rays are traced together: whose parameters a uniform block holds."""
        self.photon = records.photon_record_of(features, packs)
        ctx = context.ctx
        structs = (
            *(*SCENE_STRUCTS, self.ray, self.photon, *(POOL_STRUCTS if context.traits.ray_events else QUEUE_STRUCTS)),
            *([records.FLIGHT] if features.flights else []),
        )
        defines = light_defines(features, context.traits) | scene.defines | {"LIGHTS": f"{self._lights}u"}
        self._features = features
        self._defines = defines
        self._structs = structs
        self._emission: dict[tuple[str, bool], moderngl.ComputeShader] = {}
        self._orders: dict[tuple[int, ...], moderngl.Buffer] = {}
        self._reports: list[moderngl.Buffer] = []
        self._photons_a_ray: dict[tuple[int, ...], float] = {}
        """Room that batches of some lights are given, as the last one needed it."""
        self._trace = shader.compute(ctx, "light/trace.comp", defines, (*structs, self._parameters))
        self._queue = queue_class(traits)(QueueParts(context, traits, features, defines, structs, batch))
        self.photons, self.emitted_rays = self._queue.photons, self._queue.rays
        self.flights = ctx.buffer(reserve=FLIGHT_ROOM * batch * records.FLIGHT.stride) if features.flights else None
        """What every ray of the last batch flew, in order, where the features have it: FLIGHT records."""
        self._emit_parameters = ctx.buffer(reserve=records.EMIT_PARAMETERS.stride)
        self._trace_parameters = ctx.buffer(reserve=self._lights * self._parameters.stride)

    def release_buffers(self) -> None:
        """Free the queue: nothing is traced any more."""
        self._queue.release_buffers()

    def release(self) -> None:
        """Free every buffer and program."""
        shader.release(
            self._queue,
            self._emit_parameters,
            self._trace_parameters,
            self._trace,
            *self._emission.values(),
            *self._orders.values(),
            *self._reports,
            *([] if self.flights is None else [self.flights]),
        )

    @property
    def has_footprints(self) -> bool:
        """Photons stand for what is round them."""
        return self._features.footprints

    @property
    def bytes(self) -> int:
        """Device memory that the queue takes while photons are traced."""
        return self._queue.bytes_of(self._features, self._traits, self.batch)

    def run(self, piece: LatticeSlice, domain: EmissionDomain, max_depth: int | None = None) -> Batch:
        """Trace `piece.count` ≤ batch lattice points; their photons replace the buffer's content.

        `max_depth`: specular events, by default the pass's own."""
        return finished(self.steps([(piece, domain)], max_depth))

    def whole(
        self,
        parts: Parts,
        keep: Callable[[Batch, bool], None],
        max_depth: int | None = None,
        split_threshold: float | None = None,
    ) -> Generator[None, None, None]:
        """`steps` of `parts` in as many batches as they need; `keep` takes each while its photons are there, and
        whether it is the last."""
        most = self.batch
        while parts:
            some, rest = self.fill(parts, most)
            batch = yield from self.steps(some, max_depth, split_threshold)
            if batch.overflow and points_of(some) > 1:
                most = self.rays_of(some) // 2
                continue
            keep(batch, not rest)
            parts = rest

    def fill(self, parts: Parts, most: int) -> tuple[Parts, Parts]:
        """The front of `parts`, about `most` rays that are traced together, and the rest."""
        some: list[tuple[LatticeSlice, EmissionDomain]] = []
        room = float(most)
        for number, (piece, domain) in enumerate(parts):
            if some and piece.light // self._lights != some[0][0].light // self._lights:
                return some, parts[number:]
            rays = self._rays_a_point(piece, domain)
            points = min(piece.points, max(int(room / rays), 0 if some else 1), _MOST_POINTS // piece.lattices)
            room -= points * rays
            front, behind = piece.split(points)
            some += [(front, domain)] if points else []
            if behind.points:
                return some, [(behind, domain), *parts[number + 1 :]]
        return some, []

    def rounds(self, parts: Parts) -> int:
        """How many batches share all points evenly between them, so that the rays of each batch are traced
        together."""
        batches: dict[int, float] = {}
        for piece, domain in parts:
            held = max(int(self.batch / self._rays_a_point(piece, domain)), 1)
            together = piece.light // self._lights
            batches[together] = batches.get(together, 0.0) + piece.points / held
        return max((math.ceil(count) for count in batches.values()), default=0)

    def rays_of(self, parts: Parts) -> int:
        """About how many rays `parts` emit."""
        return math.ceil(sum(piece.points * self._rays_a_point(piece, domain) for piece, domain in parts))

    def _rays_a_point(self, piece: LatticeSlice, domain: EmissionDomain) -> float:
        # In a pool points from which none sets out take no room.
        return piece.lattices * (domain.active_share if self._traits.ray_events else 1.0)

    def steps(
        self, parts: Parts, max_depth: int | None = None, split_threshold: float | None = None
    ) -> Generator[None, None, Batch]:
        """`run` of parts that go together (`fill`), pausing after every event of all rays, on a GPU after all of them;
        a caller that draws meanwhile may bind what it likes. `split_threshold`: by default the pass's own."""
        max_depth = self.max_depth if max_depth is None else min(max_depth, self.max_depth)
        self._queue.begin(self.rays_of(parts))
        self._emit(parts, max_depth, split_threshold or self.split_threshold)
        return self._learned(parts, (yield from self._follow(max_depth)))

    def _learned(self, parts: Parts, batch: Batch) -> Batch:
        self._photons_a_ray[tuple(piece.light for piece, _ in parts)] = (
            MORE_PHOTONS * batch.photons / max(batch.emitted_photons, 1)
        )
        return batch

    @property
    def _photon_room(self) -> int:
        return self.photons.size // self.photon.stride

    def send(self, parts: Parts, max_depth: int | None = None) -> Sent | None:
        """`steps` without waiting; None where rays are counted after every event."""
        queue, rays = self._queue, self.rays_of(parts)
        if not isinstance(queue, RayPool):
            return None
        most = self._photon_room
        if (photons_a_ray := self._photons_a_ray.get(tuple(piece.light for piece, _ in parts))) is not None:
            most = min(most, int(photons_a_ray * rays) + _GROUP)
        queue.begin(rays, most)
        self._emit(parts, min(max_depth or self.max_depth, self.max_depth), self.split_threshold)
        queue.send(self._trace, self._bind)
        report = self._reports.pop() if self._reports else self.context.ctx.buffer(reserve=queue.state.size)
        self.context.ctx.copy_buffer(report, queue.state)

        def batch() -> Batch:
            self._reports.append(report)
            return self._learned(parts, self._batch_of(queue.counted(report)))

        return Sent(most, (queue.state, records.POOL_STATE.offset("drawn")), batch)

    def _emit(self, parts: Parts, max_depth: int, split_threshold: float) -> None:
        if (rays := self.rays_of(parts)) > self.batch:
            raise ValueError(f"{rays} rays in a batch of {self.batch}")
        if any(piece.beam_objects for piece, _ in parts) and not self._features.beams:
            raise ValueError("objects are left to beams, and the programs were made without them")
        self._set_parameters({part[0].light: self._parameters_of(*part, max_depth, split_threshold) for part in parts})
        self.scene.bind()
        self._emit_parameters.bind_to_storage_buffer(bindings.PARAMETERS)
        for piece, domain in parts:
            self._emit_parameters.write(self._emission_of(piece, domain).tobytes())
            order, first, count = self.order(piece)
            order.bind_to_storage_buffer(bindings.INDICES, 4 * first, 4 * count)
            self._emit_program(domain).run(-(-piece.count // _GROUP))
            self._queue.emitted(piece.count)

    def carry_on(self, rays: np.ndarray, light: int, split_threshold: float) -> Generator[None, None, Batch]:
        """`steps` for `rays` of one light that are on their way already: records (n,) of `ray` with n ≤ `batch`. Their
        flux counts as carried on."""
        count = len(rays)
        if count > self.batch:
            raise ValueError(f"{count} rays in a batch of {self.batch}")
        self._queue.load(rays)
        self._set_parameters({light: self._carried_on(light, self.max_depth, split_threshold)})
        batch = yield from self._follow(self.max_depth)
        batch.tally.carried_on = float(rays["flux_w"].sum(dtype=float))
        return batch

    def _follow(self, max_depth: int) -> Generator[None, None, Batch]:
        # Walking through covered surfaces, cutting bands and all but one of a grating's orders take steps without
        # being events.
        limit = (2 + self.scene.most_orders) * max_depth + 32
        return self._batch_of((yield from self._queue.follow(self._trace, self._bind, limit, self._end_all)))

    def _batch_of(self, found: Followed) -> Batch:
        self.context.check("tracing photons")
        self.rays_traced += found.emitted
        tally = FluxTally(found.emitted_w, roulette=found.roulette_w)
        tally.ended = dict(zip(records.CATEGORIES, found.ended_w, strict=True))
        tally.ended["absorbed"] += found.absorbed_w
        tally.fallbacks = dict(zip(records.FALLBACKS, found.fallbacks, strict=True))
        tally.fallbacks["queue_overflow"] += found.overflow
        overflow = found.overflow
        if self.flights is not None:
            overflow += max(0, found.flights - FLIGHT_ROOM * self.batch)
        return Batch(found.photons, found.emitted, tally, found.steps, found.flights, overflow)

    def _end_all(self) -> None:
        self._trace_values["max_depth"] = 0
        self._trace_parameters.write(self._trace_values.tobytes())

    def _bind(self) -> None:
        self.scene.bind()
        self._trace_parameters.bind_to_uniform_block(bindings.PARAMETERS)
        if self.flights is not None:
            self.flights.bind_to_storage_buffer(bindings.FLIGHTS)

    def _emission_of(self, piece: LatticeSlice, domain: EmissionDomain) -> np.ndarray:
        p = records.EMIT_PARAMETERS.zeros(1)
        p["origin"], p["axis"], p["tangent"], p["bitangent"] = (
            domain.origin,
            domain.axis,
            domain.tangent,
            domain.bitangent,
        )
        p["weight"] = domain.measure * piece.weight * piece.stands_for / (piece.lattice_count * piece.light_points)
        p["spacing"] = domain.spacing(piece.lattice_count)
        p["back"] = domain.back
        p["light_axis"] = np.asarray(self.scene.scene.lights[piece.light].direction, float)
        p["profile"] = self.scene.profile_start(self.scene.scene.lights[piece.light])
        p["light_u"], p["light_v"], p["aperture_centre"] = domain.light_u, domain.light_v, domain.aperture_centre
        p["is_disc"] = domain.is_disc
        p["rect"] = domain.rect
        p["cone"] = domain.cone
        p["bands"][0, : len(piece.bands)] = [(b.x_lo, b.x_hi, b.x_anchor, b.power_w) for b in piece.bands]
        p["band_count"], p["light_points"] = len(piece.bands), piece.light_points
        p["shift"], p["shift_light"], p["shift_spectral"] = piece.shift, piece.shift_light, piece.shift_spectral
        p["seed"], p["first"], p["count"], p["lattice_count"] = (
            piece.seed,
            piece.first,
            piece.count,
            piece.lattice_count,
        )
        p["light_place"] = piece.light_place
        p["light"], p["stride"] = piece.light, piece.stride
        p["mask"] = np.packbits(domain.mask.ravel(), bitorder="little").view("<u4")
        if domain.thinned is not None:
            p["thinned"] = np.packbits(domain.thinned.ravel(), bitorder="little").view("<u4")
        p["thinned_chance"] = domain.thinned_chance
        p["lamp_step"] = piece.lamp_step
        if (length := math.hypot(*piece.row)) > 0.0:
            gain = (math.hypot(1.0, length) - 1.0) / length**2
            s, t = piece.row
            p["row_s"], p["row_t"], p["row_st"] = gain * s * s, gain * t * t, gain * s * t
        return p

    def _parameters_of(
        self, piece: LatticeSlice, domain: EmissionDomain, max_depth: int, threshold: float
    ) -> np.ndarray:
        p = self._carried_on(piece.light, max_depth, threshold)
        p["lattices"] = piece.lattices
        if piece.lattice_count < 1 << (32 - records.LATTICE_BIT) and piece.stands_for == 1:
            p["lattice_bits"] = piece.lattice_count << records.LATTICE_BIT
        paths = piece.lattice_count * piece.lattices * domain.active_share
        p["paths"], p["widest_turn"] = paths, self._widest_turn(paths)
        if piece.keeps_bands:
            p["widest_sweep"] = p["narrowest_landing"] = UNBOUNDED
        p["lattice_shift"] = piece.shift[1]
        p["surface_key"] = p["tint_key"] = piece.seed
        p["lattices_together"] = 1 if self._features.spectral_groups else len(piece.bands)
        bits = np.zeros(p["beam_objects"].size * 32, bool)
        bits[list(piece.beam_objects)] = True
        p["beam_objects"] = np.packbits(bits, bitorder="little").view("<u4").reshape(p["beam_objects"].shape)
        return p

    def _set_parameters(self, of_lights: dict[int, np.ndarray]) -> None:
        self._trace_values = self._parameters.zeros(self._lights)
        for light, values in of_lights.items():
            self._trace_values[light % self._lights] = values[0]
        self._trace_parameters.write(self._trace_values.tobytes())

    def _widest_turn(self, photons: float) -> float:
        """Radians a side, in a pass of so many photons of a light."""
        return WIDEST_TURN * max(photons, 1.0) ** (-1.0 / 6.0) if self.widest_on_surface < UNBOUNDED else UNBOUNDED

    def _carried_on(self, light: int, max_depth: int, split_threshold: float) -> np.ndarray:
        p = self._parameters.zeros(1)
        p["max_depth"], p["split_threshold"], p["lattices"] = max_depth, split_threshold, 1
        p["lattices_together"], p["widest_on_surface"] = 1, self.widest_on_surface
        p["paths"], p["widest_turn"] = CARRIED_ON_POINTS, self._widest_turn(CARRIED_ON_POINTS)
        is_bounded = self.widest_on_surface < UNBOUNDED
        p["widest_sweep"] = WIDEST_SWEEP if is_bounded else UNBOUNDED
        p["narrowest_landing"] = NARROWEST_LANDING if is_bounded else UNBOUNDED
        p["power_row"] = self.scene.layout.power_row + light * max(1, self._features.tint_levels)
        p["tint_row"] = self.scene.tint_row
        if self.scene.tint_levels is not None:
            p["tint_rate"] = self.scene.tint_levels.rate / self.scene.space.scale
            p["tint_halfway"] = self.scene.tint_halfway[light]
        return p

    def order(self, piece: LatticeSlice) -> tuple[moderngl.Buffer, int, int]:
        """The order in which `piece` is emitted, uint32: where it begins, and of how many points it is; made by the
        processor where it is a new one. In a pool of rays it is of one block of points after the other, as another
        number of points asks for no other order then."""
        pooled = isinstance(self._queue, RayPool)
        key = (piece.stride,) if pooled else (piece.points, piece.stride, piece.lattice_count)
        if key not in self._orders:
            if len(self._orders) >= _MAX_ORDERS * max(1, len(self.scene.scene.lights)):
                self._orders.pop(next(iter(self._orders))).release()
            self._orders[key] = self.context.ctx.buffer(block_orders(*key) if pooled else morton_order(*key))
        block = block_of(piece.points)
        return (self._orders[key], block, block) if pooled else (self._orders[key], 0, piece.points)

    def _emit_program(self, domain: EmissionDomain) -> moderngl.ComputeShader:
        variant = domain.kind, domain.thinned is not None
        if variant not in self._emission:
            kind, is_thinned = variant
            own = switched(**{f"LIGHT_{kind.upper()}": True}, THINNED_CELLS=is_thinned)
            self._emission[variant] = shader.compute(
                self.context.ctx, "light/emit.comp", self._defines | own, (*self._structs, records.EMIT_PARAMETERS)
            )
        return self._emission[variant]
