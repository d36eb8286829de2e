"""Tries so many mutations over all families: python -m mutants 2000 (make study-mutations).

Prints how each kind ended and every mutation that made a result worse in silence or crashed; exits with status 1 if
there is one.
"""

import sys
from collections import Counter

from .ending import ENDS, Ended
from .families import FAMILIES


def main(cases: int, chosen: list[str]) -> int:
    """Tries the mutations and prints how they ended."""
    counts: dict[str, Counter[str]] = {}
    silent: list[Ended] = []
    families = chosen or list(FAMILIES)
    for number, name in enumerate(families):
        share = cases // len(families) + (number < cases % len(families))
        for ended in FAMILIES[name](share, 0):
            counts.setdefault(ended.kind, Counter())[ended.end] += 1
            if ended.end in ("worse", "crashed"):
                silent.append(ended)
    print(f"{'':50}" + "".join(f"{end:>10}" for end in ENDS))
    for kind, found in sorted(counts.items()):
        print(f"{kind:50}" + "".join(f"{found[end] or '':>10}" for end in ENDS))
    total = sum(counts.values(), Counter[str]())
    print(f"{'all':50}" + "".join(f"{total[end]:>10}" for end in ENDS))
    for ended in silent:
        print(f"{ended.end}: {ended.kind}: {ended.words}")
    return 1 if silent else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2:]))
