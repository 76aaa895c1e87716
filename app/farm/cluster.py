"""Dask as a crew: workers of this machine, each a process with its share of the cores or a GPU of its own, or those of
a scheduler that runs already."""

from __future__ import annotations

import json
import logging
import os
import pickle
import re
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any, Self

from ..base.errors import UserError
from ..base.version import __version__
from . import desk
from .gpus import count_gpus
from .jobs import Job, News

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
"""Workers that may die with one job before that is blamed."""


def check_installed() -> None:
    """Raise `UserError` where the extra is not installed."""
    try:
        import cryptography  # noqa: F401
        import distributed  # noqa: F401
    except ImportError as error:
        raise UserError(f"farms need Dask, which is not installed ({error}): {PIP_LINE}") from error


@dataclass
class _Process:
    """A worker of this machine."""

    name: int
    log: IO[bytes]
    process: subprocess.Popen[bytes]
    began_s: float
    early_deaths: int = 0


class LocalWorkers:
    """A scheduler in this process and worker processes beside it; one that dies is started again."""

    def __init__(self, count: int) -> None:
        """Raises `UserError` where they cannot be started."""
        from distributed import LocalCluster, Security

        self._security: Security = Security.temporary()
        try:
            # Nobody else on this machine may hand work to it: what workers are sent, they run.
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
        """Of the workers."""
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
            [sys.executable, "-m", "spectrasplat.farm.worker", self._cluster.scheduler_address, str(number)],
            stdin=subprocess.PIPE,
            stdout=log,
            stderr=log,
            env=self.environment(number),
            start_new_session=True,
        )
        keys = {
            name: getattr(self._security, name)
            for name in (
                "tls_ca_file",
                *(f"tls_{role}_{kind}" for role in ("client", "worker") for kind in ("cert", "key")),
            )
        }
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
    _futures: dict[tuple[Job, int], Future] = field(default_factory=dict)
    _jobs: dict[int, Job] = field(default_factory=dict)
    """By the attempt, whose numbers are never used twice."""
    _news: SimpleQueue[News] = field(default_factory=SimpleQueue)
    _size: tuple[float, int] = (-1.0, 0)

    def share(self, value: Any) -> None:
        """What all jobs from now on are about."""
        self._shared = self.client.submit(desk.same, pickle.dumps(value, 5), pure=False)
        self.client.subscribe_topic(self._topic, self._told)

    def clock(self) -> float:
        """Of this process."""
        return time.monotonic()

    def size(self) -> int:
        """Threads of all workers, asked for now and then."""
        now = time.monotonic()
        if now - self._size[0] > 0.5:
            found = self.client.scheduler_info(n_workers=-1).get("workers", {})
            self._size = now, sum(worker["nthreads"] for worker in found.values())
        return self._size[1]

    def submit(self, job: Job, attempt: int) -> None:
        """See `Crew`; `job.call` is a function of this package and its arguments."""
        function, *arguments = job.call
        key = f"{self._topic}-{attempt}"
        future = self.client.submit(
            desk.do,
            function,
            self._shared,
            __version__,
            (self._topic, job.number, attempt, key),
            *arguments,
            key=key,
            pure=False,
            priority=10 if job.urgent else 0,
        )
        self._futures[job, attempt] = future
        self._jobs[attempt] = job
        future.add_done_callback(lambda done: self._news.put(News(job, attempt, is_done=True, result=done)))

    def drop(self, job: Job, attempt: int) -> None:
        """See `Crew`."""
        self._jobs.pop(attempt, None)
        future = self._futures.pop((job, attempt), None)
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

    def _told(self, event: tuple[float, Any]) -> None:
        _, attempt, share = event[1]
        job = self._jobs.get(attempt)
        if job is not None:
            self._news.put(News(job, attempt, share))

    def _opened(self, news: News) -> News:
        """What a future that is done holds."""
        from distributed.scheduler import KilledWorker

        job, attempt, future = news.job, news.attempt, news.result
        self._futures.pop((job, attempt), None)
        self._jobs.pop(attempt, None)
        try:
            return News(job, attempt, 1.0, future.result(timeout=600), is_done=True)
        except UserError as error:
            failed: Exception = error
        except KilledWorker as error:
            failed = UserError(
                f"{job.name} took down every worker that began it, {error.allowed_failures + 1} in turn: look at their "
                "memory and their drivers"
            )
        except ModuleNotFoundError as error:
            failed = UserError(
                f"a worker cannot import what this needs ({error}): on every machine of the cluster, {PIP_LINE}"
            )
        except Exception as error:  # noqa: BLE001 - whatever a worker meets
            self._check_scheduler()
            failed = error
        return News(job, attempt, is_done=True, error=failed)

    def _check_scheduler(self) -> None:
        """Raise `UserError` where the scheduler is gone, or was for a moment: it has forgotten all then."""
        lost = any(future.status in ("lost", "cancelled") for future in self._futures.values())
        if lost or self.client.status != "running":
            raise UserError(f"the scheduler at {self.address} is gone: start it again and give the same command")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for job, attempt in [*self._futures]:
            self.drop(job, attempt)
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
        # What a user must know is told in sentences.
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
