"""Measures how hard the data association of a log is: rules are asked at the belief of a filter that is told the ids.

It is a lower bound of the mistakes of a filter that decides by itself, whose mistakes lead to others.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...backends import registry as backends
from ...backends._rules import NEW, decide_frame
from ...backends.api import Diverged, Expected
from ...backends.association.options import RULES, Association
from ...backends.association.quantiles import gates, quantile
from ...backends.association.signatures import SignatureFilters
from ...core.factors import UNKNOWN, Dataset, Log, RangeBearing, Step
from ...core.se2 import Array, wrap

FAR = 200.0  # squared distance up to which the right landmark is looked for
LARGEST = 200_000  # steps and sightings beyond which a log is not looked into


class Difficulty(NamedTuple):
    """The difficulty of a log's data association."""

    candidates: float  # landmarks within the gate of a sighting of a landmark that was sighted before, mean
    several: float  # share of these sightings that have more than one
    beyond: float  # share of these whose right landmark is not within the gate
    beyond_new: float  # share of these whose right landmark is so far off that they are taken for new ones
    single: float  # share of the steps with sightings that have a single one
    wrong: Mapping[str, float]  # by rule: share of all sightings taken for another landmark, or for a new one


class _Count:
    """Counts over the sightings of a log."""

    def __init__(self, usual: Association, *, signed: bool) -> None:
        self._usual = usual
        self._each, self._signatures = 3 if signed else 2, SignatureFilters() if signed else None
        self._match, self._far = (quantile(share, 1, self._each) for share in (usual.match, usual.new))
        self.known = self.candidates = self.several = self.beyond = self.beyond_new = 0
        self.wrong = dict.fromkeys(RULES, 0)

    def add(self, step: Step, expected: Expected, before: set[int]) -> None:
        """Adds the sightings of a step, with true ids; those `before` are on the map."""
        seen = step.sightings
        near, signed = distances(seen, expected), None
        if self._signatures is not None:
            signed = self._signatures.pairs(step.signatures, expected.ids)
            near += signed[..., 0]
            self._signatures.learn(seen.ids.tolist(), step.signatures)
        column = {landmark: k for k, landmark in enumerate(expected.ids.tolist())}
        ids = seen.ids.tolist()
        for i, landmark in enumerate(ids):
            if landmark not in before:
                continue
            inside = int((near[i] < self._match).sum())
            own = near[i, column[landmark]] if landmark in column else np.inf
            self.known += 1
            self.candidates += inside
            self.several += inside > 1
            self.beyond += bool(own >= self._match)
            self.beyond_new += bool(own >= self._far)
        for number, rule in enumerate(RULES):
            asked = (
                number, seen.z, seen.cov, expected.z, expected.cov, self._match,
                gates(self._usual.joint, len(ids), self._each), self._far, self._usual.nodes,
            )  # fmt: skip
            pair, _ = decide_frame(*asked) if signed is None else decide_frame(*asked, signed)
            for landmark, k in zip(ids, pair.tolist(), strict=True):
                found = int(expected.ids[k]) if k >= 0 else k
                self.wrong[rule] += (k >= 0 and found != landmark) or (k == NEW and landmark in before)


def difficulty(dataset: Dataset) -> Difficulty | None:
    """Measures it with the EKF; None where true ids or the EKF's needs are not known, or where it gets lost."""
    log = _told(dataset)
    if log is None or len(log) + len(log.ids) > LARGEST:
        return None
    builder = backends.find("ekf")
    usual: Any = builder.options()
    ekf: Any = builder.make(log.prior, usual, np.random.default_rng(0))
    before = set[int]() if log.prior.map is None else set(log.prior.map.ids.tolist())
    count, looks, single = _Count(usual, signed=log.prior.signatures), 0, 0
    try:
        for step in log:
            if len(step.sightings.ids):
                looks, single = looks + 1, single + (len(step.sightings.ids) == 1)
                ekf.foresee(step.gyro)
                count.add(step, ekf.expected(step.odometry, step.sightings, FAR), before)
                before.update(step.sightings.ids.tolist())
            ekf.step(step)
    except Diverged:
        return None
    if not count.known:
        return None
    return Difficulty(
        count.candidates / count.known,
        count.several / count.known,
        count.beyond / count.known,
        count.beyond_new / count.known,
        single / looks,
        {rule: one / len(log.ids) for rule, one in count.wrong.items()},
    )


def distances(seen: RangeBearing, expected: Expected) -> Array:
    """Squared Mahalanobis distances (k, m) of k sightings from m expected ones."""
    off = seen.z[:, None] - expected.z[None]
    off[..., 1] = wrap(off[..., 1])
    m = len(expected.ids)
    own = expected.cov.reshape(m, 2, m, 2)[np.arange(m), :, np.arange(m)]
    spread = seen.cov[:, None] + own[None]
    return np.einsum("kmi,kmi->km", off, np.linalg.solve(spread, off[..., None])[..., 0])


def _told(dataset: Dataset) -> Log | None:
    """The log with the true id of every sighting, without those of unknown landmarks; None without any."""
    log, truth = dataset
    if log.prior.start != "known" or (log.prior.map is not None and log.prior.map.cov is None):
        return None
    if (log.ids == UNKNOWN).any() and truth is not None and truth.assigned is not None:
        log = replace(log, ids=truth.assigned)
    log = log.identified()
    return log if len(log.ids) else None
