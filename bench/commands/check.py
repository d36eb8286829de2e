"""`bench check BACKEND`: runs the conformance suite on a backend, built in or plugged in."""

import argparse
from itertools import groupby

from rich.console import Console

from ...core.errors import InputError
from ..check.contract import BLIND, sightings_make_a_difference
from ..check.isolated import examined
from ..check.suite import Outcome, check_name, chosen
from ..plan.spec import backend_variants
from ..plan.variant import BackendVariant
from ..words.console import plain
from ..words.reason import reason

STYLE = {"passed": "green", "gave up": "yellow", "failed": "bold red", "not applicable": "dim"}
TIMEOUT_S = 120.0  # s; ten times the slowest check of the built-in backends, compiling a backend's inner loops included
SIGHTED = check_name(sightings_make_a_difference)
LONGEST_S = 86_400  # s; a day for one check


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    add = parser.add_argument
    add("backend", help="names as in bench run --backend, options in brackets, separated by commas")
    add(
        "--only",
        default="",
        metavar="CHECKS",
        help="contract, estimates, adversarial, or names of checks, separated by commas; default: all",
    )
    add("--timeout", type=float, default=TIMEOUT_S, metavar="S", help="seconds per check; default %(default)g")
    add("--quiet", action="store_true", help="print what failed, and nothing else")


def main(namespace: argparse.Namespace) -> int:
    """Prints every check's outcome as it ends; 1 where one failed, or where a backend cannot be imported."""
    console = Console(highlight=False, emoji=False, soft_wrap=True)
    checks = chosen([word.strip() for word in namespace.only.split(",") if word.strip()])
    if not 0 < namespace.timeout <= LONGEST_S:
        raise InputError(f"--timeout is {namespace.timeout:g}, expected more than 0 s and at most {LONGEST_S:,} s.")
    failures = 0
    for variant in backend_variants(namespace.backend, "bench check"):
        if variant.builder is None or variant.builder.lacks():
            _say(console, "failed", variant.builder.lacks() if variant.builder else variant.missing)
            failures += 1
            continue
        for family, group in groupby(checks, key=lambda check: check.family):
            outcomes: list[Outcome] = []
            for outcome in examined(variant.name, variant.options, list(group), namespace.timeout):
                outcomes.append(outcome)
                if outcome.status == "failed" or not namespace.quiet:
                    _say(console, outcome.status, f"{outcome.name}: {outcome.found}")
            failures += sum(outcome.status == "failed" for outcome in outcomes)
            if not namespace.quiet:
                console.print(_summary(variant, family, outcomes))
    return 1 if failures else 0


def _say(console: Console, status: str, text: str) -> None:
    console.print(f"[{STYLE[status]}]{status:14}[/] {plain(reason(text))}")


def _summary(variant: BackendVariant, family: str, outcomes: list[Outcome]) -> str:
    count = {status: sum(outcome.status == status for outcome in outcomes) for status in STYLE}
    words = {"passed": "passed", "failed": "failed", "not applicable": "not applicable"}
    if family == "adversarial":
        words = {"passed": "done", "gave up": "with a named reason", "failed": "failed"}
        family = "adversarial logs"
    counts = ", ".join(f"{count[status]} {word}" for status, word in words.items())
    blind = any(outcome.name == SIGHTED and outcome.found == BLIND for outcome in outcomes)
    return f"{plain(variant.label)}: {family}: {counts}{f'; {BLIND}' * blind}"
