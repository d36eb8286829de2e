"""Files that are there whole or not at all."""

import contextlib
import os
import secrets
from pathlib import Path


def write_whole(path: Path, content: str | bytes) -> None:
    """Put `content` in the file at `path`, a reader sees what was there before or the new, never a part."""
    part = beside(path)
    try:
        part.write_bytes(content.encode() if isinstance(content, str) else content)
        os.replace(part, path)
    except BaseException:
        with contextlib.suppress(OSError):
            part.unlink()
        raise


def beside(path: Path) -> Path:
    """A hidden place next to `path` that no thread or process but the caller has, for what is to take its place."""
    whole = path.absolute()
    return whole.with_name(f".{whole.name[:40]}.{secrets.token_hex(8)}.part")
