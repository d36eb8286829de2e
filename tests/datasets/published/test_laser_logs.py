"""The laser logs of the Freiburg benchmark: fetched file by file, whole or not at all, and read by their names."""

import gzip
import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import floor_drives as floor
import publishers
import toy_log
from motions import chained
from publishers import Http, Request
from recorded import at_hand
from refusals import refused
from slamduel.bench.cli import main
from slamduel.bench.plan.load import load
from slamduel.bench.plan.plan import Plan
from slamduel.bench.plan.spec import dataset_variants
from slamduel.bench.run.benchmark import DEFAULTS
from slamduel.core.se2 import compose
from slamduel.datasets.published import catalogue
from slamduel.datasets.published.catalogue import FILE, PUBLISHED, place
from slamduel.datasets.published.laser_logs import log_file
from toy_log import Printed, Serve, beside, refusal

quick = pytest.fixture(autouse=True)(toy_log.quick)
serve = pytest.fixture(toy_log.serve)

NAMES = ("aces", "fr079", "intel-lab", "killian", "mit-csail")
RELATIONS = b"100.000000 101.000000 0.4 0.0 0.0 0.0 0.0 0.1\n"


@pytest.fixture
def scans(tmp_path: Path) -> bytes:
    return floor.carmen(tmp_path / "written" / "floor.clf", floor.floor_drive()).read_bytes()


def sends_by_name(scans: bytes, relations: bytes = RELATIONS) -> publishers.Behaviour:
    """Answers with the file whose ending is asked for."""

    def behave(request: Request) -> None:
        publishers.sends(scans if request.path.endswith(".clf") else relations)(request)

    return behave


def served(
    monkeypatch: pytest.MonkeyPatch, name: str, server: Http, known: dict[str, str | None] | None = None
) -> None:
    """The published log `name`, at that server and without known digests."""
    log = PUBLISHED[name]
    address = f"{server.url.removesuffix('log.zip')}datasets/{FILE}"
    files = dict.fromkeys(log.files) if known is None else known
    monkeypatch.setitem(PUBLISHED, name, replace(log, urls=(address,), files=files))


def test_a_log_and_its_relations_arrive_in_one_folder(
    serve: Serve, scans: bytes, monkeypatch: pytest.MonkeyPatch, capsys: Printed
) -> None:
    server = serve(*[sends_by_name(scans)] * 2)
    served(monkeypatch, "intel-lab", server)
    assert main(["fetch", "intel-lab"]) == 0
    assert server.paths == ["/datasets/intel.clf", "/datasets/intel.relations"]
    assert "not known here; found and recorded" in capsys.readouterr().out
    found = {file.name: file.read_bytes() for file in place("intel-lab").iterdir()}
    sums = found.pop("SHA256SUMS").decode()
    assert found == {"intel.clf": scans, "intel.relations": RELATIONS}
    assert f"{hashlib.sha256(scans).hexdigest()}  intel.clf\n" in sums
    log, truth = load("intel-lab")
    assert truth.kind == "relations"
    assert log.name == "intel-lab"
    assert log.notes["source"].startswith("D. Haehnel; relations: Kuemmerle et al.")
    assert len(log) > 25
    assert main(["fetch", "--check"]) == 0


def test_relations_of_another_log_are_refused_and_nothing_is_kept(
    serve: Serve, scans: bytes, monkeypatch: pytest.MonkeyPatch, capsys: Printed
) -> None:
    known = dict(PUBLISHED["killian"].files)
    assert known["mit-killian.relations"] is not None
    served(monkeypatch, "killian", serve(*[sends_by_name(scans)] * 2), known)
    assert "its mit-killian.relations is not the published one: sha256" in refusal(capsys, "killian")
    assert beside("killian") == set()


def test_half_a_log_or_a_page_in_its_place_is_none(
    serve: Serve, scans: bytes, monkeypatch: pytest.MonkeyPatch, capsys: Printed
) -> None:
    served(monkeypatch, "aces", serve(sends_by_name(scans), publishers.answers(404)))
    text = refusal(capsys, "aces")
    assert "aces.relations: 404 Not Found." in text
    assert "open http://ais.informatik.uni-freiburg.de/slamevaluation/datasets.php , download aces.clf and" in text
    served(monkeypatch, "aces", serve(publishers.sends(b"<!doctype html>We have moved.")))
    assert "aces.clf: a web page, not the published file." in refusal(capsys, "aces")
    assert beside("aces") == set()


def test_files_got_by_hand_are_installed_from_their_folder(scans: bytes, tmp_path: Path, capsys: Printed) -> None:
    (tmp_path / "got").mkdir()
    (tmp_path / "got" / "mit-csail.clf").write_bytes(scans)
    assert "missing mit-csail.relations" in refusal(capsys, "mit-csail", "--from", tmp_path / "got")
    (tmp_path / "got" / "mit-csail.relations").write_bytes(RELATIONS)
    assert main(["fetch", "mit-csail", "--from", str(tmp_path / "got")]) == 0
    log, _ = load("mit-csail[step=1.0]")
    assert log.notes["laser"]["settings"]["step"] == 1.0
    # Another file in its place is another log, and not what the cache has of the first.
    lines = scans.splitlines(keepends=True)
    (place("mit-csail") / "mit-csail.clf").write_bytes(b"".join(lines[: len(lines) // 2]))
    assert len(load("mit-csail[step=1.0]")[0]) < len(log)


def test_a_log_that_is_not_here_says_how_to_get_it() -> None:
    for name in NAMES:
        refused(rf"{name} is not on this machine: bench fetch {name} gets it, {name}\[path=FILE\]", load, name)


def test_the_entries_name_a_log_and_its_relations() -> None:
    for name in NAMES:
        log = PUBLISHED[name]
        stem = log_file(name).removesuffix(".clf")
        assert set(log.files) == {f"{stem}.clf", f"{stem}.relations"}
        assert log.urls == (f"http://ais.informatik.uni-freiburg.de/slamevaluation/datasets/{FILE}",)
    assert catalogue.PUBLISHED.keys() >= set(NAMES)


def test_relations_at_hand_are_the_published_ones() -> None:
    known = {file: digest for name in NAMES for file, digest in PUBLISHED[name].files.items() if digest}
    assert len(known) == 3
    for file, digest in known.items():
        assert hashlib.sha256((at_hand("lidar") / file).read_bytes()).hexdigest() == digest


def test_the_scanner_of_freiburgs_robot_sits_behind_its_origin(scans: bytes, tmp_path: Path) -> None:
    path = tmp_path / "fr079.clf"
    path.write_bytes(scans)
    log, _ = load(f"fr079[path={path}]")
    other, _ = load(f"carmen[path={path},ahead=-0.04]")
    assert log.digest == other.digest
    plain, _ = load(f"carmen[path={path}]")  # the scanner's own path, whose steps end elsewhere in turns
    robot, scanner = chained(log.delta[1:]), chained(plain.delta[1:])
    _, ours, theirs = np.intersect1d(log.t, plain.t, return_indices=True)
    behind = np.array([-0.04, 0.0, 0.0])
    sits = compose(robot[ours], behind)
    there = compose(np.broadcast_to(behind, (len(theirs), 3)), scanner[theirs])
    assert len(ours) > 20
    assert np.ptp(robot[ours, 2]) > 3.0  # on turned ground the scanner swings about the robot's origin
    # On six floors with a turn: at most 9 mm, and at least 41 mm without the scanner's place.
    assert np.abs((there - sits)[:, :2]).max() < 0.015
    assert np.abs((scanner[theirs] - robot[ours])[:, :2]).max() > 0.035


def members(text: str) -> list[tuple[str, str | None]]:
    """The logs that a dataset stands for, each with its cluster."""
    (variant,) = dataset_variants(text)
    logs = [variant.log(k) for k in range(len(variant.members))]
    return [(str(log), log.cluster) for log in logs]


def test_all_buildings_are_one_dataset_of_those_that_are_there(scans: bytes, tmp_path: Path, capsys: Printed) -> None:
    assert [cluster for _, cluster in members("laser-all")] == [*NAMES]  # nothing is there: the run says what to fetch
    folder = tmp_path / "got"
    folder.mkdir()
    label = f"laser-all[path={folder}]"
    refused(f"{folder}: found no laser log of the benchmark, expected aces.clf or fr079.clf", members, label)
    (folder / "intel.clf").write_bytes(scans)
    (folder / "aces.clf.gz").write_bytes(gzip.compress(scans))
    (folder / "aces.relations").write_bytes(RELATIONS)
    assert members(label) == [
        (f"aces[path={folder}/aces.clf.gz]", "aces"), (f"intel-lab[path={folder}/intel.clf]", "intel-lab"),
    ]  # fmt: skip
    plan = Plan.from_words(DEFAULTS | {"dataset": label, "backend": "ekf"})
    assert plan.remarks() == f"{label}: not there, and left out: fr079, killian and mit-csail."
    assert main(["fetch", "aces", "--from", str(folder)]) == 0  # its scans are gzipped
    assert members("laser-all") == [("aces", "aces")]
    capsys.readouterr()
