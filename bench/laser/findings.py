"""The results of scan matching, in sentences, rows and JSON."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ...core.beside import Scans
from ...core.factors import Dataset, Log, Truth
from ...core.se2 import Array
from ...datasets.remarks import remarks
from ...frontend.laser.recording import LaserRecording
from ..words.numerals import counted, listed, number

MANY_LOST = 0.1
"""Share of lost scans from which on something must be wrong."""


class LaserFindings(NamedTuple):
    """All results."""

    log: Log
    truth: Truth | None  # at the log's times
    recording: LaserRecording
    path: Array  # (k, 3) the front end's own estimate of the steps

    @property
    def counts(self) -> Mapping[str, Any]:
        """The front end's counts, as the log's notes have them."""
        return self.log.notes["laser"]

    @property
    def scans(self) -> Scans:
        """The scans beside the log."""
        assert self.log.scans is not None  # the laser front end keeps them
        return self.log.scans

    @property
    def remarks(self) -> list[str]:
        """Lists what is legal in the log yet odd."""
        return remarks(Dataset(self.log, self.truth))


def headline(f: LaserFindings) -> list[str]:
    """Summarises in sentences: scans and steps, lost scans, loops."""
    way = float(np.hypot(*f.log.delta[1:, :2].T).sum())
    n, lost, relocated = len(f.recording.t), f.counts["lost"], f.counts["relocated"]
    beams = counted(len(f.recording.scanner.angles), "beam")
    wheels = "with wheels" if f.counts["wheels"] else "without wheels"
    said = [
        (
            f"{counted(n, 'scan')} of {beams} in {number(seconds(f))} s, {wheels}: "
            f"{counted(len(f.log), 'step')} over {number(way)} m, {counted(len(f.log.loop_to), 'loop closure')}."
        )
    ]
    if lost:
        said.append(
            f"{counted(lost, 'scan')} did not match the last metres ({100 * lost / n:.2g} %); the search placed "
            f"{relocated:,} of them elsewhere."
        )
    else:
        said.append("Every scan matched the last metres.")
    if f.counts["by_wheels"]:
        said.append(
            f"{counted(f.counts['by_wheels'], 'scan')} were placed by the wheels: what they were matched to moved "
            "along with the robot."
        )
    if f.counts["searched"]:
        confirmed = f.counts["confirmed"]
        far = f", {confirmed:,} of them far from the estimate and confirmed," if confirmed else ""
        said.append(
            f"Steps were searched for in earlier submaps {f.counts['searched']:,} times: "
            f"{counted(len(f.log.loop_to), 'loop closure')}{far} and {sum(n for _, n in turned_down(f)):,} turned down."
        )
    elif f.counts["settings"]["loops"]:
        said.append("The robot never came back to where it had been, so no loop was searched for.")
    return said


def seconds(f: LaserFindings) -> float:
    """The length of the recording, s."""
    return float(f.recording.t[-1] - f.recording.t[0])


def turned_down(f: LaserFindings) -> list[tuple[str, int]]:
    """Lists why searches gave no loop, and how often; the most frequent reason first."""
    return sorted(f.counts["turned_down"].items(), key=lambda one: (-one[1], one[0]))


def turned_down_words(f: LaserFindings) -> str:
    """Lists it in a line; "nothing" where there is nothing."""
    found = turned_down(f)
    return listed([f"{n:,} ({why})" for why, n in found]) if found else "nothing"


def advice(f: LaserFindings) -> list[str]:
    """Says what looks wrong, in sentences."""
    n, lost = len(f.recording.t), f.counts["lost"]
    if lost <= MANY_LOST * n:
        return []
    least, most, ranges = f.recording.scanner.least, f.recording.scanner.most, f.recording.ranges
    returns = float(((ranges > least) & (ranges < most)).mean())
    return [
        (
            f"{100 * lost / n:.0f} % of the scans did not match, and {100 * returns:.0f} % of the beams are returns "
            f"between {least:g} and {most:g} m: perhaps the scanner's pose on the robot, these limits or the "
            "odometry's clock are wrong."
        )
    ]


def as_json(f: LaserFindings, out: str) -> dict[str, Any]:
    """Returns the results as JSON takes them."""
    return {
        "log": out,
        "name": f.log.name,
        "scans": len(f.recording.t),
        "beams": len(f.recording.scanner.angles),
        "seconds": seconds(f),
        "wheels": f.counts["wheels"],
        "steps": len(f.log),
        "loops": len(f.log.loop_to),
        "lost": f.counts["lost"],
        "relocated": f.counts["relocated"],
        "by_wheels": f.counts["by_wheels"],
        "submaps": f.counts["submaps"],
        "searched": f.counts["searched"],
        "confirmed": f.counts["confirmed"],
        "turned_down": dict(turned_down(f)),
        "advice": advice(f),
        "remarks": f.remarks,
        "truth": None if f.truth is None else f.truth.kind,
    }
