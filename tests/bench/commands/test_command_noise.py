"""bench noise: what it prints and writes, and what it refuses."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from noisy_logs import Slow, noisy
from slamduel.bench.cli import main
from slamduel.bench.plan.load import load
from slamduel.datasets.formats import log_folder
from slamduel.datasets.noise.noise_file import read_noise

DATA = Path(os.environ.get("SLAMDUEL_DATA", "nowhere")) / "mrclam"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    log_folder.write(tmp_path / "log", *noisy("circle[steps=300]", 0, Slow(share=0.9, time=9.0)))
    return tmp_path / "log"


def test_the_noise_is_printed_saved_and_stated_in_another_log(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    saved, page, out = (folder.parent / name for name in ("noise.toml", "noise.html", "stated"))
    assert main(["noise", str(folder), "--save", str(saved), "--out", str(page)]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("Range errors stay correlated for")
    assert "95 % interval" in printed
    assert page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    model = read_noise(saved)
    assert model.range.share > 0.5
    assert main(["noise", "circle[steps=50]", "--noise", str(saved), "--apply", str(out)]) == 0
    before, after = load("circle[steps=50]").log, load(out).log
    assert (after.z == before.z).all()
    assert np.median(after.z_cov[:, 0, 0] / before.z_cov[:, 0, 0]) > 2
    assert after.notes["noise"]["range"]["time"] == model.range.time
    assert main(["validate", str(out)]) == 0


def test_correlation_that_cannot_be_stated_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    saved, out = folder.parent / "noise.toml", folder.parent / "stated"
    assert main(["noise", str(folder), "--save", str(saved), "--quiet"]) == 0
    for log, said in (("circle[steps=50,ids=hidden]", True), ("circle[steps=50]", False)):
        capsys.readouterr()
        assert main(["noise", log, "--noise", str(saved), "--apply", str(out / str(said))]) == 0
        assert ("their correlation is not stated" in capsys.readouterr().out) == said


def test_one_command_measures_and_states(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder.parent / "stated"
    assert main(["noise", str(folder), "--apply", str(out), "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    assert load(out).log.notes["noise"]["fitted_on"]


@pytest.mark.usefixtures("no_report")
def test_backends_are_named_for_either_way_to_state_slow_errors(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own, thinned = folder.parent / "own", folder.parent / "thinned"
    assert main(["noise", str(folder), "--apply", str(own), "--own"]) == 0
    *_, last = capsys.readouterr().out.splitlines()
    assert last.startswith("backend: bias-ekf[range_share=0.")
    assert main(["noise", str(folder), "--apply", str(thinned)]) == 0
    *_, filtered, graph = capsys.readouterr().out.splitlines()
    assert (filtered[:13], graph[:15]) == ("backend: ekf[", "backend: isam2[")
    assert np.median(load(thinned).log.z_cov[:, 0, 0] / load(own).log.z_cov[:, 0, 0]) > 2
    for at, named in ((own, last), (thinned, f"{filtered},{graph.removeprefix('backend: ')}")):
        run = ["run", "--dataset", str(at), "--backend", named.removeprefix("backend: "), "--executor", "here"]
        assert main([*run, "--out", str(folder.parent / f"run-{at.name}"), "--quiet"]) == 0


def test_json_has_every_number_with_its_interval(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["noise", str(folder), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found) == {"logs", "sentences", "remarks", "numbers", "noise"}
    assert all(one["low"] <= one["value"] <= one["high"] for one in found["numbers"])
    assert found["noise"]["range"]["time"] == pytest.approx(9.0, rel=0.8)


@pytest.mark.skipif(not DATA.is_dir(), reason="SLAMDUEL_DATA is not set, or has no mrclam")
@pytest.mark.slow
def test_mrclams_errors_are_found_to_stay_correlated(capsys: pytest.CaptureFixture[str]) -> None:
    logs = [f"mrclam[robot={robot},path={DATA}]" for robot in (1, 2, 3)]
    assert main(["noise", *logs, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["noise"]
    for name in ("range", "bearing"):
        assert 3 < found[name]["time"] < 30
        assert found[name]["share"] > 0.5
    assert found["bearing"]["together"] > 0.5
