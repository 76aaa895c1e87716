"""One OpenGL 4.3 core context without a window, and its failures in plain words.

EGL is tried first (every GPU driver and llvmpipe have it), on each device in turn, then
OSMesa. `SPECTRASPLAT_BACKEND=egl` or `=osmesa` chooses one and forbids the other.
"""

from __future__ import annotations

import ctypes
import os
import sys
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal, Self

from ..base.errors import DeviceError, OwnCallError, UserError, own_fault, suggestion
from ..base.paths import reserve_driver_cache
from .better_device import advice
from .device_traits import DeviceTraits, is_software_renderer
from .limits import Limits
from .linker import adopting_context
from .pass_timers import PassTimers
from .splat_way import SplatWay, way_of

if TYPE_CHECKING:
    import moderngl

Backend = Literal["egl", "osmesa", "window"]
"""How a context was made; a window brings its own."""
BACKENDS: tuple[Backend, ...] = ("egl", "osmesa")
ENVIRONMENT_VARIABLE = "SPECTRASPLAT_BACKEND"
GL_VERSION = (4, 3)
GL_VERSION_CODE = 100 * GL_VERSION[0] + 10 * GL_VERSION[1]

APT_LINE = "apt-get install libegl1 libgl1 libgl1-mesa-dri"
APT_LINE_OSMESA = "apt-get install libosmesa6"
_MAX_EGL_DEVICES = 16


def check_device(ctx: moderngl.Context, where: str) -> None:
    """Raise `DeviceError` if OpenGL has reported an error since the last check: a sentence with a way out.

    moderngl does not check by itself: a dispatch past the limits silently does nothing.
    """
    error = ctx.error
    if error == "GL_OUT_OF_MEMORY":
        raise DeviceError(
            f"the device is out of memory ({error} in {where}): use a smaller picture or a smaller --batch"
        )
    if error.startswith("GL_INVALID"):
        raise OwnCallError(own_fault(f"OpenGL was asked wrongly ({error} in {where})"))
    if error != "GL_NO_ERROR":  # moderngl has no name for a lost context
        raise DeviceError(
            f"the device was lost ({error} in {where}), as after a reset or sleep: start again, with a smaller --batch "
            "or on another device where it happens again"
        )


class Context:
    """A current moderngl context with what the passes need to know of it.

    `ctx` is the `moderngl.Context`; `backend` says how it was made.
    """

    def __init__(self, ctx: moderngl.Context, backend: Backend) -> None:
        self.ctx = ctx
        self.backend = backend
        info = ctx.info
        self.renderer: str = info["GL_RENDERER"]
        self.vendor: str = info["GL_VENDOR"]
        self.version: str = info["GL_VERSION"]
        self.limits = Limits.read(info)
        self.splats: SplatWay = way_of(ctx)
        """How splats are drawn here."""
        self.traits = replace(DeviceTraits.of(self.renderer), splats_by_compute=self.splats.by_compute)
        self.check("reading the OpenGL limits")

    @property
    def is_software(self) -> bool:
        """Whether the processor draws, not a GPU (timer queries are then meaningless)."""
        return self.traits.is_software

    @cached_property
    def advice(self) -> str:
        """A sentence where a better GPU may be there than this one, and how to choose it; else ""."""
        return advice(self.renderer, self.is_software)

    @cached_property
    def timers(self) -> PassTimers:
        """What the device itself took for each pass."""

        return PassTimers(self.ctx, not self.is_software, is_software_renderer(self.renderer))

    def finish(self) -> None:
        """Wait until everything sent so far is done."""
        self.ctx.finish()

    def check(self, where: str) -> None:
        """`check_device`, which names the device."""
        check_device(self.ctx, f"{where} ({self.renderer}, OpenGL {self.version})")

    def release(self) -> None:
        """Destroy the context; its buffers, textures and programs are gone with it."""
        self.ctx.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.release()


def create_context(backend: Backend | None = None) -> Context:
    """A current OpenGL 4.3 core context, by `backend`, else the environment, else the first that works.

    Raises `UserError` with the exact remedy when there is none.
    """
    if sys.platform == "darwin":
        raise UserError(
            "macOS stops at OpenGL 4.1 and compute shaders need 4.3, "
            "so run SpectraSplat on Linux (a virtual machine or a container will do)"
        )
    chosen = backend or _from_environment()
    reserve_driver_cache()
    if chosen == "osmesa":
        return _create_osmesa()
    try:
        return _create_egl()
    except UserError:
        if chosen == "egl":
            raise
        try:
            return _create_osmesa()
        except UserError:
            pass  # EGL is the ordinary way: its remedy is the one to give
        raise


def _from_environment() -> Backend | None:
    name = os.environ.get(ENVIRONMENT_VARIABLE, "").strip().casefold()
    if not name:
        return None
    for backend in BACKENDS:
        if name == backend:
            return backend
    hint = suggestion(name, BACKENDS) or ", use 'egl' or 'osmesa'"
    raise UserError(f"{ENVIRONMENT_VARIABLE} is '{name}', which is no known backend{hint}")


def _create_egl() -> Context:
    import glcontext

    egl = _first_loadable(("libEGL.so.1", "libEGL.so"))
    gl = _first_loadable(("libGL.so.1", "libOpenGL.so.0", "libGL.so"))
    if egl is None or gl is None:
        missing = "libEGL.so.1" if egl is None else "libGL.so.1"
        raise UserError(f"OpenGL is missing ({missing} is not installed): run '{APT_LINE}' as root")
    open_device = glcontext.get_backend_by_name("egl")
    problem = ""
    # The first device may be a card without rights or too old, and a software one follow it.
    for index in range(_MAX_EGL_DEVICES):
        try:
            loader = open_device(mode="standalone", glversion=GL_VERSION_CODE, libegl=egl, libgl=gl, device_index=index)
            ctx = adopting_context(loader, GL_VERSION_CODE, standalone=True)
        except Exception as error:  # noqa: BLE001 - glcontext raises bare Exception
            if index > 0 and "requested device index" in str(error):
                break
            problem = problem or str(error)
            if "GLCONTEXT_DEVICE_INDEX" in os.environ:  # the user's choice overrides ours
                break
            continue
        return Context(ctx, "egl")
    raise UserError(_explain_egl(problem))


def _create_osmesa() -> Context:
    from .osmesa import OSMesaLoader

    try:
        loader = OSMesaLoader(*GL_VERSION)
    except OSError as error:
        raise UserError(
            f"OpenGL through OSMesa failed ({error}): run '{APT_LINE_OSMESA}' as root, or use EGL"
        ) from error
    return Context(adopting_context(loader, GL_VERSION_CODE, standalone=True), "osmesa")


def _explain_egl(problem: str) -> str:
    """glcontext's terse message as a sentence with a remedy."""
    wanted = f"{GL_VERSION[0]}.{GL_VERSION[1]}"
    too_old = ("eglCreateContext failed", "eglChooseConfig failed", "Requested OpenGL version")
    if any(part in problem for part in too_old):
        return (
            f"OpenGL {wanted} is needed and this driver has less ({problem}): update the graphics "
            f"driver, or run '{APT_LINE}' as root for the software renderer"
        )
    return f"OpenGL {wanted} could not be started through EGL ({problem}): run '{APT_LINE}' as root"


def _first_loadable(names: tuple[str, ...]) -> str | None:
    """The first library the dynamic linker finds (far quicker than ctypes.util.find_library)."""
    for name in names:
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return name
    return None
