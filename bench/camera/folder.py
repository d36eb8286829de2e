"""Writes the folder of a detection: the log, detection.html, one page that needs no network, and contact.png."""

import base64
import os
import shlex
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

from ...core.errors import InputError
from ...core.files import write_whole
from ..drawing.page import rendered
from ..words.numerals import number
from .kept_frames import Picture, encoded, sheet
from .noise_calibration import CONSISTENT, toml
from .summary import Findings, headline, left_out, marker_rows

LOG = frozenset({"log.toml", "odometry.csv", "sightings.csv", "loops.csv", "truth.tum", "landmarks.csv"})
OURS = LOG | {"detection.html", "contact.png", "noise.toml", "scans.npz", "clouds.npz", "map.png"}
"""Files of a detection, of markers, scans or depth; a replaced folder may have nothing else."""


def check_place(out: Path) -> None:
    """Raises InputError unless `out` is new, empty, or the folder of an earlier detection with nothing added."""
    if out.is_symlink():
        raise InputError(f"--out {out}: is a link, expected the folder itself, or a new place.")
    if not out.exists():
        return
    if not out.is_dir():
        raise InputError(f"--out {out}: is a file, expected a folder for the log.")
    names = {path.name for path in out.iterdir()}
    if names and not {"log.toml", "detection.html"} <= names:
        raise InputError(f"--out {out}: is not empty and not of an earlier bench detect; expected a new place.")
    strangers = sorted(names - OURS)
    if strangers:
        raise InputError(f"--out {out}: has {strangers[0]}, which bench detect did not write; expected a new place.")


def write_folder(out: Path, write: Callable[[Path], None]) -> None:
    """Has `write` make the folder beside `out`, then replaces the old one; InputError where that is impossible."""
    check_place(out)
    place = out.absolute()
    beside, former = (place.with_name(f".{place.name}.{os.getpid()}.{word}") for word in ("new", "old"))
    try:
        write(beside)
        if place.exists():
            os.replace(place, former)
        os.replace(beside, place)
    except OSError as error:
        if former.exists() and not place.exists():
            os.replace(former, place)
        raise InputError(f"--out {out}: cannot be written ({error.strerror}).") from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)
        shutil.rmtree(former, ignore_errors=True)


PAGE, SHEET, MAP = "detection.html", "contact.png", "map.png"


def write_detection_report(folder: Path, out: Path, findings: Findings, pictures: Sequence[Picture]) -> None:
    """Writes the page and contact sheet into `folder`, beside log.toml; the page calls the log by `out`."""
    from .figures import path_figure, seen_figures, true_figures

    f = findings
    figures = list(seen_figures(f.sightings, f.t, f.max_range)) if len(f.sightings.ids) else []
    if f.true is not None and f.bins:
        figures += true_figures(f.sightings, f.true)
    figures.append(path_figure(f.log, f.truth))
    page = {
        "f": f,
        "headline": headline(f),
        "left_out": left_out(f.log),
        "markers": marker_rows(f),
        "figures": figures,
        "pictures": [(one, base64.b64encode(encoded(one.image, ".jpg")).decode()) for one in pictures],
        "noise": toml(f.calibration) if f.calibration else "",
        "consistent": CONSISTENT,
        "number": number,
        "settings": (folder / "log.toml").read_text(encoding="utf-8"),
        "command": f"bench run --dataset {shlex.quote(str(out))}",
    }
    write_whole(folder / PAGE, rendered(f"{PAGE}.jinja", page))
    if pictures:
        (folder / SHEET).write_bytes(encoded(sheet(list(pictures)), ".png"))
