"""OpenGL, whatever else the caller does with it: every rendering has a thread and a context of its own.

A context is current in one thread: what is done here neither sees the caller's own moderngl context nor takes it away.
Callbacks run in the caller's thread, between the worker's steps.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import closing
from queue import Empty, SimpleQueue
from threading import Event
from typing import TYPE_CHECKING, Self, TypeVar

from ..base.errors import UserError, sentence_of
from ..base.generators import finished

if TYPE_CHECKING:
    from ..gpu.context import Context

Progress = Callable[[float, str], object]
"""Called with the share done, 0 to 1, and what is being done."""
Cancel = Callable[[], bool]
"""Called now and then; once it returns true, what was done so far is the result."""

T = TypeVar("T")
Report = Callable[[float, str], None]
Work = Callable[["Context", Report, Cancel], T]
_CALL_EVERY_S = 0.1


class Device:
    """Owns the thread and its context. Use it with `with`."""

    def __init__(self) -> None:
        """Raises `UserError` with the remedy where there is no OpenGL 4.3."""
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix="spectrasplat")
        try:
            self._context = self._pool.submit(_context).result()
        except BaseException:
            self._pool.shutdown()
            raise

    def run(self, work: Work[T], progress: Progress | None = None, cancel: Cancel | None = None) -> T:
        """What `work(context, report, stopped)` gives, done in the thread; an exception in a callback, Ctrl-C too,
        waits for the step that runs and is raised then."""
        events: SimpleQueue[tuple[float, str] | None] = SimpleQueue()
        stop = Event()
        future = self._pool.submit(work, self._context, lambda share, text: events.put((share, text)), stop.is_set)
        future.add_done_callback(lambda _: events.put(None))
        try:
            while True:
                try:
                    news = events.get(timeout=_CALL_EVERY_S)
                except Empty:
                    pass
                else:
                    if news is None:
                        break
                    if progress is not None:
                        progress(*news)
                if cancel is not None and not stop.is_set() and cancel():
                    stop.set()
        except BaseException:
            stop.set()
            wait([future])
            raise
        try:
            return future.result()
        except Exception as error:
            sentence = sentence_of(error)
            if sentence is None:
                raise
            raise UserError(sentence) from error

    def close(self) -> None:
        """Free the context and end the thread."""
        self._pool.submit(self._context.release).result()
        self._pool.shutdown()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def run(work: Work[T], progress: Progress | None = None, cancel: Cancel | None = None) -> T:
    """What `work` gives on a device of its own, see `Device.run`."""
    with Device() as device:
        return device.run(work, progress, cancel)


def worked_out(
    what: str,
    begin: Callable[[Context], Generator[float, None, T]],
    progress: Progress | None,
    cancel: Cancel | None,
    stopped: str = "it was stopped before there was an answer: let it go on for longer",
) -> T:
    """What the steps of `begin` return, on a device of its own. Raises `UserError`, which says `stopped`, where the
    caller cancels."""

    def work(context: Context, report: Report, is_cancelled: Cancel) -> T:
        def at_pause(share: float) -> None:
            report(share, what)
            if is_cancelled():
                raise UserError(stopped)

        with closing(begin(context)) as steps:
            return finished(steps, at_pause)

    return run(work, progress, cancel)


def _context() -> Context:
    """A context of our own; `moderngl.get_context()` still returns the caller's."""
    import moderngl

    from ..gpu.context import create_context

    store = getattr(moderngl, "_store", None)
    before = getattr(store, "default_context", None)
    try:
        return create_context()
    finally:
        if store is not None:
            store.default_context = before
