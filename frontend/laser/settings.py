"""Settings of the laser front end.

Chosen on the logs of Intel and CSAIL and on made-up floors, and kept as they are on others. What changes where one is
halved or doubled, on a made-up floor and on Intel, is in docs/settings.md (`make study-settings`).
"""

from dataclasses import dataclass

from ...core.factors import STARTS
from ...core.options import option


@dataclass(frozen=True)
class Settings:
    """Lengths in m, angles in rad, times in s."""

    step: float = option(0.5, "metres between steps of the log", minimum=0.05, maximum=10.0)
    turn: float = option(0.4, "turn, rad, that ends a step, too", minimum=0.05, maximum=3.0)
    cell: float = option(0.05, "size of a submap's cells, m", minimum=0.01, maximum=0.5)
    loops: bool = option(True, "search for loop closures")
    grid: str | None = option(
        None, "localise on this occupancy grid: a folder of bench map, or the .yaml of a ROS map; * is the seed"
    )
    start: str = option(
        "known", "unknown: the robot may be anywhere on the grid, and is found by its scans", choices=STARTS
    )
    loop_every: int = option(1, "steps from one search for loops to the next", minimum=1)
    stamp_sd: float = option(
        0.005, "sd of a scan's time, s: it is swept on the move, and stamps are off", minimum=0.0, maximum=0.1
    )
    dense_start: float = option(
        0.0, "metres of path at the start in which three times as many scans are drawn into the submap: in a corridor "
        "the first headings are then half as far off", minimum=0.0, maximum=100.0,
    )  # fmt: skip

    # submaps
    insert_step, insert_turn = 0.15, 0.12  # between scans that are drawn
    denser = 1 / 3  # of these, while the start is dense
    submap_path = 5.0  # between starts of submaps; each lives for two of these
    turn_path = 0.5  # m of path that a radian of turning counts for
    share = 0.25  # of the beams that come to a wall, those that it reflects

    ground, ground_turn, replaced = 1.0, 0.8, 0.9  # around a step; share of a submap's steps that others have to cover
    newer = 4  # submaps of the same ground that replace an older one
    opened = 16  # submaps that are searched without being unpacked first

    # scan matching
    sd = 0.03  # of a point from its line
    spacing = 0.04  # between points that are matched
    lost = 0.8  # share of points explained below which the scan is searched for
    map_share = 0.35  # of the variance that a match has by its points: what the map's errors and the search add

    # odometry: sd of a motion
    still, by_way = 0.03, 0.15  # m, and m a metre
    turn_still, by_turn, turn_by_way = 0.04, 0.25, 0.10  # rad, rad a radian, rad a metre
    blind = 0.15  # sd, m and rad, of a motion that only the motion before tells

    # loops
    loop_path = 12.0  # of a submap since its end, at least
    loop_radius, loop_submaps = 8.0, 3  # around the estimate, and how many of the nearest
    window, window_start, window_by_path = 7.0, 0.5, 0.05  # search window: at most, at first, and for a metre of path
    turn_window, turn_start, turn_by_path = 0.5, 0.15, 0.01
    field_sd = 0.1  # of the field that is searched on
    score, inside, through, free = 0.55, 0.7, 0.10, 0.15  # see `loops.searched`
    cloud, cloud_cell, searched = 14, 0.1, 160  # insertions that are searched with together; thinned; points searched
    alone, alone_turn = 0.15, 0.03  # how far the scan alone may disagree
    expected, expected_by_path = 0.3, 0.004  # a loop within this of the estimate is no surprise
    expected_turn, expected_turn_by_path = 0.08, 0.001
    confirm, confirm_path, confirm_within = 4, 2.0, 20.0  # steps that ask for the same correction
    same, same_turn = 0.3, 0.05
    optimise_every, optimise_last = 60, 300  # steps; how many of the last are optimised then
    optimise_all = 0.1  # of all steps, as new ones, from which on all are optimised again
