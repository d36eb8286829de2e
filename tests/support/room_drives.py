"""More than a lap through the rendered room, at a low frame rate: rendered once per test session."""

from slamduel.core.factors import Dataset, Truth
from slamduel.datasets import registry
from slamduel.datasets.on_demand.ready import made_ready
from slamduel.datasets.worlds.aruco_room import Options

DRIVE = Options(seconds=45.0, frame_rate=1.0)


def room_drive(seed: int) -> tuple[Dataset, Truth]:
    """The drive of `seed`, cached across tests, and its ground truth."""
    made = made_ready("aruco-room", registry.find("aruco-room"), DRIVE, seed)
    assert made.truth is not None
    return made, made.truth
