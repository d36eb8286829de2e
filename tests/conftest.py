"""What every test gets without asking."""

import contextlib
import gc
import gzip
import os
import shutil
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

settings.register_profile("untimed", deadline=None)  # no test depends on how fast a machine is
settings.load_profile("untimed")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leaves modules of slow tests alone unread where those are left out: clusters and browsers import much."""
    if config.option.markexpr == "not slow" and collection_path.suffix == ".py":
        return "\npytestmark = pytest.mark.slow\n" in collection_path.read_text(encoding="utf-8") or None
    return None


@pytest.fixture(autouse=True, scope="module")
def short_collections() -> None:
    """Garbage is not looked for in all that was there before: each cell of a test collects garbage several times."""
    gc.freeze()


@pytest.fixture(autouse=True, scope="session")
def interruptible() -> None:
    """A shell lets what it starts in the background ignore Ctrl-C, which some tests are about."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True, scope="session")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep prepared logs in a folder of the tests' own, which a whole session shares; the user's cache is untouched.

    Logs at hand are there by name, as if they had been fetched.
    """
    patch = pytest.MonkeyPatch()
    cache = tmp_path_factory.getbasetemp().parent / "cache"
    patch.setenv("SLAMDUEL_CACHE", str(cache))
    if "SLAMDUEL_DATA" in os.environ:
        at_hand, published = Path(os.environ["SLAMDUEL_DATA"]), cache / "published"
        published.mkdir(parents=True, exist_ok=True)
        if (at_hand / "victoria_park_raw").is_dir():
            with contextlib.suppress(FileExistsError):  # another worker was first
                (published / "victoria-park-raw").symlink_to((at_hand / "victoria_park_raw").resolve())
        for name, recording in (("intel-lab", "intel"), ("fr079", "fr079")):
            if (at_hand / "lidar" / f"{recording}.clf.gz").is_file():
                made = tmp_path_factory.mktemp(name)
                (made / f"{recording}.clf").write_bytes(
                    gzip.decompress((at_hand / "lidar" / f"{recording}.clf.gz").read_bytes())
                )
                shutil.copy(at_hand / "lidar" / f"{recording}.relations", made)
                with contextlib.suppress(FileExistsError):
                    (published / name).symlink_to(made)


@pytest.fixture(autouse=True, scope="session")
def lasting_workers() -> None:
    """Lets runs in this process share their workers; those in processes of their own start them, as users' runs do."""
    if {"slamduel.bench.cli", "small_run"} & set(sys.modules):
        from lasting_workers import local

        for module in ("workers.local_executor", "run.result"):
            pytest.MonkeyPatch().setattr(f"slamduel.bench.{module}.Local", local)


@pytest.fixture(autouse=True, scope="session")
def timed_once() -> None:
    """Runs time their cells once where nothing else is said: each further round starts processes."""
    if "slamduel.bench.cli" in sys.modules:
        from slamduel.bench.run.benchmark import DEFAULTS

        pytest.MonkeyPatch().setitem(DEFAULTS, "repeats", 1)


@pytest.fixture(autouse=True, scope="session")
def one_compiler() -> None:
    """Keeps every core to one compiler: where several workers test, a second process for each takes their time."""
    from slamduel.core.kernels import compile_ahead

    pytest.MonkeyPatch().setattr(compile_ahead, "kept", lambda _: True)


@pytest.fixture(autouse=True, scope="session")
def patient() -> None:
    """Lets commands here be slow without a word: what they print does not depend on how fast a machine is."""
    for name in ("console", "stages"):
        if module := sys.modules.get(f"slamduel.bench.words.{name}"):
            pytest.MonkeyPatch().setattr(module, "PATIENCE_S", 3600.0)


@pytest.fixture
def no_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """`bench run` without its pages, whose pictures are nearly all that a small run costs."""
    from pages import left_out

    left_out(monkeypatch)


@pytest.fixture(scope="session")
def log_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log on disk, which no test changes: 40 steps among 8 landmarks."""
    import numpy as np

    from random_logs import random_log
    from slamduel.datasets.formats import log_folder

    folder = tmp_path_factory.mktemp("logs") / "wander"
    log_folder.write(folder, *random_log(np.random.default_rng(1), 40, 8))
    return folder


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium, as playwright drives it."""
    from narrow_window import CHROMIUM

    why = "playwright is not installed: its package drives the browser"
    api = pytest.importorskip("playwright.sync_api", reason=why)
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    with api.sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-quic"])
