"""`bench check BACKEND`: the conformance suite on a backend, built in or brought along."""

import argparse

from rich.console import Console

from ..frontend.errors import InputError
from .conformance import check_backend
from .spec import backend_variants
from .terminal import plain

STYLE = {"passed": "green", "failed": "bold red", "not applicable": "dim"}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("backend", help="names as in bench run --backend, options in brackets, separated by commas")
    parser.add_argument("--quiet", action="store_true", help="print what failed, and nothing else")


def main(namespace: argparse.Namespace) -> int:
    """Print every check's outcome; 1 where one failed."""
    console = Console(highlight=False, soft_wrap=True)
    failures = 0
    for variant in backend_variants(namespace.backend):
        if variant.builder is None:
            raise InputError(variant.missing)
        outcomes = check_backend(variant.builder, variant.options)
        statuses = [outcome.status for outcome in outcomes]
        failures += statuses.count("failed")
        for outcome in outcomes:
            if outcome.status == "failed" or not namespace.quiet:
                console.print(f"[{STYLE[outcome.status]}]{outcome.status:14}[/] {outcome.name}: {plain(outcome.found)}")
        counts = ", ".join(f"{statuses.count(status)} {status}" for status in STYLE)
        console.print(f"{plain(variant.label)}: {counts}")
    return 1 if failures else 0
