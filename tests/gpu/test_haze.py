"""Light on its way through haze: closed forms of a beam's radiance and power, the directions of a prism's fan."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
import pytest
from reference import haze as reference
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.edit.parameters import Stage
from spectrasplat.gpu.context import Context
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import CollimatedLight
from spectrasplat.model.optics.glass import from_abbe
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Black, Camera, Dielectric, RenderDefaults, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.flights import PHOTONS, Flights, trace_flights
from spectrasplat.passes.haze import Haze
from spectrasplat.passes.picture_channels import Channels
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.frames import FrameRenderer
from spectrasplat.render.viewer.engine import LiveEngine

LUX = 500.0
WIDTH = 0.2
SIZE = 64, 64


def at(*place: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = place
    return matrix


def beam_scene(camera: Camera, scattering: float, g: float = 0.0, *objects: SceneObject) -> Scene:
    """A square beam along x through the origin, from 2 before it to a black plate 2 behind it."""
    light = CollimatedLight(
        "beam",
        illuminant("D65").scaled_to_luminous(LUX),
        position=(-2.0, 0.0, 0.0),
        direction=(1.0, 0.0, 0.0),
        width=WIDTH,
        height=WIDTH,
        shape="rect",
        tangent=(0.0, 1.0, 0.0),
    )
    end = SceneObject("end", primitives.box((0.1, 1.0, 1.0)), Black(), at(2.05, 0.0, 0.0))
    render = RenderDefaults(haze=scattering, haze_anisotropy=g)
    return Scene("haze", camera, (light,), (end, *objects), render=render)


def picture_of(gl: Context, scene: Scene) -> np.ndarray:
    """Luminance (H, W), lm/(sr unit²), of haze alone."""
    buffers = scene_buffers(gl, scene, RenderSettings())
    haze = Haze(gl, buffers, Channels())
    try:
        haze.draw(scene.camera, *SIZE)
        (texture,) = haze._picture.textures
        rgb = np.frombuffer(texture.read(), "f4").reshape(SIZE[1], SIZE[0], 4)[..., :3].astype(float)
        return rgb @ np.array([0.2126, 0.7152, 0.0722])
    finally:
        haze.release()
        buffers.release()


def seen_from(angle_deg: float, distance: float = 3.0, **more) -> Camera:
    """A camera that looks at the origin, its view so far from the beam's own direction."""
    angle = math.radians(angle_deg)
    return Camera((-distance * math.cos(angle), -distance * math.sin(angle), 0.0), (0.0, 0.0, 0.0), **more)


@pytest.mark.parametrize(("angle_deg", "scattering", "g"), [(90.0, 0.01, 0.0), (60.0, 0.2, 0.6), (130.0, 0.05, -0.3)])
def test_a_beam_is_as_bright_as_its_chord(gl: Context, angle_deg: float, scattering: float, g: float) -> None:
    camera = seen_from(angle_deg, vertical_fov_deg=20.0)
    picture = picture_of(gl, beam_scene(camera, scattering, g))
    middle = picture[SIZE[1] // 2 - 2 : SIZE[1] // 2 + 2, SIZE[0] // 2 - 2 : SIZE[0] // 2 + 2].mean()
    sine = math.sin(math.radians(angle_deg))
    # Light goes towards the eye against the view.
    cosine = -math.cos(math.radians(angle_deg))
    expected = reference.beam_radiance(LUX, WIDTH / sine, scattering, g, cosine, 2.0, 3.0)
    assert middle == pytest.approx(expected, rel=0.01)


def test_all_that_is_scattered_is_seen(gl: Context) -> None:
    """Φ σ L p, over the picture of a parallel projection: what little haze there is takes nothing."""
    scattering, extent = 1e-4, 5.0
    camera = seen_from(90.0, kind="orthographic", vertical_extent=extent)
    picture = picture_of(gl, beam_scene(camera, scattering))
    power = picture.sum() * (extent / SIZE[1]) ** 2
    expected = LUX * WIDTH**2 * scattering * 4.0 / (4.0 * math.pi)
    assert power == pytest.approx(expected, rel=0.005)
    # In bins: watts, of all of the spectrum.
    buffers = scene_buffers(gl, scene_in_bins := beam_scene(camera, scattering), RenderSettings())
    haze = Haze(gl, buffers, Channels((380.0, 480.0, 550.0, 600.0, 650.0, 700.0, 780.0)))
    haze.draw(camera, *SIZE)
    sums = np.concatenate(
        [np.frombuffer(t.read(), "f4").reshape(-1, 4).sum(axis=0, dtype=float) for t in haze._picture.textures]
    )
    watts = scene_in_bins.lights[0].spectral_power.power_w() * WIDTH**2
    assert sums.sum() * (extent / SIZE[1]) ** 2 == pytest.approx(watts * scattering * 4.0 / (4.0 * math.pi), rel=0.005)
    haze.release()
    buffers.release()
    cosines, weights = np.polynomial.legendre.leggauss(64)
    for g in (0.0, 0.7, -0.4):
        assert 2.0 * math.pi * weights @ reference.henyey_greenstein(cosines, g) == pytest.approx(1.0, rel=1e-9)


def test_what_stands_before_a_beam_hides_it(gl: Context) -> None:
    camera = seen_from(90.0, kind="orthographic", vertical_extent=1.0)
    screen = SceneObject("screen", primitives.box((0.5, 0.05, 1.0)), Black(), at(0.25, -1.0, 0.0))
    picture = picture_of(gl, beam_scene(camera, 0.01, 0.0, screen))[SIZE[1] // 2]
    assert picture[SIZE[0] // 2 :].max() == 0.0 or picture[: SIZE[0] // 2].max() == 0.0
    assert picture.max() > 0.0


def test_a_prism_opens_the_beam_as_snell_has_it(gl: Context) -> None:
    """Directions behind a prism at both ends of every band, against two refractions in float64."""
    glass = from_abbe(1.7, 30.0)
    prism = SceneObject("prism", primitives.prism(60.0, 1.0, 1.0), Dielectric(glass), np.eye(4))
    turn = math.radians(28.0)  # about least deviation
    tilted = np.eye(4)
    tilted[:3, :3] = [[math.cos(turn), 0, math.sin(turn)], [0, 1, 0], [-math.sin(turn), 0, math.cos(turn)]]
    scene = beam_scene(seen_from(90.0), 0.01, 0.0, replace(prism, object_to_world=tilted))
    flights = trace_flights(gl, scene, Channels().observer(), 4096).records
    behind = flights[(flights["what"] >> 8 == 2) & (flights["direction"][:, 2] < -0.7)]
    assert len(behind) > 100
    normals = [
        tilted[:3, :3] @ np.array([side * math.cos(math.pi / 6), 0.0, math.sin(math.pi / 6)]) for side in (-1, 1)
    ]

    def leaving(nm: np.ndarray) -> np.ndarray:
        n, d = glass.index(nm), np.broadcast_to([1.0, 0.0, 0.0], (len(nm), 3))
        for eta, normal in zip((1.0 / n, n), (normals[0], -normals[1]), strict=True):
            cosine = -(d @ normal)
            rest = np.sqrt(1.0 - eta**2 * (1.0 - cosine**2))
            d = eta[:, None] * d + (eta * cosine - rest)[:, None] * normal
        return d

    buffers = scene_buffers(gl, scene, RenderSettings())
    low, high = (leaving(buffers.axis.nm_of_x(behind[name].astype(float))) for name in ("x_lo", "x_hi"))
    buffers.release()
    found = behind["ddirection_dband"].astype(float)
    assert np.abs(behind["direction"] - 0.5 * (low + high)).max() < 1e-4
    assert np.abs(found - (high - low)).max() < 0.02 * np.linalg.norm(high - low, axis=1).max()


def test_the_viewer_shows_the_same_and_traces_once(gl: Context) -> None:
    """The viewer's picture against a still's; thicker haze, seen from elsewhere, by the same beams."""
    scene = beam_scene(seen_from(90.0, vertical_fov_deg=20.0), 0.01)
    settings = RenderSettings(width=SIZE[0], height=SIZE[1], spp=1, photons=1000)
    frames = FrameRenderer(gl, settings, [Stage(scene, scene.camera)])
    still = frames.run(Stage(scene, scene.camera))
    frames.release()
    engine = LiveEngine(gl)

    def shown(scene: Scene) -> np.ndarray:
        engine.set(LiveInputs(scene, scene.camera, *SIZE))
        until = time.monotonic() + 120.0
        while not engine.is_idle and time.monotonic() < until:
            engine.advance(0.05)
        assert engine.is_idle and engine.problem is None
        return np.frombuffer(engine.picture.read(), "f4").reshape(SIZE[1], SIZE[0], 4)[..., :3].astype(float)

    try:
        first = shown(scene)
        assert first.max() > 0.0 and np.abs(first - still).max() < 1e-4 * still.max()
        calls: list[int] = []

        def counted(*args) -> Flights:
            calls.append(args[3])
            return trace_flights(*args)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("spectrasplat.passes.haze.trace_flights", counted)
            render = replace(scene.render, haze=0.02)
            thicker = shown(replace(scene, render=render, camera=seen_from(80.0, vertical_fov_deg=20.0)))
        # Fewer beams, for pictures in motion, may have been asked for first.
        assert PHOTONS not in calls and 1.8 < thicker.sum() / first.sum() < 2.1
    finally:
        engine.release()
