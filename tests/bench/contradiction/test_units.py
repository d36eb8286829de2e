"""Units and signs of ranges alone, of positions and of headings in the world, which odometry contradicts."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slamduel.bench import cli
from slamduel.bench.contradiction.remark import remarked
from slamduel.bench.contradiction.units import wrong_units
from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset, Log
from slamduel.core.fixes import FixTable
from slamduel.core.partial import RANGE, PartialTable
from slamduel.core.se2 import Array
from slamduel.datasets.formats import log_folder
from tiers import first_quick

RANGES, FIXES = "circle[ranges_only=1,steps=400]", "circle[gps=5,compass=2,steps=400]"
DEGREES = np.array([1 / 73_000, 1 / 111_000])  # of longitude and latitude in a metre, at 49 degrees north


def made(name: str, seed: int) -> Log:
    return load(name, seed=seed).log


def with_ranges(log: Log, factor: float) -> Log:
    table = log.partial
    assert table is not None
    z = np.where(table.kind == RANGE, factor * table.z, table.z)
    var = np.where(table.kind == RANGE, factor**2 * table.var, table.var)
    return replace(log, partial=PartialTable.from_arrays(len(log), table.step, table.ids, table.kind, z, var))


def with_fixes(log: Log, change: Callable[[Array], Array]) -> Log:
    fixes = log.fixes
    assert fixes is not None
    return replace(log, fixes=FixTable.from_arrays(len(log), fixes.step, change(fixes.z), fixes.cov, fixes.arm))


WRONG: dict[str, tuple[Callable[[Array], Array], str]] = {
    "degrees": (lambda z: z * [*DEGREES, 1.0], "positions are in degrees of latitude and longitude"),
    "swapped degrees": (lambda z: z[:, [1, 0, 2]] * [*DEGREES[::-1], 1.0], "positions are in degrees of latitude"),
    "centimetres": (lambda z: z * [100.0, 100.0, 1.0], "positions are in centimetres"),
    "kilometres": (lambda z: z * [1e-3, 1e-3, 1.0], "the odometry is in millimetres"),
    "swapped": (lambda z: z[:, [1, 0, 2]], "latitude and longitude, or x and y, are swapped"),
    "x to the west": (lambda z: z * [-1.0, 1.0, 1.0], "or one of them, or the odometry's turns, have the other sign"),
    "clockwise": (lambda z: z * [1.0, 1.0, -1.0], "as a compass's, which dataset csv takes with headings_from=north"),
    "converted twice": (lambda z: z * [1.0, 1.0, np.pi / 180], "were converted from degrees twice"),
}


MIRRORS = ("circle[gps=5,steps=400]", "bailey[gps=5]", "city[gps=20]", "patrol[gps=10,steps=2000]")


@pytest.mark.parametrize("seed", first_quick(range(8)))
@pytest.mark.parametrize("world", MIRRORS)
def test_odometry_that_turns_to_the_other_side_than_the_positions_is_told(world: str, seed: int) -> None:
    log = made(world, seed)
    assert list(wrong_units(log)) == []
    delta = log.delta * [1.0, -1.0, -1.0]
    (said,) = wrong_units(replace(log, delta=delta))
    assert said.startswith("the positions in the world turn to the other side than the odometry")


@pytest.mark.parametrize("seed", first_quick(range(8)))
def test_a_straight_way_and_noise_alone_tell_no_side(seed: int) -> None:
    log = made("circle[gps=5,steps=400]", seed)
    rng = np.random.default_rng(seed)
    assert log.fixes is not None
    straight = replace(log, delta=log.delta * [1.0, 0.0, 0.0])
    along = straight.dead_reckoned()[log.fixes.step]
    noisy = with_fixes(straight, lambda z: along + rng.standard_normal(z.shape))
    assert not [said for said in wrong_units(noisy) if "other side" in said]


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
@pytest.mark.parametrize("case", WRONG)
def test_positions_and_headings_of_another_unit_or_sign_are_a_remark(case: str, seed: int) -> None:
    change, words = WRONG[case]
    log = with_fixes(made(FIXES, seed), change)
    (said,) = wrong_units(log)
    assert words in said


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
@pytest.mark.parametrize(("factor", "unit"), [(1000.0, "millimetres"), (100.0, "centimetres"), (1 / 0.0254, "inches")])
def test_ranges_of_another_unit_are_a_remark(factor: float, unit: str, seed: int) -> None:
    (said,) = wrong_units(with_ranges(made(RANGES, seed), factor))
    assert said.endswith(f"ranges are in {unit}")


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
@pytest.mark.parametrize("name", [RANGES, FIXES, "circle[ranges_only=0.5,gps=60,compass=10,steps=300]", "circle"])
def test_right_units_are_none(name: str, seed: int) -> None:
    assert list(wrong_units(made(name, seed))) == []


@pytest.mark.parametrize("seed", range(8))
def test_late_and_reflected_ranges_and_noise_alone_are_none(seed: int) -> None:
    assert list(wrong_units(made("circle[ranges_only=1,steps=400,uwb_tail=0.3,uwb_tail_mean=2]", seed))) == []
    log, rng = made(FIXES, seed), np.random.default_rng(seed)
    assert list(wrong_units(with_fixes(log, lambda z: rng.normal(0, (50.0, 50.0, 1.0), z.shape)))) == []


def test_a_robot_that_stands_contradicts_no_unit() -> None:
    log = with_ranges(made(RANGES, 1), 1000.0)
    assert list(wrong_units(replace(log, delta=np.zeros_like(log.delta)))) == []


def test_validate_prints_it_and_refuses_it_if_strict(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = with_ranges(made(RANGES, 1), 1000.0)
    assert remarked(Dataset(log, None)).mistaken
    log_folder.write(tmp_path / "log", log, None)
    name = f"log[path={tmp_path / 'log'}]"
    assert cli.main(["validate", name]) == 0
    assert "ranges are in millimetres" in capsys.readouterr().out
    assert cli.main(["validate", name, "--strict"]) == 2
