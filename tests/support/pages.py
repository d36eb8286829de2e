"""`bench run` without its pages, whose pictures are nearly all that a small run costs."""

import pytest


def left_out(patch: pytest.MonkeyPatch) -> None:
    """A run reads its record, and writes no report of it."""
    from slamduel.bench.report.section import recorded
    from slamduel.bench.run import benchmark

    patch.setattr(benchmark, "write_report", recorded)
