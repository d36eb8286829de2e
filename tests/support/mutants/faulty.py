"""A sound filter as a plug-in whose answers are mutated: `mutants.faulty:build[fault=NAME]`, and odd builders."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from broken_backends import Sound
from slamduel.backends.api import Belief, Builder, Map, Prior, Solution, Step, option
from slamduel.core.se2 import Array

AT = 20
"""The step from which on a fault shows."""

ODD = "\ud800 \x1b[31m \x00 \r\n <b>%s{}[/] \u202e \U0001f916"
"""Characters that files, terminals and pages take for something else."""


def _put(place: int, value: float) -> Callable[[Array], Any]:
    def put(pose: Array) -> Array:
        pose = pose.copy()
        pose[place] = value
        return pose

    return put


def _cov(change: Callable[[Array], Any]) -> Callable[[Any], Any]:
    return lambda belief: belief._replace(cov=change(belief.cov))


def _raised(error: BaseException) -> Callable[[Any], Any]:
    def fail(answer: Any) -> Any:
        raise error

    return fail


INDEFINITE = np.array([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
ASYMMETRIC = np.array([[1.0, 0.9, 0.0], [-0.9, 1.0, 0.0], [0.0, 0.0, 1.0]])

POSES: dict[str, Callable[[Any], Any]] = {
    "nan": _put(0, np.nan),
    "inf": _put(1, np.inf),
    "heading inf": _put(2, -np.inf),
    "heading unwrapped": lambda pose: pose + np.array((0, 0, 2 * np.pi)),
    "huge": _put(0, 1e200),
    "beyond the Earth": _put(0, 1e10),
    "subnormal": _put(0, 5e-324),
    "none": lambda pose: None,
    "text": lambda pose: "here",
    "texts": lambda pose: ["1", "2", "three"],
    "number": lambda pose: 3.0,
    "complex": lambda pose: pose + 1j,
    "float32": lambda pose: pose.astype(np.float32),
    "list": lambda pose: pose.tolist(),
    "column": lambda pose: pose[:, None],
    "short": lambda pose: pose[:2],
    "long": lambda pose: np.append(pose, 0.0),
    "masked": lambda pose: np.ma.masked_array(pose, [True, False, False]),
    "object": lambda pose: np.array([None, {}, ODD], object),
    "namespace": lambda pose: SimpleNamespace(x=1, y=2),
    "zeros": lambda pose: np.zeros(3),
}
BELIEFS: dict[str, Callable[[Any], Any]] = {
    "none": lambda belief: None,
    "tuple": lambda belief: (belief.pose, belief.cov),
    "elsewhere": lambda belief: belief._replace(pose=belief.pose + np.array((0.5, 0, 0))),
    "pose nan": lambda belief: belief._replace(pose=belief.pose * np.nan),
    "no cov": _cov(lambda cov: None),
    "cov 1e-12": _cov(lambda cov: 1e-12 * cov),
    "cov 1e-4": _cov(lambda cov: 1e-4 * cov),
    "cov 1e-320": _cov(lambda cov: 1e-320 * np.eye(3)),
    "cov 1e6": _cov(lambda cov: 1e6 * cov),
    "cov 0": _cov(lambda cov: 0 * cov),
    "cov negative": _cov(lambda cov: -cov),
    "cov indefinite": _cov(lambda cov: INDEFINITE),
    "cov asymmetric": _cov(lambda cov: cov @ ASYMMETRIC),
    "cov singular": _cov(lambda cov: np.outer(cov[0], cov[0])),
    "cov nan": _cov(lambda cov: cov * np.nan),
    "cov inf": _cov(lambda cov: cov * np.inf),
    "cov complex": _cov(lambda cov: cov + 1j),
    "cov text": _cov(lambda cov: "small"),
    "cov diagonal": _cov(np.diag),
    "cov large": _cov(lambda cov: np.eye(6)),
    "sd for variance": _cov(lambda cov: np.diag(np.sqrt(np.diag(cov)))),
    "degrees": _cov(lambda cov: cov * np.outer([1, 1, 57.3], [1, 1, 57.3])),
    "nis text": lambda belief: belief._replace(nis="much"),
    "nis nan": lambda belief: belief._replace(nis=np.nan),
    "nis_dof -1": lambda belief: belief._replace(nis=1.0, nis_dof=-1),
    "nis_dof 0.5": lambda belief: belief._replace(nis=1.0, nis_dof=0.5),
    "nis_dof none": lambda belief: belief._replace(nis=1.0, nis_dof=None),
}
MAPS: dict[str, Callable[[Any], Any]] = {
    "none": lambda known: None,
    "dict": lambda known: dict(zip(known.ids.tolist(), known.xy.tolist(), strict=True)),
    "ids twice": lambda known: known._replace(ids=np.zeros_like(known.ids)),
    "ids float": lambda known: known._replace(ids=known.ids + 0.5),
    "ids text": lambda known: known._replace(ids=[str(one) for one in known.ids]),
    "ids huge": lambda known: known._replace(ids=known.ids.astype(object) + 2**70),
    "xy nan": lambda known: known._replace(xy=known.xy * np.nan),
    "xy short": lambda known: known._replace(xy=known.xy[1:]),
    "xy flat": lambda known: known._replace(xy=known.xy.ravel()),
    "xy far": lambda known: known._replace(xy=known.xy + 1e100),
    "xy in the robot's frame": lambda known: known._replace(xy=known.xy - known.xy[0]),
    "cov 0": lambda known: known._replace(cov=np.zeros((2 * len(known.ids),) * 2)),
    "cov 1e-12": lambda known: known._replace(cov=None if known.cov is None else 1e-12 * known.cov),
    "cov negative": lambda known: known._replace(cov=-np.eye(2 * len(known.ids))),
    "cov blocks": lambda known: known._replace(cov=np.tile(np.eye(2), (len(known.ids), 1, 1))),
    "cov nan": lambda known: known._replace(cov=np.full((2 * len(known.ids),) * 2, np.nan)),
}
ERRORS: dict[str, Callable[[Any], Any]] = {
    "odd characters": _raised(RuntimeError(ODD)),
    "no words": _raised(ValueError()),
    "long": _raised(RuntimeError("and more " * 200_000)),
    "bytes": _raised(OSError(2, b"\xff\xfe".decode("latin-1"), ODD)),
    "SystemExit": _raised(SystemExit(0)),
    "SystemExit text": _raised(SystemExit(ODD)),
    "GeneratorExit": _raised(GeneratorExit()),
    "group": _raised(ExceptionGroup(ODD, [ValueError(ODD), KeyError()])),
    "MemoryError": _raised(MemoryError()),
    "RecursionError": _raised(RecursionError()),
    "StopIteration": _raised(StopIteration()),
    "AssertionError": _raised(AssertionError()),
    "UnicodeError": lambda answer: ODD.encode(),
    "exit": lambda answer: sys.exit(3),
}
SOLUTIONS: dict[str, Callable[[Any], Any]] = {
    "text": lambda none: "done",
    "no path": lambda none: Solution(None, Map(np.zeros(0, int), np.zeros((0, 2)), None), None),  # type: ignore[arg-type]
    "short": lambda none: Solution(np.zeros((2, 3)), Map(np.zeros(0, int), np.zeros((0, 2)), None), None),
    "nan": lambda none: Solution(np.full((1, 3), np.nan), Map(np.zeros(0, int), np.zeros((0, 2)), None), None),
    "raises": _raised(RuntimeError(ODD)),
}
FAULTS = {
    f"{of}: {name}": (of, change)
    for of, changes in (
        ("step", POSES), ("belief", BELIEFS), ("map", MAPS), ("finish", SOLUTIONS),
        *((f"error in {where}", ERRORS) for where in ("step", "belief", "map")),
    )
    for name, change in changes.items()
}  # fmt: skip
"""Fault -> the method whose answer it changes, prefixed with "error in " or not, and how."""


@dataclass(frozen=True)
class Options:
    """The fault."""

    fault: str = option("", "one of FAULTS, or none")


class Faulty(Sound):
    """The textbook's filter with one fault from step AT on."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        super().__init__(prior, options, rng)
        where, self.change = FAULTS.get(options.fault, ("", lambda answer: answer))
        self.where = where.removeprefix("error in ")

    def _answer(self, of: str, answer: Any) -> Any:
        return self.change(answer) if of == self.where and (self.k >= AT or of == "finish") else answer

    def step(self, step: Step) -> Any:
        return self._answer("step", super().step(step))

    def belief(self) -> Any:
        return self._answer("belief", super().belief())

    def map(self) -> Any:
        return self._answer("map", super().map())

    def finish(self) -> Any:
        return self._answer("finish", None)


@dataclass
class Needed:
    """Options without a default."""

    needed: int


class Raising:
    """Options that cannot be made."""

    def __init__(self) -> None:
        raise RuntimeError(ODD)


build = Builder(Faulty, Options)
ODD_BUILDERS: dict[str, Any] = {
    "text": "a builder",
    "class": Faulty,
    "no options": Builder(Faulty, None),  # type: ignore[arg-type]
    "options of int": Builder(Faulty, int),
    "options of dict": Builder(Faulty, dict),
    "options needed": Builder(Faulty, Needed),
    "options raise": Builder(Faulty, Raising),
    "makes nothing": Builder(lambda prior, options, rng: None),  # type: ignore[arg-type, return-value]
    "cannot be called": Builder(3),  # type: ignore[arg-type]
    "takes nothing": Builder(lambda: None),  # type: ignore[arg-type]
    "raises": Builder(lambda prior, options, rng: sys.exit(ODD)),  # type: ignore[arg-type]
    "no methods": Builder(lambda prior, options, rng: SimpleNamespace()),  # type: ignore[arg-type, return-value]
    "implementation raises": Builder(Faulty, Options, implementation=lambda options: sys.exit(ODD)),
}
globals().update({f"odd_{name.replace(' ', '_')}": odd for name, odd in ODD_BUILDERS.items()})

__all__ = ["FAULTS", "ODD_BUILDERS", "Belief", "Options", "build"]
