"""Summarises a detection: for the terminal, the report and for other programs."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...core.factors import Dataset, Log, Truth
from ...datasets.remarks import remarks
from ..words.numerals import counted, listed, number
from .noise_calibration import CONSISTENT, Calibration, RangeBin
from .sightings import Detection, Marker, Sightings, TrueErrors, in_log, markers, per_frame

NOISES = ("stated", "proportional", "propagated")  # in the order of RangeBin.nees; the last two if fitted
HARDLY = 0.05  # share of frames with a marker below which the causes are diagnosed


class Findings(NamedTuple):
    """All results of a detection."""

    log: Log
    truth: Truth | None  # at the log's times
    max_range: float  # m
    size: tuple[int, int]  # px, width and height of a frame
    t: np.ndarray[Any, np.dtype[np.float64]]  # (n,) s, of the frames used
    sightings: Sightings
    true: TrueErrors | None
    bins: Sequence[RangeBin]  # of the sightings with known errors
    advice: Sequence[str]  # why so little was detected, and what else looks wrong
    calibration: Calibration | None

    @property
    def remarks(self) -> list[str]:
        """Lists what is legal in the log yet odd."""
        return remarks(Dataset(self.log, self.truth))


def hardly_any(detection: Detection) -> bool:
    """Returns True if so few frames have a marker that something must be wrong."""
    return int((per_frame(detection.sightings(), detection.frames) > 0).sum()) < HARDLY * detection.frames


def headline(f: Findings) -> list[str]:
    """Summarises in sentences: detections first, then their quality."""
    kept = in_log(f.sightings)
    frames = len(f.t)
    if not len(kept.ids):
        return [f"No marker that can be used was found in {counted(frames, 'frame')}."]
    found = counted(len(kept.ids), "sighting"), counted(len(np.unique(kept.ids)), "marker")
    counts = per_frame(kept, frames)
    none = int((counts == 0).sum())
    mean = number(float(counts.mean()))
    said = [f"{found[0]} of {found[1]} in {counted(frames, 'frame')}, {mean} a frame; {none:,} saw none."]
    said.append(f"Corners fit to {number(float(np.sqrt((kept.error**2).mean())))} px.")
    if f.bins:
        said.append(_truthfulness(f.bins))
    return said


def _truthfulness(bins: Sequence[RangeBin]) -> str:
    n = np.array([one.sightings for one in bins])
    nees = float(n @ [one.nees[0] for one in bins] / n.sum())
    bias = float(n @ [one.range_mean for one in bins] / n.sum())
    word = "cautious" if nees < CONSISTENT[0] else "consistent" if nees <= CONSISTENT[1] else "overconfident"
    return (
        f"Against the truth, ranges are {number(1e3 * abs(bias))} mm too {'long' if bias > 0 else 'short'} on average, "
        f"and the stated noise is {word}: NEES {number(nees)}, 1 being exact."
    )


def left_out(log: Log) -> list[tuple[str, int]]:
    """Lists what is in the recording and not in the log, with reasons and counts; frames first."""
    counts: Mapping[str, int] = log.notes["counts"]
    other = [(name, n) for name, n in counts.items() if n and name not in ("frames", "sightings")]
    return sorted(other, key=lambda one: not one[0].startswith("frames "))


def left_out_words(log: Log) -> str:
    """Lists it in a line; "nothing" where there is nothing."""
    return listed([_left_out(name, n) for name, n in left_out(log)]) if left_out(log) else "nothing"


def _left_out(name: str, n: int) -> str:
    noun, _, why = name.partition(" ")
    if noun in ("frames", "sightings"):
        return f"{counted(n, noun.removesuffix('s'))} {why}"
    return f"{counted(n, 'marker')} ({name})"


def marker_rows(f: Findings) -> list[Marker]:
    """Lists the markers in the log."""
    return list(markers(in_log(f.sightings), f.t))


def as_json(f: Findings, out: str) -> dict[str, Any]:
    """Returns the results as JSON takes them."""
    kept = in_log(f.sightings)
    words: dict[str, Any] = {
        "log": out,
        "name": f.log.name,
        "frames": len(f.t),
        "seconds": float(f.t[-1] - f.t[0]),
        "width": f.size[0],
        "height": f.size[1],
        "sightings": len(kept.ids),
        "markers": [one._asdict() for one in marker_rows(f)],
        "left_out": dict(left_out(f.log)),
        "advice": list(f.advice),
        "remarks": f.remarks,
        "truth": None if f.truth is None else f.truth.kind,
        "by_range": [
            one._asdict() | {"nees": dict(zip(NOISES, one.nees, strict=False))}
            for one in (f.calibration.bins if f.calibration else f.bins)
        ],
    }
    if f.calibration is not None:
        c = f.calibration
        words["noise"] = {
            "proportional": c.proportional.settings,
            "propagated": c.propagated.settings,
            "likelier": c.likelier,
            "standard_errors": {
                "k_range": c.range.k_error,
                "k_bearing": c.bearing.k_error,
                "floor_range": c.range.floor_error,
                "floor_bearing": c.bearing.floor_error,
                "scale": c.corners.scale_error,
            },
            "sightings": c.sightings,
        }
    return words
