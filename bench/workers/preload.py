"""Loads into the fork server what every worker process needs: imports, and numba set up.

The first call of any compiled function in a process sets numba up, half a second that every cell would pay: it is made
here and inherited. No worker's garbage collector examines what exists by then.
"""

# pyright: reportUnusedImport=false
import contextlib
import gc

from ...backends import registry
from ...core.errors import InputError
from ..measure import cell  # noqa: F401
from . import batch  # noqa: F401

with contextlib.suppress(ImportError):  # a worker that needs one of these and cannot have it will say so itself
    import cv2
    import gtsam  # noqa: F401

    cv2.setNumThreads(1)

with contextlib.suppress(ImportError):
    from ...core.kernels import _planar

    _planar.wrap(0.0)

for name in registry.BUILTIN:
    with contextlib.suppress(InputError):
        registry.find(name)

gc.collect()
gc.freeze()
