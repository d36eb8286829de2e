"""Silences the messages of image and video decoders about a damaged file, which we report ourselves."""

import contextlib
import os
from collections.abc import Generator


@contextlib.contextmanager
def silenced() -> Generator[None]:
    """Discards everything written to the process's standard error meanwhile, Python's own included."""
    try:
        kept = os.dup(2)
    except OSError:  # there is no standard error
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
