"""MRPT's EKF behind the backend's interface: the textbook's filter, where MRPT is installed."""

from pathlib import Path

import numpy as np
import pytest

from driven import run
from random_logs import random_log
from slamduel.backends.api import Unsuited
from slamduel.backends.programs import mrpt_ekf
from slamduel.backends.programs.textbook_ekf import TextbookEkf
from slamduel.core.factors import Dataset, Log, Map

installed = pytest.mark.skipif(bool(mrpt_ekf.lacking()), reason=mrpt_ekf.lacking() or "installed")

SINGLE = 2.0**-24
"""Ranges and bearings are read in single precision: their relative rounding error."""


@pytest.fixture(scope="module")
def drive() -> Dataset:
    return random_log(np.random.default_rng(4), 120, 15, noise=0.5)


@installed
@pytest.mark.parametrize("given", [False, True])
def test_it_is_the_textbook_filter_but_for_single_precision(given: bool, drive: Dataset) -> None:
    """Every sighting here has another covariance, so that they are taken one by one.

    A rounding error of a range of 5 m is a 1e-5 th of its deviation of 2 cm.
    """
    log = drive.log
    if given:
        assert drive.truth is not None
        assert drive.truth.map is not None
        known = drive.truth.map
        prior = log.prior._replace(map=Map(known.ids, known.xy, 1e-4 * np.eye(2 * len(known.ids))))
        log = Log.from_steps("given", prior, list(log))
    textbook = TextbookEkf(log.prior)
    expected = np.array([textbook.step(step) for step in log])
    backend, path = run("mrpt-ekf", log)
    off = 1e3 * 5.0 * SINGLE
    assert np.abs(path - expected).max() < off
    assert backend.belief().cov == pytest.approx(textbook.belief().cov, rel=1e-3, abs=1e-9)
    assert backend.map().ids.tolist() == textbook.ids
    assert np.abs(backend.map().xy - textbook.map().xy).max() < off
    assert backend.map().cov == pytest.approx(textbook.map().cov, rel=1e-2, abs=1e-7)


@installed
def test_the_cheaper_method_is_near() -> None:
    """It takes the bearing's innovation from before the range's correction."""
    log = random_log(np.random.default_rng(5), 120, 15, noise=0.2).log
    _, naive = run("mrpt-ekf", log)
    _, davison = run("mrpt-ekf", log, method="davison")
    assert 1e-6 < np.abs(naive - davison).max() < 0.05


def test_without_compiler_or_library_it_says_what_installs_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert "apt-get install cmake g++ libmrpt-slam-dev" in mrpt_ekf.lacking()
    for name in ("cmake", "c++"):
        (tmp_path / name).write_text("#!/bin/sh\necho no such package >&2\nexit 1\n")
        (tmp_path / name).chmod(0o700)
    monkeypatch.delenv("CXX", raising=False)
    place = tmp_path / "lib" / mrpt_ekf.PACKAGE
    place.parent.mkdir(parents=True)
    place.write_text("")
    monkeypatch.setenv("CMAKE_PREFIX_PATH", str(tmp_path))
    assert mrpt_ekf.lacking() == ""
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path / "cache"))
    with pytest.raises(Unsuited, match="cannot be compiled: no such package"):
        mrpt_ekf.library.__wrapped__()
    assert list((tmp_path / "cache" / "programs").iterdir()) == []


def test_mrpts_report_is_cut_to_what_happened() -> None:
    report = "==== MRPT exception ====\nFile: a.h:3\nMessage: no map\nCall stack\n"
    assert mrpt_ekf._message(report) == "Message: no map"  # pyright: ignore[reportPrivateUsage]
    assert mrpt_ekf._message("") == "it says nothing"  # pyright: ignore[reportPrivateUsage]
