"""What each column means, with its unit: those of cells.csv, of metrics.csv, and what tables have beside them."""

from typing import NamedTuple


class Column(NamedTuple):
    """A column of cells.csv, of metrics.csv or of the report's tables."""

    heading: str  # as the report's tables have it
    unit: str  # "" for words and counts
    meaning: str


COLUMNS: dict[str, Column] = {
    "dataset": Column("dataset", "", "The dataset's name."),
    "dataset_options": Column("options", "", "What was asked of it on the command line."),
    "backend": Column("backend", "", "The backend's name."),
    "options": Column("options", "", "What was asked of it on the command line."),
    "seed": Column("seed", "", "Numbers the log; a backend's own randomness is drawn from it and the backend's name."),
    "status": Column("status", "", "done, diverged, timeout, error or skipped."),
    "reason": Column("reason", "", "Why a cell is not done, or what is to be said of one that is."),
    "digest": Column("digest", "", "sha256 of all factors that the backend was given, taken inside the cell."),
    "truth_kind": Column(
        "known path",
        "",
        "truth: where the robot was. reference: the batch optimum, where nobody knows. Blank: neither.",
    ),
    "steps": Column("steps", "", "Keyframes of the log."),
    "sightings": Column("sightings", "", "Landmark sightings in it."),
    "ignored": Column("ignored", "", "Sightings of unknown landmarks, left out for a backend that cannot place them."),
    "landmarks": Column(
        "landmarks",
        "",
        "Landmarks in the final map, in the online map where there is no final one; those of a given map included.",
    ),
    "ate_m": Column(
        "ATE online",
        "m",
        "Absolute trajectory error: root mean square of the distance between the path of the poses given step by step "
        "and the known path, after the best rotation and translation of the plane (no reflection, no scale).",
    ),
    "ate_origin_m": Column("ATE from the origin", "m", "The same without alignment: both paths start at the prior."),
    "heading_rad": Column("heading", "rad", "Root mean square of the wrapped heading error, online, aligned."),
    "rpe_m": Column(
        "RPE",
        "m",
        "Relative pose error: how far the online path's motion over each metre of the known path is off, root mean "
        "square over the pieces, which follow one another (evo_rpe -d 1 -u m --pairs_from_reference). Not aligned: it "
        "does not depend on that. Blank where the path is shorter.",
    ),
    "map_rmse_m": Column(
        "map",
        "m",
        "Root mean square distance of the online map's landmarks from the known ones, aligned as the path; those of a "
        "given map are among them. Where the landmarks' places are known and the path is not, aligned by themselves.",
    ),
    "nees": Column(
        "NEES / 3",
        "1",
        "Normalised estimation error squared of the online pose over its 3 degrees of freedom, mean over the steps: 1 "
        "where a belief is as wide as its errors. Not aligned. The word beside it is that of the 95 % interval of the "
        "median over logs: overconfident where all of it is above 1.25; cautious where it is below 0.7 (a run whose "
        "errors are all one error has a median of 0.79); consistent where it is within 0.5 to 2 and neither holds; "
        "otherwise no word. With fewer than 6 logs it is a rule of thumb: overconfident where every run is above 2 and "
        "less than 90 % of its steps are inside; cautious where every run is below 0.5; consistent where all are "
        "between and at least 85 % are inside.",
    ),
    "nees_inside": Column("inside 95 %", "", "Share of steps whose NEES is below chi-square's 95 % point, 7.81."),
    "nis": Column("NIS", "1", "Normalised innovation squared over its degrees of freedom, over all sightings."),
    "final_ate_m": Column("ATE final", "m", "As ATE online, of the path smoothed over the whole log at its end."),
    "final_ate_origin_m": Column("ATE final from the origin", "m", "The same without alignment."),
    "final_map_rmse_m": Column("map final", "m", "As map, of the map at the end of smoothing."),
    "cost_j": Column(
        "J",
        "1",
        "What batch SLAM minimises: the squared residuals of all factors, weighted by their stated covariances, at the "
        "final path and map, at the online ones where there are no final ones. A given map with covariance is part of "
        "the prior. Needs no known path.",
    ),
    "step_us_mean": Column("step mean", "µs", "Process CPU time of a step, mean over the log."),
    "step_us_p50": Column("step p50", "µs", "Process CPU time of a step: half of them cost less."),
    "step_us_p95": Column("p95", "µs", "95 % of steps cost less."),
    "step_us_p99": Column("p99", "µs", "99 % of steps cost less."),
    "step_us_max": Column("max", "µs", "The slowest step."),
    "belief_us_mean": Column("belief", "µs", "Asking for the belief after a step: covariance included, not in step."),
    "finish_s": Column("finish", "s", "CPU time of the smoothing at the end of the log."),
    "setup_s": Column("set-up", "s", "CPU time of making the backend."),
    "cpu_s": Column("whole log", "s", "CPU time of set-up, all steps and finish."),
    "peak_mb": Column(
        "memory",
        "MB",
        "How much the process grew over what it held before the backend was made; blank where inner loops "
        "had to be compiled meanwhile.",
    ),
    "timing_alone": Column(
        "alone", "", "0: other cells ran at the same time, so the times are marked * and are worth less."
    ),
}
"""By name, in the order of cells.csv."""

ONLINE: dict[str, Column] = {
    "align_x_m": Column("alignment x", "m", "The motion that is put on the path before its ATE is taken: translation."),
    "align_y_m": Column("alignment y", "m", "Likewise."),
    "align_rad": Column(
        "alignment", "rad", "Likewise: the rotation, about the origin, before the translation. 0 for a straight path."
    ),
    "rpe_10m_m": Column("RPE, 10 m", "m", "As RPE, over each 10 m of the known path."),
    "rpe_100m_m": Column("RPE, 100 m", "m", "As RPE, over each 100 m of the known path."),
    "rpe_1s_m": Column(
        "RPE, 1 s",
        "m",
        "As RPE, over each second, between the poses nearest to that in time; a pair that is off by more than a tenth "
        "is left out. Blank where the log's times are its step numbers.",
    ),
    "rpe_10s_m": Column("RPE, 10 s", "m", "Likewise, over each 10 s."),
    "rpe_rad": Column("RPE, rotation", "rad", "How far the turn over each metre of the known path is off."),
    "landmarks_missed": Column(
        "missed", "", "Landmarks whose places are known and that the log sights, but that the map has not."
    ),
    "landmarks_spurious": Column("spurious", "", "Landmarks of the map that are none of the known ones."),
    "landmark_nees": Column(
        "landmark NEES / 2",
        "1",
        "Normalised estimation error squared of a landmark over its 2 degrees of freedom, mean over the map: 1 where "
        "the map is as uncertain as its errors are large. From the known start, not aligned; without landmarks that "
        "were given as exact.",
    ),
    "landmark_nees_inside": Column(
        "landmarks inside 95 %", "", "Share of landmarks whose NEES is below chi-square's 95 % point, 5.99."
    ),
}
"""Those columns of metrics.csv that there are of the online path and map, and again of the final ones."""

FINAL: dict[str, Column] = {
    f"final_{name}": Column(
        f"{column.heading} final", column.unit, f"As {column.heading}, of the path and map at the end of smoothing."
    )
    for name, column in {
        **{name: column for name, column in ONLINE.items() if name.startswith("align")},
        **{name: COLUMNS[name] for name in ("heading_rad", "rpe_m")},
        **{name: column for name, column in ONLINE.items() if name.startswith("rpe")},
        **{name: COLUMNS[name] for name in ("nees", "nees_inside")},
        **{name: column for name, column in ONLINE.items() if name.startswith("landmark")},
    }.items()
}
"""Of a particle filter the final map's covariance is what it is given the path of one particle."""

MORE: dict[str, Column] = {
    "length_s": Column("length", "s", "Time that the log covers. Blank where its times are its step numbers."),
    "real_time": Column(
        "of real time",
        "",
        "CPU time of all steps over the time the log covers: below 100 % the backend keeps up. Blank where the log's "
        "times are its step numbers, and for a batch method, which does nothing in its steps.",
    ),
    **ONLINE,
    **FINAL,
    **{
        f"step_us_fifth{k}": Column(
            f"{word} fifth", "µs", f"CPU time of a step, mean over the {word} fifth of the run."
        )
        for k, word in enumerate(("first", "second", "third", "fourth", "last"), start=1)
    },
    "growth_steps": Column(
        "growth with steps",
        "1",
        "The exponent b with which the cost of a step grows with its number k, as k to the power b: at 0 it does not "
        "grow, at 1 it is twice as much twice as far into the run. Fitted to the means of stretches that grow in "
        "proportion, so that rare expensive steps count; a constant part is told apart where there clearly is one. "
        "Beside it its standard error, the median over logs; blank where that is above 0.25, or the run is too short.",
    ),
    "growth_steps_se": Column("± with steps", "1", "Standard error of that exponent."),
    "growth_landmarks": Column(
        "growth with landmarks",
        "1",
        "The same with the number of landmarks that were sighted or given by then. Each exponent stands for itself: "
        "where the map grows all along the run, the same growth shows in both.",
    ),
    "growth_landmarks_se": Column("± with landmarks", "1", "Standard error of that exponent."),
    "j_prior": Column("prior", "1", "The part of J that the start pose, and a given map with covariance, account for."),
    "j_odometry": Column("odometry", "1", "The part of J that the motions between keyframes account for."),
    "j_sightings": Column("sightings", "1", "The part of J that the sightings of landmarks account for."),
    "j_loops": Column("loops", "1", "The part of J that the loop closures account for."),
    "j_final": Column("J, final path", "1", "J of the path and map smoothed over the whole log: the sum of its parts."),
    "j_online": Column(
        "J, online path",
        "1",
        "J of the path of the poses given step by step, and of the last map. A sighting moves such a path at a stroke, "
        "by what no odometry has reported: a filter's J is large by nature, and no measure of its accuracy.",
    ),
    "n_eff_least": Column(
        "fewest effective particles",
        "",
        "The lowest effective sample size, 1 / sum of squared weights, after any step: few particles carried all the "
        "weight then.",
    ),
    "ancestors_left": Column(
        "ancestors left",
        "",
        "How many of the particles at the start those at the end descend from: of one, all share a single early path.",
    ),
    "refused_share": Column("refused", "", "Share of the sightings that the backend's gate kept out."),
}
"""By name, in the order of metrics.csv, where they follow what names the cell."""

WORKED_OUT: dict[str, Column] = {
    "done": Column("done", "", "Cells that are done, of all."),
    "implementation": Column(
        "implementation",
        "",
        "Whose program the backend is. Compiled here: kernels of slamduel, compiled for this processor. GTSAM's wheel: "
        "GTSAM as published, compiled for any processor, and called from Python. What comes from elsewhere says so "
        "itself, or is named by what installed it. Costs compare these programs as much as the algorithms.",
    ),
    **MORE,
}
"""Columns that are in the report's tables, beside those of cells.csv."""

TIMES = frozenset(
    name
    for name in (*COLUMNS, *MORE)
    if name.startswith(("step_us_", "belief_us_")) or name in ("setup_s", "finish_s", "cpu_s", "real_time")
)
"""Columns of times taken, which are marked * where other cells ran beside."""

PAIRS: dict[str, Column] = {
    "second": Column("against", "", "The second backend of the pair."),
    "measure": Column("measure", "", "Whose errors are compared."),
    "ratio": Column(
        "ratio",
        "1",
        "The second one's error over the first one's on the same logs, typically: the Hodges-Lehmann estimate, the "
        "median of the averages of every two logarithms of these ratios. Beside it its 95 % interval, of the ratios "
        "that the signed-rank test does not reject.",
    ),
    "verdict": Column("verdict", "", "What may be said of the first one: both the test and the interval must bear it."),
    "adjusted": Column(
        "p",
        "1",
        "Wilcoxon's signed-rank test, two-sided, after Holm's correction over all pairs of a measure; comparisons with "
        "dead reckoning are corrected among themselves.",
    ),
    "effect": Column("effect", "1", "Matched-pairs rank-biserial correlation: 1 where the first is always closer."),
    "closer": Column("closer on", "", "Logs on which the first one's error is the lower, of those that both ran on."),
}
"""The columns of the table of pairs, by their names in JSON."""

STATISTICS: dict[str, Column] = {
    "median": Column(
        "median",
        "",
        "Over logs; what several runs on one log have is averaged first. A cell that failed has an infinite error.",
    ),
    "interval": Column(
        "95 % interval",
        "",
        "Beside a median, from 6 logs on: between order statistics, interpolated as by Hettmansperger and Sheather "
        "(1986). Of fewer logs it is the range.",
    ),
    "best": Column(
        "bold", "", "Those that the most accurate one is not better than for sure; nothing is where it beats nobody so."
    ),
    "baseline": Column(
        "dead-reckoning", "", "What everybody has to beat: it uses no sighting, and neither competes nor is ranked."
    ),
    **PAIRS,
}
"""What the words of tables and verdicts stand for."""
