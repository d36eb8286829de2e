"""The files of the checkout, without what was built in it."""

import shutil
import subprocess
from pathlib import Path

import pytest

from places import ROOT


def kept() -> list[str]:
    """The files that git has or would take, as paths from the root."""
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("this is no git checkout, or there is no git")
    command = ["git", "-C", str(ROOT), "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split("\0")
    return [name for name in listed if name and (ROOT / name).is_file()]


def source(folder: Path) -> Path:
    """A copy of these files in `folder`: setuptools writes beside its source."""
    for name in kept():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, target)
    return folder
