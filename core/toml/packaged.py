"""Reads a TOML file that the package brings, by its name, or any other by its path."""

from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError, nearest


def read_named(which: str, folder: Path, names: Sequence[str], noun: str) -> tuple[Path, str]:
    """Reads NAME.toml in `folder` if `which` is one of its `names`, else the file at that path: its path and text.

    InputError where it cannot be read, with the `noun` for what was expected and the name that may be meant.
    """
    path = folder / f"{which}.toml" if which in names else Path(which)
    try:
        return path, path.read_text(encoding="utf-8-sig")  # an editor may have put a mark before it
    except (OSError, ValueError) as error:
        said = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        hint = nearest(which.removesuffix(".toml"), names).removeprefix("expected ")
        raise InputError(f"{which}: {said}; expected a {noun} file, or the name of a packaged one: {hint}") from None
