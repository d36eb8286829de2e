"""Backend names and the builders behind them; nothing is imported before it is asked for.

A name is that of a built-in, of an entry point in the group `slamduel.backends`, or a `module:attribute` outright.
"""

import contextlib
from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points, packages_distributions
from typing import Any

from ..frontend.errors import InputError
from .api import Builder

BUILTIN = {
    "dead-reckoning": "slamduel.backends.gaussian.dead_reckoning:build",
    "ekf": "slamduel.backends.gaussian.ekf:build",
    "fastslam": "slamduel.backends.particles.fastslam:build",
    "fixed-lag": "slamduel.backends.graphs.fixed_lag:build",
    "graph": "slamduel.backends.graphs.graph:build",
    "invariant-ekf": "slamduel.backends.gaussian.invariant_ekf:build",
    "isam2": "slamduel.backends.graphs.isam2:build",
    "kf": "slamduel.backends.gaussian.kf:build",
    "smoother": "slamduel.backends.smoothing.smoother:build",
    "ukf": "slamduel.backends.gaussian.ukf:build",
}
GROUP = "slamduel.backends"

NOT_STATED = "not stated"
"""Of a backend that does not say whose program it is, and comes from no installed distribution."""


class Missing(InputError):
    """A backend that is named and known, but cannot be imported here: a row with a reason, not the end of a run."""


def plugins() -> Mapping[str, EntryPoint]:
    """The installed entry points of the group, by name; a built-in's name cannot be taken over."""
    return {found.name: found for found in entry_points(group=GROUP) if found.name not in BUILTIN}


def target(name: str) -> str:
    """Where the builder of that name is, as module:builder; KeyError where nothing has the name."""
    return BUILTIN.get(name) or (name if ":" in name else plugins()[name].value)


def find(name: str) -> Builder:
    """The builder of that name.

    Raises KeyError where nothing has the name, and Missing where what has it cannot be imported or is no Builder.
    """
    place = target(name)
    module, _, attribute = place.partition(":")
    try:
        found = getattr(import_module(module), attribute)
    except Exception as error:  # a plug-in's import may fail in any way at all, and that is the plug-in's matter
        raise Missing(f"backend {name}: {place} cannot be imported: {type(error).__name__}: {error}") from error
    if not isinstance(found, Builder):
        raise Missing(f"backend {name}: {place} is {type(found).__name__}, expected slamduel.backends.api.Builder")
    return found


def implementation(name: str, options: Any) -> str:
    """Whose program does the work of the backend of that name with these options, in a few words for tables.

    What its builder says; of a plug-in that does not say, "from NAME", the distribution it was installed by, else
    NOT_STATED. Raises as `find`.
    """
    builder = find(name)
    with contextlib.suppress(Exception):  # as with an import: what a plug-in's function raises is no end of a run
        if said := builder.implemented(options):
            return said
    known = plugins().get(name)
    if known is not None and known.dist is not None:
        return f"from {known.dist.name}"
    package = target(name).partition(":")[0].partition(".")[0]
    installed = packages_distributions().get(package, ())
    return f"from {installed[0]}" if installed else NOT_STATED
