"""A log's picture and numbers, for Python, for notebooks and as an HTML page: `slamduel.show`."""

import tempfile
from pathlib import Path

from ...core.errors import InputError
from ...core.factors import Dataset, Log
from ...core.factors.check import check
from ...core.files import write_whole
from ...core.truth.check import check_truth
from ..drawing.page import rendered
from ..plan.load import load
from .facts import facts, headline, noted
from .numbers import Numbers, Subject, described
from .picture import write_picture


class LogPicture:
    """The picture of a log; `numbers` has its content, in m, rad and s."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject

    @property
    def numbers(self) -> Numbers:
        """Returns what `bench show --json` prints."""
        return self._subject.numbers

    def save(self, path: Path | str) -> None:
        """Writes the picture to a .png, .svg or .pdf file, whole or not at all."""
        write_picture(Path(path), self._subject)

    def __repr__(self) -> str:
        found = list(facts(self.numbers, self._subject.shown.words, mistaken=self._subject.remarks.mistaken))
        widest = max(len(heading) for heading, _ in found)
        lines = [f"{heading:<{widest}}  {text}" for heading, text in found]
        lines += [f"{'remark':<{widest}}  {remark}" for remark in self._subject.remarks.all]
        return "\n".join([f"{self._subject.label}: {headline(self.numbers)}", *lines])

    def _repr_png_(self) -> bytes:
        return _png(self._subject)


def show(dataset: Log | Dataset | str | Path, seed: int = 0, *, solve: bool | None = None) -> LogPicture:
    """Makes the picture of a log: one that Python holds, a name with its options, or a path.

    Without a true path it is drawn along the batch optimum if the log is not too large for that, or with `solve`.
    SlamduelError, with a sentence, for what cannot be used.
    """
    if isinstance(dataset, str | Path):
        label, dataset = Path(dataset).stem if isinstance(dataset, Path) else dataset, load(dataset, seed)
    elif isinstance(dataset, Dataset):
        label = dataset.log.name
    elif isinstance(dataset, Log):  # pyright: ignore[reportUnnecessaryIsInstance]
        label, dataset = dataset.name, Dataset(dataset, None)
    else:
        raise InputError(f"slamduel.show: found {dataset!r}, expected a name, a path, a Log or a Dataset(log, truth).")
    check(dataset.log, label)
    if dataset.truth is not None:
        check_truth(dataset.log, dataset.truth, label)
    return LogPicture(described(label, dataset, solve))


def write_page(path: Path, subject: Subject) -> None:
    """Writes the picture and numbers as one HTML page that needs no network, whole or not at all."""
    page = {
        "label": subject.label,
        "headline": headline(subject.numbers),
        "facts": list(facts(subject.numbers, subject.shown.words, mistaken=subject.remarks.mistaken)),
        "remarks": subject.remarks.all,
        "notes": noted(subject.dataset.log.notes, settings=True),
        "picture": _png(subject),
    }
    write_whole(path, rendered("log.html.jinja", page))


def _png(subject: Subject) -> bytes:
    with tempfile.TemporaryDirectory(prefix="slamduel-") as folder:
        path = Path(folder) / "log.png"
        write_picture(path, subject)
        return path.read_bytes()
