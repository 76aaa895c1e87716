"""./run and ./test on machines that lack something, with stand-ins for Python, pip and apt-get."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOOLS = (
    "bash",
    "readlink",
    "mktemp",
    "rm",
    "cat",
    "tail",
    "grep",
    "env",
    "mkdir",
    "chmod",
    "cp",
    "basename",
    "dirname",
)

# Plays python3, and `python -m venv` puts a copy of it into the new environment.
PYTHON = """#!/bin/bash
all="$*"
echo "$(basename "$0") $*" >>"$LOG"
case "$*" in
    *ensurepip*) exit "${NO_VENV:-0}" ;;
    *version_info\\[:2\\]*) echo 3.11 ;;
    *version_info*) exit "${TOO_OLD:-0}" ;;
    *"-m venv"*) mkdir -p "${@: -1}/bin"; cp "$0" "${@: -1}/bin/python"; echo "${@: -1}" >"${@: -1}/bin/activate" ;;
    *"-m pip"*) exit "${NO_NETWORK:-0}" ;;
    *create_context*) exit "${NO_OPENGL:-0}" ;;
    *"-m spectrasplat "*) echo "program: ${all#*-m spectrasplat }" ;;
    *"-m pytest"*) echo "tests:${all#*-m pytest}" ;;
esac
"""


class Machine:
    """A checkout and a PATH with nothing but stand-ins and a few plain tools."""

    def __init__(self, folder: Path) -> None:
        self.root, self.bin, self.log = folder / "check out", folder / "bin", folder / "log"
        (self.root / ".ci").mkdir(parents=True)
        self.bin.mkdir()
        for name in ("run", "test", "pyproject.toml", ".ci/setup.sh", ".ci/run"):
            shutil.copy(ROOT / name, self.root / name)
        for tool in TOOLS:
            found = shutil.which(tool)
            assert found is not None
            (self.bin / tool).symlink_to(found)
        self.add("python3", PYTHON)
        self.add("id", "#!/bin/bash\necho 1000\n")

    def add(self, name: str, script: str) -> None:
        (self.bin / name).write_text(script)
        (self.bin / name).chmod(0o755)

    def call(self, script: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        self.log.write_text("")
        return subprocess.run(
            [str(self.root / script), *arguments],
            env={"PATH": str(self.bin), "LOG": str(self.log), **environment},
            cwd=self.root.parent,
            capture_output=True,
            text=True,
            timeout=30,
            check=False,
        )


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


def test_first_run_sets_up_and_the_second_starts_at_once(machine: Machine) -> None:
    first = machine.call("run", "render", "prism", "-o", "a b.png")
    assert first.stdout == "program: render prism -o a b.png\n", first.stderr
    assert "-m pip install" in machine.log.read_text()
    assert "spectrasplat.model.geometry.bvh --warm" in machine.log.read_text()
    second = machine.call("run", "doctor")
    assert (second.stdout, second.stderr) == ("program: doctor\n", "")
    assert machine.log.read_text() == "python -P -m spectrasplat doctor\n"


def test_without_arguments_the_default_scene_is_rendered(machine: Machine) -> None:
    assert machine.call("run").stdout == (
        "program: render default --size 768x432 --photons 150k --spp 4 -o spectrasplat-default.png\n"
    )


@pytest.mark.parametrize("variable", ["DISPLAY", "WAYLAND_DISPLAY"])
def test_without_arguments_on_a_display_the_viewer_opens(machine: Machine, variable: str) -> None:
    assert machine.call("run", **{variable: ":0"}).stdout == "program: view\n"


def test_a_changed_project_is_installed_again(machine: Machine) -> None:
    machine.call("run", "doctor")
    with (machine.root / "pyproject.toml").open("a") as project:
        project.write("# one more dependency\n")
    assert "installing the packages" in machine.call("run", "doctor").stderr
    assert "-m venv" not in machine.log.read_text()
    assert machine.call("run", "doctor").stderr == ""


def test_a_moved_checkout_gets_a_new_environment(machine: Machine, tmp_path: Path) -> None:
    machine.call("run", "doctor")
    machine.root = machine.root.rename(tmp_path / "moved")
    assert machine.call("run", "doctor").stdout == "program: doctor\n"
    assert "-m venv" in machine.log.read_text()


@pytest.mark.parametrize("script", ["test", ".ci/run"])
def test_tests_pass_their_arguments_on(machine: Machine, script: str) -> None:
    assert (
        machine.call(script, "-k", "two words").stdout
        == "tests: -n auto --dist loadfile --no-loadscope-reorder -k two words\n"
    )
    assert f"--editable {machine.root}[test]" in machine.log.read_text()


def test_no_python(machine: Machine) -> None:
    (machine.bin / "python3").unlink()
    done = machine.call("run")
    assert done.returncode == 2
    assert done.stderr.startswith("spectrasplat: Python 3.11 or newer is needed: run 'sudo apt-get install")
    assert not (machine.root / ".venv").exists()


def test_python_too_old(machine: Machine) -> None:
    done = machine.call("run", TOO_OLD="1")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "Python 3.11 or newer is needed" in done.stderr


def test_no_venv_module(machine: Machine) -> None:
    done = machine.call("run", NO_VENV="1")
    assert done.returncode == 2
    assert "run 'sudo apt-get install python3.11-venv'" in done.stderr


def test_root_installs_what_is_missing(machine: Machine) -> None:
    machine.add("id", "#!/bin/bash\necho 0\n")
    machine.add("apt-get", '#!/bin/bash\necho "apt-get $*" >>"$LOG"\n')
    assert machine.call("run", NO_VENV="1").returncode == 2
    assert "apt-get -qq -y install python3.11-venv" in machine.log.read_text()
    assert machine.call("run", "doctor", NO_OPENGL="1").returncode == 0
    assert "apt-get -qq -y install libegl1 libgl1 libgl1-mesa-dri" in machine.log.read_text()


def test_no_network_then_network(machine: Machine) -> None:
    done = machine.call("run", "doctor", NO_NETWORK="1")
    assert done.returncode == 2 and "check the network" in done.stderr
    assert machine.call("run", "doctor").stdout == "program: doctor\n"


def test_without_opengl_the_program_runs_and_the_tests_do_not(machine: Machine) -> None:
    assert machine.call("run", "doctor", NO_OPENGL="1").stdout == "program: doctor\n"
    done = machine.call("test", NO_OPENGL="1")
    assert (done.returncode, done.stdout) == (2, "")
    assert "run 'sudo apt-get install libegl1 libgl1 libgl1-mesa-dri'" in done.stderr
    assert (
        machine.call("test").stdout == "tests: -n auto --dist loadfile --no-loadscope-reorder\n"
    )  # once it is there, it is found
