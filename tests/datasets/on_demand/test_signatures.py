"""Signatures on demand: of so many bits, and the rest of the log as it was."""

from itertools import pairwise
from math import e, log2, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from refusals import refused
from slamduel.bench.plan.load import load
from slamduel.core.factors import UNKNOWN, Dataset, Truth
from slamduel.core.factors.check import problems
from slamduel.core.se2 import Array, Ints
from slamduel.core.signatures import Signatures
from slamduel.datasets import registry
from slamduel.datasets.on_demand.parts import Parts
from slamduel.datasets.on_demand.signatures import SIGNATURES_NOTE, WorldSignatures, bits_of, spread_of


def made(options: str = "", seed: int = 1) -> Dataset:
    dataset = load(f"circle[steps=1000,landmarks=60{options}]", seed)
    assert list(problems(dataset.log)) == []
    return dataset


def signatures(dataset: Dataset) -> Signatures:
    assert dataset.log.signatures is not None
    return dataset.log.signatures


def centred(s: Array, ids: Ints) -> Array:
    """The errors of signatures, by the means of their landmarks."""
    out = s.copy()
    for landmark in np.unique(ids):
        out[ids == landmark] -= s[ids == landmark].mean()
    return out


def density(z: float, sd: float) -> float:
    return float(norm.cdf(z / sd) - norm.cdf((z - 1) / sd))


@pytest.mark.parametrize("sd", [3.0, 0.4, 0.1, 0.003])
def test_bits_are_the_mutual_information(sd: float) -> None:
    """h(Z) - h(Z | S), by scipy's integral over the density."""
    wide = 8 * sd
    ends = sorted({-wide, wide, 1 - wide, 1 + wide})
    parts = [quad(lambda z: -density(z, sd) * np.log2(density(z, sd) + 1e-300), *two)[0] for two in pairwise(ends)]
    assert bits_of(sd) == pytest.approx(sum(parts) - log2(sd * sqrt(2 * pi * e)), abs=1e-6)


@pytest.mark.parametrize("bits", [0.01, 1.0, 2.0, 10.0])
def test_the_spread_has_its_bits(bits: float) -> None:
    assert bits_of(spread_of(bits)) == pytest.approx(bits, abs=1e-5)


def test_bits_leave_their_share_of_the_landmarks_in_question() -> None:
    """The exact posterior over many landmarks, given one measured signature: log2 of their number less the bits."""
    rng = np.random.default_rng(5)
    own = rng.uniform(size=4000)
    for bits in (1.0, 2.0):
        sd = spread_of(bits)
        measured = rng.choice(own, 600) + sd * rng.standard_normal(600)
        likely = np.exp(-0.5 * ((measured[:, None] - own) / sd) ** 2)
        p = likely / likely.sum(axis=1, keepdims=True)
        left = -(p * np.log2(np.maximum(p, 1e-300))).sum(axis=1).mean()
        assert log2(len(own)) - left == pytest.approx(bits, abs=0.05)


def test_every_simulated_world_with_sightings_has_them() -> None:
    worlds, signed = (
        {name for name in registry.BUILTIN if issubclass(registry.find(name).options, kind)}
        for kind in (Parts, WorldSignatures)
    )
    assert signed == worlds
    assert len(signed) == 10


def test_the_rest_of_the_log_is_the_same() -> None:
    plain, signed = made(), made(",signature_bits=2")
    assert plain.log.signatures is None
    assert signed.log.without_signatures().digest == plain.log.digest
    assert SIGNATURES_NOTE not in plain.log.notes
    assert signed.log.notes[SIGNATURES_NOTE] == {"sd": spread_of(2.0), "bits": 2.0}


def test_they_are_as_stated_around_one_of_each_landmark() -> None:
    dataset = made(",signature_bits=2,ids=hidden")
    found = signatures(dataset)
    assert dataset.truth is not None
    ids = dataset.truth.assigned
    assert ids is not None
    assert (dataset.log.ids == UNKNOWN).all()
    np.testing.assert_array_equal(found.var, spread_of(2.0) ** 2)
    freedom = len(ids) - len(np.unique(ids))
    assert (centred(found.s, ids) ** 2).sum() / freedom == pytest.approx(spread_of(2.0) ** 2, rel=0.1)
    means = np.array([found.s[ids == landmark].mean() for landmark in np.unique(ids)])
    assert means.min() > -0.1
    assert means.max() < 1.1
    assert means.std() == pytest.approx(sqrt(1 / 12), rel=0.25)


def test_other_bits_have_the_same_errors_in_standard_deviations() -> None:
    one, two, by_sd = (signatures(made(f",{o}")) for o in ("signature_bits=1", "signature_bits=2", "signature_sd=0.5"))
    ids = made().log.ids
    errors = [centred(found.s, ids) / np.sqrt(found.var) for found in (one, two, by_sd)]
    np.testing.assert_allclose(errors[0], errors[1], atol=1e-12)
    np.testing.assert_allclose(errors[0], errors[2], atol=1e-12)
    assert signatures(made(",signature_bits=1", seed=2)).s[0] != one.s[0]


def test_false_sightings_have_some_of_their_own() -> None:
    dataset = made(",clutter=1,signature_sd=0.001")
    assert isinstance(dataset.truth, Truth)
    assert dataset.truth.assigned is not None
    false = signatures(dataset).s[dataset.truth.assigned == UNKNOWN]
    assert len(false) > 500
    assert false.mean() == pytest.approx(0.5, abs=0.05)
    assert false.std() == pytest.approx(sqrt(1 / 12), rel=0.1)


def test_sightings_of_a_part_lose_theirs() -> None:
    whole, some = made(",signature_bits=1"), made(",signature_bits=1,ranges_only=0.4")
    assert set(signatures(some).s.tolist()) < set(signatures(whole).s.tolist())
    assert len(signatures(some)) == len(some.log.ids) < len(whole.log.ids)


def test_both_options_are_refused() -> None:
    refused(
        "found both options signature_bits=1 and signature_sd=0.5, expected one",
        made,
        ",signature_bits=1,signature_sd=0.5",
    )


@pytest.mark.parametrize("name", ["signature_bits", "signature_sd"])
def test_they_are_refused_where_no_whole_sighting_is_left(name: str) -> None:
    said = f"option {name} has no effect without whole sightings, expected both"
    for parts in ("ranges_only=1", "bearings_only=1", "ranges_only=0.25,bearings_only=0.75"):
        refused(said, made, f",{name}=1,{parts}")
    assert len(signatures(made(f",{name}=1,ranges_only=0.5,bearings_only=0.25")))
