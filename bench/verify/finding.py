"""A check of a results folder and what it found."""

from typing import Literal, NamedTuple

HOLDS, FAILS, OPEN = "holds", "fails", "not checked"


class Finding(NamedTuple):
    """One thing that was checked, or could not be."""

    subject: Literal["files", "logs", "scores", "cells"]
    verdict: Literal["holds", "fails", "not checked"]
    sentence: str
