"""The same robot log through several SLAM backends, and a verdict that holds up.

    log = slamduel.Log.from_arrays(...)
    slamduel.run(log, backend="ekf,isam2")

Public are the names listed here and `slamduel.backends.api`, which plug-ins import; all other modules may move.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .bench.check.suite import check as check
    from .bench.logs.show import LogPicture as LogPicture
    from .bench.logs.show import show as show
    from .bench.plan.load import load as load
    from .bench.report.comparison import compare as compare
    from .bench.run.result import Result as Result
    from .bench.run.result import run as run
    from .bench.study_report.result import study as study
    from .core.errors import InputError as InputError
    from .core.errors import SlamduelError as SlamduelError
    from .core.factors import UNKNOWN as UNKNOWN
    from .core.factors import Dataset as Dataset
    from .core.factors import Log as Log
    from .core.factors import Map as Map
    from .core.factors import Odometry as Odometry
    from .core.factors import Prior as Prior
    from .core.factors import RangeBearing as RangeBearing
    from .core.factors import RelativePoses as RelativePoses
    from .core.factors import Step as Step
    from .core.factors import Systematic as Systematic
    from .core.factors import Truth as Truth
    from .core.fixes import FixTable as FixTable
    from .core.gyro import Bias as Bias
    from .core.gyro import Gyro as Gyro
    from .core.mounting import Mounting as Mounting
    from .core.partial import BEARING as BEARING
    from .core.partial import RANGE as RANGE
    from .core.partial import PartialTable as PartialTable

_HOMES = {
    "BEARING": ".core.partial",
    "Bias": ".core.gyro",
    "FixTable": ".core.fixes",
    "Gyro": ".core.gyro",
    "InputError": ".core.errors",
    "LogPicture": ".bench.logs.show",
    "Mounting": ".core.mounting",
    "PartialTable": ".core.partial",
    "RANGE": ".core.partial",
    "Result": ".bench.run.result",
    "SlamduelError": ".core.errors",
    "check": ".bench.check.suite",
    "compare": ".bench.report.comparison",
    "load": ".bench.plan.load",
    "run": ".bench.run.result",
    "show": ".bench.logs.show",
    "study": ".bench.study_report.result",
} | dict.fromkeys(
    (
        "UNKNOWN",
        "Dataset",
        "Log",
        "Map",
        "Odometry",
        "Prior",
        "RangeBearing",
        "RelativePoses",
        "Step",
        "Systematic",
        "Truth",
    ),
    ".core.factors",
)
"""The public names and the modules that they are imported from, when first asked for."""

__all__ = sorted(_HOMES)  # noqa: PLE0605  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name], __name__), name)


def __dir__() -> list[str]:
    return __all__
