"""Variables of the environment that a shell, a notebook or a debugger sets do not matter for a command."""

import fcntl
import os
import pty
import struct
import subprocess
import sys
import termios
from pathlib import Path

import pytest

from slamduel.bench.words.console import FULL, LEAST

BENCH = [sys.executable, "-m", "slamduel"]


def bench(*words: str | Path, **changes: str) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, **changes}
    return subprocess.run([*BENCH, *map(str, words)], capture_output=True, text=True, env=env, check=False)


@pytest.mark.parametrize("backend", ["module://not_installed.backend_inline", "no_such_backend"])
def test_a_backend_of_matplotlib_that_is_not_here_does_not_matter(
    tmp_path: Path, log_folder: Path, backend: str
) -> None:
    done = bench("show", log_folder, "--out", tmp_path / "log.png", MPLBACKEND=backend)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "log.png").stat().st_size > 1000
    out = tmp_path / "run"
    done = bench("run", "--dataset", log_folder, "--backend", "ekf", "--out", out, "--quiet", MPLBACKEND=backend)
    assert (done.returncode, done.stderr) == (0, "")
    assert (out / "report.html").is_file()


def test_inner_loops_are_compiled_where_numba_is_told_not_to(tmp_path: Path) -> None:
    """Anew, as no machine code is cached in that folder."""
    program = "from slamduel.core.kernels._planar import wrap; print(wrap(7.0), len(wrap.overloads))"
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=env, check=False)
    assert (done.stdout.split()[-1], done.stderr) == ("1", "")


def test_numbas_setting_stays_for_others() -> None:
    program = (
        "from slamduel.core.kernels._planar import wrap; from numba import njit; wrap(7.0); "
        "print(type(njit(lambda x: x)).__name__, type(wrap).__name__)"
    )
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=env, check=False)
    assert done.stdout == "function CPUDispatcher\n", done.stderr


def test_a_run_without_just_in_time_compilation(tmp_path: Path, log_folder: Path) -> None:
    out = tmp_path / "run"
    done = bench(
        "run", "--dataset", log_folder, "--backend", "ekf,smoother", "--out", out, "--quiet", NUMBA_DISABLE_JIT="1"
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert bench("list", NUMBA_DISABLE_JIT="1").returncode == 0


def test_no_width_loses_anything() -> None:
    whole = bench("list", COLUMNS=str(FULL)).stdout
    for columns in ("0", "1", "12", "39"):
        assert bench("list", COLUMNS=columns).stdout == whole, columns
    assert "  dead-reckoning" in whole


@pytest.mark.parametrize(("columns", "real"), [("0", 100), ("0", 0), ("", 12), ("", LEAST - 1), ("12", 12)])
def test_a_narrow_terminal_has_the_whole_table(log_folder: Path, tmp_path: Path, columns: str, real: int) -> None:
    """On a pseudo-terminal, which is what `isatty` and the width are asked of."""
    mine, theirs = pty.openpty()
    words = [
        *BENCH,
        "run",
        "--dataset",
        str(log_folder),
        "--backend",
        "dead-reckoning,ekf",
        "--out",
        str(tmp_path / "r"),
    ]
    env = {**os.environ, "COLUMNS": columns, "TERM": "xterm"}
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, real, 0, 0))
    with subprocess.Popen(
        words, stdout=theirs, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL, env=env
    ) as process:
        os.close(theirs)
        said = b""
        while chunk := _read(mine):
            said += chunk
    os.close(mine)
    assert process.returncode == 0
    text = said.decode()
    for word in ("dead-reckoning", "ekf", "ATE"):
        assert word in text, text
    assert FULL > LEAST


def _read(end: int) -> bytes:
    try:
        return os.read(end, 65536)
    except OSError:  # the other end is closed
        return b""
