"""Beliefs before the first measurement: of the pose at step 0, of a map, and of errors that stay."""

from typing import Literal, NamedTuple, get_args

from ..arrays import frozen, frozen_ids
from ..gyro import Bias
from ..se2 import Array
from .landmarks import Map

Start = Literal["known", "unknown"]
STARTS: tuple[Start, ...] = get_args(Start)


class Systematic(NamedTuple):
    """Beliefs about a sensor's constant errors: standard deviations around none, 0 where there is none.

    A partial sighting's range is (1 + scale) d + offset at a distance d; a fix's heading is heading + offset. Odometry
    has (1 + wheel_scale) of the way.
    """

    range_scale: float = 0.0
    range_offset: float = 0.0  # m
    heading_offset: float = 0.0  # rad
    each: bool = False  # every landmark has a scale and an offset of its own
    wheel_scale: float = 0.0


class Prior(NamedTuple):
    """The belief at step 0. With a map the task is localisation; a map without covariance is held fixed.

    An unknown start says that the robot may be anywhere on the map: pose and cov are then placeholders. `loops`,
    `partial`, `fixes`, `signatures` and `gyro` are set by the log: a filter has to keep earlier poses where loop
    closures may come back to them, or until a landmark is placed, and there alone.
    """

    pose: Array  # (3,)
    cov: Array  # (3, 3) in the world frame, positive definite
    map: Map | None = None
    start: Start = "known"
    loops: bool = False  # the log has loop closures
    systematic: Systematic = Systematic()
    partial: bool = False  # it has partial sightings
    fixes: bool = False  # it has fixes
    signatures: bool = False  # its whole sightings have signatures
    gyro: Bias | None = None  # of the gyro that it has


def frozen_prior(prior: Prior) -> Prior:
    """A copy whose arrays are read-only."""
    known = prior.map
    if known is not None:
        known = Map(frozen_ids(known.ids), frozen(known.xy), None if known.cov is None else frozen(known.cov))
    return prior._replace(pose=frozen(prior.pose), cov=frozen(prior.cov), map=known)
