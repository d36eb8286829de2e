"""The column signature of the detections of CSV tables."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from refusals import refused_at
from slamduel.core.factors import REMARKS, Log
from slamduel.core.factors.check import problems
from slamduel.datasets.tables import csv_tables

ODOMETRY = "t,x,y,heading\n" + "".join(f"{k / 10},{k / 20},0,0\n" for k in range(60))
DETECTIONS = "t,id,range,bearing,signature\n-1,3,2,0,9.5\n1,3,2,0,5.5\n1,8,2,1,7.25\n2,3,1.5,0,5.75\n3,4,1,1,1\n"


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Any]:
    (tmp_path / "odometry.csv").write_text(ODOMETRY)
    (tmp_path / "detections.csv").write_text(DETECTIONS)
    return {name: str(tmp_path / f"{name}.csv") for name in ("odometry", "detections")}


def made(options: dict[str, Any]) -> Log:
    log = csv_tables.make(csv_tables.Options(**options), np.random.default_rng(0)).log
    assert list(problems(log)) == []
    return log


def test_they_are_read_where_their_noise_is_stated(files: dict[str, Any]) -> None:
    log = made(files | {"signature_sd": 0.5, "ignore": "4"})
    assert log.signatures is not None
    assert log.ids.tolist() == [3, 8, 3]
    assert log.signatures.s.tolist() == [5.5, 7.25, 5.75]
    assert log.signatures.var.tolist() == [0.25] * 3


def test_places_have_them_too(files: dict[str, Any]) -> None:
    text = DETECTIONS.replace("range,bearing", "x,y")
    Path(files["detections"]).write_text(text)
    found = made(files | {"signature_sd": 0.5}).signatures
    assert found is not None
    assert found.s.tolist() == [5.5, 7.25, 5.75, 1.0]


def test_without_a_noise_they_are_not_used_and_a_remark_says_so(files: dict[str, Any]) -> None:
    log = made(files)
    assert log.signatures is None
    said = "its column signature is not used: option signature_sd states its standard deviation"
    assert f"{files['detections']}: {said}" in log.notes[REMARKS]
    Path(files["detections"]).write_text(DETECTIONS.replace("signature", "colour"))
    assert made(files).digest == log.digest
    assert not any("signature" in remark for remark in made(files).remarks)


def test_a_noise_without_a_column_and_a_word_are_refused(files: dict[str, Any]) -> None:
    file, options = Path(files["detections"]), files | {"signature_sd": 0.5}
    file.write_text(DETECTIONS.replace("7.25", "red"))
    refused_at(file, "line 4: signature", made, options)
    file.write_text(DETECTIONS.replace("signature", "colour"))
    said = ", line 1: option signature_sd has no effect without a column signature, expected both; found the columns "
    refused_at(file, f"{said}t,id,range,bearing,colour", made, options)
    file.write_text(DETECTIONS.replace("range", "distance"))
    refused_at(file, "expected t,id,range,bearing,signature, or t,id,x,y,signature among them", made, options)
