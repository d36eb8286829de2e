"""Memory of this process: a limit on how far it grows, and the most that it has held."""

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
    """Let the process grow by no more than this meanwhile: address space, the one limit that the kernel keeps.

    Elsewhere than on Linux the kernel takes the limit and does not keep it.
    """
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
    """The most memory that the process holds beyond what it does now, for as long as this is asked.

    Linux forgets an earlier peak when told to; elsewhere only the first peak of a process can be told.
    """

    _asked = False

    def __init__(self) -> None:
        self._known = _forget() or not Peak._asked
        Peak._asked = True
        self._before = _peak_mb()

    def mb(self) -> float | None:
        """MB; None where it cannot be told."""
        return max(_peak_mb() - self._before, 0.0) if self._known else None


def _forget() -> bool:
    """Hand free memory back, as a new process has none, and let the peak be what is held now; whether that was done."""
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
    """The most memory this process has held, MB."""
    if sys.platform == "linux":  # where getrusage has what the process held that started this one, too
        status = Path("/proc/self/status").read_bytes()
        return int(status.partition(b"VmHWM:")[2].split(maxsplit=1)[0]) / 1024
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / MEGABYTE if sys.platform == "darwin" else peak / 1024
