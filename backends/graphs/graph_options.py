"""Options of the batch, for both of its solvers."""

from dataclasses import dataclass

from ...core.options import option
from .. import common_options


@dataclass(frozen=True)
class Options:
    """Solver, initial values, termination, and outlier rejection."""

    solver: str = option("own", "own, or GTSAM's Levenberg-Marquardt as a check", choices=("own", "gtsam"))
    start: str = option(
        "incremental",
        "initial values: smoothed chunk by chunk, or dead reckoning, which is far off where odometry is poor",
        choices=("incremental", "odometry"),
    )
    relative_tolerance: float = option(1e-13, "stop where J falls by a smaller share in one iteration", minimum=0)
    iterations: int = option(1000, "most iterations", minimum=1)
    loss: str = common_options.loss("sightings and loops")
    loss_scale: float = common_options.loss_scale()
    joint_up_to: int = common_options.joint_up_to()
    gnc: bool = option(
        False, "reject sightings and loops by graduated non-convexity; loss then applies to the start only"
    )
