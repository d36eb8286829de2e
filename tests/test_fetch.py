"""Published logs arrive whole, checked and at once, or not at all with a sentence, whatever the server does."""

import contextlib
import gzip
import hashlib
import io
import os
import re
import resource
import signal
import subprocess
import sys
import tarfile
import threading
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import publishers
from publishers import Behaviour, Ftp, Http, running
from slamduel.bench.cli import main
from slamduel.datasets import download, shelf, unpack
from slamduel.datasets.download import Watcher
from slamduel.datasets.fetch import fetch
from slamduel.datasets.published import PUBLISHED, Published, fetched, place
from slamduel.frontend.errors import InputError

FILES = {
    name: np.random.default_rng(seed).bytes(size)
    for seed, (name, size) in enumerate({"path.dat": 200_000, "marks.dat": 40_000}.items())
}


def sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def zipped(files: dict[str, bytes], folder: str = "Published_Log/") -> bytes:
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(f"{folder}README", "other files are passed over")
        for name, content in files.items():
            archive.writestr(folder + name, content)
    return target.getvalue()


def tarred(files: dict[str, bytes], mode: str = "w:gz") -> bytes:
    target = io.BytesIO()
    with tarfile.open(fileobj=target, mode=mode) as archive:  # pyright: ignore[reportCallIssue, reportArgumentType]
        for name, content in {"README": b"passed over", **files}.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    return target.getvalue()


LOG = zipped(FILES)


def entry(*urls: str, files: dict[str, str | None] | None = None, link: str = "") -> Published:
    return Published(
        title="a log for these tests",
        citation="Nobody, 2024",
        licence="none",
        page="http://example.org/logs",
        urls=urls,
        addresses="made up",
        by_hand="download log.zip",
        files={name: sha256(content) for name, content in FILES.items()} if files is None else files,
        link=link,
    )


@pytest.fixture(autouse=True)
def quick(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cache, waits and a catalogue of these tests' own."""
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(download, "PAUSE", 0.001)
    monkeypatch.setattr(download, "TIMEOUT", 0.3)
    monkeypatch.setitem(PUBLISHED, "toy", entry())


@pytest.fixture
def serve() -> Iterator[Callable[..., Http]]:
    """Start an HTTP server of `content` with the bad days given."""
    with contextlib.ExitStack() as stack:

        def start(*bad_days: Behaviour, content: bytes = LOG) -> Http:
            server = Http(content, *bad_days)
            stack.enter_context(running(server))
            return server

        yield start


def assert_in_place(name: str = "toy", files: dict[str, bytes] = FILES) -> None:
    """The log's files, byte for byte, their sums, and nothing else anywhere in the cache but the lock."""
    found = {file.name: file.read_bytes() for file in place(name).iterdir()}
    sums = found.pop("SHA256SUMS").decode()
    assert found == files
    for file, content in files.items():
        assert f"{sha256(content)}  {file}\n" in sums
    assert {file.name for file in place(name).parent.iterdir()} == {name, f".{name}.lock"}


def assert_files(name: str = "toy") -> None:
    """The log's files, byte for byte, whatever else there is."""
    assert {file: (place(name) / file).read_bytes() for file in FILES} == FILES


def refusal(capsys: pytest.CaptureFixture[str], *words: str | Path) -> str:
    """The sentences with which the command ends, with status 2."""
    capsys.readouterr()
    assert main(["fetch", "--quiet", *map(str, words)]) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("bench: ")
    assert "Traceback" not in printed.err
    return printed.err


def ranges(server: Http) -> list[str | None]:
    return [span for _, span in server.requests]


# ---------------------------------------------------------------------------------------------- a server and its days


def test_an_honest_server(serve: Callable[..., Http], capsys: pytest.CaptureFixture[str]) -> None:
    server = serve()
    assert main(["fetch", "toy", "--url", server.url]) == 0
    assert_in_place()
    assert ranges(server) == [None]
    assert "every file has the sha256 of the published one" in capsys.readouterr().out
    assert main(["fetch", "toy", "--url", server.url]) == 0
    assert "here already" in capsys.readouterr().out
    assert len(server.requests) == 1  # nothing was asked for again


def test_a_connection_that_drops_is_gone_on_with(serve: Callable[..., Http]) -> None:
    server = serve(publishers.drops(100_000), publishers.drops(60_000))
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert ranges(server) == [None, "bytes=100000-", "bytes=160000-"]
    assert_in_place()


def test_a_later_call_goes_on_where_an_earlier_one_gave_up(
    serve: Callable[..., Http], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    server = serve(publishers.drops(100_000))
    with monkeypatch.context() as impatient:
        impatient.setattr(download, "TRIES", 1)
        text = refusal(capsys, "toy", "--url", server.url)
    assert f"{server.url}: 100,000 of {len(LOG):,} bytes arrived" in text
    assert not place("toy").exists()
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert ranges(server) == [None, "bytes=100000-"]
    assert_in_place()


def test_what_came_from_another_address_is_not_gone_on_with(
    serve: Callable[..., Http], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(download, "TRIES", 1)
    cut, other = serve(publishers.drops(100_000)), serve()
    refusal(capsys, "toy", "--url", cut.url)
    assert main(["fetch", "toy", "--quiet", "--url", other.url]) == 0
    assert ranges(other) == [None]
    assert_in_place()


@pytest.mark.parametrize(
    ("second", "expected"),
    [
        (publishers.ignores_range, [None, "bytes=100000-"]),
        (publishers.starts_elsewhere, [None, "bytes=100000-", None]),
    ],
)
def test_a_server_that_does_not_heed_range(
    serve: Callable[..., Http], second: Behaviour, expected: list[str | None]
) -> None:
    server = serve(publishers.drops(100_000), second)
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert ranges(server) == expected
    assert_in_place()


def test_a_weak_tag_is_no_ground_to_go_on_from(serve: Callable[..., Http]) -> None:
    server = serve(publishers.drops_with_a_weak_tag(100_000))
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert ranges(server) == [None, None]
    assert_in_place()


@pytest.mark.parametrize("heeds", [True, False])
def test_a_file_that_changes_between_two_tries(serve: Callable[..., Http], heeds: bool) -> None:
    older = zipped({name: content[::-1] for name, content in FILES.items()})
    change = publishers.drops_and_then_the_file_changes(100_000, LOG)
    careless = [] if heeds else [lambda request: publishers.honest(request, heed_if_range=False)]
    server = serve(change, *careless, content=older)
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert ranges(server) == [None, "bytes=100000-"] + [None] * (not heeds)
    assert_in_place()


def test_a_download_that_was_whole_when_the_process_died(serve: Callable[..., Http]) -> None:
    server = serve()
    with shelf.alone("toy", pytest.fail) as part:
        download.downloaded(server.url, part, Watcher())
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert ranges(server) == [None, f"bytes={len(LOG)}-"]  # answered with 416: nothing is left
    assert_in_place()


def test_a_part_longer_than_the_file_is_thrown_away(serve: Callable[..., Http]) -> None:
    server = serve()
    with shelf.alone("toy", pytest.fail) as part:
        download.downloaded(server.url, part, Watcher())
        with part.open("ab") as file:
            file.write(b"more")
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert ranges(server)[2:] == [None]
    assert_in_place()


@pytest.mark.parametrize("note", ["", "{}", "[1]", '{"url": 3}', "\udcff"])
def test_a_damaged_note_beside_the_part(serve: Callable[..., Http], note: str) -> None:
    server = serve()
    with shelf.alone("toy", pytest.fail) as part:
        part.write_bytes(LOG[:1000])
        part.with_name(f"{part.name}.note").write_bytes(note.encode(errors="surrogateescape"))
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert ranges(server) == [None]
    assert_in_place()


@pytest.mark.parametrize("after", [None, 100_000])
def test_a_server_that_does_not_tell_the_length(serve: Callable[..., Http], after: int | None) -> None:
    server = serve(publishers.chunked(after))
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert len(server.requests) == (1 if after is None else 2)
    assert_in_place()


@pytest.mark.parametrize("code", [500, 502, 503, 429])
def test_a_passing_fault_is_waited_for(serve: Callable[..., Http], code: int) -> None:
    server = serve(publishers.answers(code), publishers.answers(code))
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert len(server.requests) == 3
    assert_in_place()


def test_a_lasting_fault_is_given_up(serve: Callable[..., Http], capsys: pytest.CaptureFixture[str]) -> None:
    server = serve(*[publishers.answers(503)] * 10)
    text = refusal(capsys, "toy", "--url", server.url)
    assert f"{server.url}: 503 Service Unavailable, at the last of 5 tries" in text
    assert len(server.requests) == download.TRIES
    assert not place("toy").exists()


@pytest.mark.parametrize("code", [401, 403, 404, 410])
def test_a_file_that_is_gone_is_asked_for_once(
    serve: Callable[..., Http], capsys: pytest.CaptureFixture[str], code: int
) -> None:
    server = serve(publishers.answers(code))
    text = refusal(capsys, "toy", "--url", server.url)
    assert f"{server.url}: {code} " in text
    assert "By hand: open http://example.org/logs , download log.zip, then: bench fetch toy --from FILE" in text
    assert len(server.requests) == 1


def test_redirects_are_followed_and_a_circle_of_them_is_not(
    serve: Callable[..., Http], capsys: pytest.CaptureFixture[str]
) -> None:
    there = serve(publishers.drops(100_000))
    aside = publishers.answers(302, Location=there.url)
    here = serve(aside, aside)
    assert main(["fetch", "toy", "--quiet", "--url", here.url]) == 0
    assert ranges(there) == [None, "bytes=100000-"]  # a redirect keeps what was asked for
    assert_in_place()
    circle = serve()
    circle.bad_days += [publishers.answers(302, Location=circle.url)] * 50
    assert f"{circle.url}: 302" in refusal(capsys, "toy", "--again", "--url", circle.url)
    out = serve(publishers.answers(302, Location="file:///etc/passwd"))
    assert f"{out.url}: 302" in refusal(capsys, "toy", "--again", "--url", out.url)
    assert_files()


@pytest.mark.parametrize("slow", [publishers.stalls, publishers.trickles])
def test_a_server_that_is_slow_to_death(serve: Callable[..., Http], slow: Behaviour) -> None:
    server = serve(slow)
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert len(server.requests) == 2
    assert 0 < int((ranges(server)[1] or "").strip("bytes=-")) < 1000  # 1000 come from the one that trickles, in 20 s
    assert_in_place()


def test_no_server_at_all(capsys: pytest.CaptureFixture[str]) -> None:
    with running(server := Http(LOG)):
        pass
    assert f"{server.url}: Connection refused" in refusal(capsys, "toy", "--url", server.url)
    assert "nowhere.invalid" in refusal(capsys, "toy", "--url", "http://nowhere.invalid/log.zip")


@pytest.mark.parametrize("url", ["file:///etc/passwd", "log.zip", "http://", "http://[", "ftp://", "gopher://x/y"])
def test_an_address_that_is_none(capsys: pytest.CaptureFixture[str], url: str) -> None:
    assert f"{url}: " in refusal(capsys, "toy", "--url", url)


# ------------------------------------------------------------------------------------------------ what is not the log


def hostile(path: str) -> bytes:
    return zipped(FILES, folder=path)


BAD = {
    "garbage": (np.random.default_rng(9).bytes(5000), "found something else"),
    "nothing": (b"", "found something else"),
    "a page": (b" \n<!DOCTYPE html><html>We have moved.</html>", "a web page, not the published file"),
    "cut off": (LOG[:-30], "cut off or damaged"),
    "a flipped bit": (LOG[:150_000] + bytes([LOG[150_000] ^ 4]) + LOG[150_001:], "a damaged archive (Bad CRC-32"),
    "a file is missing": (zipped({"path.dat": FILES["path.dat"]}), "marks.dat should be in it, and is not"),
    "another file": (zipped({**FILES, "marks.dat": b"else"}), "its marks.dat is not the published one: sha256"),
    "a way out": (hostile("../../"), "'../../README', which leads out of it"),
    "the root": (hostile("/etc/"), "'/etc/README', which leads out of it"),
    "a drive": (hostile("C:\\log\\"), "which leads out of it"),
    "a way out of a tar": (tarred({"../path.dat": b""}), "'../path.dat', which leads out of it"),
    "a cut tar": (tarred(FILES)[:100_000], "a damaged archive"),
    "a gzip of no tar": (gzip.compress(b"hello" * 500), "a damaged archive"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_not_the_log_is_turned_down(
    serve: Callable[..., Http], capsys: pytest.CaptureFixture[str], case: str
) -> None:
    content, wording = BAD[case]
    server = serve(publishers.sends(content))
    text = refusal(capsys, "toy", "--url", server.url)
    assert text.startswith(f"bench: toy could not be fetched:\n  {server.url}: ")
    assert wording in text
    assert {file.name for file in place("toy").parent.iterdir()} == {".toy.lock"}  # nothing of it is kept
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert ranges(server) == [None, None]  # and nothing gone on with
    assert_in_place()


def test_a_bad_new_one_leaves_the_old_one(serve: Callable[..., Http], capsys: pytest.CaptureFixture[str]) -> None:
    server = serve(publishers.ignores_range, publishers.sends(BAD["another file"][0]))
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    refusal(capsys, "toy", "--again", "--url", server.url)
    assert_in_place()
    assert main(["fetch", "toy", "--quiet", "--again", "--url", server.url]) == 0
    assert_in_place()


@pytest.mark.parametrize("pack", [zipped, tarred])
def test_a_bomb(
    serve: Callable[..., Http],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    pack: Callable[..., bytes],
) -> None:
    monkeypatch.setattr(unpack, "LARGEST_FILE", 1_000_000)
    server = serve(content=pack({**FILES, "path.dat": bytes(3_000_000)}))
    assert len(server.content) < 60_000
    assert "path.dat: grows beyond 1,000,000 bytes" in refusal(capsys, "toy", "--url", server.url)
    assert {file.name for file in place("toy").parent.iterdir()} == {".toy.lock"}


def test_a_bomb_in_a_part_of_a_tar_that_is_passed_over(
    serve: Callable[..., Http], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unpack, "LARGEST_ARCHIVE", 1_000_000)
    server = serve(content=tarred({"pictures": bytes(3_000_000), **FILES}))
    assert f"{server.url}: grows beyond 1,000,000 bytes" in refusal(capsys, "toy", "--url", server.url)


def test_a_download_without_end(
    serve: Callable[..., Http], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(download, "LARGEST", 100_000)
    server = serve()
    assert "more than 100,000 bytes" in refusal(capsys, "toy", "--url", server.url)
    assert len(server.requests) == 1
    assert {file.name for file in place("toy").parent.iterdir()} == {".toy.lock"}


def test_two_files_of_one_name(serve: Callable[..., Http], capsys: pytest.CaptureFixture[str]) -> None:
    twice = zipped({"older/path.dat": b"of another sheet", **FILES, "newer/path.dat": b"of a third"})
    assert main(["fetch", "toy", "--quiet", "--url", serve(content=twice).url]) == 0
    assert_in_place()  # the sha256 tells which is meant
    PUBLISHED["toy"] = entry(files=dict.fromkeys(FILES))
    assert "two different files path.dat" in refusal(capsys, "toy", "--again", "--url", serve(content=twice).url)


# ------------------------------------------------------------------------------------------------------ FTP, and pages


def test_an_ftp_server_that_drops_connections() -> None:
    with running(server := Ftp(LOG, 100_000, 60_000)):
        assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert server.starts == [0, 100_000, 160_000]
    assert_in_place()


def test_a_file_that_changes_on_an_ftp_server(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with running(server := Ftp(LOG[::-1], 100_000)):
        with monkeypatch.context() as impatient:
            impatient.setattr(download, "TRIES", 1)
            refusal(capsys, "toy", "--url", server.url)
        server.content, server.modified = LOG, "20120101000000"
        assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert server.starts == [0, 0]
    assert_in_place()


def test_a_whole_part_is_not_asked_for_again_by_ftp() -> None:
    with running(server := Ftp(LOG)):
        with shelf.alone("toy", pytest.fail) as part:
            download.downloaded(server.url, part, Watcher())
        assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert server.starts == [0]
    assert_in_place()


def test_a_part_longer_than_the_file_on_an_ftp_server() -> None:
    with running(server := Ftp(LOG)):
        with shelf.alone("toy", pytest.fail) as part:
            download.downloaded(server.url, part, Watcher())
            with part.open("ab") as file:
                file.write(b"more")
        assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert server.starts == [0, 0]
    assert_in_place()


def test_a_file_that_an_ftp_server_does_not_have(capsys: pytest.CaptureFixture[str]) -> None:
    with running(server := Ftp(LOG)):
        url = server.url.replace("log.zip", "none.zip")
        assert f"{url}: 550 no such file" in refusal(capsys, "toy", "--url", url)
    assert server.starts == []


def test_the_addresses_are_tried_in_order(serve: Callable[..., Http], capsys: pytest.CaptureFixture[str]) -> None:
    gone, page, good = serve(publishers.answers(404)), serve(publishers.sends(BAD["a page"][0])), serve()
    PUBLISHED["toy"] = entry(gone.url, page.url, good.url)
    assert main(["fetch", "toy"]) == 0
    assert_in_place()
    assert f"# from {good.url}\n" in (place("toy") / "SHA256SUMS").read_text()
    PUBLISHED["toy"] = entry(gone.url, page.url)
    gone.bad_days, page.bad_days = [publishers.answers(404)], [publishers.sends(BAD["a page"][0])]
    text = refusal(capsys, "toy", "--again")
    assert f"  {gone.url}: 404 Not Found\n  {page.url}: a web page, not the published file.\n" in text
    assert "About these addresses: made up.\nBy hand: open " in text


def test_the_links_on_a_page_are_tried(serve: Callable[..., Http], capsys: pytest.CaptureFixture[str]) -> None:
    archives = serve()
    archives.bad_days = [publishers.answers(404)]
    base = archives.url.removesuffix("log.zip")
    links = (
        f"<a href=\"{base}sheet04.pdf\">4</a> <A HREF='{base}EKF_1.tar.gz'>x</A> <a href={base}a/ekf&amp;2.zip>y</a>"
    )
    page = serve(publishers.sends(b"<!doctype html>" + links.encode()))
    PUBLISHED["toy"] = entry(page.url, link=PUBLISHED["freiburg"].link)
    assert main(["fetch", "toy", "--quiet"]) == 0
    assert [path for path, _ in archives.requests] == ["/EKF_1.tar.gz", "/a/ekf&2.zip"]
    assert_in_place()
    page.bad_days = [publishers.sends(b"<!doctype html> moved")]
    assert f"{page.url}: no link to the archive was recognised on it\n" in refusal(capsys, "toy", "--again")


# ----------------------------------------------------------------------------------------------- by hand, and the cache


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


def test_one_file_got_by_hand_is_enough_for_a_log_of_one_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "renamed"
    source.write_bytes(FILES["path.dat"])
    PUBLISHED["toy"] = entry(files={"path.dat": sha256(FILES["path.dat"])})
    assert main(["fetch", "toy", "--quiet", "--from", str(source)]) == 0
    assert_in_place(files={"path.dat": FILES["path.dat"]})
    source.write_bytes(b"else")
    assert "its path.dat is not the published one" in refusal(capsys, "toy", "--from", source)
    assert_in_place(files={"path.dat": FILES["path.dat"]})


def test_what_was_got_by_hand_is_checked_alike(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for content, wording in BAD.values():
        (source := tmp_path / "by_hand").write_bytes(content)
        text = refusal(capsys, "toy", "--from", source)
        assert text.startswith(f"bench: {source}")
        assert wording in text
    assert "there is no such file or folder" in refusal(capsys, "toy", "--from", tmp_path / "none")
    assert not place("toy").exists()


def test_check_finds_what_has_changed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "toy is not on this machine: bench fetch toy gets it" in refusal(capsys, "toy", "--check")
    (source := tmp_path / "log.zip").write_bytes(LOG)
    assert main(["fetch", "toy", "--from", str(source)]) == 0
    assert main(["fetch", "--check"]) == 0
    assert "toy: as published" in capsys.readouterr().out
    (place("toy") / "path.dat").write_bytes(b"touched")
    text = refusal(capsys, "toy", "--check")
    assert f"path.dat: its sha256 is {sha256(b'touched')}; published: {sha256(FILES['path.dat'])}" in text
    assert "bench fetch toy --again gets toy anew" in text
    (place("toy") / "path.dat").unlink()
    assert "path.dat: No such file" in refusal(capsys, "toy", "--check")


def test_digests_that_nobody_knows_are_recorded_printed_and_checked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
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


def test_a_log_that_is_incomplete_is_fetched_anew(serve: Callable[..., Http], tmp_path: Path) -> None:
    place("toy").mkdir(parents=True)
    (place("toy") / "path.dat").write_bytes(b"half of it")
    assert main(["fetch", "toy", "--quiet", "--url", serve().url]) == 0
    assert_in_place()


def test_a_swap_that_was_interrupted_is_undone(tmp_path: Path) -> None:
    (source := tmp_path / "log.zip").write_bytes(LOG)
    assert main(["fetch", "toy", "--quiet", "--from", str(source)]) == 0
    place("toy").rename(place("toy").with_name(".toy.old"))  # as a process leaves it that is killed between two renames
    (place("toy").with_name(".toy.new")).mkdir()
    assert main(["fetch", "toy"]) == 0  # no server was needed
    assert_files()


def test_a_cache_that_cannot_be_written_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_bytes(b"")
    (source := tmp_path / "log.zip").write_bytes(LOG)
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path / "file"))
    text = refusal(capsys, "toy", "--from", source)
    assert (
        "Not a directory; toy goes into the cache folder, which the environment variable SLAMDUEL_CACHE moves" in text
    )


@pytest.mark.parametrize(
    ("word", "wording"),
    [("--url", ".toy.part: what arrives cannot be written (File too large)"), ("--from", ".toy.new: File too large")],
)
def test_a_disk_that_is_full(
    serve: Callable[..., Http], tmp_path: Path, capsys: pytest.CaptureFixture[str], word: str, wording: str
) -> None:
    (source := tmp_path / "log.zip").write_bytes(LOG)
    server = serve()
    given = server.url if word == "--url" else source
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, hard))  # no file may grow beyond that
    try:
        text = refusal(capsys, "toy", word, given)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert wording in text
    assert len(server.requests) <= 1  # the disk is not asked again and again
    assert not place("toy").exists()
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert_in_place()


# ---------------------------------------------------------------------------------------------------- several at a time


def test_two_at_once_download_it_once(serve: Callable[..., Http]) -> None:
    server = serve(publishers.stalls)  # long enough for the second one to find the first at it
    said: list[str] = []

    class Listening(Watcher):
        def says(self, sentence: str) -> None:
            said.append(sentence)

    outcomes: list[object] = []
    fetching = [
        threading.Thread(target=lambda: outcomes.append(fetch("toy", Listening(), url=server.url))) for _ in range(2)
    ]
    for thread in fetching:
        thread.start()
    for thread in fetching:
        thread.join()
    assert sum(outcome is None for outcome in outcomes) == 1
    assert len(outcomes) == 2
    assert "toy: another process is fetching it; waiting for that one" in said
    assert len(server.requests) == 2  # the one that stalled and the one that went on
    assert_in_place()


MRCLAM_1 = {name: np.random.default_rng(len(name)).bytes(20_000) for name in PUBLISHED["mrclam-1"].files}


def test_a_process_that_is_killed_and_the_next_one(serve: Callable[..., Http]) -> None:
    server = serve(publishers.stalls, content=zipped(MRCLAM_1, "MRSLAM_Dataset1/"))
    command = [sys.executable, "-m", "slamduel.bench.cli", "fetch", "mrclam-1", "--url", server.url]
    part = place("mrclam-1").with_name(".mrclam-1.part")
    with subprocess.Popen(command, stderr=subprocess.PIPE) as process:
        until = time.monotonic() + 20
        while not (part.exists() and part.stat().st_size) and time.monotonic() < until:
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
    received = part.stat().st_size
    assert received == 500
    assert main(["fetch", "mrclam-1", "--quiet", "--url", server.url]) == 0
    assert ranges(server) == [None, f"bytes={received}-"]
    assert_in_place("mrclam-1", MRCLAM_1)


def test_two_processes_at_once(serve: Callable[..., Http]) -> None:
    server = serve(content=zipped(MRCLAM_1))
    command = [sys.executable, "-m", "slamduel.bench.cli", "fetch", "mrclam-1", "--quiet", "--url", server.url]
    both = [subprocess.Popen(command) for _ in range(2)]
    assert [process.wait(60) for process in both] == [0, 0]
    assert len(server.requests) == 1
    assert_in_place("mrclam-1", MRCLAM_1)


# ------------------------------------------------------------------------------------------- the command, the catalogue


def test_the_list_says_what_is_here(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (source := tmp_path / "log.zip").write_bytes(LOG)
    main(["fetch", "toy", "--quiet", "--from", str(source)])
    place("dlr").mkdir()
    assert main(["fetch"]) == 0
    listed = capsys.readouterr().out
    assert re.search(r"^toy +0\.2 MB +a log for these tests", listed, re.MULTILINE)
    assert re.search(r"^dlr +incomplete", listed, re.MULTILINE)
    assert all(re.search(rf"^{name} +-", listed, re.MULTILINE) for name in PUBLISHED if name not in ("toy", "dlr"))


def test_one_that_fails_does_not_stop_the_others(
    serve: Callable[..., Http], capsys: pytest.CaptureFixture[str]
) -> None:
    good, gone = serve(), serve(publishers.answers(404))
    PUBLISHED["toy"] = entry(gone.url)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(PUBLISHED, "second", entry(good.url))
        assert "toy could not be fetched" in refusal(capsys, "toy", "second")
        assert_files("second")


@pytest.mark.parametrize(
    ("words", "wording"),
    [
        (["none"], "there is no such published log; there are dlr, freiburg, mrclam-1"),
        (["--url", "http://x"], "--url is for one published log; found 0 names"),
        (["toy", "dlr", "--from", "x"], "--from is for one published log; found 2 names"),
        (["toy", "--from", "x", "--url", "y"], "--from and --url do not go together"),
        (["toy", "--check", "--again"], "--check and --again do not go together"),
    ],
)
def test_words_that_make_no_sense(capsys: pytest.CaptureFixture[str], words: list[str], wording: str) -> None:
    assert wording in refusal(capsys, *words)


def test_a_log_that_is_not_here_names_the_command() -> None:
    with pytest.raises(InputError, match=r"toy is not on this machine: bench fetch toy gets it, toy\[path=X\] names a"):
        fetched("toy", "toy[path=X]")


def test_the_catalogue_is_complete() -> None:
    assert [name for name in PUBLISHED if name != "toy"] == ["dlr", "freiburg", *(f"mrclam-{n}" for n in range(1, 10))]
    for name, log in PUBLISHED.items():
        if name != "toy":
            assert log.urls
            assert all(re.match(r"(https?|ftp)://", url) for url in [log.page, *log.urls])
            assert all(digest is None or re.fullmatch("[0-9a-f]{64}", digest) for digest in log.files.values())
            assert all([log.title, log.citation, log.licence, log.addresses, log.by_hand])


@pytest.mark.parametrize(("name", "folder"), [("dlr", "dlr"), ("freiburg", "freiburg"), ("mrclam-6", "mrclam")])
def test_the_real_ones_are_what_the_catalogue_says(name: str, folder: str) -> None:
    root = os.environ.get("SLAMDUEL_DATA")
    if not root:
        pytest.skip("SLAMDUEL_DATA is not set: no copies of the published logs")
    assert main(["fetch", name, "--quiet", "--from", str(Path(root) / folder)]) == 0
    assert main(["fetch", name, "--quiet", "--check"]) == 0
