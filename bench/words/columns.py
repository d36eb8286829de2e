"""The table of columns: those of cells.csv and of metrics.csv, and with `report_columns` all by name.

A column's entry is the only place that describes it. A new one is an entry at the end of METRICS, and the code in
bench/measure that computes its value.
"""

from collections.abc import Iterator

from . import column as kind
from .column import Column
from .report_columns import REPORT

DEADLINES_MS = (1, 10, 100)  # the periods of robots that steps are counted against

CONSTANTS = (
    ("range_scale", "", "range scale", kind.SIGNED, kind.NUMBER, "Share by which ranges are too long: "),
    ("range_offset", "_m", "range offset", kind.METRES, kind.BOUND_M, "What all ranges have too much: "),
    ("heading_offset", "_rad", "heading offset", kind.RADIANS, kind.SD_RAD, "What measured headings have too much: "),
    ("wheel_scale", "", "wheel scale", kind.SIGNED, kind.NUMBER, "Share by which the ways of odometry are too long: "),
    ("gyro_bias", "_rad_s", "gyro bias", kind.TURN_RATE, kind.SD_TURN_RATE, "The gyro's bias at the end: "),
)  # fmt: skip
"""Constant errors of sensors: name, unit at the end of columns, heading, kinds of a value and its sd, meaning."""

CELLS = (
    Column("dataset", "dataset", kind.NAME, "The dataset's name."),
    Column("dataset_options", "options", kind.NAME, "The dataset's options, as given on the command line."),
    Column("backend", "backend", kind.NAME, "The backend's name."),
    Column("options", "options", kind.NAME, "The backend's options, as given on the command line."),
    Column("seed", "seed", kind.SEED,
           "Number of the log. A backend's randomness is drawn from it and the backend's label."),
    Column("status", "status", kind.TEXT, "done, diverged, timeout, error or skipped."),
    Column("reason", "reason", kind.TEXT, "Why a cell is not done, or a remark on one that is."),
    Column("digest", "digest", kind.TEXT,
           "sha256 of all factors that the backend was given, computed inside the cell."),
    Column("truth_kind", "known path", kind.TEXT,
           "What errors are measured from: truth, the ground truth; relations, true motions between pairs of poses, "
           "where no true path is known; reference, the batch optimum of a log without ground truth. Blank: none is "
           "known."),
    Column("steps", "steps", kind.COUNT, "Keyframes of the log."),
    Column("sightings", "sightings", kind.COUNT, "Landmark sightings in the log."),
    Column("ignored", "ignored", kind.COUNT,
           "Sightings of unknown landmarks, left out where a backend cannot associate them."),
    Column("landmarks", "landmarks", kind.COUNT,
           "Landmarks of the final map, or of the online map where there is no final one; those of a given map "
           "included."),
    Column("ate_m", "ATE online", kind.ERROR_M,
           "Absolute trajectory error: root mean square distance of the online path, the poses given step by step, "
           "from the known path, after the best rotation and translation in the plane (no reflection, no scale). Blank "
           "where that is known at fewer than 3 steps, or in one place."),
    Column("ate_origin_m", "ATE from the origin", kind.ERROR_M, "As ATE online, not aligned: both start at the prior."),
    Column("heading_rad", "heading", kind.ERROR_RAD,
           "Root mean square of the wrapped heading error, online, aligned.", "error of the heading"),
    Column("rpe_m", "RPE", kind.ERROR_M,
           "Relative pose error: error of the online path's motion over each metre of the known path, root mean square "
           "over consecutive pieces (evo_rpe -d 1 -u m --pairs_from_reference). It does not depend on the alignment. "
           "Blank where the path is shorter."),
    Column("map_rmse_m", "map", kind.ERROR_M,
           "Root mean square distance of the online map's landmarks from the known ones, aligned as the path; the "
           "landmarks of a given map count. Where landmarks are surveyed and the path is not known, aligned by itself.",
           "error of the map"),
    Column("nees", "NEES / 3", kind.NEES,
           "Normalised estimation error squared of the online pose over its 3 degrees of freedom, mean over the steps: "
           "1 where the covariances match the errors. Not aligned. The word beside it is from the 95 % interval of the "
           "median over logs: overconfident where the whole interval is above 1.25; cautious where it is below 0.7 (if "
           "all errors of a run are a single error, the median is 0.79); consistent where it is within 0.5 to 2 and "
           "neither holds; otherwise no word. With fewer than 6 logs a rule of thumb is used: overconfident where "
           "every run is above 2 and less than 90 % of its steps are inside; cautious where every run is below 0.5; "
           "consistent where all are between and at least 85 % are inside."),
    Column("nees_inside", "inside 95 %", kind.INSIDE_95,
           "Share of steps whose NEES is below the 95 % point of chi-square, 7.81.", "share of steps inside 95 %"),
    Column("nis", "NIS", kind.NEES,
           "Normalised innovation squared over its degrees of freedom, over all sightings and loop closures."),
    Column("final_ate_m", "ATE final", kind.ERROR_M, "As ATE online, of the path smoothed at the end of the log."),
    Column("final_ate_origin_m", "ATE final from the origin", kind.ERROR_M, "As ATE final, not aligned."),
    Column("final_map_rmse_m", "map final", kind.ERROR_M,
           "As map, of the map smoothed at the end.", "error of the final map"),
    Column("cost_j", "J", kind.NUMBER,
           "What batch SLAM minimises: the squared residuals of all factors, weighted by their stated covariances, at "
           "the final path and map, at the online ones where there are no final ones. A given map with covariance is "
           "part of the prior. Needs no ground truth."),
    Column("step_us_mean", "step mean", kind.CPU_US, "CPU time of a step, mean over the log.", "mean time of a step"),
    Column("step_us_p50", "step p50", kind.CPU_US, "50 % of the steps take less CPU time.", "median time of a step"),
    Column("step_us_p95", "p95", kind.CPU_US,
           "95 % of the steps take less CPU time.", "95th percentile of a step's time"),
    Column("step_us_p99", "p99", kind.CPU_US,
           "99 % of the steps take less CPU time.", "99th percentile of a step's time"),
    Column("step_us_max", "max", kind.CPU_US, "CPU time of the slowest step.", "longest time of a step"),
    Column("belief_us_mean", "belief", kind.CPU_US,
           "CPU time of asking for the belief after a step, covariance included. Not part of the step's time.",
           "mean time of a belief"),
    Column("finish_s", "finish", kind.CPU_S, "CPU time of the smoothing at the end of the log.", "time of the finish"),
    Column("setup_s", "set-up", kind.CPU_S, "CPU time of making the backend.", "time of the set-up"),
    Column("cpu_s", "whole log", kind.CPU_S, "CPU time of set-up, all steps and finish.", "time of the whole log"),
    Column("peak_mb", "memory", kind.MEGABYTES,
           "Largest growth of the process over what it held before the backend was made. Blank where inner loops were "
           "compiled meanwhile."),
    Column("timing_alone", "alone", kind.COUNT,
           "0: other cells ran at the same time, so times are marked * and less exact."),
    Column("bound_m", "bound online", kind.BOUND_M,
           "Cramer-Rao bound of ATE online: what an efficient filter has, whose covariance is the inverse of the "
           "information of all factors up to each step, linearised at the true path and landmarks, with the noise as "
           "stated and the true ids. Blank without a true path and places of all landmarks, and where the log has more "
           "than some 400 of these."),
    Column("final_bound_m", "bound final", kind.BOUND_M,
           "Likewise of ATE final, by all factors: no unbiased estimator has less on average over logs."),
    *(
        Column(f"over_{ms}ms", f"above {ms} ms", kind.CPU_SHARE,
               f"Share of the steps that take more than {ms} ms of CPU time: a robot that needs a pose every {ms} ms "
               "does not have it in time there. Blank for a batch method, which does nothing in its steps.",
               f"share of steps above {ms} ms")
        for ms in DEADLINES_MS
    ),
)  # fmt: skip
"""The columns of cells.csv, in order; other tools read them, so new ones come last."""

ONLINE = (
    Column("align_x_m", "alignment x", kind.METRES, "Translation of the path before its ATE is taken, along x."),
    Column("align_y_m", "alignment y", kind.METRES, "Translation of the path before its ATE is taken, along y."),
    Column("align_rad", "alignment", kind.RADIANS,
           "Rotation about the origin, before that translation. 0 for a straight path."),
    Column("rpe_10m_m", "RPE, 10 m", kind.ERROR_M, "As RPE, over each 10 m of the known path."),
    Column("rpe_100m_m", "RPE, 100 m", kind.ERROR_M, "As RPE, over each 100 m of the known path."),
    Column("rpe_1s_m", "RPE, 1 s", kind.ERROR_M,
           "As RPE, over each second, between the poses nearest in time. A pair whose duration is off by more than a "
           "tenth is left out. Blank where the log's times are its step numbers."),
    Column("rpe_10s_m", "RPE, 10 s", kind.ERROR_M, "As RPE, 1 s, over each 10 s."),
    Column("rpe_rad", "RPE, rotation", kind.ERROR_RAD, "As RPE, of the turn over each metre of the known path."),
    Column("landmarks_missed", "missed", kind.COUNT,
           "Landmarks with known places that are sighted but not in the map."),
    Column("landmarks_spurious", "spurious", kind.COUNT, "Landmarks of the map that are none of the known ones."),
    Column("landmark_nees", "landmark NEES / 2", kind.NEES,
           "Normalised estimation error squared of a landmark over its 2 degrees of freedom, mean over the map: 1 "
           "where the map's covariances match its errors. From the known start, not aligned; without landmarks that "
           "were given as exact."),
    Column("landmark_nees_inside", "landmarks inside 95 %", kind.INSIDE_95,
           "Share of landmarks whose NEES is below the 95 % point of chi-square, 5.99."),
    Column("nees_void", "not a covariance", kind.COUNT,
           "Steps whose pose has a covariance that is none: not symmetric, not positive definite, or with a standard "
           "deviation below 2.2e-16 of a coordinate, or of 1 m or rad where that is larger: finer than numbers are. "
           "They have no NEES, and count as outside 95 %. A backend with such a step is called neither consistent nor "
           "cautious.", "steps without a usable covariance"),
    Column("landmark_nees_void", "landmarks, not a covariance", kind.COUNT,
           "Landmarks of the map whose covariance is none, likewise.", "landmarks without a usable covariance"),
    Column("pair_precision", "pair precision", kind.SHARE,
           "Data association: of the pairs of sightings that the backend took to be of one landmark, the share that "
           "are. 100 % where no landmark got another's sightings."),
    Column("pair_recall", "pair recall", kind.SHARE,
           "Of the pairs of sightings that are of one landmark, the share that the backend took to be. A sighting that "
           "was dropped is in no pair."),
    Column("wrong_share", "wrong", kind.SHARE,
           "Of the sightings used, the share that are not of the landmark that most sightings of their id are of.",
           "share of wrong associations"),
    Column("dropped_share", "dropped", kind.SHARE,
           "Of all sightings, the share that were used for no landmark: between two gates, or not confirmed.",
           "share of dropped sightings"),
    Column("landmarks_merged", "merged", kind.COUNT,
           "Landmarks whose sightings were used only for others: no id has its most sightings from them."),
    Column("landmarks_double", "double", kind.COUNT, "Surplus ids of landmarks that have several."),
    Column("landmarks_clutter", "clutter", kind.COUNT, "Ids whose sightings are mostly of no landmark."),
    Column("ate_median_m", "ATE, median", kind.ERROR_M,
           "As ATE online, the median distance: a few large errors of the path, or of ground truth by GPS, do not move "
           "it."),
    Column("relation_m", "relations online", kind.ERROR_M,
           "Error of relations (Kuemmerle et al., 2009): how far the motion between two poses of the online path is "
           "from the true one, mean over all pairs whose true motion is known. Pairs of the very scans are used where "
           "there are 500 of them, else also those at times between two scans. Not aligned.", "error of relations"),
    Column("relation_deg", "rotation of relations", kind.ERROR_DEG, "Likewise, of the turn between the two poses.",
           "error of relations, rotation"),
    Column("relation_se_m", "se of relations", kind.ERROR_M,
           "Standard error of the mean of the error in m, from the means of 20 stretches of the log, as neighbouring "
           "pairs have similar errors. Blank where there are fewer than 40 pairs."),
    Column("relation_se_deg", "se of their rotation", kind.ERROR_DEG, "Likewise, of the turn."),
    Column("relation_sd_m", "sd of relations", kind.ERROR_M, "Standard deviation of the error in m, over the pairs."),
    Column("relation_max_m", "worst relation", kind.ERROR_M, "The largest error of such a pair."),
    Column("relation_sd_deg", "sd of their rotation", kind.ERROR_DEG, "Likewise, of the turn."),
    Column("relation_max_deg", "worst rotation", kind.ERROR_DEG, "The largest error of a turn."),
)  # fmt: skip
"""The columns of metrics.csv that exist for the online path and map, and again for the final ones."""


def _final() -> Iterator[Column]:
    """Yields those of the final path and map; a particle filter's map covariance is given one particle's path."""
    starts = (
        "align", "heading", "rpe", "nees", "landmarks_", "landmark_", "pair_", "wrong_", "dropped_", "ate_median",
        "relation_",
    )  # fmt: skip
    online = (column for start in starts for column in (*CELLS, *ONLINE) if column.name.startswith(start))
    for column in online:
        yield Column(
            f"final_{column.name}",
            f"{column.heading} final",
            column.kind,
            f"As {column.heading}, of the path and map smoothed at the end.",
            column.said and f"{column.said}, final path",
        )


FINAL = tuple(_final())

MACHINE = (
    Column("work_us", "fixed work", kind.CPU_US,
           "CPU time of a fixed piece of work, just before and after the backend was timed: longer where the processor "
           "is slower, or shared with somebody."),
    Column("waited_share", "waited", kind.CPU_SHARE,
           "Share of the time that the backend ran, by the clock on the wall, in which others had its core."),
    Column("switches", "switches", kind.MACHINE, "How often the system gave the backend's core to another process."),
    Column("others_share", "others", kind.CPU_SHARE,
           "Share of all cores that other processes took meanwhile. Blank where the system does not say, and for runs "
           "of less than 0.1 s, which it does not resolve."),
    Column("stolen_share", "stolen", kind.CPU_SHARE, "Likewise, the share taken by other virtual machines."),
    Column("load", "load", kind.MACHINE, "The system's load average over the minute before, this process included."),
    Column("clock_mhz", "clock, MHz", kind.MACHINE,
           "Clock frequency that the system states, mean of the cores. A virtual machine may state one that it does "
           "not have."),
)  # fmt: skip
"""What the machine did while a backend was timed; part of METRICS."""

TIMED = (
    "step_us_mean", "step_us_p50", "step_us_p95", "step_us_p99", "step_us_max", "finish_s", "setup_s", "cpu_s",
    *(column.name for column in MACHINE), *(f"over_{ms}ms" for ms in DEADLINES_MS),
)  # fmt: skip
"""The columns that every repeat of a cell measures again."""

METRICS = (
    Column("length_s", "length", kind.SECONDS, "Time that the log covers. Blank where its times are its step numbers."),
    Column("real_time", "of real time", kind.CPU_SHARE,
           "CPU time of all steps over the time that the log covers: below 100 % the backend keeps up. Blank where the "
           "log's times are its step numbers, and for a batch method, which does nothing in its steps."),
    *ONLINE,
    *FINAL,
    *(
        Column(
            f"step_us_fifth{k}",
            f"{word} fifth",
            kind.CPU_US,
            f"CPU time of a step, mean over the {word} fifth of the run.",
            f"mean time of a step in the {word} fifth",
        )
        for k, word in enumerate(("first", "second", "third", "fourth", "last"), start=1)
    ),
    Column("growth_steps", "growth with steps", kind.EXPONENT,
           "The exponent b where the cost of step k grows as k to the power b: at 0 it does not grow, at 1 it doubles "
           "when k doubles. Fitted to the mean costs of intervals whose lengths grow with k, so that rare expensive "
           "steps count; a constant part is fitted apart where there clearly is one. Beside it its standard error, "
           "median over logs. Blank where that is above 0.25, or the run is too short."),
    Column("growth_steps_se", "± with steps", kind.EXPONENT, "Standard error of growth with steps."),
    Column("growth_landmarks", "growth with landmarks", kind.EXPONENT,
           "As growth with steps, with the number of landmarks sighted or given so far in place of k. Where the map "
           "grows all along the run, the same growth shows in both."),
    Column("growth_landmarks_se", "± with landmarks", kind.EXPONENT, "Standard error of growth with landmarks."),
    Column("j_prior", "prior", kind.NUMBER, "The part of J from the start pose, and from a given map with covariance."),
    Column("j_odometry", "odometry", kind.NUMBER, "The part of J from the motions between keyframes."),
    Column("j_sightings", "sightings", kind.NUMBER, "The part of J from the sightings of landmarks."),
    Column("j_loops", "loops", kind.NUMBER, "The part of J from the loop closures."),
    Column("j_final", "J, final path", kind.NUMBER, "J of the path and map smoothed at the end: the sum of its parts."),
    Column("j_online", "J, online path", kind.NUMBER,
           "J of the online path and the last map. A sighting moves such a path by a jump that no odometry has "
           "reported: a filter's J is large by nature, and is no measure of its accuracy."),
    Column("n_eff_least", "fewest effective particles", kind.NUMBER,
           "The lowest effective sample size, 1 / sum of squared weights, after any step. Where it is low, few "
           "particles carried all the weight."),
    Column("ancestors_left", "ancestors left", kind.COUNT,
           "Particles at the start that those at the end descend from. 1: all share a single early path."),
    Column("refused_share", "refused", kind.SHARE,
           "Share of the sightings and loop closures that the backend's gate rejected."),
    Column("loops_rejected", "loops rejected", kind.COUNT,
           "Loop closures that the final path contradicts: beyond what 999 of 1,000 correct ones stay within by their "
           "stated noise, however the backend treats them. Blank without a final path, and of backends that take no "
           "loops.", "loop closures that the final path rejects"),
    Column("loop_precision", "loop precision", kind.SHARE,
           "Of the loop closures that the final path rejects, the share that are false. Blank where it rejects none, "
           "or it is not known which are false (false_loops=).", "share of rejected loop closures that are false"),
    Column("loop_recall", "loop recall", kind.SHARE,
           "Of the false loop closures, the share that the final path rejects. Blank where none is known.",
           "share of false loop closures that are rejected"),
    Column("moved_out", "taken out", kind.COUNT,
           "Landmarks taken out of the log because they have moved, with moved=out.", "landmarks taken out as moved"),
    Column("moved_found", "movers found", kind.SHARE,
           "Of the landmarks that move and are sighted, the share that was taken out. Blank where none moves.",
           "share of moving landmarks taken out"),
    Column("moved_false", "taken out though standing", kind.COUNT,
           "Landmarks taken out that do not move. Blank where their places are not known."),
    Column("misread_share", "misread", kind.SHARE,
           "Of all sightings, the share left out because they do not fit their landmark, which has not moved: the id "
           "was misread.", "share of sightings left out as misread"),
    Column("associate_us_p50", "association p50", kind.CPU_US,
           "CPU time of data association in a step, part of the step's: asking the backend what it expects, and the "
           "decision. Median over the steps with sightings without an id."),
    Column("associate_us_p99", "association p99", kind.CPU_US, "Likewise, the 99th percentile."),
    Column("nodes_max", "largest search", kind.COUNT,
           "Most nodes of a step's search by joint compatibility; of the other rules, pairs of sightings and "
           "landmarks."),
    Column("told", "given the ground truth", kind.COUNT,
           "1: the backend was given the ground truth (--oracle) and linearised there, so it is not compared with "
           "others."),
    Column("relations", "relations", kind.COUNT, "Pairs of poses that errors of relations are means over."),
    Column("relations_exact", "exact relations", kind.COUNT,
           "Of these, the pairs of the very scans: no pose is interpolated."),
    Column("surveyed", "landmarks surveyed", kind.COUNT,
           "1: the true places of the landmarks are known, the true path is not. The map is measured from these "
           "places."),
    Column("reference", "reference", kind.TEXT,
           "What the path is measured from where it is neither exact ground truth nor the plain batch optimum; NEES is "
           "computed for exact ground truth alone."),
    Column("no_bound", "no bound", kind.TEXT, "Why there is no Cramer-Rao bound, where the true path is known."),
    Column("located_share", "located", kind.SHARE,
           "Share of the steps from the one on at which the robot is found on the given map. Errors of its path are "
           "those at these steps. Blank where the start is known."),
    Column("wrong_fix_share", "at a wrong place", kind.SHARE,
           "Share of the located steps whose online pose is at another place: farther from the true one than half of "
           "the map's landmarks are from their nearest other one, or turned by more than 30 degrees. Not aligned."),
    Column("locate_steps", "steps to locate", kind.COUNT, "Steps until the robot is first found on the given map."),
    Column("locate_ms", "time to locate", kind.CPU_MS,
           "CPU time of these steps, those in which nothing is seen included, and the steps that the backend is given "
           "at once where the robot is found."),
    Column("log_name", "log", kind.PLANNED,
           "Name of the log within a dataset of many logs. Blank where the dataset is one log, or draws them."),
    Column("cluster", "cluster", kind.PLANNED,
           "Logs of one cluster share a run, a robot or a building, and are not independent of each other. Blank: the "
           "log is independent of all others."),
    Column("repeats", "repeats", kind.COUNT,
           "Rounds in which the cell was timed (--repeats; by default 5 if it is small), each in a process of its own: "
           "times are medians over them. With 1, every time was measured once."),
    *(
        Column(name, f"{heading}, {end}", unit,
               f"The {end} end of the 95 % interval of {heading} over the repeats, for this log and the machine as it "
               "was. Blank with fewer than 3.")
        for name, heading, unit, end in (
            ("step_us_p50_low", "step p50", kind.CPU_US, "lower"),
            ("step_us_p50_high", "step p50", kind.CPU_US, "upper"),
            ("cpu_low_s", "whole log", kind.CPU_S, "lower"),
            ("cpu_high_s", "whole log", kind.CPU_S, "upper"),
        )
    ),
    *MACHINE,
    Column("over_bound", "over the bound", kind.NUMBER,
           "ATE online over its Cramer-Rao bound. Below 1 by chance: the bound is of the mean over logs.",
           "error of the path over its bound"),
    Column("final_over_bound", "final over the bound", kind.NUMBER, "Likewise ATE final over its bound.",
           "error of the final path over its bound"),
    Column("bound_origin_m", "bound from the origin", kind.BOUND_M,
           "As bound online, of ATE from the origin, which is not aligned."),
    Column("final_bound_origin_m", "bound final from the origin", kind.BOUND_M, "Likewise, of ATE final."),
    Column("late_share", "late", kind.CPU_SHARE,
           "Share of the steps that take more CPU time than there is until the log's next step: above 0 a robot waits "
           "for its pose there, though it may catch up. Blank as real time is.", "share of late steps"),
    Column("last_over_first", "last over first", kind.CPU_RATIO,
           "Mean cost of a step in the last fifth of the log over that in the first fifth.",
           "cost of the last fifth over the first"),
    Column("whole_from", "map whole from", kind.COUNT,
           "Step after which 99 % of all landmarks that are ever sighted or given are known. Blank without landmarks."),
    Column("slope_steps", "slope with steps", kind.EXPONENT,
           "Slope of the logarithm of the cost of step k over that of k, by least squares through the means of ten "
           "equal shares of the steps: at 0.5 a step costs twice as much when k is four times as large. Over the steps "
           "since the map is whole if that is within 60 % of the log, else over all; without the log's first 5 % "
           "in any case. Growth with steps is of what grows, without a constant part; this is of all that a step "
           "costs. Beside it its 95 % interval: over 6 logs and more that of their median, else Student's within a "
           "log, a median over logs. Blank with fewer than 1,000 steps.",
           "slope of the cost of a step"),
    Column("slope_mapping", "slope while mapping", kind.EXPONENT,
           "As slope with steps, over the steps before the map is whole, without their first 5 %. Blank where these "
           "are fewer than 1,000, and where slope with steps is over all.",
           "slope of the cost of a step while the map grows"),
    *(
        Column(f"{name}_{end}", f"{called}, {end}", kind.EXPONENT,
               f"The {word} end of its 95 % interval: Student's, of one log and the machine as it was.")
        for name, called in (("slope_steps", "slope with steps"), ("slope_mapping", "slope while mapping"))
        for end, word in (("low", "lower"), ("high", "upper"))
    ),
    Column("slope_from", "slope from", kind.COUNT, "The first step of those that slope with steps is over."),
    Column("last_over_whole", "last over whole", kind.CPU_RATIO,
           "Mean cost of a step in the last fifth of the log over that in the first fifth that begins with the whole "
           "map. Blank where that is the last one.", "cost of the last fifth over the first with the whole map"),
    *(
        Column(f"{name}{suffix}{unit}", f"{called}{word}", kind_of if suffix != "_sd" else spread,
               f"{meaning}{words}", f"{called}{word}")
        for name, unit, called, kind_of, spread, meaning in CONSTANTS
        for suffix, word, words in (
            ("", "", ("as the backend has estimated it by the log's end. Blank where it does not, and where the "
                     "log's prior has none. The median over landmarks where each has its own.")),
            ("_sd", ", its sd", "the standard deviation that the backend states for it."),
            ("_true", ", true", ("the true value: that which a simulated world has drawn or, where path and landmarks "
                                "are known, the one that fits the measurements best there.")),
        )
    ),
)  # fmt: skip
"""The columns of metrics.csv after those that name the cell, in order."""

COLUMNS = {column.name: column for column in (*CELLS, *METRICS, *REPORT)}
"""Every column by its name."""


def about(name: str) -> Column:
    """The column of that name; a plain number where only another version of slamduel knows it."""
    return COLUMNS.get(name) or Column(name, name.replace("_", " "), kind.NUMBER, "")
