"""Hides the ids of a log's sightings, as an option of simulated, rendered and published datasets.

Which ids are hidden is drawn from a generator of its own: everything else of the log is the same, bit for bit, and a
larger share includes the sightings of a smaller one.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..core.factors import UNKNOWN, Dataset, Truth
from ..core.options import option

KNOWN, HIDDEN = "known", "hidden"

HIDDEN_NOTE = "hidden ids"  # the key of how many ids were hidden on demand, among the log's notes


@dataclass(frozen=True)
class HiddenIds:
    """The sightings without an id, by default none; a dataset's options inherit it."""

    ids: float | str = option(
        KNOWN,
        "ids of the sightings, or the share of them that is hidden",
        minimum=0,
        maximum=1,
        choices=(KNOWN, HIDDEN),
    )


def hidden(dataset: Dataset, ids: float | str, rng: np.random.Generator) -> Dataset:
    """Makes `ids`, a share or all, of the log's sightings UNKNOWN; the truth's `assigned` then has their true ids.

    A log without ground truth gets one without path and map.
    """
    share = {KNOWN: 0.0, HIDDEN: 1.0}[ids] if isinstance(ids, str) else ids
    if not share:
        return dataset
    log, truth = dataset
    hide = rng.uniform(size=len(log.ids)) < share
    left = np.where(hide, UNKNOWN, log.ids)
    left.flags.writeable = False
    truth = truth or Truth(np.zeros(0), np.zeros((0, 3)))
    notes = {**log.notes, HIDDEN_NOTE: f"{hide.sum()} of {len(hide)}"}
    truth = truth._replace(assigned=log.ids if truth.assigned is None else truth.assigned)
    partial = log.partial
    if partial is not None:
        of_parts = np.where(rng.uniform(size=len(partial)) < share, UNKNOWN, partial.ids)
        of_parts.flags.writeable = False
        true = partial.ids if truth.assigned_partial is None else truth.assigned_partial
        partial, truth = replace(partial, ids=of_parts), truth._replace(assigned_partial=true)
    return Dataset(replace(log, ids=left, partial=partial, notes=notes), truth)
