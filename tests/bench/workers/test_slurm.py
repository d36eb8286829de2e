"""There is no SLURM here: what it would be given is looked at, and a stand-in for sbatch starts that."""

import os
import signal
import subprocess
import time
from collections.abc import Generator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

if find_spec("dask_jobqueue") is None:  # not imported here: it would take Ctrl-C from all other tests
    pytest.skip("dask-jobqueue is not installed", allow_module_level=True)

from dask import config

from slamduel.bench.workers.slurm_executor import Slurm
from slamduel.core.errors import InputError

pytestmark = pytest.mark.slow

SBATCH = """#!/bin/sh
cp "$1" {folder}/job.sh
OMP_NUM_THREADS=1 setsid sh {folder}/job.sh > {folder}/job.log 2>&1 &
echo "Submitted batch job $!"
"""
SCANCEL = """#!/bin/sh
echo "$@" >> {folder}/cancelled
kill -- "-$1"
"""


@pytest.fixture(scope="module", autouse=True)
def defaults() -> None:
    """Its defaults are in Dask's configuration before anything is set there, and Ctrl-C is as it was."""
    before = signal.getsignal(signal.SIGINT)
    from dask_jobqueue.slurm import SLURMCluster

    assert SLURMCluster
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def configured() -> Generator[None]:
    user = {"cores": 1, "memory": "2GB", "interface": "lo", "walltime": "01:00:00", "queue": "short"}
    user |= {"worker-extra-args": ["--no-dashboard"], "job-extra-directives": ["--qos=low"]}
    with config.set({f"jobqueue.slurm.{name}": value for name, value in user.items()}):
        yield


@pytest.fixture
def commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name, text in {"sbatch": SBATCH, "scancel": SCANCEL}.items():
        (tmp_path / name).write_text(text.format(folder=tmp_path))
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    return tmp_path


def test_where_there_is_no_sbatch(monkeypatch: pytest.MonkeyPatch, configured: None) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(InputError, match="--executor slurm: there is no sbatch here"):
        _ = Slurm(2, exclusive=False).slots


def test_where_a_job_is_not_configured(commands: Path) -> None:
    with pytest.raises(InputError, match=r"jobqueue.slurm.cores is not set; expected .* in .*jobqueue.yaml"):
        _ = Slurm(2, exclusive=False).slots


def test_a_job_is_what_the_user_configured_and_what_timed_cells_need(commands: Path, configured: None) -> None:
    scripts: list[str] = []
    for exclusive in (False, True):
        slurm = Slurm(2, exclusive=exclusive)
        scripts.append(slurm.job_script())
        slurm.close()
    for script in scripts:
        assert all(f"#SBATCH {words}\n" in script for words in ("-p short", "-t 01:00:00", "--qos=low")), script
        assert " --nthreads 1 " in script
        assert " --no-dashboard" in script
    assert ["--resources MACHINE=1" in script for script in scripts] == [False, True]
    assert ["#SBATCH --exclusive\n" in script for script in scripts] == [False, True]


def test_jobs_join_and_are_cancelled(commands: Path, configured: None) -> None:
    slurm, found = Slurm(1, exclusive=True), dict[str, Any]()
    try:
        end = time.monotonic() + 60
        while not found and time.monotonic() < end:
            found = slurm.cluster.workers()
            time.sleep(0.1)
        (worker,) = found.values()
        assert worker["resources"] == {"MACHINE": 1}
        assert worker["nthreads"] == 1
    finally:
        slurm.close()
    (job,) = (commands / "cancelled").read_text().split()
    while subprocess.run(["kill", "-0", job], capture_output=True, check=False).returncode == 0:
        assert time.monotonic() < end
        time.sleep(0.1)
