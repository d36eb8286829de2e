"""evo's own command line, as an independent judge."""

import os
import subprocess
import sys
from pathlib import Path


def evo(tool: str, folder: Path, truth: str, estimate: str, *options: str) -> float:
    """The rmse that `evo_<tool>` prints for two TUM files in `folder`, with 6 decimals."""
    command = [Path(sys.executable).parent / f"evo_{tool}", "tum", truth, estimate, *options]
    env = {**os.environ, "HOME": str(folder)}  # where evo keeps its settings
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True, env=env)
    return next(float(line.split()[1]) for line in done.stdout.splitlines() if line.split()[:1] == ["rmse"])
