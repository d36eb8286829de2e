"""The sensor and the print of a rendered world, as its options say."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from refusals import refusal, refused
from slamduel.bench.plan.spec import read_options
from slamduel.core.factors import Log
from slamduel.datasets.rendering.sensor import SENSORS, Sensor
from slamduel.datasets.rendering.sheet import Print
from slamduel.datasets.worlds.aruco_room import Options, aruco_room, record
from slamduel.frontend.markers.noise_fit import squares
from tiers import first_quick


def test_a_camera_has_the_named_sensor_and_every_effect_that_is_given() -> None:
    phone = SENSORS["phone"]
    for given, sensor, prints in (
        ([], SENSORS["ideal"], Print()),
        ([("sensor", "phone"), ("ink", "0.003")], phone, Print(ink=0.003)),
        ([("sensor", "phone"), ("mosaic", "off"), ("jpeg", "0")], replace(phone, mosaic="off", jpeg=0), Print()),
        ([("tone", "2.2"), ("photon", "0.05"), ("grain", "1")], Sensor(1.0, 0.05, tone=2.2), Print()),
        ([("sharpen", "1"), ("sharpen_radius", "2")], Sensor(sharpen=1, radius=2), Print()),
        ([("tone", "srgb"), ("aberration", "1e-3")], Sensor(tone="srgb", aberration=1e-3), Print()),
        (
            [("readout", "0.03"), ("curl", "-0.004"), ("gloss", "50")],
            Sensor(readout=0.03),
            Print(curl=-0.004, gloss=50.0),
        ),
    ):
        options = read_options(Options, given, "dataset aruco-room")
        assert (options.made_sensor, options.prints) == (sensor, prints)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("sensor", "eye"), "option sensor=eye is not one of its values; expected one of ideal, phone, webcam, ind"),
        (("tone", "log"), "option tone=log: found 'log', expected one of linear, srgb, or a number from 1.0 to 3.0"),
        (("tone", "0.5"), "option tone=0.5 is out of range; expected one of linear, srgb, or a number from 1.0 to 3.0"),
        (("mosaic", "vng"), "option mosaic=vng is not one of its values; expected one of off, bilinear, edge-aware"),
        (("jpeg", "101"), "option jpeg=101 is out of range; expected a whole number from 0 to 100"),
        (("ink", "0.1"), "option ink=0.1 is out of range; expected a number from -0.02 to 0.02"),
    ],
)
def test_a_camera_that_cannot_be_is_a_sentence(given: tuple[str, str], said: str) -> None:
    assert said in refusal(read_options, Options, [given], "dataset aruco-room")


def test_detection_knows_of_the_shutter_if_it_is_to_be_modelled() -> None:
    for shutter, readout, known in (("modelled", 0.03, 0.03), ("ignored", 0.03, 0.0), ("modelled", None, 0.0)):
        recording, _ = record(Options(readout=readout, shutter=shutter), np.random.default_rng(0))
        assert recording.detector.camera.readout == known


def test_a_shutter_slower_than_the_frames_is_refused() -> None:
    rng, slow = np.random.default_rng(0), Options(readout=0.05, frame_rate=30.0)
    refused(r"option readout=0\.05: expected at most .* 0\.03333 s at frame_rate=30", record, slow, rng)


def test_a_sensor_leaves_all_else_of_the_drive_as_it_is() -> None:
    """Photons are drawn apart: nothing else of the drive is another with them, not even the noise of reading."""
    changes: dict[str, Any] = {"seconds": 1.0, "frame_rate": 2.0, "shadow": 0.4, "occlusion": 0.5, "gain_drift": 0.2}
    made = [record(Options(**changes, photon=photon), np.random.default_rng(3))[0] for photon in (None, 1e-20, 0.05)]
    first, second, third = ([frame.image for frame in recording.frames] for recording in made)
    np.testing.assert_array_equal(first, second)
    assert all((one != other).any() for one, other in zip(first, third, strict=True))
    logs = [aruco_room(Options(**changes, photon=photon), np.random.default_rng(3)).log for photon in (None, 0.05)]
    np.testing.assert_array_equal(logs[0].delta, logs[1].delta)


@pytest.mark.parametrize("sensor", first_quick(["phone", "webcam", "industrial"]))
def test_a_drive_with_a_real_camera_is_a_log(sensor: str) -> None:
    options = Options(seconds=1.0, frame_rate=2.0, sensor=sensor, ink=0.002, curl=0.002, gloss=40.0, readout=0.02)
    log, _ = aruco_room(options, np.random.default_rng(3))
    assert len(log) == 3


@cache
def without_rocking(**options: Any) -> Log:
    """The log of a drive of 3.2 s without rocking, so that sightings have the noise of their corners alone."""
    chosen = Options(seconds=3.2, frame_rate=2.5, noise="propagated", sway=0.0, **options)
    return aruco_room(chosen, np.random.default_rng(1)).log


@pytest.mark.slow
def test_a_rolling_shutter_that_is_modelled_sees_what_a_global_one_does() -> None:
    """Sightings of the same drive: modelled they agree within the stated noise, ignored they are far outside."""
    plain = without_rocking()
    keys = list(zip(plain.sighting_step.tolist(), plain.ids.tolist(), strict=True))
    medians = []
    for shutter in ("modelled", "ignored"):
        other = without_rocking(readout=0.03, shutter=shutter)
        rows = {key: row for row, key in enumerate(zip(other.sighting_step.tolist(), other.ids.tolist(), strict=True))}
        both = [(keys.index(key), row) for key, row in rows.items() if key in keys]
        assert len(both) > 0.9 * len(keys) > 20
        one, two = np.array(both).T
        cov = plain.z_cov[one] + other.z_cov[two]
        medians.append(float(np.median(squares(plain.z[one] - other.z[two], cov)) / 2))
    modelled, ignored = medians
    assert modelled < 2
    assert ignored > 20
