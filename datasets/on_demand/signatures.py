"""Signatures of the sightings of a simulated world, as options of the dataset.

Landmarks have signatures drawn evenly from 0 to 1, and a sighting measures its landmark's with a normal error. Its
*bits* are the mutual information I(S; Z) = h(Z) - h(Z | S) of a landmark's signature S and what is measured of it, Z
(Cover and Thomas, Elements of Information Theory, 2nd ed. 2006, sections 8.5 and 8.6): h(Z | S) is the normal error's
log2(sd sqrt(2 pi e)), and Z has the density F(z / sd) - F((z - 1) / sd), with F the normal distribution. Where the
error is small, that is log2(1 / (sd sqrt(2 pi e))), and a little more from both ends. Which landmark it is acts on the
measurement through the signature alone, so that a sighting's signature tells at most these bits of which one it is (the
data processing inequality, section 2.8), and of many landmarks as many: 1 bit leaves as much in question as half of
them would, all alike, 2 bits a quarter. Without any bits, there are no signatures.

Errors are drawn from generators of their own: everything else of the log is the same, bit for bit, and those of other
bits are the same in standard deviations.
"""

from dataclasses import dataclass, replace
from functools import cache
from math import e, erf, log2, pi, sqrt

import numpy as np

from ...core.errors import InputError
from ...core.factors import UNKNOWN, Dataset
from ...core.options import option
from ...core.signatures import Signatures
from .parts import Parts

SIGNATURES_NOTE = "signatures"  # the key of their error and its bits, among the log's notes

POINTS = 401  # of the integral over the density
FAR = 8.0  # sd beyond which the normal distribution is 0 or 1
LEAST, MOST = 1e-5, 1e5  # sd between which that of some bits is looked for
HALVINGS = 60


@dataclass(frozen=True)
class WorldSignatures:
    """The signatures of sightings, by default none; a simulated world's options inherit it."""

    signature_bits: float = option(
        0.0,
        "information of a sighting's signature about which landmark it is of, bits; 0: no signatures",
        minimum=0.0,
        maximum=10.0,
    )
    signature_sd: float | None = option(
        None, "its standard deviation, landmarks' being from 0 to 1, in place of the bits", minimum=1e-4, maximum=1e4
    )


def with_signatures(dataset: Dataset, options: WorldSignatures, rng: np.random.Generator) -> Dataset:
    """Adds a signature to every whole sighting; a false one has that of a landmark of its own.

    InputError for both options, and where no whole sighting is left that could have one.
    """
    log, truth = dataset
    bits, sd = options.signature_bits, options.signature_sd
    if bits and sd is not None:
        raise InputError(
            f"dataset {log.name}: found both options signature_bits={bits:g} and signature_sd={sd:g}, expected one."
        )
    if not bits and sd is None:
        return dataset
    _check_used(dataset, options, "signature_bits" if sd is None else "signature_sd")
    sd = spread_of(bits) if sd is None else sd
    true = log.ids if truth is None or truth.assigned is None else truth.assigned
    names, row = np.unique(true, return_inverse=True)
    known = names != UNKNOWN
    places, strangers, errors = rng.spawn(3)
    own = np.zeros(len(names))
    own[known] = places.uniform(size=int(known.sum()))
    false = strangers.uniform(size=len(true))
    s = np.where(true == UNKNOWN, false, own[row]) + sd * errors.standard_normal(len(true))
    notes = {**log.notes, SIGNATURES_NOTE: {"sd": sd, "bits": round(bits_of(sd), 4)}}
    signatures = Signatures.from_arrays(s, np.full(len(s), sd**2))
    return Dataset(replace(log, signatures=signatures, notes=notes), truth)


def _check_used(dataset: Dataset, options: WorldSignatures, name: str) -> None:
    log, truth = dataset
    lacking = ""
    if not len(log.ids) and (truth is None or truth.map is None or not len(truth.map.ids)):
        lacking = "landmarks"
    elif isinstance(options, Parts) and options.ranges_only + options.bearings_only == 1:
        lacking = "whole sightings"
    if lacking:
        raise InputError(f"dataset {log.name}: option {name} has no effect without {lacking}, expected both.")


def bits_of(sd: float) -> float:
    """The information in a signature of that standard deviation, bits.

    The density is symmetric, and 1 beyond FAR from its ends: it is integrated up to the middle, by a rule that is exact
    to rounding where the slope is 0 at both ends.
    """
    wide = 1 / sd
    u = np.linspace(-FAR, min(FAR, wide / 2), POINTS)
    f = np.array([erf(x / sqrt(2)) - erf((x - wide) / sqrt(2)) for x in u.tolist()]) / 2
    inside = -f * np.log2(np.maximum(f, 1e-300))
    measured = 2 * sd * float((inside[1:] + inside[:-1]).sum()) / 2 * float(u[1] - u[0])
    return measured - log2(sd * sqrt(2 * pi * e))


@cache
def spread_of(bits: float) -> float:
    """The standard deviation with that information, to six digits: the same on every machine."""
    low, high = LEAST, MOST
    for _ in range(HALVINGS):
        middle = sqrt(low * high)
        low, high = (middle, high) if bits_of(middle) > bits else (low, middle)
    return float(f"{high:.5e}")
