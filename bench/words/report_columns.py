"""What a report's tables have beside the columns of cells.csv and metrics.csv."""

from .column import NUMBER, TEXT, Column

PAIRS = (
    Column("second", "against", TEXT, "The second backend of the pair."),
    Column("measure", "measure", TEXT, "The error that is compared."),
    Column(
        "ratio",
        "ratio",
        NUMBER,
        "Typical ratio of the second one's error to the first one's on the same logs: the Hodges-Lehmann estimate, the "
        "median of the averages of every two logarithms of these ratios. Beside it its 95 % interval: the ratios that "
        "the signed-rank test does not reject.",
    ),
    Column("verdict", "verdict", TEXT, "What holds of the first one; test and interval must both support it."),
    Column(
        "adjusted",
        "p",
        NUMBER,
        "Wilcoxon's signed-rank test, two-sided, after Holm's correction over all pairs of a measure. Comparisons with "
        "dead reckoning are corrected among themselves.",
    ),
    Column("effect", "effect", NUMBER, "Matched-pairs rank-biserial correlation: 1 where the first is always closer."),
    Column("closer", "closer on", TEXT, "Logs on which the first one's error is lower, of those that both ran on."),
)
"""The columns of a report's table of pairs, by their names in JSON."""

REPORT = (
    Column("done", "done", TEXT, "Cells that are done, of all."),
    Column(
        "implementation",
        "implementation",
        TEXT,
        "Whose program the backend is. Compiled here: kernels of slamduel, compiled for this processor. GTSAM's wheel: "
        "GTSAM as published, compiled for any processor, and called from Python. Other backends say it themselves, or "
        "are named after the package that installed them. Costs compare these programs as much as the algorithms.",
    ),
    Column(
        "median",
        "median",
        TEXT,
        "Over logs; several runs on one log are averaged first. A cell that failed has an infinite error.",
    ),
    Column(
        "interval",
        "95 % interval",
        TEXT,
        "Beside a median, from 6 logs on: between order statistics, interpolated as by Hettmansperger and Sheather "
        "(1986). With fewer logs it is the range.",
    ),
    Column(
        "best",
        "bold",
        TEXT,
        "Those that the most accurate one does not beat significantly; none where it beats nobody.",
    ),
    Column(
        "baseline", "dead-reckoning", TEXT, "What every backend has to beat: it uses no sighting and is not ranked."
    ),
    *PAIRS,
)
"""What a report's tables have beside those columns, and what their words stand for."""
