"""Shared fixtures: strict floating point everywhere, and one headless OpenGL context; how many processes share the
tests."""

from __future__ import annotations

import copy
import gc
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import platformdirs
import pytest

if TYPE_CHECKING:
    from spectrasplat.gpu.context import Context

PROCESS_BYTES = 3 << 30
"""Memory that one process of the tests may come to need, mostly for compiled programs that are kept (1.7 GB were
seen)."""
MAX_PROCESSES = 4
"""More would wait for the longest files, and crowd a graphics card that all share."""


COMPILED_FIRST = "test_animate.py", "test_camera_reference.py", "test_photon_reference.py"
"""Files whose first tests compile beams and references for most of a minute: begun first, each in a process of its own,
so that no other compiles the same."""


def usable_cores() -> int:
    """Cores this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


if "PYTEST_XDIST_WORKER_COUNT" in os.environ:
    # A software renderer takes a thread for every core, and every process would. Set before the driver is loaded.
    os.environ.setdefault("LP_NUM_THREADS", str(max(usable_cores() // int(os.environ["PYTEST_XDIST_WORKER_COUNT"]), 1)))


# Products of small matrices on several threads wait for each other far longer than they compute, most of all where
# processes share the cores: the program does without too. Set before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Pictures come and go by the hundred thousand: what is freed stays with the process, which otherwise gets, and clears,
# the same pages again each time. glibc reads both when a process starts, so this is for the processes that share tests.
os.environ.setdefault("MALLOC_MMAP_THRESHOLD_", str(32 << 20))
os.environ.setdefault("MALLOC_TRIM_THRESHOLD_", str(256 << 20))

# What driver and numba compiled is kept for the next run. Their folders are named for tests that set a cache folder of
# their own.
os.environ.setdefault("MESA_SHADER_CACHE_DIR", platformdirs.user_cache_dir())
os.environ.setdefault("NUMBA_CACHE_DIR", platformdirs.user_cache_dir("spectrasplat", appauthor=False))


# Hundreds of thousands of objects of modules and tests live to the end: looking through them again and again for what
# nobody refers to takes a third of the time until the first test.
gc.disable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files stay together and keep their order, but for `COMPILED_FIRST`."""
    items.sort(key=lambda item: item.path.name not in COMPILED_FIRST)


def pytest_collection_finish() -> None:
    """From here on rubbish is collected, of what tests make only."""
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """One process a core, as memory allows: compiling and Python take one thread. None (0) where there is nothing to
    share out."""
    files = {argument.split("::")[0] for argument in config.args}
    if len(files) == 1 and Path(*files).is_file():
        return 0
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    workers = min(usable_cores(), memory // PROCESS_BYTES, MAX_PROCESSES)
    return workers if workers > 1 else 0


@pytest.fixture(autouse=True)
def strict_floating_point() -> Iterator[None]:
    """Overflow, division by zero and NaN are failures, not warnings (underflow is normal)."""
    import numpy as np

    with np.errstate(all="raise", under="ignore"):
        yield


@pytest.fixture(scope="session")
def session_gl() -> Iterator[Context]:
    """One context with its compiled programs for all files of a process: most of what tests draw are variants of a few
    scenes, and a software renderer compiles longer than it draws. The programs' number is bounded
    (`shader.KEPT_PROGRAMS`)."""
    from spectrasplat.gpu import shader
    from spectrasplat.gpu.context import create_context

    context = create_context()
    context.ctx.gc_mode = "context_gc"  # what a test did not release is listed, and freed when its file ends
    shader.keep_programs(context.ctx)
    yield context
    shader.forget_programs(context.ctx)
    context.release()


@pytest.fixture(scope="module")
def gl(session_gl: Context) -> Iterator[Context]:
    """The process's OpenGL 4.3 context (`spectrasplat.gpu.context.Context`); `gl.ctx` is moderngl's."""
    session_gl.ctx.__enter__()  # an earlier file may have made a context of its own
    yield session_gl
    session_gl.ctx.__enter__()
    left = session_gl.ctx.objects
    while left:
        resource = left.popleft()
        if hasattr(resource, "release"):  # those that were released are in the list too
            resource.release()


@pytest.fixture(scope="module")
def commands_share_context(gl: Context) -> Iterator[None]:
    """Commands and renderings that a test starts in this process draw in its context, with the programs it has."""
    lent = copy.copy(gl)
    lent.release = lambda: None  # type: ignore[method-assign]
    with pytest.MonkeyPatch.context() as patched:
        for module in ("render.still", "gpu.context"):  # the first has it from the second when it is imported
            patched.setattr(f"spectrasplat.{module}.create_context", lambda *_: lent)
        yield


@pytest.fixture(autouse=True)
def no_gl_errors_left_behind(request: pytest.FixtureRequest) -> Iterator[None]:
    """A test that uses `gl` fails when it leaves an OpenGL error unread."""
    if "gl" not in request.fixturenames:
        yield
        return
    context = request.getfixturevalue("gl")
    context.ctx.__enter__()  # a test may have made a context of its own, which took this one's place
    yield
    context.check(request.node.name)
