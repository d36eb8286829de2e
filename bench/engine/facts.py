"""States what a record keeps of the whole run or study: options, folders, programs, limits, machine."""

import time
from typing import Any

from ...backends import registry as backends
from ..plan.variant import Variant
from ..plan.work import Work
from ..record.machine import environment
from ..words.reason import reason
from ..workers.executor import Executor

TIMING_POLICY = (
    "Process CPU time of each step(), the clock's own cost subtracted, garbage collection off, one thread, after a "
    "warm-up on a backend of its own. Beliefs, map and finish are timed apart, in a second pass whose path is the same "
    "to the last bit. timing_alone = 0 marks cells that ran side by side with others. Repeats time a cell "
    "in several rounds, each in processes of its own, and its times are their medians. GTSAM is the published generic "
    "wheel; so are numpy and its BLAS."
)


def facts(work: Work, executor: Executor) -> dict[str, Any]:
    """Returns them by name, as JSON takes them."""
    backend_variants = {cell.cell.backend.label: cell.cell.backend for cell in work.cells}
    variants: dict[str, Variant] = {cell.cell.dataset.label: cell.cell.dataset for cell in work.cells}
    variants |= backend_variants
    able = {label: variant for label, variant in backend_variants.items() if variant.builder is not None}
    return {
        "options": {label: vars(variant.options) for label, variant in variants.items()},
        "folders": {label: variant.slug for label, variant in variants.items()},
        "implementations": {label: reason(backends.implementation(v.name, v.options)) for label, v in able.items()},
        "distributions": {label: reason(dist) for label, v in able.items() if (dist := backends.distribution(v.name))},
        "random": [label for label, v in able.items() if v.builder is not None and v.builder.random],
        "cells": len(work.cells),
        "keep": work.keep,
        "oracle": work.oracle,
        "timeout_s": work.timeout_s,
        "memory_mb": work.memory_mb,
        "environment": environment(),
        "executor": executor.name,
        "workers": executor.slots,
        "timing_policy": TIMING_POLICY,
        "started": time.time(),
    }
