"""Sightings of a simulated world that tell a range alone, or a bearing alone, as options of the dataset.

Which ones is drawn from a generator of its own: everything else of the log is the same, bit for bit, and a larger share
includes the sightings of a smaller one. A range keeps its error and its variance, and so does a bearing; signatures are
lost.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.factors import CONSTANTS_NOTE, Dataset
from ...core.options import option
from ...core.partial import BEARING, RANGE, PartialTable

PARTS_NOTE = "a part alone"  # the key of how many sightings were reduced, among the log's notes


@dataclass(frozen=True)
class Parts:
    """The sightings that tell a part alone, by default none; a simulated world's options inherit it."""

    ranges_only: float = option(0.0, "share of the sightings that tell the range alone", minimum=0.0, maximum=1.0)
    bearings_only: float = option(0.0, "share that tells the bearing alone", minimum=0.0, maximum=1.0)
    uwb_tail: float = option(
        0.0,
        "share of the ranges alone that is late or reflected: too long",
        minimum=0.0,
        maximum=1.0,
        beside="ranges_only",
    )
    uwb_tail_mean: float = option(
        1.0, "mean of the exponential by which these are too long, m", minimum=1e-6, maximum=1e4, beside="uwb_tail"
    )
    range_scale: float = option(
        0.0, "sd of a constant scale of ranges alone, drawn and stated", minimum=0.0, maximum=0.3, beside="ranges_only"
    )
    range_offset: float = option(
        0.0, "likewise of a constant offset, m", minimum=0.0, maximum=100.0, beside="ranges_only"
    )


def with_parts(dataset: Dataset, options: Parts, rng: np.random.Generator) -> Dataset:
    """Reduces sightings of the log to a part; their true ids move to the truth's `assigned_partial`.

    A range that an error takes to zero or below is lost. InputError for shares of more than all sightings, and where
    the world has no landmarks.
    """
    ranges, bearings = options.ranges_only, options.bearings_only
    if not ranges and not bearings:
        return dataset
    log, truth = dataset
    if not len(log.ids) and (truth is None or truth.map is None or not len(truth.map.ids)):
        name = "ranges_only" if ranges else "bearings_only"
        raise InputError(f"dataset {log.name}: option {name} has no effect without landmarks, expected both.")
    if ranges + bearings > 1:
        raise InputError(
            f"dataset {log.name}: options ranges_only={ranges:g} and bearings_only={bearings:g} are "
            f"{ranges + bearings:g} together, expected at most 1."
        )
    choosing, lengthening, staying = rng.spawn(3)
    share, step = choosing.uniform(size=len(log.ids)), log.sighting_step
    part = {RANGE: share < ranges, BEARING: share >= 1 - bearings}
    far = _tails(len(log.ids), options, lengthening)
    scale, offset = staying.standard_normal(2) * (options.range_scale, options.range_offset)
    measured = (1 + scale) * log.z[:, 0] + offset + far
    rows = np.concatenate([np.flatnonzero(part[RANGE] & (measured > 0)), np.flatnonzero(part[BEARING])])
    kind = np.repeat([RANGE, BEARING], [int((part[RANGE] & (measured > 0)).sum()), int(part[BEARING].sum())])
    order = np.argsort(step[rows], kind="stable")
    rows, kind = rows[order], kind[order]
    partial = PartialTable.from_arrays(
        len(log),
        step[rows],
        log.ids[rows],
        kind,
        np.where(kind == RANGE, measured[rows], log.z[rows, 1]),
        np.where(kind == RANGE, log.z_cov[rows, 0, 0], log.z_cov[rows, 1, 1]),
    )
    whole = ~(part[RANGE] | part[BEARING])
    counts: dict[str, Any] = {"ranges": int((kind == RANGE).sum()), "bearings": int((kind == BEARING).sum())}
    counts |= {"too long": int((far[rows] > 0).sum())} if options.uwb_tail else {}
    columns = {"ids": log.ids[whole], "z": log.z[whole], "z_cov": log.z_cov[whole]}
    columns["sighting_first"] = np.searchsorted(step[whole], np.arange(len(log) + 1))
    for column in columns.values():
        column.flags.writeable = False
    signatures = None if log.signatures is None else log.signatures.rows(whole)
    constant = log.prior.systematic._replace(range_scale=options.range_scale, range_offset=options.range_offset)
    if truth is not None and truth.assigned is not None:
        true, of_parts = truth.assigned[whole], truth.assigned[rows]
        true.flags.writeable = of_parts.flags.writeable = False
        truth = truth._replace(assigned=true, assigned_partial=of_parts)
    prior, notes = log.prior._replace(systematic=constant), {**log.notes, PARTS_NOTE: counts}
    if options.range_scale or options.range_offset:
        drawn = {"range_scale": float(scale), "range_offset": float(offset)}
        notes[CONSTANTS_NOTE] = {**log.notes.get(CONSTANTS_NOTE, {}), **drawn}
    return Dataset(replace(log, prior=prior, partial=partial, signatures=signatures, notes=notes, **columns), truth)


def _tails(count: int, options: Parts, rng: np.random.Generator) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(count,) m by which ranges are too long: half the square of a normal in the plane is exponential."""
    late, normal = rng.uniform(size=count), rng.standard_normal((2, count))
    return np.where(late < options.uwb_tail, options.uwb_tail_mean * (normal**2).sum(axis=0) / 2, 0.0)
