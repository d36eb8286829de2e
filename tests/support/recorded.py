"""Recordings and published logs, where the environment variable SLAMDUEL_DATA names a folder of them."""

import os
from pathlib import Path

import pytest


def at_hand(name: str) -> Path:
    """The path of a file or folder of them; the test is skipped where it is not there."""
    if "SLAMDUEL_DATA" not in os.environ or not (path := Path(os.environ["SLAMDUEL_DATA"]) / name).exists():
        pytest.skip(f"SLAMDUEL_DATA is not set, or has no {name}")
    return path
