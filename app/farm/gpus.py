"""How many GPUs there are to share out: EGL's devices that are no software renderers, each card once.

By EGL_EXT_device_enumeration and EGL_EXT_device_query (Khronos), in the order in which moderngl counts them.
"""

from __future__ import annotations

import ctypes

_MOST = 64
_EXTENSIONS = 0x3055
_DRM_DEVICE_FILE = 0x3233


def count_gpus() -> int:
    """GPUs with the lowest numbers, without a gap; 0 where nothing can be told."""
    try:
        egl = ctypes.CDLL("libEGL.so.1")
        egl.eglGetProcAddress.restype = ctypes.c_void_p
        query = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
        text_of = egl.eglGetProcAddress(b"eglQueryDeviceStringEXT")
    except (OSError, AttributeError):
        return 0
    if not query or not text_of:
        return 0
    devices = (ctypes.c_void_p * _MOST)()
    found = ctypes.c_int(0)
    ask = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(query)
    ask_text = ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int)(text_of)
    if not ask(_MOST, devices, ctypes.byref(found)):
        return 0
    files: list[bytes] = []
    for device in devices[: found.value]:
        extensions = (ask_text(device, _EXTENSIONS) or b"").split()
        if b"EGL_MESA_device_software" in extensions:
            break
        has_file = b"EGL_EXT_device_drm" in extensions
        file = (ask_text(device, _DRM_DEVICE_FILE) or b"") if has_file else b""
        if file and file in files:
            break  # the same card again, by another driver
        files.append(file)
    return len(files)
