"""`bench fetch`: published logs are put in place whole, checked and at once, or not at all with a sentence."""

import gzip
import re
import resource
import shutil
from pathlib import Path

import pytest

import publishers
import slamduel
import toy_log
from recorded import at_hand
from refusals import refused
from slamduel.bench.cli import main
from slamduel.datasets.published.catalogue import PUBLISHED, fetched, place
from toy_log import FILES, LOG, Printed, Serve, assert_in_place, beside, entry, refusal, sha256, zipped

quick = pytest.fixture(autouse=True)(toy_log.quick)
serve = pytest.fixture(toy_log.serve)

MOVED = b"<!doctype html>We have moved."


def test_the_addresses_are_tried_in_order(serve: Serve, capsys: Printed) -> None:
    gone, page, good = serve(publishers.answers(404)), serve(publishers.sends(MOVED)), serve()
    PUBLISHED["toy"] = entry(gone.url, page.url, good.url)
    assert main(["fetch", "toy"]) == 0
    assert_in_place()
    assert f"# from {good.url}\n" in (place("toy") / "SHA256SUMS").read_text()
    PUBLISHED["toy"] = entry(gone.url, page.url)
    gone.bad_days, page.bad_days = [publishers.answers(404)], [publishers.sends(MOVED)]
    text = refusal(capsys, "toy", "--again")
    assert f"  {gone.url}: 404 Not Found.\n  {page.url}: a web page, not the published file.\n" in text
    assert "About these addresses: made up.\nBy hand: open " in text


def test_the_links_on_a_page_are_tried(serve: Serve, capsys: Printed) -> None:
    archives = serve()
    archives.bad_days = [publishers.answers(404)]
    base = archives.url.removesuffix("log.zip")
    links = f"<a href=\"{base}s.pdf\">4</a> <A HREF='{base}EKF_1.tar.gz'>x</A> <a href={base}a/ekf&amp;2.zip>y</a>"
    page = serve(publishers.sends(b"<!doctype html>" + links.encode()))
    PUBLISHED["toy"] = entry(page.url, link=PUBLISHED["freiburg"].link)
    assert main(["fetch", "toy", "--quiet"]) == 0
    assert archives.paths == ["/EKF_1.tar.gz", "/a/ekf&2.zip"]
    assert_in_place()
    page.bad_days = [publishers.sends(b"<!doctype html> moved")]
    assert f"{page.url}: found no link to the archive.\n" in refusal(capsys, "toy", "--again")


def test_check_finds_what_has_changed(tmp_path: Path, capsys: Printed) -> None:
    assert "toy is not on this machine: bench fetch toy gets it" in refusal(capsys, "toy", "--check")
    (source := tmp_path / "log.zip").write_bytes(LOG)
    assert main(["fetch", "toy", "--from", str(source)]) == 0
    assert main(["fetch", "--check"]) == 0
    assert "toy: as published" in capsys.readouterr().out
    (place("toy") / "path.dat").write_bytes(b"touched")
    text = refusal(capsys, "toy", "--check")
    assert f"path.dat: its sha256 is {sha256(b'touched')}; published: {sha256(FILES['path.dat'])}" in text
    assert "bench fetch toy --again downloads toy again" in text
    (place("toy") / "path.dat").unlink()
    assert "path.dat: No such file" in refusal(capsys, "toy", "--check")


def test_digests_that_nobody_knows_are_recorded_printed_and_checked(tmp_path: Path, capsys: Printed) -> None:
    PUBLISHED["toy"] = entry(files=dict.fromkeys(FILES))
    (source := tmp_path / "log.zip").write_bytes(LOG)
    assert main(["fetch", "toy", "--from", str(source)]) == 0
    printed = capsys.readouterr().out
    assert "not known here" in printed
    assert all(f"{sha256(content)}  {name}" in printed for name, content in FILES.items())
    assert_in_place()
    assert main(["fetch", "toy", "--check"]) == 0
    assert "toy: as it first arrived" in capsys.readouterr().out
    (place("toy") / "path.dat").write_bytes(b"touched")
    assert "recorded when it first arrived" in refusal(capsys, "toy", "--check")
    (place("toy") / "SHA256SUMS").unlink()
    assert "no sha256 was recorded for it" in refusal(capsys, "toy", "--check")


def test_a_log_is_not_taken_for_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Printed) -> None:
    """Two files in three tell; one may be of the room, which they share."""
    kinds = ("path.dat", "marks.dat", "room.dat")
    logs = {f"toy-{n}": {kind: f"{kind} of {n}".encode() for kind in kinds} for n in (1, 2, 3)}
    unknown = entry(files=dict.fromkeys(kinds))
    monkeypatch.setitem(PUBLISHED, "toy-1", entry(files={kind: sha256(logs["toy-1"][kind]) for kind in kinds}))
    for name in ("toy-2", "toy-3"):
        monkeypatch.setitem(PUBLISHED, name, unknown)
    source = tmp_path / "log.zip"

    def given(name: str, files: dict[str, bytes]) -> str:
        source.write_bytes(zipped(files))
        return refusal(capsys, name, "--from", source)

    text = given("toy-2", logs["toy-1"] | {"room.dat": b"touched"})
    assert f"bench: {source}: 2 of its 3 files are those of toy-1, and not those of toy-2." in text
    assert not place("toy-2").exists()

    shared = logs["toy-2"] | {"room.dat": logs["toy-1"]["room.dat"]}
    source.write_bytes(zipped(shared))
    assert main(["fetch", "toy-2", "--quiet", "--from", str(source)]) == 0
    assert_in_place("toy-2", shared)

    recorded = (
        f"3 of its 3 files are those of toy-2 (compared with {place('toy-2')}; remove that if it is the wrong one)"
    )
    assert f"{recorded}, and not those of toy-3." in given("toy-3", shared)
    assert main(["fetch", "toy-2", "--quiet", "--check"]) == 0
    shutil.copytree(place("toy-2"), place("toy-3"))  # as an installation by other means may have left it
    assert f"{place('toy-3')}: {recorded}." in refusal(capsys, "toy-3", "--check")
    source.write_bytes(zipped(logs["toy-1"]))
    assert main(["fetch", "toy-1", "--quiet", "--from", str(source)]) == 0  # nothing recorded outweighs what is known


def test_a_log_that_is_incomplete_is_fetched_anew(serve: Serve, tmp_path: Path) -> None:
    place("toy").mkdir(parents=True)
    (place("toy") / "path.dat").write_bytes(b"half of it")
    assert main(["fetch", "toy", "--quiet", "--url", serve().url]) == 0
    assert_in_place()


def test_a_cache_that_cannot_be_written_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Printed) -> None:
    (tmp_path / "file").write_bytes(b"")
    (source := tmp_path / "log.zip").write_bytes(LOG)
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path / "file"))
    text = refusal(capsys, "toy", "--from", source)
    assert "Not a directory; toy goes into the cache folder, which the environment variable SLAMDUEL_CACHE" in text


@pytest.mark.parametrize(
    ("word", "wording"),
    [
        ("--url", "the download cannot be written (File too large)"),
        ("--from", "File too large; toy goes into the cache folder"),
    ],
)
def test_a_disk_that_is_full(serve: Serve, tmp_path: Path, capsys: Printed, word: str, wording: str) -> None:
    (source := tmp_path / "log.zip").write_bytes(LOG)
    server = serve()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, hard))  # no file may grow beyond that
    try:
        text = refusal(capsys, "toy", word, server.url if word == "--url" else source)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert wording in text
    assert len(server.paths) <= 1  # the disk is not asked again and again
    assert beside() == set()


def test_the_list_says_what_is_here(tmp_path: Path, capsys: Printed) -> None:
    (source := tmp_path / "log.zip").write_bytes(LOG)
    main(["fetch", "toy", "--quiet", "--from", str(source)])
    place("dlr").mkdir()
    assert main(["fetch"]) == 0
    listed = capsys.readouterr().out
    assert re.search(r"^toy +0\.2 MB +a log for these tests", listed, re.MULTILINE)
    assert re.search(r"^dlr +incomplete", listed, re.MULTILINE)
    assert all(re.search(rf"^{name} +-", listed, re.MULTILINE) for name in PUBLISHED if name not in ("toy", "dlr"))


def test_one_that_fails_does_not_stop_the_others(serve: Serve, capsys: Printed) -> None:
    good, gone = serve(), serve(publishers.answers(404))
    PUBLISHED["toy"] = entry(gone.url)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(PUBLISHED, "second", entry(good.url))
        assert "toy could not be fetched" in refusal(capsys, "toy", "second")
    assert beside("second") == {"second"}


@pytest.mark.parametrize(
    ("words", "wording"),
    [
        (["none"], "there is no such published log; there are aces, city10000, city-trees10000, dlr"),
        (["--url", "http://x"], "--url is for one published log; found 0 names"),
        (["toy", "dlr", "--from", "x"], "--from is for one published log; found 2 names"),
        (["toy", "--from", "x", "--url", "y"], "--from and --url do not go together"),
        (["toy", "--check", "--again"], "--check and --again do not go together"),
    ],
)
def test_words_that_make_no_sense(capsys: Printed, words: list[str], wording: str) -> None:
    assert wording in refusal(capsys, *words)


def test_a_log_that_is_not_here_names_the_command() -> None:
    refused(r"toy is not on this machine: bench fetch toy gets it, toy\[path=X\]", fetched, "toy", "toy[path=X]")


def test_the_catalogue_is_complete() -> None:
    logs = {name: log for name, log in PUBLISHED.items() if name != "toy"}
    pioneer = (f"tum-pioneer-{run}" for run in ("360", "slam", "slam2", "slam3"))
    others = ("aces", "city10000", "city-trees10000", "dlr", "fr079", "freiburg", "intel-lab", "killian")
    more = ("lost-in-the-woods", "manhattan", "mit-csail")
    assert list(logs) == [*others, *more, *(f"mrclam-{n}" for n in range(1, 10)), *pioneer, "victoria-park-raw"]
    for log in logs.values():
        assert log.urls
        assert all(re.match(r"(https?|ftp)://", url) for url in [log.page, *log.urls])
        assert all(digest is None or re.fullmatch("[0-9a-f]{64}", digest) for digest in log.files.values())
        assert all([log.title, log.citation, log.licence, log.addresses, log.by_hand])


@pytest.mark.parametrize(
    ("name", "folder"),
    [
        ("dlr", "dlr"),
        ("freiburg", "freiburg"),
        ("lost-in-the-woods", "lost_in_the_woods"),
        ("mrclam-6", "mrclam"),
    ],
)
def test_the_real_ones_are_what_the_catalogue_says(name: str, folder: str) -> None:
    assert main(["fetch", name, "--quiet", "--from", str(at_hand(folder))]) == 0
    assert main(["fetch", name, "--quiet", "--check"]) == 0


def test_the_raw_park_is_what_the_catalogue_says(tmp_path: Path) -> None:
    for packed in at_hand("victoria_park_raw").glob("*.dat.gz"):
        (tmp_path / packed.stem).write_bytes(gzip.decompress(packed.read_bytes()))
    assert main(["fetch", "victoria-park-raw", "--quiet", "--from", str(tmp_path)]) == 0
    assert len(slamduel.load("victoria-park-raw").log.ids) == 52974
