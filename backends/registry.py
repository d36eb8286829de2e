"""Names of backends and their builders, imported on demand.

A backend is named as a built-in, as an entry point in the group `slamduel.backends`, or as `module:attribute`.
"""

import contextlib
from collections.abc import Mapping
from dataclasses import fields, replace
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points, packages_distributions, version
from typing import Any

from ..core.errors import InputError
from .api import Backend, Builder, Unsuited
from .import_trial import death

BUILTIN = {
    "bias-ekf": "slamduel.backends.biases.bias_ekf:build",
    "dead-reckoning": "slamduel.backends.gaussian.dead_reckoning:build",
    "ekf": "slamduel.backends.gaussian.ekf:build",
    "fastslam": "slamduel.backends.particles.fastslam:build",
    "fixed-lag": "slamduel.backends.graphs.fixed_lag:build",
    "g2o": "slamduel.backends.programs.g2o:build",
    "graph": "slamduel.backends.graphs.graph:build",
    "invariant-ekf": "slamduel.backends.invariant.invariant_ekf:build",
    "isam2": "slamduel.backends.graphs.isam2:build",
    "kf": "slamduel.backends.gaussian.kf:build",
    "mcl": "slamduel.backends.particles.mcl:build",
    "mrpt-ekf": "slamduel.backends.programs.mrpt_ekf:build",
    "smoother": "slamduel.backends.keeping.smoother:build",
    "symforce": "slamduel.backends.programs.symforce:build",
    "textbook-ekf": "slamduel.backends.programs.textbook_ekf:build",
    "textbook-fastslam": "slamduel.backends.programs.textbook_fastslam:build",
    "ukf": "slamduel.backends.unscented.ukf:build",
}
GROUP = "slamduel.backends"

distributions = cache(packages_distributions)
"""Names of the distributions that provide a top-level module, by its name; the files of all are read, once."""

NOT_STATED = "not stated"
"""Implementation of a backend without declared implementation and without distribution."""


class Missing(InputError):
    """A known backend that cannot be imported here: it becomes a row with a reason, and the run continues."""


def plugins() -> Mapping[str, EntryPoint]:
    """The installed entry points of the group, by name; built-in names take precedence."""
    return {found.name: found for found in entry_points(group=GROUP) if found.name not in BUILTIN}


def target(name: str) -> str:
    """Locates the builder of that name, as module:builder; KeyError for an unknown name."""
    return BUILTIN.get(name) or (name if ":" in name else plugins()[name].value)


def find(name: str) -> Builder:
    """Finds the builder of a name. KeyError: unknown; Missing: not importable, or no Builder with options."""
    place = target(name)
    module, _, attribute = place.partition(":")
    try:
        found = getattr(import_module(module), attribute)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a plug-in's import may raise anything at all, SystemExit included
        raise _missing(name, f"cannot be imported: {type(error).__name__}: {error}") from error
    if not isinstance(found, Builder):
        raise _missing(name, f"is {type(found).__name__}, expected slamduel.backends.api.Builder")
    try:
        found.options()
        fields(found.options)
    except Exception as error:
        raise _missing(name, f"has no options that can be left out: {type(error).__name__}: {error}") from error
    builders = import_module(f"{__package__}.association.builders")  # it imports numba
    try:
        return _complete(builders.associating(found), name)
    except TypeError as error:
        raise _missing(name, f"cannot have data association: {error}") from error


def _complete(builder: Builder, name: str) -> Builder:
    """The builder; one whose program is not installed makes no backend, but says so."""
    if not (lacking := builder.lacks()):
        return builder

    def make(*_: Any) -> Backend:
        raise Unsuited(f"backend {name}: {lacking}")

    make.__doc__ = builder.make.__doc__
    return replace(builder, make=make)


def find_first(name: str) -> Builder:
    """Finds the builder as `find`, for a process that has to outlive a plug-in's import: Missing if none would."""
    if name not in BUILTIN and (how := death(target(name).partition(":")[0])):
        raise _missing(name, f"cannot be imported: importing it ends the process with {how}")
    return find(name)


def _missing(name: str, why: str) -> Missing:
    place = target(name)
    return Missing(f"backend {name} {why}" if place == name else f"backend {name}: {place} {why}")


def implementation(name: str, options: Any) -> str:
    """The program behind a backend with these options, in a few words for tables.

    From its builder; for a plug-in that does not declare it, "from NAME", its distribution, else NOT_STATED. Raises as
    `find`.
    """
    builder = find(name)
    with contextlib.suppress(Exception, SystemExit):  # as with an import: a plug-in's error must not end a run
        said = builder.implemented(options)
        if isinstance(said, str) and said:  # pyright: ignore[reportUnnecessaryIsInstance] - it may return anything
            return said
    return f"from {found}" if (found := _distribution(name)) else NOT_STATED


def distribution(name: str) -> str:
    """The distribution of a plug-in and its version, "slamduel-mine 1.0"; "" for a built-in, and without one."""
    if name in BUILTIN or not (found := _distribution(name)):
        return ""
    return f"{found} {version(found)}"


def _distribution(name: str) -> str:
    """The name of the distribution that a backend is from; "" if it is in none."""
    known = plugins().get(name)
    if known is not None and known.dist is not None:
        return known.dist.name
    package = target(name).partition(":")[0].partition(".")[0]
    installed = distributions().get(package, ())
    return installed[0] if installed else ""
