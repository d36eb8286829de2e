"""Builders of backends with data association, and with landmarks that move taken out before it."""

import dataclasses
from functools import cache
from typing import Any

import numpy as np

from ...core.factors import Prior
from ..api import Backend, Builder, Expects, Unites, Unsuited
from .layer import Associating
from .options import UNITING, options_with
from .standing import Standing


@cache
def associating(builder: Builder) -> Builder:
    """The builder with the options of data association, and of what is taken out before it; itself if it has none."""
    if not (builder.expects or (isinstance(builder.make, type) and issubclass(builder.make, Expects))):
        return builder

    def associates(options: Any) -> bool:
        return getattr(options, "association", "none") != "none"

    def layered(options: Any) -> bool:
        return associates(options) and options.association not in builder.rules

    def make(prior: Prior, options: Any, rng: np.random.Generator) -> Backend:
        takes_out = getattr(options, "moved", "kept") == "out"
        if associates(options) and not layered(options):
            if takes_out:
                raise Unsuited(f"association={options.association} is the backend's own: no moved=out in front of it")
            return builder.rules[options.association](prior, options, rng)
        inner = builder.make(prior, options, rng)
        what = "data association" if associates(options) else "moved=out"
        if not associates(options) and not takes_out:
            return inner
        if not isinstance(inner, Expects):
            raise Unsuited(f"with these options the backend cannot state what it expects to see: no {what}")
        if prior.map is not None and prior.map.cov is None:
            raise Unsuited(f"{what} needs the covariance of the given map, which has none")
        if associates(options) and options.merge and (takes_out or not isinstance(inner, Unites)):
            raise Unsuited(f"merge=true needs a backend that can unite landmarks, {UNITING}, without moved=out")
        if takes_out:
            inner = Standing(inner, prior)
        return Associating(inner, prior, options) if associates(options) else inner

    make.__doc__ = builder.make.__doc__
    return dataclasses.replace(
        builder,
        make=make,
        options=options_with(builder.options, tuple(builder.rules)),
        associates=associates,
        associates_partial=layered if builder.partial else None,
    )
