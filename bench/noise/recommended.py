"""Names backends for a log with a measured noise, and says what of it no log can state."""

from ...core.factors import UNKNOWN, Log
from ...datasets.noise.model import Model

MOST = 0.9
"""Largest share that `backends` names. Ranges whose errors hardly change from one sighting to the next would tell
motion to the millimetre, if the process were exactly the fitted one."""

RECOMMENDED = ("ekf[gate=0.999,jacobians=first-estimates]", "isam2[loss=cauchy]")
"""Backends whose NEES holds on a log that is stated so. With the standard Jacobians the EKF stays overconfident: what
remains is its linearisation. Gate and loss are for tails heavier than normal ones."""


def backends(model: Model, *, own: bool = False) -> tuple[str, ...]:
    """Names backends for a log stated under `model`, with their options.

    With `own`, that is the one that estimates the correlated part of sightings.
    """
    if not own:
        return RECOMMENDED
    options = [
        f"{name}_{key}={value:.3g}"
        for name, one in (("range", model.range), ("bearing", model.bearing))
        if one is not None and one.share > 0
        for key, value in (("share", min(one.share, MOST)), ("time", one.time))
    ]
    return (f"bias-ekf[{','.join([*options, 'gate=0.999'])}]",)


def unstated(log: Log, model: Model) -> str:
    """Says what of the noise `stated` cannot state in the log; "" where that is nothing."""
    slow = any(one is not None and one.share > 0 for one in (model.range, model.bearing))
    if not slow or not len(log.ids) or (log.ids != UNKNOWN).any():
        return ""
    return "no sighting has an id, so none is known to follow another of its landmark: their correlation is not stated"
