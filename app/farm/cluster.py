"""Dask as a crew: workers of this machine, each a process with its share of the cores or a GPU of its own, or those of
a scheduler that runs already.

`python -m spectrasplat.farm.cluster ADDRESS NAME` is such a process: it finds its share in its environment and the
cluster's keys on its standard input, and ends when the scheduler does.
"""

from __future__ import annotations

import asyncio
import ctypes
import json
import logging
import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import IO, TYPE_CHECKING, Any, Self

from ..base.errors import UserError
from ..base.version import __version__
from . import desk
from .jobs import News, Task

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster, Security

PIP_LINE = "pip install '.[farm]' in the program's checkout"
DEVICE_VARIABLE = "GLCONTEXT_DEVICE_INDEX"
_ADDRESS = re.compile(r"([a-z]+://)?[^/\s]+:\d{1,5}")
_CONNECT_S = 10.0
_EARLY_S = 15.0
_EARLY_DEATHS = 3
"""A worker that dies so often, each time so soon after it began, will not live."""
_DEATHS = 10
"""Workers that may die with one task before that is blamed."""
_MOST_GPUS = 64
_EXTENSIONS = 0x3055
_DRM_DEVICE_FILE = 0x3233


def check_installed() -> None:
    """Raise `UserError` where the extra is not installed."""
    try:
        import cryptography  # noqa: F401
        import distributed  # noqa: F401
    except ImportError as error:
        raise UserError(f"farms need Dask, which is not installed ({error}): {PIP_LINE}") from error


def count_gpus() -> int:
    """How many GPUs there are to share out, those with the lowest numbers, without a gap; 0 where that is unknown.

    EGL's devices that are no software renderers, each card once, by EGL_EXT_device_enumeration and EGL_EXT_device_query
    (Khronos), in the order in which moderngl counts them."""
    try:
        egl = ctypes.CDLL("libEGL.so.1")
        egl.eglGetProcAddress.restype = ctypes.c_void_p
        query = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
        text_of = egl.eglGetProcAddress(b"eglQueryDeviceStringEXT")
    except (OSError, AttributeError):
        return 0
    if not query or not text_of:
        return 0
    devices = (ctypes.c_void_p * _MOST_GPUS)()
    found = ctypes.c_int(0)
    query_devices = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(query)
    query_text = ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int)(text_of)
    if not query_devices(_MOST_GPUS, devices, ctypes.byref(found)):
        return 0
    files: list[bytes] = []
    for device in devices[: found.value]:
        extensions = (query_text(device, _EXTENSIONS) or b"").split()
        if b"EGL_MESA_device_software" in extensions:
            break
        has_file = b"EGL_EXT_device_drm" in extensions
        file = (query_text(device, _DRM_DEVICE_FILE) or b"") if has_file else b""
        if file and file in files:
            break  # the same card again, by another driver
        files.append(file)
    return len(files)


@dataclass
class _Process:
    """A worker of this machine."""

    name: int
    log: IO[bytes]
    process: subprocess.Popen[bytes]
    began_s: float
    early_deaths: int = 0


class LocalWorkers:
    """A scheduler in this process and worker processes; one that dies is started again."""

    def __init__(self, count: int) -> None:
        """Raises `UserError` where they cannot be started."""
        from distributed import LocalCluster, Security

        self._security: Security = Security.temporary()
        try:
            # Nobody else on this machine may give it work: workers run what they are sent.
            self._cluster: LocalCluster = LocalCluster(
                n_workers=0, host="127.0.0.1", dashboard_address=None, security=self._security, silence_logs=False
            )
        except (OSError, RuntimeError) as error:
            raise UserError(f"no cluster could be started on this machine ({error}): is the network up?") from error
        self._count = count
        self._gpus = count_gpus() if count > 1 and DEVICE_VARIABLE not in os.environ else 0
        self._processes = [self._start(number) for number in range(count)]

    @property
    def client(self) -> Client:
        """A connection to it."""
        from distributed import Client

        return Client(self._cluster, security=self._security, set_as_default=False)

    @property
    def process_ids(self) -> list[int]:
        """Process numbers of the workers."""
        return [worker.process.pid for worker in self._processes]

    def environment(self, number: int) -> dict[str, str]:
        """What a worker finds: its threads, and which GPU is its own."""
        cores, extra = divmod(len(os.sched_getaffinity(0)), self._count)
        threads = str(max(cores + (number < extra), 1))
        own = dict.fromkeys(("LP_NUM_THREADS", "NUMBA_NUM_THREADS"), threads)
        if self._gpus > 1:
            own[DEVICE_VARIABLE] = str(number % self._gpus)
        return os.environ | own

    def _start(self, number: int) -> _Process:
        log = tempfile.TemporaryFile()  # noqa: SIM115 - as long as the worker
        process = subprocess.Popen(
            [sys.executable, "-m", "spectrasplat.farm.cluster", self._cluster.scheduler_address, str(number)],
            stdin=subprocess.PIPE,
            stdout=log,
            stderr=log,
            env=self.environment(number),
            start_new_session=True,
        )
        names = ["tls_ca_file", *(f"tls_{role}_{kind}" for role in ("client", "worker") for kind in ("cert", "key"))]
        keys = {name: getattr(self._security, name) for name in names}
        assert process.stdin is not None
        try:
            process.stdin.write((json.dumps(keys) + "\n").encode())
            process.stdin.close()
        except BrokenPipeError:
            pass  # it ended at once, and is looked after below
        return _Process(number, log, process, time.monotonic())

    def look_after(self) -> None:
        """Start again what has died. Raises `UserError` where one keeps dying before it has worked."""
        for place, worker in enumerate(self._processes):
            if worker.process.poll() is None:
                continue
            is_early = time.monotonic() - worker.began_s < _EARLY_S
            deaths = worker.early_deaths + 1 if is_early else 0
            if deaths >= _EARLY_DEATHS:
                worker.log.seek(0)
                said = [line for line in worker.log.read().decode(errors="replace").splitlines() if line.strip()]
                raise UserError(
                    f"a worker ended {deaths} times as soon as it had begun (exit code {worker.process.returncode}, "
                    f"{said[-1].strip() if said else 'without a word'}): is there memory for so many?"
                )
            worker.log.close()
            self._processes[place] = self._start(worker.name)
            self._processes[place].early_deaths = deaths

    def close(self) -> None:
        """End them all: they keep nothing."""
        for worker in self._processes:
            worker.process.kill()
        for worker in self._processes:
            worker.process.wait()
            worker.log.close()
        self._cluster.close(timeout=5)


@dataclass
class DaskCrew:
    """See `Crew`: attempts are Dask's tasks, each with a key of its own."""

    client: Client
    address: str
    workers: LocalWorkers | None = None
    _topic: str = field(default_factory=lambda: f"spectrasplat-{uuid.uuid4().hex}")
    _shared: Future | None = None
    _submitted: dict[int, tuple[Task, Future]] = field(default_factory=dict)
    """By the attempt, whose numbers are never used twice."""
    _news: SimpleQueue[News] = field(default_factory=SimpleQueue)
    _size: tuple[float, int] = (-1.0, 0)

    def share(self, value: Any) -> None:
        """See `Crew`."""
        self._shared = self.client.submit(desk.same, pickle.dumps(value, 5), pure=False)
        self.client.subscribe_topic(self._topic, self._heard)

    def clock(self) -> float:
        """Seconds of this process."""
        return time.monotonic()

    def size(self) -> int:
        """Threads of all workers, queried now and then."""
        now = time.monotonic()
        if now - self._size[0] > 0.5:
            found = self.client.scheduler_info(n_workers=-1).get("workers", {})
            self._size = now, sum(worker["nthreads"] for worker in found.values())
        return self._size[1]

    def submit(self, task: Task, attempt: int) -> None:
        """See `Crew`."""
        function, *arguments = task.call
        key = f"{self._topic}-{attempt}"
        report = (self._topic, attempt, key)
        priority = 10 if task.urgent else 0
        future = self.client.submit(
            desk.do, function, self._shared, __version__, report, *arguments, key=key, pure=False, priority=priority
        )
        self._submitted[attempt] = task, future
        future.add_done_callback(lambda done: self._news.put(News(task, attempt, is_done=True, result=done)))

    def drop(self, task: Task, attempt: int) -> None:
        """See `Crew`."""
        _, future = self._submitted.pop(attempt, (task, None))
        if future is not None and self.client.status == "running":
            with suppress(Exception):  # the scheduler may go at any moment, and takes it along
                future.cancel()

    def news(self, timeout_s: float) -> list[News]:
        """See `Crew`."""
        found: list[News] = []
        try:
            found.append(self._news.get(timeout=timeout_s))
            while True:
                found.append(self._news.get_nowait())
        except Empty:
            pass
        self._check_scheduler()
        if self.workers is not None:
            self.workers.look_after()
        return [self._opened(news) if news.is_done else news for news in found]

    def _heard(self, event: tuple[float, Any]) -> None:
        attempt, share = event[1]
        if attempt in self._submitted:
            self._news.put(News(self._submitted[attempt][0], attempt, share))

    def _opened(self, news: News) -> News:
        """What a future that is done holds."""
        from distributed.scheduler import KilledWorker

        task, attempt, future = news.task, news.attempt, news.result
        self._submitted.pop(attempt, None)
        try:
            return News(task, attempt, 1.0, future.result(timeout=600), is_done=True)
        except UserError as error:
            failed: Exception = error
        except KilledWorker as error:
            failed = UserError(
                f"{task.name} took down every worker that began it, {error.allowed_failures + 1} in turn: look at "
                "their memory and their drivers"
            )
        except ModuleNotFoundError as error:
            failed = UserError(
                f"a worker cannot import what this needs ({error}): on every machine of the cluster, {PIP_LINE}"
            )
        except Exception as error:  # noqa: BLE001 - whatever a worker meets
            self._check_scheduler()
            failed = error
        return News(task, attempt, is_done=True, error=failed)

    def _check_scheduler(self) -> None:
        """Raise `UserError` where the scheduler is gone, or was for a moment: it has forgotten all then."""
        lost = any(future.status in ("lost", "cancelled") for _, future in self._submitted.values())
        if lost or self.client.status != "running":
            raise UserError(f"the scheduler at {self.address} is gone: start it again and give the same command")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        for attempt, (task, _) in [*self._submitted.items()]:
            self.drop(task, attempt)
        self.client.close(timeout=2)
        if self.workers is not None:
            self.workers.close()


@contextmanager
def open_crew(workers: int | None, scheduler: str | None) -> Iterator[DaskCrew]:
    """Workers of this machine, so many, or those of a scheduler. Raises `UserError`."""
    check_installed()
    import dask
    from distributed import Client

    for name in ("", ".client", ".scheduler", ".core", ".comm", ".batched"):
        # What a user must know is raised as a sentence.
        logging.getLogger(f"distributed{name}").setLevel(logging.CRITICAL)
    settings = {
        "distributed.scheduler.allowed-failures": _DEATHS,
        "distributed.scheduler.worker-ttl": "1 hour",  # a compiler may hold a worker's only thread for minutes
        "distributed.comm.timeouts.connect": f"{_CONNECT_S}s",
        "distributed.admin.large-graph-warning-threshold": "1 TB",
    }
    with dask.config.set(settings), ExitStack() as stack:
        if scheduler is None:
            local = LocalWorkers(workers or 1)
            try:
                client = local.client
            except BaseException:
                local.close()
                raise
            yield stack.enter_context(DaskCrew(client, "this machine", local))
            return
        refusal = (
            "check the address, which looks like tcp://10.0.0.1:8786, or start a scheduler there with 'dask scheduler'"
        )
        if not _ADDRESS.fullmatch(scheduler):
            raise UserError(f"--scheduler '{scheduler}' is no address: {refusal}")
        try:
            client = Client(scheduler, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError, ImportError) as error:
            raise UserError(f"no scheduler answers at '{scheduler}' ({type(error).__name__}): {refusal}") from error
        yield stack.enter_context(DaskCrew(client, scheduler))


async def _work(address: str, name: str, keys: dict[str, str]) -> None:
    from distributed import Security, Worker

    with tempfile.TemporaryDirectory(prefix="spectrasplat-worker-") as folder:
        worker = Worker(
            address,
            nthreads=1,
            name=name,
            memory_limit=0,  # what a rendering takes is checked before it begins
            local_directory=folder,
            dashboard=False,
            security=Security(require_encryption=True, **keys),
            death_timeout=30,
        )
        await worker
        await worker.finished()


def _main() -> None:
    """Be a worker until there is no scheduler any more."""
    # Ctrl-C is for the process that distributes the work, which then ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    address, name = sys.argv[1:3]
    asyncio.run(_work(address, name, json.loads(sys.stdin.readline())))
    os._exit(0)  # nobody wants what may still be traced


if __name__ == "__main__":
    _main()
