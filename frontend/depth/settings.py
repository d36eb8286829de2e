"""Settings of the front end for depth cameras.

What changes where one is halved or doubled, in a rendered room and on a recorded sequence, is in docs/settings.md, by
`make study-settings`.
"""

from dataclasses import dataclass

from ...core.errors import InputError
from ...core.options import option

KINDS, ODOMETERS = ("orb", "sift"), ("wheels", "visual")


@dataclass(frozen=True)
class Settings:
    """Lengths in m, angles in rad, times in s."""

    step: float = option(0.15, "metres between steps of the log", minimum=0.02, maximum=10.0)
    turn: float = option(0.15, "turn, rad, that ends a step, too", minimum=0.02, maximum=3.0)
    features: str = option("orb", "kind of features", choices=KINDS)
    most: int = option(1000, "features looked for in a frame", minimum=50, maximum=20_000)
    landmarks: bool = option(True, "features that are seen again become landmarks, with ids")
    loops: bool = option(False, "search for loop closures")
    odometry: str = option(
        "wheels", "what the motion between steps is taken from; visual: where features tell it", choices=ODOMETERS
    )
    depth_sd: float = option(0.003, "sd of a depth of z m is this times z^2, and 1 mm", minimum=1e-5, maximum=0.1)
    near: float = option(0.4, "depths below, m, are left out", minimum=0.0, maximum=10.0)
    far: float = option(4.5, "depths above, m, are left out", minimum=0.5, maximum=100.0)
    level: bool = option(True, "level every frame by the floor in its depth image")
    sway: float = option(0.02, "sd of pitch and roll, rad, where no floor is found", minimum=0.0, maximum=0.3)
    floor: float = option(0.0003, "sd, m, that every motion has at least", minimum=1e-5, maximum=1.0)
    turn_floor: float = option(0.00015, "sd, rad, that every motion has at least", minimum=1e-6, maximum=1.0)
    floor_share: float = option(0.0, "sd, beside, that every motion has as a share of it", minimum=0.0, maximum=1.0)
    surfaces: bool = option(True, "refuse a motion where one frame sees through the other's surfaces")
    wheels_check: bool = option(True, "refuse a motion that contradicts the wheels, and look for another without it")
    sightings: int = option(30, "most sightings of a step", minimum=1, maximum=1000)

    # features
    pixel_sd = 0.35  # px, of the place of a feature of the finest scale
    constant_sd = 0.001  # m, of every depth
    fitted_sd = 0.7  # of a depth by nine pixels, in terms of the sd of one: neighbours within 3 px err alike
    jump, jump_by_depth = 0.02, 0.02  # m, and m a metre, between neighbours of one surface
    ratio = 0.8  # of the distance to the second best descriptor, that to the best one

    # registration
    hypotheses = 200
    gate = 11.34  # squared distance of an inlier: chi2 of 3 degrees of freedom, 99 %
    inliers = 12  # least number
    weak, weak_turn = 0.05, 0.02  # sd, m and rad, beyond which a view is degenerate

    # wheels
    wheels_gate = 16.27  # squared distance of a motion from the wheels': chi2 of 3 degrees of freedom, 99.9 %

    # surfaces of two frames
    surface_gate = 3.0  # sd
    agree, seen = 0.75, 0.1  # least share of the points not hidden that agree; and of all

    # landmarks
    seen_often = 4  # sightings that a landmark has at least
    seen_apart = 1.15  # sd of its place in the image, in terms of that in matches of neighbours, which err alike: from
    # two thirds of the distance a corner is found elsewhere

    # loops
    loop_after = 5.0  # s
    loop_inliers, loop_inliers_alone = 20, 30  # least number; without wheels
    loop_floor, loop_turn_floor = 0.002, 0.0012  # sd that features of one surface share, m and rad: seen from elsewhere
    # the steps of its depths and its foreshortened features err alike, which those of neighbouring frames cancel
    loop_weak_turn = 0.005  # sd by the features, rad, beyond which they are on a part of one surface, seen from afar
    loops_a_step = 2
    by_words, candidates = 300, 5  # keyframes from which on words choose, and how many they choose
    place_step, place_turn = 0.3, 0.3  # m and rad between keyframes that loops are searched in

    # visual odometry
    blind, blind_turn = 0.3, 0.3  # sd, m and rad, of a motion that nothing tells

    def __post_init__(self) -> None:
        """Refuses what would use one feature for two factors; InputError."""
        if self.landmarks and self.loops:
            raise InputError(
                "options landmarks and loops: found both true, expected one of them: the same features would be "
                "counted twice."
            )
        if self.landmarks and self.odometry == "visual":
            raise InputError(
                "options landmarks and odometry: found landmarks=true with odometry=visual, expected landmarks=false "
                "or odometry=wheels: the same features would be counted twice."
            )
        if self.near >= self.far:
            raise InputError(f"options near and far: found {self.near:g} and {self.far:g} m, expected near below far.")


@dataclass(frozen=True)
class RecordedSettings(Settings):
    """Those of a recording: its calibration, shutter and times are not exact as those of rendered frames are.

    Measured on a hand-held Kinect, 7-Scenes' red kitchen: a NEES of 270 to 440 without, of 0.8 to 2.0 with them.
    """

    floor: float = option(0.005, "sd, m, that every motion has at least", minimum=1e-5, maximum=1.0)
    turn_floor: float = option(0.0026, "sd, rad, that every motion has at least", minimum=1e-6, maximum=1.0)
    floor_share: float = option(0.1, "sd, beside, that every motion has as a share of it", minimum=0.0, maximum=1.0)
