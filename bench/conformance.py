"""The suite behind `bench check BACKEND`: the same small checks on every backend, built in or brought along.

A check is a function of a `Candidate` whose docstring is its title. It returns a sentence on what it found, or raises
Failed or NotApplicable with one; any other exception is the backend's, and fails that check alone.
"""

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NamedTuple

from ..backends.api import Builder
from . import contract_checks, estimate_checks
from .candidate import Candidate, Failed, NotApplicable

Check = Callable[[Candidate], str]
CHECKS: tuple[Check, ...] = contract_checks.CHECKS + estimate_checks.CHECKS


class Outcome(NamedTuple):
    """What came of one check."""

    name: str  # the check's function, with dashes
    title: str  # what it asks for
    status: Literal["passed", "failed", "not applicable"]
    found: str  # a sentence: what was found and, where it failed, what was expected


def check_backend(builder: Builder, options: Any = None) -> list[Outcome]:
    """Every check on the backend that `builder` makes with `options`, its defaults where None; about two seconds."""
    candidate = Candidate(builder, builder.options() if options is None else options)
    return [examine(check, candidate) for check in CHECKS]


def examine(check: Check, candidate: Candidate) -> Outcome:
    """The outcome of one check; whatever the backend raises is in it."""
    name = check.__name__.replace("_", "-")
    title = " ".join((check.__doc__ or "").split())
    try:
        return Outcome(name, title, "passed", check(candidate))
    except NotApplicable as reason:
        return Outcome(name, title, "not applicable", str(reason))
    except Failed as reason:
        return Outcome(name, title, "failed", str(reason))
    except Exception as error:
        return Outcome(name, title, "failed", f"it raised {type(error).__name__}: {error} ({_where(error)})")


def _where(error: Exception) -> str:
    """File and line of the innermost frame that is not numpy's own."""
    frames = traceback.extract_tb(error.__traceback__)
    frame = [f for f in frames if "numpy" not in Path(f.filename).parts][-1]
    return f"{frame.filename}:{frame.lineno}"
