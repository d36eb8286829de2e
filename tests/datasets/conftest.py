"""What tests get of a drive that their module has as `folders`, by kind of recording."""

import shutil
from pathlib import Path

import pytest

from recording_logs import kept
from slamduel.core.factors import Log


@pytest.fixture
def drive(folders: dict[str, Path], tmp_path: Path) -> Path:
    """A copy of the drive in files, for a test to change."""
    return shutil.copytree(folders["frames"], tmp_path / "drive")


@pytest.fixture
def log(folders: dict[str, Path]) -> Log:
    """The log of the drive in files, made once."""
    return kept(folders["frames"])
