"""Computes the columns of a path that is judged by relations: Kuemmerle et al., Autonomous Robots 27(4), 2009."""

from typing import Any

import numpy as np

from ...frontend.relations import Relations
from ...frontend.se2 import Array


def relation_columns(relations: Relations, path: Array) -> dict[str, Any]:
    """Returns mean, standard deviation and maximum of the errors of a path (n, 3), by column."""
    errors = relations.judged().errors(path)
    row: dict[str, Any] = {}
    for unit, values in (("m", errors[:, 0]), ("deg", np.degrees(errors[:, 1]))):
        row[f"relation_{unit}"] = float(values.mean())
        row[f"relation_sd_{unit}"] = float(values.std())
        row[f"relation_max_{unit}"] = float(values.max())
    return row


def counted_relations(relations: Relations) -> dict[str, Any]:
    """Returns how many relations the errors are of, and how many of these are exact, by column."""
    judged = relations.judged()
    return {"relations": len(judged.delta), "relations_exact": int(judged.exact.sum())}
