"""Says in words and rows what the noise of logs is."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from ..systematic import words as systematic
from ..systematic.estimated import Estimated
from ..words.numerals import listed, number
from .gauss_markov import IN_A_ROW, Fitted
from .measured import Noise, SightingNoise
from .motions import AXES, Motions

SENSORS = {"range": "m", "bearing": "rad"}  # name of a kind of sighting -> its unit

MATTERS = 0.3  # correlation of landmarks sighted at one step, share of correlated variance: said from here on
HEAVY = 10.0  # degrees of freedom below which tails are called heavy
RESCALED = 1.5  # factor of ranges from which on the stated noise is not what it was
ALIKE = 1.25  # times by which factors at two horizons may differ


class NoiseRow(NamedTuple):
    """One number of the noise."""

    name: str
    estimate: Estimated
    unit: str  # "" for a factor, a power or a share

    @property
    def value(self) -> str:
        """The number with its unit."""
        return f"{number(self.estimate.value)} {self.unit}".strip()

    @property
    def interval(self) -> str:
        """Its 95 % interval."""
        return f"{number(self.estimate.low)} to {number(self.estimate.high)}"


def rows(noise: Noise) -> Iterator[NoiseRow]:
    """Yields all numbers of the noise."""
    if noise.frame is not None:
        for title, estimate, unit in systematic.rows_of_frame(noise.frame):
            yield NoiseRow(title, estimate, unit)
    for label, told in noise.delays:
        if told.late is not None:
            name = f"{_of_log(noise, label)}{told.sensor}: delay by the turns of the {told.by}"
            yield NoiseRow(name, told.late, "s")
    for noun, found in noise.late:
        yield NoiseRow(f"{noun} alone: delay", found.delay, "s")
    if noise.systematic is not None:
        for title, estimate, unit in systematic.rows(noise.systematic):
            yield NoiseRow(title, estimate, unit)
    found = noise.innovations
    if found is not None:
        for name in ("translation", "turn", "range", "bearing"):
            yield NoiseRow(f"{name}: sd over the stated one", getattr(found, name), "")
    for name, unit in SENSORS.items():
        one: SightingNoise | None = getattr(noise, name)
        if one is not None:
            yield from _sighting_rows(name, unit, one, sizes=found is None)
    if noise.motions is not None:
        for k, axis in enumerate(AXES):
            for horizon in noise.motions.horizons:
                seconds = number(horizon.seconds)
                yield NoiseRow(f"odometry, {axis}: sd over the stated one, in {seconds} s", horizon.scales[k], "")
            yield NoiseRow(f"odometry, {axis}: to state", noise.motions.scales[k], "")


def _sighting_rows(name: str, unit: str, one: SightingNoise, *, sizes: bool) -> Iterator[NoiseRow]:
    fit = one.fitted
    if sizes:
        yield NoiseRow(f"{name}: sd at {number(fit.reach)} m", fit.sd, unit)
        yield NoiseRow(f"{name}: sd over the stated one", fit.scale, "")
        if fit.power is not None:
            yield NoiseRow(f"{name}: power of the distance beyond the stated one", fit.power, "")
        yield NoiseRow(f"{name}: mean error", fit.mean, unit)
        if fit.bias is not None:
            yield NoiseRow(f"{name}: sd of one bias per landmark", fit.bias, unit)
    if fit.correlation is not None:
        yield NoiseRow(f"{name}: time of correlation", fit.correlation.time, "s")
        yield NoiseRow(f"{name}: share of variance that is correlated", fit.correlation.share, "")
    if sizes and one.together is not None:
        yield NoiseRow(f"{name}: correlation of landmarks sighted at one step", one.together, "")
    if fit.tails is not None:
        yield NoiseRow(f"{name}: degrees of freedom of Student's tails", fit.tails, "")
    yield NoiseRow(f"{name}: share of outliers", fit.outliers, "")


def sentences(noise: Noise) -> list[str]:
    """Says what was found, the most important first."""
    said = [] if noise.frame is None else [systematic.of_frame(noise.frame)]
    said += [] if noise.systematic is None else list(systematic.sentences(noise.systematic))
    late = [systematic.of_late(found, noun) for noun, found in noise.late if found.certain]
    said += [f"{one[0].upper()}{one[1:]}." for one in late]
    said += [
        sentence
        for name in SENSORS
        if (one := getattr(noise, name)) is not None
        for sentence in _correlated(name, one.fitted)
    ]
    for name, unit in SENSORS.items():
        one = getattr(noise, name)
        if one is not None and noise.innovations is None:
            said += _sized(name, unit, one, noise)
    if noise.innovations is not None:
        found = noise.innovations
        names = ("translation", "turn", "range", "bearing")
        parts = [f"{_at_end(getattr(found, name))}{number(getattr(found, name).value)} for {name}" for name in names]
        said.append(
            f"By the EKF's innovations the standard deviations are these multiples of the stated ones: {listed(parts)}."
        )
    if noise.motions is not None:
        said += _driven(noise.motions)
    return said + [f"{_of_log(noise, label)}{told.sentence}" for label, told in noise.delays]


def _of_log(noise: Noise, label: str) -> str:
    """The log's name before a word, where there are several."""
    return f"{label}: " if len({other for other, _ in noise.delays}) > 1 else ""


def _at_end(factor: Estimated) -> str:
    """Words for a factor that is at an end of the search."""
    return "at most " if factor.low == 0 else "at least " if factor.high == math.inf else ""


def _correlated(name: str, fit: Fitted) -> Iterator[str]:
    if fit.correlation is None:
        yield f"{name.capitalize()} errors are not correlated from one sighting of a landmark to the next."
        return
    yield (
        f"{name.capitalize()} errors stay correlated for {number(fit.correlation.time.value)} s: {IN_A_ROW} sightings "
        f"of a landmark in a row carry the information of {number(fit.in_a_row)}."
    )


def _rescaled(name: str, noise: Noise) -> str:
    """Says that the stated noise is taken along where ranges are divided by much."""
    found = noise.systematic
    scale = found.errors.range_scale if found is not None and name == "range" else 0.0
    factor = 1 + scale
    if 1 / RESCALED < factor < RESCALED:
        return ""
    return f", both once ranges and what is stated of them are divided by {number(factor)}, as by --apply"


def _sized(name: str, unit: str, one: SightingNoise, noise: Noise) -> Iterator[str]:
    fit = one.fitted
    sentence = (
        f"{name.capitalize()}s have a standard deviation of {number(fit.sd.value)} {unit} at {number(fit.reach)} m, "
        f"{number(fit.scale.value)} times the stated one{_rescaled(name, noise)}"
    )
    if fit.power is not None and not fit.power.low <= 0 <= fit.power.high:
        grows = "grows" if fit.power.value > 0 else "falls"
        sentence += f"; the ratio {grows} with the distance, to the power {number(abs(fit.power.value))}"
    yield sentence + "."
    if one.together is not None and one.together.low > 0 and one.together.value > MATTERS:
        yield (
            f"{name.capitalize()} errors of landmarks sighted at one step are {number(one.together.value)} correlated: "
            "several landmarks tell little more than one, as with an error of time or of heading."
        )
    if fit.bias is not None:
        yield f"Each landmark has a {name} bias of its own, of {number(fit.bias.value)} {unit} typically."
    if fit.tails is not None and fit.tails.value < HEAVY:
        yield (
            f"{name.capitalize()} errors have heavy tails, as Student's t with {number(fit.tails.value)} degrees of "
            "freedom: use a robust loss or a gate."
        )
    if fit.outliers.value > 0:
        yield f"{number(100 * fit.outliers.value)} % of {name}s are outliers, left out of these numbers."


def _driven(motions: Motions) -> Iterator[str]:
    parts = [f"{number(one.value)} {axis}" for axis, one in zip(AXES, motions.scales, strict=True)]
    yield f"The odometry's standard deviations are these multiples of the stated ones: {listed(parts)}."
    for k, axis in enumerate(AXES):
        step, held = motions.horizons[0].scales[k], motions.scales[k]
        ratio = held.value / step.value
        if max(ratio, 1 / ratio) > ALIKE:
            how = "add up" if ratio > 1 else "cancel"
            yield f"{axis.capitalize()} errors {how} over time: single steps alone would ask for {number(step.value)}."
