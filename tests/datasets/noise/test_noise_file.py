"""The TOML file of a noise: written and read again, and refused with file, line and key."""

from pathlib import Path

import pytest

from refusals import refusal
from slamduel.core.errors import InputError
from slamduel.datasets.noise.model import Model, SightingModel
from slamduel.datasets.noise.noise_file import read_noise, write_noise
from slamduel.datasets.noise.systematic import Systematic

RANGE = SightingModel(1.2, 0.5, 3.3, 0.01, 0.9, 4.0, 0.2)
TEXT = """\
fitted_on = ["a"]

[range]
scale = 1.0
power = 0.0
reach = 3.0
bias = 0.0
share = 0.5
time = 2.0
together = 0.0
"""


@pytest.mark.parametrize(
    "model",
    [
        Model(["a", "b"], [1.0, 0.5, 2.0], RANGE, RANGE._replace(share=0.0)),
        Model(["a"], None, RANGE, None),
        Model([], [1.0, 0.5, 2.0], None, None),
    ],
)
def test_a_noise_is_read_as_it_was_written(tmp_path: Path, model: Model) -> None:
    path = tmp_path / "noise.toml"
    write_noise(path, model)
    if not model.fitted_on:
        path.write_text(path.read_text().replace("fitted_on = []\n", ""))
    assert read_noise(path) == model


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("scale = 1.0", "scale = -1.0", r"line 4: range.scale: found -1.0, expected a number above 0"),
        ("share = 0.5", "share = 1.5", r"line 8: range.share: found 1.5, expected a number from 0 to 1"),
        ("time = 2.0\n", "", "line 3: range has no 'time'"),
        ("together", "alike", "range.alike"),
        ("power = 0.0", "power = 300.0", "range.power: found 300.0, expected a number from -10 to 10"),
        ("[range]", "[ranges]", "ranges"),
        (TEXT[18:], "", "found no noise, expected a table"),
        ('["a"]', '[""', "expected a TOML file"),
    ],
)
def test_a_file_that_is_not_a_noise_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = tmp_path / "noise.toml"
    path.write_text(TEXT.replace(old, new))
    with pytest.raises(InputError, match=said):
        read_noise(path)


def test_errors_that_stay_are_kept_with_the_noise(tmp_path: Path) -> None:
    model = Model(["a"], None, None, None, Systematic(x=0.2, delay=0.05, turn_scale=-0.04))
    write_noise(tmp_path / "noise.toml", model)
    assert read_noise(tmp_path / "noise.toml") == model


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("[systematic]\nahead = 0.2\n", "systematic.ahead: there is no such key"),
        ("[systematic]\nturn_scale = -1.5\n", "systematic.turn_scale: found -1.5, expected a number above -1"),
    ],
)
def test_errors_that_cannot_be_are_named(tmp_path: Path, words: str, said: str) -> None:
    (tmp_path / "noise.toml").write_text(words)
    assert said in refusal(read_noise, tmp_path / "noise.toml")
