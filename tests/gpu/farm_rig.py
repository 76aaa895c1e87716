"""Farms of the tests: workers of this machine that can be killed at chosen moments."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path

from spectrasplat.commands.scenes import find_scene
from spectrasplat.farm.cluster import open_crew
from spectrasplat.farm.jobs import Foreman, Tally
from spectrasplat.farm.still import StillJob
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings

SETTINGS = RenderSettings(width=64, height=36, photons=400_000, spp=4, batch=4096)
SCENE = "lens"


def farmed(
    folder: Path,
    workers: int,
    parts: int,
    meddle: Callable[[StillJob, list[int]], None] = lambda job, process_ids: None,
    notes: list[str] | None = None,
    settings: RenderSettings = SETTINGS,
) -> tuple[StillJob, Tally]:
    """A picture by so many workers; `meddle` is called again and again with the job and the workers' processes."""
    folder.mkdir(exist_ok=True)
    scene = load_scene(find_scene(SCENE))
    with open_crew(workers, None) as crew:
        told = [] if notes is None else notes
        job = StillJob(scene, settings, find_scene(SCENE), folder, parts, told.append)
        assert crew.workers is not None
        local = crew.workers
        tally = Foreman(crew, job).run(lambda share, text: meddle(job, local.process_ids))
        assert tally is not None
        return job, tally


def kill(process_id: int) -> None:
    """As the kernel does where memory is short."""
    os.kill(process_id, signal.SIGKILL)
