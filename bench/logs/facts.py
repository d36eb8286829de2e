"""Writes the numbers of a log in words, a few facts per line, for the terminal and for a page."""

from collections.abc import Iterator, Mapping
from math import degrees, tau
from typing import Any

from ...core.factors import REMARKS
from ...core.partial import part_words
from ..measure.landmark_places import Scattered
from ..measure.stated_noise import Measured, NoiseCheck
from ..words.numerals import counted, listed, number, plain
from .agreement import Known
from .difficulty import Difficulty
from .measurements import FixCount, Noise, Parts, Sd, TurnCount
from .numbers import Numbers, Sensor, SightingCount
from .part_errors import Constant, PartCheck

TRUE_ENOUGH = (0.8, 1.25)  # typical error over the stated one that counts as stated correctly
OUTLIERS = 0.01  # share of errors far out from which on they are called outliers: ten times that expected by chance
ALL_ROUND = 5.0  # rad; a wider field of view has no sides
NAMED = 12  # ids that are named; of more, the number of the rest

MISTAKEN = "no noise is measured: see the remark"
CORRECTS = "bench noise LOG --apply FOLDER corrects them"

DEGREE = "\N{DEGREE SIGN}"


def headline(found: Numbers) -> str:
    """Describes the log in a sentence that fits over a picture."""
    parts = [counted(found.way.steps, "step"), f"{number(found.way.odometry_m)} m"]
    if found.times is not None:
        parts.append(_duration(found.times.duration))
    seen = counted(found.seen.sightings, "sighting")
    if found.landmarks is not None:
        seen += f" of {counted(found.landmarks.landmarks, 'landmark')}"
    if found.parts is not None:
        words = part_words(*found.parts[:2], found.seen.sightings)
        seen += f", {words}" if words else ""
    parts.append(seen)
    if found.fixes is not None:
        fixes = zip(found.fixes[:2], ("position", "heading"), strict=False)
        parts += [f"{counted(n, what)} in the world" for n, what in fixes if n]
    if found.turns is not None:
        parts.append(f"{counted(found.turns.turns, 'turn')} by a gyro")
    if found.back.closures:
        parts.append(counted(found.back.closures, "loop closure"))
    return ", ".join([*parts, _comes_back(found)])


def facts(found: Numbers, path: str, *, mistaken: bool = False) -> Iterator[tuple[str, str]]:
    """Yields one (heading, facts) per line; `path` describes the picture's path.

    Of a log that is `mistaken` the sightings' errors are no noise, and none is advised.
    """
    yield "way", _joined(_way(found))
    yield "times", _joined(_times(found))
    yield "sightings", _joined([*_seen(found.seen), *_signed(found.signature)])
    if found.parts is not None:
        yield "a part alone", _joined(_parts(found.parts))
    if found.fixes is not None:
        yield "in the world", _joined(_fixes(found.fixes))
    if found.turns is not None:
        yield "turns by a gyro", _joined(_turns(found.turns))
    if found.landmarks is not None:
        yield "landmarks", _joined(_landmarks(found))
    yield "returns", _joined(_back(found))
    if found.sensor is not None:
        yield "sensor", _joined(_sensor(found.sensor))
    if found.difficulty is not None:
        yield "data association", _joined(_association(found.difficulty))
    yield "stated noise", _joined(_noise(found.noise))
    yield "known", _joined(_known(found, path))
    known = found.known
    if known.scattered is not None:
        yield "not in one place", _scattered(known.scattered)
    if known.corrected is not None:
        yield "errors that stay", _joined([*(one.removesuffix(".") for one in known.corrected.errors), CORRECTS])
    if known.sightings is not None and known.measured is not None:
        yield "sightings against truth", _joined(_sightings(known, mistaken=mistaken))
    if known.ranges is not None:
        yield "ranges against truth", _joined(_part_checked(known.ranges, "range_sd", "m", mistaken=mistaken))
    if known.bearings is not None:
        yield "bearings against truth", _joined(_part_checked(known.bearings, "bearing_sd", DEGREE, mistaken=mistaken))
    if known.odometry is not None:
        after = None if known.corrected is None else known.corrected.odometry
        yield "odometry against truth", _joined(_noise_checked(known.odometry) if after is None else _left(after))


def _duration(seconds: float) -> str:
    """Writes a duration: 12.3 s, 25.6 min or 3.2 h."""
    if seconds < 600:
        return f"{number(seconds)} s"
    return f"{seconds / 60:.1f} min" if seconds < 7200 else f"{seconds / 3600:,.1f} h"


def noted(notes: Mapping[str, Any], *, settings: bool) -> list[tuple[str, str]]:
    """Lists a log's notes; without `settings` only words and the counts that are not 0."""
    said: list[tuple[str, str]] = []
    for name, value in notes.items():
        if name == REMARKS:
            continue  # shown as such
        parts: Any = value
        if isinstance(value, dict):
            if not settings:
                parts = {key: part for key, part in parts.items() if type(part) is int and part}
            parts = ", ".join(f"{key} {part}" for key, part in parts.items())
        if settings or parts:
            said.append((name.replace("_", " "), number(parts) if isinstance(parts, float) else str(parts)))
    return said


def _way(found: Numbers) -> Iterator[str]:
    w = found.way
    yield counted(w.steps, "step")
    yield f"{number(w.odometry_m)} m by odometry"
    if w.known_m is not None:
        yield f"{number(w.known_m)} m by {'truth' if found.known.kind == 'truth' else 'the batch optimum'}"
    if w.speed is not None:
        yield f"{number(w.speed)} m/s on average"
    left = w.turned_left / tau
    side = "left" if left >= 0 else "right"
    yield f"turned {w.turned / tau:.1f} times round in all, {abs(left):.1f} more to the {side}"


def _times(found: Numbers) -> Iterator[str]:
    if found.times is None:
        yield "none: there is one step" if found.way.steps == 1 else "none: t is the number of the step"
        return
    t = found.times
    yield _duration(t.duration)
    yield f"a step every {number(t.median)} s"
    yield f"at most {number(t.longest)} s apart"
    yield f"{counted(t.gaps, 'gap')} of more than 5 times the median" if t.gaps else "no gap"


def _seen(seen: SightingCount) -> Iterator[str]:
    if not seen.sightings:
        yield "none"
        return
    yield f"{seen.sightings:,}"
    middle = f"median {plain(seen.p50)}, 90 % from {plain(seen.p5)} to {plain(seen.p95)}, at most {seen.most:,}"
    yield f"{number(seen.mean)} a step: {middle}"
    if seen.steps_without:
        length = f"{number(seen.longest_without_m)} m"
        if seen.longest_without_s is not None:
            length += f", {_duration(seen.longest_without_s)}"
        yield f"{counted(seen.steps_without, 'step')} without, at most {seen.longest_without:,} in a row ({length})"
    else:
        yield "no step without"
    yield f"{seen.unknown:,} of unknown landmarks" if seen.unknown else "all with an id"


def _signed(signature: Sd | None) -> Iterator[str]:
    if signature is not None:
        yield f"with signatures, stated to {_sd(signature, '')}"


def _parts(parts: Parts) -> Iterator[str]:
    ends = [number(one) for one in parts[2:5] if isinstance(one, float)]
    if ends:
        yield f"{counted(parts.ranges, 'range')}, {ends[0]} to {ends[2]} m, median {ends[1]} m"
    if parts.range_sd is not None:
        yield f"stated to {_sd(parts.range_sd, 'm')}"
    if parts.bearings:
        yield counted(parts.bearings, "bearing")
    if parts.bearing_sd is not None:
        yield f"stated to {_sd(parts.bearing_sd, DEGREE)}"


def _fixes(fixes: FixCount) -> Iterator[str]:
    if fixes.position_sd is not None:
        yield f"{counted(fixes.positions, 'position')}, stated to {_sd(fixes.position_sd, 'm')} in x and y"
    if fixes.heading_sd is not None:
        yield f"{counted(fixes.headings, 'heading')}, stated to {_sd(fixes.heading_sd, DEGREE)}"
    yield f"at {counted(fixes.steps, 'step')}, at most {fixes.longest_without:,} without in a row"


def _turns(turns: TurnCount) -> Iterator[str]:
    noise = "" if turns.sd is None else f", stated to {_sd(turns.sd, DEGREE)}"
    yield f"{counted(turns.turns, 'turn')} since the step before{noise}"
    known = f"with a standard deviation of {number(degrees(turns.bias_sd))}" if turns.bias_sd else "and known"
    yield f"bias {number(degrees(turns.bias))} degrees/s at first, {known}"
    if turns.moves:
        yield f"moving {counted(turns.moves, 'time')}, by {number(degrees(turns.moves_sd))} degrees/s in all"
    if turns.longest_without:
        yield f"at most {counted(turns.longest_without, 'step')} without in a row"


def _landmarks(found: Numbers) -> Iterator[str]:
    marks = found.landmarks
    assert marks is not None
    yield f"{marks.landmarks:,}"
    yield f"each sighted {marks.least:,} to {marks.most:,} times, median {plain(marks.median)}"
    if marks.once:
        yield f"{marks.once:,} seen once"


def _back(found: Numbers) -> Iterator[str]:
    back = found.back
    yield _comes_back(found)
    if back.after_m is not None:
        rule = f"after more than {number(back.after_m)} m of way without it"
        back_to = f" to {counted(back.landmarks, 'landmark')}" if back.returns else ""
        yield f"{counted(back.returns, 'return')}{back_to}, a sighting {rule}"
    if back.closures:
        yield counted(back.closures, "loop closure") + " between poses"
    if back.loops:
        yield f"largest loop {number(back.longest_m)} m, at most {counted(back.longest_steps, 'step')}"


def _sensor(sensor: Sensor) -> Iterator[str]:
    s = sensor
    yield f"ranges {number(s.range_least)} to {number(s.range_most)} m, median {number(s.range_median)} m"
    if s.view > ALL_ROUND:
        yield "bearings all round"
        return
    ends = f"from {_degrees(s.view_right)} to {_degrees(s.view_left)}, left of ahead being positive"
    yield f"99 % of bearings within {degrees(s.view):.0f}{DEGREE}, {ends}"


def _association(found: Difficulty) -> Iterator[str]:
    several = f"{100 * found.several:.0f} % have more than one"
    yield f"{number(found.candidates)} landmarks within the gate of a sighting of a known one ({several})"
    yield f"the right one is outside it for {_percent(found.beyond)}, taken for new for {_percent(found.beyond_new)}"
    yield f"{100 * found.single:.0f} % of the steps with sightings have a single one"
    mistakes = listed([f"{rule} for {_percent(share)}" for rule, share in found.wrong.items()])
    yield f"told all earlier ids, wrong are {mistakes} of the sightings"


def _percent(share: float) -> str:
    return f"{number(100 * share)} %"


def _comes_back(found: Numbers) -> str:
    loops = found.back.loops
    if not found.seen.sightings and not found.back.closures and not loops:
        return "neither a landmark nor a loop closure tells if it comes back"
    if found.seen.sightings and found.back.after_m is None and not found.back.closures:
        if found.landmarks is not None:
            return "returns not counted without whole sightings"
        return "whether it comes back cannot be told without ids"
    return (
        ("never comes back", "comes back once", "comes back twice")[loops]
        if loops < 3
        else f"comes back {loops:,} times"
    )


def _noise(noise: Noise) -> Iterator[str]:
    if noise.range is not None and noise.bearing is not None:
        yield f"range {_sd(noise.range, 'm')}"
        yield f"bearing {_sd(noise.bearing, DEGREE)}"
    if noise.forward is None or noise.sideways is None or noise.turn is None:
        yield "no odometry"
        return
    metres = f"{_sd(noise.forward, 'm')} along, {_sd(noise.sideways, 'm')} across"
    yield f"a step's odometry {metres}, {_sd(noise.turn, DEGREE)}"
    if noise.forward_1m is not None and noise.sideways_1m is not None and noise.turn_1m is not None:
        metres = f"{number(noise.forward_1m)} m along, {number(noise.sideways_1m)} m across"
        yield f"over 1 m of way {metres}, {number(degrees(noise.turn_1m))}{DEGREE}"


def _sd(sd: Sd, unit: str) -> str:
    scale, gap = (degrees(1), "") if unit == DEGREE else (1.0, " " * bool(unit))
    text = f"{number(scale * sd.median)}{gap}{unit}"
    return text if sd.constant else f"{text} ({number(scale * sd.p5)} to {number(scale * sd.p95)})"


def _known(found: Numbers, path: str) -> Iterator[str]:
    k = found.known
    yield _coverage(k, found.way.steps)
    if k.relations:
        yield f"true motions between {counted(k.relations, 'pair')} of poses"
    yield f"{counted(k.landmarks, 'landmark')} with a known place" if k.landmarks else "no landmark's place"
    if k.drift_m is not None:
        share = "" if k.drift_share is None else f", {number(100 * k.drift_share)} % of the way"
        yield f"dead reckoning ends {number(k.drift_m)} m from it{share}"
    yield f"drawn: {path}"


def _coverage(known: Known, steps: int) -> str:
    if known.kind == "truth":
        return "the true pose of " + ("every step" if known.steps == steps else f"{known.steps:,} steps of {steps:,}")
    return "no true path"


def _scattered(scattered: Scattered) -> str:
    one = len(scattered.ids) == 1
    low, high = number(scattered.spread_least), number(scattered.spread_most)
    about = f"{low} m" if low == high else f"{low} to {high} m"
    named = f"id{'s' * (not one)} {listed([str(name) for name in scattered.ids], NAMED)}"
    return (
        f"{named} ({counted(scattered.sightings, 'sighting')}, spread {about}): {'does it' if one else 'do they'} move?"
    )


def _sightings(known: Known, *, mistaken: bool) -> Iterator[str]:
    assert known.sightings is not None
    assert known.measured is not None
    if known.medians:
        yield "against each landmark's median place"
    corrected = known.corrected
    if corrected is not None and corrected.sightings is not None and corrected.measured is not None:
        yield from _left(corrected.sightings)
        yield _measured(corrected.measured)
        return
    yield from _noise_checked(known.sightings)
    yield MISTAKEN if mistaken else _measured(known.measured)


def _left(check: NoiseCheck) -> Iterator[str]:
    """Writes the noise that is left when errors that stay are corrected."""
    first, *others = _noise_checked(check)
    yield f"corrected for errors that stay, {first}"
    yield from others


def _noise_checked(check: NoiseCheck) -> Iterator[str]:
    low, high = TRUE_ENOUGH
    times = f"{number(check.scale)} times"
    if low <= check.scale <= high:
        fit, but = f"typical error as stated ({times})", "but"
    else:
        small = check.scale > high
        fit = f"stated too {'small' if small else 'large'}: the typical error is {times} the stated one"
        but = "and" if small else "but"
    far = f"{number(100 * check.far)} %"
    if check.far > OUTLIERS:
        yield f"{fit}, {but} {far} are far out, where chance has 0.1 %"
    else:
        yield fit
        yield f"{far} far out, where chance has 0.1 %"
    yield f"NEES {number(check.nees)}, where 1 is exact"
    yield f"{check.checked:,} checked"


def _part_checked(check: PartCheck, option: str, unit: str, *, mistaken: bool) -> Iterator[str]:
    """Compares ranges or bearings alone with the truth; one that is off on average has more than noise."""
    scale, gap = (degrees(1), "") if unit == DEGREE else (1.0, " ")
    if check.fitted:
        yield "against the places that fit best along the true path"
    if check.constant is not None:
        yield _taken_off(check.constant)
    yield from _noise_checked(check.stated)
    if mistaken:
        yield MISTAKEN
    elif abs(check.middle) > check.spread:
        long, short = ("too long", "too short") if unit == "m" else ("too far left", "too far right")
        off = f"{number(scale * abs(check.middle))}{gap}{unit} {long if check.middle > 0 else short}"
        about = f"{number(scale * check.spread)}{gap}{unit} about that"
        yield f"measured: in the median {off}, which is no noise, and {about}"
    else:
        yield f"measured: {number(scale * check.sd)}{gap}{unit} ({option}={check.sd:.3g})"


def _taken_off(constant: Constant) -> str:
    """Says which scale and offset, stated as unknown, are not in the errors of ranges."""
    scale, offset, landmarks = constant
    parts = [] if scale is None else [f"{number(100 * abs(scale))} % too {'short' if scale < 0 else 'long'}"]
    parts += [] if offset is None else [f"{number(abs(offset))} m too {'short' if offset < 0 else 'long'}"]
    each = f", the median of {landmarks} landmarks' own" if landmarks else ""
    them = "which the log states as unknown" + each
    return f"without a constant error, {' and '.join(parts)} along the true path, {them}"


def _measured(measured: Measured) -> str:
    """Writes the measured noise, with the settings of a log's reader."""
    metres, radians = measured
    words = f"range {number(metres)} m, bearing {number(degrees(radians))}{DEGREE}"
    return f"measured: {words} (range_sd={metres:.3g}, bearing_sd={radians:.3g})"


def _joined(parts: Iterator[str] | list[str]) -> str:
    return " \N{MIDDLE DOT} ".join(parts)


def _degrees(angle: float) -> str:
    return f"{degrees(angle):+.0f}{DEGREE}"
