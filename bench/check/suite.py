"""The suite behind `bench check BACKEND`: the same checks on every backend, built in or plugged in.

A check returns a sentence on its finding, or raises Failed, GaveUp or NotApplicable with one; any other exception is
the backend's, and fails that check alone. Checks come in three families: `contract` and `estimates`, each a function
whose docstring is its title, and `adversarial`, one for each of the fifty logs.
"""

import traceback
from collections.abc import Callable, Collection, Iterable
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple

from ...backends.api import Builder, Unsuited
from ...core.errors import InputError
from ..plan.spec import backend_variants
from . import contract, data_association, estimates, parts, side_effects
from .adversarial import ends_near_the_batch_answer, stands_logs_without_ids
from .adversarial_logs import ADVERSARIES
from .candidate import Candidate, Failed, GaveUp, NotApplicable

Family = Literal["contract", "estimates", "adversarial"]


class Check(NamedTuple):
    """A check of a backend."""

    family: Family
    name: str
    title: str  # the requirement, or what is hard about its log
    run: Callable[[Candidate], str]


class Outcome(NamedTuple):
    """The outcome of a check."""

    name: str
    title: str
    status: Literal["passed", "gave up", "failed", "not applicable"]
    found: str  # a sentence: what was found and, where it failed, what was expected


def _of(family: Family, function: Callable[[Candidate], str]) -> Check:
    title = " ".join((function.__doc__ or "").split())
    return Check(family, check_name(function), title, function)


def check_name(function: Callable[[Candidate], str]) -> str:
    """The name of the check that a function makes."""
    return function.__name__.replace("_", "-")  # ty: ignore[missing-attribute]


QUICK: tuple[Check, ...] = (
    *(_of("contract", f) for part in (contract, side_effects, data_association) for f in part.CHECKS),
    *(_of("estimates", f) for part in (estimates, parts) for f in part.CHECKS),
)
"""those on small logs, about two seconds in all"""
ADVERSARIAL: tuple[Check, ...] = (
    *(
        Check("adversarial", log.name, log.title, partial(ends_near_the_batch_answer, adversary=log))
        for log in ADVERSARIES
    ),
    _of("adversarial", stands_logs_without_ids),
)
CHECKS = QUICK + ADVERSARIAL


def chosen(only: Collection[str]) -> tuple[Check, ...]:
    """Selects the checks of these names or families, all where none is named; InputError for another name."""
    families = dict.fromkeys(check.family for check in CHECKS)
    for word in only:
        if word not in families and word not in {check.name for check in CHECKS}:
            raise InputError(
                f"--only: there is no check {word!r}; expected {', '.join(families)}, or names of checks as "
                "`bench check` prints them."
            )
    return tuple(check for check in CHECKS if not only or check.family in only or check.name in only)


def check(backend: Builder | str, options: Any = None, checks: Iterable[Check] = QUICK) -> list[Outcome]:
    """Runs `checks` on a backend in this process, one outcome each; a plug-in's own tests can call it.

    `backend` is a builder, made with `options` or its defaults, or a name as on the command line. `checks=CHECKS` has
    the adversarial logs, too: tens of seconds. A backend that does not return is not stopped.
    """
    if isinstance(backend, str):
        variant = backend_variants(backend, "slamduel.check")[0]
        if variant.builder is None or variant.builder.lacks():
            raise InputError(variant.builder.lacks() if variant.builder else variant.missing)
        backend, options = variant.builder, variant.options if options is None else options
    candidate = Candidate(backend, backend.options() if options is None else options)
    return [examine(check, candidate) for check in checks]


def examine(check: Check, candidate: Candidate) -> Outcome:
    """Runs one check; whatever the backend raises is in the outcome."""
    name, title = check.name, check.title
    try:
        return Outcome(name, title, "passed", check.run(candidate))
    except (NotApplicable, Unsuited) as reason:
        return Outcome(name, title, "not applicable", str(reason))
    except GaveUp as reason:
        return Outcome(name, title, "gave up", str(reason))
    except Failed as reason:
        return Outcome(name, title, "failed", str(reason))
    except (Exception, SystemExit) as error:
        return Outcome(name, title, "failed", f"it raised {type(error).__name__}: {error} ({_where(error)})")


def _where(error: BaseException) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    frame = [f for f in frames if "numpy" not in Path(f.filename).parts][-1]
    return f"{frame.filename}:{frame.lineno}"
