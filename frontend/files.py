"""Files that are there whole or not at all."""

import contextlib
import os
import secrets
from pathlib import Path


def write_whole(path: Path, text: str) -> None:
    """Put `text` in the file at `path`, whatever was there before; a reader sees the old or the new, never a part."""
    part = beside(path)
    try:
        part.write_text(text, encoding="utf-8")
        os.replace(part, path)
    except BaseException:
        with contextlib.suppress(OSError):
            part.unlink()
        raise


def beside(path: Path) -> Path:
    """A hidden place next to `path` that no thread or process but the caller has, for what is to take its place."""
    whole = path.absolute()
    return whole.with_name(f".{whole.name[:40]}.{secrets.token_hex(8)}.part")
