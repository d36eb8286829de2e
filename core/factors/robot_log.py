"""A robot's log as columns, built from arrays or from steps."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..arrays import even, frozen, frozen_ids, numbers, seconds, sorted_ids, whole
from ..beside import Clouds, Scans, head_of
from ..errors import InputError
from ..fixes import NO_FIXES, FixTable
from ..gyro import Gyro
from ..lines import Lines
from ..mounting import Mounting, mounted
from ..partial import NO_PARTIAL, PartialTable
from ..se2 import Array, Ints, summed
from ..signatures import NO_SIGNATURES, Signatures, signatures_of
from .digest import digest_of
from .ground_truth import Truth
from .landmarks import UNKNOWN
from .priors import Prior, Systematic, frozen_prior
from .steps import Odometry, RangeBearing, RelativePoses, Step, turns_of

REMARKS = "remarks"
"""The key of what a log's reader found odd, among the log's notes: a list of sentences without their full stops."""

CONSTANTS_NOTE = "constant errors"
"""The key of the true constant errors that a simulated world has drawn, by name, among the log's notes."""

TABLES: dict[str, type[PartialTable | FixTable | Signatures | Gyro]] = {
    "partial": PartialTable,
    "fixes": FixTable,
    "signatures": Signatures,
    "gyro": Gyro,
}
"""Columns that most logs have not, by their field of `Log`."""

_COLUMNS = (
    "t",
    "delta",
    "delta_cov",
    "sighting_first",
    "ids",
    "z",
    "z_cov",
    "loop_first",
    "loop_to",
    "loop_delta",
    "loop_cov",
)
"""The columns of a log's digest that every log has, in order."""


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """A robot's log as columns; iterating or indexing it gives `Step` views. Build one with `from_arrays`.

    Row 0 of `delta` and `delta_cov` is NaN: nothing precedes step 0. The sightings of step k are rows
    `sighting_first[k]:sighting_first[k + 1]`, its loop closures rows `loop_first[k]:loop_first[k + 1]`.
    """

    name: str
    prior: Prior
    t: Array  # (n,) strictly increasing
    delta: Array  # (n, 3)
    delta_cov: Array  # (n, 3, 3)
    sighting_first: Ints  # (n + 1,)
    ids: Ints  # (s,)
    z: Array  # (s, 2)
    z_cov: Array  # (s, 2, 2)
    loop_first: Ints  # (n + 1,)
    loop_to: Ints  # (l,)
    loop_delta: Array  # (l, 3)
    loop_cov: Array  # (l, 3, 3)
    notes: Mapping[str, Any] = field(default_factory=dict[str, Any])  # sensor settings, source, licence, counts
    scans: Scans | None = None  # of a laser scanner, for maps and pictures alone: no part of the digest
    clouds: Clouds | None = None  # of a depth camera, likewise
    partial: PartialTable | None = None  # None where there are none
    fixes: FixTable | None = None  # likewise
    signatures: Signatures | None = None  # of every whole sighting, or of none
    gyro: Gyro | None = None  # None where there is none
    lines: Mapping[str, Lines] = field(default_factory=dict[str, Lines])
    """Of files that its rows are from: "odometry" of all steps, "sightings", "loops"; for remarks, no part of the
    digest and not stored."""

    def __post_init__(self) -> None:
        for name in TABLES:
            table = getattr(self, name)
            object.__setattr__(self, name, table if table is not None and len(table) else None)
        prior = self.prior._replace(
            loops=len(self.loop_to) > 0,
            partial=self.partial is not None,
            fixes=self.fixes is not None,
            signatures=self.signatures is not None,
            gyro=None if self.gyro is None else self.gyro.prior,
        )
        object.__setattr__(self, "prior", prior)

    @classmethod
    def from_arrays(
        cls,
        name: str,
        prior: Prior,
        t: Array,
        delta: Array,
        delta_cov: Array,
        sighting_step: Ints,
        ids: Ints,
        z: Array,
        z_cov: Array,
        *,
        loop_step: Ints | None = None,
        loop_to: Ints | None = None,
        loop_delta: Array | None = None,
        loop_cov: Array | None = None,
        partial: PartialTable | None = None,
        fixes: FixTable | None = None,
        signature: Array | None = None,
        signature_var: Array | None = None,
        gyro: Gyro | None = None,
        sensor: Mounting | None = None,
        notes: Mapping[str, Any] | None = None,
    ) -> "Log":
        """Builds a log of n steps from its tables; the arrays are copied and made read-only.

        `delta` (n, 3) and `delta_cov` (n, 3, 3) have one row per step, row 0 ignored. `sighting_step` (s,) and
        `loop_step` (l,), both sorted, give the step of each row of the other columns. `signature` (s,) and its variance
        `signature_var` (s,) are a third number that each sighting measures: see `core.signatures`. Sightings are of the
        body: those of a sensor that sits elsewhere, or is late, are converted if `sensor` says where it sits.
        InputError for values that are not numbers or not sorted; `check` judges the values themselves.
        """
        if not isinstance(prior, Prior):  # pyright: ignore[reportUnnecessaryIsInstance] - no notebook checks types
            raise InputError(f"prior: found {type(prior).__name__}, expected Prior(pose, cov).")
        time = seconds("t", t)
        steps, none = np.arange(len(time) + 1), np.zeros(0, np.int64)
        log = cls(
            name=name,
            prior=frozen_prior(prior),
            t=frozen(time),
            delta=frozen(_without_first(numbers("delta", delta))),
            delta_cov=frozen(_without_first(even(numbers("delta_cov", delta_cov)))),
            sighting_first=frozen_ids(np.searchsorted(sorted_ids("sighting_step", sighting_step), steps)),
            ids=frozen_ids(whole("ids", ids)),
            z=frozen(numbers("z", z)),
            z_cov=frozen(even(numbers("z_cov", z_cov))),
            loop_first=frozen_ids(
                np.searchsorted(sorted_ids("loop_step", none if loop_step is None else loop_step), steps)
            ),
            loop_to=frozen_ids(whole("loop_to", none if loop_to is None else loop_to)),
            loop_delta=frozen(np.zeros((0, 3)) if loop_delta is None else numbers("loop_delta", loop_delta)),
            loop_cov=frozen(np.zeros((0, 3, 3)) if loop_cov is None else even(numbers("loop_cov", loop_cov))),
            notes=dict(notes or {}),
            partial=partial,
            fixes=fixes,
            signatures=signatures_of(signature, signature_var, len(ids)),
            gyro=gyro,
        )
        return log if sensor is None else log.of_sensor(sensor)

    @classmethod
    def from_steps(
        cls, name: str, prior: Prior, steps: Sequence[Step], notes: Mapping[str, Any] | None = None
    ) -> "Log":
        """Builds a log from steps in order; the odometry of the first is ignored."""
        nan = Odometry(np.full(3, np.nan), np.full((3, 3), np.nan))
        odometry = [nan if s.odometry is None else s.odometry for s in steps]
        index = np.arange(len(steps))
        signed = any(len(s.signatures) for s in steps)
        return cls.from_arrays(
            name,
            prior,
            t=np.array([s.t for s in steps], float),
            delta=np.array([o.delta for o in odometry], float).reshape(-1, 3),
            delta_cov=np.array([o.cov for o in odometry], float).reshape(-1, 3, 3),
            sighting_step=np.repeat(index, [len(s.sightings.ids) for s in steps]),
            ids=np.concatenate([s.sightings.ids for s in steps]),
            z=np.concatenate([s.sightings.z for s in steps]),
            z_cov=np.concatenate([s.sightings.cov for s in steps]),
            loop_step=np.repeat(index, [len(s.loops.to) for s in steps]),
            loop_to=np.concatenate([s.loops.to for s in steps]),
            loop_delta=np.concatenate([s.loops.delta for s in steps]),
            loop_cov=np.concatenate([s.loops.cov for s in steps]),
            partial=PartialTable.from_arrays(
                len(steps),
                np.repeat(index, [len(s.partial.ids) for s in steps]),
                *(np.concatenate(column) for column in zip(*(s.partial for s in steps), strict=True)),
            ),
            fixes=FixTable.from_arrays(
                len(steps),
                np.repeat(index, [len(s.fixes.z) for s in steps]),
                *(np.concatenate(column) for column in zip(*(s.fixes for s in steps), strict=True)),
            ),
            signature=np.concatenate([s.signatures.s for s in steps]) if signed else None,
            signature_var=np.concatenate([s.signatures.var for s in steps]) if signed else None,
            gyro=turns_of(prior.gyro, steps),
            notes=notes,
        )

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        ids = self.seen
        known = ids[ids != UNKNOWN]
        said = [f"{len(self)} steps", f"{len(ids)} sightings of {len(np.unique(known))} landmarks"]
        said += [f"{len(ids) - len(known)} of them unknown"] * (len(known) < len(ids))
        said += [] if self.partial is None else [self.partial.words(self.sighted)]
        said += ["with signatures"] * (self.signatures is not None)
        said += [] if self.fixes is None else [f"{len(self.fixes)} fixes"]
        said += [] if self.gyro is None else [f"{len(self.gyro)} turns by a gyro"]
        said += [f"{len(self.loop_to)} loop closures"] * bool(len(self.loop_to))
        return f"<Log {self.name!r}: {', '.join(said)}>"

    def __iter__(self) -> Iterator[Step]:
        seen, loops = self.sighting_first.tolist(), self.loop_first.tolist()
        no_loops = RelativePoses(self.loop_to[:0], self.loop_delta[:0], self.loop_cov[:0])
        turns = {} if self.gyro is None else self.gyro.by_step()
        for k, t in enumerate(self.t.tolist()):
            rows = slice(seen[k], seen[k + 1])
            yield Step(
                t,
                Odometry(self.delta[k], self.delta_cov[k]) if k else None,
                RangeBearing(self.ids[rows], self.z[rows], self.z_cov[rows]),
                self._loops(loops[k], loops[k + 1]) if loops[k] < loops[k + 1] else no_loops,
                NO_PARTIAL if self.partial is None else self.partial.at(k),
                NO_FIXES if self.fixes is None else self.fixes.at(k),
                NO_SIGNATURES if self.signatures is None else self.signatures.rows(rows),
                turns.get(k),
            )

    def __getitem__(self, k: int) -> Step:
        """Step k (from the end where negative), as views of the columns."""
        k = range(len(self))[k]
        seen = slice(self.sighting_first[k], self.sighting_first[k + 1])
        return Step(
            float(self.t[k]),
            None if k == 0 else Odometry(self.delta[k], self.delta_cov[k]),
            RangeBearing(self.ids[seen], self.z[seen], self.z_cov[seen]),
            self._loops(self.loop_first[k], self.loop_first[k + 1]),
            NO_PARTIAL if self.partial is None else self.partial.at(k),
            NO_FIXES if self.fixes is None else self.fixes.at(k),
            NO_SIGNATURES if self.signatures is None else self.signatures.rows(seen),
            None if self.gyro is None else self.gyro.at(k),
        )

    def _loops(self, first: int, end: int) -> RelativePoses:
        return RelativePoses(self.loop_to[first:end], self.loop_delta[first:end], self.loop_cov[first:end])

    @property
    def remarks(self) -> list[str]:
        """Remarks of its reader on what is legal yet odd, one sentence each without its full stop."""
        found = self.notes.get(REMARKS, ())
        return [one for one in found if isinstance(one, str)] if isinstance(found, list) else []

    @property
    def sighted(self) -> int:
        """The number of sightings, those of a range or a bearing alone among them."""
        return len(self.ids) + (0 if self.partial is None else len(self.partial))

    @property
    def sighting_step(self) -> Ints:
        """(s,) the step of every sighting."""
        return np.repeat(np.arange(len(self)), np.diff(self.sighting_first))

    @property
    def loop_step(self) -> Ints:
        """(l,) the step of every loop closure."""
        return np.repeat(np.arange(len(self)), np.diff(self.loop_first))

    @cached_property
    def digest(self) -> str:
        """sha256, in hexadecimal, of everything a backend is given: logs with equal digests have the same factors."""
        known = self.prior.map
        columns: dict[str, Array | Ints | None] = {
            "prior.pose": self.prior.pose,
            "prior.cov": self.prior.cov,
            "prior.map.ids": None if known is None else known.ids,
            "prior.map.xy": None if known is None else known.xy,
            "prior.map.cov": None if known is None else known.cov,
        }
        columns |= {} if self.prior.start == "known" else {"prior.start unknown": None}
        constant = self.prior.systematic
        told = constant if constant.wheel_scale else constant[:4]  # as in logs from before there was one
        columns |= {} if constant == Systematic() else {"prior.systematic": np.array(told, np.float64)}
        columns |= {name: getattr(self, name) for name in _COLUMNS}
        for table in (self.partial, self.fixes, self.signatures, self.gyro):
            columns |= {} if table is None else table.columns
        return digest_of(columns)

    @property
    def seen(self) -> Ints:
        """The ids of all sightings, those of a range or a bearing alone after the whole ones."""
        return self.ids if self.partial is None else np.concatenate((self.ids, self.partial.ids))

    @property
    def unknown(self) -> int:
        """The number of sightings of UNKNOWN landmarks, those of a range or a bearing alone included."""
        return int((self.seen == UNKNOWN).sum())

    @property
    def starts_nothing(self) -> bool:
        """True where all that tells the path are ranges or bearings alone without any id, and no map is given."""
        nothing = not len(self.ids) and self.unknown == self.sighted > 0
        return nothing and self.fixes is None and not len(self.loop_to) and self.prior.map is None

    def identified(self) -> "Log":
        """The log without its sightings of UNKNOWN landmarks; itself if it has none."""
        known, partial = self.ids != UNKNOWN, self.partial
        if known.all() and (partial is None or (partial.ids != UNKNOWN).all()):
            return self
        return replace(
            self,
            partial=None if partial is None else partial.rows(partial.ids != UNKNOWN),
            sighting_first=frozen_ids(np.searchsorted(self.sighting_step[known], np.arange(len(self) + 1))),
            ids=frozen_ids(self.ids[known]),
            z=frozen(self.z[known]),
            z_cov=frozen(self.z_cov[known]),
            signatures=None if self.signatures is None else self.signatures.rows(known),
        )

    def of_sensor(self, sensor: Mounting) -> "Log":
        """The log with its sightings, which are `sensor`'s, as the body's own, from its poses at the log's times.

        InputError where some tell a part alone: these cannot be converted.
        """
        if self.partial is not None:
            raise InputError(
                "sensor: found sightings of a range or a bearing alone, expected whole ones, or all of the body itself."
            )
        z, cov = mounted(sensor, self.t, self.delta, self.sighting_step, self.z, self.z_cov)
        return replace(self, z=frozen(z), z_cov=frozen(cov))

    def dead_reckoned(self) -> Array:
        """(n, 3) the path from the prior's pose along the odometry; covariances are not used."""
        return summed(self.prior.pose, self.delta[1:])

    def without_partial(self) -> "Log":
        """The log without its partial sightings."""
        return replace(self, partial=None)

    def without_fixes(self) -> "Log":
        """The log without its fixes."""
        return replace(self, fixes=None)

    def without_signatures(self) -> "Log":
        """The log without its signatures."""
        return replace(self, signatures=None)

    def without_gyro(self) -> "Log":
        """The log without its gyro."""
        return replace(self, gyro=None)

    def without_loops(self) -> "Log":
        """The log without its loop closures; itself if it has none."""
        if not len(self.loop_to):
            return self
        return replace(
            self,
            loop_first=frozen_ids(np.zeros_like(self.loop_first)),
            loop_to=frozen_ids(self.loop_to[:0]),
            loop_delta=frozen(self.loop_delta[:0]),
            loop_cov=frozen(self.loop_cov[:0]),
        )

    def head(self, steps: int) -> "Log":
        """The log's first `steps` steps, with the scans and clouds that were taken up to the next one."""
        n, seen, loops = steps, self.sighting_first[steps], self.loop_first[steps]
        log = Log.from_arrays(
            self.name,
            self.prior,
            self.t[:n],
            self.delta[:n],
            self.delta_cov[:n],
            self.sighting_step[:seen],
            self.ids[:seen],
            self.z[:seen],
            self.z_cov[:seen],
            loop_step=self.loop_step[:loops],
            loop_to=self.loop_to[:loops],
            loop_delta=self.loop_delta[:loops],
            loop_cov=self.loop_cov[:loops],
            partial=None if self.partial is None else self.partial.head(steps),
            fixes=None if self.fixes is None else self.fixes.head(steps),
            signature=None if self.signatures is None else self.signatures.s[:seen],
            signature_var=None if self.signatures is None else self.signatures.var[:seen],
            gyro=None if self.gyro is None else self.gyro.head(steps),
            notes=self.notes,
        )
        return replace(log, scans=head_of(self.scans, steps), clouds=head_of(self.clouds, steps))


class Dataset(NamedTuple):
    """The return value of a dataset's builder: the factors, and the ground truth if there is one."""

    log: Log
    truth: Truth | None


def _without_first(rows: Array) -> Array:
    """A copy whose row 0 is NaN, so that a digest does not depend on it."""
    copy = np.array(rows, np.float64)
    copy[:1] = np.nan
    return copy
