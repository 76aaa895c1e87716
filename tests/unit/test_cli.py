"""The command line: every mistake ends in one sentence and exit code 2, every success in a file; shell completion."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from PIL import Image
from spectrasplat.__main__ import main
from spectrasplat.base.errors import UserError
from spectrasplat.commands import options
from spectrasplat.commands.measuring_table import MEASURED_PARTS, PROOF_PARTS
from spectrasplat.commands.program import COMMANDS, named
from spectrasplat.commands.proof_steps import PARTS
from spectrasplat.commands.scenes import find_scene
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.scene import Black, Camera, Diffuse, RenderDefaults, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings

pytestmark = pytest.mark.core

ROOT = Path(__file__).resolve().parents[2]


@dataclass
class FakeStats:
    photons: int = 1234567
    splats: int = 7654321
    seconds: float = 1.5
    renderer: str = "llvmpipe (LLVM 15)"
    is_software: bool = True
    notices: tuple[str, ...] = ()

    def lines(self) -> list[str]:
        return ["deposited 40.0 %", "escaped 60.0 %"]


@dataclass
class FakeResult:
    rgb: np.ndarray
    spectral: np.ndarray | None = None
    bin_edges_nm: np.ndarray | None = None
    stats: FakeStats = field(default_factory=FakeStats)


class FakeRenderer:
    """Stands where `spectrasplat.render.still` stands and remembers what it was asked."""

    def __init__(self) -> None:
        self.settings: RenderSettings | None = None
        self.press_ctrl_c = False
        self.saw_cancelled: bool | None = None

    def render(
        self, scene: Scene, settings: RenderSettings, *, progress: Any, cancelled: Any, begun: float
    ) -> FakeResult:
        assert 0.0 <= time.perf_counter() - begun < 60.0
        self.settings = settings
        progress(0.5, "half")
        if self.press_ctrl_c:
            assert not cancelled()
            os.kill(os.getpid(), signal.SIGINT)
            self.saw_cancelled = cancelled()
        return FakeResult(np.full((settings.height, settings.width, 3), 0.25, np.float32))


def small_scene() -> Scene:
    triangle = make_mesh("t", np.eye(3), np.array([[0, 1, 2]]))
    return Scene(
        name="small",
        camera=Camera((0, 0, 5), (0, 0, 0), (0, 1, 0)),
        lights=(),
        objects=(
            SceneObject("floor", triangle, Diffuse()),
            SceneObject("wall", triangle, Diffuse()),
            SceneObject("stop", triangle, Black()),
        ),
        render=RenderDefaults(width=32, height=16, photons=5000, exposure_ev=0.5, max_depth=20),
        notes=("a table was added",),
    )


@pytest.fixture
def renderer(monkeypatch: pytest.MonkeyPatch) -> FakeRenderer:
    """A renderer and a scene reader that need neither OpenGL nor files."""
    fake = FakeRenderer()
    render_module, scene_module = (
        ModuleType("spectrasplat.render.still"),
        ModuleType("spectrasplat.model.io.scene_file"),
    )
    render_module.render = fake.render  # type: ignore[attr-defined]
    scene_module.load_scene = lambda path: small_scene()  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "spectrasplat.render.still", render_module)
    monkeypatch.setitem(sys.modules, "spectrasplat.model.io.scene_file", scene_module)
    return fake


@pytest.fixture
def scene_path(tmp_path: Path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text("")
    return path


def complaint(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The one line that a mistaken command line leads to (after the notes, if it came so far)."""
    assert main([str(argument) for argument in arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    told = captured.err.removeprefix("note: a table was added\n")
    assert told.count("\n") == 1 and told.startswith("spectrasplat: ")
    assert "Traceback" not in told and "╭" not in told
    return told


class TestRender:
    def test_scene_decides_where_the_user_does_not(
        self, renderer: FakeRenderer, scene_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        output = tmp_path / "out.npy"
        assert main(["render", str(scene_path), "-o", str(output)]) == 0
        assert renderer.settings == RenderSettings(width=32, height=16, photons=5000, exposure_ev=0.5, max_depth=20)
        assert np.load(output).shape == (16, 32, 3)
        captured = capsys.readouterr()
        assert str(output) in captured.out
        assert "1,234,567 photons, 7,654,321 splats in 1.5 s (software renderer: llvmpipe (LLVM 15))" in captured.out
        assert "deposited" not in captured.out
        assert captured.err == "note: a table was added\n"

    def test_every_option_arrives(
        self, renderer: FakeRenderer, scene_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        options = (
            "--size 64x48 --photons 2M --seed 7 --method srd-lambda --layer map:wall --bins 8 "
            "--exposure -1.5 --max-depth 9 --spp 4 --batch 1000 --stats"
        )
        assert main(["render", str(scene_path), "-o", str(tmp_path / "out.npy"), *options.split()]) == 0
        assert renderer.settings == RenderSettings(
            width=64,
            height=48,
            photons=2_000_000,
            seed=7,
            method="srd-lambda",
            layer="map:wall",
            bins=8,
            exposure_ev=-1.5,
            max_depth=9,
            spp=4,
            batch=1000,
            tally=True,
        )
        assert "deposited 40.0 %\nescaped 60.0 %\n" in capsys.readouterr().out

    def test_seconds_replace_the_scenes_photons(self, renderer: FakeRenderer, scene_path: Path, tmp_path: Path) -> None:
        assert main(["render", str(scene_path), "-o", str(tmp_path / "out.npy"), "--seconds", "2.5"]) == 0
        assert renderer.settings is not None
        assert (renderer.settings.photons, renderer.settings.seconds) == (None, 2.5)

    def test_ctrl_c_keeps_what_was_done(
        self, renderer: FakeRenderer, scene_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        renderer.press_ctrl_c = True
        before = signal.getsignal(signal.SIGINT)
        assert main(["render", str(scene_path), "-o", str(tmp_path / "out.npy")]) == 130
        assert renderer.saw_cancelled is True
        assert (tmp_path / "out.npy").is_file()
        assert "stopped early" in capsys.readouterr().out
        assert signal.getsignal(signal.SIGINT) is before

    def test_a_failing_renderer_leaves_the_old_picture(
        self,
        renderer: FakeRenderer,
        scene_path: Path,
        tmp_path: Path,
        capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        def fail(*_: object, **__: object) -> None:
            raise UserError("light 'sun' lies\ninside glass")

        monkeypatch.setattr(sys.modules["spectrasplat.render.still"], "render", fail)
        output = tmp_path / "out.npy"
        output.write_text("old")
        told = complaint(capsys, "render", scene_path, "-o", output)
        assert told == "spectrasplat: light 'sun' lies inside glass\n"
        assert output.read_text() == "old"
        assert sorted(tmp_path.iterdir()) == sorted([output, scene_path])


class TestFindScene:
    @pytest.fixture(autouse=True)
    def shipped(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
        folder = tmp_path / "assets" / "scenes"
        folder.mkdir(parents=True)
        for name in ("prism.toml", "ball.glb", "README.md"):
            (folder / name).write_text("")
        monkeypatch.setattr("spectrasplat.base.paths.assets_dir", lambda: folder.parent)
        return folder

    def test_by_name(self, shipped: Path) -> None:
        assert find_scene("prism") == shipped / "prism.toml"
        assert find_scene("ball") == shipped / "ball.glb"

    def test_a_file_wins_over_a_name(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        Path("prism").write_text("")
        assert find_scene("prism") == Path("prism")

    @pytest.mark.parametrize(
        ("text", "sentence"),
        [
            ("prsm", "did you mean 'prism'"),
            ("prsm", "shipped are ball, prism"),
            ("prism.toml", "did you mean the shipped scene 'prism'"),
            ("assets/scenes/prismm.toml", "did you mean 'assets/scenes/prism.toml'"),
            ("assets", "is a folder"),
            ("zzz/zzz.toml", "scene file zzz/zzz.toml does not exist: check the path"),
        ],
    )
    def test_unknown(self, text: str, sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        with pytest.raises(UserError) as caught:
            find_scene(text)
        assert sentence in str(caught.value)


class TestGlass:
    def test_an_exact_name_is_told_in_full(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["glass", "N-SF11"]) == 0
        out = capsys.readouterr().out
        for fact in ("Schott N-SF11", "1.784720", "25.680", "-0.152878", "1.73759695", "CC0", "370-2500"):
            assert fact in out

    def test_several_hits_are_listed_uncut(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["glass", "BK7"]) == 0
        out = capsys.readouterr().out
        assert "N-BK7" in out and "1.51680" in out and "64.17" in out and "…" not in out

    def test_plot(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        assert main(["glass", "N-SF6", "--plot", str(tmp_path / "n.png")]) == 0
        assert str(tmp_path / "n.png") in capsys.readouterr().out
        with Image.open(tmp_path / "n.png") as picture:
            assert picture.width > 1000 and len(picture.convert("RGB").getcolors(1 << 20)) > 500

    @pytest.mark.parametrize(
        ("arguments", "sentence"),
        [
            (["zzzzqq"], "no glass resembles 'zzzzqq'"),
            (["--plot", "n.png"], "--plot shows at most 6 glasses"),
            (["N-BK7", "--plot", "n.jpg"], "must end in .png"),
        ],
    )
    def test_mistakes(
        self,
        arguments: list[str],
        sentence: str,
        capsys: pytest.CaptureFixture[str],
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.chdir(tmp_path)
        assert sentence in complaint(capsys, "glass", *arguments)
        assert list(tmp_path.iterdir()) == []


class TestProgram:
    @pytest.mark.parametrize("name", COMMANDS)
    def test_every_command_has_a_function_of_its_options(self, name: str) -> None:
        values, runs = COMMANDS[name]
        notes = named(runs).__annotations__
        assert notes["options"].split(".")[-1] == named(values).__name__ and notes["return"] == "int"

    def test_every_part_of_the_proof_can_be_chosen(self) -> None:
        assert [part.key for part in PARTS] == ["doctor", *PROOF_PARTS, *MEASURED_PARTS]

    @pytest.mark.parametrize(
        ("arguments", "sentence"),
        [
            (["rendr"], "no such command 'rendr', did you mean 'render'"),
            (["render"], "missing argument 'SCENE'"),
            (["render", "prism"], "missing option '-o' / '--output'"),
            (["doctor", "now"], "unexpected extra argument"),
            (["render", "prism", "--photon", "5"], "no such option '--photon' (did you mean"),
        ],
    )
    def test_wrong_usage(self, arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
        told = complaint(capsys, *arguments)
        assert sentence in told.replace("(s)", "")
        assert "spectrasplat --help" in told

    @pytest.mark.parametrize(
        ("error", "code", "told"),
        [
            (UserError("scene x: no"), 2, "spectrasplat: scene x: no\n"),
            (MemoryError(), 2, "spectrasplat: out of memory: use fewer photons, a smaller picture or a simpler mesh\n"),
            (KeyboardInterrupt(), 130, "spectrasplat: interrupted\n"),
        ],
    )
    def test_exit_codes(
        self,
        error: BaseException,
        code: int,
        told: str,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        def fail(_arguments: object) -> int:
            raise error

        monkeypatch.setattr("spectrasplat.commands.program.run", fail)
        assert main(["doctor"]) == code
        assert capsys.readouterr().err == told

    def test_a_bug_is_not_hidden(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def fail(_arguments: object) -> int:
            raise ZeroDivisionError

        monkeypatch.setattr("spectrasplat.commands.program.run", fail)
        with pytest.raises(ZeroDivisionError):
            main(["doctor"])

    @pytest.mark.parametrize("arguments", [["render", "--help"], pytest.param(["doctor"], marks=pytest.mark.slow)])
    def test_a_closed_pipe_is_quiet(self, arguments: list[str]) -> None:
        reader, writer = os.pipe()
        os.close(reader)
        try:
            done = subprocess.run(
                [sys.executable, "-m", "spectrasplat", *arguments],
                cwd=ROOT,
                stdout=writer,
                stderr=subprocess.PIPE,
                timeout=60,
                check=False,
            )
        finally:
            os.close(writer)
        assert (done.returncode, done.stderr) == (1, b"")

    def test_start_imports_nothing_heavy(self) -> None:
        # The warm start to the first picture has a budget of 3 s. A picture without beams needs no machine code.
        code = (
            "import sys; from spectrasplat.__main__ import main; main(['render', 'x', '-o', 'x.jpg']);"
            "import spectrasplat.render.still;"
            "heavy = {'colour', 'scipy', 'matplotlib', 'numba', 'trimesh', 'OpenEXR', 'imgui_bundle', 'glfw'};"
            "print(sorted(heavy & set(sys.modules)))"
        )
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=30, check=True
        )
        assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("text", "count"),
    [("1", 1), ("1000000", 10**6), ("1e6", 10**6), ("2M", 2 * 10**6), ("1.5k", 1500), ("1_000", 1000)],
)
def test_photons_are_read(text: str, count: int) -> None:
    assert options.photons("--photons", text) == count


@pytest.mark.parametrize("text", ["960x540", "960X540", " 960×540"])
def test_sizes_are_read(text: str) -> None:
    assert options.size("--size", text) == (960, 540)


SHELLS = ("bash", "zsh", "fish")


@pytest.fixture
def answer(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[[str, str], str]:
    """What the program prints when a shell asks how a line goes on."""

    def ask(shell: str, line: str) -> str:
        asked = {
            "bash": {"COMP_WORDS": line, "COMP_CWORD": str(len(line.split(" ")) - 1)},
            "zsh": {"COMP_WORDS": line, "COMP_CWORD": str(len(line.split(" ")) - 1)},
            "fish": {"COMP_WORDS": line, "COMP_CWORD": line.split(" ")[-1]},
        }[shell]
        for name, value in (asked | {"_SPECTRASPLAT_COMPLETE": f"{shell}_complete"}).items():
            monkeypatch.setenv(name, value)
        with pytest.raises(SystemExit):
            main([])
        captured = capsys.readouterr()
        assert captured.err == ""
        return captured.out.replace("plain,", "").replace("file,", "files: ")

    return ask


@pytest.mark.parametrize("shell", SHELLS)
def test_shipped_scenes_are_offered(answer: Callable[[str, str], str], shell: str) -> None:
    offered = answer(shell, "spectrasplat render pri")
    assert all(name in offered for name in ("prism", "prism_case", "prism_edge")) and "ball" not in offered


@pytest.mark.parametrize(
    ("line", "wanted", "unwanted"),
    [
        ("spectrasplat ren", "render", "bake"),
        ("spectrasplat render --camera-m", "--camera-method", "--photons"),
        ("spectrasplat bake prism ", "table", "caustic"),
        ("spectrasplat render prism --layer m", "map:table", "beauty"),
        ("spectrasplat render --spp 4 prism --layer ", "caustic", "map:floor"),
        ("spectrasplat render prism --method sr", "srd-lambda", "regular-7"),
        ("spectrasplat render prism --camera-method sto", "stochastic-even", "stochastic-point"),
        ("spectrasplat bench --methods srd,reg", "srd,regular-16", "srd,srd"),
        ("spectrasplat glass N-SF", "N-SF11", "N-BK7"),
    ],
)
def test_what_is_offered(answer: Callable[[str, str], str], line: str, wanted: str, unwanted: str) -> None:
    offered = answer("bash", line).splitlines()
    assert wanted in offered and unwanted not in offered


@pytest.mark.parametrize("scene", ["nowhere", "broken.toml", "folder"])
def test_a_scene_that_cannot_be_read_offers_nothing(
    answer: Callable[[str, str], str], scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken.toml").write_text("= 3")
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path)
    assert answer("bash", f"spectrasplat bake {scene} ").strip() == "files:"


def test_options_without_words_offer_files(answer: Callable[[str, str], str]) -> None:
    assert answer("bash", "spectrasplat render prism -o pict").strip() == "files: pict"


@pytest.mark.parametrize("shell", [shell for shell in SHELLS if shutil.which(shell)])
def test_the_script_of_a_shell_is_shown_and_installed_once(
    shell: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SHELL", f"/bin/{shell}")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["--show-completion"]) == 0
    script = capsys.readouterr().out
    assert "_SPECTRASPLAT_COMPLETE" in script and "spectrasplat" in script
    assert main(["--install-completion"]) == main(["--install-completion"]) == 0
    (file,) = (each for each in tmp_path.rglob("*") if each.is_file())
    assert file.read_text().count(script.strip()) == 1


def test_an_unknown_shell_has_no_script(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("SHELL", "/bin/tcsh")
    assert "known are bash, zsh, fish" in complaint(capsys, "--install-completion")
