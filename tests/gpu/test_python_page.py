"""docs/python.md: every example runs, in order."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_every_example_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As a reader would run them: one after the other, in one process."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    blocks = re.findall(r"^```python\n(.*?)^```", TEXT, flags=re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 8
    for block in blocks:
        exec(compile(block, "docs/python.md", "exec"), names)
    assert {path.name for path in tmp_path.iterdir()} == {
        *("prism.png", "prism.exr", "edited.toml", "table.glb", "table.json", "cookie.png", "cookie.json")
    }
    told = capsys.readouterr().out
    assert "unknown glass 'N-SF111', did you mean" in told
    assert "A lamp" in told
    assert "Abbe number: 25.6" in told
