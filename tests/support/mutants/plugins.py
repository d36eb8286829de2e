"""Mutated plug-ins: a sound filter with one fault, each a row with a status or a remark, or the same result."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from slamduel.backends import registry
from slamduel.bench.measure.cell import Job, Result, run_on
from slamduel.bench.record.schema import COLUMNS, MORE, Row
from slamduel.bench.verdict.consistency import belief_word
from slamduel.bench.verdict.summary import lines
from slamduel.bench.words.reason import reason
from slamduel.core.errors import InputError
from slamduel.core.factors import Dataset

from .ending import Ended, compared, in_any_order
from .faulty import FAULTS, ODD_BUILDERS
from .random_drive import random_drive

REUSED = 20  # mutations on one log
TOLD = ("overconfident", "cautious")
PLACE = "mutants.faulty"


def tried(cases: int, seed: int = 0) -> Iterator[Ended]:
    """Mutates that many plug-ins, every fault in turn; each tenth is an odd builder instead."""
    faults, odd = in_any_order(FAULTS, seed), in_any_order(ODD_BUILDERS, seed)
    made, right = random_drive(np.random.default_rng(seed), 1.0), dict[str, Any]()
    for case in range(cases):
        if case % REUSED == 0:
            made = random_drive(np.random.default_rng([seed, case]), 30.0)
            right = ran("build", "", made).row
        if case % 10 == 9:
            name, fault = odd[(case // 10) % len(odd)], ""
            kind, place = f"plug-in builder: {name}", f"odd_{name.replace(' ', '_')}"
        else:
            fault = faults[(case - case // 10) % len(faults)]
            kind, place = f"plug-in {fault}", "build"
        try:
            yield judged(kind, ran(place, fault, made), right)
        except Exception as error:
            yield Ended(kind, "crashed", f"{type(error).__name__}: {error}")


def ran(place: str, fault: str, made: Dataset) -> Result:
    """Runs the plug-in as a worker does."""
    name = f"{PLACE}:{place}"
    try:
        builder = registry.find(name)
        options = builder.options(**({"fault": fault} if fault else {}))
        registry.implementation(name, options)
    except InputError as error:
        return Result("error", str(error))
    return run_on(Job(name, name, options, 0, 8000), lambda: made.log, lambda: made.truth)


def judged(kind: str, found: Result, right: dict[str, Any]) -> Ended:
    """Says how the cell ended: a status, a remark, a verdict, or the same result."""
    said = reason(found.reason)
    said.encode()
    if found.status != "done":
        whole = bool(said) and said.isprintable()
        return Ended(kind, "refused" if whole else "crashed", f"{found.status}: {said}")
    if said:
        return Ended(kind, "remarked", said)
    key = {"dataset": "drive", "dataset_options": "", "backend": "faulty", "options": "", "seed": 0}
    columns = dict.fromkeys((*COLUMNS, *MORE)) | key | found.row | {"status": "done", "reason": ""}
    (line,) = lines([Row(columns, "")])
    word = belief_word(line)
    if word in TOLD:
        return Ended(kind, "remarked", word)
    if found.row.get("nees") is None and found.row.get("ate_m") is not None:  # no covariance was given
        return Ended(kind, *compared(kind, found.row | {"nees": right["nees"]}, right))
    return Ended(kind, *compared(kind, found.row, right))
