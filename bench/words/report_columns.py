"""Columns of a report's tables that are not in its files of cells: pairs, costs by pair, estimated constants."""

from . import column as kind
from .column import Column

PAIRS = (
    Column("second", "against", kind.TEXT, "The second backend of the pair."),
    Column("measure", "measure", kind.TEXT, "The error that is compared."),
    Column("ratio", "ratio", kind.NUMBER,
           "Typical ratio of the second one's error to the first one's on the same logs: the Hodges-Lehmann estimate, "
           "the median of the averages of every two logarithms of these ratios. Beside it its 95 % interval: the "
           "ratios that the signed-rank test does not reject."),
    Column("verdict", "verdict", kind.TEXT, "What holds of the first one; test and interval must both support it."),
    Column("adjusted", "p", kind.NUMBER,
           "Wilcoxon's signed-rank test, two-sided, after Holm's correction over all pairs of a measure. Comparisons "
           "with dead reckoning are corrected among themselves."),
    Column("effect", "effect", kind.NUMBER,
           "Matched-pairs rank-biserial correlation: 1 where the first is always closer."),
    Column("closer", "closer on", kind.TEXT,
           "Logs on which the first one's error is lower, of those that both ran on."),
)  # fmt: skip
"""The columns of a report's table of pairs, by their names in JSON."""

ESTIMATED = (
    Column("constant", "constant", kind.TEXT, "The constant error, and its unit."),
    Column("estimate", "estimate", kind.SIGNED, "Its median over the logs at each one's end."),
    Column("stated_sd", "stated sd", kind.NUMBER,
           "The standard deviation that the backend states for it; blank where it states none."),
    Column("true", "true", kind.SIGNED, "The true value, where it is known."),
)  # fmt: skip
"""The columns of a report's table of estimated constants."""

COST_PAIRS = (
    *PAIRS[:2],
    Column("cost_ratio", "ratio", kind.NUMBER,
           "Ratio of the second one's cost to the first one's on the same log in the same round: the "
           "geometric mean. Beside it its 95 % interval, over logs and rounds, for the machine as it was."),
    Column("cost_verdict", "verdict", kind.TEXT,
           "Cheaper, or more costly, where the whole interval is beyond 1.5, which is more than load shifted any ratio "
           "by; alike where it is within 1.5 and its inverse; otherwise the costs are not told apart."),
    Column("rounds", "rounds", kind.TEXT, "Rounds and logs, or clusters of logs, that the interval is of."),
)  # fmt: skip
"""The columns of a report's table of costs by pair."""

REPORT = (
    Column("done", "done", kind.TEXT, "Cells that are done, of all."),
    Column("implementation", "implementation", kind.TEXT,
           "Whose program the backend is. Compiled here: kernels of slamduel, compiled for this processor. GTSAM's "
           "wheel: GTSAM as published, compiled for any processor, and called from Python. Other backends say it "
           "themselves, or are named after the package that installed them. Costs compare these programs as much as "
           "the algorithms."),
    Column("median", "median", kind.TEXT,
           "Over logs; several runs on one log are averaged first. A cell that failed has an infinite error."),
    Column("interval", "95 % interval", kind.TEXT,
           "Beside a median, from 6 logs on: between order statistics, interpolated as by Hettmansperger and Sheather "
           "(1986). With fewer logs it is the range."),
    Column("best", "bold", kind.TEXT,
           "Those that the most accurate one does not beat significantly; none where it beats none."),
    Column("baseline", "dead-reckoning", kind.TEXT,
           "What every backend has to beat: it uses no sighting and is not ranked."),
    *PAIRS,
    *COST_PAIRS[2:],
    *ESTIMATED,
)  # fmt: skip
"""The other columns of a report's tables, and the meanings of their words."""
