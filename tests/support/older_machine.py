"""The environment in which libraries choose the code of an older processor.

numpy, OpenBLAS, OpenCV, numba and the C library detect the processor when loaded, and each can be told to ignore
features. `python tests/support/older_machine.py haswell COMMAND ...` runs a command so.
"""

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

_AVX512 = ("X86_V4", "AVX512_ICL", "AVX512_SPR")
_NUMPY = {"haswell": _AVX512, "nehalem": ("X86_V3", *_AVX512)}
"""Features that numpy dispatches beyond AVX2, and beyond its baseline."""

_OPENCV = {"haswell": {"AVX512-SKX": "avx512f"}, "nehalem": {"AVX2": "avx2", "AVX512-SKX": "avx512f"}}
"""The same of OpenCV, each with Linux's name of the processor feature."""

_KINDS = {
    "haswell": {  # AVX2 and FMA, 2013
        "OPENBLAS_CORETYPE": "Haswell"
    },
    "nehalem": {  # SSE 4.2, 2008
        "OPENBLAS_CORETYPE": "Nehalem",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA",
    },
}


def environment(kind: str) -> dict[str, str]:
    """The variables that make a process compute as on that kind of machine.

    Only features of this machine are disabled: libraries complain about others.
    """
    core: Any = np._core._multiarray_umath  # pyright: ignore[reportAttributeAccessIssue]
    numpy = " ".join(name for name in _NUMPY[kind] if core.__cpu_features__.get(name))
    flags = _flags()
    opencv = ",".join(name for name, flag in _OPENCV[kind].items() if flag in flags)
    beyond = {"NPY_DISABLE_CPU_FEATURES": numpy, "OPENCV_CPU_DISABLE": opencv}
    told = {name: words for name, words in beyond.items() if words}
    return {**told, **_KINDS[kind], "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}


def _flags() -> set[str]:
    """The first processor's features in Linux; empty elsewhere."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    return next((set(line.split()) for line in lines if line.startswith("flags")), set())


_NEEDS = {"haswell": {"avx2", "fma"}, "nehalem": {"sse4_2"}}
KINDS = tuple(kind for kind in _KINDS if _NEEDS[kind] <= _flags())
"""Machines that this one can emulate: it must have their features."""


if __name__ == "__main__":
    if len(sys.argv) < 3 or sys.argv[1] not in KINDS:
        sys.exit(f"usage: python {sys.argv[0]} {'|'.join(KINDS)} COMMAND ...")
    os.execvpe(sys.argv[2], sys.argv[2:], os.environ | environment(sys.argv[1]))
