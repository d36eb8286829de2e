"""What every test gets without asking."""

import gc
import signal

import pytest


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


@pytest.fixture
def no_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """`bench run` without its pages, whose pictures are nearly all that a small run costs."""
    from slamduel.bench.run import benchmark

    monkeypatch.setattr(benchmark, "write_report", lambda store: None)
