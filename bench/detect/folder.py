"""Writes the folder of a detection, whole or not at all: the log, its page and the sensor's own files."""

import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple, TypeVar

from ...core.errors import InputError
from ...datasets.formats import log_folder
from ...datasets.remarks import refuse
from .findings import Findings
from .page import FILES, PAGE, write_page
from .preview import Preview

F = TypeVar("F", bound=Findings)
Frame = TypeVar("Frame")


class Request(NamedTuple):
    """The options of a detection."""

    source: str  # the recording, as the user named it
    out: Path
    preview: Preview | None = None  # of a camera's recording
    seconds: float | None = None  # of the recording, at most
    calibrate_noise: bool = False  # of a recording of markers
    strict: bool = False  # a log with a remark is refused
    poses: Path | None = None  # file for the tags' poses, of a recording of markers

    def first(self, frames: Iterable[Frame], time: Callable[[Frame], float]) -> Iterator[Frame]:
        """Yields the frames of the first `seconds`; `time` is that of a frame, s."""
        start = None
        for frame in frames:
            start = time(frame) if start is None else start
            if self.seconds is not None and time(frame) - start > self.seconds:
                return
            yield frame


def check_place(out: Path) -> None:
    """Raises InputError unless `out` is new, empty, or the folder of an earlier detection with nothing added."""
    if out.is_symlink():
        raise InputError(f"--out {out}: is a link, expected the folder itself, or a new place.")
    if not out.exists():
        return
    if not out.is_dir():
        raise InputError(f"--out {out}: is a file, expected a folder for the log.")
    names = {path.name for path in out.iterdir()}
    if names and not {"log.toml", PAGE} <= names:
        raise InputError(f"--out {out}: is not empty and not of an earlier bench detect; expected a new place.")
    strangers = sorted(names - {PAGE, *FILES})
    if strangers:
        raise InputError(f"--out {out}: has {strangers[0]}, which bench detect did not write; expected a new place.")


def written(request: Request, findings: F) -> F:
    """Writes the folder beside its place, then replaces an earlier one; returns the findings.

    InputError where that is impossible, and for a remark if strict.
    """
    out = request.out
    if request.strict:
        refuse(request.source, findings.remarks)
    check_place(out)
    place = out.absolute()
    beside, former = (place.with_name(f".{place.name}.{os.getpid()}.{word}") for word in ("new", "old"))
    try:
        log_folder.write(beside, findings.log, findings.truth)
        write_page(beside, out, findings)
        if place.exists():
            os.replace(place, former)
        os.replace(beside, place)
    except OSError as error:
        if former.exists() and not place.exists():
            os.replace(former, place)
        raise InputError(f"--out {out}: cannot be written ({error.strerror}).") from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)
        shutil.rmtree(former, ignore_errors=True)
    return findings
