"""`spectrasplat bench` on the command line: wrong options end in one sentence before any work, right ones in the
runner."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any, Self

import pytest
from spectrasplat.__main__ import main
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.bench import runner
from spectrasplat.bench.results import BenchSettings, Curve, Point, Sample, SceneResult, SpeedUp
from spectrasplat.commands import scenes
from spectrasplat.model.settings import CAMERA_METHODS, METHODS


class FakeContext:
    renderer, vendor, version = "llvmpipe", "Mesa", "4.5"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass


class Seen:
    """What the runner and the report were given."""

    def __init__(self) -> None:
        self.scenes: list[str] = []
        self.settings: BenchSettings | None = None
        self.command = ""
        self.interrupt = False
        self.dark = ""
        """A scene in which there is nothing to measure."""
        self.reported: Path | None = None


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> Seen:
    """The command without OpenGL: the runner is made up."""
    found = Seen()

    def run(
        _context: object, scenes: dict[str, Any], store: Any, _progress: object, skipped: Any, start_seconds: float
    ) -> None:
        assert 0.0 < start_seconds
        found.scenes, found.settings, found.command = [*scenes], store.result.settings, store.result.command
        points = [Point(n, n / 1000, 1 / n, 1 / n, 1 / n, 0.2 / n, 0.8 / n) for n in (100, 1000)]
        samples = [Sample(n, 1, n, n, {"trace": n / 1000}, {"relmse": 1 / n}) for n in (100, 1000)]
        for name in scenes:
            if name == found.dark:
                if skipped is None:
                    raise UserError(f"'{name}': nothing to measure")
                skipped(f"'{name}': nothing to measure")
                continue
            curve = Curve("srd", {}, samples, [100, 1000], points, -1.0, 0.1)
            done = SceneResult(name, name, (4, 4), 2, 1.0, None, [curve])
            done.speed_ups = [SpeedUp(0.01, "photon", 1.0, False, "stochastic", 40.0, False)]
            done.complete = not found.interrupt
            store.put_scene(done)
        store.save()
        if found.interrupt:
            raise KeyboardInterrupt

    def report(_result: object, directory: Path) -> None:
        found.reported = directory

    monkeypatch.setattr("spectrasplat.gpu.context.create_context", FakeContext)
    monkeypatch.setattr(runner, "run_bench", run)
    monkeypatch.setattr("spectrasplat.bench.report.report.write_report", report)
    return found


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("prism", "give one with -o DIR"),
        ("prsm -o out", "did you mean 'prism'"),
        ("prism -o out --methods srd,stochstic", "--methods 'stochstic' is unknown, did you mean 'stochastic'"),
        ("prism -o out --methods ''", "--methods '' is unknown, known are"),
        ("prism -o out --seeds 0", "--seeds 0 is out of range"),
        ("prism -o out --seeds 2.5", "--seeds '2.5' is not a whole number"),
        ("prism -o out --seconds 0", "--seconds 0 is out of range: give more than 0"),
        ("prism -o out --seconds -1", "--seconds -1 is out of range"),
        ("prism -o out --seconds nan", "--seconds 'nan' is not a number"),
        ("prism -o out --seconds soon", "--seconds 'soon' is not a number"),
        ("prism -o out --horizon 2", "--horizon 2 is less than the photon time that every method is given"),
        ("prism -o out --camera --horizon 30", "leave it out with --camera"),
        ("prism -o out --reference-seconds 0", "--reference-seconds 0 is out of range"),
        ("prism -o out --size 64", "--size '64' is not WIDTHxHEIGHT"),
        ("prism -o out --size 16384x16384 --seeds 1", ""),
        (
            "prism -o out --camera --methods stochastic-point",
            "--methods 'stochastic-point' is a method of the light pass alone",
        ),
    ],
)
def test_mistakes_are_one_sentence(
    arguments: str,
    told: str,
    seen: Seen,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    if not told:  # depends on the machine
        monkeypatch.setattr("spectrasplat.base.memory.memory_bytes", lambda: 1 << 30)
        told = "choose a smaller one"
    assert main(["bench", *shlex.split(arguments)]) == 2
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1 and error.startswith("spectrasplat: ")
    assert seen.scenes == [] and list(tmp_path.iterdir()) == []


def test_folders_that_cannot_be_used(seen: Seen, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "file"
    file.write_text("")
    assert main(["bench", "prism", "-o", str(file)]) == 2
    assert f"cannot make the folder {file}" in capsys.readouterr().err
    assert main(["bench", "prism", "-o", str(file / "below")]) == 2
    assert "cannot make the folder" in capsys.readouterr().err
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "results.json").mkdir()
    assert main(["bench", "prism", "-o", str(tmp_path / "out")]) == 2
    assert "it is a folder" in capsys.readouterr().err


def test_options_reach_the_runner(seen: Seen, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    options = "--seconds 0.5 --horizon 8 --seeds 2 --methods 'srd, regular' --size 64x36 --reference-seconds 4"
    assert main(["bench", "prism", "ball", "-o", str(out), *shlex.split(options)]) == 0
    assert seen.scenes == ["prism", "ball"] and seen.reported == out
    assert seen.settings == BenchSettings(0.5, 2, ("srd", "regular-7", "regular-16"), (64, 36), 4.0, horizon=8.0)
    repeated = "spectrasplat bench prism ball -o out " + options.replace("srd, regular", "srd,regular")
    assert shlex.split(seen.command) == shlex.split(repeated)
    shown = capsys.readouterr().out
    assert "prism, 64" not in shown
    assert all(text in shown for text in ("40×", "−1.00 ± 0.10", "20 %", "report.html"))


@pytest.fixture
def three_shipped(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Two shipped scenes, and one without glass, are all that there are."""
    mirror = tmp_path / "mirror.toml"
    mirror.write_text('[[objects]]\nshape = "sphere"\nmaterial = "mirror"\n', encoding="utf-8")
    shipped = shipped_scenes()
    few = {"mirror": mirror, "prism": shipped["prism"], "water": shipped["water"]}
    monkeypatch.setattr(scenes, "shipped_scenes", lambda: few)


def test_defaults_are_all_scenes_with_glass_and_all_methods(seen: Seen, tmp_path: Path, three_shipped: None) -> None:
    assert main(["bench", "-o", str(tmp_path)]) == 0
    assert seen.settings == BenchSettings() and set(BenchSettings().methods) == set(METHODS)
    assert seen.scenes == ["prism", "water"] and shlex.split(seen.command)[2:4] == seen.scenes


def test_the_camera_has_its_own_defaults(seen: Seen, tmp_path: Path) -> None:
    assert main(["bench", "--camera", "-o", str(tmp_path)]) == 0
    methods = ("stochastic", "stochastic-even", "regular-7", "regular-16", "srd-lambda", "srd")
    assert seen.settings == BenchSettings(20.0, methods=methods, measured_pass="camera")
    assert {*methods, "srd-photons"} == set(CAMERA_METHODS)
    assert seen.scenes == ["prism_edge", "lens_text", "brilliant_studio", "ball_caustic"]
    assert shlex.split(seen.command)[:4] == ["spectrasplat", "bench", "--camera", "prism_edge"]
    assert (
        main(["bench", "--camera", "prism", "-o", str(tmp_path / "other"), "--seconds", "2", "--methods", "srd"]) == 0
    )
    assert seen.settings == BenchSettings(2.0, methods=("srd",), measured_pass="camera") and seen.scenes == ["prism"]


def test_ctrl_c_says_what_is_kept_and_reports_it(
    seen: Seen, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    seen.interrupt = True
    assert main(["bench", "prism", "-o", str(tmp_path)]) == 130
    told = capsys.readouterr()
    assert (
        f"stopped; 0 scenes done, 1 of {2 * len(METHODS)} method seeds of 'prism' kept; the same command goes on from "
        "there" in told.err
    )
    assert seen.reported == tmp_path and "40×" in told.out


def test_a_scene_without_light_costs_the_others_nothing(
    seen: Seen, tmp_path: Path, capsys: pytest.CaptureFixture[str], three_shipped: None
) -> None:
    """The others are measured and reported; who named it is told by the exit code as well, and alone it is an error."""
    seen.dark = "water"
    assert main(["bench", "water", "prism", "-o", str(tmp_path)]) == 1
    assert "note: 'water': nothing to measure" in capsys.readouterr().err and seen.reported == tmp_path
    assert main(["bench", "-o", str(tmp_path / "all")]) == 0
    assert main(["bench", "water", "-o", str(tmp_path / "alone")]) != 0
    assert "spectrasplat: 'water': nothing to measure" in capsys.readouterr().err


def test_two_scenes_of_one_name(tmp_path: Path) -> None:
    other = tmp_path / "prism.toml"
    other.write_text('[[objects]]\nshape = "sphere"\nglass = "N-SF11"\n')
    with pytest.raises(UserError, match="another scene of this run is called 'prism' too"):
        scenes.load_scenes(["prism", str(other)])
