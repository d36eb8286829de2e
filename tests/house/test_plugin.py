"""The example plug-in: found once it is installed, held to the same checks as everybody, and right."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from places import SUPPORT
from random_logs import random_log
from slamduel.backends import registry
from slamduel.backends.api import Builder
from slamduel.backends.programs.textbook_ekf import TextbookEkf
from slamduel.bench.check.suite import check
from slamduel.core.factors import Log
from slamduel.core.se2 import Array, between

EXAMPLE = SUPPORT / "example_plugin"

LOOK = """
import json
from importlib.metadata import entry_points
from slamduel.backends import registry
from slamduel.bench.check.suite import check
(point,) = entry_points(group="slamduel.backends", name="iterated-ekf")
builder = registry.find("iterated-ekf")
module = __import__(builder.make.__module__)
same = registry.find("slamduel_iterated_ekf:build") is builder
failed = [list(found) for found in check(builder) if found.status == "failed"]
whose = registry.implementation("iterated-ekf", builder.options())
print(json.dumps({"value": point.value, "same": same, "file": module.__file__, "failed": failed, "whose": whose}))
"""


@pytest.fixture
def builder(monkeypatch: pytest.MonkeyPatch) -> Builder:
    monkeypatch.syspath_prepend(EXAMPLE)
    return registry.find("slamduel_iterated_ekf:build")


def path(builder: Builder, log: Log, iterations: int) -> Array:
    backend = builder.make(log.prior, builder.options(iterations), np.random.default_rng(0))
    return np.array([backend.step(step) for step in log])


@pytest.mark.slow
def test_once_installed_it_is_found_by_name_and_conforms(tmp_path: Path) -> None:
    if subprocess.run([sys.executable, "-m", "pip", "--version"], capture_output=True, check=False).returncode:
        pytest.skip("this Python has no pip to install the plug-in with")
    source, site = tmp_path / "source", tmp_path / "site"
    shutil.copytree(EXAMPLE, source, ignore=shutil.ignore_patterns("__pycache__"))  # a build writes beside its source
    install = ["install", "--quiet", "--no-index", "--no-deps", "--no-build-isolation", "--target", site, source]
    quiet = os.environ | {"PIP_DISABLE_PIP_VERSION_CHECK": "1", "PIP_ROOT_USER_ACTION": "ignore"}
    subprocess.run([sys.executable, "-m", "pip", *install], env=quiet, cwd=tmp_path, check=True)
    env = os.environ | {"PYTHONPATH": str(site)}
    look = [sys.executable, "-c", LOOK]
    done = subprocess.run(look, env=env, cwd=tmp_path, check=True, capture_output=True, text=True)
    seen = json.loads(done.stdout)
    assert seen["value"] == "slamduel_iterated_ekf:build"
    assert seen["same"]
    assert Path(seen["file"]).parent == site
    assert seen["failed"] == []
    assert seen["whose"] == "from slamduel-iterated-ekf"


def test_it_conforms_with_other_options(builder: Builder) -> None:
    outcomes = check(builder, builder.options(iterations=1))
    assert [found for found in outcomes if found.status == "failed"] == []


def test_with_one_iteration_it_is_the_textbook_filter(builder: Builder) -> None:
    log, _ = random_log(np.random.default_rng(1), 80, 12)
    ekf = TextbookEkf(log.prior)
    expected = np.array([ekf.step(step) for step in log])
    np.testing.assert_allclose(between(path(builder, log, 1), expected), 0, atol=1e-10)
    assert np.abs(between(path(builder, log, 3), expected)).max() > 1e-5


def test_iterating_ends_where_the_posterior_is_flat(builder: Builder) -> None:
    """The gradient of (x - x0)' P^-1 (x - x0) + (z - h(x))' R^-1 (z - h(x)), by differences, is zero at the end."""
    log, _ = random_log(np.random.default_rng(2), 30, 6, noise=3.0)
    k = int(np.flatnonzero(np.diff(log.sighting_first) > 0)[-1])
    ekf = TextbookEkf(log.prior)
    for step in log.head(k):
        ekf.step(step)
    step = log[k]
    assert step.odometry is not None
    ekf.predict(step.odometry)
    landmark, z, R = step.sightings.ids[0], step.sightings.z[0], step.sightings.cov[0]
    before, P = ekf.mean.copy(), ekf.cov.copy()

    def cost(x: Array) -> float:
        ekf.mean = x
        gap = z - ekf.predict_sighting(int(landmark))[0]
        gap[1] = (gap[1] + np.pi) % (2 * np.pi) - np.pi
        return float((x - before) @ np.linalg.solve(P, x - before) + gap @ np.linalg.solve(R, gap))

    def slope(x: Array) -> float:
        return max(abs(cost(x + e) - cost(x - e)) / 2e-6 for e in 1e-6 * np.eye(len(x)))

    def updated(iterations: int) -> Array:
        iterated = builder.make(log.prior, builder.options(iterations), np.random.default_rng(0))
        iterated.mean, iterated.cov, iterated.ids = before.copy(), P.copy(), list(ekf.ids)  # pyright: ignore
        iterated.update(3 + 2 * ekf.ids.index(landmark), z, R)  # pyright: ignore
        return iterated.mean  # pyright: ignore

    assert slope(updated(20)) < 1e-5 * slope(before)
    assert slope(updated(20)) < 1e-3 * slope(updated(1))
