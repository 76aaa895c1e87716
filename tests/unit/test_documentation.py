"""README, docs/ and the pages beside them: short enough, links that lead somewhere, commands that exist."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest
import python_reference
from command_reference import MARK, PAGE, commands, reference
from spectrasplat.commands import program

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted(
    [
        *ROOT.glob("*.md"),
        *(ROOT / "docs").glob("*.md"),
        ROOT / "shaders" / "README.md",
        ROOT / "assets" / "scenes" / "README.md",
    ]
)
MAX_README_LINES = 120
SOURCES = {".py", ".glsl", ".comp", ".vert", ".frag"}
NOT_FILES = ("NAME", "…")
"""Marks of paths that stand for others."""
ids = [str(page.relative_to(ROOT)) for page in PAGES]


def without_code(text: str) -> str:
    """Markdown without its blocks and spans of code."""
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL))


def anchors(page: Path) -> set[str]:
    """Of a page's headlines, as GitHub makes them."""
    headlines = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", line.lower()).replace(" ", "-") for line in headlines}


def shown_commands(text: str) -> Iterator[str]:
    """Command lines in blocks (indented or fenced) and spans of code."""
    fenced = re.findall(r"^```(?:sh|bash|console)?\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    blocks = [line for block in fenced for line in block.splitlines()] + re.findall(r"^    (.*)$", text, re.MULTILINE)
    spans = re.findall(r"`([^`]+)`", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL))
    for line in [*blocks, *(" ".join(span.split()) for span in spans)]:
        command = re.sub(r"\s+#.*", "", line).strip()
        if re.match(r"(\./run|spectrasplat)( |$)", command):
            yield command


def complaint(command: str) -> str:
    """Why the program would not take `command`; "" where it would."""
    words = shlex.split(command)[1:]
    if not words or any(mark in command for mark in ("[", "…", "ARGS")):
        return ""
    known: dict[str, Any] = commands()
    if words[0].startswith("-"):
        options = {o for p in program.program().params for o in p.opts}
        return "" if words[0] in options else f"no option {words[0]}"
    name = next((name for name in (" ".join(words[:2]), words[0]) if name in known), None)
    if name is None:
        return f"no command {words[0]}"
    try:
        known[name].make_context(name, words[len(name.split()) :], resilient_parsing=False)
    except click.UsageError as error:
        needs_more = {"Missing argument", "Missing option"}
        message = error.format_message()
        return "" if any(message.startswith(start) for start in needs_more) else message
    return ""


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= MAX_README_LINES


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_relative_links_lead_somewhere(page: Path) -> None:
    broken = []
    for target in re.findall(r"\]\(([^)\s]+)\)", without_code(page.read_text(encoding="utf-8"))):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        place = page.parent / path if path else page
        if not place.exists() or (anchor and anchor not in anchors(place)):
            broken.append(target)
    assert broken == []


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_shown_commands_are_known(page: Path) -> None:
    wrong = [(line, complaint(line)) for line in shown_commands(page.read_text(encoding="utf-8"))]
    assert [pair for pair in wrong if pair[1]] == []


def test_wrong_commands_would_be_noticed() -> None:
    text = "Say `./run rendr prism` or\n\n    spectrasplat bench --secnds 3   # three\n    spectrasplat --instal\n"
    assert [bool(complaint(line)) for line in shown_commands(text)] == [True, True, True]
    assert [complaint(line) for line in shown_commands("`./run render prism -o p.png --photons 1M`")] == [""]


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_named_paths_exist(page: Path) -> None:
    """Paths in code spans that begin with one of the checkout's folders; * stands for some file."""
    spans = re.findall(r"`((?:app|assets|docs|shaders|tests|integrations)/[^`\s]*)`", page.read_text(encoding="utf-8"))
    named = [span for span in spans if not any(mark in span for mark in NOT_FILES)]
    assert [span for span in named if not any(ROOT.glob(span.rstrip("/")))] == []


def test_paths_named_in_sources_exist() -> None:
    """Comments and docstrings of the program that point to another file."""
    files = [f for folder in ("app", "shaders") for f in (ROOT / folder).rglob("*") if f.suffix in SOURCES]
    pattern = re.compile(r"(?<![\w/.])(?:app|assets|docs|shaders|tests)/[\w/]+\.(?:py|md|toml|glsl|comp|vert|frag)\b")
    named = {(file.name, path) for file in files for path in pattern.findall(file.read_text(encoding="utf-8"))}
    assert len(named) > 10
    assert sorted(entry for entry in named if not (ROOT / entry[1]).exists()) == []


def test_every_shader_is_in_their_list() -> None:
    listed = re.findall(r"`([^`\s]+)`", (ROOT / "shaders" / "README.md").read_text(encoding="utf-8"))
    shaders = [file for file in (ROOT / "shaders").rglob("*") if file.suffix in SOURCES - {".py"}]
    assert shaders
    assert sorted(file.name for file in shaders if not any(file.match(name) for name in listed)) == []


def test_every_page_is_in_the_index() -> None:
    index = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    assert [page.name for page in (ROOT / "docs").glob("*.md") if f"({page.name})" not in index + "(README.md)"] == []


def test_the_command_line_page_is_what_the_program_says() -> None:
    written = PAGE.read_text(encoding="utf-8").partition(MARK)[2]
    assert written == reference(), "run 'python tests/unit/command_reference.py'"


def test_the_python_reference_is_up_to_date() -> None:
    written = python_reference.PAGE.read_text(encoding="utf-8")
    assert written == python_reference.reference(), "run 'python tests/unit/python_reference.py'"


def test_every_scene_is_described() -> None:
    page = (ROOT / "docs" / "scene-format.md").read_text(encoding="utf-8")
    scenes = [file.stem for file in (ROOT / "assets" / "scenes").glob("*.toml")]
    assert [name for name in scenes if f"`{name}`" not in page] == []


def test_no_text_installs_a_package_of_our_name() -> None:
    """Nobody has registered it: whoever does would run code on the machines of those who follow the advice."""
    told = re.compile(r"pip3?\s+install\b[^\n`]*?\bspectrasplat(?![\w.-]*\.whl)\b|spectrasplat\[\w+\]")
    assert all(told.search(f"pip install {rest}") for rest in ("spectrasplat", "-U 'spectrasplat[farm]'"))
    assert not any(told.search(line) for line in ("pip install .", "`pip install .` it is called `spectrasplat`"))
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False).stdout
    files = [ROOT / name for name in listed.split("\0") if name and ROOT / name != Path(__file__)]
    texts = {file: file.read_bytes().decode("utf-8", "ignore") for file in files if file.is_file()}
    assert [str(file.relative_to(ROOT)) for file, text in texts.items() if told.search(text)] == []


def test_one_version() -> None:
    from spectrasplat import __version__

    assert f"## [{__version__}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"\nversion: {__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")


def test_workflow_runs_the_pythons_that_are_promised() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    promised = re.findall(r"Python :: (3\.\d+)", " ".join(project["classifiers"]))
    workflow = (ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8")
    assert re.search(r"python: \[(.*)\]", workflow)[1].replace('"', "").split(", ") == promised


@pytest.mark.skipif(shutil.which("desktop-file-validate") is None, reason="desktop-file-utils is not installed")
def test_the_desktop_entry_is_valid() -> None:
    entry = ROOT / "integrations" / "spectrasplat.desktop"
    done = subprocess.run(["desktop-file-validate", str(entry)], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "")


def test_the_desktop_entry_starts_the_viewer() -> None:
    entry = (ROOT / "integrations" / "spectrasplat.desktop").read_text(encoding="utf-8")
    command = re.search(r"^Exec=(.*)$", entry, re.MULTILINE)[1]
    assert complaint(command.replace("%f", "prism")) == ""
    assert (ROOT / "integrations" / f"{re.search(r'^Icon=(.*)$', entry, re.MULTILINE)[1]}.png").is_file()
