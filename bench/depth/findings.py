"""The results of the front end for depth cameras, in sentences, rows and JSON."""

from collections import Counter
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.beside import Clouds
from ...core.factors import Dataset, Log, Truth
from ...core.se2 import Array, Ints
from ...datasets.remarks import remarks
from ...frontend.depth.recording import DepthRecording
from ..words.numerals import counted, listed, number

MANY = 0.5
"""Share of the keyframes without a floor, or of pairs turned down, from which on something must be wrong."""

TILTED = 0.05
"""rad; a mean attitude from which on the stated mounting is doubted."""

OFF = 0.05
"""m; likewise the height of the robot's origin above the floor."""

FEW = 50
"""Features of a keyframe, on average, below which there is little to see."""


class Levels(NamedTuple):
    """The body's attitude at every step."""

    tilts: Array  # (k, 3) pitch forward and roll to the right (rad), and the origin's height above the floor (m)
    found: NDArray[np.bool]  # (k,) False: no floor was found, and the mounting is taken as stated


class DepthFindings(NamedTuple):
    """All results."""

    log: Log
    truth: Truth | None  # at the log's times
    recording: DepthRecording
    path: Array  # (k, 3) the front end's own estimate of the steps
    levels: Levels
    again: Ints  # (l, 2) steps, and earlier ones whose places they show
    span: tuple[float, float]  # s, of the first frame and the last one

    @property
    def counts(self) -> Counter[str]:
        """The front end's counts of frames, features and pairs."""
        return Counter(self.log.notes["depth"]["counts"])

    @property
    def clouds(self) -> Clouds:
        """The clouds beside the log."""
        assert self.log.clouds is not None  # the front end for depth cameras keeps them
        return self.log.clouds

    @property
    def remarks(self) -> list[str]:
        """Lists what is legal in the log yet odd."""
        return remarks(Dataset(self.log, self.truth))

    @property
    def size(self) -> str:
        """The size of the images, px."""
        return f"{self.recording.camera.width}x{self.recording.camera.height}"


def headline(f: DepthFindings) -> list[str]:
    """Summarises in sentences: frames, steps and factors; pairs, levelling, places seen again."""
    c, searched = f.counts, f.log.notes["depth"]["loops"]["searched"]
    way = float(np.hypot(*f.log.delta[1:, :2].T).sum())
    wheels = "with wheels" if f.recording.motion is not None else "without wheels"
    steps = f"{counted(len(f.log), 'step')} over {number(way)} m"
    said = [
        f"{counted(c['frames'], 'frame')} of {f.size} pixels in {number(seconds(f))} s, {wheels}: {steps}, {_seen(f)}."
    ]
    if c["pairs"]:
        said.append(f"{c['pairs registered']:,} of {counted(c['pairs'], 'pair')} of keyframes were registered.")
    lost = int((~f.levels.found).sum())
    if lost == len(f.log):
        said.append("No step is levelled by a floor: pitch, roll and height are those of the stated mounting.")
    elif lost:
        share = f"{lost:,} ({100 * lost / len(f.log):.2g} %)"
        levelled = counted(len(f.log) - lost, "step")
        said.append(f"The floor levels {levelled}; {share} show no floor and are taken as the mounting states.")
    else:
        said.append("The floor levels every step.")
    if searched:
        again = counted(len(f.again), "time")
        said.append(f"Earlier places were compared {counted(searched, 'time')} and recognised {again}.")
    return said


def _seen(f: DepthFindings) -> str:
    """Names the factors of the log."""
    if f.log.notes["depth"]["settings"]["landmarks"]:
        landmarks = counted(len(np.unique(f.log.ids)), "landmark")
        return f"{counted(len(f.log.ids), 'sighting')} of {landmarks}"
    return counted(len(f.log.loop_to), "loop closure")


def seconds(f: DepthFindings) -> float:
    """The length of the recording, s."""
    return f.span[1] - f.span[0]


def turned_down(f: DepthFindings) -> list[tuple[str, int]]:
    """Lists why pairs of keyframes were not registered, and how often; the most frequent reason first."""
    return _by_count(f.log.notes["depth"]["turned_down"])


def places_turned_down(f: DepthFindings) -> list[tuple[str, int]]:
    """Lists why earlier places were not recognised, likewise."""
    return _by_count(f.log.notes["depth"]["loops"]["turned_down"])


def left_out(f: DepthFindings) -> list[tuple[str, int]]:
    """Lists frames of the recording that were left out, likewise: those that are bad or without odometry."""
    bad = f.recording.left_out
    return _by_count({name: n for name, n in f.counts.items() if name in bad or (name.startswith("frames without ")
                      and name != "frames without a floor")})  # fmt: skip


def _by_count(counts: Mapping[str, int]) -> list[tuple[str, int]]:
    return sorted(((name, n) for name, n in counts.items() if n), key=lambda one: (-one[1], one[0]))


def turned_down_words(f: DepthFindings) -> str:
    """Lists the refused pairs and the frames left out in a line."""
    pairs = listed([f"{n:,} ({why})" for why, n in turned_down(f)]) or "nothing"
    return f"Turned down: {pairs}. Left out: {listed([f'{n:,} {why}' for why, n in left_out(f)]) or 'nothing'}."


def advice(f: DepthFindings) -> list[str]:
    """Says what looks wrong, in sentences."""
    c, said, found = f.counts, list[str](), f.levels.found
    looked, pairs = c["frames looked at"], c["pairs"]
    if f.log.notes["depth"]["settings"]["level"] and (~found).mean() > MANY:
        said.append(
            f"{100 * (~found).mean():.0f} % of the steps show no floor: perhaps [camera] mounting is wrong, or the "
            "camera looks above it."
        )
    elif found.any():
        pitch, roll, up = f.levels.tilts[found].mean(axis=0).tolist()
        if max(abs(pitch), abs(roll)) > TILTED or abs(up) > OFF:
            said.append(
                f"On average the floor has the body pitched by {np.degrees(pitch):.1f} degrees, rolled by "
                f"{np.degrees(roll):.1f} and {100 * up:.0f} cm above where the mounting has it: perhaps [camera] "
                "mounting is wrong."
            )
    if c["features"] < FEW * looked:
        said.append(
            f"A keyframe has {c['features'] / looked:.0f} features with depth, expected hundreds: perhaps the depth is "
            "not registered, near and far leave it out, or there is little texture."
        )
    refused = dict(turned_down(f)).get("it contradicts the wheels", 0)
    if pairs and refused > MANY * pairs:
        said.append(
            f"{100 * refused / pairs:.0f} % of the pairs contradict the wheels: perhaps the images' clock "
            "(time_offset), the odometry's noise or the calibration is wrong."
        )
    elif pairs and c["pairs registered"] < (1 - MANY) * pairs:
        said.append(f"{100 * (1 - c['pairs registered'] / pairs):.0f} % of the pairs of keyframes were turned down.")
    return said


def as_json(f: DepthFindings, out: str) -> dict[str, Any]:
    """Returns the results as JSON takes them."""
    c, found = f.counts, f.levels.found
    tilts = f.levels.tilts[found]
    return {
        "log": out,
        "name": f.log.name,
        "frames": c["frames"],
        "width": f.recording.camera.width,
        "height": f.recording.camera.height,
        "seconds": seconds(f),
        "wheels": f.recording.motion is not None,
        "keyframes": c["frames looked at"],
        "features": c["features"],
        "steps": len(f.log),
        "landmarks": len(np.unique(f.log.ids)),
        "sightings": len(f.log.ids),
        "loops": len(f.log.loop_to),
        "pairs": c["pairs"],
        "pairs_registered": c.get("pairs registered", 0),
        "turned_down": dict(turned_down(f)),
        "places_compared": f.log.notes["depth"]["loops"]["searched"],
        "places_recognised": len(f.again),
        "places_turned_down": dict(places_turned_down(f)),
        "steps_without_floor": int((~found).sum()),
        "pitch_roll_sd": tilts[:, :2].std(axis=0).tolist() if len(tilts) else None,
        "left_out": dict(left_out(f)),
        "points": len(f.clouds.points),
        "advice": advice(f),
        "remarks": f.remarks,
        "truth": None if f.truth is None else f.truth.kind,
    }
