"""What each column means, with its unit: the columns of cells.csv, and those that the report works out from them."""

from typing import NamedTuple


class Column(NamedTuple):
    """A column of cells.csv or of the report's tables."""

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
    "rpe_m": Column("RPE", "m", "Relative pose error of the online path over each metre of the known path, by evo."),
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
        "where a belief is as wide as its errors. Not aligned. The word beside it is a rule of thumb and no test: "
        "overconfident where every seed is above 2 and less than 90 % of steps are inside; cautious where every seed "
        "is below 0.5; consistent where all are between and at least 85 % are inside; otherwise no word.",
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
    "peak_mb": Column("memory", "MB", "How much the process grew over what it held before the backend was made."),
    "timing_alone": Column(
        "alone", "", "0: other cells ran at the same time, so the times are marked * and are worth less."
    ),
}
"""By name, in the order of cells.csv."""

WORKED_OUT: dict[str, Column] = {
    "done": Column("done", "", "Cells that are done, of all."),
    "real_time": Column(
        "of real time",
        "",
        "CPU time of all steps over the time the log covers: below 100 % the backend keeps up. Blank where the log's "
        "times are its step numbers.",
    ),
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
"""Columns that are in the report's tables alone."""
