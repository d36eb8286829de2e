"""Refusals: what a user can mend ends in an InputError of one sentence."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from slamduel.core.errors import InputError


def refusal(call: Callable[..., object], *given: object, **options: object) -> str:
    """The sentence of the InputError in which a call ends, on one line."""
    with pytest.raises(InputError) as caught:
        call(*given, **options)
    sentence = str(caught.value)
    assert "\n" not in sentence, sentence
    return sentence


def refused(words: str, call: Callable[..., object], *given: object, **options: object) -> None:
    """A call ends in an InputError whose sentence has the regular expression `words`."""
    sentence = refusal(call, *given, **options)
    assert re.search(words, sentence), sentence


def refused_at(file: Path, words: str, call: Callable[..., object], *given: object, **options: object) -> None:
    """A call ends in an InputError whose sentence begins with a file or folder and has `words`."""
    sentence = refusal(call, *given, **options)
    assert sentence.startswith(str(file)), sentence
    assert words in sentence, sentence
