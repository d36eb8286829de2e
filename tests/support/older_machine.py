"""The environment in which libraries choose the code that they would on an older processor.

numpy, OpenBLAS, OpenCV, numba and the C library look at the processor when they are loaded, and each can be told to
leave some of it aside. `python tests/support/older_machine.py haswell COMMAND ...` runs a command so.
"""

import os
import sys
from typing import Any

import numpy as np

_AVX512 = ("X86_V4", "AVX512_ICL", "AVX512_SPR")
_NUMPY = {"haswell": _AVX512, "nehalem": ("X86_V3", *_AVX512)}
"""What numpy dispatches beyond AVX2, and beyond its baseline."""

_KINDS = {
    "haswell": {  # AVX2 and FMA, 2013
        "OPENBLAS_CORETYPE": "Haswell",
        "OPENCV_CPU_DISABLE": "AVX512-SKX",
    },
    "nehalem": {  # SSE 4.2, 2008
        "OPENBLAS_CORETYPE": "Nehalem",
        "OPENCV_CPU_DISABLE": "AVX2,AVX512-SKX",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA",
    },
}

KINDS = tuple(_KINDS)


def environment(kind: str) -> dict[str, str]:
    """The variables that make a process compute as that kind of machine does; numpy is told only what this one has."""
    core: Any = np._core._multiarray_umath  # pyright: ignore[reportAttributeAccessIssue]
    beyond = [name for name in _NUMPY[kind] if core.__cpu_features__.get(name)]
    numpy = {"NPY_DISABLE_CPU_FEATURES": " ".join(beyond)} if beyond else {}
    return {**numpy, **_KINDS[kind], "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}


if __name__ == "__main__":
    kind, *command = sys.argv[1:]
    os.execvpe(command[0], command, os.environ | environment(kind))
