"""Writes docs/python-reference.md from the Python interface's docstrings: `python tests/unit/python_reference.py`."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from pathlib import Path
from typing import Any

from spectrasplat import api

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python-reference.md"
HEAD = """# Python reference

Written by `tests/unit/python_reference.py` from the docstrings; [python.md](python.md) shows how to use it.
Everything here is a name of `import spectrasplat as ss`. Every mistake raises `ss.UserError`.
"""


def reference() -> str:
    """Markdown: a section for each function, then one for each class."""
    names = sorted(api.__all__, key=lambda name: (name[0].isupper(), name))
    return HEAD + "".join(_section(name, getattr(api, name)) for name in names)


def _section(name: str, thing: Any) -> str:
    if not inspect.isclass(thing):
        return f"\n## {name}\n\n```python\n{_signature(name, thing)}\n```\n\n{_text(thing)}\n"
    text = f"\n## {name}\n\n{_text(thing)}\n"
    # A dataclass without a docstring of its own for its making is made by the program.
    making = thing.__dict__.get("__init__")
    if making is not None and making.__doc__:
        text += f"\n```python\n{_signature(name, making)}\n```\n\n{_text(making)}\n"
    rows = [f"| `{field}` | {told} |\n" for field, told in _fields(thing)]
    return text + ("\n| | |\n|---|---|\n" + "".join(rows) if rows else "") + "".join(_methods(name, thing))


def _fields(thing: Any) -> list[tuple[str, str]]:
    """Attributes of a class and of those it is made from, with the text below each, and its properties."""
    found: dict[str, str] = {}
    for cls in reversed(thing.__mro__):
        if not cls.__module__.startswith("spectrasplat.") or cls.__name__.endswith("Error"):
            continue
        body = ast.parse(textwrap.dedent(inspect.getsource(cls))).body[0].body  # type: ignore[attr-defined]
        for item, below in zip(body, [*body[1:], None], strict=True):
            if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name):
                is_text = isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
                found[item.target.id] = str(below.value.value) if is_text else ""  # type: ignore[union-attr]
        found |= {key: value.__doc__ or "" for key, value in vars(cls).items() if isinstance(value, property)}
    return [(key, " ".join(text.split())) for key, text in found.items() if not key.startswith("_")]


def _methods(name: str, thing: Any) -> list[str]:
    found: dict[str, Any] = {}
    for cls in reversed(thing.__mro__):
        if cls.__module__.startswith("spectrasplat."):
            found |= {key: value for key, value in vars(cls).items() if inspect.isfunction(value)}
    public = {key: method for key, method in found.items() if not key.startswith("_")}
    return [
        f"\n### {name}.{key}\n\n```python\n{_signature(key, method)}\n```\n\n{_text(method)}\n"
        for key, method in public.items()
    ]


def _signature(name: str, function: Any) -> str:
    found = inspect.signature(function)
    parameters = [p for p in found.parameters.values() if p.name != "self"]
    returns = inspect.Signature.empty if found.return_annotation in ("None", None) else found.return_annotation
    line = name + str(found.replace(parameters=parameters, return_annotation=returns))
    # Annotations are texts; what is left in quotes are defaults.
    line = re.sub(r"(: |-> )'([^']*)'", r"\1\2", line).replace("StoredPhotons", "Photons")
    if len(line) <= 110:
        return line
    head, _, rest = line.partition("(")
    inner, _, tail = rest.rpartition(")")
    return f"{head}(\n" + "".join(f"    {part},\n" for part in _split(inner)) + f"){tail}"


def _split(text: str) -> list[str]:
    """`text` at its commas outside brackets."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in "([") - (letter in ")]")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts]


def _text(thing: Any) -> str:
    found = inspect.getdoc(thing)
    assert found, f"{thing} has no docstring"
    return found.replace("`spectrasplat.", "`ss.")


if __name__ == "__main__":
    PAGE.write_text(reference(), encoding="utf-8")
