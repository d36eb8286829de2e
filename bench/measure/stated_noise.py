"""Compares a log's stated noise with its errors where the truth is known, and remarks on a log that misstates it."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.arrays import slices
from ...core.factors import UNKNOWN, Log, Truth
from ...core.se2 import Array, Ints
from ...core.truth.errors import Errors, difference, driven_errors, named, sighting_errors
from .landmark_places import comparable

FAR = {1: 10.828, 2: 13.816, 3: 16.266}  # dimension -> chi-square's 99.9 % point
MEDIAN = {1: 0.4549, 2: 1.3863, 3: 2.3660}  # dimension -> the median of chi-square
ROBUST = 1.4826  # a normal standard deviation over the median of absolute values
OVERCONFIDENT, CAUTIOUS = 1.5, 0.3  # mean NEES over its dimension beyond which the log is looked into
TYPICAL = 2.0  # times the stated standard deviation, or its inverse, from which a typical error is remarked on
TENFOLD = 10.0  # likewise, where the belief holds: no sensor is calibrated as badly, a wrong unit or a square is worse
GROSS = 7.0  # standard deviations: a normal error is beyond once in 4e10 sightings
UNEVEN = 1.3  # root mean square of the errors over the typical one, as stated, from which no single factor mends both
APART = 2.0  # times the scale of the one part of the sightings, from which on the other part is one of its own
FEWEST = 50  # sightings to divide into parts
NAMED = 6  # landmarks that a remark names one by one
COMPONENTS = {
    "forward": "option forward",
    "sideways": "option floor_position",
    "turn": "options turning and turning_by_turn",
}
"""The components of a motion, and what states the noise of each for CSV tables."""

OTHER_PLACES = "the true places of landmarks are not where sightings from the true path have them: they judge no noise"


class NoiseCheck(NamedTuple):
    """Normalised squared errors e' C^-1 e of one kind of measurement."""

    checked: int
    nees: float  # their mean over the dimension k: 1 where the noise is as stated
    median: float
    far: float  # share beyond FAR
    scale: float  # by how much the typical error is larger than stated: sqrt(median / chi-square's median)


def noise_check(errors: Errors, cov: Array) -> NoiseCheck | None:
    """Compares `errors` with their stated covariances, whose rows are in `cov` (n, k, k); None without any."""
    if not len(errors.row):
        return None
    k, squares = errors.values.shape[1], squares_in(errors, cov)
    far = float((squares > FAR[k]).mean())
    median = float(np.median(squares))
    return NoiseCheck(len(squares), float(squares.mean()) / k, median, far, typical_scale(squares, k))


def squares_in(errors: Errors, cov: Array) -> Array:
    """The squares (m,) e' C^-1 e of `errors`, whose covariances are rows of `cov` (n, k, k)."""
    found = np.empty(len(errors.row))
    for some in slices(len(found)):
        found[some] = normalised(errors.values[some], cov[errors.row[some]])
    return found


def normalised(errors: Array, cov: Array) -> Array:
    """The squares (m,) e' C^-1 e of `errors` (m, k) with covariances `cov` (m, k, k)."""
    return np.einsum("mi,mi->m", errors, np.linalg.solve(cov, errors[..., None])[..., 0])


def typical_scale(squares: Array, k: int) -> float:
    """Returns by how much the typical error is larger than stated, from normalised squares of dimension k."""
    return float(np.sqrt(np.median(squares) / MEDIAN[k]))


class Measured(NamedTuple):
    """The noise that sightings have, robust to outliers."""

    range_sd: float  # m
    bearing_sd: float  # rad


def measured(errors: Errors) -> Measured | None:
    """The standard deviations of the errors (m, 2) of sightings; None without any."""
    return Measured(*map(typical, errors.values.T)) if len(errors.row) else None


def typical(errors: Array) -> float:
    """A robust standard deviation: 1.4826 times the median absolute error, not centred: a bias enlarges it."""
    return float(ROBUST * np.median(np.abs(errors)))


def misstated(log: Log, truth: Truth, row: dict[str, Any], *, sightings: bool = True) -> Iterator[str]:
    """Yields remarks on a log that a backend's NEES in `row` contradicts, as far as the true path can tell.

    Of a backend that does not use `sightings` they are no reason for its NEES.
    """
    beliefs = [row[name] for name in ("nees", "final_nees") if row.get(name) is not None]
    belief = _Belief(any(nees > OVERCONFIDENT for nees in beliefs), any(nees < CAUTIOUS for nees in beliefs))
    if sightings:
        yield from _sightings(named(log, truth), truth, belief)
    driven = driven_errors(log, truth)
    worst = _worst(driven, log.delta_cov)
    yield from _far("motion", _Sizes.of(driven, log.delta_cov), len(log) - 1, belief, worst)
    if belief.overconfident and truth.t[0] == log.t[0]:
        yield from _start(log, truth)


class _Belief(NamedTuple):
    """The ways in which a backend's NEES, online or final, is off."""

    overconfident: bool
    cautious: bool

    @property
    def off(self) -> bool:
        """True in either way."""
        return self.overconfident or self.cautious

    @property
    def typical(self) -> float:
        """The factor on what is stated, or its inverse, from which a typical error is remarked on."""
        return TYPICAL if self.off else TENFOLD


def _sightings(log: Log, truth: Truth, belief: _Belief) -> Iterator[str]:
    """Remarks on the errors of sightings, and on the parts of the log that they differ in where the belief is off."""
    given = truth._replace(assigned=None)  # an error of the given id is an error of the sighting
    right = comparable(log, given)
    if given.map is not None and right is not given:
        yield OTHER_PLACES
    errors = sighting_errors(log, right)
    sizes = _Sizes.of(errors, log.z_cov)
    if belief.off and sizes is not None and sizes.uneven and len(errors.row) >= FEWEST:
        parts = _parts(sizes, log.z[errors.row, 0], log.ids[errors.row])
        if parts:
            yield f"the stated noise of the sightings is uneven: {parts}"
            return
    yield from _far("sighting", sizes, int((log.ids != UNKNOWN).sum()), belief)


class _Sizes(NamedTuple):
    """Errors of one kind of measurement, over what is stated: normalised squares of dimension k."""

    squares: Array  # (m,)
    k: int

    @classmethod
    def of(cls, errors: Errors, cov: Array) -> "_Sizes | None":
        """Those of `errors`, whose rows are in `cov`; None without any."""
        squares = squares_in(errors, cov)
        return cls(squares, errors.values.shape[1]) if len(squares) else None

    @property
    def typical(self) -> float:
        """The typical error's scale."""
        return typical_scale(self.squares, self.k)

    @property
    def overall(self) -> float:
        """The scale of the root mean square, which NEES goes by, without gross errors."""
        kept = self.squares[self.squares <= (GROSS * max(self.typical, 1.0)) ** 2]
        return float(np.sqrt(kept.mean() / self.k)) if len(kept) else 0.0

    @property
    def uneven(self) -> bool:
        """True where some are so much larger than typical that no single factor on what is stated is right."""
        return self.overall > UNEVEN * self.typical

    def part(self, mine: NDArray[np.bool_]) -> "_Sizes":
        """Those of some of the measurements (m,)."""
        return self._replace(squares=self.squares[mine])


def _parts(sizes: _Sizes, reach: Array, ids: Ints) -> str:
    """Says for which distances or landmarks too much is stated, and for which too little; "" where neither explains it.

    Sightings, at the ranges `reach` (m,) of the landmarks `ids` (m,), are divided in two where that raises the
    likelihood of normal errors most; landmarks by their own errors, each of which costs as a parameter does (BIC).
    """
    n = len(ids)
    names, landmark = np.unique(ids, return_inverse=True)
    own = np.bincount(landmark, sizes.squares) / np.bincount(landmark)
    order = np.argsort(own)
    near = [reach <= limit for limit in np.quantile(reach, np.arange(0.1, 0.95, 0.1))]
    low = [np.isin(landmark, order[:count]) for count in range(1, len(names))]
    halves = [(_gain(sizes, mine) - np.log(n), "distance", mine) for mine in near]
    halves += [(_gain(sizes, mine) - len(names) * np.log(n) / 2, "landmark", mine) for mine in low]
    gain, kind, mine = max(halves, key=lambda one: one[0])
    scales = [sizes.part(one).overall for one in (mine, ~mine)]
    if gain <= 0 or max(scales) < APART * min(scales):
        return ""
    if kind == "distance":
        limit = float(reach[mine].max())
        where = [f"for landmarks within {limit:.2g} m", "for those beyond"]
    else:
        where = [f"for {_listed(np.unique(ids[one]).tolist())}" for one in (mine, ~mine)]
    first, second = (
        f"{_judged(scale)} {of}, whose errors are {scale:.2g} times what is stated"
        for of, scale in zip(where, scales, strict=True)
    )
    return f"{first}, and {second}"


def _gain(sizes: _Sizes, mine: NDArray[np.bool_]) -> float:
    """The gain in log likelihood from a scale of its own for `mine` (m,) and for the rest, neither of them empty."""
    parts = [sizes.part(mine), sizes.part(~mine)]
    if not all(len(part.squares) and part.overall > 0 for part in parts):
        return -np.inf
    return sizes.k * sum(len(part.squares) * np.log(sizes.overall / part.overall) for part in parts)


def _judged(scale: float) -> str:
    """Judges what is stated for errors that are `scale` times that."""
    return "too much" if scale < 0.8 else "too little" if scale > 1.25 else "right"


def _listed(names: list[int]) -> str:
    """The landmarks, the first by name."""
    shown = ", ".join(map(str, names[:NAMED]))
    more = len(names) - NAMED
    return f"landmark{'s' * (len(names) > 1)} {shown}" + (f" and {more} more" if more > 0 else "")


def _start(log: Log, truth: Truth) -> Iterator[str]:
    """Compares the prior's pose with the true one."""
    error = difference(log.prior.pose[None], truth.poses[:1])
    distance = float(np.sqrt(normalised(error, log.prior.cov[None])[0]))
    if distance > GROSS:
        yield (
            f"the log's prior is {np.hypot(*error[0, :2]):.2g} m and {abs(error[0, 2]):.2g} rad off the true pose, "
            f"{distance:.2g} of its standard deviations"
        )


def _worst(errors: Errors, cov: Array) -> str:
    """Says which component of motions is the farthest from what is stated of all, and what states it; "" for none."""
    if not len(errors.row):
        return ""
    squares = errors.values**2 / np.einsum("nii->ni", cov[errors.row])
    scales = [typical_scale(column, 1) for column in squares.T]
    more = sum(np.log(np.maximum(scales, 1e-300))) > 0
    k = int(np.argmax(scales) if more else np.argmin(scales))
    name, option = list(COMPONENTS.items())[k]
    return f", {'most' if more else 'least'} of all {name}, {scales[k]:.2g} times (of CSV tables {option})"


def _far(noun: str, sizes: _Sizes | None, number: int, belief: _Belief, worst: str = "") -> Iterator[str]:
    """Remarks on errors of another size than stated; where the `belief` is overconfident, on single ones as well.

    `worst` is added to what is said of their typical size.
    """
    if sizes is None:
        return
    scale = sizes.typical
    if not 1 / belief.typical < scale < belief.typical:
        said = f"the errors of the {noun}s are typically {scale:.2g} times what is stated"
        if not sizes.uneven:
            yield said + worst
            return
        if belief.off:
            overall = f"{sizes.overall:.2g} times in the root mean square"
            yield f"{said}, but {overall}: some are much larger than the rest{worst}"
    gross = int((sizes.squares > GROSS**2).sum())
    if gross and belief.overconfident:
        largest = float(np.sqrt(sizes.squares.max()))
        yield (
            f"{gross} of {number} {noun}s {'are' if gross > 1 else 'is'} off by more than {GROSS:g} stated standard "
            f"deviations, by {float(f'{largest:.2g}'):,.10g} at most"
        )
