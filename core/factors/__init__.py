"""The factors given to every backend, and the log and ground truth they come from.

Conventions, everywhere: metres, radians, seconds, float64. World x, y; body x forward, y left; headings
counter-clockwise in (-pi, pi]. A measurement is (range, bearing), the bearing from the body's x axis. Odometry is the
motion since the last step in the body frame *before* the motion, with its covariance in those coordinates. A pose's
covariance is of (x, y, heading) in the world frame. An unknown covariance is None, never zeros.
"""

from .digest import digest_of as digest_of
from .ground_truth import Truth as Truth
from .landmarks import UNKNOWN as UNKNOWN
from .landmarks import Map as Map
from .priors import STARTS as STARTS
from .priors import Prior as Prior
from .priors import Start as Start
from .priors import Systematic as Systematic
from .robot_log import CONSTANTS_NOTE as CONSTANTS_NOTE
from .robot_log import REMARKS as REMARKS
from .robot_log import TABLES as TABLES
from .robot_log import Dataset as Dataset
from .robot_log import Log as Log
from .steps import Odometry as Odometry
from .steps import RangeBearing as RangeBearing
from .steps import RelativePoses as RelativePoses
from .steps import Step as Step
