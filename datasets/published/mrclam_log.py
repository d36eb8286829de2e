"""One robot's log of a set of MRCLAM: the options of its noise, its factors and its ground truth.

The log spans the time for which odometry and ground truth both exist, and starts at the true pose. Of a robot without
a file of ground truth, as in copies that leave the paths out, it spans the time of the odometry and starts at the
origin, which only fixes the frame; the landmarks' places alone are its truth, by which maps are judged. Keyframes are
the times of the sightings that are kept and every full second between; the motion up to each is one factor. The files
have no covariances: those of the factors follow from the options, the motion's in the body frame before it.
"""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.factors import REMARKS, UNKNOWN, Dataset, Log, Prior, Truth
from ...core.options import option
from ...core.se2 import Array, Ints, wrap
from ...core.table import Table
from ...frontend.wheels.encoder import Floors, compose, roll
from ..hidden_ids import HiddenIds
from ..noise.noise_file import read_noise
from ..noise.stated import stated
from .mrclam_files import NOBODY, Recorded, read_files, since
from .mrclam_noise import noise
from .mrclam_sets import LAST_ROBOT, SETS, USUAL, RecordedSet

Flags = NDArray[np.bool_]

GAP = 0.15
"""s. Steps in longer gaps between truth samples have no ground truth; usually samples are 0.01 to 0.03 s apart."""

OTHERS = "others"
MEASURED = Path(__file__).parent / "noise"
"""What `make mrclam-noise` measures on the robots of set 6, on all five and without each of them."""

ALL = "all"  # stands for every dataset, or every robot, in options
LONGEST = 1e5  # s; dataset 6 lasts a quarter of an hour, and every second is a step

START_SD = 1e-3
"""The prior's standard deviation in x and y (m) and heading (rad): about the Vicon system's resolution.

Without a path the start is known by definition, and this is small beside all errors of a map.
"""


@dataclass(frozen=True)
class Options(HiddenIds):
    """The log, and one set of noise settings for all robots, so that no robot is tuned to its own ground truth.

    The defaults are rounded from the errors of dataset 6, its five robots together, and do not depend on any backend's
    results: 0.18 m and 0.0125 rad RMS without 9 gross sightings in 15,349; over 1 to 30 s of driving 0.01 to 0.03 m
    forward and 0.03 to 0.05 rad of turn per root second. Across the body 0.003 m over a second; later the turn's error
    dominates. The errors are not white, as backends assume: two ranges of one landmark within a second have a
    correlation of 0.93 to 0.97. Backends are therefore overconfident on these logs. Ranges are less accurate with
    distance (0.07 m at 1 to 2 m, 0.3 m at 6 to 9 m), but a noise that grows likewise does not improve the results.
    """

    dataset: int | str | None = option(
        None,
        f"number of the dataset; all: every one; not given: that of the folder, else {USUAL}",
        minimum=1,
        maximum=SETS,
        choices=(ALL,),
    )
    robot: int | str = option(1, "whose log; all: every robot's", minimum=1, maximum=LAST_ROBOT, choices=(ALL,))
    path: str | None = option(
        None, "the dataset's folder or the one that holds it; not given: the copy from bench fetch"
    )
    robots: str = option("drop", "other robots' sightings: left out, or kept as unknown", choices=("drop", "unknown"))
    range_sd: float = option(0.2, "standard deviation of ranges, m", minimum=1e-6)
    bearing_sd: float = option(0.012, "standard deviation of bearings, rad", minimum=1e-6)
    forward: float = option(0.03, "motion noise along the body, m per root second", minimum=1e-6)
    lateral: float = option(0.01, "motion noise across the body, m per root second", minimum=1e-6)
    turn: float = option(0.05, "noise of the turn, rad per root second", minimum=1e-6)
    rest: float = option(0.05, "share of the motion noise while commanded to stand", minimum=1e-6)
    noise: str | None = option(
        None,
        "a file of bench noise --save, which is stated; others: as measured on other robots, those of set 6, without "
        "the log's own",
    )


class Sightings(NamedTuple):
    """A robot's sightings, sorted by time, and the numbers left out or kept without id, by reason."""

    t: Array  # (s,)
    ids: Ints  # (s,)
    z: Array  # (s, 2)
    dropped: dict[str, int]
    unnamed: dict[str, int]


def read(of: RecordedSet, options: Options) -> Dataset:
    """Reads the log and ground truth of one robot; InputError names the file and line of a fault."""
    recorded = read_files(of.folder, int(options.robot))
    start, end = _span(recorded.odometry, recorded.truth)
    seen = _sightings(recorded, start, end, options.robots == "unknown")
    t = np.union1d(np.arange(np.floor(round(end - start, 6)) + 1), seen.t)
    delta, delta_cov = _motions(t, since(recorded.odometry, start), recorded.odometry.rows[:, 1:], options)
    poses, known = np.zeros((len(t), 3)), np.zeros(len(t), bool)
    if recorded.truth is not None:
        poses, known = _interpolated(recorded.truth, start, t)
    truth = Truth(t[known], poses[known], recorded.landmarks, None, "truth")
    z_cov = np.diag([options.range_sd**2, options.bearing_sd**2])
    log = Log.from_arrays(
        f"mrclam-{of.called}-robot-{options.robot}",
        Prior(poses[0], START_SD**2 * np.eye(3)),
        t,
        delta,
        delta_cov,
        sighting_step=np.searchsorted(t, seen.t),
        ids=seen.ids,
        z=seen.z,
        z_cov=np.broadcast_to(z_cov, (len(seen.ids), 2, 2)),
        notes=_notes(of, options, recorded, start, seen),
    )
    judged = {"noise by the truth": noise(log, truth)} if len(truth.t) else {}
    log = replace(log, notes={**log.notes, **judged})
    return Dataset(log if options.noise is None else stated(log, read_noise(_noise_file(of, options))), truth)


def _noise_file(of: RecordedSet, options: Options) -> Path:
    """The noise to state: a given file, or that of the other robots of the set with which it was measured."""
    if options.noise != OTHERS:
        return Path(str(options.noise))
    without = f"-without-{options.robot}" if of.number == USUAL else ""
    return MEASURED / f"mrclam-{USUAL}{without}.toml"


def _span(odometry: Table, truth: Table | None) -> tuple[float, float]:
    """Start of the log, at the first command, with ground truth if there is any, and end, of the shorter of both."""
    t, lasts = odometry.column("t"), "lasts"
    start, end = float(t[0]), float(t[-1])
    if truth is not None:
        tracked = np.flatnonzero(_tracked(truth.column("t"), t))
        if not len(tracked):
            raise InputError(f"{odometry.path}: no command lies within the time of {truth.path.name}.")
        start, end, lasts = float(t[tracked[0]]), min(end, float(truth.rows[-1, 0])), f"overlaps {truth.path.name} for"
    if end - start > LONGEST:
        raise InputError(f"{odometry.path}: {lasts} {end - start:g} s, expected no more than {LONGEST:g}.")
    return start, end


def _tracked(samples: Array, t: Array) -> Flags:
    """(n,) mask of times `t` with ground truth, given the times of its samples."""
    after = np.clip(np.searchsorted(samples, t), 1, max(len(samples) - 1, 1))
    near = np.diff(samples, append=np.inf)[after - 1] <= GAP
    return (samples[0] <= t) & (t <= samples[-1]) & (near | np.isin(t, samples))


def _interpolated(truth: Table, start: float, t: Array) -> tuple[Array, Flags]:
    """Poses (n, 3) at `t` (n,), headings interpolated on the circle, and a mask of known ones, (n,)."""
    samples, (x, y, heading) = since(truth, start), truth.rows[:, 1:].T
    places = [np.interp(t, samples, column) for column in (x, y, np.unwrap(heading))]
    places[2] = wrap(places[2])
    return np.stack(places, axis=-1), _tracked(samples, t)


def _motions(t: Array, commanded: Array, velocities: Array, options: Options) -> tuple[Array, Array]:
    """(n, 3) and (n, 3, 3): the motion up to each keyframe, along exact arcs, and its covariance; row 0 is not used."""
    inside = commanded[(commanded > t[0]) & (commanded < t[-1])]
    edges = np.union1d(t, inside)
    dt = np.diff(edges)
    v, omega = velocities[np.searchsorted(commanded, edges[:-1], side="right") - 1].T
    pieces, _ = roll(np.stack((v * dt, omega * dt), axis=-1), "arc")
    share = np.where((v == 0) & (omega == 0), options.rest, 1.0)
    variance = np.square([options.forward, options.lateral, options.turn])
    cov = (share**2 * dt)[:, None, None] * np.diag(variance)
    delta, delta_cov = np.zeros((len(t), 3)), np.zeros((len(t), 3, 3))
    first = np.searchsorted(edges, t)
    for k in range(1, len(t)):
        between = slice(first[k - 1], first[k])
        delta[k], delta_cov[k] = compose(pieces[between], cov[between], Floors(0.0, 0.0))
    return delta, delta_cov


def _sightings(recorded: Recorded, start: float, end: float, keep_robots: bool) -> Sightings:
    """Sightings from `start` to `end`, each subject once at a time: landmarks, and robots if they are kept.

    Another robot moves, and the log of one robot does not say how: as a landmark it would be wrong, so its sightings
    are UNKNOWN. A backend with data association of its own has to reject them.
    """
    table, subjects = recorded.sightings, recorded.subjects
    t = since(table, start)
    outside = (table.column("t") < start) | (table.column("t") > end)
    robot, nobody = (subjects > NOBODY) & (subjects <= LAST_ROBOT), subjects == NOBODY
    kept = np.flatnonzero(~(outside | nobody | (robot & (not keep_robots))))
    _, first = np.unique(np.stack((t[kept], subjects[kept])), axis=1, return_index=True)
    once = kept[np.sort(first)]
    dropped = {
        "of another robot": 0 if keep_robots else int(np.sum(robot & ~outside)),
        "with an unknown barcode": int(np.sum(nobody & ~outside)),
        "outside the log's time": int(np.sum(outside)),
        "repeated at one time": len(kept) - len(once),
    }
    unnamed = {"of another robot": int(np.sum(robot[once]))}
    return Sightings(t[once], np.where(robot, UNKNOWN, subjects)[once], table.rows[once, 2:], dropped, unnamed)


def _notes(of: RecordedSet, options: Options, recorded: Recorded, start: float, seen: Sightings) -> dict[str, Any]:
    settings = asdict(options) | {"dataset": of.number}
    del settings["path"], settings["ids"], settings["noise"]  # a stated noise has notes of its own
    path = {"truth": f"interpolated between samples up to {GAP} s apart"}
    if recorded.truth is None:
        path = {
            "truth": f"the landmarks' places alone: there is no Robot{options.robot}_Groundtruth.dat",
            "start pose": "the origin of a frame of its own, not that of the landmarks' places",
        }
    return {
        "source": f"UTIAS MRCLAM, {of.folder.name}; Leung, Halpern, Barfoot, Liu, IJRR 30(8):969-974, 2011",
        "licence": "none stated with the files",
        "start": start,
        "time": "seconds since start, which is in seconds since 1970",
        **path,
        "covariances": "none in the files; made of the settings, the motion's in the body frame before it",
        "settings": settings,
        "dropped": seen.dropped,
        "kept as unknown": seen.unnamed,
    } | ({REMARKS: recorded.remarks} if recorded.remarks else {})
