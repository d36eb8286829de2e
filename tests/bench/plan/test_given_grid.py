"""A grid that --map gives becomes an option of every laser log, and what contradicts it is a sentence."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slamduel.bench.drawing.map_files import write_grid
from slamduel.bench.plan.plan import Plan
from slamduel.core.errors import InputError
from slamduel.frontend.maps.occupancy import Occupancy


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    cells = np.zeros((40, 40, 4), np.float32)
    cells[5, :, 0], cells[6:, :, 1] = 4.0, 3.0
    write_grid(tmp_path / "graph", Occupancy(np.zeros(2), 0.05, cells))
    return tmp_path / "graph"


def plan(dataset: str, source: str | Path, **more: Any) -> Plan:
    words = {"backend": "graph", "dataset": dataset, "seeds": 2, "timeout_s": 60, "memory_mb": 1000}
    return Plan.from_words({**words, "map": str(source), **more})


def test_it_becomes_an_option_with_the_start(folder: Path) -> None:
    (dataset,) = plan("laser-floor[drive=1]", folder, start="unknown").datasets
    assert (dataset.options.grid, dataset.options.start) == (str(folder), "unknown")
    assert dataset.options.drive == 1


@pytest.mark.parametrize("name", ["grid.npz", "grid.pgm", "grid.png"])
def test_a_file_of_the_grid_is_not_the_grid(folder: Path, name: str) -> None:
    with pytest.raises(InputError, match=rf"--map .*{name}: is a file of a grid, expected the folder"):
        plan("laser-floor", folder / name)


def test_what_contradicts_it_is_refused(folder: Path) -> None:
    for dataset, source, more, said in (
        (f"laser-floor[grid={folder}]", folder, {}, "has a grid already, expected one of the two"),
        ("laser-floor[start=unknown]", folder, {}, "has the option start, expected --start unknown"),
        ("laser-floor,circle", folder, {}, "circle takes none; expected a laser log"),
        ("laser-floor", f"{folder.parent.parent}/*/gr*", {}, r"has 2 \*, expected one: it is the seed of each log"),
        ("laser-floor", folder, {"map_fixed": True}, r"--map-fixed: .* is an occupancy grid, which is fixed as it is"),
    ):
        with pytest.raises(InputError, match=said):
            plan(dataset, source, **more)
