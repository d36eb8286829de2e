import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fuzzing import survivors
from refusals import refused
from slamduel.core import files
from slamduel.core.files import Rows, read_arrays, write_whole


def test_threads_that_write_one_file_do_not_meet(tmp_path: Path) -> None:
    together = threading.Barrier(8)

    def write(number: int) -> None:
        together.wait()
        for _ in range(20):
            write_whole(tmp_path / "file", f"{number}" * 10_000)

    with ThreadPoolExecutor(8) as threads:
        list(threads.map(write, range(8)))
    text = (tmp_path / "file").read_text()
    assert len(text) == 10_000
    assert len(set(text)) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_full_disk_is_named_with_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, content: bytes) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space left") as caught:
        write_whole(tmp_path / "log.png", b"content")
    assert caught.value.filename == str(tmp_path / "log.png")
    assert not list(tmp_path.iterdir())


def test_nothing_is_left_of_a_text_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("old")
    with pytest.raises(UnicodeEncodeError):
        write_whole(tmp_path / "file", "\ud800")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_arrays_of_a_damaged_file_are_read_or_refused(tmp_path: Path) -> None:
    """A flipped bit or a cut at any place of a compressed archive."""
    path = tmp_path / "some.npz"
    np.savez_compressed(path, a=np.arange(300.0), b=np.arange(40))
    (whole, same) = read_arrays(path, ("a", "b"), "numbers").values()
    assert (whole == np.arange(300)).all()
    assert (same == np.arange(40)).all()
    _, sentences = survivors(lambda file: read_arrays(file, ("a", "b"), "numbers"), path, 600, 0)
    assert len(sentences) > 300
    refused(r"some\.npz: .*c.*, expected a, c\.$", read_arrays, path, ("a", "c"), "numbers")


@pytest.mark.parametrize(("kind", "shape"), [("f8", ()), ("i2", (3,)), ([("a", "i8"), ("b", "f8", (2, 2))], ())])
def test_rows_are_read_as_they_were_added(kind: Any, shape: tuple[int, ...]) -> None:
    rows, rng = Rows(kind, *shape), np.random.default_rng(0)
    assert rows.all().shape == (0, *shape)
    size = np.dtype(kind).itemsize * int(np.prod(shape))
    added = [np.frombuffer(rng.bytes(k * size), kind).reshape(k, *shape) for k in (3, 0, 1000)]
    rows.add(added[0])
    before = rows.all()
    for part in added[1:]:
        rows.add(part)
    after = rows.all()
    del rows  # what was read stays
    assert before.tobytes() == added[0].tobytes()
    assert after.dtype == np.dtype(kind)
    assert after.shape == (1003, *shape)
    assert after.tobytes() == b"".join(part.tobytes() for part in added)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_rows_without_room_name_the_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "TemporaryFile", lambda: Path("/dev/full").open("wb"))  # noqa: SIM115
    with pytest.raises(OSError, match="No space left on device") as refused:
        Rows(np.int16, 3).add(np.ones((4, 3)))
    assert refused.value.filename == tempfile.gettempdir()
