"""How fast splats are drawn, against the plainest Gaussians of the same size on the same device.

Both draw the same parallelograms from the same photon records. The plain ones are one colour, sampled at texel
centres, and skip everything that makes a caustic right; their rate is what the rasteriser itself allows.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..features.features import Features
from ..gpu import shader
from ..gpu.records import RECEIVER, photon_record
from ..gpu.splat_tables import SplatTables
from ..gpu.tiles import pack
from ..model.optics import spectrum
from ..model.optics.spectral_tables import SpectralAxis
from ..passes.footprint import Photons, SpectralVariables, SplatSpectra
from ..passes.map_atlas import MapAtlas, placement_rows
from ..passes.splat import Splatter

if TYPE_CHECKING:
    import moderngl

_FEATURES = Features(spectral_groups=1, band_cuts=True)
_SIDE = 768
_ROUNDS = 5
_REACH = 3.0
"""Standard deviations from the middle of a splat to its edge."""


def measure(ctx: moderngl.Context, pixels: float, count: int = 1 << 17) -> dict[str, float]:
    """Rates for splats that cover `pixels` texels each, twice as long as wide.

    Returns M splats/s by wall clock: `splat_m_per_s` (footprint pass and all), `draw_m_per_s` (from finished splat
    records), `plain_m_per_s`, the best of a few rounds taken in turn; and the ratios of splat and of draw to plain,
    `ratio` and `draw_ratio`. On a software renderer these compare processor time, which other work on the
    machine disturbs less.
    """
    tiles, size = pack([(_SIDE, _SIDE)])
    rows = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    atlas = MapAtlas(ctx, size, placement_rows(tiles[0], rows, 1.0))
    tables = SplatTables.build(ctx, SpectralAxis.build([]), [spectrum.illuminant("D65")], [None], [[(0.0, 1.0)]])
    splatter = Splatter(ctx, _FEATURES)
    receivers = ctx.buffer(RECEIVER.zeros(1))
    variable = SpectralVariables.build(ctx, np.linspace(0.0, 1.0, 1025)[None])
    swept, still = (ctx.buffer(_photons(pixels, count, sweep)) for sweep in (True, False))
    plain = _Plain(ctx, count, size)

    def splat() -> None:
        splatter.run(Photons(swept, count), SplatSpectra(variable, tables), atlas, receivers, 1.0)

    def draw() -> None:
        for _ in range(-(-count // splatter.group)):
            splatter.draw(tables, atlas)

    software = "llvmpipe" in ctx.info["GL_RENDERER"]
    seconds, work = _best(ctx, {"splat": splat, "plain": lambda: plain.run(still, atlas), "draw": draw})
    shader.release(atlas, tables, splatter, receivers, variable, swept, still, plain)
    cost = work if software else seconds
    drawn = -(-count // splatter.group) * min(count, splatter.group)
    return {
        "splat_m_per_s": count / seconds["splat"] / 1e6,
        "draw_m_per_s": drawn / seconds["draw"] / 1e6,
        "plain_m_per_s": count / seconds["plain"] / 1e6,
        "ratio": cost["plain"] / cost["splat"],
        "draw_ratio": cost["plain"] / cost["draw"] * drawn / count,
    }


def _best(ctx: moderngl.Context, jobs: dict[str, Callable[[], None]]) -> tuple[dict[str, float], dict[str, float]]:
    """Shortest wall time and shortest processor time of each job, s; the first round only warms up."""
    wall, work = dict.fromkeys(jobs, np.inf), dict.fromkeys(jobs, np.inf)
    for round_number in range(_ROUNDS + 1):
        for name, job in jobs.items():
            ctx.finish()
            start, start_work = time.perf_counter(), time.process_time()
            job()
            ctx.finish()
            if round_number:
                wall[name] = min(wall[name], time.perf_counter() - start)
                work[name] = min(work[name], time.process_time() - start_work)
    return wall, work


def _photons(pixels: float, count: int, sweep: bool) -> np.ndarray:
    """Splats of one size at random places and angles; swept, or Gaussians as long as those with their sweep."""
    rng = np.random.default_rng(1)
    sigma = np.sqrt(pixels / 2.0) / (2.0 * _REACH)
    margin = 2.0 * np.sqrt(pixels)
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    records = photon_record(_FEATURES.spectral_groups).zeros(count)
    records["position"][:, :2] = rng.uniform(margin, _SIDE - margin, (count, 2))
    records["dposition_ds"][:, :2] = along * sigma * (1.0 if sweep else 2.0)
    records["dposition_dt"][:, :2] = np.stack([-along[:, 1], along[:, 0]], axis=1) * sigma
    records["dposition_dvar0"][:, :2] = along * (2.0 * _REACH * sigma)
    records["x_hi"], records["x_anchor"] = 1.0, 0.5
    records["throughput"], records["flux_w"] = 1.0, 1.0
    return records


class _Plain:
    """The yardstick: one colourless Gaussian a photon."""

    def __init__(self, ctx: moderngl.Context, count: int, size: tuple[int, int]) -> None:
        self._ctx = ctx
        self._count = count
        structs = (photon_record(_FEATURES.spectral_groups),)
        self._program = shader.program(ctx, "bench/plain_gaussian.vert", "bench/plain_gaussian.frag", {}, structs)
        self._program["atlas_size"] = size
        corners = np.array([0, 1, 2, 2, 1, 3], np.uint32) + 4 * np.arange(count, dtype=np.uint32)[:, None]
        self._indices = ctx.buffer(corners)
        self._draw = ctx.vertex_array(self._program, [], index_buffer=self._indices)

    def run(self, photons: moderngl.Buffer, atlas: MapAtlas) -> None:
        import moderngl

        photons.bind_to_storage_buffer(0)
        atlas.framebuffer.use()
        self._ctx.enable_only(moderngl.BLEND)
        self._ctx.blend_func = moderngl.ONE, moderngl.ONE
        self._draw.render(moderngl.TRIANGLES, vertices=6 * self._count)
        self._ctx.enable_only(moderngl.NOTHING)

    def release(self) -> None:
        shader.release(self._draw, self._program, self._indices)
