"""The bench of the camera pass without a GPU: made-up rigs and curves, budgets that keep to whole bands, a report that
speaks of samples."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.bench import runner, subjects
from spectrasplat.bench.camera_rendering import CameraRig
from spectrasplat.bench.measured_passes import CAMERA, MEASURED_PASSES
from spectrasplat.bench.rendering import Rendering
from spectrasplat.bench.report import report
from spectrasplat.bench.report.page import PROSE
from spectrasplat.bench.results import BenchResult, BenchSettings, SceneResult
from spectrasplat.bench.store import Store
from spectrasplat.bench.subjects import SUBJECTS, Subject
from spectrasplat.model.scene import Diffuse, Scene
from spectrasplat.passes.spectrum_choice import Spectrum

from tests.unit.bench_synthetic import synthetic_result, synthetic_scene
from tests.unit.test_bench_report import assert_stands_alone
from tests.unit.test_bench_resume import HEIGHT, MACHINE, WIDTH, Rig, Rigs, glass_scene
from tests.unit.test_bench_resume import reference_picture as reference_pixels

SETTINGS = BenchSettings(20.0, 2, ("stochastic", "srd"), (WIDTH, HEIGHT), measured_pass="camera")


class WholeRig(Rig):
    """Renders multiples of four samples only, at 0.1 s each."""

    def budgets(self, _seconds: float, count: int) -> list[int]:
        return [4 * n for n in (1, 2, 4, 12, 50)]

    def fitting(self, budget: int) -> int:
        return max(budget // 4, 1) * 4

    def render(self, photons: int, seed: int, kernel: float | None = None) -> Rendering:
        assert photons % 4 == 0
        return replace(super().render(photons, seed), seconds={"bands": 0.02, "lookups": 0.1 * photons}, splats=0)


class WholeRigs(Rigs):
    rig = WholeRig


def run(directory: Path, settings: BenchSettings = SETTINGS) -> SceneResult:
    def reference_image(*_: object) -> tuple[object, object]:
        from spectrasplat.bench.results import ReferenceInfo
        from spectrasplat.reference.metrics import ReferencePicture

        return ReferencePicture(reference_pixels(), np.full((HEIGHT, WIDTH, 3), 1e-9)), ReferenceInfo(
            "made up", 2000, 1.0, 1e-9, "key", 1 << 20, 1e-5
        )

    store = Store(directory, BenchResult("0", "today", "command", dict(MACHINE), [], settings))
    runner.run_bench(
        None,
        {"one": glass_scene()},
        store,
        lambda *_: None,
        None,
        Subject(WholeRigs().make, reference_image, lambda *_: "key"),
    )  # type: ignore[arg-type]
    return store.result.scenes[0]


def test_a_run_of_the_camera(tmp_path: Path) -> None:
    done = run(tmp_path)
    assert done.measured_pass == "camera" and done.complete
    assert [c.budgets for c in done.curves] == [[4, 8, 16, 48, 200]] * 2
    assert done.curves[0].points[-1].seconds == pytest.approx(20.02)  # choosing the bands counts
    wanted = {"": 20.0, " early": 1.0, " first": 0.5}  # the talk's crops
    assert {ending: share * 20.0 for ending, share in CAMERA.pictures} == pytest.approx(wanted)
    for ending, seconds in wanted.items():
        sample = done.picture_samples[f"srd{ending}"]
        assert sample.photons % 4 == 0 and sample.photons == max(int(10 * (seconds - 0.02)) // 4 * 4, 4)
    stored = msgspec.json.decode((tmp_path / "results.json").read_bytes(), type=BenchResult)
    assert stored.scenes[0].reference is not None and stored.scenes[0].reference.caustic_photons == 1 << 20
    with pytest.raises(UserError, match="the camera pass measured instead of the light pass.*--fresh"):
        run(tmp_path, msgspec.structs.replace(SETTINGS, measured_pass="light"))


class CountedRig(CameraRig):
    """The budgets of a real rig on a made-up device: 50 ms a sample, bands that double while there are samples for
    them, up to 8."""

    def __init__(self, max_bands: int, a_sample_s: float = 0.05) -> None:
        self._most, self._sample_s = max_bands, a_sample_s

    def _choose(self, samples: int) -> Spectrum:
        return Spectrum(min(self._most, 1 << (max(samples, 1).bit_length() - 1)))

    def render(self, budget: int, seed: int) -> Rendering:
        bands, samples = self._choose(budget).bands, self._choose(budget).samples(budget)
        return Rendering(
            np.zeros((1, 1, 3)), {"bands": 0.01 * (2 * bands - 1), "lookups": self._sample_s * samples}, samples, 0
        )


@pytest.mark.parametrize(("max_bands", "seconds"), [(1, 20.0), (8, 20.0), (8, 2.0), (32, 1.0), (1, 0.01)])
def test_budgets_are_whole_multiples_of_their_bands(max_bands: int, seconds: float) -> None:
    rig = CountedRig(max_bands)
    budgets = rig.budgets(seconds, 10)
    assert budgets == sorted(set(budgets)) and budgets[0] == 1 and len(budgets) <= 10
    assert all(n % rig._choose(n).bands == 0 and rig.fitting(n) == n and rig.render(n, 1).emitted == n for n in budgets)
    if seconds > 1.0:
        assert len(budgets) >= 7
        assert sum(rig.render(budgets[-1], 1).seconds.values()) == pytest.approx(seconds, rel=0.2)


def test_the_report_speaks_of_samples(tmp_path: Path) -> None:
    names = ("stochastic", "regular-7", "srd-lambda", "srd")
    made = [
        synthetic_scene(tmp_path, name, methods=names, longest_s=20.0) for name in ("edge", "text", "studio", "ball")
    ]
    for one in made:
        one.measured_pass, one.title = "camera", "made up"
        assert one.reference is not None
        one.reference.method, one.reference.photons, one.reference.caustic_photons = "camera paths", 900, 67_000_000
        for each in one.curves:
            each.setup_seconds = {"light pass": 2.0, "buffers": 0.1, "compile": 1.0}
            each.samples = [
                msgspec.structs.replace(s, seconds={"bands": 0.1, "lookups": s.photon_seconds}) for s in each.samples
            ]
            one.picture_samples |= {f"{each.method}{ending}": each.samples[0] for ending, _ in CAMERA.pictures}
            one.pictures[f"{each.method} first"] = one.pictures[f"{each.method} early"]
    result = synthetic_result(made)
    result.settings = BenchSettings(20.0, methods=names, measured_pass="camera")
    report.write_report(result, tmp_path)
    page = assert_stands_alone((tmp_path / "report.html").read_text(encoding="utf-8"))
    text = page.text
    for told in (
        "the camera pass",
        "camera samples a pixel",
        "20 s of camera time",
        "0.5 s, part",
        "1 s, part",
        "its caustic: 67 M photons",
        "Stages of camera time",
        "bands s",
        "light pass s",
        *(PROSE["camera"].methods[name] for name in names),
    ):
        assert told in text, told
    without_caustic = text.replace("67 M photons", "").replace("srd-photons", "")
    assert not re.search(r"photon", without_caustic, re.IGNORECASE), re.findall(r".{40}photon.{40}", without_caustic)
    stems = {path.stem for path in (tmp_path / "plots").iterdir()}
    assert {
        "edge_error_time",
        "edge_error_samples",
        "scenes",
    } <= stems
    assert "edge_error_photons" not in stems
    # Four columns and the reference: three rows of parts and one of whole pictures, four error maps and their scale.
    assert page.tags["img"] == 4 * (4 * 5 + 4 + 1)


def test_halves_and_subjects_fit() -> None:
    assert set(MEASURED_PASSES) == set(SUBJECTS) == set(PROSE)
    for half in MEASURED_PASSES.values():
        assert set(half.counted) <= set(half.stages) == set(PROSE[half.key].stages) and half.pictures[0] == ("", 1.0)


def test_a_caustic_is_planned_where_light_may_fall() -> None:
    """Light and something diffuse are both needed; depth is the scene's, as in the maps."""
    from spectrasplat.commands.scenes import find_scene
    from spectrasplat.model.io.scene_file import load_scene

    ball = load_scene(find_scene("ball_plain"))
    plan = subjects.caustic_plan(ball)
    assert plan is not None and plan.max_depth == ball.render.max_depth and 0.0 < plan.target_relmse <= 1e-4
    assert subjects.caustic_plan(replace(ball, lights=())) is None
    bare = replace(ball, objects=tuple(o for o in ball.objects if not isinstance(o.material, Diffuse)))
    assert isinstance(bare, Scene) and subjects.caustic_plan(bare) is None
