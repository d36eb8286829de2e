"""Locks a folder for one process, and makes it where it does not exist."""

import contextlib
import fcntl
import os
from collections.abc import Generator
from pathlib import Path

from ...core.errors import InputError

LOCK = ".lock"


@contextlib.contextmanager
def claimed(folder: Path) -> Generator[None]:
    """Locks the folder, made if needed; a folder made here that stays empty is removed again."""
    made = _make(folder)
    lock = _locked(folder)
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            (folder / LOCK).unlink()
        os.close(lock)
        for path in made:
            with contextlib.suppress(OSError):  # not empty
                path.rmdir()


def _locked(folder: Path) -> int:
    while True:
        try:
            lock = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT)
        except OSError as error:
            raise InputError(
                f"--out {folder}: cannot be written to ({error.strerror}); expected a writable folder."
            ) from None
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_at(folder / LOCK, lock):
                return lock
            os.close(lock)  # its last holder removed it in between
        except OSError:
            os.close(lock)
            raise InputError(
                f"--out {folder}: another run or study writes to it; wait for its end, or choose another --out."
            ) from None


def _is_at(path: Path, descriptor: int) -> bool:
    with contextlib.suppress(FileNotFoundError):
        return os.path.samestat(os.stat(path), os.fstat(descriptor))
    return False


def _make(folder: Path) -> list[Path]:
    """Makes the folder and its missing parents; returns those that were made, the innermost first."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {folder}: cannot be made ({error.strerror}); expected a place to write to.") from None
    return missing
