import os
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from refusals import refused
from slamduel.core.factors import Dataset
from slamduel.core.options import option
from slamduel.datasets import cache
from slamduel.datasets.on_demand.ready import made_ready
from slamduel.datasets.registry import Source
from small_log import assert_same, small_log


@dataclass(frozen=True)
class Options:
    scale: float = option(1.0, "a factor on ranges")


class Maker:
    """A source's `make` that counts how often it was called."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, options: Options, rng: np.random.Generator) -> Dataset:
        self.calls += 1
        ranges = rng.uniform(1, 2, 6) * options.scale
        return Dataset(small_log(change=lambda parts: parts["z"].__setitem__((slice(None), 0), ranges)), None)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def maker() -> Maker:
    return Maker()


@pytest.fixture
def costly(maker: Maker) -> Source:
    return Source(maker, Options, seeded=True, costly=True)


def test_a_costly_log_is_made_once_and_comes_back_the_same(costly: Source, maker: Maker):
    first = made_ready("x", costly, Options(), 3)
    assert_same(made_ready("x", costly, Options(), 3), first)
    assert maker.calls == 1


def test_a_cheap_log_is_made_each_time_and_never_kept(maker: Maker, folder: Path):
    source = Source(maker, Options, seeded=True)
    assert_same(made_ready("x", source, Options(), 3), made_ready("x", source, Options(), 3))
    assert maker.calls == 2
    assert not folder.exists()


@pytest.mark.parametrize(("name", "options", "seed"), [("y", Options(), 3), ("x", Options(2), 3), ("x", Options(), 4)])
def test_another_name_option_or_seed_is_another(costly: Source, maker: Maker, name: str, options: Options, seed: int):
    first = made_ready("x", costly, Options(), 3)
    assert made_ready(name, costly, options, seed).log.digest != first.log.digest
    assert maker.calls == 2


def test_another_version_or_line_of_code_is_another_entry(
    costly: Source, maker: Maker, monkeypatch: pytest.MonkeyPatch, folder: Path
):
    made_ready("x", costly, Options(), 3)
    monkeypatch.setattr(cache.metadata, "version", lambda _: "0.0")
    made_ready("x", costly, Options(), 3)
    assert maker.calls == 2
    original = Path.read_bytes

    def edited(path: Path) -> bytes:
        return original(path) + (b"#" if path.name == "se2.py" else b"")

    monkeypatch.setattr(Path, "read_bytes", edited)
    made_ready("x", costly, Options(), 3)
    assert maker.calls == 3
    assert len(os.listdir(folder)) == 3


@pytest.mark.parametrize("damage", [b"", b"nonsense", None])
def test_a_damaged_entry_is_made_anew(costly: Source, maker: Maker, folder: Path, damage: bytes | None):
    first = made_ready("x", costly, Options(), 3)
    (entry,) = folder.iterdir()
    entry.write_bytes(entry.read_bytes()[:-40] if damage is None else damage)
    assert_same(made_ready("x", costly, Options(), 3), first)
    assert maker.calls == 2
    assert_same(made_ready("x", costly, Options(), 3), first)
    assert maker.calls == 2


def test_a_cache_that_cannot_be_written_to_is_done_without(costly: Source, maker: Maker, folder: Path):
    folder.write_text("a file where the folder should be")
    first = made_ready("x", costly, Options(), 3)
    assert_same(made_ready("x", costly, Options(), 3), first)
    assert maker.calls == 2


def test_another_content_of_a_file_that_is_read_is_another_entry(costly: Source, maker: Maker, tmp_path: Path):
    source, path = replace(costly, files=lambda _: [tmp_path / "read.txt"]), tmp_path / "read.txt"
    for calls, content in ((1, None), (2, "one"), (3, "more")):
        if content is not None:
            path.write_text(content)
        made_ready("x", source, Options(), 3)
        made_ready("x", source, Options(), 3)
        assert maker.calls == calls


def test_variants_share_their_randomness(maker: Maker):
    source = Source(maker, Options, seeded=True)
    one, two = (made_ready("x", source, Options(scale), 3).log for scale in (1.0, 2.0))
    np.testing.assert_array_equal(2 * one.z[:, 0], two.z[:, 0])


def test_an_unseeded_source_is_the_same_for_every_seed(maker: Maker):
    source = Source(maker, Options, costly=True)
    assert_same(made_ready("x", source, Options(), 3), made_ready("x", source, Options(), 4))
    assert maker.calls == 1


def test_the_generator_is_the_same_in_another_process():
    code = "from slamduel.datasets.cache import generator; print(generator('aruco-room', 7).integers(2**62))"
    env = {**os.environ, "PYTHONHASHSEED": "1"}
    other = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, check=True)
    assert int(other.stdout) == cache.generator("aruco-room", 7).integers(2**62)


def test_the_generator_depends_on_name_and_seed():
    drawn = {cache.generator(name, seed).integers(2**62) for name in ("x", "y", "z") for seed in range(50)}
    assert len(drawn) == 150


def test_a_source_that_makes_an_unusable_log_is_named(costly: Source, folder: Path):
    refused(r"dataset x: sightings row 0: range is -", made_ready, "x", costly, Options(-1.0), 3)
    assert not folder.exists()
