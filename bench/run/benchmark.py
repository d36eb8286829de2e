"""A whole run, from its settings to a folder with its report: what `bench run` and `slamduel.run` do."""

import contextlib
import difflib
import itertools
import shlex
import time
from collections.abc import Generator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...core.errors import InputError, Interrupted
from ..plan.plan import Plan
from ..record.schema import FILE
from ..record.store import Store
from ..report.report import write_report
from ..report.section import Recorded
from ..verdict.statistics import MOST
from ..words.numerals import listed
from ..workers.executor import Executor
from .progress import Screen
from .runner import any_ended, killed_plan, recorded_plan, run

DEFAULTS: dict[str, Any] = {
    "backend": "dead-reckoning,ekf,fastslam,isam2,smoother",
    "dataset": "aruco-room,victoria-park",
    "seeds": 10,
    "timeout_s": 1800.0,
    "memory_mb": 8000,
    "map": None,
    "map_fixed": False,
    "start": "known",
    "oracle": False,
    "repeats": None,
}
"""the settings of a run where nothing is given"""


def benchmark(
    given: Mapping[str, Any],
    out: Path,
    executor: Executor,
    command: Sequence[str],
    watcher: Screen,
    *,
    retry: bool = False,
    strict: bool = False,
    lasting: bool = False,
) -> tuple[Plan, Recorded]:
    """Runs `given` and DEFAULTS into `out`, or continues its run where nothing is given; returns its plan and record.

    The executor is closed before the report is written, which needs the memory of its workers where logs are long,
    unless it is `lasting`. InputError where `out` has other settings, or nothing is given and it has no run, and with
    `strict` for a log with a remark.
    """
    plan = planned(given, out)
    if (plan.repeats or 1) > 1 and not executor.times:
        raise InputError(
            f"repeats: found {plan.repeats}, and an executor that cannot run cells one at a time on each machine, "
            "expected one that can, on Dask by workers with the resource MACHINE: times of cells that run side by side "
            "are not compared."
        )
    if not given and killed_plan(out) is not None:
        watcher.say(f"The run in {out} was killed before all of its logs were made: it begins again.")
    elif not given and not any_ended(out):
        watcher.say(f"The run in {out} was stopped before any of its cells had ended: it goes on.")
    elif given == DEFAULTS:
        watcher.say(f"A new run in {out}: {DEFAULTS['backend']} on {DEFAULTS['dataset']}, {DEFAULTS['seeds']} seeds.")
    try:
        run(plan, out, executor, command, watcher, retry=retry, strict=strict)
    except KeyboardInterrupt:
        if not begun(out):
            raise Interrupted(f"no cell was begun, and {out} holds nothing of this run") from None
        raise Interrupted(f"bench run --out {shlex.quote(str(out))} continues from here") from None
    watcher.reporting()
    if not lasting:
        executor.close()
    with Store(out) as store:
        return plan, write_report(store)


def asked(given: Mapping[str, Any], out: Path | None) -> Mapping[str, Any]:
    """`given`, or DEFAULTS where nothing is given, nor a folder `out` whose run would be continued."""
    return given if given or out is not None else DEFAULTS


def planned(given: Mapping[str, Any], out: Path) -> Plan:
    """The plan of the run in `out`, else that of `given` and DEFAULTS; InputError as `benchmark`."""
    plan = recorded_plan(out)
    if plan is None and not given:
        plan = killed_plan(out)
    if plan is None:
        if not given:
            raise _no_run(out)
        plan = Plan.from_words(DEFAULTS | dict(given))
        if "seeds" in given:
            _refuse_seeds(plan)
        if len(plan.backends) > 1 and plan.seeds > MOST and any(one.source.draws(one.options) for one in plan.datasets):
            raise InputError(f"seeds: found {plan.seeds:,}, expected at most {MOST:,} to compare backends on.")
        return plan
    return replace(plan, repeats=_refuse_another(plan, given, out))


def _refuse_seeds(plan: Plan) -> None:
    """Raises InputError for a number of seeds where every dataset has logs of its own, another number of them.

    One is what they are run with, and some write it for every dataset without randomness.
    """
    logs = {dataset.label: len(dataset.members) for dataset in plan.datasets if len(dataset.members) > 1}
    if plan.seeds > 1 and len(logs) == len(plan.datasets) and set(logs.values()) != {plan.seeds}:
        said = listed([f"{label} has {count} logs" for label, count in logs.items()])
        raise InputError(f"seeds: found {plan.seeds}, expected none, or 1: {said}, and all of them are run, each once.")


def _no_run(out: Path) -> InputError:
    """The error of a folder that has no run to continue, with the run beside it that has nearly its name."""
    beside = () if out.exists() else (folder.parent.name for folder in out.absolute().parent.glob(f"*/{FILE}"))
    close = difflib.get_close_matches(out.name, sorted(beside), n=1)
    meant = f", did you mean {out.with_name(close[0])}?" if close else ";"
    return InputError(f"--out {out}: there is no run to continue{meant} --backend and --dataset begin one.")


@contextlib.contextmanager
def folder_for(out: Path | None) -> Generator[Path]:
    """Gives `out`, or a new folder: results/DATE-TIME, with -2 and so on behind it where that is there already.

    A new one is made at once, as another run may begin in the same second; it is removed again if it stays empty.
    """
    if out is not None:
        yield out
        return
    first = Path("results") / time.strftime("%Y%m%d-%H%M%S")
    more = (first.with_name(f"{first.name}-{count}") for count in itertools.count(2))
    made = next(folder for folder in itertools.chain([first], more) if _is_made(folder))
    try:
        yield made
    finally:
        with contextlib.suppress(OSError):  # not empty
            made.rmdir()
            made.parent.rmdir()


def _is_made(folder: Path) -> bool:
    """Makes a folder; False where something has its name."""
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        return False
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror}); expected --out FOLDER.") from None
    return True


def begun(out: Path) -> bool:
    """True if `out` holds a run to continue."""
    with contextlib.suppress(InputError):
        return recorded_plan(out) is not None
    return False


def _refuse_another(plan: Plan, given: Mapping[str, Any], out: Path) -> int | None:
    """The repeats to be there, no fewer than were asked for before; InputError where other settings differ."""
    recorded = plan.words()
    asked = Plan.from_words(recorded | {"map_digest": None} | dict(given)).words()
    if plan.repeats is not None and asked["repeats"] < plan.repeats:
        raise InputError(
            f"--out {out}: holds a run with repeats {plan.repeats}, found repeats {asked['repeats']}; expected at "
            "least as many, or nothing but --out to continue it, or another folder."
        )
    for name, value in asked.items():
        if name != "repeats" and value != recorded[name]:
            raise InputError(
                f"--out {out}: holds a run with {name} {recorded[name]}, found {name} {value}; expected the same, or "
                "nothing but --out to continue it, or another folder."
            )
    return asked["repeats"]
