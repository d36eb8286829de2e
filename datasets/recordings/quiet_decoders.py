"""Keeps the terminal clear of what image and video decoders say of a damaged file: our own sentence says it."""

import contextlib
import os
from collections.abc import Generator


@contextlib.contextmanager
def silenced() -> Generator[None]:
    """What libraries write to the process's standard error meanwhile goes nowhere; Python's own goes with it."""
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
