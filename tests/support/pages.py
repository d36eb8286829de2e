"""`bench run` without its pages, whose pictures are nearly all that a small run costs."""

from pathlib import Path

import pytest


def left_out(patch: pytest.MonkeyPatch) -> None:
    """A run reads its record, and writes no report of it."""
    from slamduel.bench.report.section import recorded
    from slamduel.bench.run import benchmark

    patch.setattr(benchmark, "write_report", recorded)


def site_of(place: Path, suite: str) -> Path:
    """The site of a suite, given as its file's text, on a machine without published logs; without pages of runs."""
    from slamduel.bench.cli import main

    (place / "small.toml").write_text(suite)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SLAMDUEL_CACHE", str(place / "cache"))
        left_out(patch)
        words = [str(place / "small.toml"), "--out", str(place / "site"), "--executor", "here", "--quiet"]
        assert main(["suite", *words]) == 0
    return place / "site"
