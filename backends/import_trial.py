"""Imports a plug-in's module in a process of its own first: one that ends its process must not end ours in silence."""

import functools
import json
import signal
import subprocess
import sys

ALIVE = 113  # exit status of a trial that survived the import, whether or not this raised anything

_TRIAL = f"""
import json, os, sys
sys.path[:] = json.loads(sys.argv[2])
try:
    __import__(sys.argv[1])
except BaseException:
    pass
os._exit({ALIVE})
"""


@functools.cache
def death(module: str) -> str:
    """Describes how importing `module` ends a process; "" where it does not, or where it is imported here already.

    An exception is no end: the import here raises it again.
    """
    if module in sys.modules:
        return ""
    trial = subprocess.run(
        [sys.executable, "-c", _TRIAL, module, json.dumps(sys.path)],
        check=False,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    if trial.returncode == ALIVE:
        return ""
    return f"exit status {trial.returncode}" if trial.returncode >= 0 else _signal(-trial.returncode)


def _signal(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
