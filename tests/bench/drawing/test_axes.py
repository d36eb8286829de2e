import numpy as np
import pytest

from slamduel.bench.drawing.axes import stretches


def test_stretches_are_means_and_gaps_stay_gaps() -> None:
    rng = np.random.default_rng(1)
    t = np.sort(np.concatenate((rng.uniform(0, 4, 500), rng.uniform(6, 10, 500), (0.0, 10.0))))
    values = rng.normal(size=len(t))
    values[7] = np.nan
    middle, means = stretches(t, values, 10)
    assert middle == pytest.approx(np.arange(10) + 0.5)
    assert np.flatnonzero(np.isnan(means)).tolist() == [4, 5]
    for k in (0, 2, 9):
        inside = (t >= k) & ((t < k + 1) | (k == 9))
        assert means[k] == pytest.approx(np.nanmean(values[inside]), rel=1e-12)
    short, same = stretches(t[:5], values[:5], 10)
    assert short.tolist() == t[:5].tolist()
    assert same.tolist() == values[:5].tolist()
