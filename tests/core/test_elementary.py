"""Elementary functions: as near to the truth as they say, in arrays as one by one, and made of exact operations."""

import ast
import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from slamduel.core import elementary
from slamduel.core.elementary import arctan2, cos, exp, hypot, sin, sinc, sincos

Array = NDArray[np.float64]
rng = np.random.default_rng(7)
ANGLES = np.concatenate((
    rng.uniform(-8, 8, 20_000), rng.uniform(-1e5, 1e5, 5_000), rng.normal(0, 1e-4, 5_000),
    np.arange(-40, 41) * np.pi / 4, [0.0, -0.0, 1e-300, np.pi, -np.pi],
))  # fmt: skip
POINTS = rng.normal(size=(30_000, 2)) * 10.0 ** rng.uniform(-4, 4, (30_000, 2))


def units_off(found: Array, right: Array) -> float:
    """The largest difference from `right`, of higher precision, in units in the last place."""
    return float(np.max(np.abs(found - right) / np.spacing(np.maximum(np.abs(right.astype(float)), 1e-300))))


@pytest.fixture(scope="module")
def longer() -> type[np.longdouble]:
    if np.finfo(np.longdouble).nmant <= np.finfo(np.float64).nmant:
        pytest.skip("there is no longer float here to compare with")
    return np.longdouble


def test_sine_and_cosine_are_within_a_unit(longer: type[np.longdouble]) -> None:
    s, c = sincos(ANGLES)
    assert units_off(s, np.sin(ANGLES.astype(longer))) < 1
    assert units_off(c, np.cos(ANGLES.astype(longer))) < 1


def test_the_angle_of_a_point_is_within_one_unit_and_a_fifth(longer: type[np.longdouble]) -> None:
    y, x = POINTS.T
    assert units_off(arctan2(y, x), np.arctan2(y.astype(longer), x.astype(longer))) < 1.2


def test_the_exponential_is_within_a_unit(longer: type[np.longdouble]) -> None:
    x = rng.uniform(-30, 30, 20_000)
    assert units_off(exp(x), np.exp(x.astype(longer))) < 1.2
    np.testing.assert_allclose(exp(np.array([-700.0, 0.0, 700.0])), np.exp([-700.0, 0.0, 700.0]), rtol=1e-15)


def test_large_angles_are_off_by_no_more_than_their_own_rounding() -> None:
    large = rng.uniform(5e5, 1e12, 5_000)
    assert (np.abs(sin(large) - np.sin(large)) <= np.spacing(large)).all()
    assert (np.abs(cos(large) - np.cos(large)) <= np.spacing(large)).all()


def test_one_at_a_time_gives_the_same_bits() -> None:
    angles = np.concatenate((ANGLES[::20], ANGLES[-90:], [1e7, np.nan, np.inf]))
    one_by_one = np.array([sincos(float(angle)) for angle in angles])
    np.testing.assert_array_equal(np.array(sincos(angles)).T, one_by_one)
    few = [[0, 0], [-0.0, -0.0], [0, -1], [-0.0, -1], [5, 0], [1, 1], [2, 4], [7, 16]]
    y, x = np.concatenate((POINTS[::20], few)).T
    one_by_one = np.array([arctan2(a, b) for a, b in zip(y.tolist(), x.tolist(), strict=True)])
    assert arctan2(y, x).tobytes() == one_by_one.tobytes()


@pytest.mark.parametrize("y", [0.0, -0.0, 1.0, -1.0])
@pytest.mark.parametrize("x", [0.0, -0.0, 1.0, -1.0])
def test_on_the_axes_it_is_the_angle_that_c_gives(y: float, x: float) -> None:
    for found in (float(arctan2(y, x)), float(arctan2(np.array([y]), np.array([x]))[0])):
        assert found == math.atan2(y, x)
        assert math.copysign(1, found) == math.copysign(1, math.atan2(y, x))


def test_what_is_not_finite_has_no_value() -> None:
    for odd in (np.nan, np.inf, -np.inf):
        assert np.isnan(sin(odd))
        assert np.isnan(cos(np.array([odd]))).all()
    for y, x in ((np.nan, 1.0), (1.0, np.nan), (np.inf, 1.0), (np.inf, np.inf)):
        assert np.isnan(arctan2(y, x))
        assert np.isnan(arctan2(np.array([y]), np.array([x]))).all()


def test_shapes_are_kept() -> None:
    angle = np.zeros((2, 3))
    for found in (*sincos(angle), sinc(angle), exp(angle), arctan2(angle, 1.0), arctan2(0.0, angle), hypot(angle, 1.0)):
        assert found.shape == (2, 3)
    assert sinc(angle).tolist() == [[1.0] * 3] * 2
    assert sinc(1e-9) == 1.0
    assert sinc(2.0) == sin(2.0) / 2.0
    assert hypot(3.0, 4.0) == 5.0


def test_many_numbers_are_worked_on_in_blocks_with_the_same_bits() -> None:
    rng = np.random.default_rng(0)
    angle, x = rng.normal(0, 1e3, (2, elementary.BLOCK + 7)), rng.normal(size=(2, elementary.BLOCK + 7))
    angle[1, -1] = 1e9
    found, across = sincos(angle), arctan2(angle, x)
    for k in (0, 1):
        for some in (slice(0, 1000), slice(-1000, None)):
            one = sincos(angle[k, some])
            np.testing.assert_array_equal(found.sin[k, some], one.sin)
            np.testing.assert_array_equal(found.cos[k, some], one.cos)
            np.testing.assert_array_equal(across[k, some], arctan2(angle[k, some], x[k, some]))
    np.testing.assert_array_equal(arctan2(1.0, angle), arctan2(np.ones(angle.shape), angle))


def test_nothing_in_it_depends_on_the_processor() -> None:
    """Of numpy and of C's library only what IEEE 754 gives one result."""
    tree = ast.parse(Path(elementary.__file__).read_text(encoding="utf-8"))
    used = {
        f"{node.value.id}.{node.attr}"
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ("np", "math")
    }
    exact = {"abs", "minimum", "maximum", "rint", "mod", "fmod", "where", "sqrt", "copysign", "signbit", "ldexp"}
    about = {"asarray", "broadcast_arrays", "empty", "errstate", "float64", "int64", "pi", "nan", "isfinite"}
    assert {name.partition(".")[2] for name in used} <= exact | about
