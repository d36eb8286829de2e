"""Limits and measures the memory of this process."""

import contextlib
import ctypes
import os
import resource
import sys
from collections.abc import Generator
from pathlib import Path

MEGABYTE = 1 << 20


@contextlib.contextmanager
def limited(megabytes: int) -> Generator[None]:
    """Limits the process's growth, by address space, the one limit that the kernel enforces; only on Linux does it."""
    if sys.platform != "linux":
        yield
        return
    before, most = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + megabytes * MEGABYTE
    if most != resource.RLIM_INFINITY:
        limit = min(limit, most)
    resource.setrlimit(resource.RLIMIT_AS, (limit, most))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (before, most))


class Peak:
    """The peak of the process's memory beyond what it holds now.

    Linux resets an earlier peak on request; elsewhere only the first peak of a process can be measured.
    """

    _asked = False

    def __init__(self) -> None:
        self._known = _forget() or not Peak._asked
        Peak._asked = True
        self._before = _peak_mb()

    def mb(self) -> float | None:
        """The peak in MB; None where it cannot be measured."""
        return max(_peak_mb() - self._before, 0.0) if self._known else None


def _forget() -> bool:
    """Returns free memory to the system and resets the peak; returns True if that was possible."""
    if sys.platform != "linux":
        return False
    libc = ctypes.CDLL(None)
    if hasattr(libc, "malloc_trim"):  # glibc
        libc.malloc_trim(0)
    try:
        descriptor = os.open("/proc/self/clear_refs", os.O_WRONLY)
    except OSError:
        return False
    try:
        return os.write(descriptor, b"5") == 1
    except OSError:
        return False
    finally:
        os.close(descriptor)


def _peak_mb() -> float:
    if sys.platform == "linux":  # where getrusage includes the parent's memory
        status = Path("/proc/self/status").read_bytes()
        return int(status.partition(b"VmHWM:")[2].split(maxsplit=1)[0]) / 1024
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / MEGABYTE if sys.platform == "darwin" else peak / 1024
