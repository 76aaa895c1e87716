"""Whether a better GPU may be there than the one that was chosen, and how to choose it.

OpenGL takes a software renderer or a laptop's integrated GPU without a word where the better one's libraries, files or
rights are missing. What the kernel reports of the machine is compared with what draws.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

_VENDORS = {"0x10de": "NVIDIA", "0x1002": "AMD", "0x8086": "Intel"}
_RANKS = {"NVIDIA": 2, "AMD": 1, "Intel": 0}
"""A laptop's second GPU is of the higher rank, as a rule."""
_DISPLAY_CLASS = "0x03"
_FORCING = {
    "LIBGL_ALWAYS_SOFTWARE": ("1", "true", "yes"),
    "GALLIUM_DRIVER": ("llvmpipe", "softpipe", "swr"),
    "MESA_LOADER_DRIVER_OVERRIDE": ("swrast", "kms_swrast", "llvmpipe"),
    "SPECTRASPLAT_BACKEND": ("osmesa",),
}
"""Variables, and values of theirs, that force a software renderer."""
_VENDOR_FOLDERS = ("usr/share/glvnd/egl_vendor.d", "etc/glvnd/egl_vendor.d")
NVIDIA_EGL = "libEGL_nvidia.so.0"


@dataclass(frozen=True)
class Card:
    """A graphics card on the bus."""

    vendor: str
    driver: str
    """The kernel's; "" for none."""


@dataclass(frozen=True)
class Machine:
    """The system that is examined; tests have one of their own."""

    root: Path = Path("/")
    environment: Mapping[str, str] | None = None
    loads: Callable[[str], bool] | None = None
    """Whether a library can be loaded."""

    def variable(self, name: str) -> str:
        """An environment variable; "" where it is not set."""
        return (os.environ if self.environment is None else self.environment).get(name, "").strip()

    def has(self, library: str) -> bool:
        """Whether a library can be loaded."""
        if self.loads is not None:
            return self.loads(library)
        try:
            ctypes.CDLL(library)
        except OSError:
            return False
        return True

    def find(self, pattern: str) -> list[Path]:
        """Files by a pattern below the root, sorted; none where they may not be listed."""
        try:
            return sorted(self.root.glob(pattern))
        except OSError:
            return []

    def cards(self) -> list[Card]:
        """Those whose makers' GPUs we know: servers have small ones besides, for their consoles."""
        found = []
        for device in self.find("sys/bus/pci/devices/*"):
            vendor = _VENDORS.get(_text(device / "vendor"))
            if vendor and _text(device / "class").startswith(_DISPLAY_CLASS):
                driver = device / "driver"
                found.append(Card(vendor, driver.resolve().name if driver.exists() else ""))
        if not any(card.vendor == "NVIDIA" for card in found) and self.find("dev/nvidia[0-9]*"):
            found.append(Card("NVIDIA", "nvidia"))  # containers may hide the bus
        return found


def advice(renderer: str, is_software: bool, machine: Machine | None = None) -> str:
    """One sentence that names the GPU that may be there and how to choose it; "" where none is better than `renderer`
    (OpenGL's GL_RENDERER)."""
    machine = machine or Machine()
    cards = sorted(machine.cards(), key=lambda card: -_RANKS[card.vendor])
    if not is_software:
        return _instead_of(renderer, cards)
    if not cards:
        if machine.find("dev/dxg"):
            return "the processor draws, and Windows may have a GPU: set GALLIUM_DRIVER=d3d12 (Mesa 22 or newer)"
        return ""
    best = cards[0]
    found = f"the processor draws although there is a GPU by {best.vendor}"
    for name, values in _FORCING.items():
        if machine.variable(name).casefold() in values:
            return f"{found}: {name}={machine.variable(name)} asks for it, so unset {name}"
    return f"{found}: {_nvidia(machine, best) if best.vendor == 'NVIDIA' else _mesa(machine, best)}"


def _instead_of(renderer: str, cards: list[Card]) -> str:
    """What to do where a laptop's lesser GPU draws."""
    name = renderer.casefold()
    mine = next((vendor for vendor in _VENDORS.values() if vendor.casefold() in name), None)
    if mine is None and "geforce" in name:
        mine = "NVIDIA"
    if mine is None or not cards:
        return ""
    best = cards[0].vendor
    if _RANKS[best] <= _RANKS[mine]:
        return ""
    found = f"a GPU by {mine} draws although there is one by {best}"
    if best == "NVIDIA":
        return (
            f"{found}: set __NV_PRIME_RENDER_OFFLOAD=1 and __GLX_VENDOR_LIBRARY_NAME=nvidia for the window, and "
            "__EGL_VENDOR_LIBRARY_FILENAMES to NVIDIA's file in /usr/share/glvnd/egl_vendor.d without one"
        )
    return f"{found}: set DRI_PRIME=1"


def _nvidia(machine: Machine, card: Card) -> str:
    if card.driver == "nouveau":
        return "its driver is nouveau, which may be too old for it; install NVIDIA's"
    if card.driver != "nvidia":
        return f"its driver is {card.driver or 'not loaded'}; install NVIDIA's, or hand the device to this machine"
    if not machine.has(NVIDIA_EGL):
        in_container = machine.find(".dockerenv") or machine.find("run/.containerenv")
        if in_container or machine.variable("NVIDIA_VISIBLE_DEVICES"):
            return (
                f"{NVIDIA_EGL} is not in this container; start it with NVIDIA_DRIVER_CAPABILITIES=all (it is "
                f"'{machine.variable('NVIDIA_DRIVER_CAPABILITIES') or 'not set'}')"
            )
        return f"{NVIDIA_EGL} is not installed; install the driver's OpenGL libraries (Debian: libnvidia-egl1)"
    files = [file for folder in _VENDOR_FOLDERS for file in machine.find(f"{folder}/*.json")]
    named = [file for file in files if NVIDIA_EGL in _text(file)]
    if not named:
        return (
            f"no file in /usr/share/glvnd/egl_vendor.d names {NVIDIA_EGL}; write 10_nvidia.json there with "
            f'{{"file_format_version": "1.0.0", "ICD": {{"library_path": "{NVIDIA_EGL}"}}}}'
        )
    return f"set __EGL_VENDOR_LIBRARY_FILENAMES={named[0]}; if that fails, this user may lack rights to /dev/nvidia*"


def _mesa(machine: Machine, card: Card) -> str:
    if not card.driver:
        return "its kernel driver is not loaded; load it (amdgpu, i915 or xe)"
    nodes = machine.find("dev/dri/renderD*")
    if not nodes:
        return "there is no /dev/dri/renderD*; hand /dev/dri to this container (docker run --device /dev/dri)"
    if not any(os.access(node, os.R_OK | os.W_OK) for node in nodes):
        return f"this user may not open {nodes[0]}; add them to the group 'render'"
    return "install its OpenGL driver (Debian: libgl1-mesa-dri), or a newer one"


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
