"""A third number of every sighting: in a log's columns, its steps and its digest."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from refusals import refusal, refused
from slamduel.core.factors import UNKNOWN, Dataset, Log
from slamduel.core.factors.check import check, problems
from slamduel.core.signatures import NO_SIGNATURES, Signatures
from slamduel.datasets import archive
from small_log import small_dataset, small_log

S, VAR = np.array([0.5, 0.1, 0.9, 0.4, 0.2, 0.7]), np.full(6, 0.01)


def signed(s: Any = S, var: Any = VAR) -> Log:
    """`small_log` with signatures."""
    return small_log(change=lambda parts: parts.update(signature=s, signature_var=var))


def columns(log: Log) -> Signatures:
    assert log.signatures is not None
    return log.signatures


def test_every_step_has_those_of_its_sightings() -> None:
    log = signed()
    assert [step.signatures.s.tolist() for step in log] == [[0.5, 0.1, 0.9], [], [0.4, 0.2], [], [], [0.7]]
    assert log[2].signatures.var.tolist() == [0.01, 0.01]
    assert log.prior.signatures
    assert "with signatures" in repr(log)
    assert not columns(log).s.flags.writeable
    assert not log[2].signatures.s.flags.writeable


def test_a_log_without_has_none_and_the_digest_it_had() -> None:
    plain = small_log()
    assert plain.signatures is None
    assert not plain.prior.signatures
    assert all(step.signatures is NO_SIGNATURES for step in plain)
    assert signed().without_signatures().digest == plain.digest


def test_both_columns_are_part_of_the_digest() -> None:
    digests = {small_log().digest, signed().digest, signed(s=S + 0.1).digest, signed(var=2 * VAR).digest}
    assert len(digests) == 4


def test_they_stay_with_their_sightings() -> None:
    log = signed()
    assert columns(log.identified()).s.tolist() == S[log.ids != UNKNOWN].tolist()
    assert columns(log.head(3)).s.tolist() == S[:5].tolist()
    again = Log.from_steps(log.name, log.prior, list(log), log.notes)
    assert again.digest == log.digest
    assert Log.from_steps(log.name, log.prior, list(small_log())).signatures is None


def test_an_archive_restores_them_bit_for_bit() -> None:
    dataset = Dataset(signed(), small_dataset().truth)
    found = archive.unpacked(archive.packed(dataset)).log
    assert found.digest == dataset.log.digest
    assert columns(found).s.tobytes() == S.tobytes()
    plain = archive.unpacked(archive.packed(small_dataset())).log
    assert plain.signatures is None


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"signature": S}, "signature_var: found signature alone, expected a signature and its variance"),
        ({"signature_var": VAR}, "signature: found signature_var alone, expected a signature and its variance"),
        ({"signature": S[:5], "signature_var": VAR}, r"signature: found shape \(5,\), expected \(6,\), one for each"),
        ({"signature": S, "signature_var": 0.01}, r"signature_var: found shape \(\), expected \(6,\), one for each"),
        ({"signature": ["red"] * 6, "signature_var": VAR}, "signature: found list, expected an array of numbers"),
    ],
)
def test_columns_that_do_not_fit_are_refused(given: dict[str, Any], words: str) -> None:
    refused(words, small_log, change=lambda parts: parts.update(given))


@pytest.mark.parametrize(
    ("row", "s", "var", "words"),
    [
        (2, np.nan, 0.1, "signature is nan, expected a finite number"),
        (4, 0.3, 0.0, "css is 0.0, expected a variance, more than 0"),
        (5, 0.3, -1.0, "css is -1.0, expected a variance, more than 0"),
        (1, 0.3, np.inf, "css is inf, expected a variance, more than 0"),
    ],
)
def test_bad_numbers_are_problems_of_their_row(row: int, s: float, var: float, words: str) -> None:
    some, its = S.copy(), VAR.copy()
    some[row], its[row] = s, var
    log = signed(some, its)
    assert [problem[:2] for problem in problems(log)] == [("signatures", row)]
    assert refusal(check, log, "log small") == f"log small: signatures row {row}: {words}."


def test_a_log_whose_sightings_have_changed_without_them_is_refused() -> None:
    log = replace(signed(), signatures=columns(signed()).rows(slice(0, 4)))
    assert refusal(check, log, "log small") == "log small: signatures row 0: s has shape (4,), expected (6,)."
