"""Fits the noise models to a recording with ground truth, and checks the stated noise by range."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array
from ...frontend.markers.noise import PropagatedNoise, ProportionalNoise, rocking
from ...frontend.markers.noise_fit import Propagated, Slope, fit_propagated, fit_slope, squares
from .sightings import Sightings, TrueErrors, in_log

CORNERS = PropagatedNoise(scale=1.0, floor_range=0.0, floor_bearing=0.0, sway=0.0)
"""the covariance from the corners alone, at the scale 1"""

CONSISTENT = (0.8, 1.2)  # NEES of (range, bearing), over its two degrees of freedom, that counts as consistent


class RangeBin(NamedTuple):
    """The errors of the sightings in the log from `low` to `high`, m."""

    low: float
    high: float
    sightings: int
    range_mean: float  # m
    range_sd: float  # m, about the mean
    bearing_mean: float  # rad
    bearing_sd: float  # rad
    nees: Sequence[float]  # over its two degrees of freedom, by each noise, as stated first


class Calibration(NamedTuple):
    """Both models, fitted."""

    sightings: int
    range: Slope
    bearing: Slope
    corners: Propagated
    corner_sd: float  # px, of a corner, root mean square, as fitted
    proportional: ProportionalNoise
    propagated: PropagatedNoise
    likelier: str  # the model with the higher likelihood
    bins: list[RangeBin]  # of the sightings that neither fit set aside; nees: stated, proportional, propagated


def range_bins(ranges: Array, most: int = 10) -> Array:
    """Returns edges (k + 1,) of at most `most` bins of round width from 0 to beyond the farthest of `ranges`."""
    top = float(ranges.max()) if len(ranges) else 1.0
    width = next(w for w in (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, np.inf) if top / w < most)
    width = width if np.isfinite(width) else top / (most - 1)
    return np.arange(int(top / width) + 2.0) * width


def errors_by_range(sightings: Sightings, true: TrueErrors) -> list[RangeBin]:
    """Tabulates the errors of the sightings in the log, and their NEES as stated."""
    seen, errors = known_in_log(sightings, true)
    return range_table(seen.z, errors, [seen.cov], range_bins(seen.z[:, 0]))


def known_in_log(sightings: Sightings, true: TrueErrors) -> tuple[Sightings, Array]:
    """Returns the m sightings in the log with known errors, and these, (m, 2)."""
    both = sightings._replace(kept=sightings.kept & true.known)
    return in_log(both), true.errors[sightings.kept[true.known]]


def calibrate(sightings: Sightings, true: TrueErrors) -> Calibration:
    """Fits both models to the sightings in the log; InputError for too few."""
    edges = range_bins(sightings.z[sightings.kept, 0])
    seen, errors = known_in_log(sightings, true)
    by_range, by_bearing = (fit_slope(seen.z[:, axis], errors[:, axis]) for axis in (0, 1))
    places = np.column_stack((seen.z[:, 0], seen.height))
    corners = fit_propagated(errors, seen.corner_noise, places)
    proportional = ProportionalNoise(by_range.k, by_bearing.k, by_range.floor, by_bearing.floor)
    propagated = PropagatedNoise(corners.scale, *corners.floors.tolist(), sway=corners.sway)
    used = by_range.used & by_bearing.used & corners.used
    fixed = np.diag([propagated.floor_range**2, propagated.floor_bearing**2])
    by_corners = propagated.scale**2 * seen.corner_noise + fixed + rocking(propagated.sway, *places.T)
    covs = (seen.cov, proportional.cov(seen.z), by_corners)
    costs = [(squares(errors, cov) + np.linalg.slogdet(cov)[1])[used].mean() for cov in covs[1:]]
    return Calibration(
        sightings=len(errors),
        range=by_range,
        bearing=by_bearing,
        corners=corners,
        corner_sd=corners.scale * float(np.sqrt(np.mean(seen.corner_sd**2))),
        proportional=proportional,
        propagated=propagated,
        likelier="proportional" if costs[0] <= costs[1] else "propagated",
        bins=range_table(seen.z[used], errors[used], [cov[used] for cov in covs], edges),
    )


def range_table(z: Array, errors: Array, covs: Sequence[Array], edges: Array) -> list[RangeBin]:
    """Tabulates errors (n, 2) of measurements z (n, 2), non-empty bins of range `edges` (k + 1,), NEES by `covs`."""
    place = np.digitize(z[:, 0], edges) - 1
    normalised = [squares(errors, cov) / 2 for cov in covs]
    return [
        RangeBin(
            float(edges[k]),
            float(edges[k + 1]),
            int(mine.sum()),
            *(float(value) for e in errors[mine].T for value in (e.mean(), e.std())),
            nees=[float(one[mine].mean()) for one in normalised],
        )
        for k in range(len(edges) - 1)
        if (mine := place == k).any()
    ]


def toml(calibration: Calibration) -> str:
    """Writes the [noise] of a robot.toml: the likelier model, the other commented out beside it."""
    c = calibration
    sections = {
        "proportional": (
            ("k_range", c.range.k, c.range.k_error, "of the range"),
            ("k_bearing", c.bearing.k, c.bearing.k_error, "of the bearing"),
            ("floor_range", c.range.floor, c.range.floor_error, "m"),
            ("floor_bearing", c.bearing.floor, c.bearing.floor_error, "rad"),
        ),
        "propagated": (
            ("scale", c.corners.scale, c.corners.scale_error, f"with it a corner has {c.corner_sd:.3f} px"),
            ("floor_range", c.corners.floors[0], c.corners.floor_errors[0], "m"),
            ("floor_bearing", c.corners.floors[1], c.corners.floor_errors[1], "rad"),
            ("sway", c.corners.sway, c.corners.sway_error, "rad"),
        ),
    }
    lines = [f"# Fitted to {c.sightings} sightings with truth; the {c.likelier} model explains them better.", "[noise]"]
    for model in sorted(sections, key=lambda name: name != c.likelier):
        mark = "" if model == c.likelier else "# "
        lines.append(f'{mark}model = "{model}"')
        for name, value, error, unit in sections[model]:
            lines.append(f"{mark}{name} = {value:.4g}  # {unit}, +- {error:.1g}")
    return "\n".join(lines) + "\n"
