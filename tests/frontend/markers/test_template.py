"""The fit of a printed pattern: its model, its derivatives, its covariance, and what it makes of frames without one."""

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.ndimage import gaussian_filter
from scipy.stats import multivariate_normal, norm

from slamduel.datasets.rendering.cameras import CAMERAS
from slamduel.datasets.rendering.clutter import drawn
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.markers import template
from slamduel.frontend.markers._alignment import (
    PARAMETERS,
    RIM,
    _accumulate,  # pyright: ignore[reportPrivateUsage]
    _believe,  # pyright: ignore[reportPrivateUsage]
    _moved,  # pyright: ignore[reportPrivateUsage]
)
from slamduel.frontend.markers.aruco import Image
from slamduel.frontend.markers.square_pose import square
from slamduel.frontend.se2 import Array

PATTERN = template.pattern(drawn("4X4_50", 7)[1:-1, 1:-1])
M = len(PATTERN) - 2 * RIM
CUT_OFF = 4.5
"""Standard deviations beyond which the compiled model takes an edge for a step."""


class Model(NamedTuple):
    """The compiled model at one pixel."""

    grey: float
    jacobian: Array  # (19,)


def at_pixel(place: Array, G: Array, look: Array, free: bool = True) -> Model:
    """Grey level and derivatives, from the normal equations of one pixel that is black."""
    normal, gradient = np.zeros((PARAMETERS, PARAMETERS)), np.zeros(PARAMETERS)
    loss, chi, total = _accumulate(place[None], PATTERN, M, G, look, np.inf, free, normal, gradient)
    assert loss == pytest.approx(chi)
    assert total == 1
    prior, pull = np.zeros_like(normal), np.zeros_like(gradient)
    _believe(look, max(chi, 0.25), free, prior, pull)
    grey = np.sqrt(loss)
    jacobian = -(gradient - pull) / grey  # the residual is minus the grey level
    np.testing.assert_allclose(normal - prior, np.outer(jacobian, jacobian), atol=1e-5 * np.abs(normal).max())
    return Model(float(grey), jacobian)


def tilted(turn: float, stretch: float, tilt: tuple[float, float], scale: float) -> Array:
    """A homography from px to modules, with the pattern's middle at the origin."""
    c, s = np.cos(turn), np.sin(turn)
    affine = np.array([[c, -s], [s, c]]) @ np.diag([stretch, 1 / stretch]) / scale
    G = np.eye(3)
    G[:2, :2] = affine
    G[2, :2] = tilt
    centre = np.eye(3)
    centre[:2, 2] = M / 2
    return centre @ G


def places(rng: np.random.Generator, G: Array, count: int) -> Array:
    """(count, 7) black pixels within the pattern, rays being px."""
    uv = rng.uniform(-0.4, M + 0.4, (count, 2))
    rays = np.column_stack((uv, np.ones(count))) @ np.linalg.inv(G).T
    rays = rays[:, :2] / rays[:, 2:]
    return np.column_stack((np.zeros(count), rays, np.tile([1.0, 0.0, 0.0, 1.0], (count, 1))))


def look_of(a: float, b: float, c: float, kurtosis: float = 0.0, light: tuple[float, ...] = (0.0,) * 5) -> Array:
    return np.array([a, b, c, kurtosis, 40.0, 200.0, *light])


def blur_of(look: Array) -> Array:
    root = np.array([[np.exp(look[0]), 0.0], [look[1], np.exp(look[2])]])
    return root @ root.T


def seen_exactly(uv: Array, cov: Array) -> float:
    """How much white a pixel at `uv` sees of the pattern on endless paper, a Gaussian `cov` modules^2 over it."""
    cells = np.argwhere(~PATTERN) - RIM
    spread = multivariate_normal(uv, cov, abseps=1e-9, releps=1e-9)  # pyright: ignore[reportArgumentType]
    black = sum(
        float(spread.cdf([x + 1, y + 1], lower_limit=[x, y]))
        for y, x in cells
        if abs(x + 0.5 - uv[0]) < 3 and abs(y + 0.5 - uv[1]) < 3
    )
    return 1 - black


@pytest.mark.parametrize("turn", [0.0, 0.5])
def test_the_model_is_the_blurred_pattern(turn: float) -> None:
    """Where the blur is straight in the pattern's own coordinates the model is exact.

    Only tails beyond CUT_OFF are left out, of up to three edges each way, and the normal distribution has 3.4e-6 there.
    """
    G, look = tilted(turn, 1.0, (0.0, 0.0), 5.0), look_of(np.log(0.8), 0.0, np.log(0.8))
    for place in places(np.random.default_rng(1), G, 40):
        uv = G[:2] @ np.array([*place[1:3], 1.0])
        expected = 40 + 160 * seen_exactly(uv, 0.8**2 / 25 * np.eye(2))
        assert at_pixel(place, G, look).grey == pytest.approx(expected, abs=960 * float(norm.sf(CUT_OFF)))


def test_a_blur_that_is_askew_is_right_to_second_order() -> None:
    """Mehler's series: what is left out is r^n / n! times the product of n-th derivatives, n = 2, 3, ... at a corner.

    Four cells that meet weigh 2 at the most, and the corners of a cell around a pixel do not peak together.
    """
    G, look = tilted(0.3, 1.25, (0.0, 0.0), 5.0), look_of(np.log(0.8), 0.0, np.log(0.8))
    cov = G[:2, :2] @ blur_of(look) @ G[:2, :2].T
    r = abs(cov[0, 1]) / np.sqrt(cov[0, 0] * cov[1, 1])
    assert r > 0.1
    s = np.linspace(-6, 6, 2001)
    # derivatives of the distribution function: phi times Hermite's polynomials
    second, third, fourth = (np.abs(h * norm.pdf(s)).max() for h in (s, s**2 - 1, s**3 - 3 * s))
    bound = 2 * (r**2 / 2 * second**2 + r**3 / 6 * third**2 + r**4 / 24 * fourth**2 / (1 - r))
    first = 2 * r * norm.pdf(0) ** 2
    assert bound < first / 5  # so that leaving the correction out would be noticed
    misses = []
    for place in places(np.random.default_rng(2), G, 80):
        uv = G[:2] @ np.array([*place[1:3], 1.0])
        misses.append(at_pixel(place, G, look).grey - 40 - 160 * seen_exactly(uv, cov))
    assert np.abs(misses).max() < 160 * bound


def test_a_streak_is_a_kurtosis() -> None:
    """A straight edge under a Gaussian and an even streak: right to the next terms of Edgeworth's series."""
    width, sigma = 1.2, 0.6  # px
    variance = sigma**2 + width**2 / 12
    kurtosis = -(width**4) / 120 / variance**2
    sixth = width**6 / 252 / variance**3
    s = np.linspace(-6, 6, 4001)
    fifth_hermite, seventh_hermite = s**5 - 10 * s**3 + 15 * s, s**7 - 21 * s**5 + 105 * s**3 - 105 * s
    bound = sum(
        np.abs(term * norm.pdf(s)).max() for term in (sixth / 720 * fifth_hermite, kurtosis**2 / 1152 * seventh_hermite)
    )
    gaussian_alone = np.abs(kurtosis / 24 * (s**3 - 3 * s) * norm.pdf(s)).max()
    assert bound < gaussian_alone / 4
    G, spread = tilted(0.0, 1.0, (0.0, 0.0), 8.0), np.log(np.sqrt(variance))
    look = look_of(spread, 0.0, spread, kurtosis)
    for u in np.linspace(-0.3, 0.3, 25):  # across the pattern's first edge, paper to border, in modules
        x, y = 8 * (u - M / 2), 8 * (3.3 - M / 2)
        place = np.array([0.0, x, y, 1.0, 0.0, 0.0, 1.0])
        black = quad(lambda shift, u=u: norm.cdf((8 * u + shift) / sigma), -width / 2, width / 2)[0] / width
        # the kurtosis is there along the edge, too, where it changes nothing but for tails of the next edges
        assert at_pixel(place, G, look).grey == pytest.approx(200 - 160 * black, abs=160 * (bound + 1e-4))


def differences(place: Array, G: Array, look: Array, h: float) -> Array:
    """(19,) the central differences of the grey level by every parameter, as `_moved` applies them."""
    slopes = np.zeros(PARAMETERS)
    for k in range(PARAMETERS):
        step = np.zeros(PARAMETERS)
        step[k] = h
        ends = [at_pixel(place, *_moved(G, look, way * step, M)[:2]).grey for way in (-1, 1)]
        slopes[k] = (ends[1] - ends[0]) / (2 * h)
    return slopes


def clear_of_cut_off(place: Array, G: Array, look: Array) -> bool:
    """Whether no edge is so near to CUT_OFF that a small step crosses it, where the model has a tiny step."""
    u, v, w = G @ np.array([*place[1:3], 1.0])
    by_px = (G[:2, :2] - np.outer([u / w, v / w], G[2, :2])) / w
    sigma = np.sqrt(np.diag(by_px @ blur_of(look) @ by_px.T))
    s = np.abs(np.array([[u], [v]]) / w - np.arange(-RIM, M + RIM + 1)) / sigma[:, None]
    return bool((np.abs(s - CUT_OFF) > 0.05).all())


def test_the_looks_derivatives() -> None:
    """Exact where the blur is not askew in the pattern's coordinates, for any kurtosis and light.

    Where it is, what the correction's own change with the blur's width is left out: r phi(0)^2 times a few.
    """
    rng = np.random.default_rng(3)
    checked = 0
    while checked < 15:
        scale, light = rng.uniform(4, 9), (0.1, -0.2, 0.05, 0.1, -0.1)
        spread, kurtosis = rng.uniform(-0.6, 0.1), rng.uniform(-0.6, 0.3)
        G, look = tilted(rng.uniform(-3, 3), 1.0, (0.0, 0.0), scale), look_of(spread, 0.0, spread, kurtosis, light)
        (place,) = places(rng, G, 1)
        if clear_of_cut_off(place, G, look):
            exact = at_pixel(place, G, look).jacobian
            np.testing.assert_allclose(exact[8:], differences(place, G, look, 1e-4)[8:], atol=1e-3, rtol=1e-4)
            checked += np.abs(exact[8]) > 1  # that an edge was near


def test_the_homographys_derivatives() -> None:
    """With light and blur straight, what shifts the pattern is exact; the rest leaves the blur in modules as it is.

    A module that grows by 1 / m has a blur smaller by as much in modules. That changes a grey level by no more than
    max |s phi(s)| / m of the contrast for each of the two nearest edges, for stretches (1 and 5). A shear (2 and 4)
    makes the blur askew by 1 / m, worth 2 phi(0)^2 / m. The perspective (6 and 7) does both, |2 p| + |q| and |p| times.
    """
    rng = np.random.default_rng(4)
    s = np.linspace(0, 5, 2001)
    widened, askew = 160 * 2 * (s * norm.pdf(s)).max() / M, 160 * 2 * norm.pdf(0) ** 2 / M
    both = 1.7 * widened + 0.6 * askew
    bound = np.array([0, widened, askew, 0, askew, widened, both, both])
    exact, rough = list[Array](), list[Array]()
    while len(exact) < 60:
        G, spread = tilted(rng.uniform(-3, 3), 1.0, (0.0, 0.0), rng.uniform(4, 9)), rng.uniform(-0.5, 0)
        look = look_of(spread, 0.0, spread)
        (place,) = places(rng, G, 1)
        if clear_of_cut_off(place, G, look):
            exact.append(differences(place, G, look, 1e-4)[:8])
            rough.append(at_pixel(place, G, look).jacobian[:8])
    misses = np.abs(np.array(exact) - rough)
    assert (misses < bound + 1e-2).all()
    assert (np.abs(exact).max(axis=0) > 4 * bound).all()  # edges were near, and the bound says something


def test_far_from_the_goal_only_homography_and_greys_may_change() -> None:
    rng = np.random.default_rng(5)
    G, look = tilted(0.4, 1.1, (1e-4, 0.0), 6.0), look_of(-0.3, 0.1, -0.2)
    spots = places(rng, G, 200)
    spots[:, 0] = rng.uniform(30, 210, len(spots))
    normal, gradient = np.zeros((PARAMETERS, PARAMETERS)), np.zeros(PARAMETERS)
    free_normal, free_gradient = np.zeros_like(normal), np.zeros_like(gradient)
    _accumulate(spots, PATTERN, M, G, look, np.inf, False, normal, gradient)
    _accumulate(spots, PATTERN, M, G, look, np.inf, True, free_normal, free_gradient)
    moving = np.r_[0:8, 12, 13]
    np.testing.assert_array_equal(gradient[moving], free_gradient[moving])
    np.testing.assert_array_equal(normal[np.ix_(moving, moving)], free_normal[np.ix_(moving, moving)])
    assert not np.delete(gradient, moving).any()
    still = np.setdiff1d(np.arange(PARAMETERS), moving)
    np.testing.assert_array_equal(normal[still], np.eye(PARAMETERS)[still])


FINE = 6
"""Samples of a pixel across and down, before the blur."""


class Bench(NamedTuple):
    """A camera and a window of its frame in which a pattern is drawn."""

    camera: Camera
    rays: Array  # (h, w, 2) of all pixels
    window: tuple[int, int, int]  # row, column, size
    fine: Array  # (size * FINE, size * FINE, 2) the rays in the window


def bench_of(camera: Camera, row: int, column: int, size: int) -> Bench:
    v, u = np.mgrid[: camera.height, : camera.width].astype(float)
    rays = camera.undistort(np.stack((u.ravel(), v.ravel()), axis=-1)).reshape(*u.shape, 2)
    part = (np.arange(size * FINE) + 0.5) / FINE - 0.5
    fv, fu = np.meshgrid(row + part, column + part, indexing="ij")
    fine = camera.undistort(np.stack((fu.ravel(), fv.ravel()), axis=-1)).reshape(*fu.shape, 2)
    return Bench(camera, np.ascontiguousarray(rays), (row, column, size), fine)


@pytest.fixture(scope="module")
def webcam() -> Bench:
    return bench_of(CAMERAS["pinhole"], 40, 60, 96)


@pytest.fixture(scope="module")
def fisheye() -> Bench:
    return bench_of(CAMERAS["fisheye"], 90, 120, 96)


def hang(bench: Bench, rng: np.random.Generator, span: float = 70.0) -> Array:
    """(4, 2) the rays of a pattern's corners in the window: a leaning square, turned anyhow, that spans `span` px."""
    row, column, size = bench.window
    middle = np.array([[column, row]]) + size / 2 + rng.uniform(-4, 4, 2)
    ray = np.append(bench.camera.undistort(middle)[0], 1.0)
    sight = ray / np.linalg.norm(ray)
    across = np.cross([0.0, 1.0, 0.0], -sight)
    across /= np.linalg.norm(across)
    facing = np.column_stack((across, np.cross(-sight, across), -sight))
    lean = np.asarray(cv2.Rodrigues(np.append(rng.uniform(-0.5, 0.5, 2), 0.0))[0])
    roll = np.asarray(cv2.Rodrigues(np.array([0, 0, rng.uniform(-np.pi, np.pi)]))[0])
    outline, distance = square(1.0) @ (facing @ lean @ roll).T, 10.0
    for _ in range(3):
        points = outline + distance * sight
        distance *= np.ptp(bench.camera.project(points), axis=0).max() / span
    points = outline + distance * sight
    return points[:, :2] / points[:, 2:]


def to_pattern(corners: Array) -> Array:
    """(3, 3) from rays to modules."""
    rows = []
    for (x, y), (u, v) in zip(corners, M * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), strict=True):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y, -u], [0, 0, 0, x, y, 1, -v * x, -v * y, -v]]
    return np.linalg.svd(np.array(rows, float))[2][-1].reshape(3, 3)


def draw(
    bench: Bench,
    corners: Array,
    blur: tuple[float, float],
    rng: np.random.Generator,
    grain: float = 2.0,
    light: Callable[[Array, Array], Array] = lambda p, q: 1 + 0 * p * q,
) -> Image:
    """A frame of the pattern on endless paper: `blur` px down and across, sensor noise, light over the paper."""
    H = to_pattern(corners)
    at = bench.fine @ H[:, :2].T + H[:, 2]
    u, v = at[..., 0] / at[..., 2], at[..., 1] / at[..., 2]
    column, row = (np.clip(np.floor(c).astype(int) + RIM, 0, len(PATTERN) - 1) for c in (u, v))
    grey = np.where(PATTERN[row, column], 200.0, 40.0) * light(u / M - 0.5, v / M - 0.5)
    size = bench.window[2]
    # the mean over FINE x FINE samples is a blur, too
    pixel = (1 - 1 / FINE**2) / 12
    sigma = [FINE * np.sqrt(max(b**2 - pixel, 0.0)) for b in blur]
    seen = gaussian_filter(grey, sigma, mode="nearest").reshape(size, FINE, size, FINE).mean(axis=(1, 3))
    image = np.full((bench.camera.height, bench.camera.width), 120.0)
    top, left, _ = bench.window
    image[top : top + size, left : left + size] = seen + grain * rng.normal(size=seen.shape)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def fit(bench: Bench, image: Image, corners: Array, rng: np.random.Generator, off: float = 0.5) -> template.Fit | None:
    """From corners that are `off` px away."""
    rough = bench.camera.project(np.column_stack((corners, np.ones(4)))) + off * rng.normal(size=(4, 2))
    return template.fit(image, bench.rays, PATTERN, bench.camera.undistort(rough), rough)


@pytest.mark.parametrize("name", ["webcam", "fisheye"])
def test_corners_are_as_good_as_stated(name: str, request: pytest.FixtureRequest) -> None:
    """Under a blur of its own in either direction and slanting light.

    The pixels' noise is white here, for which the stated covariance is NEIGHBOURS times too large. Mean of n chi-square
    sums of 8: standard deviation sqrt(16 / n). At most a quarter of a chi-square is allowed for what the drawing's
    samples, a sixth of a pixel, put in.
    """
    bench: Bench = request.getfixturevalue(name)
    rng = np.random.default_rng(6)
    count, chi2, misses = 50, list[float](), list[Array]()
    for _ in range(count):
        corners = hang(bench, rng)
        image = draw(bench, corners, (0.6, 0.85), rng, light=lambda p, q: 1 + 0.12 * p - 0.08 * q)
        found = fit(bench, image, corners, rng)
        miss = (found.rays - corners).ravel()
        chi2.append(float(miss @ np.linalg.solve(found.cov, miss)) / 8)
        pixels = [bench.camera.project(np.column_stack((r, np.ones(4)))) for r in (found.rays, corners)]
        misses.append((pixels[0] - pixels[1]).ravel())
        assert found.contrast == pytest.approx(160, rel=0.1)
        assert np.sqrt(np.diag(found.blur)) == pytest.approx([0.85, 0.6], rel=0.25)
    spread = 4 * np.sqrt(2 / (8 * count))
    assert (1 - spread) / template.NEIGHBOURS < np.mean(chi2) < 1.25 / template.NEIGHBOURS * (1 + spread)
    assert np.sqrt(np.mean(np.square(misses))) < 0.06  # px
    # unbiased: eight means, each of `count`
    assert np.abs(np.mean(misses, axis=0)).max() < 4.5 * np.std(misses) / np.sqrt(count)


def test_where_the_pattern_is_not() -> None:
    """Another marker, noise, nothing, and a frame of one grey: no fit, and no exception."""
    bench = bench_of(CAMERAS["pinhole"], 40, 60, 96)
    rng = np.random.default_rng(7)
    corners = hang(bench, rng)
    image = draw(bench, corners, (0.6, 0.6), rng)
    assert fit(bench, image, corners, rng) is not None
    pixels = bench.camera.project(np.column_stack((corners, np.ones(4))))
    other = template.pattern(drawn("4X4_50", 12)[1:-1, 1:-1])
    assert template.fit(image, bench.rays, other, corners, pixels) is None
    assert template.fit(image, bench.rays, PATTERN, np.roll(corners, 1, axis=0), np.roll(pixels, 1, axis=0)) is None
    assert fit(bench, rng.integers(0, 256, image.shape).astype(np.uint8), corners, rng) is None
    for grey in (0, 128, 255):
        assert fit(bench, np.full_like(image, grey), corners, rng) is None
    faint = (120 + (image.astype(float) - 120) * 0.05).astype(np.uint8)
    assert fit(bench, faint, corners, rng) is None


def test_half_covered_is_refused_or_right(webcam: Bench) -> None:
    """A hand over a part of the pattern: whatever is found is where the pattern is, to its covariance, or refused."""
    rng = np.random.default_rng(8)
    found = 0
    for share in np.linspace(0.0, 0.6, 13):
        corners = hang(webcam, rng)
        image = draw(webcam, corners, (0.6, 0.6), rng)
        pixels = webcam.camera.project(np.column_stack((corners, np.ones(4))))
        left, right = pixels[:, 0].min(), pixels[:, 0].max()
        image[:, : int(left + share * (right - left))] = 90
        fitted = fit(webcam, image, corners, rng, off=0.2)
        if fitted is None:
            assert share > 0
            continue
        found += 1
        assert np.isfinite(fitted.cov).all()
        if share < 0.15:
            seen = webcam.camera.project(np.column_stack((fitted.rays, np.ones(4))))
            assert np.abs(seen - pixels).max() < 1.5
    assert found < 12


def test_at_the_frames_border(webcam: Bench) -> None:
    """A part of the pattern is outside the frame; nothing is read from beyond it."""
    bench, rng = bench_of(CAMERAS["pinhole"], 0, 0, 96), np.random.default_rng(9)
    for shift in (-30.0, -10.0, 0.0, 20.0):
        pixels = np.array([[10.0, 10.0], [70.0, 14.0], [66.0, 72.0], [8.0, 68.0]])
        pixels += np.array([shift, shift / 2])
        corners = bench.camera.undistort(pixels)
        fitted = template.fit(draw(bench, corners, (0.6, 0.6), rng), bench.rays, PATTERN, corners, pixels)
        if shift >= 0:
            assert fitted is not None
        if fitted is not None:
            seen = bench.camera.project(np.column_stack((fitted.rays, np.ones(4))))
            assert np.abs(seen - pixels).max() < 0.5


def test_pixels_without_a_ray_are_left_out(fisheye: Bench) -> None:
    rng = np.random.default_rng(10)
    corners = hang(fisheye, rng)
    image = draw(fisheye, corners, (0.6, 0.6), rng)
    assert np.isnan(fisheye.rays[0, 0]).all()  # the fisheye's own corner
    some = fisheye.rays.copy()
    row, _, size = fisheye.window
    some[row : row + size // 2 - 20] = np.nan
    fitted = template.fit(image, some, PATTERN, corners, fisheye.camera.project(np.column_stack((corners, np.ones(4)))))
    seen = fisheye.camera.project(np.column_stack((fitted.rays, np.ones(4))))
    assert np.abs(seen - fisheye.camera.project(np.column_stack((corners, np.ones(4))))).max() < 0.2
    none = np.full_like(some, np.nan)
    assert fit(fisheye, image, corners, rng) is not None
    assert template.fit(image, none, PATTERN, corners, np.array([[10.0, 10], [60, 10], [60, 60], [10, 60]])) is None


@pytest.mark.parametrize(
    "corners",
    [
        np.zeros((4, 2)),
        np.array([[0, 0], [1, 0], [2, 0], [3, 0]], float),
        np.array([[0, 0], [0.1, 0.1], [0.1, 0], [0, 0.1]], float),
    ],
    ids=["a point", "a line", "crossed"],
)
def test_corners_of_no_square(webcam: Bench, corners: NDArray[np.float64]) -> None:
    image = draw(webcam, hang(webcam, np.random.default_rng(11)), (0.6, 0.6), np.random.default_rng(12))
    pixels = 100 + 50 * corners
    assert template.fit(image, webcam.rays, PATTERN, webcam.camera.undistort(pixels), pixels) is None
