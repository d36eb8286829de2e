"""What every test gets without asking."""

import fcntl
import gc
import hashlib
import os
import signal
from collections.abc import Generator
from typing import Any

import pytest

from places import ROOT

HERE = f"{ROOT}{os.sep}"


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
    """Keep prepared logs in a folder of the tests' own, which a whole session shares; the user's cache is untouched."""
    patch = pytest.MonkeyPatch()
    patch.setenv("SLAMDUEL_CACHE", str(tmp_path_factory.getbasetemp().parent / "cache"))


@pytest.fixture(autouse=True, scope="session")
def compiled_once(tmp_path_factory: pytest.TempPathFactory) -> Generator[None]:
    """Where another worker is compiling one of our kernels, wait for it and load what it has made from numba's cache.

    A lock a kernel: it is compiled while those that call it are, but calls go one way only, so none waits in a circle.
    """
    from numba.core.dispatcher import Dispatcher  # not where the controller of the workers would import it, too

    folder = tmp_path_factory.getbasetemp().parent / "compiling"
    folder.mkdir(exist_ok=True)
    compile_ = Dispatcher.compile

    def in_turn(self: Any, signature: Any) -> Any:
        code = self.py_func.__code__
        if not code.co_filename.startswith(HERE):
            return compile_(self, signature)
        name = hashlib.sha256(f"{code.co_filename} {code.co_qualname}".encode()).hexdigest()
        with (folder / name).open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            return compile_(self, signature)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Dispatcher, "compile", in_turn)
        yield


@pytest.fixture
def no_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """`bench run` without its pages, whose pictures are nearly all that a small run costs."""
    from slamduel.bench.run import benchmark

    monkeypatch.setattr(benchmark, "write_report", lambda store: None)
