"""The fit of a printed pattern: its model, its derivatives, its covariance, and what it makes of frames without one."""

from collections.abc import Callable
from typing import Any, NamedTuple

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates, maximum_filter, minimum_filter, spline_filter
from scipy.spatial.transform import Rotation
from scipy.stats import multivariate_normal, norm

from slamduel.core.kernels._small import cholesky, solve
from slamduel.core.se2 import Array
from slamduel.datasets.rendering.cameras import CAMERAS
from slamduel.datasets.rendering.clutter import drawn
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.response import Measured, Response
from slamduel.frontend.markers import _grey, template
from slamduel.frontend.markers._alignment import Equations, _accumulate  # pyright: ignore[reportPrivateUsage]
from slamduel.frontend.markers._edges import COLUMNS, RESIDUAL, Misfit, spread, sum_edges
from slamduel.frontend.markers._grey import BUMP, CURL, HALO, PARAMETERS, SHARED, STIFF, Model, Scratch
from slamduel.frontend.markers._share import CUT_OFF, RIM
from slamduel.frontend.markers._step import LIMITED, LIMITS, hold, moved
from slamduel.frontend.markers.aruco import Image
from slamduel.frontend.markers.prior import UNKNOWN_CAMERA, prior_of
from slamduel.frontend.markers.square_pose import square
from tiers import first_quick

PATTERN = template.pattern(drawn("4X4_50", 7)[1:-1, 1:-1])
M = len(PATTERN) - 2 * RIM

NOWHERE = np.zeros(3)
"""In place of a camera that is known to be on one side."""


class Predicted(NamedTuple):
    """The compiled model at one pixel."""

    grey: float
    jacobian: Array  # (24,)


def at_pixel(place: Array, G: Array, look: Array, whole: bool = True, eye: Array | None = None) -> Predicted:
    curve, jacobian = np.empty(SHARED), np.zeros(PARAMETERS)
    model = Model(PATTERN, G, look, _grey.eye_of(G, M, NOWHERE) if eye is None else eye)
    _grey.curve_of(model, curve)
    scratch = Scratch(np.empty((2, 3, 7)), np.empty((2, 7)), np.empty(12), np.empty(2))
    return Predicted(_grey.predict(place, model, curve, whole, scratch, jacobian), jacobian)


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
    """(count, 8) black pixels within the pattern, rays being px, of any kind."""
    uv = rng.uniform(-0.4, M + 0.4, (count, 2))
    rays = np.column_stack((uv, np.ones(count))) @ np.linalg.inv(G).T
    rays = rays[:, :2] / rays[:, 2:]
    kinds = (np.arange(count) % 4).astype(np.float64)
    return np.column_stack((np.zeros(count), rays, np.tile([1.0, 0.0, 0.0, 1.0], (count, 1)), kinds))


def look_of(
    a: float,
    b: float,
    c: float,
    ink: float = 0.0,
    tone: float = 0.0,
    sharp: float = 0.0,
    light: tuple[float, ...] = (0.0,) * 5,
    curl: tuple[float, ...] = (0.0,) * 3,
) -> Array:
    return np.array([40.0, 200.0, a, b, c, ink, tone, sharp, *light, *curl])


def blur_of(look: Array) -> Array:
    root = np.array([[np.exp(look[2]), 0.0], [look[3], np.exp(look[4])]])
    return root @ root.T


def lit(seen: float, tone: float) -> float:
    """The grey level of a share of white, between 40 and 200, behind a tone curve."""
    gamma = np.exp(tone)
    return float((40**gamma + (200**gamma - 40**gamma) * seen) ** (1 / gamma))


def seen_exactly(uv: Array, cov: Array) -> float:
    """How much white a pixel at `uv` sees of the pattern on endless paper, a Gaussian `cov` modules^2 over it."""
    cells = np.argwhere(PATTERN == 0) - RIM
    spread = multivariate_normal(uv, cov, abseps=1e-9, releps=1e-9)  # pyright: ignore[reportArgumentType]
    black = sum(
        float(spread.cdf([x + 1, y + 1], lower_limit=[x, y]))
        for y, x in cells
        if abs(x + 0.5 - uv[0]) < 3 and abs(y + 0.5 - uv[1]) < 3
    )
    return 1 - black


@pytest.mark.parametrize("tone", [0.0, np.log(2.2)])
@pytest.mark.parametrize("turn", [0.0, 0.5])
def test_the_model_is_the_blurred_pattern(turn: float, tone: float) -> None:
    """Where the blur is straight in the pattern's own coordinates the model is exact.

    Only tails beyond CUT_OFF are left out, of up to three edges each way, and the normal distribution has 3.4e-6 there.
    The tone curve is steepest at black, where it stretches them by the ratio of light's and curve's contrasts.
    """
    G, look = tilted(turn, 1.0, (0.0, 0.0), 5.0), look_of(np.log(0.8), 0.0, np.log(0.8), tone=tone)
    gamma = np.exp(tone)
    steepest = (200**gamma - 40**gamma) / (gamma * 40 ** (gamma - 1)) / 160
    for place in places(np.random.default_rng(1), G, 40):
        uv = G[:2] @ np.array([*place[1:3], 1.0])
        expected = lit(seen_exactly(uv, 0.8**2 / 25 * np.eye(2)), tone)
        bound = 960 * steepest * float(norm.sf(CUT_OFF))
        assert at_pixel(place, G, look).grey == pytest.approx(expected, abs=bound)


CELLS = 40
"""Samples of a module across and down in `drawn_finely`."""


def drawn_finely(grown: int, sigma: float) -> Array:
    """The pattern with black grown by so many samples each way, under a blur of `sigma` samples."""
    fine = np.kron(PATTERN, np.ones((CELLS, CELLS)))
    fine = (minimum_filter if grown > 0 else maximum_filter)(fine, 2 * abs(grown) + 1)
    return np.asarray(gaussian_filter(fine, sigma, mode="nearest", truncate=6.0))


def sampled(fine: Array, uv: Array) -> Array:
    """(n,) values at (n, 2) `uv`, modules; by a cubic spline."""
    return map_coordinates(spline_filter(fine), (uv.T[::-1] + RIM) * CELLS - 0.5, order=3, prefilter=False)


def drawn_at(rng: np.random.Generator, G: Array, count: int) -> tuple[Array, Array]:
    """(count, 7) pixels within the pattern, and where they see it, modules."""
    seen = places(rng, G, count)
    return seen, seen[:, 1:3] @ G[:2, :2].T + G[:2, 2]


def greys(seen: Array, G: Array, look: Array) -> Array:
    """(n,) grey levels of the model at (n, 7) pixels."""
    return np.array([at_pixel(place, G, look).grey for place in seen])


@pytest.mark.parametrize("grown", [-2, 1, 3])
def test_ink_moves_edges(grown: int) -> None:
    """Black that has grown by some samples of a finely drawn pattern, blurred by a fifth of a module.

    Left out is where two edges meet, both moved: their square, weighed by the blur's density. For as much again other
    edges within the blur, which the model moves by the nearest edge's ink alone, and the samples' own width count.
    """
    sigma, ink = 0.2, grown / CELLS
    fine = drawn_finely(grown, sigma * CELLS)
    G, spread = tilted(0.0, 1.0, (0.0, 0.0), 1.0), np.log(sigma)
    look = look_of(spread, 0.0, spread, ink=ink)
    seen, uv = drawn_at(np.random.default_rng(21), G, 300)
    true = 40 + 160 * sampled(fine, uv)
    misses, plain = greys(seen, G, look) - true, greys(seen, G, look_of(spread, 0.0, spread)) - true
    both = 160 * (ink * norm.pdf(0) / sigma) ** 2
    assert np.abs(misses).max() < 2 * both + 0.7
    assert np.abs(plain).max() > 3 * (both + 0.7)
    assert np.sqrt(np.mean(np.square(misses))) < 0.1 * np.sqrt(np.mean(np.square(plain)))


def test_sharpening_adds_what_a_wider_blur_takes_off() -> None:
    """An unsharp mask of a straight camera's picture: exact but for tails, as its own wider blur is Gaussian."""
    px = 5.0  # a module
    sigma, amount = 0.8, 0.7
    G, spread = tilted(0.0, 1.0, (0.0, 0.0), px), np.log(sigma)
    near, far = (drawn_finely(0, width / px * CELLS) for width in (sigma, np.hypot(sigma, HALO)))
    look = look_of(spread, 0.0, spread, sharp=amount)
    seen, uv = drawn_at(np.random.default_rng(22), G, 100)
    white = sampled(near, uv) + amount * (sampled(near, uv) - sampled(far, uv))
    assert greys(seen, G, look) == pytest.approx(40 + 160 * white, abs=0.15)


def test_sharpening_follows_the_tone_curve() -> None:
    """The wider blur is of the picture behind the curve, whose edges are nearer to black.

    They are moved in the mean, which leaves a small part of the miss that light's own edges would have.
    """
    px, sigma, amount, tone = 5.0, 0.8, 0.8, np.log(2.2)
    G, spread = tilted(0.0, 1.0, (0.0, 0.0), px), np.log(sigma)
    light = drawn_finely(0, sigma / px * CELLS)
    gamma = np.exp(tone)
    picture = (40**gamma + (200**gamma - 40**gamma) * light) ** (1 / gamma)
    halo = gaussian_filter(picture, HALO / px * CELLS, mode="nearest", truncate=6.0)
    look = look_of(spread, 0.0, spread, tone=tone, sharp=amount)
    seen, uv = drawn_at(np.random.default_rng(23), G, 300)
    wide, near = sampled(halo, uv), sampled(picture, uv)
    misses = greys(seen, G, look) - near - amount * (near - wide)
    straight = drawn_finely(0, np.hypot(sigma, HALO) / px * CELLS)  # light's pattern under the wider blur
    unmoved = amount * (wide - 40 - 160 * sampled(straight, uv))
    assert np.sqrt(np.mean(np.square(misses))) < 0.4 * np.sqrt(np.mean(np.square(unmoved)))


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


def differences(place: Array, G: Array, look: Array, h: float) -> Array:
    """(24,) the central differences of the grey level by every parameter, as `moved` applies them."""
    slopes = np.zeros(PARAMETERS)
    for k in range(PARAMETERS):
        step = np.zeros(PARAMETERS)
        step[k] = h
        ends = [at_pixel(place, *moved(G, look, way * step, PARAMETERS, M)[:2]).grey for way in (-1, 1)]
        slopes[k] = (ends[1] - ends[0]) / (2 * h)
    return slopes


def clear_of_cut_off(place: Array, G: Array, look: Array) -> bool:
    """Whether no edge is so near to CUT_OFF that a small step crosses it, where the model has a tiny step."""
    u, v, w = G @ np.array([*place[1:3], 1.0])
    by_px = (G[:2, :2] - np.outer([u / w, v / w], G[2, :2])) / w
    clear = True
    for blur in (blur_of(look), blur_of(look) + HALO**2 * np.eye(2)):
        sigma = np.sqrt(np.diag(by_px @ blur @ by_px.T))
        # with an ink the nearest edge is elsewhere
        for ink in (-look[5], 0.0, look[5]):
            s = np.abs(np.array([[u], [v]]) / w - np.arange(-RIM, M + RIM + 1) - ink) / sigma[:, None]
            clear = clear and bool((np.abs(s - CUT_OFF) > 0.05).all())
    return clear


def test_the_looks_derivatives() -> None:
    """Exact where the blur is not askew in the pattern's coordinates, for any ink, tone and light, or sharpening alone.

    Where it is, what the correction's own change with the blur's width is left out: r phi(0)^2 times a few. With all of
    them, the derivatives of the halo are those at the place its edges are moved from: a share of its own contrast by as
    much as they are moved, over its width.
    """
    rng = np.random.default_rng(3)
    checked = 0
    while checked < 30:
        sharp = (0.0, 0.6, 0.6)[checked % 3]
        tone, ink = (rng.uniform(0.0, 0.8), rng.uniform(-0.03, 0.04)) if checked % 3 != 1 else (0.0, 0.0)
        scale, spread = rng.uniform(4, 9), rng.uniform(-0.6, 0.1)
        G = tilted(rng.uniform(-3, 3), 1.0, (0.0, 0.0), scale)
        look = look_of(spread, 0.0, spread, ink, tone, sharp, (0.1, -0.2, 0.05, 0.1, -0.1))
        (place,) = places(rng, G, 1)
        if clear_of_cut_off(place, G, look):
            exact, measured = at_pixel(place, G, look).jacobian, differences(place, G, look, 1e-4)
            moved = abs(ink) * scale + BUMP * np.exp(spread) * (2 ** (1 - np.exp(-tone)) - 1)
            held = 160 * sharp * moved / HALO * norm.pdf(0) if checked % 3 == 2 else 0.0
            bounds = (
                2e-3 + 2e-4 * np.abs(measured) + held * np.array([1] * 8 + [0.02, 0.02, 1, 1, 1, scale, 1, 0] + [0] * 8)
            )
            assert (np.abs(exact - measured) < bounds)[8 : CURL + 8].all()
            checked += int(np.abs(exact[10]) > 1)  # that an edge was near


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


def leaning(rng: np.random.Generator) -> tuple[Array, Array]:
    """A homography from rays to modules, of a square of side 1 that leans by up to 50 degrees, and its camera's place.

    p and q run along the square's sides from its middle, and its normal towards the camera.
    """
    turn, shift = (
        Rotation.from_euler("zyx", rng.uniform(-1, 1, 3) * [np.pi, 0.6, 0.6]).as_matrix(),
        np.append(rng.uniform(-2, 2, 2), rng.uniform(4, 12)),
    )
    sides = np.column_stack((turn[:, 0] / M, turn[:, 1] / M, shift - (turn[:, 0] + turn[:, 1]) / 2))
    eye = -turn.T @ shift
    return np.asarray(np.linalg.inv(sides)), np.array([eye[0], eye[1], -eye[2]])


def test_the_camera_stands_where_the_homography_says() -> None:
    rng = np.random.default_rng(21)
    for _ in range(30):
        G, eye = leaning(rng)
        mirrored = eye * [-1, -1, 1]
        for scale, other, expected in ((1.0, NOWHERE, eye), (-3.0, NOWHERE, eye), (1.0, 0.8 * mirrored, mirrored)):
            np.testing.assert_allclose(_grey.eye_of(scale * G, M, other), expected, rtol=1e-7, atol=1e-7)


def test_rays_meet_curled_paper_where_it_is() -> None:
    """On the ray, above the place that is the arc of a parabola away from the middle.

    The arc, of slope g up to a tenth, is longer than its shadow by g^2 / 6 of it; g^4 / 40 is left out.
    """
    rng = np.random.default_rng(22)
    paper = np.empty(12)
    for _ in range(40):
        eye, way, curvature = leaning(rng)[1], rng.uniform(0, np.pi), rng.uniform(-0.1, 0.1)
        axis, foot = np.array([np.cos(way), np.sin(way)]), rng.uniform(-0.5, 0.5, 2)
        across = float(foot @ axis)
        # the ray to the point above its foot meets the plane further on
        p, q = eye[:2] + (foot - eye[:2]) / (1 - curvature * across**2 / eye[2])
        curl = curvature * np.array([axis[0] ** 2, 2 * axis[0] * axis[1], axis[1] ** 2])
        assert _grey.unroll(p, q, curl[0], curl[1], curl[2], eye, paper)
        along = np.linspace(0, across, 2001)
        arc = float(np.trapezoid(np.sqrt(1 + (2 * curvature * along) ** 2), along))
        np.testing.assert_allclose(paper[:2], foot + (arc - across) * axis, atol=0.11**4 / 40)


def test_a_ray_that_passes_the_paper_by_meets_none() -> None:
    assert not _grey.unroll(0.4, 0.0, 3.0, 0.0, 0.0, np.array([3.0, 0.0, 0.5]), np.empty(12))


def test_the_derivatives_of_curled_paper() -> None:
    """Exact by the curl; by the plane, only the arc's part is left out, two thirds of a slope squared."""
    rng = np.random.default_rng(23)

    def at(values: Array, eye: Array) -> Array:
        paper = np.empty(12)
        p, q, xx, xy, yy = values.tolist()
        assert _grey.unroll(p, q, xx, xy, yy, eye, paper)
        return paper

    for _ in range(40):
        eye, values = leaning(rng)[1], np.concatenate((rng.uniform(-0.5, 0.5, 2), rng.uniform(-0.08, 0.08, 3)))
        exact, h = at(values, eye), 1e-5
        steps = h * np.eye(5)
        slopes = np.array([(at(values + step, eye) - at(values - step, eye))[:2] / (2 * h) for step in steps])
        np.testing.assert_allclose(exact[2:6], slopes[:2].T.ravel(), atol=2 / 3 * 0.25**2)
        np.testing.assert_allclose(exact[6:], slopes[2:].T.ravel(), rtol=1e-6, atol=1e-8)
        assert np.abs(exact[2:6] - [1, 0, 0, 1]).max() > 1e-4


def test_the_greys_derivatives_by_the_curl() -> None:
    """The pattern moves, its blur stays: with it straight in the pattern's coordinates they are exact."""
    rng = np.random.default_rng(24)
    checked = 0
    while checked < 20:
        G, spread = tilted(rng.uniform(-3, 3), 1.0, (0.0, 0.0), rng.uniform(4, 9)), rng.uniform(-0.6, 0.1)
        look = look_of(spread, 0.0, spread, curl=tuple(rng.uniform(-0.05, 0.05, 3)))
        eye = np.array([*rng.uniform(-6, 6, 2), rng.uniform(5, 10)])
        (place,) = places(rng, G, 1)
        if not clear_of_cut_off(place, G, look):
            continue
        exact, h = at_pixel(place, G, look, eye=eye).jacobian[-3:], 1e-5
        steps = h * np.eye(len(look))[CURL:]
        ends = [[at_pixel(place, G, look + way * step, eye=eye).grey for way in (-1, 1)] for step in steps]
        measured = np.diff(np.array(ends), axis=1)[:, 0] / (2 * h)
        np.testing.assert_allclose(exact, measured, rtol=1e-4, atol=2e-2)
        checked += int(np.abs(exact).max() > 5)


def in_larger(normal: Array) -> Array:
    """The same numbers as a part of a larger array, as in a fit: kernels are compiled for one kind."""
    return np.column_stack((normal, np.zeros(len(normal))))[:, :-1]


def filled(spots: Array, G: Array, look: Array, active: int, step: Array | None = None) -> tuple[Array, Array, Array]:
    """Normal matrix, gradient, and gradient by edge after the `step` that solves them, or the one given."""
    normal, gradient = in_larger(np.zeros((PARAMETERS, PARAMETERS))), np.zeros(PARAMETERS)
    by_edge = np.zeros((2 * (M + 1) * (M + 2), PARAMETERS + 1))
    rows = np.zeros((len(spots), COLUMNS))
    model, equations = Model(PATTERN, G, look, _grey.eye_of(G, M, NOWHERE)), Equations(normal, gradient)
    count = _accumulate(spots, 1, model, UNKNOWN_CAMERA, np.inf, active, rows, equations)[3]
    if active == PARAMETERS:
        rows[:count, RESIDUAL] -= rows[:count, :PARAMETERS] @ (
            np.linalg.solve(normal, gradient) if step is None else step
        )
        sum_edges(rows[:count], by_edge)
    return normal, gradient, by_edge


def test_far_from_the_goal_only_homography_and_greys_may_change() -> None:
    rng = np.random.default_rng(5)
    G, look = tilted(0.4, 1.1, (1e-4, 0.0), 6.0), look_of(-0.3, 0.1, -0.2)
    spots = places(rng, G, 200)
    spots[:, 0] = rng.uniform(30, 210, len(spots))
    (normal, gradient, _), (all_normal, all_gradient, _) = (filled(spots, G, look, n) for n in (STIFF, PARAMETERS))
    np.testing.assert_allclose(gradient[:STIFF], all_gradient[:STIFF], rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(normal[:STIFF, :STIFF], all_normal[:STIFF, :STIFF], rtol=1e-9, atol=1e-6)
    assert not gradient[STIFF:].any()


@pytest.mark.parametrize("side", [0, 1], ids=["least", "largest"])
@pytest.mark.parametrize("k", range(len(LIMITED)))
def test_what_is_at_a_limit_is_held_where_it_would_pass_it(side: int, k: int) -> None:
    """The others' step is then the best one without it; inwards, or away from the limit, it moves like any."""
    rng, i = np.random.default_rng(8), 8 + LIMITED[k]
    half = rng.normal(size=(2 * PARAMETERS, PARAMETERS))
    at_limit, inside = look_of(0.0, 0.0, 0.0), look_of(0.0, 0.0, 0.0)
    at_limit[LIMITED[k]] = LIMITS[side, k]
    for look, outwards, held in ((at_limit, True, True), (at_limit, False, False), (inside, True, False)):
        normal, step = in_larger(half.T @ half), rng.normal(size=PARAMETERS)
        step[i] = abs(step[i]) * (1 if outwards == bool(side) else -1)
        free = np.arange(PARAMETERS) != i if held else np.ones(PARAMETERS, bool)
        expected = np.zeros(PARAMETERS)
        expected[free] = np.linalg.solve(normal[np.ix_(free, free)], step[free])
        hold(look, normal, step)
        assert cholesky(normal, normal, PARAMETERS, 1e-12, 0.0)
        solve(normal, step, step, PARAMETERS)
        np.testing.assert_allclose(step, expected, rtol=1e-9, atol=1e-12)


def test_every_pixel_belongs_to_its_nearest_edge() -> None:
    rng = np.random.default_rng(6)
    G, look = tilted(0.4, 1.1, (1e-4, 0.0), 6.0), look_of(-0.3, 0.1, -0.2, 0.01, 0.3, 0.2)
    spots = places(rng, G, 300)
    spots[:, 0] = rng.uniform(30, 210, len(spots))
    step = rng.normal(size=PARAMETERS) * np.where(np.arange(PARAMETERS) < 8, 0.02, 0.1)
    by_edge = filled(spots, G, look, PARAMETERS, step)[2]
    expected = np.zeros_like(by_edge)
    for spot in spots:
        u, v, w = G @ np.array([*spot[1:3], 1.0])
        grey, jacobian = at_pixel(spot, G, look)
        off = [abs(x / w - round(x / w)) for x in (u, v)]
        across, along = (u, v) if off[0] < off[1] else (v, u)
        row = round(across / w) * (M + 2) + int(np.floor(along / w)) + 1 + (off[0] >= off[1]) * len(by_edge) // 2
        expected[row] += np.append((spot[0] - grey - jacobian @ step) * jacobian, 1.0)
    np.testing.assert_allclose(by_edge, expected, rtol=1e-9, atol=1e-6)
    assert by_edge[:, PARAMETERS].sum() == len(spots)


def test_the_covariance_grows_by_what_edges_share() -> None:
    """Residuals of one pixel each leave it about as it is; what edges share gives the covariance that it has."""
    rng = np.random.default_rng(7)
    G, look = tilted(0.3, 1.0, (0.0, 0.0), 10.0), look_of(-0.3, 0.0, -0.3)
    spots = places(rng, G, 2000)
    along = np.column_stack((spots[:, 1:3], np.ones(len(spots)))) @ G.T
    off = np.abs(along[:, :2] - np.round(along[:, :2]))
    near = off.min(axis=1) < 3 * np.exp(-0.3) / 10
    spots, (u, v) = spots[near], along[near, :2].T
    greys = np.array([at_pixel(spot, G, look).grey for spot in spots])
    across_u = np.abs(u - np.round(u)) < np.abs(v - np.round(v))
    names = np.where(across_u, np.round(u) * 100 + np.floor(v), 5000 + np.round(v) * 100 + np.floor(u))
    edges, edge = np.unique(names, return_inverse=True)
    summed = np.zeros((len(edges), PARAMETERS))
    np.add.at(summed, edge, [at_pixel(spot, G, look).jacobian for spot in spots])
    inverse = np.linalg.inv(filled(spots, G, look, PARAMETERS)[0])[:8]
    shared = np.trace(np.linalg.solve(inverse[:, :8], inverse @ summed.T @ summed @ inverse.T)) / 8
    factors = []
    for common in (False, True):
        growth = []
        for _ in range(12):
            residual = rng.normal(size=len(edges))[edge] if common else rng.normal(size=len(spots))
            spots[:, 0] = greys + 2 * residual
            normal, _, by_edge = filled(spots, G, look, PARAMETERS)
            plain = 4.0 * np.linalg.inv(normal)[:8, :8]
            misfit = Misfit(by_edge, np.zeros_like(by_edge), np.zeros(PARAMETERS), np.array([4.0, 0.0]))
            growth.append(np.trace(np.linalg.solve(plain, spread(normal.copy(), misfit))) / 8)
        factors.append(np.mean(growth))
    assert 1 <= factors[0] < 1.2
    # the square of a sum over 12 x 112 edges varies by 4 %, what the fit takes up of it is known to 10 %
    assert 0.8 * shared < factors[1] < 1.25 * shared


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
    ink: float = 0.0,
    gamma: float = 1.0,
    sharpen: float = 0.0,
) -> Image:
    """A frame of the pattern on endless paper: `blur` px down and across, sensor noise, light over the paper.

    With `ink` modules of growth of black at every edge, a tone curve of 255 levels, and an unsharp mask of HALO px.
    """
    H = to_pattern(corners)
    at = bench.fine @ H[:, :2].T + H[:, 2]
    u, v = at[..., 0] / at[..., 2], at[..., 1] / at[..., 2]
    darkest = np.ones_like(u)
    for right in {-ink, ink}:
        for down in {-ink, ink}:
            column, row = (np.clip(np.floor(c).astype(int) + RIM, 0, len(PATTERN) - 1) for c in (u + right, v + down))
            darkest = np.minimum(darkest, PATTERN[row, column])
    grey = np.where(darkest > 0, 200.0, 40.0) * light(u / M - 0.5, v / M - 0.5)
    size = bench.window[2]
    # the mean over FINE x FINE samples is a blur, too
    pixel = (1 - 1 / FINE**2) / 12
    sigma = [FINE * np.sqrt(max(b**2 - pixel, 0.0)) for b in blur]
    seen = gaussian_filter(grey, sigma, mode="nearest").reshape(size, FINE, size, FINE).mean(axis=(1, 3))
    seen = 255 * np.clip((seen + grain * rng.normal(size=seen.shape)) / 255, 0, 1) ** (1 / gamma)
    seen += sharpen * (seen - gaussian_filter(seen, HALO))
    image = np.full((bench.camera.height, bench.camera.width), 120.0)
    top, left, _ = bench.window
    image[top : top + size, left : left + size] = seen
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def fit(
    bench: Bench, image: Image, corners: Array, rng: np.random.Generator, off: float = 0.5
) -> template.PatternFit | None:
    """From corners that are `off` px away."""
    rough = bench.camera.project(np.column_stack((corners, np.ones(4)))) + off * rng.normal(size=(4, 2))
    return template.fit(image, bench.rays, PATTERN, bench.camera.undistort(rough), rough)


@pytest.mark.parametrize("name", first_quick(["webcam", "fisheye"]))
def test_corners_are_as_good_as_stated(name: str, request: pytest.FixtureRequest) -> None:
    """Under a blur of its own in either direction and slanting light.

    The pixels' noise is white here, for which the stated covariance is larger by how much edges differ by chance, a
    fifth at most. Mean of n chi-square sums of 8: standard deviation sqrt(16 / n). At most a quarter of a chi-square is
    allowed for what the drawing's samples, a sixth of a pixel, put in.
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
    assert (1 - spread) / 1.2 < np.mean(chi2) < 1.25 * (1 + spread)
    assert np.sqrt(np.mean(np.square(misses))) < 0.06  # px
    # unbiased: eight means, each of `count`
    assert np.abs(np.mean(misses, axis=0)).max() < 4.5 * np.std(misses) / np.sqrt(count)


@pytest.mark.parametrize(
    "effect",
    first_quick(
        [{"ink": 0.02, "gamma": 1.8, "sharpen": 0.6}, {"ink": 0.03}, {"ink": 0.005}, {"gamma": 2.2}, {"sharpen": 0.8}]
    ),
    ids=lambda effect: " ".join(f"{name} {value}" for name, value in effect.items()),
)
def test_what_moves_every_edge_moves_no_corner(webcam: Bench, effect: dict[str, Any]) -> None:
    """Spread ink and a tone curve make black larger or smaller, which is no change of distance.

    The mean of n errors of the size, in percent, has their standard deviation over sqrt(n); unmodelled, an ink of 0.03
    modules alone would be 1 %. A chi-square sum as in `test_corners_are_as_good_as_stated`, with twice its allowance.
    """
    rng = np.random.default_rng(13)
    count, chi2, sizes = 40, list[float](), list[float]()
    for _ in range(count):
        corners = hang(webcam, rng)
        found = fit(webcam, draw(webcam, corners, (0.6, 0.7), rng, **effect), corners, rng)
        miss = (found.rays - corners).ravel()
        chi2.append(float(miss @ np.linalg.solve(found.cov, miss)) / 8)
        extent = [np.linalg.norm(each - each.mean(axis=0)) for each in (found.rays, corners)]
        sizes.append(100 * float(extent[0] / extent[1] - 1))
    assert np.abs(np.mean(sizes)) < 4 * np.std(sizes) / np.sqrt(count) + 0.02
    assert np.std(sizes) < 0.15
    assert 0.5 < np.mean(chi2) < 1.6


def test_a_calibrated_camera_says_more_of_a_small_marker(webcam: Bench) -> None:
    """With its own tone and sharpening expected the same frames say more, per grey level of noise, and it holds."""
    rng = np.random.default_rng(14)
    response = Response(Measured(2.2, 0.02), Measured(0.6, 0.02), Measured(0.65, 0.01))
    chi2, volumes = list[float](), list[float]()
    for _ in range(40):
        corners = hang(webcam, rng, span=24.0)
        image = draw(webcam, corners, (0.65, 0.65), rng, gamma=2.2, sharpen=0.6)
        pixels = webcam.camera.project(np.column_stack((corners, np.ones(4))))
        start = webcam.camera.undistort(pixels)
        unknown, known = (
            template.fit(image, webcam.rays, PATTERN, start, pixels, prior_of(what)) for what in (None, response)
        )
        miss = (known.rays - corners).ravel()
        chi2.append(float(miss @ np.linalg.solve(known.cov, miss)) / 8)
        known_cov, unknown_cov = (np.linalg.inv(one.normal)[:8, :8] for one in (known, unknown))
        volumes.append(np.linalg.slogdet(known_cov)[1] - np.linalg.slogdet(unknown_cov)[1])
    assert np.mean(volumes) < -0.03
    assert 0.4 < np.mean(chi2) < 1.6


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
