"""README and the pages of docs, and the commands that they show."""

import re
import shlex

from places import ROOT

PAGES = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in ROOT.glob("docs/*.md")}
PAGES["README.md"] = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(page: str) -> list[list[list[str]]]:
    """The words of the commands of a page after `bench`, by the blocks they stand in."""
    logs: list[str] = re.findall(r"^    LOG='(.*)'$", PAGES[page], re.MULTILINE)
    found = re.findall(r"(?:^    bench .*\n)+", PAGES[page], re.MULTILINE)
    lines = ((line.partition("   #")[0] for line in block.splitlines()) for block in found)
    return [[shlex.split(line.replace("$LOG", logs[0]) if logs else line)[1:] for line in block] for block in lines]
