"""Interface tests never touch the user's settings, and share one virtual screen."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator

import pytest


@pytest.fixture(scope="session", autouse=True)
def own_config(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A config folder for the whole run; a test that sets its own overrides it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SPECTRASPLAT_CONFIG", str(tmp_path_factory.mktemp("config")))
        yield


@pytest.fixture(scope="session")
def display() -> Iterator[str]:
    """One virtual screen for all windows of the tests."""
    assert shutil.which("Xvfb"), "install xvfb ('apt-get install xvfb'): the window cannot be tested without"
    reader, writer = os.pipe()
    command = ["Xvfb", "-displayfd", str(writer), "-screen", "0", "1400x900x24", "-noreset", "-nolisten", "tcp"]
    with subprocess.Popen(command, pass_fds=[writer], stderr=subprocess.DEVNULL) as server:
        os.close(writer)
        with os.fdopen(reader) as answer:
            yield ":" + answer.readline().strip()
        server.terminate()
