"""A study that is killed, and begun again, ends with exactly the rows of one that was left in peace."""

import random
from pathlib import Path

import pytest

from kills import killed, same, uninterrupted, write

pytestmark = pytest.mark.slow


def test_a_study_ends_as_if_it_had_not_been_killed(tmp_path: Path) -> None:
    write(tmp_path, seeds=12)
    expected = uninterrupted(tmp_path / "uninterrupted")
    draws, folder = random.Random(1), tmp_path / "killed"
    struck = [killed(folder, victim, draws, latest=0.5)[0] for victim in ("runner", "worker", "runner")]
    assert any(struck), "it ended before anything was killed"
    uninterrupted(folder)
    same(folder, expected)
