"""A whole run, from words to a folder with its report: what `bench run` and `slamduel.run` both do."""

import contextlib
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...frontend.errors import InputError, Interrupted
from ..plan.plan import Plan
from ..record.store import Store
from ..report.report import write_report
from ..verdict.walsh import MOST
from ..workers.executor import Executor
from .progress import Screen
from .runner import recorded_plan, run

DEFAULTS: dict[str, Any] = {
    "backend": "dead-reckoning,ekf,fastslam,isam2,smoother",
    "dataset": "aruco-room,victoria-park",
    "seeds": 10,
    "timeout_s": 1800.0,
    "memory_mb": 8000,
    "map": None,
    "map_fixed": False,
    "oracle": False,
}
"""What a run is when nothing is said."""


def benchmark(
    given: Mapping[str, Any],
    out: Path,
    executor: Executor,
    command: Sequence[str],
    watcher: Screen,
    *,
    retry: bool = False,
) -> Plan:
    """Run what `given` says, and DEFAULTS where it says nothing, into `out`; or go on with the run that is in there.

    InputError where that run is another one than what is asked for.
    """
    plan = planned(given, out)
    try:
        run(plan, out, executor, command, watcher, retry=retry)
    except KeyboardInterrupt:
        if not begun(out):
            raise Interrupted(f"no cell was begun, and {out} holds nothing of this run") from None
        raise Interrupted(f"bench run --out {shlex.quote(str(out))} goes on where this stopped") from None
    watcher.reporting()
    with Store(out) as store:
        write_report(store)
    return plan


def planned(given: Mapping[str, Any], out: Path) -> Plan:
    """The plan of the run in `out`, else what `given` and DEFAULTS say. InputError as for `benchmark`."""
    plan = recorded_plan(out)
    if plan is None:
        plan = Plan.from_words(DEFAULTS | dict(given))
        if len(plan.backends) > 1 and plan.seeds > MOST and any(dataset.source.seeded for dataset in plan.datasets):
            raise InputError(f"seeds: found {plan.seeds:,}, expected at most {MOST:,} to compare backends on.")
        return plan
    _refuse_another(plan, given, out)
    return plan


def begun(out: Path) -> bool:
    """Whether `out` holds a run to go on with."""
    with contextlib.suppress(InputError):
        return recorded_plan(out) is not None
    return False


def _refuse_another(plan: Plan, given: Mapping[str, Any], out: Path) -> None:
    """InputError where `out` holds a run of another plan than the one asked for."""
    recorded = plan.words()
    asked = Plan.from_words(recorded | {"map_digest": None} | dict(given)).words()
    for name, value in asked.items():
        if value != recorded[name]:
            raise InputError(
                f"--out {out}: holds a run with {name} {recorded[name]}, found {name} {value}; expected the same, or "
                "nothing but --out to go on with it, or another folder."
            )
