"""What the status bar says of the light: never photons where none will come; and numbers as words."""

from __future__ import annotations

from dataclasses import replace

import pytest
from spectrasplat.render.viewer.stats import LiveStats
from spectrasplat.ui.line_breaks import broken
from spectrasplat.ui.panels.numbers import kelvin
from spectrasplat.ui.panels.status_bar import progress_words


@pytest.mark.parametrize(
    ("stats", "is_playing", "said"),
    [
        (LiveStats(differs="scene"), True, "Preparing …"),
        (LiveStats(differs="scene", preparing="searching for beams", preparing_s=1.0), True, "Preparing …"),
        (
            LiveStats(differs="scene", preparing="searching for beams", preparing_s=12.4),
            True,
            "Preparing: searching for beams (12 s so far)",
        ),
        (LiveStats(), True, "Preparing …"),
        (LiveStats(), False, "Paused"),
        (LiveStats(converged=True), True, "Done"),
        (LiveStats(photons=1_250_000, camera_samples=3.0), True, "Accumulating, 1.25 M photons"),
        (LiveStats(photons=1_250_000, camera_samples=3.0), False, "Paused, 1.25 M photons"),
        (LiveStats(only_beams=True, polygons=368, converged=True), True, "Done, 368 polygons"),
        (LiveStats(camera_samples=2.6), True, "Accumulating, 3 samples a pixel, no caustics"),
        (LiveStats(camera_samples=1.0), True, "Accumulating, 1 sample a pixel, no caustics"),
        (LiveStats(camera_samples=64.0, converged=True), True, "Done, 64 samples a pixel, no caustics"),
    ],
)
def test_what_is_said(stats: LiveStats, is_playing: bool, said: str) -> None:
    assert progress_words(stats, is_playing) == said


def test_nothing_accumulates_while_all_time_is_an_export_s() -> None:
    stats = LiveStats(photons=1_250_000, camera_samples=3.0)
    assert progress_words(stats, True, rests=True) == "Waiting, 1.25 M photons"
    assert progress_words(replace(stats, converged=True), True, rests=True) == "Done, 1.25 M photons"


@pytest.mark.parametrize(
    ("temperature_k", "said"), [(6503.7, "6,504 K"), (2855.6, "2,856 K"), (25_373.0, "25,370 K"), (999.6, "1,000 K")]
)
def test_a_colour_temperature_has_no_power_of_ten(temperature_k: float, said: str) -> None:
    assert kelvin(temperature_k) == said


def test_a_label_s_parts_stand_below_each_other_where_they_have_no_room() -> None:
    said = "Reference, relMSE of its caustics > 1.0e-01, direct light 1 of 32 samples"
    assert broken(said, 100.0, len, at=", ") == said
    assert broken(said, 50.0, len, at=", ") == said.replace(", direct", "\ndirect")
    assert broken(said, 10.0, len, at=", ") == said.replace(", ", "\n")


def test_a_message_breaks_between_words_and_not_within_endings_of_files() -> None:
    said = "notes.txt: '.txt' is not a kind of scene; use .toml, .glb, .gltf, .ply, .obj, .stl."
    lines = broken(said, 66.0, len).splitlines()
    assert " ".join(lines) == said and max(map(len, lines)) <= 66 and lines[1].startswith(".ply,")
    assert broken("a_name_that_is_wider.png is saved", 10.0, len) == "a_name_that_is_wider.png\nis saved"
