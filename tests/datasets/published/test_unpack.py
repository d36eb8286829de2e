"""Out of what was downloaded or got by hand comes the log that was asked for, or a sentence."""

import dataclasses
import gzip
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import publishers
import toy_log
from slamduel.bench.cli import main
from slamduel.datasets.published import unpack
from slamduel.datasets.published.catalogue import PUBLISHED, fetched, place
from slamduel.datasets.published.installed import here
from toy_log import FILES, LOG, Printed, Serve, assert_in_place, beside, entry, refusal, sha256, tarred, zipped

quick = pytest.fixture(autouse=True)(toy_log.quick)
serve = pytest.fixture(toy_log.serve)


def hostile(path: str) -> bytes:
    return zipped(FILES, folder=path)


BAD = {
    "garbage": (np.random.default_rng(9).bytes(5000), "found something else"),
    "nothing": (b"", "found something else"),
    "a page": (b" \n<!DOCTYPE html><html>We have moved.</html>", "a web page, not the published file"),
    "cut off": (LOG[:-30], "truncated or damaged"),
    "a flipped bit": (LOG[:150_000] + bytes([LOG[150_000] ^ 4]) + LOG[150_001:], "it cannot be unpacked (Bad CRC-32"),
    "a file is missing": (zipped({"path.dat": FILES["path.dat"]}), "missing marks.dat."),
    "both are missing": (zipped({}), "missing path.dat, marks.dat."),
    "zeros": (bytes(10240), "missing path.dat, marks.dat."),
    "another file": (zipped({**FILES, "marks.dat": b"else"}), "its marks.dat is not the published one: sha256"),
    "a way out": (hostile("../../"), "'../../README', which leads outside of it"),
    "the root": (hostile("/etc/"), "'/etc/README', which leads outside of it"),
    "a drive": (hostile("C:\\log\\"), "which leads outside of it"),
    "a way out of a tar": (tarred({"../path.dat": b""}), "'../path.dat', which leads outside of it"),
    "a cut tar": (tarred(FILES)[:100_000], "it cannot be unpacked"),
    "a gzip of no tar": (gzip.compress(b"hello" * 500), "found something else"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_not_the_log_is_turned_down(serve: Serve, tmp_path: Path, capsys: Printed, case: str) -> None:
    content, wording = BAD[case]
    url = serve(content=content).url
    text = refusal(capsys, "toy", "--url", url)
    assert text.startswith(f"bench: toy could not be fetched:\n  {url}: ")
    assert wording in text
    (source := tmp_path / "by_hand").write_bytes(content)
    text = refusal(capsys, "toy", "--from", source)
    assert text.startswith(f"bench: {source}: ")
    assert wording in text
    assert beside() == set()  # nothing of it is kept


def test_a_file_may_have_another_name_and_be_gzipped(tmp_path: Path, capsys: Printed) -> None:
    also = {"way.dat": "path.dat", "marks.dat.gz": "marks.dat"}
    PUBLISHED["toy"] = dataclasses.replace(entry(), also=also)
    (source := tmp_path / "log.zip").write_bytes(
        zipped({"way.dat": FILES["path.dat"], "marks.dat.gz": gzip.compress(FILES["marks.dat"])})
    )
    assert main(["fetch", "toy", "--quiet", "--from", str(source)]) == 0
    assert_in_place()
    source.write_bytes(zipped({"way.dat": FILES["path.dat"], "marks.dat.gz": FILES["marks.dat"]}))
    assert "it cannot be unpacked (Not a gzipped file" in refusal(capsys, "toy", "--from", source)
    PUBLISHED["toy"] = entry()
    assert "missing path.dat, marks.dat." in refusal(capsys, "toy", "--from", source)


def test_a_bad_new_one_leaves_the_old_one(serve: Serve, capsys: Printed) -> None:
    server = serve(publishers.sends(LOG), publishers.sends(BAD["another file"][0]))
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    refusal(capsys, "toy", "--again", "--url", server.url)
    assert_in_place()
    assert main(["fetch", "toy", "--quiet", "--again", "--url", server.url]) == 0
    assert_in_place()


@pytest.mark.parametrize("pack", [zipped, tarred])
def test_a_bomb(
    serve: Serve,
    capsys: Printed,
    monkeypatch: pytest.MonkeyPatch,
    pack: Callable[..., bytes],
) -> None:
    monkeypatch.setattr(unpack, "LARGEST", 1_000_000)
    server = serve(content=pack({**FILES, "path.dat": bytes(3_000_000)}))
    assert len(server.content) < 60_000
    assert "path.dat is larger than 1,000,000 bytes" in refusal(capsys, "toy", "--url", server.url)
    assert beside() == set()


def test_two_files_of_one_name(serve: Serve, capsys: Printed) -> None:
    twice = zipped({"older/path.dat": b"of another sheet", **FILES, "newer/path.dat": b"of a third"})
    assert main(["fetch", "toy", "--quiet", "--url", serve(content=twice).url]) == 0
    assert_in_place()  # the sha256 tells which is meant
    PUBLISHED["toy"] = entry(files=dict.fromkeys(FILES))
    assert "two different files path.dat" in refusal(capsys, "toy", "--again", "--url", serve(content=twice).url)


@pytest.mark.parametrize("form", ["zip", "tar", "tar.gz", "folder"])
def test_a_log_that_was_got_by_hand(tmp_path: Path, form: str) -> None:
    source = tmp_path / f"by_hand.{form}"
    if form == "folder":
        (source / "deep").mkdir(parents=True)
        for name, content in FILES.items():
            (source / "deep" / name).write_bytes(content)
    else:
        source.write_bytes(LOG if form == "zip" else tarred(FILES, "w" if form == "tar" else "w:gz"))
    assert main(["fetch", "toy", "--quiet", "--from", str(source)]) == 0
    assert_in_place()
    assert fetched("toy", "toy[path=FOLDER]") == place("toy")


def test_one_file_got_by_hand_is_enough_for_a_log_of_one_file(tmp_path: Path, capsys: Printed) -> None:
    source = tmp_path / "renamed"
    source.write_bytes(FILES["path.dat"])
    PUBLISHED["toy"] = entry(files={"path.dat": sha256(FILES["path.dat"])})
    assert main(["fetch", "toy", "--quiet", "--from", str(source)]) == 0
    assert_in_place(files={"path.dat": FILES["path.dat"]})
    source.write_bytes(b"else")
    assert "its path.dat is not the published one" in refusal(capsys, "toy", "--from", source)
    assert_in_place(files={"path.dat": FILES["path.dat"]})


def test_of_many_files_that_are_missing_three_are_named(tmp_path: Path, capsys: Printed) -> None:
    (source := tmp_path / "empty.tar").write_bytes(bytes(10240))
    listed = "missing Barcodes.dat, Landmark_Groundtruth.dat, Robot1_Groundtruth.dat and 14 more."
    assert listed in refusal(capsys, "mrclam-6", "--from", source)


def test_a_pipe_is_not_waited_for(tmp_path: Path, capsys: Printed) -> None:
    os.mkfifo(pipe := tmp_path / "path.dat")
    for given in (pipe, Path("/dev/null")):
        assert f"bench: {given}: a pipe, a socket or a device; expected" in refusal(capsys, "toy", "--from", given)
    assert "there is no such file or folder" in refusal(capsys, "toy", "--from", tmp_path / "none")
    assert f"bench: {pipe}: expected a regular file; found a pipe" in refusal(capsys, "toy", "--from", tmp_path)


# -------------------------------------------------------------------------- logs that differ in nothing but a number


def mrclam(number: int) -> dict[str, bytes]:
    return {name: f"{name} of set {number}".encode() for name in PUBLISHED["mrclam-1"].files}


@pytest.fixture
def sets(tmp_path: Path) -> Path:
    """Three of them in a folder."""
    for folder, number in (("MRCLAM_Dataset3", 3), ("MRSLAM_Dataset4", 4), ("mrclam5", 5)):
        (tmp_path / "sets" / folder).mkdir(parents=True)
        for name, content in mrclam(number).items():
            (tmp_path / "sets" / folder / name).write_bytes(content)
    return tmp_path / "sets"


@pytest.mark.parametrize("number", [3, 4, 5])
def test_of_several_sets_the_one_that_was_asked_for_is_taken(sets: Path, number: int) -> None:
    assert main(["fetch", f"mrclam-{number}", "--quiet", "--from", str(sets)]) == 0
    assert_in_place(f"mrclam-{number}", mrclam(number))


def test_a_copy_without_its_spare_files_is_installed_and_says_what_it_lacks(sets: Path, capsys: Printed) -> None:
    folder = sets / "MRCLAM_Dataset3"
    for robot in range(1, 6):
        (folder / f"Robot{robot}_Groundtruth.dat").unlink()
    (folder / "Robot4_Odometry.dat").unlink()
    assert main(["fetch", "mrclam-3", "--from", str(folder)]) == 0
    words = "without Robot1_Groundtruth.dat, Robot2_Groundtruth.dat, Robot3_Groundtruth.dat and 3 more: what it has"
    assert words in capsys.readouterr().out
    assert here("mrclam-3")
    assert main(["fetch", "mrclam-3", "--check"]) == 0
    (place("mrclam-3") / "Robot3_Odometry.dat").unlink()  # it was there
    assert "Robot3_Odometry.dat: No such file" in refusal(capsys, "mrclam-3", "--check")
    (folder / "Robot3_Measurement.dat").unlink()
    assert "missing Robot3_Measurement.dat." in refusal(capsys, "mrclam-3", "--from", folder)


def test_a_set_of_another_number_is_turned_down(sets: Path, monkeypatch: pytest.MonkeyPatch, capsys: Printed) -> None:
    turned_down = "Barcodes.dat in it is of mrclam-4 by its path, not of mrclam-3."
    folder = sets / "MRSLAM_Dataset4"
    assert f"{folder}: {turned_down}" in refusal(capsys, "mrclam-3", "--from", folder)
    monkeypatch.chdir(folder)
    assert f"{folder}: {turned_down}" in refusal(capsys, "mrclam-3", "--from", ".")
    (archive := sets / "MRCLAM4 (1).zip").write_bytes(zipped(mrclam(4), folder=""))
    assert f"{archive}: {turned_down}" in refusal(capsys, "mrclam-3", "--from", archive)
    archive.rename(renamed := sets / "MRCLAM3.zip")
    renamed.write_bytes(zipped(mrclam(4), folder="MRSLAM_Dataset4/"))
    assert f"{renamed}: MRSLAM_Dataset4/{turned_down}" in refusal(capsys, "mrclam-3", "--from", renamed)
    (sets / "MRCLAM_Dataset3" / "Barcodes.dat").unlink()
    assert "missing Barcodes.dat." in refusal(capsys, "mrclam-3", "--from", sets)
    assert not place("mrclam-3").exists()


def test_an_address_of_another_set_is_turned_down(serve: Serve, capsys: Printed) -> None:
    url = serve(content=zipped(mrclam(4), folder="")).url.replace("log.zip", "get?target=MRCLAM4.zip")
    assert f"{url}: Barcodes.dat in it is of mrclam-4" in refusal(capsys, "mrclam-3", "--url", url)
    assert main(["fetch", "mrclam-4", "--quiet", "--url", url]) == 0


def test_where_the_sha256_is_known_a_name_says_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = mrclam(6)
    known = dataclasses.replace(PUBLISHED["mrclam-6"], files={name: sha256(text) for name, text in files.items()})
    monkeypatch.setitem(PUBLISHED, "mrclam-6", known)
    (source := tmp_path / "MRCLAM3.zip").write_bytes(zipped(files))
    assert main(["fetch", "mrclam-6", "--quiet", "--from", str(source)]) == 0
