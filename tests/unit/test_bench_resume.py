"""A bench run that is stopped anywhere goes on without doing anything twice, to the same result; folders that do not
fit are refused.

The rigs are made up: pictures are the reference with a bias and noise that depend on method, photons and seed alone.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import numpy as np
import pytest
from spectrasplat.base import paths
from spectrasplat.base.errors import UserError
from spectrasplat.bench import machine, runner
from spectrasplat.bench.rendering import NothingToMeasure, Rendering
from spectrasplat.bench.results import BenchResult, BenchSettings, ReferenceInfo, SceneResult
from spectrasplat.bench.store import Store
from spectrasplat.bench.subjects import Subject
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.geometry.primitives import box
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, RenderDefaults, Scene, SceneObject
from spectrasplat.reference import metrics
from spectrasplat.reference.metrics import ReferencePicture

WIDTH, HEIGHT = 8, 6
SETTINGS = BenchSettings(3.0, 3, ("stochastic", "srd"), (WIDTH, HEIGHT))
MACHINE = {"processor": "p", "renderer": "r", "program": "hash"}


class Rig:
    """Stands where `MethodRig` and `CameraRig` stand."""

    setup_seconds = {"buffers": 0.1}
    buffers_mib = 1.0
    goes_on = False
    kernels = ()

    def __init__(self, rigs: Rigs, method: str) -> None:
        self._rigs, self._method = rigs, method

    def budgets(self, _seconds: float, count: int) -> list[int]:
        return [1000 * 2**i for i in range(count)]

    def render(self, photons: int, seed: int, kernel: float | None = None) -> Rendering:
        if len(self._rigs.rendered) == self._rigs.stop_at:
            self._rigs.stop_at = -1
            raise KeyboardInterrupt
        self._rigs.rendered.append((self._method, photons, seed))
        rng = np.random.default_rng(zlib.crc32(f"{self._method} {photons} {seed}".encode()))
        size = 0.02 if self._method == "srd" else 0.3
        xyz = reference_picture() * (1.01 + size * np.sqrt(1000 / photons) * rng.normal(size=(HEIGHT, WIDTH, 3)))
        seconds = {"plan": 0.01, "trace": photons / 2e5, "splat": photons / 4e5, "resolve": 0.01, "camera": 0.2}
        return Rendering(xyz, seconds, photons, photons // 2)

    def fitting(self, budget: int) -> int:
        return budget

    def release(self) -> None:
        """Owns nothing."""


class Rigs:
    """Makes made-up rigs, counts what they render, and interrupts at the rendering that `stop_at` names."""

    rig = Rig

    def __init__(self) -> None:
        self.rendered: list[tuple[str, int, int]] = []
        self.stop_at = -1
        self.released = 0
        self.refuses = False

    @contextmanager
    def make(
        self,
        _context: object,
        _scene: Scene,
        methods: tuple[str, ...],
        width: int,
        height: int,
        progress: Callable[[str], None],
    ) -> Iterator[dict[str, Rig]]:
        assert (width, height) == (WIDTH, HEIGHT)
        if self.refuses:
            raise NothingToMeasure("nothing")
        progress(f"preparing {methods[0]}")
        rigs = {method: self.rig(self, method) for method in methods}
        yield rigs
        self.released += len(rigs)


def reference_picture() -> np.ndarray:
    return np.linspace(1.0, 2.0, HEIGHT * WIDTH * 3).reshape(HEIGHT, WIDTH, 3)


def relative_error(xyz: np.ndarray, reference_image: ReferencePicture) -> float:
    """Stands for FLIP."""
    return float(np.abs(xyz / reference_image.xyz - 1.0).mean())


def glass_scene() -> Scene:
    mesh = make_mesh("triangle", np.eye(3), np.array([[0, 1, 2]]))
    objects = (
        SceneObject("glass", mesh, Dielectric(find("N-SF11"))),
        SceneObject("table", box((1.0, 1.0, 1.0)), Diffuse()),
    )
    return Scene("made up", Camera((0.0, -5.0, 1.0), (0.0, 0.0, 0.0)), (), objects, render=RenderDefaults(960, 720))


class Bench:
    """Opens the folder and runs, as the command does."""

    def __init__(self, directory: Path, rigs: Rigs) -> None:
        self.directory, self.rigs, self.references, self.told, self.skipped = directory, rigs, 0, [], None

    def run(
        self,
        settings: BenchSettings = SETTINGS,
        key: str = "key",
        fresh: bool = False,
        names: tuple[str, ...] = ("one", "two"),
    ) -> BenchResult:
        store = Store(self.directory, BenchResult("0", "today", "command", dict(MACHINE), [], settings), fresh)
        runner.run_bench(
            None,
            dict.fromkeys(names, glass_scene()),
            store,
            lambda f, t: self.told.append((f, t)),
            self.skipped,
            Subject(self.rigs.make, self._reference_image, lambda scene, *_: f"{key} {len(scene.objects)}"),
        )  # type: ignore[arg-type]
        return store.result

    def _reference_image(
        self, scene: Scene, width: int, height: int, seconds: float, progress: Callable[[float, str], None]
    ) -> tuple[ReferencePicture, ReferenceInfo]:
        self.references += 1
        progress(0.5, "half")
        assert seconds == SETTINGS.reference_seconds
        return ReferencePicture(reference_picture(), np.full((height, width, 3), 1e-9)), ReferenceInfo(
            "made up", 1, 1.0, 1e-9, f"key {len(scene.objects)}"
        )

    def stored(self) -> BenchResult:
        return msgspec.json.decode((self.directory / "results.json").read_bytes(), type=BenchResult)


@pytest.fixture
def rigs(monkeypatch: pytest.MonkeyPatch) -> Rigs:
    monkeypatch.setattr(runner, "POINTS", 4)
    monkeypatch.setattr(metrics, "flip", relative_error)  # FLIP takes 0.2 s even for these few pixels
    return Rigs()


def comparable(scene: SceneResult) -> dict[str, object]:
    """All of a scene but the order in which its parts were found."""
    values = msgspec.to_builtins(scene)
    values["curves"] = {curve["method"]: curve for curve in values["curves"]}
    for curve in values["curves"].values():
        curve["samples"].sort(key=lambda s: (s["seed"], s["photons"]))
    return values


def test_one_whole_run(tmp_path: Path, rigs: Rigs) -> None:
    bench = Bench(tmp_path / "new" / "out", rigs)
    result = bench.run()
    assert bench.stored() == result and [s.scene for s in result.scenes] == ["one", "two"] and bench.references == 2
    scene = result.scenes[0]
    assert scene.complete and scene.strongest_glass == "Schott N-SF11"
    assert scene.strongest_abbe == pytest.approx(25.68, abs=0.01)
    assert {len(curve.samples) for curve in scene.curves} == {12}
    assert {len(curve.points) for curve in scene.curves} == {4}
    noise = {curve.method: curve for curve in scene.curves}
    assert noise["srd"].points[-1].bias2 == pytest.approx(1e-4, rel=0.3)
    assert noise["stochastic"].points[0].variance == pytest.approx(0.09, rel=0.3)
    assert len(rigs.rendered) == 2 * (2 * 3 * 4 + 4) and rigs.released == 4
    first_of_seed = [next(m for m, _, seed in rigs.rendered if seed == s) for s in (1, 2, 3)]
    assert first_of_seed == ["stochastic", "srd", "stochastic"]  # who begins changes
    for name, file in scene.pictures.items():
        picture = np.load(bench.directory / file)
        assert picture.shape == (HEIGHT, WIDTH, 3) and picture.dtype == np.float32
        assert name == "reference" or name in scene.picture_samples
    assert set(scene.pictures) == {"reference", "srd", "srd early", "stochastic", "stochastic early"}
    assert not (bench.directory / "partial").exists()
    fractions = [fraction for fraction, _ in bench.told]
    assert fractions == sorted(fractions) and 0.0 <= fractions[0] and fractions[-1] <= 1.0
    assert bench.told[0][1] == "one: preparing stochastic"
    assert any(text.startswith("one: reference") for _, text in bench.told)


@pytest.mark.parametrize("stop_at", [0, 1, 5, 12, 13, 22, 25, 30])
def test_stopped_anywhere_it_goes_on(tmp_path: Path, rigs: Rigs, stop_at: int) -> None:
    whole = Bench(tmp_path / "whole", rigs).run()
    rigs.rendered.clear()
    rigs.stop_at = stop_at
    bench = Bench(tmp_path / "stopped", rigs)
    with pytest.raises(KeyboardInterrupt):
        bench.run()
    kept = [(c.method, s.photons, s.seed) for scene in bench.stored().scenes for c in scene.curves for s in c.samples]
    assert len(kept) >= min(stop_at, 24) - 3  # less than one method's seed is lost
    rigs.rendered.clear()
    resumed = bench.run()
    measured = [] if stop_at > 24 else kept
    again = [r for r in rigs.rendered[: 24 - len(measured)] if r in measured]
    assert again == [] and bench.references == 2  # neither a sample nor the reference is made twice
    assert [comparable(s) for s in resumed.scenes] == [comparable(s) for s in whole.scenes]
    assert len({(c.method, s.photons, s.seed) for c in resumed.scenes[0].curves for s in c.samples}) == 24
    assert not (bench.directory / "partial").exists()


def test_a_finished_run_does_nothing_and_takes_more_scenes(tmp_path: Path, rigs: Rigs) -> None:
    bench = Bench(tmp_path, rigs)
    before = bench.run(names=("one",))
    rigs.rendered.clear()
    assert bench.run(names=("one",)).scenes == before.scenes and rigs.rendered == []
    assert [s.scene for s in bench.run(names=("two",)).scenes] == ["one", "two"]
    rigs.rendered.clear()
    bench.run(names=("one",), fresh=True)
    assert len(rigs.rendered) == 28 and [s.scene for s in bench.stored().scenes] == ["one"]


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (BenchSettings(1.0, 3, SETTINGS.methods, SETTINGS.size), "--seconds 3 instead of 1"),
        (BenchSettings(3.0, 4, SETTINGS.methods, SETTINGS.size), "--seeds 3 instead of 4"),
        (BenchSettings(3.0, 3, ("srd",), SETTINGS.size), "--methods stochastic,srd instead of srd"),
        (BenchSettings(3.0, 3, SETTINGS.methods, None), "--size 8x6 instead of by the scene"),
    ],
)
def test_results_of_other_settings_are_refused(tmp_path: Path, rigs: Rigs, settings: BenchSettings, told: str) -> None:
    bench = Bench(tmp_path, rigs)
    bench.run(names=("one",))
    before = (tmp_path / "results.json").read_bytes()
    with pytest.raises(UserError, match="--fresh") as refused:
        bench.run(settings)
    assert told in str(refused.value) and (tmp_path / "results.json").read_bytes() == before


def test_another_program_machine_or_scene_is_refused(
    tmp_path: Path, rigs: Rigs, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(tmp_path, rigs)
    bench.run(names=("one",))
    with pytest.raises(UserError, match="scene 'one' has changed .* --fresh"):
        bench.run(names=("one",), key="other")
    monkeypatch.setitem(MACHINE, "program", "other")
    with pytest.raises(UserError, match="another version of the program"):
        bench.run()
    monkeypatch.setitem(MACHINE, "program", "hash")
    monkeypatch.setitem(MACHINE, "renderer", "a GPU")
    with pytest.raises(UserError, match="another renderer \\('r', not 'a GPU'\\)"):
        bench.run()


@pytest.mark.parametrize("content", [b"{", b"[]", b'{"version": 3}', b""])
def test_a_results_file_that_is_none_is_refused(tmp_path: Path, rigs: Rigs, content: bytes) -> None:
    (tmp_path / "results.json").write_bytes(content)
    with pytest.raises(UserError, match="cannot be read as earlier results .* --fresh"):
        Bench(tmp_path, rigs).run()


def test_lost_sums_are_said(tmp_path: Path, rigs: Rigs) -> None:
    bench = Bench(tmp_path, rigs)
    rigs.stop_at = 14
    with pytest.raises(KeyboardInterrupt):
        bench.run(names=("one",))
    for file in (tmp_path / "partial").glob("one.s*.npy"):
        file.unlink()
    with pytest.raises(UserError, match="partial.*--fresh"):
        bench.run(names=("one",))


def test_a_lost_reference_begins_the_scene_anew(tmp_path: Path, rigs: Rigs) -> None:
    bench = Bench(tmp_path, rigs)
    rigs.stop_at = 14
    with pytest.raises(KeyboardInterrupt):
        bench.run(names=("one",))
    (tmp_path / "partial" / "one.reference.npy").unlink()
    rigs.rendered.clear()
    assert bench.run(names=("one",)).scenes[0].complete and len(rigs.rendered) == 28


def test_pictures_that_are_not_finite_are_no_result(
    tmp_path: Path, rigs: Rigs, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Rig, "render", lambda *_: Rendering(np.full((HEIGHT, WIDTH, 3), np.nan), {}, 1, 1))
    with pytest.raises(RuntimeError, match="stochastic .* not finite .*one"):
        Bench(tmp_path, rigs).run()


def test_a_black_scene_is_an_error_by_name_and_skipped_among_all(tmp_path: Path, rigs: Rigs) -> None:
    rigs.refuses = True
    bench = Bench(tmp_path, rigs)
    with pytest.raises(UserError, match="nothing"):
        bench.run()
    reasons: list[str] = []
    bench.skipped = reasons.append
    assert bench.run().scenes == [] and reasons == ["nothing", "nothing"] and bench.references == 0


def test_the_program_is_told_apart_by_files_that_exist() -> None:
    app = paths.assets_dir().parent / "app"
    assert [pattern for pattern in machine._MEASURING if not any(app.glob(pattern))] == []


def test_default_size_follows_the_scene() -> None:
    assert runner.picture_size(glass_scene(), BenchSettings()) == (480, 360)
