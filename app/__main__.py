"""Start of the program, and the one place where mistakes become a sentence and an exit code.

0: done; 2: the user can mend it (one line on stderr); 130, 143, 129: ended by Ctrl-C, SIGTERM, SIGHUP; 1: what was to
be printed could not be (a closed pipe, a full disk), or a bug with its traceback.
"""

from __future__ import annotations

import atexit
import errno
import gc
import os
import sys
from collections.abc import Sequence
from contextlib import redirect_stderr, suppress
from typing import Any, TextIO

from .base.errors import UserError, plain, sentence_of
from .base.interrupts import INTERRUPTED, exit_code_of, signals_raise
from .base.memory import waste_little

USER_ERROR = 2
NOT_PRINTED = 1  # as click has it for a closed pipe
_OF_PRINTING = (errno.EPIPE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line `arguments` (None: those of the process); returns the exit code."""
    _open_standard_streams()
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a terminal without × or ° shows "?" instead of failing
            stream.reconfigure(errors="replace")
    stderr = sys.stderr
    with signals_raise() as ended, redirect_stderr(_Patient(stderr)):
        try:
            code = _run(arguments)
            # Click knows of Ctrl-C only.
            return _printed(ended.exit_code if code == INTERRUPTED and ended() else code)
        except UserError as error:
            return _tell(str(error), error.exit_code)
        except KeyboardInterrupt as interrupt:
            return _tell("interrupted", exit_code_of(interrupt))
        except OSError as error:
            if error.filename is not None or error.errno not in _OF_PRINTING:
                raise
            return _lost(error)
        except Exception as error:
            sentence = sentence_of(error)
            if sentence is None:
                raise
            return _tell(sentence)
        finally:
            try:
                stderr.flush()
            except OSError:
                _to_nowhere(stderr)


class _Patient:
    """A stream for notes and progress: where it cannot be written to (a log on a full disk), the work goes on."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """As of the stream."""
        with suppress(OSError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """As of the stream."""
        with suppress(OSError):
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _run(arguments: Sequence[str] | None) -> int:
    waste_little()
    atexit.register(gc.freeze)  # else what is there at the end is looked through three times, for an eighth of a second
    gc.set_threshold(50_000)  # what is imported stays: looking through it again and again is a tenth of the start
    from .commands.program import run

    return run(sys.argv[1:] if arguments is None else list(arguments))


def _open_standard_streams() -> None:
    """Where one was closed (`>&-`), what is printed there goes nowhere.

    Otherwise the next file that is opened would take its number, and be printed into.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            with suppress(OSError):
                os.open(os.devnull, os.O_RDWR)  # takes the lowest free number, which is this one
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), "r" if number == 0 else "w"))


def _printed(code: int) -> int:
    """`code` where everything printed has arrived: a closed pipe or a full disk shows here, not in the interpreter's
    last breath."""
    try:
        sys.stdout.flush()
    except OSError as error:
        return _lost(error)
    return code


def _lost(error: OSError) -> int:
    """Nothing can be printed any more, the interpreter's own flush included."""
    if error.errno != errno.EPIPE:  # else the reader (head, less) has seen enough
        _tell(f"what was to be printed is lost: {error.strerror}")
    _to_nowhere(sys.stdout)
    return NOT_PRINTED


def _to_nowhere(stream: TextIO) -> None:
    """What could not be written would be tried once more by the interpreter, which then exits with 120."""
    with suppress(OSError, ValueError):  # ValueError: a test's stream, without a number
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _tell(message: str, code: int = USER_ERROR) -> int:
    print(f"spectrasplat: {plain(' '.join(message.split()))}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
