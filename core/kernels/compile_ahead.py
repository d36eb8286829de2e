"""Compiles a list of inner loops on two cores: one process from the list's start, another from its end.

Once they meet, each loads from disk what the other has compiled.
"""

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import cache
from importlib import import_module
from typing import Any

from .compiled import kept

Kernels = Sequence[tuple[Callable[..., Any], tuple[Any, ...]]]
"""Compiled functions, each with arguments of the types it is called with."""


@cache
def compile_ahead(module: str) -> None:
    """Compiles what `kernels()` of a module lists, where some of it is not cached on disk yet.

    Does nothing on a single core, where each function is compiled at its first call. Runs once per process.
    """
    if (os.cpu_count() or 1) < 2 or all(kept(kernel) for kernel, _ in _listed(module)):
        return
    program = f"from {__name__} import backwards; backwards({module!r}, {os.getpid()})"
    path = os.pathsep.join(filter(None, sys.path))
    quiet: Any = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen([sys.executable, "-c", program], env={**os.environ, "PYTHONPATH": path}, **quiet) as other:
        try:
            _compile(_listed(module))
        finally:
            other.kill()


def backwards(module: str, parent: int) -> None:
    """Compiles from the list's end, as long as the process `parent` waits."""
    for one in reversed(_listed(module)):
        if os.getppid() == parent:
            _compile([one])


def _listed(module: str) -> Kernels:
    return import_module(module).kernels()


def _compile(kernels: Kernels) -> None:
    from numba import typeof

    for kernel, arguments in kernels:
        dispatcher: Any = kernel
        dispatcher.compile(tuple(typeof(argument) for argument in arguments))
