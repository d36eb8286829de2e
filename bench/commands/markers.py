"""`bench markers`: writes markers, or a board for calibration, to print at their true size."""

import argparse
import re
from pathlib import Path

from rich.console import Console

from ...core.errors import InputError
from ...frontend.markers.markers import Markers, write
from ..camera.sheets import PAGES, lay_out, sheets
from ..plan.values import check_file
from ..words.numerals import counted


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    add = parser.add_argument
    add("--dictionary", default="4X4_50", help="OpenCV's name, custom[count=30,size=4,seed=0] or a file (4X4_50)")
    add("--ids", default="0-11", help="such as 0-11,20 (0-11)")
    add(
        "--side",
        action="append",
        default=[],
        metavar="[ID=]METRES",
        help="of the black square; again as 7=0.2 for a marker of another size (0.15)",
    )
    add("--page", default="A4", choices=list(PAGES), help="(A4)")
    add(
        "--board",
        metavar="BOARD",
        help="a calibration board instead: charuco[...] or chessboard[...]",
    )
    add("--out", type=Path, default=Path("markers.pdf"), help="the PDF (markers.pdf)")
    add("--write-dictionary", type=Path, metavar="FILE", help="also put the dictionary in a file that OpenCV reads")


def main(namespace: argparse.Namespace) -> int:
    """Writes the PDF; 0."""
    from ...frontend.boards.board import read_board
    from ...frontend.boards.chessboard import Chessboard
    from ..camera import paper

    check_file("--out", namespace.out)
    check_file("--write-dictionary", namespace.write_dictionary)
    say = Console(emoji=False, highlight=False, markup=False, soft_wrap=True).print
    if namespace.board:
        board = read_board(namespace.board)
        if isinstance(board, Chessboard):
            drawn = paper.chessboard((board.columns, board.rows), board.square, namespace.board, namespace.page)
        else:
            drawn = paper.board(board.opencv, namespace.board, namespace.page)
        paper.write_pdf(namespace.out, namespace.page, [drawn], "calibration board")
        say(f"{namespace.out}: {namespace.board} on {namespace.page}")
    else:
        markers = Markers(namespace.dictionary, *_sides(namespace.side))
        names = _ids(namespace.ids, len(markers.opencv.bytesList) - 1)
        markers.check("--side")
        if strangers := set(markers.sides) - set(names):
            raise InputError(f"--side {min(strangers)}=...: marker {min(strangers)} is not among --ids {namespace.ids}")
        pages = lay_out(sheets(markers, names), namespace.page)
        if namespace.write_dictionary is not None:
            write(namespace.write_dictionary, markers.opencv)
        drawn = [paper.markers(placed, namespace.page) for placed in pages]
        paper.write_pdf(namespace.out, namespace.page, drawn, markers.dictionary)
        count = f"{counted(len(names), 'marker')} on {counted(len(pages), 'page')}"
        say(f"{namespace.out}: {count} of {namespace.page}\n\n{_settings(markers)}")
    return 0


def _settings(markers: Markers) -> str:
    own = ", ".join(f"{name} = {side:g}" for name, side in markers.sides.items())
    lines = ["for robot.toml:", "[markers]", f'dictionary = "{markers.dictionary}"', f"side = {markers.side:g}"]
    return "\n".join([*lines, f"sides = {{{own}}}"] if own else lines)


def _ids(text: str, last: int) -> list[int]:
    """Parses `0-3,7` into [0, 1, 2, 3, 7]; InputError for anything else or an id beyond `last`."""
    found: set[int] = set()
    for part in text.split(","):
        ends = re.fullmatch(r"\s*([0-9]+)(?:\s*-\s*([0-9]+))?\s*", part)
        low, high = (int(ends[1]), int(ends[2] or ends[1])) if ends else (1, 0)
        if low > high:
            raise InputError(f"--ids {text}: found {part.strip()!r}, expected ids such as 0-11,20")
        if high > last:
            raise InputError(f"--ids {text}: found {high}, expected ids of the dictionary, 0 to {last}")
        found.update(range(low, high + 1))
    return sorted(found)


def _sides(given: list[str]) -> tuple[float, dict[int, float]]:
    """Parses the side of all markers and those of some, m; InputError unless METRES or ID=METRES."""
    side, sides = 0.15, dict[int, float]()
    for text in given:
        name, equals, metres = text.rpartition("=")
        try:
            if equals:
                sides[int(name)] = float(metres)
            else:
                side = float(metres)
        except ValueError:
            raise InputError(
                f"--side {text}: expected metres, such as 0.16, or a marker's own, such as 7=0.2"
            ) from None
    return side, sides
