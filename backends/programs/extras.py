"""Wheels of other programs: installed with slamduel[programs], and not needed by anything else."""

import contextlib
from importlib import import_module
from typing import Any

INSTALL = "pip install 'slamduel[programs]'"


def wheel(module: str) -> Any:
    """Imports the module of a wheel; None if it is not installed."""
    with contextlib.suppress(ImportError):
        return import_module(module)
    return None


def lacking(found: Any, module: str) -> str:
    """Says that the module is not installed, and how it is; "" where it was found."""
    return "" if found is not None else f"{module} is not installed; {INSTALL} does it"
