"""A command as its tests run it: without the command line's own handling of errors."""

import argparse
from pathlib import Path
from types import ModuleType


def run(module: ModuleType, *words: str | Path) -> int:
    """Runs the command of a module of bench/commands; what it raises is the test's."""
    parser = argparse.ArgumentParser()
    module.arguments(parser)
    return module.main(parser.parse_args([str(word) for word in words]))
