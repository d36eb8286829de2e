"""Measures the noise of logs: by their true paths, or by the innovations of a filter."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...core.arrays import frozen
from ...core.errors import InputError
from ...core.factors import Dataset, Log, Truth
from ...core.gyro import fused
from ...core.partial import BEARING, RANGE
from ...core.se2 import Array, Ints
from ...core.truth.doubts import judges
from ...core.truth.errors import named
from ...datasets.noise.model import Model, SightingModel
from ...datasets.noise.systematic import Systematic, corrected
from ..plan.reference import reference
from ..systematic.delays import ToldDelay, told_delays
from ..systematic.estimated import Estimated
from ..systematic.fit import SystematicFit, fitted, of_estimate, of_truth
from ..systematic.frame import PLACE, Frame, PutRight, put_right
from ..systematic.late_parts import Late, in_time, late
from ..systematic.places import places_of
from ..systematic.ranges import around_optimum, best, of_ranges
from .gauss_markov import Chains, Fitted
from .gauss_markov import fitted as fitted_chains
from .innovations import Innovations, by_innovations
from .motions import Motions, fitted_motions
from .sightings import Part, alone, joined, sighted
from .together import together


class SightingNoise(NamedTuple):
    """The noise of ranges, or of bearings."""

    fitted: Fitted
    together: Estimated | None  # correlation between landmarks sighted at one step; None: too few of them
    chains: Chains
    t: Array  # (n,) s, since the start of each error's log
    first: int  # errors of the first log, which come first

    @property
    def model(self) -> SightingModel:
        """The numbers to state: a correlation that may be zero is none."""
        found = self.together
        return self.fitted.model(min(found.value, 1.0) if found is not None and found.low > 0 else 0.0)


class Noise(NamedTuple):
    """The noise of logs."""

    labels: Sequence[str]
    range: SightingNoise | None  # None: too few errors
    bearing: SightingNoise | None
    motions: Motions | None
    innovations: Innovations | None  # without a true path, what the EKF's innovations say
    remarks: Sequence[str]  # what cannot be said, without full stops
    systematic: SystematicFit | None = None  # errors that stay; None: not told. All else is without them.
    frame: Frame | None = None  # of a true path that is not the wheels' own; all else is by theirs
    delays: Sequence[tuple[str, ToldDelay]] = ()  # of sensors of joined recordings, each after its log's label
    late: Sequence[tuple[str, Late]] = ()  # of ranges and bearings alone, where it is told; certain ones are taken off

    @property
    def model(self) -> Model:
        """The numbers to state in a log."""
        range_, bearing = (None if one is None else one.model for one in (self.range, self.bearing))
        odometry = None if self.motions is None else [one.value for one in self.motions.scales]
        if self.innovations is not None:
            odometry, range_, bearing = self.innovations.stated((range_, bearing))
        stays = Systematic() if self.systematic is None else self.systematic.errors
        return Model(self.labels, odometry, range_, bearing, stays)


def measured(datasets: Sequence[Dataset], labels: Sequence[str]) -> Noise:
    """Measures the noise that `datasets` have in common, and lists the delays that their recordings told.

    InputError where the logs tell nothing.
    """
    delays = [(label, one) for (log, _), label in zip(datasets, labels, strict=True) for one in told_delays(log)]
    return _measured(datasets, labels)._replace(delays=delays)


def _measured(datasets: Sequence[Dataset], labels: Sequence[str]) -> Noise:
    """Measures the noise that `datasets` have in common, by the true paths of those that have one.

    Without any, by the innovations of the EKF on the first log, which takes a minute. The turns of a gyro are taken
    together with the odometry. InputError where the logs tell nothing.
    """
    datasets = [one._replace(log=_with_turns(one.log)) for one in datasets]
    by_truth = [
        k for k, (log, truth) in enumerate(datasets) if truth is not None and len(truth.t) > 1 and judges(log, truth)
    ]
    if not by_truth:
        return _without_truth(datasets, labels)
    known, lates = _in_time([datasets[k] for k in by_truth])
    stays = fitted(systems) if (systems := [one for log, truth in known if (one := of_truth(log, truth))]) else None
    if stays is None:
        stays = of_ranges(known)
    own = _put_right(known[0], stays) if stays is not None and len(known) == 1 else None
    if own is not None:
        known, stays = [own.dataset], own.fit
    known = [_corrected(dataset, stays) for dataset in known]
    left = [labels[k] for k in range(len(datasets)) if k not in by_truth]
    remarks = [f"{one} has no true path, and is left out" for one in left]
    found = [(sighted(log, truth), log, truth) for log, truth in known if truth is not None]
    range_, bearing = (
        _sightings([joined((whole.part(axis), alone(log, truth, kind))) for whole, log, truth in found])
        for axis, kind in ((0, RANGE), (1, BEARING))
    )
    if range_ is None and bearing is None:
        remarks.append("too few sightings have a known error: their noise stays as stated")
    motions = fitted_motions(known, _matters([log for log, _ in known], (range_, bearing)))
    if motions is None:
        remarks.append("too few motions lie between true poses: the odometry's noise stays as stated")
    if motions is None and range_ is None and bearing is None:
        raise InputError(f"{labels[0]}: found too few measurements with a known error, expected some 30.")
    return Noise(
        [labels[k] for k in by_truth], range_, bearing, motions, None, remarks, stays, own and own.frame, late=lates
    )


def _in_time(known: Sequence[Dataset]) -> tuple[list[Dataset], list[tuple[str, Late]]]:
    """Logs whose ranges and bearings alone are without a delay that is certain, and the delays that are told."""
    found, told = list(known), list[tuple[str, Late]]()
    for noun, kind in (("ranges", RANGE), ("bearings", BEARING)):
        one = late(known, kind)
        if one is None:
            continue
        told.append((noun, one))
        if one.certain:
            found = [in_time(dataset, kind, one) for dataset in found]
    return found, told


def _with_turns(log: Log) -> Log:
    """The log with its gyro's turns in the odometry."""
    if log.gyro is None:
        return log
    delta, cov = fused(log.gyro, log.delta, log.delta_cov)
    return replace(log, delta=frozen(delta), delta_cov=frozen(cov), gyro=None)


def _corrected(dataset: Dataset, stays: SystematicFit | None) -> Dataset:
    return dataset if stays is None else dataset._replace(log=corrected(dataset.log, stays.errors))


def _put_right(dataset: Dataset, by_truth: SystematicFit) -> PutRight | None:
    """The true path as that of the robot's wheels, where sightings and motions alone contradict what it tells."""
    if not set(by_truth.certain) & {*PLACE, "heading"}:
        return None
    alone = _systematic(dataset.log, None)
    return None if alone is None else put_right(dataset, by_truth, alone)


def _systematic(log: Log, truth: Truth | None) -> SystematicFit | None:
    """The errors that stay, around the batch optimum; None where there is none, and on a given map."""
    log = named(log, truth).identified().without_loops()
    if log.prior.start != "known" or log.prior.map is not None:
        return None
    found = reference(log)
    if found is None or found.map is None:
        return None
    system = of_estimate(log, found.poses, found.map, places_of(log, truth, found.map))
    return None if system is None else fitted([system])


def _sightings(found: Sequence[Part]) -> SightingNoise | None:
    chains = Chains(*map(np.concatenate, zip(*(one.chains for one in found), strict=True)))
    fit = fitted_chains(chains)
    if fit is None:
        return None
    first = np.cumsum([0, *(int(one.step.max(initial=0)) + 1 for one in found)])
    step = np.concatenate([one.step + start for one, start in zip(found, first, strict=False)])
    size = np.hypot(fit.model(0.0).spread(chains.stated, chains.reach), 0.0 if fit.bias is None else fit.bias.value)
    alike = together(step[fit.used], (chains.error / size)[fit.used])
    t = np.concatenate([one.t for one in found])
    return SightingNoise(fit, alike, chains, t, len(found[0].t))


def _matters(logs: Sequence[Log], noises: Sequence[SightingNoise | None]) -> float:
    """Seconds until landmarks have told the pose anew.

    The time between steps with sightings, nearly always; and twice the time of correlation, in which sightings of a
    landmark have the information of one more.
    """
    spans = [np.diff(log.t[np.unique(_seen_at(log))]) for log in logs]
    spans = [one for one in spans if len(one)]
    between = float(np.percentile(np.concatenate(spans), 95)) if spans else np.inf
    times = [2 * c.time.value for one in noises if one is not None and (c := one.fitted.correlation) is not None]
    return max(between, *times) if times else between


def _seen_at(log: Log) -> Ints:
    """The steps of all sightings."""
    return log.sighting_step if log.partial is None else np.concatenate((log.sighting_step, log.partial.step))


def _without_truth(datasets: Sequence[Dataset], labels: Sequence[str]) -> Noise:
    alone_ = [not len(log.ids) and log.partial is not None for log, _ in datasets]
    if all(alone_) and (found := _along_gps(datasets, labels)) is not None:
        return found
    remarks = [f"{label} is left out: without a true path one log is fitted" for label in labels[1:]]
    if alone_[0]:
        return _around_optimum(datasets[0].log, labels[0], remarks)
    stays = _systematic(*datasets[0])
    found, rough = by_innovations(_corrected(datasets[0], stays), labels[0])
    remarks.append(
        "without a true path, slow errors of sightings look like motion: sizes hold if errors are independent from "
        "sighting to sighting"
    )
    range_, bearing = (None if rough is None else _sightings([rough.part(axis)]) for axis in (0, 1))
    return Noise(labels[:1], range_, bearing, None, found, remarks, stays)


def _along_gps(datasets: Sequence[Dataset], labels: Sequence[str]) -> Noise | None:
    """Ranges alone along true paths of GPS, which tell positions; None without any, or where ranges are too few."""
    by_gps = [k for k, (_, truth) in enumerate(datasets) if truth is not None and truth.kind == "truth"]
    known, lates = _in_time([datasets[k] for k in by_gps])
    stays = of_ranges(known)
    if stays is None:
        return None
    parts = [alone(log, truth, RANGE) for log, truth in (_corrected(one, stays) for one in known) if truth is not None]
    remarks = [
        "the true path is not exact: its errors are among those of ranges, and the odometry's noise stays as stated"
    ]
    return Noise([labels[k] for k in by_gps], _sightings(parts), None, None, None, remarks, stays, late=lates)


def _around_optimum(log: Log, label: str, remarks: list[str]) -> Noise:
    """Ranges alone without a path: the errors that stay, and the residuals of the batch optimum without them."""
    log = log.identified()
    stays = around_optimum(log)
    if stays is None:
        raise InputError(
            f"{label}: found no true path and too few ranges alone, or no optimum of these, expected some 200: nothing "
            "in the log tells how large its errors are."
        )
    log = corrected(log, stays.errors)
    found = best(log)
    remarks.append("without a true path, the wheels' way tells how long ranges are: theirs may be the error")
    remarks.append("errors of ranges are those from the batch optimum, whose path follows slow ones: they are larger")
    part = alone(log, Truth(log.t, found.path, found.map), RANGE)
    return Noise([label], _sightings([part]), None, None, None, remarks, stays)
