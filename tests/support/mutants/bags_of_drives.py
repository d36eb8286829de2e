"""Mutated ROS bags: messages dropped, doubled, of another time or unit, and files that are damaged.

Frames are small and hold their number; the detector returns the sightings of the frame of that number.
"""

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import bags
from fuzzing import damaged
from slamduel.core.factors import Dataset, Truth
from slamduel.core.se2 import Array
from slamduel.datasets.recordings.recording import build, open_recording
from slamduel.datasets.recordings.robot import Robot
from slamduel.datasets.truth import write_truth
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.shutter import CameraMotion
from slamduel.frontend.markers.aruco import Detector, Image, Rejections, Sighting
from slamduel.frontend.markers.markers import Markers
from slamduel.frontend.markers.noise import ProportionalNoise
from slamduel.frontend.wheels.encoder import Floors
from slamduel.frontend.wheels.track import TrackNoise
from small_recording import MOUNTING, SIDE, sighting

from .drive import Tables, drive
from .ending import Ended, in_any_order, judged, sound

REUSED, SECONDS = 16, 40.0  # mutations of one drive, and its length
NS, BEGIN = 10**9, 1_000  # s, of the first message: in the header and on reception
CAMERA = Camera(64, 48, (60.0, 60.0), (31.5, 23.5), (), MOUNTING)
ROBOT = Robot(
    "cart", Markers("4X4_50", SIDE), CAMERA, MOUNTING, max_range=10.0, noise=ProportionalNoise(0.0, 0.0, 0.1, 0.02),
    track_noise=TrackNoise(0.05, 0.03, 0.05, Floors()),
)  # fmt: skip
INFO = [60.0, 0, 31.5, 0, 60.0, 23.5, 0, 0, 1]

Told = list[list[Sighting]]


@dataclass(frozen=True)
class Message:
    """A message: of odometry (x, y, heading), or a frame's number."""

    pose: Array | None
    number: int
    stamp: float  # s, of the header
    received: float  # s
    size: tuple[int, int] = (48, 64)
    encoding: str = "mono8"
    quaternion: float = 1.0  # its length

    def said(self) -> bags.Said:
        """The message as it is written."""
        stamp, received = round(self.stamp * NS), round(self.received * NS)
        if self.pose is None:
            image = np.full(self.size, 90, np.uint8)
            image[:, :2] = divmod(self.number, 256)
            return bags.image(stamp, image, received, encoding=self.encoding)
        x, y, heading = self.pose.tolist()
        turn = self.quaternion * np.sin(heading / 2), self.quaternion * np.cos(heading / 2)
        return bags.odometry(stamp, x, y, (0.0, 0.0, *turn))._replace(received=received)


@dataclass(frozen=True, eq=False)
class Numbered(Detector):
    """Returns the sightings of the frame whose number is in every row of the image."""

    told: tuple[list[Sighting], ...] = ()

    def detect(self, image: Image, motion: CameraMotion | None = None) -> tuple[list[Sighting], Rejections]:
        """The sightings of the frame, none where its number cannot be read."""
        rows = image[:, :2].reshape(-1, 2)
        number = 256 * int(rows[0, 0]) + int(rows[0, 1])
        known = bool((rows == rows[0]).all()) and number < len(self.told)
        return (self.told[number] if known else []), Rejections()


Messages = list[Message]
Mutation = Callable[[Messages, np.random.Generator], Messages]


def messages(tables: Tables) -> tuple[Messages, Told]:
    """The messages of a drive, in order of reception, and the sightings in its frames."""
    found = [Message(row[1:], 0, BEGIN + row[0], BEGIN + row[0] + 0.005) for row in tables["odometry"]]
    seen = tables["detections"]
    told: Told = []
    for number, t in enumerate(np.unique(seen[:, 0])):
        told.append([sighting(int(row[1]), row[2], row[3]) for row in seen[seen[:, 0] == t]])
        found.append(Message(None, number, BEGIN + t, BEGIN + t + 0.02))
    return sorted(found, key=lambda one: one.received), told


def _each(of: str, change: Callable[[Message], Message]) -> Mutation:
    """Changes every message of a stream: "frames" or "odometry"."""
    return lambda said, rng: [change(one) if _is(one, of) else one for one in said]


def _is(message: Message, of: str) -> bool:
    return (message.pose is None) == (of == "frames")


def _some(of: str, change: Callable[[Message], Message | None], share: float = 0.0) -> Mutation:
    """Changes, or drops, one message of a stream, or a share of them."""

    def mutate(said: Messages, rng: np.random.Generator) -> Messages:
        rows = [k for k, one in enumerate(said) if _is(one, of)]
        chosen = set(rng.choice(rows[1:-1], max(1, int(share * len(rows))), replace=False).tolist())
        changed = [change(one) if k in chosen else one for k, one in enumerate(said)]
        return [one for one in changed if one is not None]

    return mutate


def _hole(of: str) -> Mutation:
    def mutate(said: Messages, rng: np.random.Generator) -> Messages:
        start = BEGIN + rng.uniform(5, 20)
        end = start + rng.uniform(3, 15)
        return [one for one in said if not (_is(one, of) and start < one.stamp < end)]

    return mutate


def _twice(said: Messages, rng: np.random.Generator) -> Messages:
    return [one for one in said for _ in range(2)]


def _shuffled(said: Messages, rng: np.random.Generator) -> Messages:
    """Received in any order within the bag."""
    times = [one.received for one in said]
    order = rng.permutation(len(said))
    return [replace(said[k], received=t) for k, t in zip(order.tolist(), times, strict=True)]


def _swapped_stamps(said: Messages, rng: np.random.Generator) -> Messages:
    """The headers' times of the frames are dealt anew."""
    frames = [one for one in said if _is(one, "frames")]
    stamps = iter(rng.permutation([one.stamp for one in frames]).tolist())
    return [replace(one, stamp=next(stamps)) if _is(one, "frames") else one for one in said]


def _shifted(of: str, least: float, most: float, *, from_half: bool = False) -> Mutation:
    def mutate(said: Messages, rng: np.random.Generator) -> Messages:
        by, start = rng.choice((-1, 1)) * rng.uniform(least, most), BEGIN + SECONDS / 2 * from_half
        return _each(of, lambda one: replace(one, stamp=one.stamp + by * (one.stamp >= start)))(said, rng)

    return mutate


def _posed(change: Callable[[Array], Array]) -> Mutation:
    def posed(one: Message) -> Message:
        assert one.pose is not None
        return replace(one, pose=change(one.pose))

    return _each("odometry", posed)


def _from_half(by: Array) -> Mutation:
    """The odometry is elsewhere from half of the time on."""

    def jumped(one: Message) -> Message:
        return replace(one, pose=one.pose + by * (one.stamp > BEGIN + SECONDS / 2))

    return _each("odometry", jumped)


def _nan(one: Message) -> Message:
    return replace(one, pose=np.full(3, np.nan))


def _same(said: Messages, rng: np.random.Generator) -> Messages:
    return said


MUTATIONS: dict[str, Mutation] = {
    "as it is": _same,
    **{f"{of}: lost one": _some(of, lambda one: None) for of in ("frames", "odometry")},
    **{f"{of}: thinned": _some(of, lambda one: None, 0.2) for of in ("frames", "odometry")},
    **{f"{of}: hole": _hole(of) for of in ("frames", "odometry")},
    **{f"{of}: first stamp 0": lambda said, rng, of=of: _first_zero(said, of) for of in ("frames", "odometry")},
    **{f"{of}: some stamps 0": _some(of, lambda one: replace(one, stamp=0.0), 0.1) for of in ("frames", "odometry")},
    **{f"{of}: stamps 0": _each(of, lambda one: replace(one, stamp=0.0)) for of in ("frames", "odometry")},
    **{f"{of}: another clock": _shifted(of, 0.7, 100.0) for of in ("frames", "odometry")},
    **{f"{of}: clock jumps": _shifted(of, 0.7, 100.0, from_half=True) for of in ("frames", "odometry")},
    **{f"{of}: clock drifts": _each(of, lambda one: replace(one, stamp=BEGIN + 1.05 * (one.stamp - BEGIN)))
       for of in ("frames", "odometry")},
    **{f"{of}: milliseconds": _each(of, lambda one: replace(one, stamp=1000 * one.stamp))
       for of in ("frames", "odometry")},
    "all: twice": _twice,
    "all: received in any order": _shuffled,
    "all: stamps 0": lambda said, rng: [replace(one, stamp=0.0) for one in said],
    "frames: stamps swapped": _swapped_stamps,
    "frames: one of another size": _some("frames", lambda one: replace(one, size=(24, 32))),
    "frames: of another size": _each("frames", lambda one: replace(one, size=(96, 128))),
    "frames: one of no encoding": _some("frames", lambda one: replace(one, encoding="sepia")),
    "frames: of no encoding": _each("frames", lambda one: replace(one, encoding="sepia")),
    "odometry: millimetres": _posed(lambda pose: pose * [1000.0, 1000.0, 1.0]),
    "odometry: kilometres": _posed(lambda pose: pose * [0.001, 0.001, 1.0]),
    "odometry: degrees": _posed(lambda pose: pose * [1.0, 1.0, 180 / np.pi]),
    "odometry: mirrored": _posed(lambda pose: pose * [1.0, 1.0, -1.0]),
    "odometry: x and y swapped": _posed(lambda pose: pose[[1, 0, 2]]),
    "odometry: jump": _from_half(np.array([3.0, 2.0, 0.0])),
    "odometry: turned": _from_half(np.array([0.0, 0.0, 1.0])),
    "odometry: nan": _some("odometry", _nan),
    "odometry: quaternion too long": _some("odometry", lambda one: replace(one, quaternion=2.0)),
    "odometry: no heading": _posed(lambda pose: pose * [1.0, 1.0, 0.0]),
}  # fmt: skip


def _first_zero(said: Messages, of: str) -> Messages:
    first = next(k for k, one in enumerate(said) if _is(one, of))
    return [*said[:first], replace(said[first], stamp=0.0), *said[first + 1 :]]


def _written(folder: Path, kind: str, said: Messages, info: Any, truth: Truth) -> Path:
    folder.mkdir()
    write_truth(folder, truth)
    calibration = bags.camera_info(BEGIN * NS, info, [0.0] * 5)
    path = bags.write(folder, kind, [_sized(calibration), *(one.said() for one in said)])
    if kind == "mcap":
        write_truth(path.parent, truth)
    return path


def _sized(said: bags.Said) -> bags.Said:
    return said._replace(build=lambda new: said.build(new) | {"height": 48, "width": 64})


def _load(path: Path, told: Told) -> Dataset:
    opened = open_recording(path, ROBOT)
    detector = Numbered(ROBOT.markers, CAMERA, told=tuple(told))
    return build(opened._replace(recording=replace(opened.recording, detector=detector)))


def tried(cases: int, seed: int = 0) -> Iterator[Ended]:
    """Mutates that many bags, every kind in turn; each fifth is a damaged file instead, each tenth another lens."""
    kinds = in_any_order(MUTATIONS, seed)
    with tempfile.TemporaryDirectory(prefix="slamduel-") as scratch:
        said, told, right = Messages(), Told(), dict[str, Any]()
        truth = Truth(np.zeros(0), np.zeros((0, 3)), None, None, "truth")
        for case in range(cases):
            rng = np.random.default_rng([seed, case])
            folder, kind = Path(scratch) / str(case), bags.KINDS[case % len(bags.KINDS)]
            if case % REUSED == 0:
                tables = drive(rng, SECONDS)
                said, told = messages(tables)
                rows = tables["truth"]
                truth = Truth(BEGIN + rows[:, 0], rows[:, 1:], None, None, "truth")
                right = sound(_load(_written(folder.with_suffix(".sound"), kind, said, INFO, truth), told))
            if case % 10 == 9:
                info = [float(rng.choice((0.5, 0.9, 1.1, 2.0))) * 60 if k in (0, 4) else x for k, x in enumerate(INFO)]
                path, name = _written(folder, kind, said, info, truth), "another lens"
            elif case % 5 == 4:
                path, name = _written(folder, kind, said, INFO, truth), "damaged"
                files = sorted(one for one in (path.iterdir() if path.is_dir() else [path]) if one.name != "truth.tum")
                victim = files[case // 10 % len(files)]
                (content,) = list(damaged(victim.read_bytes(), case // 10 % 3 + 1, case))[-1:]
                victim.write_bytes(content)
            else:
                name = kinds[(case - case // 5) % len(kinds)]
                path = _written(folder, kind, MUTATIONS[name](said, rng), INFO, truth)
            yield judged(f"bag {name}", lambda path=path, told=told: _load(path, told), right)
