"""New folders for recordings: they appear complete or not at all."""

import os
import shutil
from collections.abc import Collection, Generator
from contextlib import contextmanager
from pathlib import Path

from ...core.errors import InputError


@contextmanager
def new_folders(places: Collection[Path]) -> Generator[dict[Path, Path]]:
    """Gives a folder to write to for each of the `places`, and moves it there at the end.

    A place must not exist or be an empty folder. InputError if one is not, or cannot be written.
    """
    beside = {folder: folder.absolute().parent / f".{folder.absolute().name}.{os.getpid()}.part" for folder in places}
    place = next(iter(places))
    try:
        for place in places:
            if place.exists() and (not place.is_dir() or any(place.iterdir())):
                raise InputError(f"{place}: exists and is not an empty folder; expected a new place for the recording.")
            beside[place].mkdir(parents=True)
        yield beside
        for place in places:
            os.replace(beside[place], place)
    except OSError as error:
        raise InputError(f"{place}: cannot be written ({error.strerror or error}).") from error
    finally:
        for part in beside.values():
            shutil.rmtree(part, ignore_errors=True)
