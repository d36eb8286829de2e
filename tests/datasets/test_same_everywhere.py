"""The digest of every log that is simulated or read is the same whatever the processor."""

import itertools
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import pytest

import older_machine
import own_world
from places import SUPPORT
from slamduel.core.factors import Dataset
from slamduel.datasets import cache as datasets
from slamduel.datasets import registry
from slamduel.datasets.redrawn import redrawn
from slamduel.datasets.truth import digest
from tiers import first_quick

DATA = os.environ.get("SLAMDUEL_DATA")
WORLDS = ("aruco-robot", "bailey", "circle", "city", "linear", "matlab-report", "patrol")
FAULTS = {
    "sensor_scale": 1.5, "odometry_scale": 1.3, "tails": 4.0, "slip": 0.3, "missing": 0.1, "gap": 0.1,
    "wrong_ids": 0.05, "clutter": 0.3, "jitter": 0.05, "moving": 0.3, "motion": "stop-and-go", "kidnap": 5.0,
    "correlated": 0.5, "stated": "thinned",
}  # fmt: skip
PATROL = {"loops": 7, "furniture": 0.3, "day": 2, "people": 3, "people_ids": "meeting", "clutter": 0.1}
"""What a patrol does not have by default, and not beside all faults."""


def made(name: str, seed: int = 0, **options: Any) -> Dataset:
    source = registry.find(name)
    return source.make(source.options(**options), datasets.generator(name, seed))


def drawn(name: str, seed: int, **options: Any) -> Dataset:
    return redrawn(made(name, **options), datasets.generator(f"noise of {name}", seed))


def logs(whole: bool) -> dict[str, Callable[[], Dataset]]:
    """Every world, as it is by default and with all faults, and every published log that is there.

    If not `whole`, one log of each world alone.
    """
    found: dict[str, Callable[[], Dataset]] = {}
    if not whole:
        return {f"{name} with faults": partial(made, name, 3, **FAULTS) for name in WORLDS}
    found["world"] = partial(made, "world", 1, **own_world.written(Path(tempfile.mkdtemp())))
    for name in WORLDS:
        found |= {f"{name} {seed}": partial(made, name, seed) for seed in (0, 1)}
        found[f"{name} with faults"] = partial(made, name, 3, **FAULTS)
    found["patrol of days"] = partial(made, "patrol", 1, **PATROL)
    found["victoria-park"] = partial(made, "victoria-park")
    found["w20000 drawn"] = partial(drawn, "w20000", 1, noise="true")
    if DATA is not None:
        for name, file in (("manhattan", "manhattanOlson3500"), ("city-trees10000", "cityTrees10000")):
            path = f"{DATA}/posegraphs/{file}.txt.gz"
            found |= {name: partial(made, name, path=path), f"{name} drawn": partial(drawn, name, 1, path=path)}
        found["dlr"] = partial(made, "dlr", path=f"{DATA}/dlr/map.circles")
        for motion in ("turns", "course"):
            found[f"freiburg {motion}"] = partial(made, "freiburg", path=f"{DATA}/freiburg", motion=motion)
        found["victoria-park-raw"] = partial(made, "victoria-park-raw", path=f"{DATA}/victoria_park_raw")
        for robot in range(1, 6):
            found[f"mrclam {robot}"] = partial(made, "mrclam", path=f"{DATA}/mrclam/MRCLAM_Dataset6", robot=robot)
    return found


@cache
def digests(whole: bool) -> list[str]:
    """One line per log: its name, the digest of its factors and that of its truth."""
    said = list[str]()
    for name, make in logs(whole).items():
        log, truth = make()
        said.append(f"{name}: {log.digest} {'none' if truth is None else digest(truth)}")
    return said


@pytest.mark.parametrize(("kind", "whole"), first_quick(itertools.product(older_machine.KINDS, (0, 1))))
def test_the_digests_are_those_of_an_older_machine(kind: str, whole: int) -> None:
    done = subprocess.run(
        [sys.executable, __file__, str(whole)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)} | older_machine.environment(kind),
        cwd=SUPPORT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.splitlines() == digests(bool(whole))


@pytest.mark.skipif(len(older_machine.KINDS) < 2, reason="this machine cannot stand in for two kinds of older ones")
def test_an_older_machine_does_compute_in_another_way() -> None:
    """Else the test above shows nothing: a large product has other last bits with other kernels."""
    code = "import numpy as np; a = np.sqrt(np.arange(1.0, 90001.0)).reshape(300, 300); print((a @ a).tobytes())"
    said = set[bytes]()
    for kind in older_machine.KINDS:
        env = os.environ | older_machine.environment(kind)
        said.add(subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, check=True).stdout)
    assert len(said) == len(older_machine.KINDS)


def test_every_source_that_draws_is_looked_at() -> None:
    simulated = {name for name in registry.BUILTIN if registry.find(name).seeded and not registry.find(name).costly}
    assert simulated == {*WORLDS, "world"}


if __name__ == "__main__":
    print(*digests(sys.argv[1] == "1"), sep="\n")
