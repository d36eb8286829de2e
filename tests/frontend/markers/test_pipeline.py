"""From a recording to a log: readings cut at frame times, what is left out and counted, what is refused."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from motions import chained
from refusals import refused
from slamduel.core.errors import InputError
from slamduel.core.factors import Odometry, Prior
from slamduel.datasets.worlds.aruco_room import Options, record
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting
from slamduel.frontend.camera.shutter import carried
from slamduel.frontend.markers.aruco import Detector, Image
from slamduel.frontend.markers.markers import Markers, find
from slamduel.frontend.markers.noise import PropagatedNoise, ProportionalNoise
from slamduel.frontend.markers.pipeline import JOINED, Frame, Recording, build_log, camera_motion, see
from slamduel.frontend.pauses import PAUSE
from slamduel.frontend.wheels.encoder import Encoder
from slamduel.frontend.wheels.motion import Drift
from slamduel.frontend.wheels.ticks import Ticks, Wheels, readings

CAMERA = Camera(160, 120, (150.0, 150.0), (79.5, 59.5), (), mounting(0, 0, 0.3, 0))
ENCODER = Encoder(1e-3, 1e-3, 0.3, 0.02, "distance")
UNCOUNTED = Ticks(np.array([0.0, 1.0]), np.array([[0, 0], [np.nan, 0]]))
BLANK = np.full((120, 160), 128, np.uint8)


def marked(side: int, name: int = 4) -> Image:
    """A frame with a marker in its middle, `side` px (a multiple of 6) wide."""
    image = BLANK.copy()
    rim = side // 6
    paper = np.pad(np.asarray(find("4X4_50").generateImageMarker(name, side), np.uint8), rim, constant_values=255)
    top, left = (120 - len(paper)) // 2, (160 - len(paper)) // 2
    image[top : top + len(paper), left : left + len(paper)] = paper
    return image


def recording(frames: Sequence[Frame] | Iterator[Frame], **changes: Any) -> Recording:
    t = np.arange(0, 1.05, 0.1)
    ticks = Ticks(t, np.stack((100 * t**2, 120 * t), axis=-1))
    settings: dict[str, Any] = {
        "name": "bench",
        "motion": Wheels(ticks, ENCODER),
        "detector": Detector(Markers("4X4_50", 0.1), CAMERA),
        "noise": ProportionalNoise(),
        "prior": Prior(np.zeros(3), np.eye(3) * 1e-6),
    }
    return Recording(frames=frames, **(settings | changes))


def blank(*times: float) -> list[Frame]:
    return [Frame(t, BLANK) for t in times]


def test_readings_are_cut_at_frame_times() -> None:
    ticks = Ticks(np.array([0.0, 1.0, 2.0, 3.0]), np.array([[0, 0], [10, 20], [30, 20], [30, 60]]))
    counts, dt = readings(ticks, 0.5, 2.25)
    np.testing.assert_allclose(dt, [0.5, 1.0, 0.25])
    np.testing.assert_allclose(counts, [[5, 10], [20, 0], [0, 10]])


def test_a_frame_at_a_readings_time_makes_no_empty_reading() -> None:
    ticks = Ticks(np.array([0.0, 1.0, 2.0]), np.array([[0, 0], [10, 20], [30, 20]]))
    counts, dt = readings(ticks, 1.0, 2.0)
    assert dt.tolist() == [1.0]
    assert counts.tolist() == [[20.0, 0.0]]


def test_the_way_does_not_depend_on_where_the_frames_are() -> None:
    def end(*times: float) -> np.ndarray[Any, Any]:
        return chained(build_log(recording(blank(*times))).delta[1:])[-1]

    expected = end(0.0, 1.0)
    np.testing.assert_allclose(end(0.0, 0.3, 0.6, 1.0), expected, atol=1e-12)
    # Cutting a reading in two makes a chord into two: the difference is of third order in a reading's turn.
    np.testing.assert_allclose(end(0.0, 0.25, 0.55, 1.0), expected, atol=1e-5)


def test_ids_to_ignore_are_left_out_and_counted() -> None:
    frames = [Frame(0.0, marked(30)), Frame(0.5, BLANK), Frame(1.0, marked(30))]
    log = build_log(recording(frames, detector=Detector(Markers("4X4_50", 0.1, ignore=(4, 9)), CAMERA)))
    assert log.ids.tolist() == []
    assert log.notes["counts"]["id 4 is to be left out"] == 2
    assert log.notes["markers"]["ignore"] == [4, 9]
    assert log.remarks == ["bench: [markers] ignore has id 9, which no frame has"]
    other = build_log(recording(frames, detector=Detector(Markers("4X4_50", 0.1, ignore=(9,)), CAMERA)))
    assert other.ids.tolist() == [4, 4]


def test_sightings_near_are_kept_and_far_are_counted() -> None:
    # 0.1 m at f = 150 px: 30 px are 0.5 m away.
    frames = [Frame(0.0, marked(30)), Frame(0.5, BLANK), Frame(1.0, marked(30))]
    near = build_log(recording(frames))
    assert near.ids.tolist() == [4, 4]
    assert near.sighting_step.tolist() == [0, 2]
    np.testing.assert_allclose(near.z, [[0.5, 0.0]] * 2, atol=0.03)
    np.testing.assert_array_equal(near.z_cov, ProportionalNoise().cov(near.z))
    assert near.notes["counts"] == {"frames": 3, "sightings": 2, "sightings beyond 3 m": 0}
    far = build_log(recording(frames, max_range=0.4))
    assert len(far.ids) == 0
    assert far.notes["counts"] == {"frames": 3, "sightings": 0, "sightings beyond 0.4 m": 2}


def test_several_of_one_id_in_a_frame_are_a_remark_and_not_in_the_log() -> None:
    both = np.hstack((marked(30), marked(36)))
    detector = Detector(Markers("4X4_50", 0.1), replace(CAMERA, width=320))
    log = build_log(recording([Frame(0.0, both), Frame(0.5, both)], detector=detector))
    assert len(log.ids) == 0
    assert log.notes["counts"]["same id twice in a frame"] == 4
    (said,) = log.remarks
    assert said == (
        "bench: id 4 was on several markers of one frame, in 2 frames: none of these is in the log; an id is one "
        "landmark, so every marker needs its own"
    )
    alone = np.hstack((marked(30), BLANK))
    log = build_log(recording([Frame(0.0, both), Frame(0.5, alone), Frame(1.0, alone)], detector=detector))
    assert log.ids.tolist() == [4, 4]
    (said,) = log.remarks
    assert "id 4 was on several markers of one frame, in 1 frame: none of these is in the log, and the 2 sight" in said
    assert not build_log(recording([Frame(0.0, marked(30))])).remarks


def test_several_of_one_id_are_several_in_a_frame_of_one_camera() -> None:
    """Two cameras that see marker 4 at once see one; two markers in a frame of one leave that of the other alone."""
    left, right = (Detector(Markers("4X4_50", 0.1), replace(CAMERA, name=name)) for name in ("left", "right"))
    frames = [Frame(0.0, marked(30), camera="left"), Frame(0.0, marked(30), camera="right")]
    log = build_log(recording(frames, detector=left, others=[right]))
    assert log.ids.tolist() == [4]
    assert not log.remarks
    assert log.notes["counts"] == {"frames": 2, "sightings": 1, "sightings beyond 3 m": 0, JOINED: 1}
    (one,) = build_log(recording([Frame(0.0, marked(30))])).z_cov
    np.testing.assert_allclose(log.z_cov[0], one / 2, rtol=1e-9)
    pair = Detector(Markers("4X4_50", 0.1), replace(CAMERA, name="left", width=320))
    frames = [Frame(0.0, np.hstack((marked(30), marked(36))), camera="left"), frames[1]]
    log = build_log(recording(frames, detector=pair, others=[right]))
    assert log.ids.tolist() == [4]
    assert log.notes["counts"]["same id twice in a frame"] == 2
    assert "none of these is in the log, and the 1 sightings of other frames may be of any of them" in log.remarks[0]


def test_a_frame_of_a_camera_is_later_than_its_last_one() -> None:
    left, right = (Detector(Markers("4X4_50", 0.1), replace(CAMERA, name=name)) for name in ("left", "right"))
    frames = [Frame(0.5, BLANK, camera=name) for name in ("left", "right", "left")]
    refused("frame 2 is at 0.5 s, expected later", build_log, recording(frames, detector=left, others=[right]))
    frames = [Frame(0.5, None, camera="left"), Frame(0.5, marked(30), camera="right")]
    log = build_log(recording(frames, detector=left, others=[right]))
    assert (len(log), log.ids.tolist()) == (1, [4])
    assert log.notes["counts"]["frames that could not be decoded"] == 1


def test_several_ids_of_several_markers_are_named() -> None:
    def pair(name: int) -> Image:
        return np.hstack((marked(30, name), marked(36, name)))

    both = np.vstack((pair(4), pair(7)))
    detector = Detector(Markers("4X4_50", 0.1), replace(CAMERA, width=320, height=240))
    (said,) = build_log(recording([Frame(0.0, both), Frame(0.5, both)], detector=detector)).remarks
    assert "each of the ids 4, 7 was on several markers of one frame, in up to 2 frames: none" in said


@pytest.mark.parametrize(
    ("camera", "lens"),
    [
        ("fisheye", {}),
        ("pinhole", {}),
        ("fisheye", {"model": "pinhole"}),
        ("fisheye", {"model": "pinhole", "distortion": (0.0,) * 5}),
        ("pinhole", {"distortion": ()}),
        ("wide", {"distortion": ()}),
    ],
)
def test_a_lens_that_is_another_is_a_remark(camera: str, lens: dict[str, Any]) -> None:
    """Markers in frames of one lens, read as those of another: a square is none."""
    seen = record(Options(seconds=6.0, frame_rate=2.0, camera=camera), np.random.default_rng(3))[0]
    known = replace(seen.detector, camera=replace(seen.detector.camera, **lens))
    found = build_log(replace(seen, detector=known)).remarks
    if not lens:
        assert found == []
    else:
        (said,) = found
        assert re.search("the corners of large markers fit [0-9]+ times worse than their patterns do", said)


def test_a_pause_of_the_frames_is_none_of_the_readings() -> None:
    wheels = build_log(recording(blank(0.0, 0.05, 1.0)))
    assert wheels.notes[PAUSE] == pytest.approx(0.1)
    drifting = build_log(recording(blank(0.0, 0.05, 1.0), motion=Drift(0.4, 0.6)))
    assert drifting.notes[PAUSE] == pytest.approx(0.95)


def test_frames_without_readings_are_counted() -> None:
    log = build_log(recording(blank(-0.1, 0.2, 0.7, 1.3)))
    assert log.t.tolist() == [0.2, 0.7]
    assert log.notes["counts"]["frames"] == 4
    assert log.notes["counts"]["frames without encoder readings"] == 2


def test_frames_are_taken_one_at_a_time() -> None:
    def endless() -> Iterator[Frame]:
        yield from blank(0.0, 0.5)
        raise InputError("frame 2 cannot be read")

    refused("frame 2 cannot be read", build_log, recording(endless()))
    assert len(build_log(recording(iter(blank(0.0, 0.5))))) == 2


def test_covariances_are_positive_definite_at_rest() -> None:
    t = np.array([0.0, 1.0])
    log = build_log(recording(blank(0.0, 1.0), motion=Wheels(Ticks(t, np.zeros((2, 2))), ENCODER)))
    np.testing.assert_array_equal(log.delta_cov[1], Encoder(1, 1, 1, 0).floors.cov)


@pytest.mark.parametrize(
    ("frames", "changes", "message"),
    [
        (blank(0.0, 0.5, 0.5), {}, "bench: frame 2 is at 0.5 s, expected later than 0.5 s"),
        (blank(0.0, float("nan")), {}, "bench: frame 1 is at nan s, expected later than 0.0 s"),
        (blank(5.0), {}, "bench: found no frame within the time of the encoder readings, expected one"),
        ([], {}, "bench: found no frame within the time of the encoder readings, expected one"),
        (blank(0.0), {"motion": Wheels(Ticks(np.zeros(0), np.zeros((0, 2))), ENCODER)}, "encoder: found no readings"),
        (
            blank(0.0),
            {"motion": Wheels(Ticks(np.array([0.0, 1.0, 0.5]), np.zeros((3, 2))), ENCODER)},
            "encoder: reading 2 is at 0.5 s, expected later than 1.0 s",
        ),
        (
            blank(0.0, 0.5),
            {"motion": Wheels(UNCOUNTED, ENCODER)},
            r"encoder: in reading 1, at 1\.0 s, the left wheel's count is nan, expected a finite number",
        ),
    ],
)
def test_what_cannot_be_used_is_refused(frames: list[Frame], changes: dict[str, Any], message: str) -> None:
    refused(message, build_log, recording(frames, **changes))


ROLLING = Detector(Markers("4X4_50", 0.1), replace(CAMERA, readout=0.03))
NARROW = Detector(Markers("4X4_50", 0.1), replace(CAMERA, readout=0.4))


def test_a_rolling_shutters_motion_is_the_mean_of_the_readings_around_the_frame() -> None:
    made = recording(blank(0.5), detector=ROLLING)
    motion = camera_motion(made.motion, made.detector.camera, 0.53)
    delta, cov = made.motion.odometry(0.43, 0.63)
    expected = carried(Odometry(delta, cov), 0.2, CAMERA.mounting)
    np.testing.assert_allclose(motion.rates, expected.rates, atol=1e-12)
    np.testing.assert_allclose(motion.cov, expected.cov, rtol=1e-9)
    # The wheels: 100 t^2 and 120 t counts of a millimetre; forward is the camera's z, turning left about its -y.
    left, right = 0.2 * 0.53, 0.12
    np.testing.assert_allclose(motion.rates, [0, -(right - left) / 0.3, 0, 0, 0, (left + right) / 2], atol=1e-3)
    assert (np.linalg.eigvalsh(motion.cov) > -1e-12).all()


def test_a_readout_longer_than_that_is_the_time_of_the_mean() -> None:
    made = recording(blank(0.5), detector=NARROW)
    motion = camera_motion(made.motion, made.detector.camera, 0.5)
    expected = carried(made.motion.odometry(0.3, 0.7), 0.4, CAMERA.mounting)
    np.testing.assert_allclose(motion.rates, expected.rates, atol=1e-12)


@pytest.mark.parametrize(("t", "start", "end"), [(0.0, 0.0, 0.1), (0.95, 0.85, 1.0)])
def test_where_readings_begin_or_end_it_is_the_mean_of_those_there_are(t: float, start: float, end: float) -> None:
    made = recording(blank(0.5), detector=ROLLING)
    motion = camera_motion(made.motion, made.detector.camera, t)
    expected = carried(made.motion.odometry(start, end), end - start, CAMERA.mounting)
    np.testing.assert_allclose(motion.rates, expected.rates, atol=1e-12)


def test_without_a_rolling_shutter_or_time_between_readings_there_is_no_motion() -> None:
    assert camera_motion(recording(blank(0.5)).motion, CAMERA, 0.5) is None
    once = Wheels(Ticks(np.array([0.5]), np.zeros((1, 2))), ENCODER)
    assert camera_motion(once, ROLLING.camera, 0.5) is None


def test_a_robot_that_may_drift_unmeasured_leaves_its_sightings_uncertain() -> None:
    """At rest by its readings: the marker is where a global shutter sees it, but less surely, off the middle row."""
    noise = PropagatedNoise()
    images = [marked(48), np.roll(marked(48), 30, axis=0)]
    frames = [Frame(t, image) for t, image in zip((0.1, 0.2), images, strict=True)]
    drift = Drift(0.3, 0.3)
    rolling, whole = (
        build_log(recording(frames, motion=drift, noise=noise, **({"detector": ROLLING} if on else {})))
        for on in (True, False)
    )
    sd, without = (np.sqrt(log.z_cov[:, 1, 1]) for log in (rolling, whole))
    assert (np.abs(rolling.z[:, 1] - whole.z[:, 1]) < 2 * sd).all()
    # the two start apart and look at other pixels of the marker
    assert (np.abs(rolling.z[:, 0] - whole.z[:, 0]) < 2 * np.sqrt(whole.z_cov[:, 0, 0])).all()
    # A marker across 40 % of the rows tells most of the motion by its own slant; what is left grows off the middle.
    assert sd[0] > without[0]
    assert sd[1] > 2 * without[1]
    added = np.sqrt(sd**2 - without**2)
    assert added[1] > 3 * added[0]


def test_a_distance_from_the_camera_is_in_space() -> None:
    frame = Frame(0.5, marked(30))
    seen = see(recording([frame]), frame)
    distance = float(np.linalg.norm(seen.sightings[0].centre))
    assert seen.z[0, 0] == pytest.approx(distance, abs=1e-3)  # straight ahead, at the camera's height
    for limit, kept in ((1.01 * distance, True), (0.99 * distance, False)):
        assert see(recording([frame], max_range=np.inf, max_distance=limit), frame).kept.tolist() == [kept]
    high = replace(CAMERA, mounting=mounting(0, 0, 0.3, 1.2))  # looks down: the plane's range is shorter
    down = {"detector": Detector(Markers("4X4_50", 0.1), high)}
    assert see(recording([frame], **down), frame).z[0, 0] < 0.5 * distance
    assert see(recording([frame], **down, max_range=0.8 * distance), frame).kept.tolist() == [True]
    assert see(recording([frame], **down, max_distance=0.8 * distance), frame).kept.tolist() == [False]
    log = build_log(recording([frame], max_range=np.inf, max_distance=0.5 * distance))
    assert log.notes["counts"][f"sightings beyond {0.5 * distance:g} m from the camera"] == 1
    assert "max_range" not in log.notes["markers"]
