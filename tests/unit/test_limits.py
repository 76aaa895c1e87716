"""What a driver must have beyond OpenGL's promise is asked for in a sentence, before anything is compiled."""

from __future__ import annotations

from dataclasses import replace

import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.gpu.limits import BRUSH_STORAGE_BLOCKS, NEEDED, check_brush, check_splats


def test_what_is_needed_is_enough_for_splats() -> None:
    check_splats(NEEDED)
    check_brush(replace(NEEDED, storage_blocks=BRUSH_STORAGE_BLOCKS))


@pytest.mark.parametrize(
    ("name", "found", "words"),
    [
        ("vertex_storage_blocks", 0, "0 storage blocks in a vertex shader, and splats need 5"),
        ("storage_bindings", 8, "8 binding points of storage blocks"),
        ("storage_blocks", 4, "4 storage blocks in a compute shader"),
    ],
)
def test_too_few_are_told_with_a_remedy(name: str, found: int, words: str) -> None:
    with pytest.raises(UserError, match=words) as told:
        check_splats(replace(NEEDED, **{name: found}))
    assert "doctor" in str(told.value)


def test_the_brush_asks_for_more() -> None:
    with pytest.raises(UserError, match="local dispersion takes 10 storage blocks"):
        check_brush(NEEDED)
