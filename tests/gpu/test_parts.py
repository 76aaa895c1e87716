"""One picture in parts: merged they are the picture of one process; what is no part of it is refused in a sentence."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.base.image_io import read_image

ASKED = ("--size", "64x36", "--photons", "40k", "--spp", "4", "--batch", "4096")
pytestmark = pytest.mark.usefixtures("commands_share_context")
SPECTRAL = ("--method", "srd-photons", "--bins", "8")
"""Photons with spectral maps."""


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory, commands_share_context: None) -> list[Path]:
    """Three parts of one picture, the last first: order must not matter."""
    made = [tmp_path_factory.mktemp("parts") / f"{index}.ssp" for index in (3, 2, 1)]
    for part in made:
        assert main(["render", "prism", *ASKED, *SPECTRAL, "--passes", f"{part.stem}/3", "-o", str(part)]) == 0
    return made


def test_merged_parts_are_the_picture_of_one_process(parts: list[Path], tmp_path: Path) -> None:
    """To a few millionths of its largest value: the sums are the same float32 numbers, added in another order."""
    whole, merged = tmp_path / "whole.exr", tmp_path / "merged.exr"
    assert main(["render", "prism", *ASKED, *SPECTRAL, "-o", str(whole)]) == 0
    assert main(["merge", *map(str, parts), "-o", str(merged)]) == 0
    a, b = read_image(whole), read_image(merged)
    assert np.abs(a.rgb - b.rgb).max() <= 4e-6 * a.rgb.max()
    if a.spectral is not None and b.spectral is not None:
        assert np.abs(a.spectral - b.spectral).max() <= 1e-6 * a.spectral.max()
    # It can fail: without one of them the picture is another.
    assert main(["merge", *map(str, parts[1:]), "--partial", "-o", str(merged)]) == 0
    assert np.abs(a.rgb - read_image(merged).rgb).max() > 1e-4 * a.rgb.max()


def refusal(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The sentence of a command that must fail."""
    assert main([str(argument) for argument in arguments]) == 2
    return capsys.readouterr().err


def test_a_missing_part_is_named(parts: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = refusal(capsys, "merge", parts[0], parts[2], "-o", tmp_path / "a.npy")
    assert "of 3 parts 1 are missing: 2; trace them, or merge what there is with --partial" in told
    assert not (tmp_path / "a.npy").exists()


@pytest.mark.slow
def test_no_part_counts_twice(parts: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    copy = tmp_path / "copy.ssp"
    shutil.copy(parts[0], copy)
    assert main(["merge", *map(str, parts), "-o", str(tmp_path / "a.npy")]) == 0
    assert main(["merge", *map(str, parts), str(copy), str(parts[1]), "-o", str(tmp_path / "b.npy")]) == 0
    told = capsys.readouterr().err
    assert "is part 3 again" in told and "is given 2 times: counted once" in told
    assert np.array_equal(np.load(tmp_path / "a.npy"), np.load(tmp_path / "b.npy"))


@pytest.mark.slow
def test_parts_of_others_are_refused(parts: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = tmp_path / "other.ssp"
    for scene, changed, share, sentence in (
        ("water", SPECTRAL, "1/3", "parts of different scenes, 'prism' and"),
        ("prism", (*SPECTRAL, "--seed", "2"), "1/3", "parts of different scenes or settings"),
        ("prism", SPECTRAL, "1/4", "trace all with the same --passes and --batch"),
    ):
        assert main(["render", scene, *ASKED, *changed, "--passes", share, "-o", str(other)]) == 0
        assert sentence in refusal(capsys, "merge", parts[0], other, "-o", tmp_path / "a.npy")
    edited = tmp_path / "prism.toml"
    edited.write_text("[[objects]]\nshape = 'sphere'\n")
    told = refusal(capsys, "merge", *parts, "--scene", edited, "-o", tmp_path / "a.npy")
    assert "is not as it was when" in told


def test_a_damaged_part_is_a_sentence(parts: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data, bad = parts[0].read_bytes(), tmp_path / "bad.ssp"
    generator = np.random.default_rng(1)
    damaged = [data[: len(data) * k // 8] for k in (0, 3, 7)] + [b"PK" * 40]
    places = generator.integers(30, len(data), 3)
    damaged += [data[:at] + bytes([data[at] ^ 0x55]) + data[at + 1 :] for at in places]
    whole = 0
    for text in damaged:
        bad.write_bytes(text)
        code = main(["merge", str(bad), *map(str, parts[1:]), "-o", str(tmp_path / "a.npy")])
        told = capsys.readouterr().err
        whole += code == 0
        assert code == 0 or (code == 2 and "spectrasplat: " in told and "Traceback" not in told), told
    assert whole <= 1, "damage of the content is found by its checksum"


def test_what_is_asked_wrongly_is_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    part = tmp_path / "a.ssp"
    for arguments, sentence in (
        (("--passes", "0/3", "-o", part), "is out of range"),
        (("--passes", "4/3", "-o", part), "is out of range"),
        (("--passes", "third", "-o", part), "is no part: give which of how many"),
        (("--passes", "1/3", "-o", tmp_path / "a.png"), "name the output .ssp"),
        (("-o", part), "say which by --passes"),
        (("--passes", "1/3", "--seconds", "1", "-o", part), "--passes and --seconds exclude each other"),
        (("--passes", "1/3", "--photons", "1k", "--size", "64x36", "-o", part), "not enough to share out"),
    ):
        assert sentence in refusal(capsys, "render", "prism", *arguments)
    assert not part.exists()
