"""What a frame of the viewer asks of a GPU while the camera orbits, a dispersion is dragged and glass is moved."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import moderngl
import numpy as np
import pytest
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.edit.camera_controls import orbit
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.gpu import device_traits
from spectrasplat.gpu.context import Context, create_context
from spectrasplat.gpu.device_tables import DeviceTables
from spectrasplat.gpu.device_traits import DeviceTraits
from spectrasplat.gpu.splat_tables import LEAST_WIDTH, SplatTables
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics.spectral_tables import SpectralAxis
from spectrasplat.model.optics.spectrum import Spectrum, illuminant
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.camera_tables import CameraTables
from spectrasplat.passes.picture_channels import Channels
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.shown_spectra import ShownSpectra
from viewer_rig import MOVEMENTS, doubled, dragging, pulling, roughened, table, turning, viewer, with_gains

MOST_BYTES = 64 << 10
PYTHON_MS = {"orbit": 1.0, "drag": 3.0}
STALL_MS = 50.0


@pytest.mark.parametrize(
    "name", ["prism", pytest.param("default", marks=pytest.mark.slow), pytest.param("ball", marks=pytest.mark.slow)]
)
def test_a_viewer_makes_nothing_anew(name: str) -> None:
    with viewer(name) as rig:
        for movement, bound in PYTHON_MS.items():
            frames = rig.frames(8, MOVEMENTS[movement])
            for frame in frames[2:]:
                assert not (frame.counts.made or frame.counts.programs), (movement, frame.counts.made)
                assert frame.counts.written_bytes <= MOST_BYTES / 2 and not frame.counts.waits, movement
            assert frames[-1].version > frames[2].version, "nothing was shown"
            assert min(frame.python_ms for frame in frames[2:]) <= bound, movement
            rig.settle()
        for change in (pulling, turning):
            frames = rig.frames(5, change)[2:]
            for frame in frames:
                counts = frame.counts
                assert not (counts.made or counts.programs or counts.finishes), table([frame])
                assert counts.written_bytes <= MOST_BYTES / 4, table([frame])
                # Of the frame before: where some of its photons landed, and what became of its batches.
                assert counts.read_bytes <= 12 << 10, table([frame])
            assert len({frame.version for frame in frames}) == 3
            assert min(frame.python_ms for frame in frames) <= 3.0, table(frames)
            rig.settle()


def leaping(first: LiveInputs, count: int) -> Iterator[LiveInputs]:
    """Dispersions from none to extreme, and the camera anywhere."""
    random = np.random.default_rng(7)
    for _ in range(count):
        camera = orbit(first.camera, *random.uniform(-300.0, 300.0, 2))
        scene = with_gains(first.scene, random.choice([0.0, 1e-3, 0.3, 1.0, 3.0, 8.0], 4))
        yield replace(first, camera=camera, scene=scene)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["default", "ball", "wine_glass"])
def test_nor_does_it_whatever_is_dragged_how_far(name: str, count: int = 200) -> None:
    with viewer(name) as rig:
        asked = list(rig.steps(leaping(rig.wanted, count)))
    assert len(asked) > count / 2
    assert not any(counts.made or counts.programs or counts.waits for counts in asked)
    assert max(counts.written_bytes for counts in asked) <= 2 * MOST_BYTES / 3


@pytest.mark.slow
def test_no_frame_stalls() -> None:
    """While something is compiled, refitted or read back: whatever a driver does, it lets other threads go on."""
    with viewer("prism") as rig:
        rig.engine.refine_when_still = True
        first = rig.wanted
        for change in (partial(dragging, step=60.0), roughened, doubled):
            for _ in range(2):  # the texts of programs and the table of a roughness are made once
                rig.wanted = first
                rig.settle()
                longest = max(rig.python_ms(change(first), 30))
            assert longest <= STALL_MS, change


def test_tables_that_the_device_writes_are_those_of_numpy(gl: Context) -> None:
    scene = load_scene(shipped_scenes()["prism"])
    axis = SpectralAxis.build([o.material.dispersion for o in scene.objects if o.material.transmits])
    lights = [illuminant("D65"), Spectrum(0.1 * np.ones(401), ((546.1, 3.0), (435.8, 2.0)))]
    classes = [None, np.linspace(0.2, 0.9, 401)]
    bands = [[(0.0, 0.3), (0.3, 1.0)], [(0.1, 0.5), (0.5, 0.5), (0.5, 0.9)]]
    exact = SplatTables.build(gl.ctx, axis, lights, classes, bands, width=LEAST_WIDTH)
    device = DeviceTables(gl.ctx, lights, classes)
    made = device.tables(axis, bands, None)
    again = device.tables(axis, bands, made)
    assert again is made

    def values(owner: moderngl.Buffer | moderngl.TextureArray) -> np.ndarray:
        return np.frombuffer(owner.read(), "f4")

    for name in ("first_power", "classes", "bands", "targets", "rows", "width", "layers", "stacked"):
        assert getattr(exact, name) == getattr(made, name)
    pairs = [(exact.texture, made.texture), *zip(exact.buffers, made.buffers, strict=True)]
    for expected, got in (tuple(map(values, pair)) for pair in pairs):
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-4 * np.abs(expected).max())
    places, spans = (
        values(tables.band_buffer)[: 4 * tables.first_power].reshape(-1, 4)[:, :3] for tables in (exact, made)
    )
    np.testing.assert_allclose(spans, places, atol=1e-5)
    for owned in (exact, made, device):
        owned.release()


@pytest.mark.parametrize("name", ["prism", "default", "wine_glass"])
def test_what_the_device_writes_for_the_camera_is_what_numpy_does(name: str) -> None:
    """Over wavelength straight between nanometres, which are more than a kink of a clamped index asks for."""
    scene = load_scene(shipped_scenes()[name])
    with device_traits.assumed(DeviceTraits(splats_by_compute=True)), create_context() as context:
        buffers = scene_buffers(context, scene, RenderSettings(width=64, height=36))
        shown = ShownSpectra(context.ctx, scene, buffers, None)
        of = Channels(), shown.reflectances, shown.channels
        tables = CameraTables(context.ctx, buffers, *of)
        try:
            for gain in (3.0, 0.0):
                buffers.scene = with_gains(scene, [gain])
                assert tables.take(buffers)
                fresh = CameraTables(context.ctx, buffers, *of)
                first = [int(fresh.defines[f"{row}_ROW"]) for row in ("INDEX", "ABSORPTION", "QUANTILE")]
                rows, expected = (
                    np.frombuffer(t.spectra.read(), "f4").reshape(t.spectra.height, -1) for t in (tables, fresh)
                )
                indices, seen, sampled = slice(first[0], first[1]), slice(first[1], first[2]), slice(first[2], None)
                np.testing.assert_allclose(rows[indices], expected[indices], atol=2e-5)
                np.testing.assert_allclose(rows[seen], expected[seen], atol=3e-3)
                np.testing.assert_array_equal(rows[sampled], expected[sampled])
                sums, exact = (np.frombuffer(t.emission.read(), "f4") for t in (tables, fresh))
                np.testing.assert_allclose(sums, exact, atol=2e-6 * np.abs(exact).max())
                fresh.release()
        finally:
            for owned in (tables, shown, buffers):
                owned.release()
