"""signatures.csv beside sightings.csv in the folder of a log."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from refusals import refused, refused_at
from slamduel.core.factors import Dataset, Log
from slamduel.datasets.formats import log_folder
from slamduel.datasets.formats.g2o_write import write_g2o
from small_log import assert_same, small_dataset, small_log

ROWS = ["signature,css", "0.5,0.01", "0.1,0.01", "0.9,0.01", "0.4,0.04", "0.2,0.01", "0.7,0.01"]


def signed() -> Log:
    s, css = np.array([row.split(",") for row in ROWS[1:]], float).T
    return small_log(change=lambda parts: parts.update(signature=s, signature_var=css))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    log_folder.write(tmp_path / "log", signed(), small_dataset().truth)
    return tmp_path / "log"


def own(folder: Path, rows: list[str]) -> Path:
    """Writes these rows, as a user does: without what log.toml knows of the files."""
    words = (folder / "log.toml").read_text()
    start = words.index("[contents]")
    (folder / "log.toml").write_text(words[:start] + words[words.index("[prior]") :])
    (folder / "signatures.csv").write_text("\n".join(rows) + "\n")
    return folder


def test_a_log_with_signatures_reads_back_bit_for_bit(folder: Path) -> None:
    assert (folder / "signatures.csv").read_text().splitlines() == ROWS
    assert '"signatures.csv" = 6' in (folder / "log.toml").read_text()
    found = log_folder.read(folder)
    assert_same(found, Dataset(signed(), small_dataset().truth))
    assert found.log.signatures is not None


def test_a_log_without_has_no_such_file(tmp_path: Path) -> None:
    log_folder.write(tmp_path / "log", small_log(), None)
    assert not (tmp_path / "log" / "signatures.csv").exists()
    assert "signatures" not in (tmp_path / "log" / "log.toml").read_text()


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (ROWS[:-1], "signatures.csv: found 5 rows, expected 6, one for each row of sightings.csv."),
        ([*ROWS, "0.3,0.01"], "signatures.csv: found 7 rows, expected 6, one for each row of sightings.csv."),
        (ROWS[:1], "signatures.csv: found 0 rows, expected 6, one for each row of sightings.csv."),
        ([row.split(",")[0] for row in ROWS], "signatures.csv, line 1: column 'css' is missing, expected the columns"),
        ([*ROWS[:3], "0.9,", *ROWS[4:]], "signatures.csv, line 4: css "),
        ([*ROWS[:3], "0.9,0", *ROWS[4:]], "signatures.csv, line 4: css is 0.0, expected a variance, more than 0."),
        ([*ROWS[:3], "nan,0.1", *ROWS[4:]], "signatures.csv, line 4: signature is nan, expected a finite number."),
    ],
)
def test_a_fault_is_named(folder: Path, rows: list[str], words: str) -> None:
    refused_at(folder, words, log_folder.read, own(folder, rows))


def test_only_the_fault_of_a_sighting_is_told(folder: Path) -> None:
    own(folder, ROWS)
    rows = (folder / "sightings.csv").read_text().splitlines()
    rows[2] = rows[2].replace("0,", "a,", 1)
    (folder / "sightings.csv").write_text("\n".join(rows) + "\n")
    found = list(log_folder.scan(folder))
    assert len(found) == 1
    assert "sightings.csv, line 3: step" in str(found[0])


@pytest.mark.parametrize("change", ["number", "gone"])
def test_a_change_is_told(folder: Path, change: str) -> None:
    file = folder / "signatures.csv"
    if change == "gone":
        file.unlink()
        refused("contents.rows has 6 for signatures.csv, which has 0 rows", log_folder.read, folder)
    else:
        file.write_text(file.read_text().replace("0.04", "0.05"))
        refused("sightings.csv or loops.csv, or signatures.csv has changed", log_folder.read, folder)


def test_a_graph_file_has_no_place_for_them(tmp_path: Path) -> None:
    log = replace(signed(), prior=signed().prior._replace(map=None))
    refused("log small has signatures, which a g2o file cannot represent", write_g2o, tmp_path / "log.g2o", log)
