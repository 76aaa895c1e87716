"""What runs on a worker: one task at a time in a thread that keeps its OpenGL context, its programs and what tasks
share from one to the next."""

from __future__ import annotations

import hashlib
import pickle
import threading
import time
from collections.abc import Callable
from typing import Any

from ..base.errors import UserError
from ..base.version import __version__
from ..gpu import shader
from ..gpu.context import Context, create_context

_REPORT_EVERY_S = 0.4
_own = threading.local()


class Desk:
    """One thread's."""

    def __init__(self) -> None:
        self._context: Context | None = None
        self._of = b""
        self._value: Any = None
        self._kept: Any = None

    @property
    def context(self) -> Context:
        """Made at its first use. Raises `UserError` where there is no OpenGL."""
        if self._context is None:
            self._context = create_context()
            shader.keep_programs(self._context.ctx)
        return self._context

    def keep(self, make: Callable[[], Any]) -> Any:
        """What tasks on the same shared value leave for each other; made by the first of them."""
        if self._kept is None:
            self._kept = make()
        return self._kept

    def take(self, shared: bytes) -> Any:
        """The value that was pickled; another one than before clears the desk."""
        digest = hashlib.sha256(shared).digest()
        if digest != self._of:
            self.clear()
            self._value, self._of = pickle.loads(shared), digest
        return self._value

    def clear(self) -> None:
        """Forget all, the context too."""
        if self._kept is not None:
            self._kept.release()
        if self._context is not None:
            shader.forget_programs(self._context.ctx)
            self._context.release()
        self._context, self._value, self._of, self._kept = None, None, b"", None


class Report:
    """Reports how far a task is, now and then, and knows whether it is wanted at all."""

    def __init__(self, topic: str, attempt: int, key: str) -> None:
        from distributed import get_worker

        self._worker, self._topic, self._attempt, self._key = get_worker(), topic, attempt, key
        self._reported_s = 0.0
        self(0.0)

    def __call__(self, share: float, text: str = "") -> None:
        now = time.monotonic()
        if now - self._reported_s >= _REPORT_EVERY_S:
            self._reported_s = now
            self._worker.log_event(self._topic, [self._attempt, float(share)])

    def unwanted(self) -> bool:
        """Whether the task was dropped meanwhile: another copy was quicker, or all was stopped."""
        task = self._worker.state.tasks.get(self._key)
        return task is None or task.state == "cancelled"


def do(function: Callable[..., Any], shared: bytes, version: str, report: tuple[str, int, str], *arguments: Any) -> Any:
    """One task: `function(desk, value, report, *arguments)`, where `value` was pickled as `shared`."""
    if version != __version__:
        raise UserError(
            f"a worker has version {__version__} of spectrasplat and this is {version}: install the same one everywhere"
        )
    desk = _own.__dict__.setdefault("desk", Desk())
    try:
        return function(desk, desk.take(shared), Report(*report), *arguments)
    except UserError:
        raise
    except BaseException:
        desk.clear()  # whatever it was, the next task begins with a context of its own
        raise


def same(value: bytes) -> bytes:
    """What all tasks share: the result of a task, so that it is made again where the worker that held it is gone."""
    return value
