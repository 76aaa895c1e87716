"""OpenGL through Mesa's OSMesa library: no screen, no device, no EGL needed.

The fall-back where EGL is broken or absent. `glcontext` has no OSMesa backend, so this is
the small loader moderngl asks for: an object that can look up functions by name.
The constants are those of Mesa's `GL/osmesa.h`. Mesa dropped OSMesa with version 25.1.
"""

from __future__ import annotations

import ctypes
from typing import Self

_LIBRARIES = ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so")
_FORMAT, _RGBA = 0x22, 0x1908
_PROFILE, _CORE_PROFILE = 0x33, 0x34
_MAJOR_VERSION, _MINOR_VERSION = 0x36, 0x37
_GL_UNSIGNED_BYTE = 0x1401
_SIDE_PX = 4
"""The window's own framebuffer is never drawn to: everything goes to framebuffer objects."""


def load_library() -> ctypes.CDLL:
    """The OSMesa library; OSError when none is installed."""
    for name in _LIBRARIES:
        try:
            return ctypes.CDLL(name)
        except OSError:
            continue
    raise OSError(f"{_LIBRARIES[0]} is not installed")


class OSMesaLoader:
    """A current OSMesa core context, in the form `moderngl.create_context(context=…)` takes."""

    def __init__(self, major: int, minor: int) -> None:
        """Make a context of at least `major.minor` current; OSError when that cannot be had."""
        self._library = _declare(load_library())
        attributes = (ctypes.c_int * 10)(
            *(_FORMAT, _RGBA),
            *(_PROFILE, _CORE_PROFILE),
            *(_MAJOR_VERSION, major),
            *(_MINOR_VERSION, minor),
            *(0, 0),
        )
        self._handle = self._library.OSMesaCreateContextAttribs(attributes, None)
        if not self._handle:
            raise OSError(f"this OSMesa has no OpenGL {major}.{minor} core profile")
        # Kept alive here: OSMesa writes into it for as long as the context lives.
        self._pixels = (ctypes.c_ubyte * (4 * _SIDE_PX * _SIDE_PX))()
        self._make_current()

    def load(self, name: str) -> int:
        """Address of the OpenGL function `name`, 0 when unknown."""
        return self._library.OSMesaGetProcAddress(name.encode()) or 0

    def release(self) -> None:
        """Destroy the context (once)."""
        if self._handle:
            self._library.OSMesaDestroyContext(self._handle)
            self._handle = None

    def __enter__(self) -> Self:
        self._make_current()
        return self

    def __exit__(self, *_exception: object) -> None:
        """Stays current, as with moderngl's standalone contexts."""

    def _make_current(self) -> None:
        if not self._library.OSMesaMakeCurrent(self._handle, self._pixels, _GL_UNSIGNED_BYTE, _SIDE_PX, _SIDE_PX):
            raise OSError("OSMesaMakeCurrent failed")


def _declare(library: ctypes.CDLL) -> ctypes.CDLL:
    """Give the functions used here their C signatures (pointers are 64 bits wide)."""
    pointer, integer = ctypes.c_void_p, ctypes.c_int
    library.OSMesaCreateContextAttribs.restype = pointer
    library.OSMesaCreateContextAttribs.argtypes = [ctypes.POINTER(integer), pointer]
    library.OSMesaMakeCurrent.restype = ctypes.c_ubyte
    library.OSMesaMakeCurrent.argtypes = [pointer, pointer, ctypes.c_uint, integer, integer]
    library.OSMesaGetProcAddress.restype = pointer
    library.OSMesaGetProcAddress.argtypes = [ctypes.c_char_p]
    library.OSMesaDestroyContext.restype = None
    library.OSMesaDestroyContext.argtypes = [pointer]
    return library
