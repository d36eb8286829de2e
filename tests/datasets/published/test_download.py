"""A download comes whole, or ends with a sentence, whatever the server does."""

from collections.abc import Callable

import pytest

import publishers
import toy_log
from publishers import Behaviour, Ftp, Http, running
from slamduel.bench.cli import main
from slamduel.datasets.published import download, installed
from slamduel.datasets.published.catalogue import place
from slamduel.datasets.published.download import Watcher
from toy_log import FILES, LOG, assert_files, assert_in_place, ranges, refusal, zipped

quick = pytest.fixture(autouse=True)(toy_log.quick)
serve = pytest.fixture(toy_log.serve)


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
    with installed.alone("toy", pytest.fail) as part:
        download.downloaded(server.url, part, Watcher())
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert ranges(server) == [None, f"bytes={len(LOG)}-"]  # answered with 416: nothing is left
    assert_in_place()


def test_a_part_longer_than_the_file_is_thrown_away(serve: Callable[..., Http]) -> None:
    server = serve()
    with installed.alone("toy", pytest.fail) as part:
        download.downloaded(server.url, part, Watcher())
        with part.open("ab") as file:
            file.write(b"more")
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert ranges(server)[2:] == [None]
    assert_in_place()


@pytest.mark.parametrize("note", ["", "{}", "[1]", '{"url": 3}', "\udcff"])
def test_a_damaged_note_beside_the_part(serve: Callable[..., Http], note: str) -> None:
    server = serve()
    with installed.alone("toy", pytest.fail) as part:
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
        with installed.alone("toy", pytest.fail) as part:
            download.downloaded(server.url, part, Watcher())
        assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert server.starts == [0]
    assert_in_place()


def test_a_part_longer_than_the_file_on_an_ftp_server() -> None:
    with running(server := Ftp(LOG)):
        with installed.alone("toy", pytest.fail) as part:
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


def test_a_download_without_end(
    serve: Callable[..., Http], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(download, "LARGEST", 100_000)
    server = serve()
    assert "more than 100,000 bytes" in refusal(capsys, "toy", "--url", server.url)
    assert len(server.requests) == 1
    assert {file.name for file in place("toy").parent.iterdir()} == {".toy.lock"}
