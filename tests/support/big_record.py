"""A record of a large run: 3 backends, 5 datasets, 30 seeds. `python big_record.py FOLDER` shows it."""

import sys
from pathlib import Path

import numpy as np

from small_record import Record

RECORDING = "log[path=recordings/2024-05-17/office-third-floor-evening]"
DATASETS = ("aruco-room", "circle", RECORDING, "bailey", "victoria-park")
BACKENDS = ("ekf", "fastslam[particles=1000,resample_below=0.5]", "isam2")


def big(folder: Path) -> Record:
    """The fourth dataset is without a known path, the last with a reference, the others with ground truth."""
    made, rng = Record(folder), np.random.default_rng(2)
    for dataset in DATASETS:
        kind = {"victoria-park": "reference", "bailey": ""}.get(dataset, "truth")
        for k, backend in enumerate(BACKENDS):
            name, _, options = backend.rstrip("]").partition("[")
            paths = ("online", "final") if name == "isam2" else ("online",)
            for seed in range(30):
                off, steps = float(0.1 * (1 + 0.5 * k) * rng.lognormal(0, 0.3)), 60 if seed else 300
                made.cell(dataset, kind, name, options, seed, off=off, steps=steps, paths=paths)
    return made


def main() -> None:
    """Writes the record and its report."""
    from slamduel.bench.report.report import write_report

    made = big(Path(sys.argv[1]))
    write_report(made.store)
    made.store.close()


if __name__ == "__main__":
    main()
