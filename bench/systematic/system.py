"""The equations of a log around a path, a map and systematic errors: residuals over their standard deviations."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from ...backends.models import innovation, sight
from ...core.factors import Log, Map
from ...core.mounting import before
from ...core.se2 import Array, Ints, between, compose, compose_jacobians, inverse, wrap
from ...core.truth.errors import rows_of
from ...datasets.noise.clock import motions_after
from ...datasets.noise.systematic import NAMES, SENSOR, Systematic, measured_motions, measured_sightings, true_motions
from .windows import windows

ABOUT, STEPS = 0.3, 3
"""s, and steps at least, before and after a sighting, between which odometry tells how fast the body is: noise of the
step of the sighting itself is in what is measured, too."""

NEAR = 0.1
"""s, and steps at least, before and after the ends of a motion, between which a known path tells how fast they change
with its clock."""

PLACED = 0.01
"""m, standard deviation of the known place of a landmark."""

UNEVEN = 0.05
"""Standard deviation of the share by which turns are off, from window to window: wheels slip now more, now less."""

JITTER = 0.02
"""s, standard deviation of the time of a sighting: what turns fast is seen the worse."""

WHEELS = NAMES[len(SENSOR) : -1]
"""The wheels' errors without their lag."""

STEP = 1e-5
"""Of the differences that derivatives by systematic errors are made of, in their units."""

FAR, JUMP = 3.5, 10.0
"""Standard deviations beyond which a sighting, and a motion along a known path, lose weight.

Errors of sightings beyond are more often mistakes; motions have more of what is not modelled, and paths jump."""

MEDIANS = {2: 1.1774, 3: 1.5382}
"""Root of the median of chi-square, by its degrees of freedom."""


@dataclass
class System:
    """A log of which all sightings have ids, and the state at which its equations are linear.

    Variables are the poses (n, 3), unless the path is known, the landmarks (m, 2) and the systematic errors. Steps that
    are not `known` have neither sightings nor motions.
    """

    log: Log
    path: Array  # (n, 3)
    landmarks: Map
    fixed: bool  # the path is known
    known: NDArray[np.bool_]  # (n,)
    places: Map | None = None  # known places of landmarks, in the frame of the path, which then starts anywhere

    def __post_init__(self) -> None:
        seen = self.known[self.log.sighting_step]
        self.seen = np.flatnonzero(seen)
        self.step = self.log.sighting_step[self.seen]
        self.of = rows_of(self.landmarks.ids, self.log.ids[self.seen])
        self.z = self.log.z[self.seen]
        self.driven = np.flatnonzero(self.known[1:] & self.known[:-1]) + 1
        cov, t = self.log.delta_cov[self.driven], self.log.t
        self._lasted = t[self.driven] - t[self.driven - 1]
        self._windows = windows(t, self.driven)
        self._motion_cov = np.add.reduceat(cov, self._windows) if self.fixed else self._uneven(cov)
        self._motion_root = _whitening(self._motion_cov)
        z_cov = self.log.z_cov[self.seen].copy()
        z_cov[:, 1, 1] += (JITTER * self._odometry_speeds(self.log.delta)[:, 2]) ** 2
        self._root = _whitening(z_cov)
        self.xy = self.landmarks.xy.copy()

    @property
    def poses(self) -> int:
        """Number of variables of the path."""
        return 0 if self.fixed else 3 * len(self.path)

    def linearised(self, errors: Systematic, *, evenly: bool = False) -> tuple[Array, csr_matrix, Ints]:
        """Residuals (r,), their Jacobian by poses, landmarks and errors, and the step (r,) that each belongs to.

        A motion belongs to the step before it. Sightings, and motions along a known path, that fit badly have less
        weight. `evenly` takes speeds averaged over windows: their noise would make errors
        look as if they were told apart by it.
        """
        residuals, blocks, steps = list[Array](), list[tuple[Ints, Ints, Array]](), list[Ints]()
        n, end, row = self.poses, self.poses + 2 * len(self.xy), 0
        for e, first, root, at in self._priors():
            residuals.append((root @ e[..., None]).ravel())
            blocks.append(_block(row, first[:, None] + np.arange(e.shape[1]), root))
            steps.append(np.repeat(at, e.shape[1]))
            row += e.size
        e, by_before, by_after, by_errors = self._motions(errors)
        k, root = self.driven[:, None], self._motion_root
        if self.fixed:
            e, by_errors = (np.add.reduceat(one, self._windows) for one in (e, by_errors))
            k = k[self._windows]
            root = root * _weights(root, e, JUMP)[:, None, None]
        residuals.append((root @ e[..., None]).ravel())
        if not self.fixed:
            blocks.append(_block(row, 3 * (k - 1) + np.arange(3), root @ by_before))
            blocks.append(_block(row, 3 * k + np.arange(3), root @ by_after))
        wheels = end + np.arange(len(SENSOR), len(NAMES))[None]
        blocks.append(_block(row, np.broadcast_to(wheels, (len(k), wheels.shape[1])), root @ by_errors))
        steps.append(np.repeat(k[:, 0] - 1, 3))
        row += 3 * len(k)
        e, by_pose, by_place, by_errors = self._sightings(errors, evenly=evenly)
        root = self._root * _weights(self._root, e, FAR)[:, None, None]
        residuals.append((root @ e[..., None]).ravel())
        if not self.fixed:
            blocks.append(_block(row, 3 * self.step[:, None] + np.arange(3), root @ by_pose))
        blocks.append(_block(row, n + 2 * self.of[:, None] + np.arange(2), root @ by_place))
        sensor = end + np.arange(len(SENSOR))[None]
        blocks.append(_block(row, np.broadcast_to(sensor, (len(e), len(SENSOR))), root @ by_errors))
        steps.append(np.repeat(self.step, 2))
        rows, places, values = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
        r = np.concatenate(residuals)
        return r, csr_matrix((values, (rows, places)), shape=(len(r), end + len(NAMES))), np.concatenate(steps)

    def move(self, by: Array) -> None:
        """Adds a change (variables,) of poses and landmarks."""
        n = self.poses
        if n:
            self.path = self.path + by[:n].reshape(-1, 3)
            self.path[:, 2] = wrap(self.path[:, 2])
        self.xy = self.xy + by[n : n + self.xy.size].reshape(-1, 2)

    def _priors(self) -> Iterator[tuple[Array, Ints, Array, Ints]]:
        """Yields errors (k, d), their first variables (k,), roots of weights (k, d, d) and their steps (k,).

        Known places, or the start where none is known.
        """
        if self.places is not None:
            at = rows_of(self.landmarks.ids, self.places.ids)
            e, root = self.xy[at] - self.places.xy, np.broadcast_to(np.eye(2) / PLACED, (len(at), 2, 2))
            first_seen = self.step[np.unique(self.of, return_index=True)[1]]
            yield e, self.poses + 2 * at, root * _weights(root, e, FAR)[:, None, None], first_seen[at]
        elif not self.fixed:
            e = self.path[:1] - self.log.prior.pose
            e[:, 2] = wrap(e[:, 2])
            yield e, np.zeros(1, np.int64), _whitening(self.log.prior.cov[None]), np.zeros(1, np.int64)

    def _motions(self, errors: Systematic) -> tuple[Array, Array, Array, Array]:
        """Measured minus expected (d, 3), and derivatives of that by the poses before and after and wheels' errors."""
        a = self.path[self.driven - 1]
        moved, inside = self._moved(errors.lag)
        expected, J = measured_motions(moved, errors)
        e = self.log.delta[self.driven] - expected
        e[:, 2] = wrap(e[:, 2])
        c, s, zero = np.cos(a[:, 2]), np.sin(a[:, 2]), np.zeros(len(a))
        by_b = np.stack((c, s, zero, -s, c, zero, zero, zero, zero + 1), axis=-1).reshape(-1, 3, 3)
        by_a = -by_b
        by_a[:, 0, 2], by_a[:, 1, 2] = moved[:, 1], -moved[:, 0]
        slopes = [_slope(lambda at: measured_motions(moved, at)[0], errors, name) for name in WHEELS]
        slopes.append(self._by_lag(errors))
        if not inside.all():
            e = e * inside[:, None]
            slopes = [one * inside[:, None] for one in slopes]
        return e, -J @ by_a, -J @ by_b, -self._smoothed(np.stack(slopes, axis=-1))

    def _moved(self, lag: float) -> tuple[Array, NDArray[np.bool_]]:
        """(d, 3) motions of the path, of a known one `lag` s before, and where that is known, (d,)."""
        if not lag:
            return between(self.path[self.driven - 1], self.path[self.driven]), np.ones(len(self.driven), bool)
        t, known = self.log.t - lag, np.flatnonzero(self.known)
        inside = (t >= self.log.t[known[0]]) & (t <= self.log.t[known[-1]])
        last = np.clip(np.searchsorted(self.log.t[known], t, side="left"), 1, len(known) - 1)
        inside &= known[last] - known[last - 1] == 1
        columns = self.path[known].T.copy()
        columns[2] = np.unwrap(columns[2])
        then = np.stack([np.interp(t, self.log.t[known], column) for column in columns], axis=-1)
        k = self.driven
        return between(then[k - 1], then[k]), inside[k - 1] & inside[k]

    def _by_lag(self, errors: Systematic) -> Array:
        """(d, 3) derivatives of expected motions by the lag; 0 around a path that is not known, which then has it."""
        if not self.fixed:
            return np.zeros((len(self.driven), 3))
        about = max(NEAR, float(np.median(self._lasted)))
        (late, one), (early, other) = (self._moved(errors.lag + by) for by in (about, -about))
        slope = measured_motions(late, errors)[0] - measured_motions(early, errors)[0]
        slope[:, 2] = wrap(slope[:, 2])
        return slope * (one & other)[:, None] / (2 * about)

    def _sightings(self, errors: Systematic, *, evenly: bool) -> tuple[Array, Array, Array, Array]:
        """Measured minus expected (s, 2), and derivatives of that by the pose, the landmark and the sensor's errors."""
        at, places = self.path[self.step], self.xy[self.of]
        relative = self._relative(errors)
        expected, by_sensor, by_place = sight(compose(at, relative), places)
        expected, scale = measured_sightings(expected, errors)
        e = innovation(self.z.copy(), expected)
        by_pose = by_sensor @ compose_jacobians(at, relative)[0]

        now, back = compose(self._relative(errors), inverse(_place(errors))), self._speeds(errors, evenly=evenly)

        def predicted(here: Systematic) -> Array:
            then = compose(now, (errors.delay - here.delay) * back)
            return measured_sightings(sight(compose(at, compose(then, _place(here))), places)[0], here)[0]

        by_errors = np.stack([_slope(predicted, errors, name, turn=1) for name in SENSOR], axis=-1)
        return e, -scale[:, None] * by_pose, -scale[:, None] * by_place, -by_errors

    def _relative(self, errors: Systematic) -> Array:
        """(s, 3) the sensor's pose at each sighting, in the frame of the body at its step."""
        return compose(before(self.log.t, self._true_motions(errors), errors.delay)[self.step], _place(errors))

    def _true_motions(self, errors: Systematic) -> Array:
        """(n, 3) motions without the wheels' errors."""
        log, (delta, _) = self.log, true_motions(self.log.delta, errors)
        return motions_after(log.t, delta, log.delta_cov, errors.lag)[0] if errors.lag else delta

    def _uneven(self, cov: Array) -> Array:
        """Covariances (d, 3, 3) of motions whose turn is off by another share, of UNEVEN, in each window."""
        turn = np.abs(self._rates(self.log.delta[self.driven])[:, 2] * self._lasted)
        whole = np.add.reduceat(turn, self._windows)
        count = np.diff(np.append(self._windows, len(turn)))
        cov = cov.copy()
        cov[:, 2, 2] += UNEVEN**2 * turn * np.repeat(whole, count)
        return cov

    def _smoothed(self, slopes: Array) -> Array:
        """(d, 3, p) slopes added up over each window, and shared out among its steps by their covariances.

        Factors of errors must have little noise themselves. So shared, a window tells as much as its sum does.
        """
        if self.fixed:
            return slopes  # are added up later
        cov = self._motion_cov
        whole, total = (np.add.reduceat(one, self._windows) for one in (cov, slopes))
        count = np.diff(np.append(self._windows, len(cov)))
        return cov @ np.repeat(np.linalg.solve(whole, total), count, axis=0)

    def _rates(self, moved: Array) -> Array:
        """(d, 3) motions (d, 3) a second, averaged over WINDOW: factors of errors must have little noise themselves."""
        total, lasted = (np.add.reduceat(one, self._windows) for one in (moved, self._lasted))
        count = np.diff(np.append(self._windows, len(moved)))
        return np.repeat(total / lasted[:, None], count, axis=0)

    def _beyond_noise(self, rates: Array) -> Array:
        """(d, 3) rates of which as much of their variation is left as motions' noise does not explain.

        At one speed an estimated path has that noise, and a delay would look as if it were told by it.
        """
        noise, lasted = (np.add.reduceat(one, self._windows) for one in (self._motion_cov, self._lasted))
        explained = (np.diagonal(noise, axis1=1, axis2=2) / lasted[:, None] ** 2).mean(axis=0)
        middle = rates.mean(axis=0)
        varies = np.maximum(((rates - middle) ** 2).mean(axis=0), 1e-300)
        return middle + np.sqrt(np.maximum(1 - explained / varies, 0.0)) * (rates - middle)

    def _speeds(self, errors: Systematic, *, evenly: bool) -> Array:
        """(s, 3) the body's motion a second at each sighting: by its odometry, or by its path, which has less noise."""
        if evenly:
            at = np.clip(np.searchsorted(self.driven, self.step), 0, len(self.driven) - 1)
            rates = self._rates(between(self.path[self.driven - 1], self.path[self.driven]))
            return (rates if self.fixed else self._beyond_noise(rates))[at]
        return self._odometry_speeds(self._true_motions(errors))

    def _odometry_speeds(self, motions: Array) -> Array:
        """(s, 3) the body's motion a second at each sighting, by motions (n, 3)."""
        t, about = self.log.t, max(ABOUT, STEPS * float(np.median(self._lasted)))
        return ((before(t, motions, -about) - before(t, motions, about)) / (2 * about))[self.step]


def _place(errors: Systematic) -> Array:
    return np.array([errors.x, errors.y, errors.yaw])


def _slope(of: Callable[[Systematic], Array], errors: Systematic, name: str, turn: int = 2) -> Array:
    """Derivative of the values (k, d), of which column `turn` is an angle, by one of the errors."""
    here = getattr(errors, name)
    difference = of(errors._replace(**{name: here + STEP})) - of(errors._replace(**{name: here - STEP}))
    difference[:, turn] = wrap(difference[:, turn])
    return difference / (2 * STEP)


def _weights(root: Array, e: Array, most: float) -> Array:
    """(k,) roots of weights of residuals e (k, d): 1, and (most / e)^2 beyond that many times their scale.

    A loss that weighs small residuals less, too, would need another curvature for intervals to hold.
    """
    far = np.sqrt(((root @ e[..., None])[..., 0] ** 2).sum(axis=1))
    scale = float(np.median(far)) / MEDIANS[e.shape[1]] if len(far) else 0.0
    return np.minimum(1.0, most * scale / np.maximum(far, 1e-300)) if scale > 0 else np.ones(len(far))


def _block(first: int, places: Ints, values: Array) -> tuple[Ints, Ints, Array]:
    """Rows, columns and values of blocks (b, p, q) below one another, in columns (b, q)."""
    b, p, q = values.shape
    rows = first + p * np.arange(b)[:, None, None] + np.arange(p)[None, :, None]
    shape = (b, p, q)
    return (
        np.broadcast_to(rows, shape).ravel(),
        np.broadcast_to(places[:, None, :], shape).ravel(),
        values.ravel(),
    )


def _whitening(cov: Array) -> Array:
    """W (k, d, d) of covariances C (k, d, d), W' W = C^-1."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(cov)), np.float64) if len(cov) else cov
