"""Templates for schedulers: they are valid, and what they run are commands that the program takes."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.unit.test_documentation import complaint

INTEGRATIONS = Path(__file__).resolve().parents[2] / "integrations"


def check(commands: list[list[str]]) -> None:
    """Each is a command of the program with options that it has."""
    assert commands
    for command in commands:
        assert command[0] == "spectrasplat"
        assert complaint(shlex.join(command)) == "", command


def openjd_job(name: str, values: dict[str, str], tmp_path: Path) -> object:
    """The job that a template makes."""
    model = pytest.importorskip("openjd.model", reason="pip install openjd-model, to validate OpenJobDescription")
    path = INTEGRATIONS / "openjd" / name
    template = model.decode_job_template(
        template=model.document_string_to_object(document=path.read_text(), document_type=model.DocumentType.YAML)
    )
    given = model.preprocess_job_parameters(
        job_template=template,
        job_parameter_values=values,
        job_template_dir=path.parent,
        current_working_dir=tmp_path,
        allow_job_template_dir_walk_up=True,
    )
    return model.create_job(job_template=template, job_parameter_values=given)


def test_the_openjd_picture_traces_every_part_and_merges_them(tmp_path: Path) -> None:
    values = {"Scene": "lens", "PartFolder": str(tmp_path), "Picture": str(tmp_path / "a.exr"), "Parts": "4"}
    job = openjd_job("picture.yaml", values, tmp_path)
    from openjd.model import StepDependencyGraph, StepParameterSpaceIterator

    trace, merge = job.steps  # type: ignore[attr-defined]
    parts = [task["Part"].value for task in StepParameterSpaceIterator(space=trace.parameterSpace)]
    assert parts == ["1", "2", "3", "4"]
    graph = StepDependencyGraph(job=job)  # type: ignore[arg-type]
    assert [edge.origin.step.name for edge in graph.step_node(stepname="Merge").in_edges] == ["Trace"]
    commands = []
    for step, number in ((trace, "3"), (merge, "")):
        action = step.script.actions.onRun
        texts = [str(argument) for argument in [action.command, *action.args]]
        for key, value in {"Size": "1920x1080", "Photons": "64M", "Samples": "64", "Seed": "1", **values}.items():
            texts = [text.replace("{{Param." + key + "}}", value) for text in texts]
        commands.append([text.replace("{{Task.Param.Part}}", number) for text in texts])
    check(commands)
    assert "--passes=3/4" in commands[0] and not any("{{" in text for text in commands[0] + commands[1])


def test_the_openjd_frames_are_all_drawn(tmp_path: Path) -> None:
    job = openjd_job("frames.yaml", {"Scene": "lens", "Keys": "k.toml", "Folder": str(tmp_path)}, tmp_path)
    (step,) = job.steps  # type: ignore[attr-defined]
    script = str(step.script.embeddedFiles[0].data)
    drawn: list[int] = []
    for ten in range(1, 25):
        text = script.replace("{{Task.Param.Ten}}", str(ten)).replace("exec spectrasplat", "echo spectrasplat")
        for key, value in (("Frames", "240"), ("Size", "64x36"), ("Photons", "4M"), ("Scene", "lens")):
            text = text.replace("{{Param." + key + "}}", value)
        text = text.replace("{{Param.Keys}}", "k.toml").replace("{{Param.Folder}}", "out")
        told = subprocess.run(["bash", "-c", text], capture_output=True, text=True, check=True).stdout
        command = shlex.split(told)
        check([command])
        first, last = command[command.index("--frames") + 1].removesuffix("/240").split("-")
        drawn += range(int(first), int(last) + 1)
    assert drawn == list(range(240))


FLAMENCO = """
const tasks = [];
const author = {
  Task: (name, type) => ({name, type, commands: [], before: [],
    addCommand(c) { this.commands.push(c); }, addDependency(t) { this.before.push(t.name); }}),
  Command: (name, parameters) => ({name, parameters}),
};
eval(require("fs").readFileSync(process.argv[1], "utf8") + "; globalThis.made = [JOB_TYPE, compileJob];");
const [type, compile] = globalThis.made;
const settings = Object.fromEntries(type.settings.map(s => [s.key, s.default]));
compile({settings: {...settings, ...JSON.parse(process.argv[2])}, addTask: t => tasks.push(t)});
console.log(JSON.stringify(tasks));
"""


@pytest.mark.parametrize("parts", [3, 200])
def test_the_flamenco_job_merges_every_part_once(parts: int) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the Flamenco job type is not run")
    given = json.dumps({"scene": "lens", "picture": "/shared/lens.exr", "parts": parts})
    file = INTEGRATIONS / "flamenco" / "spectrasplat_picture.js"
    done = subprocess.run([node, "-e", FLAMENCO, str(file), given], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    tasks = {task["name"]: task for task in json.loads(done.stdout)}
    commands = {name: ["spectrasplat", *task["commands"][0]["parameters"]["args"]] for name, task in tasks.items()}
    check(list(commands.values())[:1] + list(commands.values())[-5:])
    # From the picture back through the tree every part is reached once, each by who made it.
    made = {command[command.index("-o") + 1]: name for name, command in commands.items()}
    reached, todo = [], ["/shared/lens.exr"]
    while todo:
        name = made[todo.pop()]
        read = [word for word in commands[name][1:] if word.endswith(".ssp") and commands[name][1] == "merge"]
        read = [word for word in read if word != commands[name][commands[name].index("-o") + 1]]
        assert sorted(made[word] for word in read) == sorted(tasks[name]["before"])
        assert len(read) <= 64
        todo += read
        reached += [name] if name.startswith("trace-") else []
    assert sorted(reached) == sorted(f"trace-{part}" for part in range(1, parts + 1))


SBATCH = """#!/bin/bash
# Runs an array's tasks at once, in order, as Slurm would with one node; kills nothing, checks what comes before.
n=$(($(cat "$FAKE/jobs" 2>/dev/null || echo 0) + 1)); echo $n > "$FAKE/jobs"
while [[ $1 == --* ]]; do case $1 in
    --array=*) array=${1#--array=1-} ;;
    --dependency=afterok:*) [ -e "$FAKE/done${1#--dependency=afterok:}" ] || exit 1 ;;
    --export=ALL,SPECTRASPLAT_STEP=*) s=${1#--export=ALL,SPECTRASPLAT_STEP=}; step=${s%%,*}; export "${s#*,}" ;;
    --parsable) ;;
    *) echo "$1" >> "$FAKE/options" ;;
esac; shift; done
script=$1; shift
for ((task = 1; task <= array; task++)); do
    SPECTRASPLAT_STEP=$step SLURM_ARRAY_TASK_ID=$task bash "$script" "$@" >> "$FAKE/log" 2>&1 || exit 1
done
touch "$FAKE/done$n"; echo "$n;cluster"
"""
PROGRAM = """#!/bin/bash
printf '%q ' spectrasplat "$@" >> "$FAKE/commands"; echo >> "$FAKE/commands"
while [ "$1" != -o ]; do shift; done; echo made > "$2"
"""


def slurm(tmp_path: Path, program: str | None, parts: int, *arguments: str) -> tuple[str, list[list[str]]]:
    """What the script says, and the commands that its tasks ran; `program` stands in for ours."""
    bin_folder = tmp_path / "bin"
    bin_folder.mkdir(exist_ok=True)
    for name, text in (("sbatch", SBATCH), ("spectrasplat", program)):
        if text is not None:
            (bin_folder / name).write_text(text)
            (bin_folder / name).chmod(0o755)
    path = f"{bin_folder}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "FAKE": str(tmp_path), "PARTS": str(parts)}
    script = ["bash", str(INTEGRATIONS / "slurm" / "picture.sh"), *arguments]
    done = subprocess.run(script, env=environment, capture_output=True, text=True, check=False)
    log = tmp_path / "log"
    assert done.returncode == 0, done.stderr + (log.read_text() if log.exists() else "")
    ran = tmp_path / "commands"
    return done.stdout, [shlex.split(line) for line in ran.read_text().splitlines()] if ran.exists() else []


def test_the_slurm_script_merges_in_a_tree(tmp_path: Path) -> None:
    subprocess.run(["bash", "-n", str(INTEGRATIONS / "slurm" / "picture.sh")], check=True)
    picture = tmp_path / "a.exr"
    arguments = ("lens", str(picture), "--photons", "1G", "--", "--gres=gpu:1")
    told, commands = slurm(tmp_path, PROGRAM, 130, *arguments)
    assert told.endswith(f"will write {picture}\n") and picture.exists()
    check([commands[0], commands[-1], commands[-2]])
    traced = [command for command in commands if command[1] == "render"]
    merges = [command for command in commands if command[1] == "merge"]
    assert [c[c.index("--passes") + 1] for c in traced] == [f"{i}/130" for i in range(1, 131)]
    assert all(c[c.index("--photons") + 1] == "1G" for c in traced)
    read = [Path(word).name for c in merges[:-1] for word in c[2:-2]]
    assert sorted(read) == sorted(f"0-{i}.ssp" for i in range(1, 131)), "each part once"
    assert [Path(word).name for word in merges[-1][2:5]] == ["1-1.ssp", "1-2.ssp", "1-3.ssp"]
    assert (tmp_path / "options").read_text().split() == ["--gres=gpu:1"] * 3
    # What is there is left alone when all is submitted again.
    (tmp_path / "commands").unlink()
    _, again = slurm(tmp_path, PROGRAM, 130, *arguments)
    assert [command[1] for command in again] == ["merge"]


@pytest.mark.slow
def test_the_slurm_script_makes_the_picture(tmp_path: Path) -> None:
    import numpy as np
    from spectrasplat.__main__ import main

    asked = ("--size", "48x27", "--photons", "30k", "--spp", "2", "--batch", "4096")
    runs = '#!/bin/bash\nexec python -m spectrasplat "$@"\n'
    slurm(tmp_path, runs, 3, "lens", str(tmp_path / "a.npy"), *asked)
    assert main(["render", "lens", *asked, "-o", str(tmp_path / "b.npy")]) == 0
    a, b = np.load(tmp_path / "a.npy"), np.load(tmp_path / "b.npy")
    assert np.abs(a - b).max() <= 1e-6 * b.max()
