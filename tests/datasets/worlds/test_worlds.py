"""Every simulated world at the ends of its options: whatever may be asked for makes a log that can be used."""

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from slamduel.bench.plan.spec import read_options
from slamduel.core.factors.check import problems
from slamduel.datasets import registry
from slamduel.datasets.worlds.faults import Faults
from tiers import first_quick

SMALL = {
    "aruco-robot": {"seconds": "10"},
    "bailey": {"loops": "1"},
    "circle": {"steps": "60"},
    "city": {"steps": "60", "landmarks": "60"},
    "matlab-report": {},
    "patrol": {"steps": "60"},
}
LONG = {"clutter", "landmarks", "loops", "markers", "seconds", "steps", "tags"}
"""Options whose greatest value makes a log that takes long."""

RING = {"nearest", "farthest"}
"""Options of the circle that go together."""

WORST = {
    "sensor_scale": "1000",
    "odometry_scale": "1000",
    "tails": "2.1",
    "slip": "5",
    "wrong_ids": "0.5",
    "clutter": "1",
    "jitter": "60",
    "moving": "0.5",
    "moving_speed": "50",
}


def ends(world: str) -> Iterator[dict[str, str]]:
    """The world's own options, each at its ends and all others as they are, and then its faults."""
    for field in fields(registry.find(world).options):
        if world == "circle" and field.name in RING:
            continue  # the one has to be less than the other
        inherited = field.name in {one.name for one in fields(Faults)}
        if world == "circle" or not inherited:  # faults are the same for all
            for end in ("minimum", "maximum"):
                value = field.metadata[end]
                if value is not None and not (end == "maximum" and field.name in LONG):
                    yield {field.name: str(value)}
    if world == "circle":
        yield {"nearest": "0", "farthest": "0.01"}
        yield {"nearest": "999", "farthest": "1000"}
    yield WORST
    yield WORST | {"missing": "1"}


def made(world: str, given: dict[str, str]) -> Any:
    source = registry.find(world)
    options = read_options(source.options, list((SMALL[world] | given).items()), world)
    return source.make(options, np.random.default_rng(1))


@pytest.mark.parametrize("world", [*SMALL, "aruco-room", "linear"])
def test_a_world_is_registered_under_its_name(world: str) -> None:
    source = registry.find(world)
    assert source.make.__name__ == world.replace("-", "_")
    assert source.seeded
    assert source.costly == (world == "aruco-room")
    assert source.summary


@pytest.mark.parametrize("world", first_quick(SMALL, 2))
def test_the_ends_of_every_option_make_a_good_log(world: str) -> None:
    for given in ends(world):
        log, truth = made(world, given)
        assert list(problems(log)) == [], given
        assert len(truth.t) == len(log)


@pytest.mark.parametrize("faults", [{}, WORST], ids=["clean", "spoilt"])
def test_a_drive_may_be_over_at_its_first_frame(faults: dict[str, str]) -> None:
    log, truth = made("aruco-robot", {"seconds": "1", "frame_rate": "0.5"} | faults)
    assert len(log) == len(truth.t) == 1
    assert list(problems(log)) == []
