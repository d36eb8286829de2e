"""The ArUco document's robot in a room with markers on its walls; sightings are simulated, not rendered.

The parameters are those of the implementation that comes with ArUco EKF SLAM: metres per count of either wheel, the
wheel base, the noise of eqs (1) and (10), the camera's calibration and its mounting, 15 degrees up, the markers' side,
and the maximum range of 3 m. The encoders' rate, which eq. (1) leaves open, the floors, the room and the drive are
ours. Heights are relative to the camera's.
"""

from dataclasses import dataclass

import numpy as np

from ...core.elementary import cos, hypot, sincos
from ...core.factors import Dataset, Log, Map, Truth
from ...core.options import option
from ...core.se2 import Array, Ints, wrap
from ...core.small_matrices import product
from ...core.truth.errors import sighted_from
from ...frontend.camera.camera import Camera
from ...frontend.camera.mounting import from_matrix
from ...frontend.markers.noise import ProportionalNoise
from ...frontend.wheels.encoder import Encoder
from ..hidden_ids import HiddenIds
from ..on_demand.fixes import WorldFixes
from ..on_demand.gyro import WorldGyro
from ..on_demand.parts import Parts
from ..on_demand.signatures import WorldSignatures
from ..on_demand.slip import WorldSlip
from ..on_map import OnMap
from ..registry import Source
from ..rendering.room import Room, wall_point
from .faults import Faults, with_faults
from .measurements import counted, in_reach, polar, prior
from .wheeled_robot import ClosedPath, count, drive

ENCODER = Encoder(left=2.31249273072714e-06, right=2.30439760302837e-06, base=0.719561485930414, k=0.01, interval=0.05)
"""Each reading of d metres has an error of k |d|; 20 readings per second."""

NOISE = ProportionalNoise(k_range=0.05, k_bearing=0.05)

CAMERA = Camera(
    width=960,
    height=540,
    focal=(525.2866, 525.2178),
    centre=(472.8574, 264.7718),
    distortion=(0.04160, -0.04771, -0.003264, -0.003985, 0.01110),
    mounting=from_matrix(
        [[0, 0.258819, 0.965926, 0.18], [-1, 0, 0, -0.1], [0, -0.965926, 0.258819, 0], [0, 0, 0, 1]], "the mounting"
    ),
)

SIDE, FARTHEST = 0.14, 3.0  # m, of a marker, and from the camera to the farthest that is used
FLATTEST = cos(np.deg2rad(70.0))  # largest viewing angle at which a marker is read

ROOM = Room(length=6.0, width=5.0, height=2.5, side=SIDE, markers=())

LOW, HIGH = 0.1, 0.9  # m above the camera, range of the markers' heights on the walls

LOOP = ClosedPath(
    cos=np.array([[1.5, 0.0], [0.0, 0.0], [0.15, 0.0]]),
    sin=np.array([[0.0, 1.1], [0.0, 0.0], [0.0, 0.0]]),
)
"""A lap of 8 m around the room, counter-clockwise."""


@dataclass(frozen=True)
class Options(HiddenIds, OnMap, Parts, WorldFixes, WorldGyro, WorldSlip, WorldSignatures, Faults):
    """The room, the drive, and faults."""

    markers: int = option(24, "markers around the walls", minimum=1, maximum=200)
    seconds: float = option(60.0, "length of the drive, s", minimum=1.0, maximum=3600.0)
    frame_rate: float = option(5.0, "camera frames per second, each a keyframe", minimum=0.5, maximum=30.0)
    speed: float = option(0.4, "speed of the robot, m/s", minimum=0.05, maximum=1.0)


def aruco_robot(options: Options, rng: np.random.Generator) -> Dataset:
    """The ArUco document's robot, with its encoders, camera and noise, in a room of markers; one room per seed."""
    start, room, wheels, floors, seeing = rng.spawn(5)
    t = np.arange(int(options.seconds * options.frame_rate + 1e-9) + 1) / options.frame_rate
    assert ENCODER.interval is not None
    ticks = ENCODER.interval * np.arange(int(np.ceil(t[-1] / ENCODER.interval)) + 2.0)
    poses, _ = drive(LOOP, options.speed, t)
    readings = count(*drive(LOOP, options.speed, ticks), ticks, ENCODER, wheels)
    delta, delta_cov = counted(readings, ENCODER, t, floors)
    places, normals = _hang(options.markers, room)
    step, marker = in_view(poses, places, normals)
    xy = places[marker, :2]
    right = sighted_from(poses[step], xy)
    right[:, 1] = wrap(right[:, 1])
    sd = np.sqrt(NOISE.cov(right)[:, [0, 1], [0, 1]])
    z, _ = polar(poses[step], xy, sd, seeing)
    z_cov = NOISE.cov(z)  # from the readings, as on a robot
    ids, beginning = np.arange(options.markers), prior(poses[0], start)
    after = "simulated after ArUco EKF SLAM and its implementation; room, drive and floors are ours"
    notes = {"source": after, "noise": NOISE.settings}
    log = Log.from_arrays("aruco-robot", beginning, t, delta, delta_cov, step, ids[marker], z, z_cov, notes=notes)
    return with_faults(Dataset(log, Truth(t, poses, Map(ids, places[:, :2], None), None, "truth")), options, rng)


def in_view(poses: Array, places: Array, normals: Array) -> tuple[Ints, Ints]:
    """Markers, at `places` (n, 3) and facing `normals` (n, 2), that the camera reads from `poses` (p, 3).

    Returns the steps and the markers: those with all four corners in the image, in range, and not at too sharp an
    angle.
    """
    step, marker = in_reach(poses, places[:, :2], 0.0, FARTHEST + float(hypot(*CAMERA.mounting[:2, 3])))
    place, normal = places[marker], normals[marker]
    along = np.column_stack((-normal[:, 1], normal[:, 0], np.zeros(len(step))))
    up = np.array([0.0, 0.0, 1.0])
    half = SIDE / 2
    corners = place[:, None] + half * np.stack((along + up, along - up, -along - up, -along + up), axis=1)
    inside = np.ones(len(step), bool)
    for k in range(4):
        points = _seen_from(poses[step], corners[:, k])
        front = points[:, 2] > 0.1
        pixels = CAMERA.project(np.where(front[:, None], points, [0.0, 0.0, 1.0]))
        inside &= front & ((pixels >= 0) & (pixels <= [CAMERA.width - 1, CAMERA.height - 1])).all(axis=1)
    centre = _seen_from(poses[step], place)
    distance = np.linalg.norm(centre, axis=1)
    towards = _seen_from(poses[step], place + np.column_stack((normal, np.zeros(len(step))))) - centre
    facing = -np.einsum("si,si->s", centre, towards) > FLATTEST * distance
    inside &= facing & (distance <= FARTHEST)
    return step[inside], marker[inside]


def _seen_from(poses: Array, points: Array) -> Array:
    """The points (s, 3) of the world in the frame of the camera of a robot at `poses` (s, 3)."""
    s, c = sincos(poses[:, 2])
    x, y = (points[:, :2] - poses[:, :2]).T
    on_robot = np.stack((c * x + s * y, -s * x + c * y, points[:, 2]), axis=-1)
    return product(on_robot - CAMERA.mounting[:3, 3], CAMERA.mounting[:3, :3])


def _hang(count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Positions (count, 3) and normals (count, 2) of markers around the walls: even, each shifted at random."""
    along = ROOM.perimeter * (np.arange(count) + rng.uniform(0.1, 0.9, count)) / count
    xy, normals = wall_point(ROOM, along)
    return np.column_stack((xy, rng.uniform(LOW, HIGH, count))), normals


source = Source(aruco_robot, options=Options, seeded=True)
