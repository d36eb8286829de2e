"""Photographs of one marker by ray casting that shares nothing with `datasets/rendering`, in plain numpy.

Rays are cast from a disc and a box around every pixel, a lens out of focus; ink spreads by distance, so that corners of
black are round; the sheet is a cylinder about any axis; sensors have a mosaic in the order GRBG, by Malvar, He and
Cutler's interpolation (2004), the tone curve of Rec. 709 and a sharpening by the Laplacian.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.spatial.transform import Rotation

from slamduel.frontend.camera.camera import Camera

Array = NDArray[np.float64]

SIDE, MODULES = 0.16, 6
FINE = 40
"""Cells of the drawn sheet per module."""

WIDTH, HEIGHT = 640, 480
FOCAL, CENTRE = np.array([576.0, 577.5]), np.array([322.3, 237.1])
K1, K2 = -0.11, 0.03
FORWARD = np.array([[0.0, 0.0, 1.0, 0.1], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.7], [0.0, 0.0, 0.0, 1.0]])

CAMERA = Camera(WIDTH, HEIGHT, tuple(FOCAL.tolist()), tuple(CENTRE.tolist()), (K1, K2, 0.0, 0.0, 0.0), FORWARD)

RAYS = 10
"""Rays along either side of a pixel."""

DARK, LIGHT, WALL = 0.05, 0.75, 0.35
"""Reflectance of ink, paper and wall, where 1 saturates."""

RED, BLUE = 0.6, 0.75
"""A sensor's response to two of its colours, green having 1, which white balance takes back before the mosaic is."""


@dataclass(frozen=True)
class Look:
    """A camera, its processing, and the faults of printer and paper."""

    defocus: float = 0.7  # px, radius of a point's disc
    noise: float = 0.006  # of saturation, of reading
    photons: float = 0.0  # variance per light, both as shares of saturation
    mosaic: bool = False
    rec709: bool = False
    sharpen: float = 0.0
    jpeg: int = 0
    motion: float = 0.0  # px, by which the picture is drawn out in some direction
    ink: tuple[float, float] = (0.0, 0.0)  # shares of the side, from which an edge's shift is drawn
    curl: float = 0.0  # m, the largest distance of the sheet's edge from its middle's plane


FAULTS = (-0.002, 0.005)

LOOKS: Mapping[str, Look] = MappingProxyType({
    "ideal": Look(),
    "tone curve": Look(rec709=True),
    "ink": Look(ink=(0.005, 0.005)),
    "mosaic": Look(mosaic=True),
    "sharpening": Look(sharpen=0.25),
    "photons": Look(photons=2e-4),
    "motion": Look(motion=2.0),
    "curl": Look(curl=0.003),
    "phone": Look(mosaic=True, rec709=True, sharpen=0.25, jpeg=85, ink=FAULTS),
    "webcam": Look(rec709=True, jpeg=70, motion=2.0, ink=FAULTS),
    "industrial": Look(mosaic=True, photons=2e-4, ink=FAULTS),
    "phone, curled paper": Look(mosaic=True, rec709=True, sharpen=0.25, jpeg=85, ink=FAULTS, curl=0.003),
})  # fmt: skip


class Photograph(NamedTuple):
    """A picture of one marker."""

    id: int
    centre: Array  # (3,) m, of the marker in the camera's frame
    image: NDArray[np.uint8]


def photograph(look: Look, distance: float, rng: np.random.Generator) -> Photograph:
    """A marker at a random place in view, tilted by up to 45 degrees."""
    name = int(rng.integers(50))
    turn, centre = _placed(distance, rng)
    angle, bend = rng.uniform(0, np.pi), rng.uniform(-1, 1) * look.curl
    sheet = _printed(name, rng.uniform(*look.ink) * SIDE)
    offsets = _offsets(look, rng)
    light, lit = _room(rng)
    corners = SIDE * 0.75 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    seen = _pixels(np.column_stack((corners, np.zeros(4))) @ turn.T + centre)
    left, top = np.maximum(np.floor(seen.min(axis=0)).astype(int) - 4, 0)
    right, bottom = np.minimum(np.ceil(seen.max(axis=0)).astype(int) + 5, (WIDTH, HEIGHT))
    pixels = np.stack(np.meshgrid(np.arange(left, right), np.arange(top, bottom)), axis=-1)
    paper, shone = np.zeros(pixels.shape[:2]), np.zeros(pixels.shape[:2])
    rays, little = _rays(pixels), 0.5
    across, down = ((_rays(pixels + little * way) - _rays(pixels - little * way)) / (2 * little) for way in np.eye(2))
    for x, y in offsets:
        on, reflected = _reflected(rays + x * across + y * down, turn, centre, sheet, angle, bend)
        paper += on
        shone += on * reflected
    area = (slice(top, bottom), slice(left, right))
    light[area] = light[area] * (1 - paper / len(offsets)) + lit[area] * shone / len(offsets)
    return Photograph(name, centre, _developed(light, look, rng))


def _placed(distance: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """The rotation from the marker's frame, x right, y down, z into the wall, and the centre; all of it is in view."""
    while True:
        sight = np.array([rng.uniform(-0.5, 0.5), rng.uniform(-0.38, 0.38), 1.0])
        sight /= np.linalg.norm(sight)
        across = np.cross([0.0, 1.0, 0.0], sight)
        across /= np.linalg.norm(across)
        facing = np.column_stack((across, np.cross(sight, across), sight))
        toward, lean = rng.uniform(-np.pi, np.pi), np.arccos(rng.uniform(np.cos(np.pi / 4), 1))
        tilt = Rotation.from_rotvec(lean * np.array([np.cos(toward), np.sin(toward), 0.0])).as_matrix()
        turn = facing @ tilt @ Rotation.from_rotvec([0, 0, rng.uniform(-np.pi, np.pi)]).as_matrix()
        corners = SIDE * 0.7 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
        seen = _pixels(corners @ turn.T + distance * sight)
        if (seen > 8).all() and (seen < np.array([WIDTH, HEIGHT]) - 9).all():
            return turn, distance * sight


def _printed(name: int, spread: float) -> NDArray[np.bool_]:
    """The sheet's cells, True is black: a module of paper around the marker, black grown by `spread` m."""
    drawn = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50).generateImageMarker(name, MODULES)
    black = np.pad(np.asarray(drawn) == 0, 1).repeat(FINE, axis=0).repeat(FINE, axis=1)
    beyond = np.asarray(distance_transform_edt(~black)) - np.asarray(distance_transform_edt(black))
    return np.asarray(beyond - 0.5 * np.sign(beyond) < spread * MODULES * FINE / SIDE)


def _offsets(look: Look, rng: np.random.Generator) -> Array:
    """(n, 2) px from a pixel's middle, where its rays pass: box, disc and motion, one of each to a ray."""
    count, steps = RAYS * RAYS, np.arange(RAYS)
    box = (np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) + 0.5) / RAYS - 0.5
    radius = look.defocus * np.sqrt((np.arange(count) + 0.5) / count)
    angle = np.arange(count) * np.pi * (3 - np.sqrt(5))
    disc = np.column_stack((radius * np.cos(angle), radius * np.sin(angle)))
    way = rng.uniform(0, 2 * np.pi)
    along = ((np.arange(count) + 0.5) / count - 0.5)[:, None] * np.array([np.cos(way), np.sin(way)])
    # paired at random, but alike in every picture, as a lens's are
    fixed = np.random.default_rng(0)
    offsets = box + fixed.permutation(disc) + look.motion * fixed.permutation(along)
    return np.asarray(offsets - offsets.mean(axis=0))


def _pixels(points: Array) -> Array:
    """(n, 2) px of points (n, 3) in the camera's frame."""
    ray = points[:, :2] / points[:, 2:]
    square = (ray**2).sum(axis=1, keepdims=True)
    return FOCAL * ray * (1 + K1 * square + K2 * square**2) + CENTRE


def _rays(pixels: Array) -> Array:
    """(..., 3) rays, 1 ahead, through pixels (..., 2): the lens's distortion is inverted by Newton along the radius."""
    far = (pixels - CENTRE) / FOCAL
    bent = np.linalg.norm(far, axis=-1, keepdims=True)
    r = bent.copy()
    for _ in range(6):
        r -= (r * (1 + K1 * r**2 + K2 * r**4) - bent) / (1 + 3 * K1 * r**2 + 5 * K2 * r**4)
    scale = np.divide(r, bent, out=np.ones_like(r), where=bent > 0)
    return np.concatenate((far * scale, np.ones_like(r)), axis=-1)


def _reflected(
    rays: Array, turn: Array, centre: Array, sheet: NDArray[np.bool_], angle: float, bend: float
) -> tuple[NDArray[np.bool_], Array]:
    """Where rays meet the sheet, and the reflectance there: the cylinder is met by fixed-point steps."""
    eye, ways = -turn.T @ centre, rays @ turn
    half = SIDE * (MODULES + 2) / MODULES / 2
    axis = np.array([np.cos(angle), np.sin(angle)])
    curvature = 2 * bend / half**2  # towards the camera, which is at negative z
    slopes = ways[..., :2] / ways[..., 2:]
    at = eye[:2] - slopes * eye[2]
    if bend:
        for _ in range(6):
            across = at @ axis
            sine = np.clip(curvature * across, -0.9, 0.9)
            z = -(curvature * across**2) / (1 + np.sqrt(1 - sine**2))
            at = eye[:2] + slopes * (z - eye[2])[..., None]
        across = at @ axis
        sine = np.clip(curvature * across, -0.9, 0.9)
        stretched = np.divide(np.arcsin(sine), curvature * across, out=np.ones_like(across), where=sine != 0)
        at = at + ((stretched - 1) * across)[..., None] * axis
    cell = np.floor((at + half) / (2 * half) * len(sheet)).astype(int)
    on = ((cell >= 0) & (cell < len(sheet))).all(axis=-1)
    inside = np.where(on[..., None], cell, 0)
    return on, np.where(sheet[inside[..., 1], inside[..., 0]], DARK, LIGHT)


def _room(rng: np.random.Generator) -> tuple[Array, Array]:
    """(h, w) of a wall with soft stains, darker towards one side and the frame's corners; (h, w) of white there."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    stains = np.asarray(cv2.GaussianBlur(rng.normal(size=(HEIGHT, WIDTH)), (0, 0), 9))
    slope = rng.uniform(-0.15, 0.15, 2)
    corner = ((x - CENTRE[0]) ** 2 + (y - CENTRE[1]) ** 2) / FOCAL[0] ** 2
    lit = 0.9 + slope[0] * (x / WIDTH - 0.5) + slope[1] * (y / HEIGHT - 0.5)
    lit = lit * (1 - 0.3 * corner)
    return WALL * (1 + 3 * np.clip(stains, -0.1, 0.1)) * lit, lit


MALVAR_GREEN = np.array([[0, 0, -2, 0, 0], [0, 0, 4, 0, 0], [-2, 4, 8, 4, -2], [0, 0, 4, 0, 0], [0, 0, -2, 0, 0]]) / 16
"""Green, at red and blue."""

MALVAR_ROW = np.array([[0, 0, 1, 0, 0], [0, -2, 0, -2, 0], [-2, 8, 10, 8, -2], [0, -2, 0, -2, 0], [0, 0, 1, 0, 0]]) / 16
"""The colour of a green pixel's row; transposed, of its column."""

MALVAR_CROSS = np.array([[0, 0, -3, 0, 0], [0, 4, 0, 4, 0], [-3, 0, 12, 0, -3], [0, 4, 0, 4, 0], [0, 0, -3, 0, 0]]) / 16
"""Red at blue, and blue at red."""


def _demosaiced(raw: Array) -> Array:
    """(h, w, 3) colours of a GRBG mosaic."""
    green, row, column, cross = (
        np.asarray(cv2.filter2D(raw, -1, kernel, borderType=cv2.BORDER_REFLECT_101))
        for kernel in (MALVAR_GREEN, MALVAR_ROW, MALVAR_ROW.T, MALVAR_CROSS)
    )
    full = np.empty((*raw.shape, 3))
    full[..., 1] = raw
    full[::2, 1::2, 1], full[1::2, ::2, 1] = green[::2, 1::2], green[1::2, ::2]
    for colour, (top, left) in ((0, (0, 1)), (2, (1, 0))):
        full[top::2, left::2, colour] = raw[top::2, left::2]
        full[top::2, 1 - left :: 2, colour] = row[top::2, 1 - left :: 2]
        full[1 - top :: 2, left::2, colour] = column[1 - top :: 2, left::2]
        full[1 - top :: 2, 1 - left :: 2, colour] = cross[1 - top :: 2, 1 - left :: 2]
    return full


def _developed(light: Array, look: Look, rng: np.random.Generator) -> NDArray[np.uint8]:
    """(h, w) the grey picture of `light`, shares of saturation."""
    response = np.ones_like(light)
    if look.mosaic:
        response[::2, 1::2], response[1::2, ::2] = RED, BLUE
    raw = light * response
    raw = raw + np.sqrt(look.noise**2 + look.photons * raw) * rng.normal(size=raw.shape)
    if look.mosaic:
        # White balance first, as raw converters do; 14 bits.
        raw = np.rint(np.clip(raw / response, 0, 1.2) * 16383) / 16383
        colours = _demosaiced(raw)
    else:
        colours = np.repeat(raw[..., None], 3, axis=-1)
    colours = np.clip(colours, 0, 1)
    if look.rec709:
        colours = np.where(colours < 0.018, 4.5 * colours, 1.099 * np.maximum(colours, 0.018) ** 0.45 - 0.099)
    if look.sharpen:
        laplacian = np.array([[1, 2, 1], [2, -12, 2], [1, 2, 1]]) / 3.0
        colours = colours - look.sharpen * np.asarray(cv2.filter2D(colours, -1, laplacian))
    picture = np.rint(255 * np.clip(colours, 0, 1)).astype(np.uint8)
    if look.jpeg:
        _, code = cv2.imencode(".jpg", picture[..., ::-1], (cv2.IMWRITE_JPEG_QUALITY, look.jpeg))
        picture = np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR), np.uint8)[..., ::-1]
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2GRAY), np.uint8)
