"""The files of the checkout, without what was built in it."""

import shutil
import subprocess
import sys
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


def built(here: Path, kind: str) -> Path:
    """The "wheel" or "sdist", built from a copy of the files that git has."""
    command = [sys.executable, "-m", "build", f"--{kind}", "--no-isolation", "--outdir", here / "dist"]
    words = [*command, source(here / "source")]
    done = subprocess.run(words, cwd=here, capture_output=True, text=True, check=False)
    assert done.returncode == 0, (done.stdout + done.stderr)[-2000:]
    (archive,) = (here / "dist").glob("slamduel-*")
    return archive


def source(folder: Path) -> Path:
    """A copy of these files in `folder`: setuptools writes beside its source."""
    for name in kept():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, target)
    return folder
