"""What the fork server imports once, so that a worker process starts with it: nothing but imports."""

# pyright: reportUnusedImport=false
import contextlib

from . import cell, prepare  # noqa: F401

with contextlib.suppress(ImportError):  # a worker that needs one of these and cannot have it will say so itself
    import cv2
    import gtsam  # noqa: F401
    from evo.core import metrics, trajectory  # noqa: F401

    cv2.setNumThreads(1)
