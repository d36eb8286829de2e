"""A command as its tests run it: whole, where it refuses, or without the command line's own handling of errors."""

import argparse
from pathlib import Path
from types import ModuleType

import pytest

from slamduel.bench.cli import main
from slamduel.bench.words import console, stages


def run(module: ModuleType, *words: str | Path) -> int:
    """Runs the command of a module of bench/commands; what it raises is the test's."""
    parser = argparse.ArgumentParser()
    module.arguments(parser)
    return module.main(parser.parse_args([str(word) for word in words]))


def refused(capsys: pytest.CaptureFixture[str], *words: str | Path) -> str:
    """What `bench` prints of words that it refuses with status 2: one sentence, or a parser's usage and one."""
    capsys.readouterr()
    status: object = None
    with pytest.MonkeyPatch.context() as patch:
        for module in (console, stages):  # a machine at work says meanwhile what it is at
            patch.setattr(module, "PATIENCE_S", 3600.0)
        try:
            status = main([str(word) for word in words])
        except SystemExit as stopped:  # argparse's own way
            status = stopped.code
    said = capsys.readouterr()
    assert status == 2, said
    assert said.err.count("\n") == 1 or said.err.startswith("usage: ") or not said.err
    assert "Traceback" not in said.err
    return said.out + said.err
