"""Computes the columns of a path that is judged by relations: Kuemmerle et al., Autonomous Robots 27(4), 2009."""

from typing import Any

import numpy as np

from ...core.relations import Relations
from ...core.se2 import Array

STRETCHES = 20  # stretches of a log from whose means a standard error is


def relation_columns(relations: Relations, path: Array) -> dict[str, Any]:
    """Returns mean, its standard error, standard deviation and maximum of the errors of a path (n, 3), by column."""
    judged = relations.judged()
    errors = judged.errors(path)
    order = np.argsort(judged.first.step, kind="stable")
    row: dict[str, Any] = {}
    for unit, values in (("m", errors[:, 0]), ("deg", np.degrees(errors[:, 1]))):
        row[f"relation_{unit}"] = float(values.mean())
        row[f"relation_se_{unit}"] = standard_error(values[order])
        row[f"relation_sd_{unit}"] = float(values.std())
        row[f"relation_max_{unit}"] = float(values.max())
    return row


def counted_relations(relations: Relations) -> dict[str, Any]:
    """Returns how many relations the errors are of, and how many of these are exact, by column."""
    judged = relations.judged()
    return {"relations": len(judged.delta), "relations_exact": int(judged.exact.sum())}


def standard_error(values: Array) -> float | None:
    """The standard error of the mean of (n,) values in the order of time; None for fewer than two a stretch.

    By batch means: neighbouring relations share scans and a part of the map, so that their errors are alike, and those
    of long stretches are nearly independent (G. S. Fishman, Management Science 24(5), 1978).
    """
    if len(values) < 2 * STRETCHES:
        return None
    means = np.array([stretch.mean() for stretch in np.array_split(values, STRETCHES)])
    return float(means.std(ddof=1) / np.sqrt(STRETCHES))
