"""The efficiencies of robust losses that docs/backends.md prints, by quadrature over Gaussian errors."""

import re
from collections.abc import Callable

import pytest
from scipy.integrate import quad
from scipy.stats import chi

from places import ROOT
from slamduel.backends.common_options import LOSSES

WEIGHTS: dict[str, Callable[[float, float], float]] = {
    "huber": lambda r, c: 1.0 if r <= c else c / r,
    "cauchy": lambda r, c: 1.0 / (1.0 + (r / c) ** 2),
    "geman-mcclure": lambda r, c: 1.0 / (1.0 + (r / c) ** 2) ** 2,
}
"""Weight of an error of length r at scale c, from the losses' definitions."""


def efficiency(loss: str, dimensions: int) -> float:
    """Variance of the mean by that of the M-estimate of a location, per axis, of standard Gaussian errors.

    An M-estimate with influence w(r) x has the variance E[w² r²] / d over the square of its mean slope, which is
    E[w r²] / d by Stein's identity.
    """
    scale = LOSSES[loss]
    density: Callable[[float], float] = chi(dimensions).pdf  # pyright: ignore[reportAttributeAccessIssue]

    def mean(value: Callable[[float], float]) -> float:
        parts = [quad(lambda r: value(r) * density(r), *ends)[0] for ends in ((0.0, scale), (scale, 40.0))]
        return sum(parts) / dimensions

    slope = mean(lambda r: WEIGHTS[loss](r, scale) * r * r)
    return slope**2 / mean(lambda r: (WEIGHTS[loss](r, scale) * r) ** 2)


@pytest.mark.parametrize("loss", WEIGHTS)
def test_the_efficiencies_that_are_printed(loss: str) -> None:
    text = (ROOT / "docs" / "backends.md").read_text(encoding="utf-8")
    row = re.search(rf"^\| `{loss}` \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$", text, re.MULTILINE)
    scale, *printed = row.groups()
    assert float(scale) == LOSSES[loss]
    assert [f"{100 * efficiency(loss, dimensions):.1f}" for dimensions in (1, 2, 3)] == printed
