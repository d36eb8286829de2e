"""Remarks: none on logs as they are published, drawn or studied, and some on logs whose units do not agree."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import recorded
from refusals import refused
from slamduel.bench.plan.load import load, made
from slamduel.bench.study import file as study_file
from slamduel.core.factors import REMARKS, Dataset
from slamduel.datasets import archive
from slamduel.datasets.formats import log_folder
from slamduel.datasets.published import catalogue
from slamduel.datasets.remarks import NO_SIGHTING, refuse, remarks
from small_log import small_dataset

DRAWN = ("aruco-robot", "bailey", "circle", "city", "linear", "matlab-report", "victoria-park")

MRCLAM = "mrclam/MRCLAM_Dataset6"
PUBLISHED = {"dlr": "dlr/map.circles", "freiburg": "freiburg", **{f"mrclam[robot={k},": MRCLAM for k in range(1, 6)}}


def at_hand(name: str) -> bool:
    """Tells if a log can be made: a recording has to be on this machine."""
    return name not in catalogue.PUBLISHED or catalogue.place(name).is_dir()


@pytest.mark.parametrize("name", DRAWN)
def test_a_log_as_it_comes_has_no_remark(name: str) -> None:
    assert remarks(load(name)) == []


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_published_log_has_no_remark(name: str) -> None:
    path = recorded.at_hand(PUBLISHED[name])
    assert remarks(load(f"{name}path={path}]" if "[" in name else f"{name}[path={path}]")) == []


PARTIAL = {"intel-lab", "fr079"}
"""Laser logs whose copies at hand lack scans that relations are about, or the odometry."""


@pytest.mark.slow
@pytest.mark.parametrize("name", study_file.packaged())
def test_no_log_of_a_packaged_study_has_a_remark(name: str) -> None:
    """Two seeds of every dataset, but that the raw park has no ids, and visual odometry alone nothing to estimate from.

    Both are studied for that. Copies of laser logs are partial. What is rendered or scanned is that of the quick size.
    """
    seen: dict[str, set[int]] = {}
    quick, full = ([planned.cell for planned in study_file.read(name, full=full).cells] for full in (False, True))
    for cell in [*quick, *(cell for cell in full if not cell.dataset.source.costly)]:
        dataset, seed = cell.dataset, cell.seed if cell.dataset.source.seeded else 0
        of = seen.setdefault(dataset.label, set())
        if seed in of or len(of) == 2 or not at_hand(dataset.name) or dataset.name in PARTIAL:
            continue
        of.add(seed)
        odd = remarks(made(dataset, seed))
        if dataset.name == "victoria-park-raw":
            (without_ids,) = odd
            assert "have no id: " in without_ids
        elif getattr(dataset.options, "odometry", "") == "visual" and not dataset.options.loops:
            assert odd == [NO_SIGHTING]
        else:
            assert odd == [], f"{dataset.label}, seed {seed}"
    assert seen


@pytest.mark.parametrize(
    ("column", "factor", "words"),
    [
        ("delta", [100.0, 100.0, 1.0], "the odometry goes .* times as far as their ranges allow"),
        ("z", [100.0, 1.0], "its range changes by .* times the way of the odometry"),
    ],
)
def test_odometry_and_ranges_in_different_units_are_noticed(column: str, factor: list[float], words: str) -> None:
    log, _ = load("circle")
    odd: Any = {column: getattr(log, column) * np.array(factor)}
    (remark,) = remarks(Dataset(replace(log, **odd), None))
    assert re.search(words, remark)


@pytest.mark.parametrize(("sd", "told"), [(0.9, 0), (1.1, 1), (1000.0, 1)])
def test_a_start_whose_heading_is_unknown_is_noticed(sd: float, told: int) -> None:
    log, _ = load("circle")
    odd = replace(log, prior=log.prior._replace(cov=np.diag([1.0, 1.0, sd**2])))
    found = remarks(Dataset(odd, None))
    assert len(found) == told
    assert all(f"the heading of the prior has a standard deviation of {sd:.3g} rad" in one for one in found)


def test_a_readers_remark_goes_wherever_the_log_goes(tmp_path: Path) -> None:
    log, truth = small_dataset()
    told = replace(log, notes={**log.notes, REMARKS: ["readings are missing", "so are frames"]})
    assert told.digest == log.digest
    log_folder.write(tmp_path / "log", told, truth)
    archive.save(tmp_path / "log.npz", Dataset(told, truth))
    for again in (log_folder.read(tmp_path / "log"), archive.load(tmp_path / "log.npz")):
        assert remarks(again)[:2] == ["readings are missing", "so are frames"]


def test_strict_refuses_with_the_first_of_them() -> None:
    refuse("drive", [])
    refused(r"--strict: drive: hole; and 1 more\.", refuse, "drive", ["hole", "so are frames"])
