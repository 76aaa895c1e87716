"""While something is held and moved, every picture shows it where it stands, lit by a few photons through the glass
there; let go, it is traced as if it had always stood there."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.glass import set_dispersion_gain
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.edit.objects import add_dabs
from spectrasplat.edit.projection import View
from spectrasplat.gpu import shader
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.device_traits import Budget
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Dab, Dielectric, Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.camera_records import camera_parameters
from spectrasplat.passes.first_surfaces import FirstSurfaces
from spectrasplat.passes.ray_paths import RayPaths
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.viewer import rehearsal
from spectrasplat.render.viewer.engine import LiveEngine
from spectrasplat.render.viewer.invalidation import only_moves
from spectrasplat.render.viewer.live_light import LiveLight

SIZE = (120, 68)
SETTINGS = RenderSettings(width=SIZE[0], height=SIZE[1], batch=8192, any_view=True, editable=True)


def shipped(name: str) -> Scene:
    return load_scene(assets_dir() / "scenes" / f"{name}.toml")


def inputs(scene: Scene) -> LiveInputs:
    return LiveInputs(scene, scene.camera, *SIZE)


def glass_of(scene: Scene) -> int:
    return next(i for i, o in enumerate(scene.objects) if isinstance(o.material, Dielectric))


def moved(scene: Scene, step: float, turn_deg: float = 0.0, index: int | None = None) -> Scene:
    """Its glass, or object `index`, turned about the vertical and carried along x by `step`."""
    index = glass_of(scene) if index is None else index
    a = np.radians(turn_deg)
    turn = np.eye(4)
    turn[:2, :2] = (np.cos(a), -np.sin(a)), (np.sin(a), np.cos(a))
    turn[0, 3] = step
    objects = list(scene.objects)
    objects[index] = replace(objects[index], object_to_world=turn @ objects[index].object_to_world)
    return replace(scene, objects=tuple(objects))


@pytest.fixture
def engine(gl: Context) -> Iterator[LiveEngine]:
    made = LiveEngine(gl, Budget(8192, 1 << 12, 1 << 14, 1 << 24))
    made.target_photons = 1 << 13
    yield made
    made.release()


def picture(engine: LiveEngine) -> np.ndarray:
    texture = engine.picture
    return np.frombuffer(texture.read(), np.float32).reshape(texture.height, texture.width, 4)[..., :3].astype(float)


def settled(engine: LiveEngine, scene: Scene) -> np.ndarray:
    engine.set(inputs(scene))
    for _ in range(2000):
        engine.advance(0.05)
        if engine.is_idle:
            return picture(engine)
    raise AssertionError("it took too long")


def coarse(rgb: np.ndarray) -> np.ndarray:
    """Means over about 8×8 blocks of a picture of this shape."""
    rows, columns = (np.linspace(0, side, side // 8, endpoint=False).astype(int) for side in rgb.shape[:2])
    sums = np.add.reduceat(np.add.reduceat(rgb, rows, axis=0), columns, axis=1)
    counts = np.diff([*rows, rgb.shape[0]])[:, None] * np.diff([*columns, rgb.shape[1]])[None, :]
    return sums / counts[..., None]


@pytest.mark.parametrize("name", ["prism", "wine_glass"])  # half-spaces, and a tree
def test_moved_buffers_are_hit_where_fresh_ones_are(gl: Context, name: str) -> None:
    scene = shipped(name)
    after = moved(scene, 0.2, 25.0)
    buffers, fresh = scene_buffers(gl, scene, SETTINGS), scene_buffers(gl, after, SETTINGS)
    assert buffers.move(after)
    tracers = RayPaths(gl, buffers), RayPaths(gl, fresh)
    try:
        view = View.of(after.camera, SIZE[0] / SIZE[1])
        rays = [view.ray(x, y) for x in np.linspace(0.05, 0.95, 12) for y in np.linspace(0.05, 0.95, 8)]
        starts, ways = (np.array(each) for each in zip(*rays, strict=True))
        paths = [tracer.trace(starts, ways, np.full(len(rays), 550.0), 1.0) for tracer in tracers]
        for a, b in zip(*paths, strict=True):
            assert a.points.shape == b.points.shape and np.allclose(a.points, b.points, atol=1e-3)
        assert sum(len(a.points) > 2 for a in paths[0]) > 2
    finally:
        for owned in (*tracers, buffers, fresh):
            owned.release()


@pytest.mark.parametrize("name", ["prism", "ball_plain"])
def test_a_few_photons_carry_the_light_of_the_moved_glass(gl: Context, name: str) -> None:
    scene = shipped(name)
    after = moved(scene, 0.1, 15.0)
    light, fresh = (LiveLight(gl, s, SETTINGS, 64 << 20) for s in (scene, after))
    try:
        for each in (light, fresh):
            each.light_pass.prepare()
            each.light_pass.begin(1 << 14, 1)
        maps = light.move(after)
        assert maps is not None
        for _ in fresh.light_pass.pass_steps(0, 1 << 14):
            pass
        wanted = fresh.light_pass.maps.flux() * fresh.light_pass.maps.scale
        assert maps.flux() * maps.scale == pytest.approx(wanted, rel=0.15)
    finally:
        light.release()
        fresh.release()


def test_every_frame_of_a_drag_shows_where_things_stand(engine: LiveEngine) -> None:
    scene = shipped("prism")
    before = settled(engine, scene)
    seen, versions = [], []
    for step in range(1, 5):
        wanted = inputs(moved(scene, 0.1 * step, 5.0 * step))
        engine.set(wanted)
        engine.advance(0.05, interacting=True)
        assert engine.inputs is wanted and engine.stats.differs == "moved"
        versions.append(engine.picture_version)
        seen.append(picture(engine))
    assert len(set(versions)) == 4, "a new picture for every step"
    still = settled(engine, wanted.scene)
    assert engine.stats.differs == ""
    # Light and glass are where they will be, not where they were.
    there, here = (float(np.abs(coarse(seen[-1]) - coarse(other)).mean()) for other in (still, before))
    assert there < 0.5 * here, (there, here)


@pytest.mark.slow
def test_back_where_it_was_all_is_traced_afresh(engine: LiveEngine) -> None:
    """What was accumulated before a drag must not be shown, nor added to, in moved buffers."""
    scene = shipped("prism")
    before = settled(engine, scene)
    engine.set(inputs(moved(scene, 0.3)))
    engine.advance(0.05, interacting=True)
    engine.set(inputs(scene))
    engine.advance(0.05, interacting=True)
    assert engine.stats.differs == "moved"
    again = settled(engine, scene)
    assert np.abs(coarse(again) - coarse(before)).mean() < 0.05 * coarse(before).mean()


def test_a_drag_begun_while_light_is_prepared_is_followed_at_once(engine: LiveEngine) -> None:
    scene = shipped("prism")
    settled(engine, scene)
    engine.set(inputs(moved(scene, 0.1)))
    engine.advance(0.0)
    assert engine.schedule.building
    wanted = inputs(moved(scene, 0.2))
    engine.set(wanted)
    engine.advance(0.05, interacting=True)
    assert engine.inputs is wanted and not engine.schedule.building


def test_what_else_changes_is_no_move() -> None:
    scene = shipped("prism")
    glass = scene.objects[glass_of(scene)]
    assert only_moves(inputs(scene), inputs(moved(scene, 0.1)))
    aside = replace(scene.lights[0], position=(9.0, 9.0, 9.0))
    assert only_moves(inputs(scene), inputs(replace(scene, lights=(aside, *scene.lights[1:]))))
    assert not only_moves(inputs(scene), inputs(replace(scene, objects=(*scene.objects, glass))))
    assert not only_moves(inputs(scene), replace(inputs(scene), method="srd-photons"))
    brighter = replace(scene, background_rgb=(0.5, 0.5, 0.5))
    assert not only_moves(inputs(scene), inputs(brighter))


def test_surfaces_of_another_size_leave_no_error(gl: Context) -> None:
    scene = shipped("prism")
    buffers = scene_buffers(gl, scene, SETTINGS)
    surfaces = FirstSurfaces(gl.ctx, buffers)
    try:
        for size in ((60, 34), (120, 68), (60, 34)):
            surfaces.run(camera_parameters(buffers, scene.camera, *size))
            assert surfaces.texture is not None and surfaces.texture.size == size
            gl.check("drawing surfaces")
    finally:
        surfaces.release()
        buffers.release()
    gl.ctx.framebuffer([gl.ctx.texture((4, 4), 4)]).release()
    gl.check("making a framebuffer after it")


@pytest.mark.parametrize("name", ["prism", pytest.param("ball", marks=pytest.mark.slow)])  # beams, photons
def test_edits_of_a_rehearsed_scene_compile_nothing(gl: Context, engine: LiveEngine, name: str) -> None:
    shader.drop_programs(gl.ctx)
    scene = shipped(name)
    settled(engine, scene)
    with shader.recorded() as rehearsed:
        for _ in rehearsal.rehearse(gl, inputs(scene)):
            pass
    assert "light/footprint.comp" in {program.name for program in rehearsed if program.seconds}
    glass, floor = glass_of(scene), next(i for i, o in enumerate(scene.objects) if o.material.receives)
    stroke = [Dab((0.1, 0.2, 0.0), 0.5, 1.5)]
    made = set_dispersion_gain(scene, glass, 1.7), moved(scene, 0.1, 15.0), add_dabs(scene, floor, stroke)
    with shader.recorded() as needed:
        for edited in made:
            version = engine.picture_version
            engine.set(inputs(edited))
            while engine.picture_version == version or engine.differs not in ("", "moved"):
                engine.advance(0.05, interacting=True)
    assert needed and [program.name for program in needed if program.seconds] == []


def test_a_kind_of_scene_is_rehearsed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[str] = []
    steps = lambda _, wanted: ((taken.append(wanted.scene.name), True)[1] for _ in range(3))  # noqa: E731
    monkeypatch.setattr(rehearsal, "rehearse", steps)
    with ThreadPoolExecutor(1) as thread:
        rehearsals = rehearsal.Rehearsals(lambda: SimpleNamespace(context=None, submit=thread.submit))  # type: ignore[arg-type, return-value]
        prism, ball = (inputs(shipped(name)) for name in ("prism", "ball"))
        for wanted in [prism] + 6 * [ball] + [prism, replace(ball, scene=moved(ball.scene, 0.1)), ball]:
            rehearsals.follow(wanted)
            thread.submit(int).result()
    assert taken == 3 * [prism.scene.name] + 3 * [ball.scene.name]
