"""`spectrasplat bench-speed`: how fast the stages are on this machine, against what was promised.

Ratios are measured side by side in one run, since these machines are noisy; absolute figures
are quoted with the renderer's name. Not a test: nothing fails here.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..base.errors import UserError
from ..features.features import Features
from ..gpu.context import Context, create_context
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.shader import recorded
from ..model.geometry import primitives_round
from ..model.geometry.bvh import build_bvh
from ..model.geometry.primitives import plane
from ..model.lights import PointLight
from ..model.optics.catalogue import find
from ..model.optics.glass import constant
from ..model.optics.spectrum import illuminant
from ..model.scene import (
    Camera,
    Dielectric,
    Diffuse,
    Scene,
    SceneObject,
)
from ..model.settings import RenderSettings
from ..passes.emission_domain import emission_domain
from ..passes.trace import Band, LatticeSlice, TracePass
from ..render.device_scene import spectral_axis
from . import splat_speed
from .machine import clocks, compile_line, copied_bytes_per_second
from .programs import unique

TRIANGLES = 81_920
LATTICE = {True: 1 << 16, False: 1 << 20}
"""Photons in flight at a time, by whether the processor draws: a GPU traces fewer in the time that starting takes."""
REPEATS = 5
MEMORY_PHOTONS = 1_000_000
BLENDED_BYTES = 32
"""Of an RGBA32F texel that is added to: read and written."""


def run(is_short: bool = False) -> Iterator[str]:
    """One line a figure, as each is measured. `is_short`: only what is measured in this process, with few splats."""
    with create_context() as context:
        yield f"machine               {context.renderer}, OpenGL {context.version}, {context.vendor}"
        if known := clocks():
            yield f"clocks                {known}"
        with recorded() as programs:
            dispersive, plain = _trace_rates(context)
        yield f"compiled              {compile_line(unique(programs))}"
        yield (
            f"trace, 3 columns      {dispersive / 1e6:.3f} M photons/s through {TRIANGLES} triangles   (promised 0.40 "
            "on a 2-core llvmpipe)"
        )
        yield (
            f"spectral column       adds {100 * (plain / dispersive - 1):.1f} % to the trace   (promised at most 15 %)"
        )
        figures = splat_speed.measure(context.ctx, pixels=64, count=1 << (13 if is_short else 16))
        yield (
            f"splats at 64 texels   {figures['splat_m_per_s']:.2f} M/s swept XYZ, {figures['ratio']:.2f} of plain "
            "Gaussians"
        )
        yield f"                      {figures['draw_ratio']:.2f} of them once footprints are known   (promised 0.70)"
        fragments = 64e6 * figures["draw_m_per_s"]
        blended, copied = fragments * BLENDED_BYTES, copied_bytes_per_second(context)
        word = "adding" if context.splats.by_compute else "blending"
        yield (
            f"{word:<22}{fragments / 1e9:.3f} G fragments/s, {blended / 1e9:.1f} GB/s read and written, "
            f"{100 * blended / copied:.0f} % of the {copied / 1e9:.1f} GB/s that copying memory reaches"
        )
    yield f"tree                  {_tree_seconds():.3f} s for {TRIANGLES} triangles   (promised 0.5)"
    if is_short:
        return
    seconds = _warm_start_seconds()
    yield f"first picture         {seconds:.2f} s after process start, default scene   (promised 3)"
    resident, picture_seconds = _resident_bytes()
    yield (
        f"resident memory       {resident / 2**20:.0f} MiB at 1280×720 with 1 M photons in {picture_seconds:.1f} s   "
        "(promised below 1024)"
    )


def _ball(dispersive: bool) -> Scene:
    """A smooth glass ball over a table, lit from above."""
    glass = find("N-SF11") if dispersive else constant(find("N-SF11").n_d)
    ball = primitives_round.sphere(1.0, triangles=TRIANGLES)
    lifted = np.eye(4)
    lifted[2, 3] = 2.0
    light = PointLight("lamp", illuminant("D65").scaled_to_luminous(100.0), position=(1.0, 0.5, 6.0))
    objects = (SceneObject("ball", ball, Dielectric(glass), lifted), SceneObject("table", plane(10.0, 10.0), Diffuse()))
    return Scene("ball", Camera((0.0, -6.0, 4.0), (0.0, 0.0, 1.0)), (light,), objects)


def _trace_rates(context: Context) -> tuple[float, float]:
    """Photons a second with the spectral column and without; measured in turns, the best of each."""
    runs, lattice = [], LATTICE[context.is_software]
    for dispersive in (True, False):
        scene = _ball(dispersive)
        settings = RenderSettings()
        features = Features.of(scene, settings)
        buffers = SceneBuffers(context.ctx, scene, features, spectral_axis(scene, features))
        trace = TracePass(context, features, buffers, lattice, settings.max_depth)
        domain = emission_domain(
            scene.lights[0], scene, buffers.space, buffers.space.to_gpu(buffers.world_meshes[0].corners())
        )
        assert domain is not None
        lattice_slice = LatticeSlice(0, (Band(0.0, 1.0, 0.5, 1.0),), lattice, 0, 1, lattice, (0, 0), (0, 0), 0, 1)
        runs.append((trace, lattice_slice, domain))
    best = [0.0, 0.0]
    for repeat in range(REPEATS + 1):
        for i, (trace, lattice_slice, domain) in enumerate(runs):
            context.finish()
            started = time.perf_counter()
            batch = trace.run(lattice_slice, domain)
            context.finish()
            if repeat:  # the first run compiles
                best[i] = max(best[i], batch.emitted_photons / (time.perf_counter() - started))
    for trace, _, _ in runs:
        trace.release()
    return best[0], best[1]


def _tree_seconds() -> float:
    """Time of a build, not of a lookup in the cache: the ball is turned a little each time."""
    corners = primitives_round.sphere(1.0, triangles=TRIANGLES).corners()
    times = []
    for repeat in range(3):
        angle = time.time() % 1.0 + repeat
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        turned = (corners @ turn.T).astype(np.float32)
        started = time.perf_counter()
        build_bvh(turned)
        times.append(time.perf_counter() - started)
    return min(times)


def _render_command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "spectrasplat", "render", *arguments]


def _succeed(command: list[str]) -> str:
    """Run; what it wrote to stdout. Raises `UserError` with the end of its stderr where it fails."""
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise UserError(f"{' '.join(command[2:5])} ended with {done.returncode}: {done.stderr.strip()[-500:]}")
    return done.stdout


def _warm_start_seconds() -> float:
    """Process start to the first picture of the default scene, second time round (caches are warm)."""
    with tempfile.TemporaryDirectory() as folder:
        command = _render_command("default", "-o", str(Path(folder) / "first.png"), "--photons", "32k", "--spp", "1")
        times = []
        for _ in range(3):
            started = time.perf_counter()
            _succeed(command)
            times.append(time.perf_counter() - started)
        return min(times[1:])


def _resident_bytes() -> tuple[int, float]:
    """Peak resident memory of a 1280×720 rendering with 1 M photons, and its seconds."""
    script = (
        "import resource, sys\n"
        "from spectrasplat.__main__ import main\n"
        "code = main(sys.argv[1:])\n"
        "print('peak', resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)\n"
        "sys.exit(code)\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        arguments = [
            "render",
            "default",
            "-o",
            str(Path(folder) / "m.png"),
            "--size",
            "1280x720",
            "--photons",
            str(MEMORY_PHOTONS),
        ]
        started = time.perf_counter()
        written = _succeed([sys.executable, "-c", script, *arguments])
        seconds = time.perf_counter() - started
    peak = next(line for line in written.splitlines() if line.startswith("peak "))
    return int(peak.split()[1]) * 1024, seconds
