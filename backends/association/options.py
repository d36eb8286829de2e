"""Options of data association, added to those of every backend that can have it."""

from dataclasses import dataclass, fields, make_dataclass
from functools import cache
from typing import Any, ClassVar

from ...core.errors import InputError
from ...core.options import option

RULES = ("nn", "ml", "jcbb")
"""Nearest neighbour, maximum likelihood, joint compatibility: in the order of their numbers in `backends/_rules.py`."""

OWN_RULES = {"particle": "every particle decides by itself, with `new` as its only gate"}
"""Rules that a backend carries out by itself, and what to say of them."""

USED_BY_OWN = ("association", "new")  # options that such a rule has


UNITING = "ekf, kf or smoother"
"""The backends that can unite landmarks, which `merge` needs."""


@dataclass(frozen=True)
class Association:
    """Which landmark is a sighting without an id of? Probabilities are those of chi-square quantiles."""

    association: str = option(
        "none",
        "data association of sightings without an id: nearest neighbour, maximum likelihood or joint compatibility",
        choices=("none", *RULES),
    )
    match: float = option(
        0.999, "probability that a sighting is within the gate of its landmark", minimum=0.1, maximum=0.999999999
    )
    joint: float = option(
        0.9999,
        "jcbb: probability that all pairs of a step are within their joint gate",
        minimum=0.1,
        maximum=0.999999999,
    )
    new: float = option(
        0.9999,
        "a sighting beyond this probability of every free landmark is of a new one; in between it is dropped",
        minimum=0.1,
        maximum=0.999999999999,
    )
    rescue: bool = option(
        True, "look for a frame that would be mostly new on the map so far, before it doubles landmarks"
    )
    lookahead: int = option(
        0, "later sightings that are weighed together with a step's, which waits for them", minimum=0, maximum=1000
    )
    confirm: int = option(
        0, "later steps that must agree with a new landmark for it to enter the map; 0: every one does", minimum=0
    )
    within: int = option(
        5, "steps with sightings among which those must be; the step waits for them", minimum=1, maximum=50
    )
    retire: int = option(
        0, "steps with sightings after which a landmark sighted only once leaves the map; 0: never", minimum=0
    )
    merge: bool = option(
        False,
        "a sighting that may be of a landmark by chance is of a new one; groups of these are merged with old ones",
    )
    nodes: int = option(20_000, "jcbb: most nodes of a step's search", minimum=1)

    made_of: ClassVar[tuple[type, tuple[str, ...]]]
    """The arguments of `options_with` that have made the class."""

    def __reduce__(self) -> tuple[Any, ...]:
        """The class is made at run time: it is stored by what it is made of, and the values."""
        return _restored, (*self.made_of, {one.name: getattr(self, one.name) for one in fields(self)})


@dataclass(frozen=True)
class Moved:
    """The treatment of landmarks that move."""

    moved: str = option(
        "kept",
        "landmarks that are found to move, and sightings with a wrong id: kept, or taken out",
        choices=("kept", "out"),
    )


def _restored(base: type, own: tuple[str, ...], values: dict[str, Any]) -> Any:
    return options_with(base, own)(**values)


@cache
def options_with(base: type[Any], own: tuple[str, ...] = ()) -> type:
    """The options dataclass `base` with those of data association and of landmarks that move.

    `own` are rules that the backend has by itself.

    Raises TypeError where it has one of the same name with another meaning.
    """
    twice = {one.name for one in fields(base)} & {one.name for kind in (Association, Moved) for one in fields(kind)}
    if twice:
        raise TypeError(f"options {', '.join(sorted(twice))} of {base.__qualname__} are those of data association, too")
    plain: Any = next(one for one in fields(Association) if one.name == "association").metadata
    also = "".join(f", or {rule}: {OWN_RULES[rule]}" for rule in own)
    extended = option("none", f"{plain['summary']}{also}", choices=(*plain["choices"], *own))
    more = [("association", str, extended)] if own else []
    made_of = {"made_of": (base, own)}
    return make_dataclass("Options", more, bases=(Association, Moved, base), namespace=made_of, frozen=True)


def _check_together(options: Any, where: str) -> None:
    """Refuses values that contradict one another: InputError."""
    if options.confirm > options.within:
        raise InputError(
            f"{where}: option confirm={options.confirm}: expected at most within={options.within}, the steps that may "
            "agree with a new landmark."
        )
    if options.match > options.new:
        raise InputError(
            f"{where}: option match={options.match:g}: expected at most new={options.new:g}, beyond which a sighting "
            "is of a new landmark."
        )


def check(options: Any, where: str) -> None:
    """Refuses options without effect: InputError names the first."""
    rule = getattr(options, "association", None)
    if rule is None:
        return
    if rule in RULES:
        _check_together(options, where)
        return
    used = () if rule == "none" else USED_BY_OWN
    for one in fields(Association):
        if one.name not in used and getattr(options, one.name) != one.default:
            what = "for data association" if rule == "none" else f"not for association={rule}"
            of = f" of {UNITING}" if one.name == "merge" else ""
            raise InputError(f"{where}: option {one.name} is {what}; expected association=nn, ml or jcbb{of}.")
