"""A record of a large run: 3 backends, 5 datasets, 30 seeds. `python big_record.py FOLDER` shows it."""

import sys
from pathlib import Path

import numpy as np

from small_record import Record

DATASETS = (
    "aruco-room",
    "circle",
    "log[path=recordings/2024-05-17/office-third-floor-evening]",
    "bailey",
    "victoria-park",
)
BACKENDS = ("ekf", "fastslam[particles=1000,resample_below=0.5]", "isam2")


def big(
    folder: Path,
    datasets: tuple[str, ...] = DATASETS,
    backends: tuple[str, ...] = BACKENDS,
    seeds: int = 30,
    steps: int = 300,
) -> Record:
    """The first dataset is without a known path, the second with a reference, the others with ground truth."""
    made, rng = Record(folder), np.random.default_rng(2)
    for place, dataset in enumerate(datasets):
        kind = {4: "reference", 3: ""}.get(place, "truth")
        for k, backend in enumerate(backends):
            name, _, options = backend.partition("[")
            for seed in range(seeds):
                paths = ("online", "final") if name == "isam2" else ("online",)
                off = float(0.1 * (1 + 0.5 * k) * rng.lognormal(0, 0.3))
                made.cell(
                    dataset,
                    kind,
                    name,
                    options.rstrip("]"),
                    seed,
                    off=off,
                    steps=steps if seed == 0 else 60,
                    paths=paths,
                )
    return made


def main() -> None:
    """Writes the record and its report."""
    from slamduel.bench.report.report import write_report

    made = big(Path(sys.argv[1]))
    write_report(made.store)
    made.store.close()


if __name__ == "__main__":
    main()
