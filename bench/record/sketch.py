"""Sketches of logs: a few numbers that give the distance of two logs, in units of their own noise.

Where frames are rendered or a library chooses code by the processor, logs of the same sources differ by rounding, and
so in their digests. The sketch is a random projection (Johnson and Lindenstrauss, 1984): the distance of two sketches
estimates that of the logs, with a standard deviation of 18 %.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ...core.factors import Log, digest_of
from ...core.se2 import Array

ROUNDING = 0.1
"""Standard deviations; two logs whose numbers, all together, are no further apart are equal up to rounding."""

SUMS = 16
_BLOCK = 1 << 16
_SEED = 1984


class Sketch(NamedTuple):
    """A digest of the exact parts, and projections of everything else."""

    frame: str  # digest of the times, the ids and which step each row belongs to
    sums: Array  # (SUMS,)

    def words(self) -> dict[str, Any]:
        """Converts to JSON values."""
        return {"frame": self.frame, "sums": self.sums.tolist()}


def sketch(log: Log) -> Sketch:
    """The sketch of `log`."""
    known = log.prior.map
    fixed = {name: getattr(log, name) for name in ("t", "sighting_first", "ids", "loop_first", "loop_to")}
    fixed |= {"map.ids": None if known is None else known.ids}
    if known is not None and known.cov is None:
        fixed["map.xy"] = known.xy
    sums = np.zeros(SUMS)
    rng = np.random.default_rng(_SEED)
    for column in _standardised(log):
        for first in range(0, len(column), _BLOCK):
            block = np.nan_to_num(column[first : first + _BLOCK], nan=0.0, posinf=0.0, neginf=0.0)
            signs = rng.integers(1 << SUMS, size=len(block), dtype=np.uint32)
            sums += [np.where(signs >> k & 1, block, -block).sum() for k in range(SUMS)]
    return Sketch(digest_of(fixed), sums)


def distance(one: Sketch, other: Sketch) -> float:
    """Estimates the root of the summed squared differences of two logs, in standard deviations; may be infinite.

    Variances count by half their logarithms, so that relative differences of standard deviations matter.
    """
    if one.frame != other.frame:
        return np.inf
    return float(np.sqrt(np.mean((one.sums - other.sums) ** 2)))


def from_words(words: Any) -> Sketch | None:
    """Inverts `Sketch.words`; None for anything else."""
    try:
        found = Sketch(str(words["frame"]), np.array(words["sums"], np.float64))
    except (TypeError, KeyError, ValueError):
        return None
    return found if found.sums.shape == (SUMS,) and np.isfinite(found.sums).all() else None


def _standardised(log: Log) -> Iterator[Array]:
    """Every number subject to rounding, in units of its standard deviation; not finite where that is zero."""
    prior, known = log.prior, log.prior.map
    pairs = [(prior.pose[None], prior.cov[None]), (log.delta[1:], log.delta_cov[1:])]
    pairs += [(log.z, log.z_cov), (log.loop_delta, log.loop_cov)]
    if known is not None and known.cov is not None:
        pairs.append((known.xy.reshape(1, -1), known.cov[None]))
    for values, cov in pairs:
        sd = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
        i, j = np.triu_indices(cov.shape[-1], 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            columns = values / sd, np.log(sd), cov[:, i, j] / (sd[:, i] * sd[:, j])
        yield from (column.ravel() for column in columns)
