"""No number kills a report: infinite, missing, tiny, huge and all the same, through everything that reads a record.

Warnings are errors in these tests, so that none of numpy's or matplotlib's reaches a user either.
"""

import io
import json
from pathlib import Path

import pytest

from odd_records import odd_record
from slamduel.bench.cli import main
from slamduel.bench.record.files import export
from slamduel.bench.record.store import Store
from slamduel.bench.report.report import write_report
from slamduel.bench.run.document import document
from slamduel.bench.run.terminal import conclude, status, verdicts
from slamduel.bench.verdict.summary import lines
from slamduel.bench.words.console import screen_console
from tiers import first_quick


@pytest.mark.parametrize("seed", first_quick(range(40), 7))
def test_terminal_and_document_have_a_verdict(tmp_path: Path, seed: int) -> None:
    made = odd_record(tmp_path / "r", seed)
    found = lines(made.store.cells(), {})
    made.store.close()
    console = screen_console(quiet=False)
    console.file = io.StringIO()
    conclude(console, found)
    words = json.dumps(document("", "", status(found), found, verdicts(found), "", {}), allow_nan=False)
    assert json.loads(words)["status"] in (0, 1)
    assert all(dataset in console.file.getvalue() for dataset in {line.dataset for line in found})


@pytest.mark.parametrize("seed", first_quick(range(60)))
def test_page_files_and_comparison_are_written(tmp_path: Path, seed: int) -> None:
    for name, of in (("one", seed), ("two", seed + 1000)):
        made = odd_record(tmp_path / name, of)
        write_report(made.store)
        export(made.store)
        made.store.close()
        assert (tmp_path / name / "report.html").read_text(encoding="utf-8").endswith("</html>\n")
        assert (tmp_path / name / "metrics.csv").stat().st_size > 0
    assert main(["compare", str(tmp_path / "one"), str(tmp_path / "two")]) in (0, 1, 2)
    with Store(tmp_path / "one") as store:
        assert list(store.cells())
