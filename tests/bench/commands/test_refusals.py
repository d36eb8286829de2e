"""What commands refuse before they do anything: a sentence with what was expected, status 2, and no file."""

import shlex
from pathlib import Path

import pytest

from command import refused

RUN = "run --backend ekf --dataset victoria-park --out run"
NOISE = "noise circle --noise n.toml"
REFUSALS = [
    # names
    ("rum", "there is no command 'rum'; did you mean 'run'?"),
    ("run --datset circle", "bench: run: there is no option '--datset'; did you mean '--dataset'?"),
    ("run --sedes=3", "bench: run: there is no option '--sedes=3'; did you mean '--seeds'?"),
    ("run --dataset a b", "bench: run: found 'b', which belongs to no option"),
    ("run --dataset 'a*'", "bench: a*: nothing fits this pattern"),
    ("run --backend mine.py:build", "bench: --backend: found 'mine.py:build', expected module:builder"),
    ("run --backend ../mine.py:build", "bench: --backend: found '../mine.py:build', expected module:builder"),
    (f"{RUN} --backend efk", "there is no backend 'efk'; did you mean 'ekf'?"),
    (f"{RUN} --dataset aruco-rom", "there is no dataset 'aruco-rom'; did you mean 'aruco-room'?"),
    (f"{RUN} --backend fastslam[particles=many]", "found 'many', expected a whole number"),
    (f"{RUN} --backend fastslam[particles=0]", "out of range"),
    (f"{RUN} --dataset mrclam", "path"),
    (f"{RUN} --dataset mrclam[path=/no/such/folder]", "/no/such/folder"),
    (f"{RUN} --dataset mrclam[path=/tmp,robot=9]", "expected one of all, or a whole number from 1 to 5"),
    (f"{RUN} --dataset ./no/such/log", "no/such/log"),
    (f"{RUN} --dataset {'x' * 400}/", "expected readable files"),
    (f"{RUN} --map-fixed", "there is no map to hold fixed"),
    ("check efk", "bench: check: there is no backend 'efk'"),
    ("show circl", "bench: show: there is no dataset 'circl'; did you mean 'circle'?"),
    ("show circle[stepz=3]", "there is no option 'stepz'"),
    ("show nowhere/at/all", "nowhere/at/all"),
    ("show circle,city", "bench: show: found 2 datasets, expected one."),
    ("validate victoria-prak", "validate: there is no dataset 'victoria-prak'"),
    ("noise nothing", "bench: noise: there is no dataset 'nothing'"),
    ("export circle,city --out x", "bench: export: found 2 datasets, expected one."),
    ("export circel --out x", "there is no dataset 'circel'; did you mean 'circle'?"),
    ("export circle", "bench: export circle: expected --out FOLDER, a new folder for the files."),
    ("export circle --csv x", "--csv: is for the folder of a study or a run, and circle is none;"),
    ("render aruco-rom --out x", "bench: render: there is no dataset 'aruco-rom'"),
    ("render victoria-park --out x", "found 'victoria-park', expected aruco-room or depth-room, whose"),
    ("render aruco-room,aruco-room[seconds=2] --out x", "expected aruco-room"),
    ("render aruco-room[seconds=0] --out x", "option seconds=0 is out of range"),
    ("map nowhere", "expected the folder of a run"),
    ("replay nowhere", "expected the folder of a run"),
    ("report nowhere", "expected the folder of a run"),
    # values
    *((f"{name} --seed -1", ": --seed: found -1, expected") for name in ("show", "validate", "export", "speed")),
    ("render circle --seed -1", ": --seed: found -1, expected a whole number, at least 0.\n"),
    *((f"{RUN} {words}", words.split()[0]) for words in ("--seeds 0", "--seeds x", "--timeout nan", "--memory 0")),
    (f"{RUN} --jobs -1", "--jobs"),
    *((f"{RUN} --repeats {n}", f"found {n}, expected a whole number, at least 1") for n in ("0", "-1", "2.5", "many")),
    ("check ekf --timeout 0", "--timeout is 0, expected more than 0 s and at most 86,400 s."),
    ("map nowhere --cell 7", "--cell"),
    *((f"compare {words}", "compare") for words in ("a", "a b --least 0", "a b --least much")),
    # files and formats
    (
        "detect drive --out log --poses p.txt",
        "--poses p.txt: found the ending '.txt', expected one of .csv, .jrl",
    ),
    ("show circle --out x.txt", "--out x.txt: found the ending '.txt', expected one of .png, .svg, .pdf, .html"),
    ("show circle --out no/x.png", "there is no folder no, expected an existing one"),
    ("noise circle --out page.pdf", "--out page.pdf: found the ending '.pdf'"),
    ("noise circle --save noise.json", "--save noise.json: found the ending '.json'"),
    ("render depth-room --as mp4 --out x", "expected one of tum, frames, ros1, ros2, mcap for depth-room"),
    ("render aruco-room --as gif --out x", "--as: found 'gif', expected one of frames, video, mp4, ros1, ros2, mcap"),
    ("render aruco-room --as frames,frames --out x", "--as frames,frames: a format is named twice"),
    ("suite quick --out file", "--out file: is no folder"),
    # options that go together
    ("noise circle city --apply x", "--apply x: found 2 logs, expected one"),
    (NOISE, "--noise: expected --apply FOLDER beside it"),
    (f"{NOISE} --apply x --json", "--json: nothing is measured with --noise"),
    (f"{NOISE} --apply x", "n.toml"),
    ("noise circle --own", "--own: expected --apply FOLDER beside it"),
    ("suite quikc", "did you mean 'quick'?"),
    ("suite quick --verify x", "--verify: found quick beside it, expected no name of a suite"),
    ("suite --sample 3", "--sample: found neither --verify nor --add"),
    ("suite --seed 3 quick", "--seed: found neither --verify nor --add"),
    ("suite --retry", "--retry: found no suite"),
    ("suite --verify nothing", "expected the folder that bench run left"),
    ("suite --site --out nothing", "holds no run of a suite; bench suite NAME --out nothing makes one"),
    # speed
    ("speed --sizes 10,x", "--sizes 10,x: expected whole numbers above 0"),
    ("speed --sizes 0,10", "--sizes 0,10: expected whole numbers above 0"),
    ("speed --sizes ''", "--sizes : expected whole numbers above 0"),
    ("speed --sightings 0", "--sightings 0: expected 1 or more"),
    ("speed --steps -3", "--steps -3: expected 1 or more"),
    ("speed --seconds nan", "--seconds nan: expected a number above 0"),
    ("speed --backend efk", "did you mean 'ekf'?"),
    ("speed --csv no/t.csv", "--csv no/t.csv: there is no folder no"),
    ("speed --crowded 3", "--crowded: without --association or --frontend backends are timed, which has no"),
    ("speed --association --backend graph", "--backend graph: has no data association"),
    ("speed --association --backend ekf[association=nn]", "expected it without association"),
    ("speed --association --crowded 3", "--crowded: --association times steps with and without ids"),
    ("speed --association --frontend", "--association --frontend: expected one of them"),
    ("speed --frontend --sizes 10", "--sizes: --frontend is the study of front ends, which has no such option"),
    ("speed --frontend --scattered", "--scattered: --frontend is the study of front ends"),
    ("speed --frontend --placements 1", "--placements 1: expected 2 or more"),
    ("speed --frontend --clutter -1", "--clutter -1: expected 0 or more"),
    ("speed --frontend --csv no/t.csv", "--csv no/t.csv: there is no folder no"),
    ("speed --frontend --out file", "found a file, expected a folder"),
    ("speed --frontend --scans no.clf", "--scans no.clf: found no such file, expected a log of laser scans"),
    ("speed --frontend --only markers --scans a.clf", "a.clf: found --only markers, expected no log of laser"),
    ("speed --frontend --only cameras --scans a.clf", "a.clf: found --only cameras, expected no log of laser"),
    ("speed --frontend --frames no", "--frames no: found no such file, expected a recording of a depth camera"),
    ("speed --frontend --only laser --frames a", "a: found --only laser, expected no recording of a depth"),
]


@pytest.mark.parametrize(("words", "sentence"), REFUSALS, ids=[words for words, _ in REFUSALS])
def test_it_is_one_sentence_and_nothing_is_done(
    words: str, sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    assert sentence in refused(capsys, *shlex.split(words))
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
