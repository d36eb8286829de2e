"""Folders named in tests: the checkout, its layers, and the modules that tests share."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
SUPPORT = Path(__file__).parent
LAYERS = ("core", "frontend", "backends", "datasets", "bench")
"""The lowest first."""
