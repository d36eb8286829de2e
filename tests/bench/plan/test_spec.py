"""Names and options as a user types them."""

import re
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from carmen_files import flaser, robotlaser, written
from floor_drives import floor_drive
from slamduel.bench.plan.plan import Plan
from slamduel.bench.plan.spec import backend_variants, dataset_at, dataset_variants, describe, read_options
from slamduel.core.errors import InputError
from slamduel.core.options import option
from slamduel.datasets.recordings.sensors import sensors_in
from slamduel.datasets.scans.open import open_scans


@dataclass(frozen=True)
class Options:
    """One of each kind."""

    count: int = option(10, "how many", minimum=1, maximum=1_000_000)
    share: float = option(0.5, "how much", minimum=0, maximum=1)
    loud: bool = option(False, "whether")
    shape: str = option("round", "which", choices=("round", "square"))
    path: str | None = option(None, "where")
    names: float | str = option("all", "which, or how many", minimum=0, maximum=1, choices=("all", "none"))
    sizes: float | tuple[float, float] = option(0.1, "both sizes, or each", minimum=0, maximum=9)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ([], Options()),
        ([("count", "1_000"), ("share", "1e-3")], Options(1000, 0.001)),
        ([("loud", "True"), ("shape", "square")], Options(loud=True, shape="square")),
        ([("path", "none")], Options(path=None)),
        ([("path", "a b/c")], Options(path="a b/c")),
        ([("names", "none")], Options(names="none")),
        ([("names", "3e-1")], Options(names=0.3)),
        ([("sizes", "3")], Options(sizes=3.0)),
        ([("sizes", "3;2e-1")], Options(sizes=(3.0, 0.2))),
    ],
)
def test_options_are_read_by_their_annotation(given: list[tuple[str, str]], expected: Options) -> None:
    assert read_options(Options, given, "backend x") == expected


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ([("cuont", "3")], "backend x: there is no option 'cuont'; did you mean 'count'?"),
        ([("zzz", "3")], "there is no option 'zzz'; expected one of count, loud, names, path, shape, share, sizes."),
        ([("count", "3.5")], "option count=3.5: found '3.5', expected a whole number from 1 to 1000000."),
        ([("count", "0")], "option count=0 is out of range; expected a whole number from 1 to 1000000."),
        ([("share", "nan")], "option share=nan is out of range; expected a number from 0 to 1."),
        ([("share", "inf")], "option share=inf is out of range; expected a number from 0 to 1."),
        ([("loud", "maybe")], "option loud=maybe: found 'maybe', expected true or false."),
        ([("shape", "oval")], "option shape=oval is not one of its values; expected one of round, square."),
        ([("path", "")], "option path is empty, expected text."),
        ([("sizes", "3;x")], "option sizes=x: found 'x', expected a number from 0 to 9, or 2 of them, A,B."),
        ([("sizes", "3;20")], "option sizes=20 is out of range; expected a number from 0 to 9, or 2 of them, A,B."),
        ([("sizes", "3;2;1")], "option sizes=3;2;1: found 3 values, expected a number from 0 to 9, or 2 of them, A,B."),
        ([("count", "3"), ("count", "4")], "option count is given twice, expected once."),
    ],
)
def test_wrong_options_get_a_sentence(given: list[tuple[str, str]], sentence: str) -> None:
    with pytest.raises(InputError, match=re.escape(sentence)):
        read_options(Options, given, "backend x")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("efk", "there is no backend 'efk'; did you mean 'ekf'?"),
        ("ekf,,isam2", "found an empty name"),
        ("", "found an empty name"),
        ("ekf,ekf", "ekf is named twice"),
        ("fastslam[particles=7],fastslam[particles=7]", "fastslam[particles=7] is named twice"),
        ("dead-reckoning[particles=3]", "backend dead-reckoning: there is no option 'particles'; it has none."),
        ("fastslam[particles]", "found 'particles', expected option=value"),
        ("fastslam[particles=3", "expected every bracket and quote to be closed"),
        ("fastslam[particles=3]x", "expected the brackets to close at the end"),
        ("fastslam]particles=3[", "expected"),
        ('fast"slam"', "expected double quotes around the whole"),
        ("fastslam[particles=-3]", "out of range; expected a whole number from 1 to"),
    ],
)
def test_wrong_names_get_a_sentence(text: str, sentence: str) -> None:
    with pytest.raises(InputError, match=re.escape(sentence)):
        backend_variants(text)


def test_no_name_is_suggested_that_has_half_of_the_letters() -> None:
    with pytest.raises(InputError, match="there is no option 'loops'; expected one of "):
        dataset_variants("city[loops=5]")


@pytest.mark.parametrize("option", ["motion=stop-and-go", "moving_speed=1", "roaming=3"])
def test_options_of_moving_landmarks_are_refused_where_none_move(option: str) -> None:
    name = option.partition("=")[0]
    with pytest.raises(InputError, match=f"dataset circle: option {name} has no effect without moving, expected both"):
        dataset_variants(f"circle[{option}]")
    (found,) = dataset_variants(f"circle[{option},moving=0.2]")
    assert found.options.moving == 0.2


@pytest.mark.parametrize(
    ("option", "files"),
    [
        ("position_sd=2.0", ["positions"]),
        ("heading_sd=0.2", ["headings"]),
        ("bearing_sd=0.5", ["detections", "bearings"]),
        ("range_sd=0.5", ["detections", "ranges"]),
        ("range_share=0.1", ["detections", "ranges"]),
        ("xy_sd=0.1", ["detections"]),
        ("signature_sd=0.1", ["detections"]),
        ("ignore=99", ["detections"]),
        ("sensor_x=0.1", ["detections"]),
        ("sensor_y=0.1", ["detections"]),
        ("sensor_yaw=0.1", ["detections"]),
        ("sensor_delay=0.1", ["detections", "ranges", "bearings"]),
    ],
)
def test_noise_of_files_that_are_not_given_is_refused(option: str, files: list[str]) -> None:
    name, expected = option.partition("=")[0], "both" if len(files) == 1 else "one of them"
    others = {"detections", "ranges", "bearings", "positions", "headings"} - set(files)
    given = ",".join(f"{one}=f.csv" for one in sorted(others))
    said = f"dataset csv: option {name} has no effect without {' or '.join(files)}, expected {expected}."
    with pytest.raises(InputError, match=said):
        dataset_variants(f"csv[odometry=o.csv,{given},{option}]")
    for one in files:
        (found,) = dataset_variants(f"csv[odometry=o.csv,{one}=f.csv,{option}]")
        assert str(getattr(found.options, name)) == option.partition("=")[2]


@pytest.mark.parametrize("separator", [",", ";", " , ", "; "])
def test_a_list_in_an_option_is_read_with_commas_and_written_as_ever(separator: str) -> None:
    """A label parts options with commas, so that of a list has another separator: the same log has the same label."""
    given = separator.join(("5", "14", "23"))
    (found,) = dataset_variants(
        f"csv[detections=d.csv,range_sd=0.1,ignore={given},start_sd={separator.join(('100', '0.1'))},every=2]"
    )
    assert found.label == "csv[detections=d.csv,ignore=5;14;23,every=2.0,start_sd=100.0;0.1]"
    assert dataset_variants(found.label)[0].options == found.options


@pytest.mark.parametrize("separator", [",", ";", "+"])
def test_every_option_that_is_a_list_takes_every_separator(separator: str) -> None:
    angles = dataset_variants(f"csv[angles={separator.join(('truth', 'odometry'))}]")[0].options
    assert angles.in_degrees() == ("odometry", "truth")
    (found,) = dataset_variants(f"recording[path=x,sensors={separator.join(('laser', 'depth'))},imu=false]")
    assert found.options.sensors == "laser+depth"
    assert sensors_in(separator.join(("laser", "depth")), "--sensors") == ("laser", "depth")


@pytest.mark.parametrize("text", ["csv[odometry=a.csv,b.csv]", "csv[range_sd=0.1,b.csv]", "csv[imu=none,b.csv]"])
def test_a_comma_in_a_value_that_is_no_list_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"found 'b.csv', expected option=value; option .* is no list"):
        dataset_variants(text)
    assert dataset_variants('csv[odometry="a,b.csv"]')[0].options.odometry == "a,b.csv"


def test_labels_are_what_the_command_line_takes() -> None:
    for text in ("fastslam[particles=1000,resample_below=0.3]", "isam2[factorization=cholesky]", "ekf"):
        (variant,) = backend_variants(text)
        assert variant.label == text
    assert dataset_variants("csv[start_sd=100;0.1]")[0].label == "csv[start_sd=100.0;0.1]"
    (dataset,) = dataset_variants('log[path="a,[b]/c"]')
    assert dataset.options.path == "a,[b]/c"
    assert dataset_variants(dataset.label)[0].options == dataset.options


@pytest.mark.parametrize("path", ["a,b", "a[1]/c", " a ", "none", "city", "a=b"])
def test_a_path_comes_back_from_its_label(path: str) -> None:
    variant = dataset_at(Path(path), "test")
    (again,) = dataset_variants(variant.label)
    assert (again.name, again.options) == (variant.name, variant.options)
    assert Path(again.options.path) == Path(path)


def test_a_path_with_a_double_quote_is_refused() -> None:
    for named in (lambda: dataset_at(Path('a"b'), "test"), lambda: dataset_variants('log[path=a"b"c]')):
        with pytest.raises(InputError, match="double quote"):
            named()


def test_quotes_stand_round_a_whole_name(tmp_path: Any) -> None:
    for name in ("x,y", "br[1]"):
        (tmp_path / name).mkdir()
        (variant,) = dataset_variants(f'"{tmp_path}/{name}"')
        assert (variant.name, variant.options.path) == ("log", f"{tmp_path}/{name}")
    (variant,) = backend_variants('"fastslam"[particles=7]')
    assert variant.label == "fastslam[particles=7]"


def test_what_is_there_under_a_name_with_brackets_or_commas_is_a_path(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a[1]", "a,b", "x", "c[1,2]/log", "open[", "d, e", "circle[steps=100]"):
        (tmp_path / name).mkdir(parents=True)
    for name in ("a[1]", "a,b", "c[1,2]/log", "open[", "d, e", f"{tmp_path}/a[1]", f"{tmp_path}/a,b"):
        (variant,) = dataset_variants(name)
        assert (variant.name, variant.options.path) == ("log", name)
    found = dataset_variants("x,a[1],a,b,c[1,2]/log")
    assert [one.options.path for one in found] == ["x", "a[1]", "a,b", "c[1,2]/log"]
    assert dataset_variants("circle[steps=100],x")[0].name == "circle"
    for name in ("b[1]", "b[1]/log", "open[1"):
        with pytest.raises(InputError):
            dataset_variants(name)


@pytest.mark.parametrize("name", ["a.log", "a.log.gz", "a.txt", "a.clf", "a"])
@pytest.mark.parametrize("line", [flaser, robotlaser])
def test_a_laser_log_is_known_by_its_lines(tmp_path: Any, name: str, line: Any) -> None:
    recording = floor_drive(laps=0.02)
    path = written(tmp_path / name, recording, line)
    (variant,) = dataset_variants(str(path))
    assert (variant.name, variant.options.path) == ("carmen", str(path))
    found = open_scans(path)
    assert found is not None
    assert len(found.recording.t) == len(recording.t)
    (tmp_path / "robot.toml").write_text("[laser]\n")
    assert dataset_variants(str(path))[0].name == "recording"
    inside = open_scans(tmp_path)
    assert inside is not None
    assert len(inside.recording.t) == len(recording.t)


def test_another_text_is_no_laser_log(tmp_path: Any) -> None:
    (tmp_path / "a.log").write_text("# FLASER\nPARAM laser_front_laser_resolution 1.0\nlaser FLASER 3\n")
    (tmp_path / "b.log.gz").write_bytes(b"no gzip")
    (tmp_path / "c.log").write_bytes(bytes(range(256)) * 99)
    for name in ("a.log", "b.log.gz", "c.log"):
        assert dataset_variants(str(tmp_path / name))[0].name == "recording"
        assert open_scans(tmp_path / name) is None


def test_an_option_at_its_default_is_the_plain_backend() -> None:
    assert backend_variants("fastslam[particles=500]")[0].label == "fastslam"


@pytest.mark.parametrize(
    ("file", "rows", "kind"),
    [
        ("a.g2o", "VERTEX_SE2 0 0 0 0", "g2o"),
        ("a.G2O", "# by hand\n\nEDGE_SE2 0 1", "g2o"),
        ("a.g2o", "VERTEX2 0 0 0 0\nEDGE2 0 1", "gtsam"),
        ("a.g2o", "EDGE_SE2 0 1\nLANDMARK2 0 1", "gtsam"),
        ("a.graph", "VERTEX2 0 0 0 0\nEDGE2 0 1", "toro"),
        ("a.graph", "VERTEX2 0 0 0 0\nEDGE2 0 1\nBR 0 1", "gtsam"),
        ("a.graph", "ODOMETRY 0 1", "gtsam"),
        ("a.graph", "EDGE_SE2 0 1", "g2o"),
        ("a.toro", "EDGE2 0 1", "toro"),
    ],
)
def test_a_graph_s_path_is_short_for_its_reader(file: str, rows: str, kind: str, tmp_path: Any) -> None:
    (tmp_path / file).write_text(rows)
    (variant,) = dataset_variants(str(tmp_path / file))
    assert (variant.name, variant.options.path) == (kind, str(tmp_path / file))


def test_a_graph_that_is_not_there_is_a_sentence(tmp_path: Any) -> None:
    with pytest.raises(InputError, match=r"none\.g2o: there is no such file"):
        dataset_variants(str(tmp_path / "none.g2o"))
    with pytest.raises(InputError, match=r"none\.g2o: there is no such file"):
        dataset_variants("none.g2o")
    (tmp_path / "folder.g2o").mkdir()  # a folder's path is short for a log
    assert dataset_variants(str(tmp_path / "folder.g2o"))[0].name == "log"


def test_variants_of_one_backend_have_folders_of_their_own() -> None:
    plain, many, more = backend_variants("fastslam,fastslam[particles=200],fastslam[particles=300]")
    assert plain.slug == "fastslam"
    assert len({plain.slug, many.slug, more.slug}) == 3
    assert many.slug.startswith("fastslam-")
    assert all(c.isalnum() or c in "-_." for v in backend_variants("pack.mod:build") for c in v.slug)


def test_a_plugin_that_cannot_be_imported_is_kept_with_the_reason() -> None:
    (variant,) = backend_variants("no-such-package.module:build")  # a module's file may have such a name
    assert variant.builder is None
    assert "no-such-package" in variant.missing


def test_a_plan_comes_back_from_its_words() -> None:
    words = {"backend": "ekf,fastslam[particles=7]", "dataset": "aruco-room[markers=12],victoria-park", "seeds": 2}
    words |= {"timeout_s": 5.0, "memory_mb": 100, "repeats": 3}
    plan = Plan.from_words(words)
    usual = {"logs": {}, "map": None, "map_fixed": False, "start": "known", "map_digest": None, "oracle": False}
    assert plan.words() == words | usual
    cells = {(c.dataset.name, c.backend.name, c.seed) for c in plan.cells()}
    every = set(product(("aruco-room", "victoria-park"), ("ekf", "fastslam"), (0, 1)))
    assert cells == every - {("victoria-park", "ekf", 1)}  # neither draws: once
    assert len(plan.cells()) == len(cells)


def test_more_cells_than_memory_holds_are_refused_before_they_are_made() -> None:
    words = {"backend": "ekf,fastslam", "dataset": "circle", "seeds": 10**11, "timeout_s": 1.0, "memory_mb": 1}
    sentence = "seeds: with these there are 200,000,000,000 cells, expected at most 1,000,000."
    with pytest.raises(InputError, match=sentence):
        Plan.from_words(words)
    assert len(Plan.from_words(words | {"seeds": 500}).cells()) == 1000


def test_every_option_is_described_with_its_range() -> None:
    described = {name: (default, summary) for name, default, summary in describe(Options)}
    assert described["count"] == ("10", "how many (a whole number from 1 to 1000000)")
    assert described["shape"] == ("round", "which (one of round, square)")
    assert described["names"] == ("all", "which, or how many (one of all, none, or a number from 0 to 1)")
    assert described["path"] == ("none", "where (text)")
    assert described["sizes"] == ("0.1", "both sizes, or each (a number from 0 to 9, or 2 of them, A,B)")
