"""What this machine has, what SpectraSplat needs, and the exact remedy for every difference."""

from __future__ import annotations

import importlib.metadata
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, fields
from importlib import import_module as load_module
from importlib.metadata import version as installed_version
from typing import Literal

from ..base.errors import UserError
from ..base.paths import assets_dir, cache_dir, shaders_dir
from ..gpu import context as gpu
from ..gpu.limits import BRUSH_STORAGE_BLOCKS, NEEDED, Limits
from .table import Doctor

PACKAGE = "spectrasplat"
PYTHON = (3, 11)
REINSTALL = "python -m pip install --upgrade"
_NATIVE_MODULES = ("numpy", "moderngl", "imgui_bundle", "glfw", "numba", "OpenEXR")
"""Modules with compiled parts, which can be installed and still not load; imgui_bundle must precede glfw."""
_WINDOW_MODULES = ("imgui_bundle", "glfw")
"""Rendering to files does without them."""
_CACHE_BYTES = 16 << 20
"""What the programs of a few scenes take."""
_MORE_THAN_PROMISED = dict.fromkeys(
    ("vertex_storage_blocks", "storage_bindings"),
    "update the graphics driver or use another GPU: OpenGL 4.3 promises fewer, but splats are drawn by vertex shaders "
    "that read them",
)
"""Remedies of limits where `NEEDED` asks for more than OpenGL 4.3 promises."""

State = Literal["ok", "optional", "missing"]


@dataclass(frozen=True)
class Check:
    """One finding. `remedy` is empty when all is well."""

    name: str
    found: str
    state: State
    """"optional": something is absent that rendering can do without."""
    remedy: str = ""

    @property
    def usable(self) -> bool:
        """Whether SpectraSplat can work in spite of it."""
        return self.state != "missing"


def doctor(options: Doctor) -> int:
    """Print the findings; returns 2 where something that is needed is missing."""
    checks = examine()
    print(report(checks))
    return 0 if all(check.usable for check in checks) else 2


def examine() -> list[Check]:
    """Every check, in the order in which to mend things."""
    return [_python(), *_packages(), *_modules(), *_opengl(), _osmesa(), _display(), _cache(), _data()]


def report(checks: list[Check]) -> str:
    """The findings as aligned lines, then what to do."""
    signs = {"ok": "ok", "optional": "--", "missing": "!!"}
    width = max(len(check.name) for check in checks)
    lines = [f"{signs[check.state]}  {check.name:<{width}}  {check.found}" for check in checks]
    missing = [check for check in checks if not check.usable]
    optional = [check for check in checks if check.state == "optional" and check.remedy]
    lines.append("")
    if missing:
        lines.append("SpectraSplat cannot run here yet. To mend it:")
        lines += [f"  {check.name}: {check.remedy}" for check in missing]
    else:
        lines.append("SpectraSplat can run here.")
    if optional:
        lines.append("It would also be good to have:")
        lines += [f"  {check.name}: {check.remedy}" for check in optional]
    return "\n".join(lines)


def _python() -> Check:
    found = ".".join(str(part) for part in sys.version_info[:3])
    if sys.version_info[:2] >= PYTHON:
        return Check("Python", found, "ok")
    wanted = f"{PYTHON[0]}.{PYTHON[1]}"
    return Check("Python", f"{found}, needed {wanted}", "missing", f"install Python {wanted} or newer")


def requirements() -> list[tuple[str, str]]:
    """(package, oldest version) of the run-time dependencies, as installed or as in the checkout."""
    try:
        listed = importlib.metadata.requires(PACKAGE) or []
    except importlib.metadata.PackageNotFoundError:
        import tomllib

        project = shaders_dir().parent / "pyproject.toml"
        listed = tomllib.loads(project.read_text(encoding="utf-8"))["project"]["dependencies"]
    found = []
    for line in listed:
        match = re.match(r"([A-Za-z0-9._-]+)\s*(?:>=\s*([0-9.]+))?", line)
        if match and ";" not in line:  # extras, and what only some Pythons have, are done without
            found.append((match[1], match[2] or "0"))
    return found


def _packages() -> Iterator[Check]:
    """One line for all packages that fit, one for each that does not."""
    fitting = []
    for name, oldest in requirements():
        wanted = f"'{name}>={oldest}'"
        try:
            version = installed_version(name)
        except importlib.metadata.PackageNotFoundError:
            yield Check(f"package {name}", "not installed", "missing", f"{REINSTALL} {wanted}")
            continue
        if _version_key(version) < _version_key(oldest):
            yield Check(f"package {name}", f"{version}, needed {oldest}", "missing", f"{REINSTALL} {wanted}")
        else:
            fitting.append(f"{name} {version}")
    yield Check("packages", ", ".join(fitting), "ok")


def _modules() -> Iterator[Check]:
    """That the compiled packages really load."""
    loaded = []
    for name in _NATIVE_MODULES:
        try:
            load_module(name)
        except ImportError as error:
            reason = " ".join(str(error).split())
            library = re.search(r"lib[\w.+-]*\.so[.\d]*", reason)
            remedy = f"run '{gpu.APT_LINE}' as root" if library else f"{REINSTALL} --force-reinstall {name}"
            state: State = "optional" if name in _WINDOW_MODULES else "missing"
            yield Check(f"module {name}", reason, state, remedy)
        else:
            loaded.append(name)
    yield Check("modules load", ", ".join(loaded), "ok")


def _opengl() -> Iterator[Check]:
    """The context that rendering would get, and its limits."""
    try:
        context = gpu.create_context()
    except UserError as error:
        found, _, remedy = str(error).partition(": ")
        yield Check("OpenGL", found, "missing", remedy or found)
        return
    kind = "software renderer: slow but right" if context.is_software else "GPU"
    yield Check("OpenGL", f"{context.version} through {context.backend.upper()}", "ok")
    yield Check("renderer", f"{context.renderer} ({kind})", "ok")
    yield Check("vendor", context.vendor, "ok")
    yield Check("splats", context.splats.sentence, "ok")
    if context.advice:
        found, _, remedy = context.advice.partition(": ")
        yield Check("better GPU", found, "optional", remedy)
    yield from _limits(context.limits)
    context.release()


def _limits(limits: Limits) -> Iterator[Check]:
    for field in fields(Limits):
        found, needed = getattr(limits, field.name), getattr(NEEDED, field.name)
        enough = _at_least(found, needed)
        yield Check(
            f"limit {field.name}",
            f"{_number(found)} (needed {_number(needed)})",
            "ok" if enough else "missing",
            ""
            if enough
            else _MORE_THAN_PROMISED.get(field.name, "update the graphics driver: OpenGL 4.3 promises more"),
        )
    if NEEDED.storage_blocks <= limits.storage_blocks < BRUSH_STORAGE_BLOCKS:
        yield Check(
            "limit of the brush",
            f"{limits.storage_blocks} storage blocks (local dispersion takes {BRUSH_STORAGE_BLOCKS})",
            "optional",
            "update the graphics driver to brush dispersion onto glass",
        )


def _osmesa() -> Check:
    from ..gpu.osmesa import load_library

    try:
        load_library()
    except OSError:
        return Check("OSMesa", "not installed (only a second way to the software renderer)", "optional")
    return Check("OSMesa", "installed", "ok")


def _display() -> Check:
    for variable in ("WAYLAND_DISPLAY", "DISPLAY"):
        if os.environ.get(variable):
            return Check("display", f"{variable}={os.environ[variable]}", "ok")
    return Check("display", "none (rendering to files needs none)", "optional")


def _cache() -> Check:
    try:
        folder = cache_dir()
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(_CACHE_BYTES))
    except OSError as error:
        remedy = "make room or the folder writable, or set XDG_CACHE_HOME to one that is; else all is compiled anew"
        return Check("cache folder", str(error), "optional", remedy)
    return Check("cache folder", f"{folder} is writable", "ok")


def _data() -> Check:
    absent = [str(folder) for folder in (shaders_dir(), assets_dir()) if not folder.is_dir()]
    if absent:
        return Check(
            "program files",
            f"{' and '.join(absent)} missing",
            "missing",
            "reinstall: pip install . in the program's checkout",
        )
    return Check("program files", str(shaders_dir().parent), "ok")


def _at_least(found: int | tuple[int, ...], needed: int | tuple[int, ...]) -> bool:
    if isinstance(found, tuple) and isinstance(needed, tuple):
        return all(have >= want for have, want in zip(found, needed, strict=True))
    return found >= needed  # type: ignore[operator]


def _number(value: int | tuple[int, ...]) -> str:
    if isinstance(value, tuple):
        return " × ".join(f"{part:,}" for part in value)
    return f"{value:,}"


def _version_key(version: str) -> tuple[int, ...]:
    """Leading numbers of a version, comparable: "3.5.3rc1" → (3, 5, 3); trailing zeros do not count."""
    numbers = [int(part) for part in re.match(r"[0-9.]*", version)[0].split(".") if part]  # type: ignore[index]
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return tuple(numbers)
