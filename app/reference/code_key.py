"""Which code makes a reference: a stored picture belongs to exactly that code, and no version is kept by hand."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from ..base.paths import assets_dir

_PACKAGE = Path(__file__).resolve().parents[1]
_ROOMS = ("reference", "model")


@cache
def code_key(*modules: str) -> str:
    """SHA-256 over the code of `modules` of this folder ("photon_reference"), of all that they import here and in the
    model, and over the spectral tables.

    Comments, docstrings and layout do not count.
    """
    digest = hashlib.sha256()
    for path in _imported([_PACKAGE / "reference" / f"{name}.py" for name in modules]):
        digest.update(f"{path.relative_to(_PACKAGE).as_posix()}\n{stripped_code(_parsed(path))}\n".encode())
    for path in sorted((assets_dir() / "spectra").glob("*.csv")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def stripped_code(tree: ast.Module) -> str:
    """What a module does, without comments and docstrings; these are taken out of `tree`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [line for line in node.body if not _is_text(line)]
    return ast.dump(tree)


def _is_text(line: ast.stmt) -> bool:
    return isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant) and isinstance(line.value.value, str)


def _imported(waiting: list[Path]) -> list[Path]:
    """The files and all that they import, wherever in them, from `_ROOMS`; in the order of their names."""
    found: set[Path] = set()
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += _imports(path)
    return sorted(found)


@cache
def _parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_bytes())


def _imports(path: Path) -> Iterator[Path]:
    for node in ast.walk(_parsed(path)):
        if isinstance(node, ast.ImportFrom) and node.level:
            folder = path.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            for file in (folder.with_suffix(".py"), *(folder / f"{name.name}.py" for name in node.names)):
                if file.is_file() and file.relative_to(_PACKAGE).parts[0] in _ROOMS:
                    yield file
