"""Shared fixtures: strict floating point everywhere, and one headless OpenGL context."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest


@pytest.fixture(autouse=True)
def strict_floating_point() -> Iterator[None]:
    """Overflow, division by zero and NaN are failures, not warnings (underflow is normal)."""
    with np.errstate(all="raise", under="ignore"):
        yield


@pytest.fixture(scope="session")
def gl():
    """The session's OpenGL 4.3 context (`app.gpu.context.Context`); `gl.ctx` is moderngl's."""
    from app.gpu.context import create_context

    context = create_context()
    yield context
    context.release()


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
