"""The text of a small study, and the study parsed from a text."""

from slamduel.bench.study.file import made
from slamduel.bench.study.study import Study

HEAD = """title = "A study"
seeds = 3

[[cells]]
dataset = "bailey"
backend = ["ekf", "dead-reckoning"]
grid."dataset.loops" = [1, 2]

[[cells]]
dataset = "bailey"
backend = "fastslam"
grid."dataset.loops" = [1, 2]
grid."backend.particles" = [10, 20]

"""
"""14 lines, so that appended text begins on line 15."""


def study(text: str, *, full: bool = False) -> Study:
    return made("s.toml", text, full=full)
