"""Runs the command line: `python -m slamduel run` is `bench run`."""

import sys

from .bench.cli import main

if __name__ == "__main__":
    sys.exit(main())
