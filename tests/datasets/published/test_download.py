"""A download comes whole, or ends with a sentence, whatever the server does."""

from dataclasses import replace

import pytest

import publishers
import toy_log
from publishers import Behaviour, Ftp, Http, running
from slamduel.bench.cli import main
from slamduel.datasets.published import download
from slamduel.datasets.published.catalogue import PUBLISHED
from toy_log import LOG, Printed, Serve, assert_in_place, beside, refusal

quick = pytest.fixture(autouse=True)(toy_log.quick)
serve = pytest.fixture(toy_log.serve)


def test_an_honest_server(serve: Serve, capsys: Printed) -> None:
    server = serve()
    assert main(["fetch", "toy", "--url", server.url]) == 0
    assert_in_place()
    printed = capsys.readouterr()
    assert "every file has the sha256 of the published one" in printed.out
    assert printed.err == ""
    assert main(["fetch", "toy", "--url", server.url]) == 0
    assert "here already" in capsys.readouterr().out
    assert len(server.paths) == 1  # nothing was asked for again


PASSING = [publishers.drops, publishers.drops_a_chunk, publishers.stalls, *map(publishers.answers, (429, 500, 503))]


@pytest.mark.parametrize("fault", PASSING)
def test_a_passing_fault_is_waited_for(serve: Serve, fault: Behaviour) -> None:
    server = serve(fault, fault)
    assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert len(server.paths) == 3
    assert_in_place()


@pytest.mark.parametrize(
    ("fault", "wording"),
    [
        (publishers.answers(503), "503 Service Unavailable"),
        (publishers.drops, "the connection broke after 98,304 bytes"),
    ],
)
def test_a_lasting_fault_is_given_up(serve: Serve, capsys: Printed, fault: Behaviour, wording: str) -> None:
    server = serve(*[fault] * 10)
    assert f"\n  {server.url}: {wording}.\n" in refusal(capsys, "toy", "--url", server.url)
    assert len(server.paths) == 1 + download.RETRIES
    assert beside() == set()


@pytest.mark.parametrize("code", [401, 404])
def test_a_file_that_is_gone_is_asked_for_once(serve: Serve, capsys: Printed, code: int) -> None:
    server = serve(publishers.answers(code))
    text = refusal(capsys, "toy", "--url", server.url)
    assert f"{server.url}: {code} " in text
    assert "By hand: open http://example.org/logs , download log.zip, then: bench fetch toy --from FILE" in text
    assert len(server.paths) == 1


def test_redirects_are_followed_but_not_in_a_circle_or_to_a_file(serve: Serve, capsys: Printed) -> None:
    here = serve(publishers.answers(302, Location=serve().url))
    assert main(["fetch", "toy", "--quiet", "--url", here.url]) == 0
    assert_in_place()
    here.bad_days += [publishers.answers(302, Location=here.url)] * 50
    assert f"{here.url}: 302" in refusal(capsys, "toy", "--again", "--url", here.url)
    here.bad_days = [publishers.answers(302, Location="file:///etc/passwd")]
    assert "'file:///etc/passwd'" in refusal(capsys, "toy", "--again", "--url", here.url)
    assert_in_place()


def test_no_server_at_all(capsys: Printed) -> None:
    with running(server := Http(LOG)):
        pass
    assert f"{server.url}: Connection refused" in refusal(capsys, "toy", "--url", server.url)
    assert "http://nowhere.invalid/log.zip: " in refusal(capsys, "toy", "--url", "http://nowhere.invalid/log.zip")


@pytest.mark.parametrize("url", ["file:///etc/passwd", "log.zip", "http://", "http://[", "ftp://", "gopher://x/y"])
def test_an_address_that_is_none(capsys: Printed, url: str) -> None:
    assert f"{url}: " in refusal(capsys, "toy", "--url", url)


def test_an_ftp_server_that_breaks_off() -> None:
    with running(server := Ftp(LOG, 100_000, 60_000)):
        assert main(["fetch", "toy", "--quiet", "--url", server.url]) == 0
    assert server.sent == 3
    assert_in_place()


def test_a_file_that_an_ftp_server_does_not_have(capsys: Printed) -> None:
    with running(server := Ftp(LOG)):
        url = server.url.replace("log.zip", "none.zip")
        assert f"{url}: 550 no such file" in refusal(capsys, "toy", "--url", url)


def test_a_download_without_end(serve: Serve, capsys: Printed, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(PUBLISHED, "toy", replace(PUBLISHED["toy"], largest=100_000))
    server = serve()
    assert "more than 100,000 bytes" in refusal(capsys, "toy", "--url", server.url)
    assert len(server.paths) == 1
    assert beside() == set()
