"""Start of the program, and the one place where mistakes become a sentence and an exit code.

0: done; 2: the user can mend it (one line on stderr); 130: interrupted by Ctrl-C; 1: a closed
pipe, or a bug with its traceback.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from .base.errors import UserError

USER_ERROR = 2
INTERRUPTED = 130
CLOSED_PIPE = 1  # as typer has it


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line `arguments` (None: those of the process); returns the exit code."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a terminal without × or ° shows "?" instead of failing
            stream.reconfigure(errors="replace")
    try:
        code = _run(arguments)
        sys.stdout.flush()  # a closed pipe shows here, not in the interpreter's last breath
        return code
    except UserError as error:
        return _tell(str(error), error.exit_code)
    except MemoryError:
        return _tell("out of memory: use fewer photons, a smaller picture or a simpler mesh")
    except Exception as error:
        # moderngl says so where a buffer, a texture or a program cannot be made; it may not even be imported.
        if type(error).__module__.split(".")[0] not in ("moderngl", "_moderngl", "mgl"):
            raise
        return _tell(f"OpenGL failed ({error}): use a smaller picture or fewer photons, or update the driver")
    except KeyboardInterrupt:
        print("spectrasplat: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader (head, less) has seen enough; the interpreter's own flush must not complain.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return CLOSED_PIPE


def _run(arguments: Sequence[str] | None) -> int:
    from .commands.program import run

    return run(sys.argv[1:] if arguments is None else list(arguments))


def _tell(message: str, code: int = USER_ERROR) -> int:
    print("spectrasplat: " + " ".join(message.split()), file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
