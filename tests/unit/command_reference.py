"""Writes the commands' part of docs/command-line.md from the program: `python tests/unit/command_reference.py`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from spectrasplat.commands import program

PAGE = Path(__file__).resolve().parents[2] / "docs" / "command-line.md"
MARK = "<!-- From here on written by tests/unit/command_reference.py -->\n"


def commands() -> dict[str, Any]:
    """Every command of the program, as click has it, by name; those of a group by both words."""
    found: dict[str, Any] = {}
    for name, command in program.program().commands.items():
        inner = command.commands if isinstance(command, click.Group) else None
        found |= {name: command} if inner is None else {f"{name} {word}": each for word, each in inner.items()}
    return found


def reference() -> str:
    """Markdown: a section for each command, with a table of what it takes."""
    return "".join(_section(name, command) for name, command in commands().items())


def _section(name: str, command: Any) -> str:
    arguments = [p.metavar for p in command.params if p.param_type_name == "argument"]
    options = [p for p in command.params if p.param_type_name == "option"]
    needed = [f"{p.opts[0]} {p.metavar}" for p in options if p.required]
    others = ["[OPTIONS]"] if len(options) > len(needed) else []
    usage = " ".join(["spectrasplat", name, *arguments, *needed, *others])
    rows = [(f"`{p.metavar}`", p.help) for p in command.params if p.param_type_name == "argument"]
    names = {p.name: ", ".join(f"`{o}`" for o in (*p.opts, *p.secondary_opts)) for p in options}
    rows += [(names[p.name] + (f" `{p.metavar}`" if p.metavar else ""), p.help) for p in options]
    table = "".join(f"| {taken} | {text} |\n" for taken, text in rows)
    head = f"\n## {name}\n\n`{usage}`\n\n{command.help}\n"
    return head + (f"\n| | |\n|---|---|\n{table}" if table else "")


if __name__ == "__main__":
    before = PAGE.read_text(encoding="utf-8").partition(MARK)[0]
    PAGE.write_text(before + MARK + reference(), encoding="utf-8")
