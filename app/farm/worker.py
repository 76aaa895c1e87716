"""A worker of this machine: `python -m spectrasplat.farm.worker ADDRESS NAME`, with its share of the cores and its GPU
in its environment and the cluster's keys on its standard input. It ends when the scheduler does."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
import tempfile


async def _work(address: str, name: str, keys: dict[str, str]) -> None:
    from distributed import Security, Worker

    with tempfile.TemporaryDirectory(prefix="spectrasplat-worker-") as folder:
        worker = Worker(
            address,
            nthreads=1,
            name=name,
            memory_limit=0,  # what a rendering takes is told before it begins
            local_directory=folder,
            dashboard=False,
            security=Security(require_encryption=True, **keys),
            death_timeout=30,
        )
        await worker
        await worker.finished()


def main() -> None:
    """Work until there is no scheduler any more."""
    # Ctrl-C is for the process that hands out the work, which then ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    address, name = sys.argv[1:3]
    asyncio.run(_work(address, name, json.loads(sys.stdin.readline())))
    os._exit(0)  # nobody wants what may still be traced


if __name__ == "__main__":
    main()
