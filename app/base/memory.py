"""How much memory this process may use, and pictures that would not fit into it."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from .errors import UserError

MAX_SIDE_PX = 16384
"""Largest texture side OpenGL 4.3 promises."""
_TEXEL_BYTES = 16  # RGBA32F
_LISTED_BYTES, _SURVEYED_BYTES = 4, 20
"""More for a pixel that sees glass, and for one that is surveyed, where one texture holds the sums."""
_GIB, _MIB = 1 << 30, 1 << 20
_LEAST_BYTES = 160 * _MIB
"""What any rendering takes beyond the interpreter: OpenGL and its compiler, programs, the queue of photons."""
_LEAST_ADDRESSES = 560 * _MIB
"""The same where addresses are counted (`ulimit -v`): libraries reserve more than they touch."""


def picture_bytes(width: int, height: int, bins: int | None) -> int:
    """Most memory that a picture takes at once while it is sampled and read back: the sums on the device with the list
    of pixels that see glass and the survey, what is read of them, and what is made of that (`CameraPass`,
    `Channels`)."""
    targets = math.ceil(bins / 4) if bins else 1
    sums = targets * _TEXEL_BYTES
    read = max(_TEXEL_BYTES + sums, sums + 4 * (bins or 0) + 12)
    listed = _LISTED_BYTES + (_SURVEYED_BYTES if targets == 1 else 0)
    return width * height * (sums + listed + read)


def check_picture_memory(width: int, height: int, bins: int | None) -> None:
    """Refuse a picture that would not fit into the memory there is, before anything else is made."""
    needed, available = picture_bytes(width, height, bins), available_bytes()
    least = _LEAST_BYTES if address_limit() is None else _LEAST_ADDRESSES
    if least > available:
        raise UserError(
            f"a rendering needs at least {least // _MIB} MiB and {available // _MIB} MiB are left: give it more memory"
        )
    if needed > available:
        with_bins = f" with --bins {bins}" if bins else ""
        raise UserError(
            f"--size {width}x{height}{with_bins} needs about {needed / _GIB:.1f} GiB "
            f"and {available / _GIB:.1f} GiB are left: choose a smaller one"
        )


def waste_little() -> None:
    """Give memory back as soon as it is free, where the C library is GNU's: with an arena for each thread and a
    threshold that grows, a tenth of what a rendering takes is held for nothing."""
    import ctypes

    arenas_at_most, mapped_from, trimmed_from = -8, -3, -1  # M_ARENA_MAX, M_MMAP_THRESHOLD, M_TRIM_THRESHOLD
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return
    mallopt(arenas_at_most, 1)
    mallopt(mapped_from, 1 << 20)
    mallopt(trimmed_from, 1 << 20)


def peak_bytes() -> int:
    """Most memory that this process has held at once."""
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak * (1 if sys.platform == "darwin" else 1024)


def resident_bytes() -> int:
    """Memory that this process holds now; 0 where the system does not say."""
    return sum(1024 * size for size in _kib("/proc/self/status", "VmRSS:"))


def available_bytes() -> int:
    """Memory this process may still take: the machine's free memory, what is left of its control groups', and of the
    process's own limits of data and addresses (`ulimit -d`, `-v`), whichever is least."""
    found = [memory_bytes()]
    found += [1024 * size for size in _kib("/proc/meminfo", "MemAvailable:")]
    for limit, used, reclaimable in _groups():
        found.append(max(min(limit, _physical_bytes()) - used + reclaimable, 0))
    import resource

    for limit, key in ((resource.RLIMIT_AS, "VmSize:"), (resource.RLIMIT_DATA, "VmData:")):
        most = resource.getrlimit(limit)[0]
        if most != resource.RLIM_INFINITY:
            found += [max(most - 1024 * size, 0) for size in _kib("/proc/self/status", key)]
    return min(found)


def address_limit() -> int | None:
    """What `ulimit -v` allows; None where it is not set."""
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def _kib(path: str, key: str) -> list[int]:
    """The number that follows `key` in a file of the kernel's; nothing where there is none."""
    try:
        lines = Path(path).read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return []
    return [int(line.split()[1]) for line in lines if line.startswith(key)]


def memory_bytes() -> int:
    """Memory this process may use: the machine's, or its control groups' where that is less."""
    return min([_physical_bytes(), *(limit for limit, _, _ in _groups())])


def _physical_bytes() -> int:
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


_V1, _V2 = Path("/sys/fs/cgroup/memory"), Path("/sys/fs/cgroup")


def _groups() -> Iterator[tuple[int, int, int]]:
    """(limit, used, of which files that can be dropped), bytes, of every control group of this process that limits
    memory: its own and those around it, of either version of the kernel's interface."""
    own = {_V1: "/", _V2: "/"}
    try:
        for line in Path("/proc/self/cgroup").read_text(encoding="utf-8", errors="replace").splitlines():
            _, controllers, path = line.split(":", 2)
            if not controllers or "memory" in controllers.split(","):
                own[_V1 if controllers else _V2] = path
    except (OSError, ValueError):
        pass
    names = {
        _V1: ("memory.limit_in_bytes", "memory.usage_in_bytes", ("total_inactive_file", "total_active_file")),
        _V2: ("memory.max", "memory.current", ("inactive_file", "active_file")),
    }
    for root, path in own.items():
        limit, used, files = names[root]
        inside = Path(path.lstrip("/"))
        for part in (inside, *inside.parents) if inside != Path() else (inside,):
            folder = root / part
            try:
                most = (folder / limit).read_text(encoding="ascii").strip()
                held = int((folder / used).read_text(encoding="ascii"))
                stat = (folder / "memory.stat").read_text(encoding="ascii").splitlines()
            except (OSError, ValueError):
                continue
            if most.isdigit():
                yield int(most), held, sum(int(row.split()[1]) for row in stat if row.split()[0] in files)
