"""A sensor's steps, each against its formula or a plain loop."""

import math
from statistics import NormalDist

import numpy as np
import pytest
from scipy.fft import dctn, idctn

from slamduel.core.se2 import Array
from slamduel.datasets.rendering.sensor import LINES, SENSORS, Sensor

RAMP = np.tile(np.linspace(0, 255, 511), (4, 1))


def taken(sensor: Sensor, light: Array, seed: int = 0) -> Array:
    return sensor.picture(light.astype(np.float32), np.random.default_rng(seed)).astype(float)


def textured(height: int = 24, width: int = 32, colours: int = 1, seed: int = 1) -> Array:
    return np.random.default_rng(seed).uniform(30, 220, (colours, height, width)).squeeze()


def bayer(light: Array) -> Array:
    """(h, w) the levels of a sensor of 16 bits under red, green / green, blue."""
    raw = light[1].copy()
    raw[0::2, 0::2], raw[1::2, 1::2] = light[0][0::2, 0::2], light[2][1::2, 1::2]
    return np.round(raw * 65535 / 255)


def test_the_ideal_sensor_adds_one_normal_number_per_byte_and_rounds() -> None:
    light = textured(100, 120)
    drawn = np.frombuffer(np.random.default_rng(3).bytes(light.size), np.uint8).reshape(light.shape)
    quantiles = np.array([NormalDist().inv_cdf((k + 0.5) / 256) for k in range(256)])
    noise = 2 * quantiles / math.sqrt((quantiles**2).mean())
    expected = np.clip(np.round(light.astype(np.float32) + noise.astype(np.float32)[drawn]), 0, 255)
    # A sum may round otherwise where the table differs in its last bit.
    assert (taken(Sensor(), light, 3) != expected).mean() < 1e-3
    rng, other = np.random.default_rng(3), np.random.default_rng(3)
    Sensor().picture(light.astype(np.float32), rng)
    other.bytes(light.size)
    assert rng.random() == other.random()


def srgb(share: float) -> float:
    return 12.92 * share if share <= 0.0031308 else 1.055 * math.pow(share, 1 / 2.4) - 0.055


@pytest.mark.parametrize("tone", ["srgb", 1.8, 2.2, 2.4])
def test_tones_are_those_of_the_formula(tone: float | str) -> None:
    made = taken(Sensor(0.0, tone=tone), RAMP)[0]
    curve = srgb if isinstance(tone, str) else lambda share: math.pow(share, 1 / tone)
    expected = np.array([255 * curve(grey / 255) for grey in RAMP[0].tolist()])
    # half a level of 16 bits is 0.002 of a grey level, times the slope at black: 12.92, or of a gamma more
    steep = RAMP[0] > 1
    np.testing.assert_allclose(made[steep], expected[steep], atol=0.52)
    assert (np.diff(made) >= 0).all()
    assert (made[0], made[-1]) == (0, 255)


def test_linear_is_a_gamma_of_one_and_light_saturates() -> None:
    np.testing.assert_array_equal(taken(Sensor(0.0, tone=1.0), RAMP), taken(Sensor(0.0), RAMP))
    for sensor in (Sensor(0.0), Sensor(0.0, tone="srgb"), Sensor(0.0, mosaic="bilinear"), Sensor(0.0, sharpen=0.5)):
        assert (taken(sensor, np.full((20, 20), 400.0)) == 255).all()


def interpolated(raw: Array, edge_aware: bool) -> Array:
    """(h, w, 3) red, green and blue of the inner pixels: the mean of the neighbours of each missing colour."""
    height, width = raw.shape
    found = np.zeros((height, width, 3))
    for v in range(1, height - 1):
        for u in range(1, width - 1):
            own = (0 if v % 2 == 0 else 1) if u % 2 == v % 2 == 0 else (2 if u % 2 == v % 2 else 1)
            across, along = (raw[v, u - 1], raw[v, u + 1]), (raw[v - 1, u], raw[v + 1, u])
            diagonal = [raw[v + i, u + j] for i in (-1, 1) for j in (-1, 1)]
            if own == 1:
                red, blue = (across, along) if v % 2 == 0 else (along, across)
                found[v, u] = np.mean(red), raw[v, u], np.mean(blue)
                continue
            green = (*across, *along)
            if edge_aware:
                green = along if abs(across[0] - across[1]) > abs(along[0] - along[1]) else across
            found[v, u, 1] = np.mean(green)
            found[v, u, own], found[v, u, 2 - own] = raw[v, u], np.mean(diagonal)
    return found


@pytest.mark.parametrize("tone", ["linear", "srgb"])
@pytest.mark.parametrize("mosaic", ["bilinear", "edge-aware"])
def test_missing_colours_are_interpolated_before_tones_and_grey(mosaic: str, tone: float | str) -> None:
    light = textured(colours=3)
    planes = interpolated(bayer(light), mosaic == "edge-aware") / 65535
    toned = planes if tone == "linear" else np.vectorize(srgb)(planes)
    expected = 255 * toned @ [0.299, 0.587, 0.114]
    inner = np.s_[2:-2, 2:-2]
    np.testing.assert_allclose(taken(Sensor(0.0, mosaic=mosaic, tone=tone), light)[inner], expected[inner], atol=0.52)


def test_without_a_filter_a_sensor_adds_the_colours_up() -> None:
    light = textured(colours=3)
    np.testing.assert_allclose(taken(Sensor(0.0), light), np.tensordot([0.299, 0.587, 0.114], light, 1), atol=0.51)


@pytest.mark.parametrize("grey", [20.0, 110.0, 200.0])
def test_the_noise_of_photons_grows_with_the_light(grey: float) -> None:
    image = taken(Sensor(grain=1.5, photon=0.1), np.full((500, 600), grey))
    # rounding adds 1/12; 300,000 pixels know a variance to 0.26 %
    assert image.var() == pytest.approx(1.5**2 + 0.1 * grey + 1 / 12, rel=6 * math.sqrt(2 / 300_000))
    assert image.mean() == pytest.approx(grey, abs=6 * math.sqrt((1.5**2 + 0.1 * grey) / 300_000) + 0.01)


def test_photons_leave_the_other_noise_as_it_is() -> None:
    light = textured(100, 120)
    np.testing.assert_array_equal(taken(Sensor(photon=1e-20), light, 5), taken(Sensor(), light, 5))
    first, second = np.random.default_rng(5), np.random.default_rng(5)
    for sensor, rng in ((Sensor(), first), (Sensor(photon=0.1), second)):
        sensor.picture(light.astype(np.float32), rng)
    assert first.random() == second.random()


def test_sharpening_adds_what_a_blur_takes_away() -> None:
    light, radius = textured(80, 80), 1.2
    reach = np.arange(-30, 31)
    weights = np.exp(-(reach**2) / (2 * radius**2))
    weights /= weights.sum()
    soft = np.apply_along_axis(lambda row: np.convolve(row, weights, "same"), 0, light)
    soft = np.apply_along_axis(lambda row: np.convolve(row, weights, "same"), 1, soft)
    inner = np.s_[8:-8, 8:-8]
    expected = np.clip(light + 0.8 * (light - soft), 0, 255)
    # the blur is cut off at four standard deviations
    np.testing.assert_allclose(taken(Sensor(0.0, sharpen=0.8), light)[inner], expected[inner], atol=0.6)


QUANTISED = np.array(
    [
        [16, 11, 10, 16, 24, 40, 51, 61],
        [12, 12, 14, 19, 26, 58, 60, 55],
        [14, 13, 16, 24, 40, 57, 69, 56],
        [14, 17, 22, 29, 51, 87, 80, 62],
        [18, 22, 37, 56, 68, 109, 103, 77],
        [24, 35, 55, 64, 81, 104, 113, 92],
        [49, 64, 78, 87, 103, 121, 120, 101],
        [72, 92, 95, 98, 112, 100, 103, 99],
    ]
)
"""The luminance table of JPEG (ITU-T T.81, K.1), for quality 50."""


@pytest.mark.parametrize("quality", [50, 70, 85])
def test_jpeg_rounds_the_cosines_of_blocks(quality: int) -> None:
    light = np.round(textured(32, 40))
    table = np.clip(np.floor((QUANTISED * (200 - 2 * quality) + 50) / 100), 1, 255)
    expected = np.empty_like(light)
    for v in range(0, 32, 8):
        for u in range(0, 40, 8):
            cosines = np.asarray(dctn(light[v : v + 8, u : u + 8] - 128, norm="ortho"))
            expected[v : v + 8, u : u + 8] = np.asarray(idctn(np.round(cosines / table) * table, norm="ortho")) + 128
    difference = taken(Sensor(0.0, jpeg=quality), light) - np.clip(expected, 0, 255)
    # A coefficient next to the middle between two steps may be rounded the other way.
    assert np.median(np.abs(difference)) < 0.5
    assert np.abs(difference).mean() < 0.1 * np.abs(light - expected).mean()


def test_rows_are_read_one_band_after_the_other() -> None:
    assert Sensor().delays(480).tolist() == [0.0]
    delays = Sensor(readout=0.03).delays(480)
    assert len(delays) == 480 / LINES
    np.testing.assert_allclose(delays, 0.03 * ((np.arange(48) * LINES + LINES / 2) / 480 - 0.5), rtol=1e-12)
    assert Sensor(readout=1.0).delays(25).tolist() == pytest.approx([5 / 25 - 0.5, 15 / 25 - 0.5, 22.5 / 25 - 0.5])


def test_named_cameras_have_every_step_they_are_known_for() -> None:
    phone, webcam, industrial = (SENSORS[name] for name in ("phone", "webcam", "industrial"))
    assert (phone.tone, phone.mosaic, phone.sharpen, phone.radius, phone.jpeg) == ("srgb", "edge-aware", 0.8, 1.2, 85)
    assert (webcam.tone, webcam.jpeg, webcam.mosaic, webcam.exposure) == (2.2, 70, "off", 0.008)
    assert (industrial.tone, industrial.mosaic, industrial.photon, industrial.jpeg) == ("linear", "bilinear", 0.02, 0)
    assert SENSORS["ideal"] == Sensor()
