"""A study that is asked to stop: it ends at once, says how to go on, and leaves nothing behind."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from kills import descendants, held
from places import SUPPORT

pytestmark = pytest.mark.slow

STUDY = """
[[cells]]
dataset = "matlab-report"
backend = "misbehaving:slow[seconds=0.3]"
seeds = 200
"""


@pytest.fixture
def temporary() -> Iterator[Path]:
    """A folder with a short name: the path of a socket has 107 letters at most."""
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_it_tells_how_to_go_on_and_is_gone(tmp_path: Path, temporary: Path, how: signal.Signals) -> None:
    (tmp_path / "slow.toml").write_text(STUDY)
    environment = {**os.environ, "PYTHONPATH": str(SUPPORT), "TMPDIR": str(temporary)}
    command = [sys.executable, "-m", "slamduel.bench.cli", "ablate", "slow.toml", "--out", "out"]
    runner = subprocess.Popen(command, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, stdout=subprocess.PIPE)
    while held(tmp_path / "out") < 1 and runner.poll() is None:
        time.sleep(0.05)
    children = descendants(runner.pid)
    runner.send_signal(how)
    said = runner.communicate(timeout=60)[1].decode()
    assert runner.returncode == 130
    assert said.startswith("bench: interrupted; ")
    assert said.endswith(" ablate slow.toml --out out continues from here.\n")
    assert len(said.splitlines()) == 1
    end = time.monotonic() + 30
    while any(Path(f"/proc/{pid}").exists() for pid in children):
        assert time.monotonic() < end, "a process was left"
        time.sleep(0.05)
    assert not list(temporary.glob("slamduel-*"))
    assert not (tmp_path / "out" / ".lock").exists()
