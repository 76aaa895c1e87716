"""What bench-beams counts: it grows as it should, and says where photons take over."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from spectrasplat.__main__ import main
from spectrasplat.bench import beam_costs
from spectrasplat.bench.beam_costs import BeamCost, stone


@pytest.mark.parametrize("facets", [6, 57, 200])
def test_stones_are_closed_and_have_so_many_facets(facets: int) -> None:
    mesh = stone(facets)
    volume = float((mesh.corners().mean(axis=1) * mesh.area_vectors()).sum()) / 3.0
    assert 0.1 < volume < 0.6 and abs(mesh.area_vectors().sum(axis=0)).max() < 1e-12
    assert facets < 200 or len(mesh.triangles) == facets


def test_finer_searches_leave_less(gl) -> None:
    costs = list(beam_costs.measure(gl, (6, 10_000)))
    boxes, dense = costs[:-1], costs[-1]
    assert [cost.threshold for cost in boxes] == list(beam_costs.THRESHOLDS) and all(cost.by_beams for cost in boxes)
    for coarse, fine in pairwise(boxes):
        assert fine.beams > coarse.beams and fine.left < coarse.left
    assert not dense.by_beams and "10000 triangles" in dense.why_not and "10000 triangles" in beam_costs.line(dense)


def test_the_command_writes_what_it_measured(tmp_path: Path, monkeypatch, capsys) -> None:
    cost = BeamCost(6, 1e-3, 0.01, 10, 4, 3, 0.25, True, "")
    monkeypatch.setattr(beam_costs, "measure", lambda context: iter([cost]))
    assert main(["bench-beams", "-o", str(tmp_path / "out")]) == 0
    assert {file.name for file in (tmp_path / "out").iterdir()} == {
        "beam_costs.json",
        "beam_costs.png",
        "beam_costs.svg",
    }
    assert "0.2500" in capsys.readouterr().out
    (tmp_path / "file").touch()
    assert main(["bench-beams", "-o", str(tmp_path / "file")]) != 0
    assert "give another one with -o" in capsys.readouterr().err
