"""The same robot log through several SLAM backends, and a verdict that holds up.

log = slamduel.Log.from_arrays(...)
slamduel.run(log, backend="ekf,isam2")
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .bench.logs.show import show as show
    from .bench.plan.load import load as load
    from .bench.run.result import Result as Result
    from .bench.run.result import run as run
    from .frontend.errors import SlamduelError as SlamduelError
    from .frontend.factors import UNKNOWN as UNKNOWN
    from .frontend.factors import Dataset as Dataset
    from .frontend.factors import Log as Log
    from .frontend.factors import Map as Map
    from .frontend.factors import Odometry as Odometry
    from .frontend.factors import Prior as Prior
    from .frontend.factors import RangeBearing as RangeBearing
    from .frontend.factors import RelativePoses as RelativePoses
    from .frontend.factors import Step as Step
    from .frontend.factors import Truth as Truth

__all__ = [
    "UNKNOWN",
    "Dataset",
    "Log",
    "Map",
    "Odometry",
    "Prior",
    "RangeBearing",
    "RelativePoses",
    "Result",
    "SlamduelError",
    "Step",
    "Truth",
    "load",
    "run",
    "show",
]

_PLACES = {
    "Result": ".bench.run.result",
    "run": ".bench.run.result",
    "show": ".bench.logs.show",
    "load": ".bench.plan.load",
    "SlamduelError": ".frontend.errors",
}
"""Where what is not a part of the shared language is imported from, when it is first asked for."""


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PLACES.get(name, ".frontend.factors"), __name__), name)


def __dir__() -> list[str]:
    return __all__
