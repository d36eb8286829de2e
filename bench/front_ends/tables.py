"""Tables that the studies of all front ends have."""

from collections.abc import Sequence

from rich import box
from rich.table import Table

from .consistency import Consistency

TRUTH = (
    "root mean square of the true errors | root of the mean stated variance; NEES over 3 degrees of freedom, 1 is exact"
)

CONSISTENCY_COLUMNS = tuple(f"{which}_{axis}" for which in ("true", "stated") for axis in ("x_m", "y_m", "heading_rad"))


def plain(title: str, texts: Sequence[str], figures: Sequence[str], caption: str = "") -> Table:
    """Makes an empty table: columns of texts, then columns of figures."""
    table = Table(title=f"[bold]{title}[/]", title_style="", title_justify="left", box=box.SIMPLE_HEAD)
    for heading in texts:
        table.add_column(heading, no_wrap=True)
    for heading in figures:
        table.add_column(heading, justify="right", no_wrap=True)
    if caption:
        table.caption, table.caption_justify = caption, "left"
    return table


def consistency_table(title: str, rows: Sequence[Consistency]) -> Table:
    """Makes the table of errors beside their covariances: true | stated."""
    table = plain(f"{title}, true | stated", ["factor"], ["count", "x, mm", "y, mm", "heading, mrad", "NEES"], TRUTH)
    for row in rows:
        pairs = (f"{1e3 * true:.1f} | {1e3 * stated:.1f}" for true, stated in zip(row.true, row.stated, strict=True))
        table.add_row(row.kind, f"{row.factors:,}", *pairs, f"{row.nees:.2f}")
    return table


def consistency_record(front_end: str, row: Consistency) -> dict[str, str | int | float]:
    """The columns of a row."""
    figures = dict(zip(CONSISTENCY_COLUMNS, (*row.true, *row.stated), strict=True))
    return {"study": f"{front_end} {row.kind}", "count": row.factors, "nees": row.nees, **figures}
