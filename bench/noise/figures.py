"""Draws the noise of logs: errors over time, their autocorrelation and quantiles, and odometry over horizons."""

from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from ...core.se2 import Array
from ..drawing.axes import fitted as fitted_axis
from ..drawing.axes import labelled, legend
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import report_figure
from ..drawing.svg import INK
from ..words.styles import COLOURS, MARKERS
from .gauss_markov import Chains, closed
from .measured import Noise, SightingNoise
from .motions import AXES, Motions
from .words import SENSORS

HEIGHT = 200  # points
MOST = 1500  # errors drawn
LAGS = 12  # of the autocorrelation
AHEAD = 300  # errors of a chain that each is compared with
FEWEST = 30  # pairs of a lag


class Autocorrelation(NamedTuple):
    """Correlation of two errors of a landmark by the time between them."""

    lag: Array  # (k,) s
    value: Array  # (k,)


def figures(noise: Noise) -> list[ReportFigure]:
    """Draws all that is known."""
    known = {name: one for name in SENSORS if (one := getattr(noise, name)) is not None}
    drawn = [_over_time(name, one, noise.labels[0]) for name, one in known.items()]
    drawn += [_correlations(known), _quantiles(known)] if known else []
    return drawn + ([] if noise.motions is None else [_horizons(noise.motions)])


def autocorrelation(chains: Chains, spread: Array) -> Autocorrelation:
    """The correlation of errors over their standard deviations `spread` (n,), at lags of equal logarithmic width."""
    chain = np.cumsum(np.isinf(chains.gap))
    t = np.cumsum(np.where(np.isinf(chains.gap), 0.0, chains.gap))
    x = chains.error / spread
    lags, products, sizes = [], [], []
    for k in range(1, min(AHEAD, len(x))):
        same = chain[k:] == chain[:-k]
        if not same.any():
            break
        a, b = x[k:][same], x[:-k][same]
        lags.append((t[k:] - t[:-k])[same])
        products.append(a * b)
        sizes.append((a * a + b * b) / 2)
    if not lags:
        return Autocorrelation(np.zeros(0), np.zeros(0))
    lag, product, size = (np.concatenate(one) for one in (lags, products, sizes))
    edges = np.geomspace(max(np.percentile(lag, 0.5), 1e-9), np.percentile(lag, 99) + 1e-9, LAGS + 1)
    bins = np.digitize(lag, edges)
    count, total, scale, middle = (np.bincount(bins, w, LAGS + 2)[1:-1] for w in (None, product, size, lag))
    told = count >= FEWEST
    return Autocorrelation(middle[told] / count[told], total[told] / scale[told])


def _over_time(name: str, one: SightingNoise, label: str) -> ReportFigure:
    error, t = one.chains.error[: one.first], one.t[: one.first]
    used = one.fitted.used[: one.first]
    thin = np.unique(np.linspace(0, len(t) - 1, min(MOST, len(t))).astype(np.int64))
    sd = one.fitted.sd.value
    unit = SENSORS[name]

    def draw(figure: Figure) -> None:
        axes = labelled(figure, "time, s", f"{name} error, {unit}")
        row = thin[used[thin]]
        axes.axhspan(-2 * sd, 2 * sd, color=COLOURS[0], alpha=0.12, linewidth=0)
        axes.plot(t[row], error[row], ".", color=COLOURS[0], markersize=2, rasterized=True)

    caption = f"Of {label}, without outliers. The band is two standard deviations as fitted."
    return report_figure(f"noise-{name}", f"{name.capitalize()} errors over time", caption, HEIGHT, draw)


def _correlations(known: dict[str, SightingNoise]) -> ReportFigure:
    def draw(figure: Figure) -> None:
        axes = labelled(figure, "time between two sightings of a landmark, s", "correlation of their errors")
        largest: list[float] = []
        for k, (name, one) in enumerate(known.items()):
            used, all_ = one.fitted.used, one.chains
            chains = Chains(all_.error[used], all_.stated[used], all_.reach[used], closed(all_.gap, used))
            model = one.fitted.model(0.0)
            spread = np.hypot(model.spread(chains.stated, chains.reach), model.bias)
            found = autocorrelation(chains, spread)
            axes.plot(found.lag, found.value, MARKERS[k], color=COLOURS[k], markersize=4, label=f"{name}, measured")
            if len(found.lag):
                lag = np.geomspace(found.lag.min(), found.lag.max(), 100)
                scale = float(np.mean(model.spread(chains.stated, chains.reach) ** 2))
                total = scale + model.bias**2
                curve = (scale * model.share * np.exp(-lag / model.time) + model.bias**2) / total
                axes.plot(lag, curve, color=COLOURS[k], label=f"{name}, fitted")
                largest += [float(found.lag.min()), float(found.lag.max())]
        axes.axhline(0, color=INK, linewidth=0.6)
        fitted_axis("x", axes, largest)
        legend(figure, axes, 2)

    caption = "At 0 each sighting tells something new; near 1 the next one repeats the error of the last."
    return report_figure("noise-correlation", "Correlation in time", caption, HEIGHT, draw)


def _quantiles(known: dict[str, SightingNoise]) -> ReportFigure:
    def draw(figure: Figure) -> None:
        from scipy.special import ndtri

        axes = labelled(figure, "normal quantile", "error, standard deviations")
        for k, (name, one) in enumerate(known.items()):
            white = np.sort(one.fitted.white)
            at = np.unique(np.linspace(0, len(white) - 1, min(200, len(white))).astype(np.int64))
            normal = ndtri((at + 0.5) / len(white))
            axes.plot(normal, white[at], MARKERS[k], color=COLOURS[k], markersize=2.5, label=name)
        end = np.array(axes.get_xlim())
        axes.plot(end, end, color=INK, linewidth=0.8, label="normal")
        legend(figure, axes, 3)

    caption = "What is new in each error. Steeper than the line at both ends: heavier tails than normal ones."
    return report_figure("noise-quantiles", "Quantiles", caption, HEIGHT, draw)


def _horizons(motions: Motions) -> ReportFigure:
    def draw(figure: Figure) -> None:
        axes = labelled(figure, "time over which errors accumulate, s", "sd over the stated one")
        seconds = np.array([one.seconds for one in motions.horizons])
        values: list[float] = []
        for k, axis in enumerate(AXES):
            scales = np.array([one.scales[k] for one in motions.horizons])
            told = scales[:, 2] < 4 * scales[:, 1]
            low, high = (scales[told, 0] - scales[told, 1], scales[told, 2] - scales[told, 0])
            axes.errorbar(
                seconds[told], scales[told, 0], np.stack((low, high)), fmt=f"-{MARKERS[k]}", color=COLOURS[k],
                markersize=4, elinewidth=1, label=axis,
            )  # fmt: skip
            values += scales[told].ravel().tolist()
        axes.axhline(1, color=INK, linewidth=0.6)
        if np.isfinite(motions.matters):
            axes.axvline(motions.matters, color=INK, linewidth=0.6, linestyle=(0, (2, 2)))
        fitted_axis("x", axes, [*seconds.tolist(), *([motions.matters] if np.isfinite(motions.matters) else [])])
        fitted_axis("y", axes, values)
        legend(figure, axes, 3)

    caption = (
        "1 is as stated. Level: errors are independent. Rising: they add up, as a bias does; falling: they cancel. "
        "Dashed: the time until landmarks have told the pose anew, whose factors are stated."
    )
    return report_figure("noise-odometry", "Odometry: errors over longer and longer times", caption, HEIGHT, draw)
