"""Pictures of one marker by a camera with a colour filter, in plain numpy and of nothing in `datasets/rendering`.

Every pixel is the mean over a lattice of rays that meet a flat marker, drawn with a lens's Gaussian blur at the scale
of that lattice. Then come the filter, in any of its four phases, noise, one of several ways to interpolate colours, a
tone curve, an unsharp mask and 8 bits.
"""

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve, gaussian_filter
from scipy.spatial.transform import Rotation

from slamduel.frontend.camera.camera import Camera

Array = NDArray[np.float64]

SIDE, MODULES = 0.16, 6
WIDTH, HEIGHT, FOCAL = 640, 480, 600.0
CENTRE = np.array([321.3, 238.4])
FORWARD = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.5], [0.0, 0.0, 0.0, 1.0]])
CAMERA = Camera(WIDTH, HEIGHT, (FOCAL, FOCAL), (CENTRE[0], CENTRE[1]), (0.0,) * 5, FORWARD)

FINE = 8
"""Rays of a pixel across and down."""

PHASES = ("RGGB", "GRBG", "GBRG", "BGGR")
COLOURS = ("opencv-ea", "bilinear", "edge-aware", "opencv-vng", "malvar")
"""How colours are interpolated: OpenCV's two, bilinearly, Hamilton and Adams's, and Malvar, He and Cutler's way."""

DARK, LIGHT, WALL = 30.0, 200.0, 140.0  # grey levels of linear light: ink, paper, what is behind
TO_GREY = np.array([0.299, 0.587, 0.114])


@dataclass(frozen=True)
class Process:
    """What a camera makes of the light."""

    phase: str | None = None  # of the colour filter; None: a grey sensor
    colours: str = "bilinear"  # of COLOURS
    gamma: float = 1.0
    sharpen: float = 0.0  # amount of the unsharp mask, after the tone curve
    radius: float = 1.0  # px, standard deviation of the mask's blur
    blur: float = 0.6  # px, standard deviation of the lens's blur, without that of a pixel's own square
    noise: float = 1.5  # grey levels of linear light
    response: tuple[float, float, float] = (1.0, 1.0, 1.0)  # of the three colours to white, before white balance


class Picture(NamedTuple):
    """A picture of one marker."""

    id: int
    centre: Array  # (3,) m, in the camera's frame
    image: NDArray[np.uint8]


def picture(process: Process, distance: float, rng: np.random.Generator, roll: float = np.pi) -> Picture:
    """A marker at a random place in view, `distance` m away, tilted by up to 45 degrees.

    It is turned by up to `roll`, rad, about its own normal: at 0 it hangs level, its edges nearly along the pixels.
    """
    name = int(rng.integers(50))
    turn, centre = _placed(distance, rng, roll)
    sheet = np.pad(np.asarray(_DICTIONARY.generateImageMarker(name, MODULES), float) > 0, 1, constant_values=True)
    half = SIDE / 2 * (1 + 2 / MODULES)
    outline = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]]) @ turn.T + centre
    seen = FOCAL * outline[:, :2] / outline[:, 2:] + CENTRE
    left, top = np.floor(seen.min(axis=0)).astype(int) // 2 * 2 - 8
    right, bottom = np.ceil(seen.max(axis=0)).astype(int) + 10
    left, top, right, bottom = max(left, 0), max(top, 0), min(right, WIDTH), min(bottom, HEIGHT)
    part = (np.arange(FINE) + 0.5) / FINE - 0.5
    x = (np.arange(left, right)[:, None] + part).ravel()
    y = (np.arange(top, bottom)[:, None] + part).ravel()
    rays = np.stack((*np.meshgrid((x - CENTRE[0]) / FOCAL, (y - CENTRE[1]) / FOCAL), np.ones((len(y), len(x)))), -1)
    far = (turn[:, 2] @ centre) / (rays @ turn[:, 2])
    on = (rays * far[..., None] - centre) @ turn[:, :2]
    cell = np.floor((on + half) / (2 * half) * len(sheet)).astype(int)
    inside = np.asarray(((cell >= 0) & (cell < len(sheet))).all(axis=-1))
    column, row = np.where(inside[..., None], cell, 0).transpose(2, 0, 1)
    light = np.where(inside, np.where(sheet[row, column], LIGHT, DARK), WALL)
    light = gaussian_filter(light, process.blur * FINE, mode="nearest")
    light = light.reshape(bottom - top, FINE, right - left, FINE).mean(axis=(1, 3))
    wall = WALL + process.noise * rng.normal(size=(HEIGHT, WIDTH))
    frame = np.rint(np.clip(wall, 0, 255)).astype(np.uint8)
    frame[top:bottom, left:right] = developed(light, process, rng)
    return Picture(name, centre, frame)


_DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)


def _placed(distance: float, rng: np.random.Generator, roll: float) -> tuple[Array, Array]:
    """The rotation from the marker's frame, x right, y down, z away, and its centre; the sheet is in view."""
    while True:
        sight = np.array([rng.uniform(-0.5, 0.5), rng.uniform(-0.38, 0.38), 1.0])
        sight /= np.linalg.norm(sight)
        # a camera that is panned, then tipped, to look at the marker
        facing = Rotation.from_euler("YX", [np.arctan2(sight[0], sight[2]), -np.arcsin(sight[1])])
        toward, lean = rng.uniform(-np.pi, np.pi), rng.uniform(0, np.pi / 4)
        tilt = Rotation.from_rotvec(lean * np.array([np.cos(toward), np.sin(toward), 0.0]))
        turn = (facing * tilt * Rotation.from_rotvec([0, 0, rng.uniform(-roll, roll)])).as_matrix()
        corners = SIDE * 0.7 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
        points = corners @ turn.T + distance * sight
        seen = FOCAL * points[:, :2] / points[:, 2:] + CENTRE
        if (seen > 4).all() and (seen < np.array([WIDTH, HEIGHT]) - 5).all():
            return turn, distance * sight


def developed(light: Array, process: Process, rng: np.random.Generator) -> NDArray[np.uint8]:
    """(h, w) the grey picture of `light` (h, w), grey levels of linear light."""
    if process.phase is None:
        colours = np.repeat((light + process.noise * rng.normal(size=light.shape))[..., None], 3, axis=-1)
    else:
        response = np.array(process.response)[_filter(process.phase, light.shape)]
        raw = (light * response + process.noise * rng.normal(size=light.shape)) / response
        colours = _interpolated(np.clip(raw, 0, 255), process.phase, process.colours)
    grey = 255 * (np.clip(colours, 0, 255) / 255) ** (1 / process.gamma) @ TO_GREY
    if process.sharpen:
        grey = grey + process.sharpen * (grey - gaussian_filter(grey, process.radius))
    return np.asarray(np.clip(np.rint(grey), 0, 255), np.uint8)


def _filter(phase: str, shape: tuple[int, ...]) -> NDArray[np.int64]:
    """(h, w) each pixel's colour: 0, 1, 2 are red, green and blue."""
    tile = np.array(["RGB".index(letter) for letter in phase]).reshape(2, 2)
    return np.tile(tile, (shape[0] // 2 + 1, shape[1] // 2 + 1))[: shape[0], : shape[1]]


def _interpolated(raw: Array, phase: str, how: str) -> Array:
    """(h, w, 3) the colours of a mosaic."""
    if how == "opencv-vng":
        return np.asarray(cv2.cvtColor(np.rint(raw).astype(np.uint8), _CODES[phase, how]), float)
    if how == "opencv-ea":
        return np.asarray(cv2.cvtColor(np.rint(raw * 257).astype(np.uint16), _CODES[phase, how]), float) / 257
    return {"bilinear": _bilinear, "edge-aware": _edge_aware, "malvar": _malvar}[how](raw, _filter(phase, raw.shape))


_CODES = {
    ("RGGB", "opencv-ea"): cv2.COLOR_BayerRGGB2RGB_EA,
    ("GRBG", "opencv-ea"): cv2.COLOR_BayerGRBG2RGB_EA,
    ("GBRG", "opencv-ea"): cv2.COLOR_BayerGBRG2RGB_EA,
    ("BGGR", "opencv-ea"): cv2.COLOR_BayerBGGR2RGB_EA,
    ("RGGB", "opencv-vng"): cv2.COLOR_BayerRGGB2RGB_VNG,
    ("GRBG", "opencv-vng"): cv2.COLOR_BayerGRBG2RGB_VNG,
    ("GBRG", "opencv-vng"): cv2.COLOR_BayerGBRG2RGB_VNG,
    ("BGGR", "opencv-vng"): cv2.COLOR_BayerBGGR2RGB_VNG,
}

_NEAR = np.array([[1, 2, 1], [2, 4, 2], [1, 2, 1]]) / 4
_CROSS = np.array([[0, 1, 0], [1, 4, 1], [0, 1, 0]]) / 4


def _bilinear(raw: Array, at: NDArray[np.int64]) -> Array:
    return np.stack(
        [convolve(np.where(at == k, raw, 0), _CROSS if k == 1 else _NEAR, mode="mirror") for k in range(3)], -1
    )


def _edge_aware(raw: Array, at: NDArray[np.int64]) -> Array:
    """Hamilton and Adams 1997: green along the smaller gradient, then red and blue by their differences to green."""

    def along(kernel: list[float], axis: int) -> Array:
        shaped = np.array(kernel)[None] if axis else np.array(kernel)[:, None]
        return np.asarray(convolve(raw, shaped, mode="mirror"))

    guess, rough = list[Array](), list[Array]()
    for axis in (1, 0):
        second = along([-1, 0, 2, 0, -1], axis)
        guess.append(along([0, 0.5, 0, 0.5, 0], axis) + second / 4)
        rough.append(np.abs(along([0, 1, 0, -1, 0], axis)) + np.abs(second))
    mixed = np.where(rough[0] < rough[1], guess[0], np.where(rough[1] < rough[0], guess[1], (guess[0] + guess[1]) / 2))
    green = np.where(at == 1, raw, mixed)
    full = [green + convolve(np.where(at == k, raw - green, 0), _NEAR, mode="mirror") for k in (0, 2)]
    return np.stack((full[0], green, full[1]), -1)


_GREEN = np.array([[0, 0, -2, 0, 0], [0, 0, 4, 0, 0], [-2, 4, 8, 4, -2], [0, 0, 4, 0, 0], [0, 0, -2, 0, 0]]) / 16
_ROW = np.array([[0, 0, 1, 0, 0], [0, -2, 0, -2, 0], [-2, 8, 10, 8, -2], [0, -2, 0, -2, 0], [0, 0, 1, 0, 0]]) / 16
_OTHER = np.array([[0, 0, -3, 0, 0], [0, 4, 0, 4, 0], [-3, 0, 12, 0, -3], [0, 4, 0, 4, 0], [0, 0, -3, 0, 0]]) / 16


def _malvar(raw: Array, at: NDArray[np.int64]) -> Array:
    """Malvar, He and Cutler 2004."""
    green, row, column, other = (convolve(raw, k, mode="mirror") for k in (_GREEN, _ROW, _ROW.T, _OTHER))
    full = np.empty((*raw.shape, 3))
    full[..., 1] = np.where(at == 1, raw, green)
    for k in (0, 2):
        in_row = np.broadcast_to((at == k).any(axis=1)[:, None], at.shape)
        full[..., k] = np.where(at == k, raw, np.where(at == 2 - k, other, np.where(in_row, row, column)))
    return full
