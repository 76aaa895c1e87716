"""Output files appear whole or not at all, and an existing one survives every failure."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import pytest
from spectrasplat.base import atomic
from spectrasplat.base.atomic import atomic_output, atomic_outputs, check_writable
from spectrasplat.base.errors import UserError


def test_file_appears_when_the_block_succeeds(tmp_path: Path) -> None:
    target = tmp_path / "a.png"
    with atomic_output(target) as temporary:
        assert temporary.parent == tmp_path and temporary.suffix == ".png"
        temporary.write_text("new")
        assert not target.exists()
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("failure", [ValueError, KeyboardInterrupt, SystemExit])
def test_old_file_survives_a_failure(tmp_path: Path, failure: type[BaseException]) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    with pytest.raises(failure), atomic_output(target) as temporary:
        temporary.write_text("half")
        raise failure
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_permissions_are_the_usual_ones(tmp_path: Path) -> None:
    mask = os.umask(0o022)
    try:
        with atomic_output(tmp_path / "a"):
            pass
    finally:
        os.umask(mask)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o644


def test_a_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    real, link = tmp_path / "elsewhere" / "real.txt", tmp_path / "link.txt"
    real.write_text("old")
    link.symlink_to(real)
    with atomic_output(link) as temporary:
        temporary.write_text("new")
    assert link.is_symlink() and real.read_text() == "new"


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("", "is a folder"),
        ("no/a.png", "does not exist; create it"),
        ("file/a.png", "is not a folder"),
        ("x" * 300 + ".png", "name is too long"),
    ],
)
def test_impossible_places(tmp_path: Path, name: str, sentence: str) -> None:
    (tmp_path / "file").write_text("")
    for attempt in (check_writable, lambda path: atomic_output(path).__enter__()):
        with pytest.raises(UserError, match=sentence) as caught:
            attempt(tmp_path / name)
        assert str(tmp_path / name) in str(caught.value)
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_long_names_that_fit_work(tmp_path: Path) -> None:
    target = tmp_path / ("ä" * 125 + ".png")  # 254 bytes of at most 255
    with atomic_output(target) as temporary:
        temporary.write_text("new")
    assert target.read_text() == "new"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_folder_without_permission(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(UserError, match="no permission"):
        check_writable(tmp_path / "a.png")


@pytest.mark.parametrize(
    ("code", "sentence"),
    [(errno.EACCES, "no permission"), (errno.EROFS, "no permission"), (errno.ENOSPC, "disk is full")],
)
def test_refusals_of_the_system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int, sentence: str) -> None:
    def refuse(*_: object) -> int:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(UserError, match=sentence):
        check_writable(tmp_path / "a.png")


def test_disk_full_while_writing(tmp_path: Path) -> None:
    target = tmp_path / "a.npy"
    target.write_text("old")
    with pytest.raises(UserError, match="a.npy: the disk is full"), atomic_output(target):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_errors_about_other_files_pass_unchanged(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), atomic_output(tmp_path / "a.png"):
        (tmp_path / "input.csv").read_text()


def test_check_writable_leaves_the_file_alone(tmp_path: Path) -> None:
    target = tmp_path / "a.png"
    check_writable(target)
    assert list(tmp_path.iterdir()) == []
    target.write_text("old")
    check_writable(target)
    assert target.read_text() == "old"


def test_what_is_done_is_on_the_disk_before_it_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    happened: list[str] = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda fd: (happened.append("sync"), fsync(fd))[1])
    monkeypatch.setattr(os, "replace", lambda a, b: (happened.append("rename"), replace(a, b))[1])
    with atomic_output(tmp_path / "a"):
        pass
    assert happened == ["sync", "rename", "sync"]  # the file, its name, the folder
    happened.clear()
    with atomic_output(tmp_path / "a", lasting=False):
        pass
    assert happened == ["rename"]


def test_what_killed_processes_left_is_removed_and_what_others_write_is_not(tmp_path: Path) -> None:
    script = (
        "import os, signal, sys\n"
        "from spectrasplat.base.atomic import atomic_output\n"
        "with atomic_output(sys.argv[1]) as part:\n"
        "    part.write_text('half')\n"
        "    print(part.name, flush=True)\n"
        "    sys.stdin.read() if sys.argv[2] == 'wait' else os.kill(os.getpid(), signal.SIGKILL)\n"
    )

    def start(how: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", script, str(tmp_path / "a.png"), how]
        return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    with start("kill") as killed:
        assert killed.stdout is not None
        left = killed.stdout.readline().strip()
    assert (tmp_path / left).exists()
    mine = tmp_path / ".notes.part.txt"  # a name that only resembles ours
    mine.write_text("keep")
    with start("wait") as living:
        assert living.stdout is not None and living.stdin is not None
        written = living.stdout.readline().strip()
        assert not (tmp_path / left).exists() and (tmp_path / written).exists()
        atomic._swept.clear()
        check_writable(tmp_path / "b.png")
        assert (tmp_path / written).exists()
        living.stdin.close()
    assert sorted(entry.name for entry in tmp_path.iterdir()) == [mine.name, "a.png"]


@pytest.mark.parametrize("fails", [0, 1, 2, 3])
@pytest.mark.parametrize("old", [(), ("a",), ("a", "b")])
def test_files_that_belong_together_appear_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: int, old: tuple[str, ...]
) -> None:
    for name in old:
        (tmp_path / name).write_text("old")
    count, replace = 0, os.replace

    def counted(a: object, b: object) -> None:
        nonlocal count
        count += 1
        if count == fails:
            raise OSError(errno.ENOSPC, "No space left on device")
        replace(a, b)  # type: ignore[type-var]

    monkeypatch.setattr(os, "replace", counted)
    raises = pytest.raises(UserError, match="disk is full") if 0 < fails <= len(old) + 2 else nullcontext()
    with raises, atomic_outputs(tmp_path / "a", tmp_path / "b") as parts:
        for part in parts:
            part.write_text("new")
    expected = dict.fromkeys(old, "old") if 0 < fails <= len(old) + 2 else {"a": "new", "b": "new"}
    assert {entry.name: entry.read_text() for entry in tmp_path.iterdir()} == expected
