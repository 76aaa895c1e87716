"""Gratings: the GLSL functions against float64, known answers through the real passes, energy, evanescent orders."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from reference import tracer
from reference.grating import diffract
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.scene_records import SCENE_STRUCTS
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.geometry.primitives import box
from spectrasplat.model.optics import catalogue
from spectrasplat.model.optics.colorimetry import VISIBLE_NM
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Grating, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.ray_paths import RayPaths
from spectrasplat.reference.optics import dot, times, unit
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.still import render
from spectrasplat.stress.rigs.camera_probe import white_furnace
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate
from spectrasplat.stress.rigs.gpu_paths import Photons, placed, screen, trace_beam

from tests.gpu.camera_rig import white_through

MERCURY_NM = (404.66, 435.83, 546.07, 576.96, 579.07)
COUNT = 4096
DISTANCE = 1.0


def sheet(grating: Grating, size: float = 1.0, normal: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> SceneObject:
    """A grating about the origin."""
    return placed("grating", screen(np.zeros(3), np.array(normal), 0.5 * size), grating)


def shone(
    gl: Context,
    grating: Grating,
    nm: float | tuple[float, float],
    direction: Sequence[float] = (0.0, 0.0, -1.0),
    around: Sequence[SceneObject] = (),
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0),
    wall: Mesh | None = None,
    **more,
) -> Photons:
    """A thin beam through the grating at the origin, onto a wall one unit behind."""
    direction = unit(np.array(direction, float))
    wall = screen(np.array([0.0, 0.0, -DISTANCE]), np.array([0.0, 0.0, 1.0]), 3.0) if wall is None else wall
    objects = [sheet(grating, normal=normal), *around]
    return trace_beam(gl, objects, None, wall, -0.4 * direction, direction, 1e-3, nm, count=64, **more)


@pytest.mark.parametrize("method", ["srd", "srd-lambda", "regular-point"])
def test_lines_of_mercury(gl: Context, method: str) -> None:
    """600 lines/mm, a wall a unit behind: each line lies where the grating equation puts it, to two millionths."""
    grating = Grating(orders=(-2, -1, 0, 1, 2), efficiency=(0.1,) * 5, direction=(0.0, 1.0, 0.0))
    for nm in MERCURY_NM:
        found = shone(gl, grating, nm, method=method)
        assert len(found.records) % 5 == 0 and len(found.records) > 0
        offset = found.position[:, 0] - found.start[:, 0]
        orders = np.rint(np.sin(np.arctan(offset)) / (nm * 6e-4)).astype(int)
        assert sorted(set(orders)) == [-2, -1, 0, 1, 2]
        told = found.records["branch_key"]
        assert len(np.unique(told)) == 5
        want = np.tan(np.arcsin(orders * nm * 6e-4))
        assert np.abs(offset - want).max() < 2e-6
        assert np.abs(found.position[:, 1] - found.start[:, 1]).max() < 2e-6


def test_orders_and_their_energy(gl: Context) -> None:
    """Every order carries its efficiency, the rest is absorbed, and so is what an evanescent order would have had."""
    grating = Grating(lines_per_mm=1200.0, orders=(-2, -1, 0, 1, 2), efficiency=(0.1, 0.2, 0.15, 0.25, 0.05))
    found = shone(gl, grating, 550.0)
    offset = found.position[:, 0] - found.start[:, 0]
    orders = np.rint(np.sin(np.arctan(offset)) / (550.0 * 1.2e-3)).astype(int)
    flux = {int(m): float(found.records["flux_w"][orders == m].sum(dtype=float)) for m in np.unique(orders)}
    assert set(flux) == {-1, 0, 1}, "sin = 1.32 for order 2"
    emitted = flux[0] / 0.15
    # The zeroth order stays together, the others are whole lattices too.
    assert flux[-1] / emitted == pytest.approx(0.2, rel=1e-5)
    assert flux[1] / emitted == pytest.approx(0.25, rel=1e-5)
    tally = found.tally
    assert tally.ended["absorbed"] / tally.emitted == pytest.approx(1.0 - 0.2 - 0.15 - 0.25, abs=2e-5)


def test_an_order_ends_inside_the_band(gl: Context) -> None:
    """2000 lines/mm: order 1 leaves up to 500 nm only; a band over 450 to 550 nm is cut there."""
    grating = Grating(lines_per_mm=2000.0, orders=(1,), efficiency=(0.8,))
    wall = screen(np.array([3.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0]), 300.0)
    found = shone(gl, grating, (450.0, 550.0), wall=wall)
    highest = found.nm[:, 2]
    assert len(highest) and np.abs(highest - 500.0).max() < 0.01
    assert np.abs(found.nm[:, 0] - 450.0).max() < 1e-3
    assert found.tally.fallbacks["band_cut"] > 0
    # A constant power over the axis (wavelength here): half of the band leaves.
    assert found.records["flux_w"].sum(dtype=float) / (0.8 * found.weight.sum()) == pytest.approx(0.5, abs=2e-3)


def test_littrow(gl: Context) -> None:
    """A reflection grating tilted so that order -1 goes straight back: 2 sin(angle) = λ / Λ."""
    nm, lines = 546.07, 1200.0
    angle = np.arcsin(0.5 * nm * 1e-6 * lines)
    normal = np.array([np.sin(angle), 0.0, np.cos(angle)])
    for order in (-1, 1):
        grating = Grating(lines, (order,), (0.9,), True, (0.0, 1.0, 0.0))
        back = screen(np.array([0.0, 0.0, 0.8]), np.array([0.0, 0.0, -1.0]), 3.0)
        found = shone(gl, grating, nm, wall=back, normal=tuple(normal))
        offset = np.abs(found.position[:, 0] - found.start[:, 0]) if len(found.records) else np.array([])
        if len(offset) and offset.max() < 1e-5:
            return
    pytest.fail("neither order comes back")


def slanted_landing(found: Photons, grating: Grating, direction: np.ndarray, nm: float, order: int) -> np.ndarray:
    """Where the beam's rays arrive (N, 3), in float64."""
    count = len(found.start)
    step = np.full(count, order * nm * 1e-6 * grating.lines_per_mm)
    lines = np.array(grating.direction)
    going = diffract(np.broadcast_to(direction, (count, 3)), np.array([0.0, 0.0, 1.0]), lines, step, False)
    at = found.start - (found.start[:, 2] / direction[2])[:, None] * direction
    return at + (-DISTANCE / going[:, 2])[:, None] * going


def test_columns_are_derivatives(gl: Context) -> None:
    """∂(landing)/∂λ of slanted beams, against the exact equation differentiated in float64."""
    rng = np.random.default_rng(3)
    for _ in range(4):
        grating = Grating(700.0, (-1, 1), (0.4, 0.4), False, tuple(rng.normal(size=3)))
        direction = unit(np.array([*rng.uniform(-0.4, 0.4, 2), -1.0]))
        nm = float(rng.uniform(420.0, 620.0))
        found = shone(gl, grating, nm, direction)
        low, middle, high = (
            {m: slanted_landing(found, grating, direction, nm + h, m) for m in (-1, 1)} for h in (-0.5, 0.0, 0.5)
        )
        near = [np.linalg.norm(found.position - middle[m], axis=1) for m in (-1, 1)]
        assert np.minimum(*near).max() < 3e-6
        slopes = {m: (high[m] - low[m]) * 1e3 for m in (-1, 1)}
        want = np.where((near[0] < near[1])[:, None], slopes[-1], slopes[1])
        got = found.dposition_dvar[:, 0]
        assert np.linalg.norm(got - want, axis=1).max() < 2e-5 * np.linalg.norm(want, axis=1).max()


def test_water_shortens_waves(gl: Context) -> None:
    """In a medium of index n an order is deflected as by waves n times shorter, and its column is 1/n of it."""
    n, nm = 1.5, 550.0
    grating = Grating(600.0, (1,), (0.8,))
    around = [placed("water", box((4.0, 4.0, 0.5)), Dielectric(constant(n)))]
    found = shone(gl, grating, nm, around=around, max_depth=3).of_depth(3)
    inside = np.arcsin(nm * 6e-4 / n)
    # A slab's far face refracts it to where it would go in air; it starts a quarter of a unit lower.
    outside = np.arcsin(nm * 6e-4)
    want = 0.25 * np.tan(inside) + (DISTANCE - 0.25) * np.tan(outside)
    offset = found.position[:, 0] - found.start[:, 0]
    straight = offset[np.abs(np.abs(offset) - want) < 1e-2]
    assert len(straight) and np.abs(np.abs(straight) - want).max() < 3e-6


FUNCTIONS = """
    ShadingFrame frame;
    frame.normal = frame.normal_g = dot(d, n) < 0.0 ? n : -n;
    frame.interpolated = frame.refused = 0u;
    GratingEvent met;
    met.grating.lines = l;
    met.grating.index = REFLECTS ? 0.0 : 1.0;
    met.side = dot(d, n) < 0.0 ? 1.0 : -1.0;
    Deflection turned = diffract_at(met, frame, d, step_);
    out_d = turned.direction;
    out_dd = diffracted_column(met, turned, d, dd, met.side * dn, step_, dstep);
    exists = turned.exists ? 1.0 : 0.0;
"""
_SCENE = {
    "SPECTRAL_GROUPS": 0,
    "SPECTRAL_SAMPLES": 2,
    "INDEX_ROW": 0,
    "GRATINGS_AT": 0,
    "OBJECTS_AT": 0,
    "TRIANGLES_AT": 0,
    "NORMALS_AT": 0,
    "TRIANGLE_COUNT": 0,
    "UNIT_SCENE": 0,
    "UNIT_SPECTRA": 1,
    "NORMAL_DERIVATIVES": 1,
    "SMOOTH_NORMALS": 1,
}


@pytest.mark.parametrize("reflects", [False, True])
def test_functions_against_float64(gl: Context, reflects: bool) -> None:
    """Directions to 1e-6; columns, with a turning normal, to 1e-5 of central differences, away from grazing."""
    rng = np.random.default_rng(11)
    normal, lines = unit(rng.normal(size=(COUNT, 3))), unit(rng.normal(size=(COUNT, 3)))
    d, step = unit(rng.normal(size=(COUNT, 3))), rng.uniform(-1.5, 1.5, COUNT)
    dn = rng.normal(size=(COUNT, 3))
    dn -= times(dot(dn, normal), normal)
    dd = rng.normal(size=(COUNT, 3))
    dd -= times(dot(dd, d), d)
    dstep = rng.normal(size=COUNT)
    inputs = {"d": d, "n": normal, "l": lines, "dd": dd, "dn": dn, "step_": step, "dstep": dstep}
    inputs = {name: as_f32(value) for name, value in inputs.items()}
    body = FUNCTIONS.replace("REFLECTS", "true" if reflects else "false")
    got = evaluate(
        gl.ctx,
        ["lib/grating.glsl"],
        body,
        inputs,
        {"out_d": "vec3", "out_dd": "vec3", "exists": "float"},
        _SCENE,
        SCENE_STRUCTS,
    )

    def exact(h: float) -> np.ndarray:
        i = inputs
        return diffract(
            unit(i["d"] + h * i["dd"]), unit(i["n"] + h * i["dn"]), i["l"], i["step_"] + h * i["dstep"], reflects
        )

    want, cosine = exact(0.0), np.abs(dot(exact(0.0), unit(inputs["n"])))
    sine = np.linalg.norm(np.cross(inputs["n"], inputs["l"]), axis=1)
    assert np.array_equal(got["exists"] > 0.0, np.isfinite(cosine)) or np.nanmin(cosine) < 1e-3
    clear = (np.nan_to_num(cosine) > 0.1) & (sine > 0.1) & (np.abs(dot(d, normal)) > 0.05)
    assert clear.sum() > COUNT // 8
    assert np.abs(got["out_d"] - want)[clear].max() < 2e-6
    h = 1e-4
    slope = (8 * (exact(h) - exact(-h)) - (exact(2 * h) - exact(-2 * h))) / (12 * h)
    error = np.linalg.norm(got["out_dd"] - slope, axis=1) / np.maximum(np.linalg.norm(slope, axis=1), 1.0)
    assert error[clear].max() < 3e-5


def test_inside_dispersive_glass_against_the_slow_tracer(gl: Context) -> None:
    """Both columns, by the glass's index and by the wavelength, through a slanted grating immersed in N-SF11."""
    nm, tilt, glass = 560.0, unit(np.array([0.2, -0.3, 1.0])), catalogue.find("N-SF11")
    grating = Grating(900.0, (-1, 0, 1), (0.3, 0.3, 0.3), False, (0.3, 1.0, 0.1))
    block, wall = box((2.0, 2.0, 1.4)), screen(np.array([0.0, 0.0, -2.0]), np.array([0.0, 0.0, 1.0]), 6.0)
    direction = unit(np.array([0.15, 0.1, -1.0]))
    objects = [sheet(grating, normal=tuple(tilt)), placed("block", block, Dielectric(glass))]
    found = trace_beam(gl, objects, None, wall, -1.2 * direction, direction, 0.02, nm, count=32).of_depth(3)
    assert found.dposition_dvar.shape[1] == 2
    corners = [mesh.corners() for mesh in (block, screen(np.zeros(3), tilt, 0.5), wall)]
    scene = tracer.TriangleList(np.concatenate(corners), np.repeat([0, -2, -1], [len(c) for c in corners]))
    lines = np.array(grating.direction)

    def path(start: np.ndarray, order: int, more_um: float = 0.0, more_n: float = 0.0) -> tracer.Path:
        step = order * grating.lines_per_mm * 1e-3 * (nm * 1e-3 + more_um)
        bodies = [tracer.Body(float(glass.index(nm)) + more_n), tracer.Body(kind="grating", lines=lines, step=step)]
        return tracer.follow(tracer.make_ray(start, direction), scene, [*bodies, tracer.Body(kind="receiver")])

    matched = 0
    for order in grating.orders:
        for k, start in enumerate(found.start):
            exact = path(start, order)
            if not exact.landed or np.linalg.norm(exact.ray.position - found.position[k]) > 1e-3:
                continue
            matched += 1
            assert np.linalg.norm(exact.ray.position - found.position[k]) < 1e-5
            # Groups are in the order of the objects: the grating's wavelength first.
            for column, more in enumerate(("more_um", "more_n")):
                want = tracer.central_difference(lambda x, m=more, at=(start, order): path(*at, **{m: x}), 1e-4)
                assert np.abs(found.dposition_dvar[k, column] - want).max() < 3e-5 * max(np.abs(want).max(), 1.0)
    assert matched > 60


@pytest.mark.slow
@pytest.mark.parametrize("lines", [1500.0, 1700.0, 2000.0, 2400.0])
def test_the_camera_sees_an_order_end_at_its_wavelength(gl: Context, lines: float) -> None:
    """White all round, seen straight through order 1: all up to λ = Λ, nothing beyond."""
    camera = Camera((0, 0, 2), (0, 0, 0), (0, 1, 0), "orthographic", vertical_extent=0.5)
    scene = white_furnace(sheet(Grating(lines, (1,), (0.8,)), 4.0), camera=camera)
    settings = RenderSettings(width=24, height=16, spp=64)
    picture = render(scene, settings, context=gl).rgb.mean(axis=(0, 1))
    # Half a nanometre on either side belongs to each value of the spectrum.
    through = np.clip(1e6 / lines - VISIBLE_NM + 0.5, 0.0, 1.0)
    assert np.abs(picture - 0.8 * white_through(through)).max() < 0.015


def test_all_orders_of_white_are_white(gl: Context) -> None:
    """Seen in a white furnace every order that leaves adds its efficiency, whatever its colours do."""
    camera = Camera((0, 0, 2), (0.3, 0, 0), (0, 1, 0), vertical_fov_deg=30.0)
    scene = white_furnace(sheet(Grating(250.0, (-2, -1, 0, 1, 2), (0.1, 0.2, 0.3, 0.2, 0.1)), 6.0), camera=camera)
    picture = render(scene, RenderSettings(width=24, height=16, spp=64), context=gl).rgb
    assert np.abs(picture.mean(axis=(0, 1)) - 0.9).max() < 2e-3
    assert np.abs(picture - 0.9).max() < 1e-5


def test_picking_follows_the_strongest_order(gl: Context) -> None:
    """Each wavelength of a single ray goes where that order goes."""
    grating = Grating(600.0, (-1, 0, 1), (0.2, 0.3, 0.4))
    wall = placed("wall", screen(np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0]), 3.0), Diffuse())
    scene = Scene("pick", Camera((0, 0, 9), (0, 0, 0), up=(0, 1, 0)), (), (sheet(grating), wall))
    buffers = scene_buffers(gl, scene, RenderSettings())
    paths = RayPaths(gl, buffers)
    try:
        nm = np.array(MERCURY_NM)
        start = np.tile([0.01, 0.02, 0.5], (len(nm), 1))
        found = paths.trace(start, np.tile([0.0, 0.0, -1.0], (len(nm), 1)), nm, 1.0)
    finally:
        paths.release()
        buffers.release()
    ends = np.array([path.points[-1] for path in found])
    assert np.abs(ends[:, 0] - 0.01 - np.tan(np.arcsin(nm * 6e-4))).max() < 2e-6
