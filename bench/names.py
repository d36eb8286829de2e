"""What people call the datasets of a run: those that are paths by the paths' last parts."""

import re
from collections.abc import Sequence

_PATH = re.compile(r'^\w+\[path=(?:"([^"]*)"|([^",\]]*))(?:,(.*))?\]$', re.DOTALL)


def called(labels: Sequence[str]) -> dict[str, str]:
    """A name a label, no two the same: log[path=runs/kitchen] is kitchen where no other dataset is called so."""
    depth, names = 1, [_called(label, 1) for label in labels]
    while len(set(names)) < len(set(labels)):
        depth += 1
        deeper = [_called(label, depth) for label in labels]
        if deeper == names:  # not told apart by their paths: another kind of dataset at the same place
            return {label: label for label in labels}
        names = deeper
    return dict(zip(labels, names, strict=True))


def _called(label: str, depth: int) -> str:
    found = _PATH.match(label)
    if found is None:
        return label
    parts = [part for part in (found[1] or found[2]).split("/") if part not in ("", ".")]
    rest = f"[{found[3]}]" if found[3] else ""
    return "/".join(parts[-depth:] or [label]) + rest
