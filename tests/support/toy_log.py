"""A small published log for tests: its files, archives of them, and checks of a fetch.

`quick` and `serve` become fixtures in the files that use them.
"""

import contextlib
import hashlib
import io
import tarfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pytest

from publishers import Behaviour, Http, running
from slamduel.bench.cli import main
from slamduel.datasets.published import download
from slamduel.datasets.published.catalogue import PUBLISHED, Published, place

Serve: TypeAlias = Callable[..., Http]
Printed: TypeAlias = pytest.CaptureFixture[str]

FILES = {
    name: np.random.default_rng(seed).bytes(size)
    for seed, (name, size) in enumerate({"path.dat": 200_000, "marks.dat": 40_000}.items())
}


def sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def zipped(files: dict[str, bytes], folder: str = "Published_Log/") -> bytes:
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(f"{folder}README", "other files are skipped")
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


def quick(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cache and a catalogue for these tests, without waits."""
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("time.sleep", lambda seconds: None)
    monkeypatch.setattr(download, "TIMEOUT", 0.3)
    monkeypatch.setitem(PUBLISHED, "toy", entry())


def serve() -> Iterator[Serve]:
    """Starts an HTTP server of `content` with the given bad days."""
    with contextlib.ExitStack() as stack:

        def start(*bad_days: Behaviour, content: bytes = LOG) -> Http:
            server = Http(content, *bad_days)
            stack.enter_context(running(server))
            return server

        yield start


def beside(name: str = "toy") -> set[str]:
    """Everything in the folder of the published logs."""
    return {file.name for file in place(name).parent.glob("*")}


def assert_in_place(name: str = "toy", files: dict[str, bytes] = FILES) -> None:
    """Asserts that the log's files and their checksums are in place, and nothing else is beside them."""
    found = {file.name: file.read_bytes() for file in place(name).iterdir()}
    sums = found.pop("SHA256SUMS").decode()
    assert found == files
    for file, content in files.items():
        assert f"{sha256(content)}  {file}\n" in sums
    assert beside(name) == {name}


def refusal(capsys: Printed, *words: str | Path) -> str:
    """The sentences with which the command ends, with status 2."""
    capsys.readouterr()
    assert main(["fetch", "--quiet", *map(str, words)]) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("bench: ")
    assert "Traceback" not in printed.err
    assert all(line.endswith((".", " could not be fetched:")) for line in printed.err.splitlines())
    return printed.err
