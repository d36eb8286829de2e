"""evo's own command line, as an independent reference."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ALL = """
import json, sys
from evo.cli import entry_points
for tool, *words in json.loads(sys.argv[1]):
    sys.argv[:] = [f"evo_{tool}", "tum", *words]
    getattr(entry_points, tool)()
    print("next", flush=True)
"""
"""The scripts evo_ape and evo_rpe, several commands in one process: evo is slow to import."""


def evo(folder: Path, *commands: Sequence[str]) -> list[float]:
    """The rmse, with 6 decimals, that evo prints at each of `commands` in `folder`.

    A command is the tool ("ape" or "rpe"), the TUM files of truth and estimate, and options.
    """
    env = {**os.environ, "HOME": str(folder)}  # evo's settings folder
    done = subprocess.run(
        [sys.executable, "-c", ALL, json.dumps(commands)],
        cwd=folder, capture_output=True, text=True, check=True, env=env,
    )  # fmt: skip
    answers = done.stdout.split("next\n")[:-1]
    found = [[line.split()[1] for line in answer.splitlines() if line.split()[:1] == ["rmse"]] for answer in answers]
    assert len(found) == len(commands)
    return [float(values[0]) for values in found]
