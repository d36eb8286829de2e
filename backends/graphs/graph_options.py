"""Options of the batch, for both of its solvers."""

from dataclasses import dataclass

from ...core.options import option
from .. import common_options


@dataclass(frozen=True)
class Options:
    """Solver, initial values, termination, and outlier rejection."""

    solver: str = option("own", "this package's, or GTSAM's as a check", choices=("own", "gtsam"))
    start: str = option(
        "auto",
        "initial values: headings by motions and loops together; dead reckoning, far off where odometry is poor; "
        "smoothed chunk by chunk (incremental); auto: a cheap one if its fit is to be trusted, else the lowest J",
        choices=("auto", "headings", "odometry", "incremental"),
    )
    relative_tolerance: float = option(1e-13, "stop where J falls by a smaller share in one iteration", minimum=0)
    iterations: int = option(1000, "most iterations", minimum=1)
    loss: str = common_options.loss("sightings and loops")
    loss_scale: float = common_options.loss_scale()
    joint_up_to: int = common_options.joint_up_to()
    algorithm: str = option(
        "levenberg-marquardt",
        "of solver=gtsam: GTSAM's optimizer",
        choices=("levenberg-marquardt", "gauss-newton", "dogleg"),
    )
    linear: str = option(
        "multifrontal-cholesky",
        "of solver=gtsam: GTSAM's solver of linear systems; multifrontal-solver reuses its symbolic part",
        choices=("multifrontal-cholesky", "multifrontal-qr", "multifrontal-solver"),
    )
    gyro: str = common_options.gyro()
    gnc: bool = option(
        False, "reject sightings and loops by graduated non-convexity; loss then applies to the start only"
    )
