"""Farms on this machine: workers that are killed lose nothing and double nothing, what was done is gone on from."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from farm_rig import SCENE, SETTINGS, farmed, kill
from PIL import Image
from spectrasplat.__main__ import main
from spectrasplat.base import atomic
from spectrasplat.base.errors import UserError
from spectrasplat.commands.scenes import find_scene
from spectrasplat.farm.still import StillJob
from spectrasplat.gpu.context import create_context
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.still import render

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="workers are looked after as POSIX has it"),
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning"),
]
pytest.importorskip("distributed", reason="pip install '.[farm]'")
SMALL = RenderSettings(width=48, height=27, photons=30_000, spp=2, batch=4096)


class Killer:
    """Kills one of the workers so often, each time once `after` more parts are done."""

    def __init__(self, times: int, after: int) -> None:
        self.times, self.after = times, after
        self.killed: list[int] = []

    def __call__(self, job: StillJob, process_ids: list[int]) -> None:
        is_time = len(self.killed) < self.times and len(job.kept.indices) >= self.after * (1 + len(self.killed))
        if is_time and process_ids[0] not in self.killed:  # the same worker, begun again
            self.killed.append(process_ids[0])
            kill(process_ids[0])


def whole(settings: RenderSettings) -> np.ndarray:
    """By one process."""
    with create_context() as context:
        return render(load_scene(find_scene(SCENE)), settings, context=context).rgb


@pytest.mark.slow
def test_a_killed_worker_loses_nothing(tmp_path: Path) -> None:
    killer = Killer(1, after=1)
    job, _ = farmed(tmp_path / "parts", 1, 3, killer, settings=SMALL)
    assert len(killer.killed) == 1 and job.kept.count == 3
    one = whole(SMALL)
    assert np.abs(job.picture.rgb - one).max() <= 4e-6 * one.max()
    assert len(list((tmp_path / "parts").glob("*.ssp"))) == 3


@pytest.mark.slow
def test_eight_parts_on_four_workers_of_which_one_is_killed_twice(tmp_path: Path) -> None:
    killer = Killer(2, after=1)
    job, _ = farmed(tmp_path / "parts", 4, 8, killer, settings=SETTINGS)
    assert len(set(killer.killed)) == 2
    one = whole(SETTINGS)
    assert np.abs(job.picture.rgb - one).max() <= 4e-6 * one.max()
    # It can fail: without one of its parts the picture is another.
    parts = sorted((tmp_path / "parts").glob("*.ssp"))
    assert len(parts) == 8
    merged = tmp_path / "a.npy"
    assert main(["merge", *map(str, parts[1:]), "--partial", "-o", str(merged)]) == 0
    assert np.abs(np.load(merged) - one).max() > 1e-4 * one.max()


@pytest.mark.slow
def test_what_is_stopped_is_gone_on_from_and_what_is_cut_short_done_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, notes = tmp_path / "parts", list[str]()

    def fill_the_disk(job: StillJob, process_ids: list[int]) -> None:
        if job.kept.indices:
            raise UserError("cannot write: the disk is full")

    with pytest.raises(UserError, match="the disk is full"):
        farmed(folder, 2, 3, fill_the_disk, settings=SMALL)
    there = sorted(folder.glob("*.ssp"))
    assert 1 <= len(there) < 3
    there[0].write_bytes(there[0].read_bytes()[:1000])
    job, _ = farmed(folder, 2, 3, notes=notes, settings=SMALL)
    assert job.taken_up == len(there) - 1
    assert len(notes) == 1 and "cut short" in notes[0] and str(there[0]) in notes[0]
    one = whole(SMALL)
    assert np.abs(job.picture.rgb - one).max() <= 4e-6 * one.max()
    # All is there: a farm that begins again only looks at the parts.
    job, tally = farmed(folder, 1, 3, settings=SMALL)
    assert job.taken_up == 3 and tally.done == 1
    # Parts of another rendering are not touched.
    with pytest.raises(UserError, match="holds parts of another rendering"):
        farmed(folder, 1, 3, settings=RenderSettings(48, 27, photons=50_000, batch=4096))
    with pytest.raises(UserError, match="holds parts of 3, not of 2"):
        farmed(folder, 1, 2, settings=SMALL)
    assert len(list(folder.glob("*.ssp"))) == 3


@pytest.mark.slow
def test_a_full_disk_is_a_sentence_that_says_what_is_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out, real = tmp_path / "a.exr", atomic._put_in_place

    def full(parts: list[Path], targets: list[Path]) -> None:
        if len(list((tmp_path / "a.exr.parts").glob("part*.ssp"))) == 2:
            raise OSError(28, "No space left on device", str(parts[0]))
        real(parts, targets)

    asked = ["farm", "render", SCENE, "--workers", "1", "--parts", "4", "--size", "48x27", "--photons", "40k"]
    asked += ["--spp", "2", "--batch", "4096", "-o", str(out)]
    with monkeypatch.context() as patch:
        patch.setattr(atomic, "_put_in_place", full)
        assert main(asked) == 2
    told = capsys.readouterr().err
    assert "the disk is full; free some space or choose another disk (2 of 4 parts are kept in" in told
    assert main(asked) == 0
    assert "4 parts, 2 of them from before" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]


@pytest.mark.slow
def test_a_scheduler_that_is_lost_is_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    address, out = "tcp://127.0.0.1:18741", tmp_path / "a.exr"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "18741"]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny"]
    scheduler = subprocess.Popen([*dask, "--no-dashboard"], cwd=tmp_path, **quiet)
    workers = subprocess.Popen([*worker, "--no-dashboard", "--death-timeout", "5"], cwd=tmp_path, **quiet)
    asked = [SCENE, "--scheduler", address, "--parts", "40", "--size", "48x27", "--photons", "2M", "--spp", "2"]
    program = [sys.executable, "-m", "spectrasplat", "farm", "render", *asked, "--batch", "4096", "-o", str(out)]
    farm = None
    try:
        time.sleep(3.0)
        farm = subprocess.Popen(program, stderr=subprocess.PIPE, text=True)
        folder = tmp_path / "a.exr.parts"
        while farm.poll() is None and len(list(folder.glob("part*.ssp"))) < 2:
            time.sleep(0.1)
        scheduler.kill()
        told = farm.communicate(timeout=60)[1]
        assert farm.returncode == 2
        assert f"the scheduler at {address} is gone: start it again and give the same command (" in told
        assert "Traceback" not in told and len(list(folder.glob("part*.ssp"))) >= 2
    finally:
        for process in (scheduler, workers, farm):
            if process is not None:
                process.kill()
                process.wait()


@pytest.mark.slow
def test_frames_of_a_farm_are_those_of_one_process(tmp_path: Path) -> None:
    asked = ["prism", "--set", "objects.prism.dispersion_gain=0:3", "--size", "48x27", "--photons", "20k"]
    asked += ["--spp", "2", "--frames", "5"]
    assert main(["animate", *asked, "-o", str(tmp_path / "one")]) == 0
    assert main(["farm", "animate", *asked, "--workers", "2", "-o", str(tmp_path / "many")]) == 0
    one, many = ({path.name: path.read_bytes() for path in (tmp_path / name).iterdir()} for name in ("one", "many"))
    assert one == many and len(one) == 6
    assert main(["farm", "animate", *asked, "--workers", "1", "-o", str(tmp_path / "a.mp4")]) == 0
    assert main(["farm", "animate", *asked, "--workers", "1", "-o", str(tmp_path / "a.webp")]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mp4", "a.webp", "many", "one"]
    with Image.open(tmp_path / "a.webp") as image:
        assert image.n_frames == 5 and image.size == (48, 27)
