"""Short names of datasets that read files: as short as they stay distinct."""

import pytest

from slamduel.bench.words.names import called, short


def csv(place: str, more: str = "", name: str = "") -> str:
    named = f"name={name}," * bool(name)
    return f"csv[{named}odometry={place},detections={place.rpartition('/')[0]}/detections.csv{more}]"


def test_a_log_from_tables_has_the_name_of_its_folder_or_else_of_its_file() -> None:
    assert short(csv("some/long/path/kitchen/odometry.csv", ",range_sd=0.2")) == "kitchen"
    assert short("csv[odometry=kitchen.csv,detections=seen.csv]") == "kitchen"
    assert short('csv[odometry="/a, b/c/odometry.csv",detections=x.csv]') == "c"
    assert short("world[landmarks=rooms/landmarks.csv,path=rooms/walk.csv,loops=2]") == "rooms"
    assert short("csv[range_sd=0.2]") == "csv[range_sd=0.2]"


@pytest.mark.parametrize("kind", ["csv", "log", "g2o", "toro", "gtsam", "carmen", "recording", "jrl", "pyfg", "world"])
def test_a_given_name_is_the_name(kind: str) -> None:
    option = "odometry" if kind == "csv" else "path"
    assert short(f"{kind}[name=Monday 1,{option}=some/long/path/x]") == "Monday 1"
    assert short(f'{kind}[name="a,b",{option}=some/long/path/x]') == "a,b"


@pytest.mark.parametrize(
    ("labels", "names"),
    [
        ([csv("x/d1/o.csv"), csv("x/d2/o.csv")], ["d1", "d2"]),
        ([csv("x/d/o.csv"), csv("y/d/o.csv"), csv("y/e/o.csv")], ["x/d", "y/d", "e"]),
        ([csv("x/d/o.csv"), csv("x/d/p.csv")], ["d/o.csv", "d/p.csv"]),
        ([csv("x/d/o.csv", ",every=1"), csv("x/d/o.csv", ",every=2")], ["d[every=1]", "d[every=2]"]),
        ([csv("x/d/o.csv"), csv("x/d/o.csv", ",range_sd=0.2")], ["d", "d[range_sd=0.2]"]),
        ([csv("x/o.csv", name="k"), csv("y/o.csv")], ["k", "y"]),
        ([csv("x/d/o.csv"), "log[path=logs/d]", "d"], ["x/d", "logs/d", "d"]),
    ],
)  # fmt: skip
def test_names_are_as_short_as_they_stay_distinct(labels: list[str], names: list[str]) -> None:
    assert list(called(labels).values()) == names


def test_logs_of_one_name_stay_apart() -> None:
    one, other = csv("x/o.csv", name="k"), csv("y/o.csv", name="k")
    found = called([one, other, "k"])
    assert found[one] == "k[odometry=x/o.csv,detections=x/detections.csv]"
    assert found[other] == "k[odometry=y/o.csv,detections=y/detections.csv]"
    assert len(set(found.values())) == 3
    noisy = [csv("x/o.csv", f",range_sd={sd}", name="k") for sd in (0.2, 0.3)]
    assert list(called(noisy).values()) == ["k[range_sd=0.2]", "k[range_sd=0.3]"]


def test_any_labels_have_distinct_names() -> None:
    kinds = ("csv", "log", "recording", "world", "circle")
    labels = [
        f"{kind}[{named}{'odometry' if kind == 'csv' else 'path'}={place}{more}]"
        for kind in kinds
        for named in ("", "name=a,", "name=o.csv,")
        for place in ("a", "a/a", "b/a", "a/b/o.csv", "c/b/o.csv", "/", "a/*")
        for more in ("", ",x=1", ",x=2")
    ]
    assert len(set(called(labels).values())) == len(labels)
    assert called([*labels, *labels]) == called(labels)
