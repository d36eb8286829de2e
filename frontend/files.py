"""Atomic file writes."""

import contextlib
import os
import secrets
from pathlib import Path


def write_whole(path: Path, content: str | bytes) -> None:
    """Writes `content` to `path` atomically: a reader sees the old or the new file, never a part."""
    part = beside(path)
    try:
        part.write_bytes(content.encode() if isinstance(content, str) else content)
        os.replace(part, path)
    except BaseException:
        with contextlib.suppress(OSError):
            part.unlink()
        raise


def beside(path: Path) -> Path:
    """A hidden temporary path next to `path`, unique to the caller."""
    whole = path.absolute()
    return whole.with_name(f".{whole.name[:40]}.{secrets.token_hex(8)}.part")
