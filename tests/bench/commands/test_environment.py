"""Variables of the environment that a shell, a notebook or a debugger sets do not matter for a command."""

import fcntl
import os
import pty
import struct
import subprocess
import sys
import termios
import threading
from pathlib import Path

import pytest

from slamduel.bench.cli import main
from slamduel.bench.words.console import FULL, LEAST
from tiers import first_quick

BENCH = [sys.executable, "-m", "slamduel"]
ONCE = ["--repeats", "1", "--quiet"]  # each further round starts processes


def bench(*words: str | Path, **changes: str) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, **changes}
    return subprocess.run([*BENCH, *map(str, words)], capture_output=True, text=True, env=env, check=False)


MISSING = ["module://not_installed.backend_inline", "no_such_backend"]


@pytest.mark.parametrize("backend", MISSING)
def test_a_backend_of_matplotlib_that_is_not_here_does_not_matter_to_a_picture(
    tmp_path: Path, log_folder: Path, backend: str
) -> None:
    done = bench("show", log_folder, "--out", tmp_path / "log.png", "--quiet", MPLBACKEND=backend)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "log.png").stat().st_size > 1000


@pytest.mark.parametrize("backend", first_quick(MISSING))
def test_nor_does_it_to_a_report(tmp_path: Path, log_folder: Path, backend: str) -> None:
    out = tmp_path / "run"
    done = bench("run", "--dataset", log_folder, "--backend", "ekf", *ONCE, "--out", out, MPLBACKEND=backend)
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
    words = ["run", "--dataset", log_folder, "--backend", "ekf,smoother", *ONCE, "--out", out]
    done = bench(*words, NUMBA_DISABLE_JIT="1")
    assert (done.returncode, done.stderr) == (0, "")
    assert bench("list", NUMBA_DISABLE_JIT="1").returncode == 0


def test_no_width_loses_anything(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def listed(columns: str) -> str:
        monkeypatch.setenv("COLUMNS", columns)
        assert main(["list"]) == 0
        return capsys.readouterr().out

    whole = listed(str(FULL))
    for columns in ("0", "1", "12", "39"):
        assert listed(columns) == whole, columns
    assert "  dead-reckoning" in whole


@pytest.mark.usefixtures("no_report")
@pytest.mark.parametrize(("columns", "real"), [("0", 100), ("0", 0), ("", 12), ("", LEAST - 1), ("12", 12)])
def test_a_narrow_terminal_has_the_whole_table(
    log_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, columns: str, real: int
) -> None:
    """On a pseudo-terminal, which is what `isatty` and the width are asked of."""
    mine, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, real, 0, 0))
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setenv("TERM", "xterm")
    said = list[bytes]()
    reader = threading.Thread(target=lambda: said.extend(iter(lambda: _read(mine), b"")))
    reader.start()
    words = ["--dataset", str(log_folder), "--backend", "dead-reckoning,ekf", "--out", str(tmp_path / "r")]
    try:
        with open(theirs, "w", encoding="utf-8") as screen, monkeypatch.context() as patch:
            patch.setattr(sys, "stdout", screen)
            assert main(["run", *words]) == 0
    finally:
        reader.join()
        os.close(mine)
    text = b"".join(said).decode()
    for word in ("dead-reckoning", "ekf", "ATE"):
        assert word in text, text
    assert FULL > LEAST


def _read(end: int) -> bytes:
    try:
        return os.read(end, 65536)
    except OSError:  # the other end is closed
        return b""
