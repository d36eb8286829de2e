"""How often the 95 % intervals of `bench noise` have the true noise, over simulated logs: `make study-noise`."""

import sys
from collections import Counter

from noisy_logs import REACH, Slow, noisy
from slamduel.bench.noise.measured import Noise, measured
from slamduel.bench.systematic.estimated import Estimated

WORLDS = ("circle[steps=500]", "city[steps=500]", "linear[steps=500]")
RANGE = Slow(scale=1.5, power=0.4, share=0.7, time=6.0)
BEARING = Slow(scale=0.8)
ODOMETRY = (1.3, 0.7, 1.2)

EXPECTED = (0.93, 0.97)


def found(noise: Noise) -> dict[str, tuple[Estimated | None, float]]:
    """Estimates with their true values."""
    one, other = noise.range.fitted, noise.bearing.fitted
    slow = one.correlation
    values = {
        "range scale": (one.scale, RANGE.scale * (one.reach / REACH) ** RANGE.power),
        "range power": (one.power, RANGE.power),
        "range share": (None if slow is None else slow.share, RANGE.share),
        "range time": (None if slow is None else slow.time, RANGE.time),
        "bearing scale": (other.scale, BEARING.scale),
        "bearing power": (other.power, BEARING.power),
    }
    odometry = zip(("forward", "sideways", "turn"), noise.motions.horizons[0].scales, ODOMETRY, strict=True)
    return values | {name: (estimate, true) for name, estimate, true in odometry}


def coverage(world: str, logs: int, first: int = 0) -> tuple[Counter[str], list[str]]:
    """Counts by parameter the logs whose interval has the true value; and parameters that were not found at all."""
    inside: Counter[str] = Counter()
    missed: list[str] = []
    for seed in range(first, first + logs):
        noise = measured([noisy(world, seed, RANGE, BEARING, ODOMETRY)], [world])
        for name, (estimate, true) in found(noise).items():
            if estimate is None:
                missed.append(f"{name} of {world}, seed {seed}")
            else:
                inside[name] += estimate.low <= true <= estimate.high
    return inside, missed


def main(logs: int) -> int:
    """Prints the shares; 1 where one of all worlds together is not as expected."""
    total: Counter[str] = Counter()
    lost = 0
    for world in WORLDS:
        inside, missed = coverage(world, logs)
        total += inside
        lost += len(missed)
        print(world, {name: round(count / logs, 3) for name, count in inside.items()}, f"{len(missed)} missed")
    shares = {name: count / (logs * len(WORLDS)) for name, count in total.items()}
    print("all", {name: round(share, 3) for name, share in shares.items()})
    return int(lost > 0 or not all(EXPECTED[0] <= share <= EXPECTED[1] for share in shares.values()))


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 67))
