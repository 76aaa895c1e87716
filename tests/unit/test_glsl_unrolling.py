"""Short loops are written out: `gpu/dead_code.unrolled`."""

from __future__ import annotations

import pytest
from spectrasplat.gpu.dead_code import unrolled

COUNTS = {"TWO": 2, "NONE": 0, "1": 1, "MANY": 9}


@pytest.mark.parametrize(
    ("loop", "written"),
    [
        ("for (int c = 0; c < TWO; ++c) a[c] = f(c, path.c);", "{ a[0] = f(0, path.c); a[1] = f(1, path.c); }"),
        ("for (int c = 0; c < 1; ++c) { float x = a[c]; s += x; }", "{ { float x = a[0]; s += x; } }"),
        ("if (b) for (int c = 0; c < NONE; ++c) s += a[c];\ns = 1;", "if (b) { }\ns = 1;"),
        (
            "for (int i = 0; i < TWO; ++i)\n  for (int g = 0; g < 1; ++g)\n    a[i] += b[g];",
            "{ \n { \n a[0] += b[0]; } { a[1] += b[0]; } }",
        ),
    ],
)
def test_few_rounds_are_written_out(loop: str, written: str) -> None:
    found = unrolled(loop, COUNTS.get)
    assert found.split() == written.split()
    assert found.count("\n") == loop.count("\n")


@pytest.mark.parametrize(
    "loop",
    [
        "for (int c = 0; c < MANY; ++c) s += a[c];",
        "for (int c = 0; c < unknown; ++c) s += a[c];",
        "for (int c = 0; c < TWO; ++c) if (a[c] > 0.0) break;",
        "for (uint c = 0u; c < TWO; ++c) s += a[c];",
    ],
)
def test_others_stay(loop: str) -> None:
    assert unrolled(loop, COUNTS.get) == loop
