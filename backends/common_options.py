"""Options that several backends have."""

from typing import Any

from ..core.options import option

LOSSES = {"none": 0.0, "huber": 1.345, "cauchy": 2.3849, "geman-mcclure": 3.7874}
"""Robust losses, in the order of their numbers in `smoothing/_factors`, and their scales in standard deviations.

With Gaussian errors of one dimension, an estimate by a loss of that scale has 1 / 0.95 times the variance of least
squares: it is 95 % efficient (Z. Zhang, Image and Vision Computing 15(1), 1997). More errors of a sighting or a loop
closure, of two and three dimensions, are beyond the scale; docs/backends.md has their efficiencies.
"""


def relinearize_threshold() -> Any:
    """The change of a variable that is relinearized."""
    return option(0.03, "change (m, rad) of a variable above which it is relinearized", minimum=0)


def joint_up_to() -> Any:
    """The size of a map with joint covariance."""
    return option(5000, "most landmarks of a map with joint covariance, which is expensive", minimum=0)


def loss(of: str) -> Any:
    """The robust loss of some factors."""
    return option("none", f"robust loss of {of}", choices=tuple(LOSSES))


def without_loss(options: Any) -> bool:
    """True without a robust loss."""
    return options.loss == "none"


def loss_scale() -> Any:
    """The scale of that loss."""
    return option(
        0.0, "scale of the loss, standard deviations; 0: 95 % efficient for an error of one dimension", minimum=0
    )


def gate() -> Any:
    """A filter's gate."""
    return option(
        0.0, "gate: reject innovations beyond this chi-square probability; 0: no gate", minimum=0, maximum=0.999999999
    )


def gate_after() -> Any:
    """The sightings that a filter's gate waits for."""
    return option(3, "with a gate: sightings that must agree with a landmark before others are rejected", minimum=0)


STATE, FRONT, IGNORED = "state", "front", "ignored"
"""What becomes of a gyro's bias."""


def gyro() -> Any:
    """The treatment of a gyro's bias by a backend that can estimate it."""
    return option(
        STATE,
        "bias of a gyro: in the state; estimated in front where the robot stands, its turns fused with the odometry; "
        "or ignored: fused as if there were none",
        choices=(STATE, FRONT, IGNORED),
    )
