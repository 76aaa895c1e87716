"""Every function of shaders/lib has a test: each CPU reference test declares in `COVERS` what it covers, and this reads
the declarations.

A declared function must be called by the module's own GLSL, or by a library function that is: a name alone does not
count.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

from spectrasplat.base import paths

TESTS = Path(__file__).parent
_DEFINITION = re.compile(r"^(?!return|else)(?:\w+)\s+(\w+)\(([^;]*?)\)\s*\{", re.MULTILINE | re.DOTALL)
_CALL = re.compile(r"\b(\w+)\s*\(")


def functions() -> dict[str, dict[str, str]]:
    """File of shaders/lib → function → its bodies (overloads together)."""
    found: dict[str, dict[str, str]] = {}
    for file in sorted((paths.shaders_dir() / "lib").glob("*.glsl")):
        text = re.sub(r"//[^\n]*", "", file.read_text())
        starts = list(_DEFINITION.finditer(text))
        found[file.name] = {}
        for match, following in zip(starts, [*starts[1:], None], strict=False):
            end = len(text) if following is None else following.start()
            found[file.name][match[1]] = found[file.name].get(match[1], "") + text[match.end() : end]
    return found


def declared() -> dict[str, tuple[dict[str, tuple[str, ...]], str]]:
    """Test module → its `COVERS` and all its strings."""
    modules = {}
    for file in sorted(TESTS.glob("test_*.py")):
        tree = ast.parse(file.read_text())
        for node in tree.body:
            if isinstance(node, ast.Assign) and any(isinstance(t, ast.Name) and t.id == "COVERS" for t in node.targets):
                strings = [n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)]
                modules[file.name] = (ast.literal_eval(node.value), "\n".join(strings))
    return modules


def reached(strings: str, library: dict[str, dict[str, str]]) -> set[str]:
    """Library functions that the GLSL in `strings` calls, directly or through others."""
    bodies = {name: body for file in library.values() for name, body in file.items()}
    todo, seen = {name for name in _CALL.findall(strings) if name in bodies}, set()
    while todo:
        name = todo.pop()
        seen.add(name)
        todo |= {called for called in _CALL.findall(bodies[name]) if called in bodies} - seen
    return seen


def test_the_library_is_read_as_it_is_written() -> None:
    library = functions()
    assert {"camera_ray", "picture_point"} == set(library["camera.glsl"])
    assert len(library["intersect.glsl"]) == 16
    assert sum(map(len, library.values())) > 55


def test_every_library_function_has_a_test() -> None:
    library, covered = functions(), set()
    for module, (covers, strings) in declared().items():
        runs = reached(strings, library)
        for file, names in covers.items():
            unknown = set(names) - set(library[file])
            assert not unknown, f"{module} covers {sorted(unknown)}, which {file} does not hold"
            assert set(names) <= runs, f"{module} declares {sorted(set(names) - runs)} of {file} and never runs them"
            covered |= {(file, name) for name in names}
    missing = {(file, name) for file, names in library.items() for name in names} - covered
    assert not missing, f"functions of shaders/lib without a CPU reference test: {sorted(missing)}"
