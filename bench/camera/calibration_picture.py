"""Draws a calibration in one picture: coverage, residuals, and errors by view."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from ...frontend.boards.charuco import GRID, Calibration, coverage
from ..drawing.axes import short
from ..drawing.picture import picture
from ..words.styles import COLOURS

ARROW = 0.04  # share of the image's width that the arrow of a large residual takes
NAMED = 40  # views up to which each bar has its name

_GOOD, _BAD, _EMPTY, _INK = COLOURS[0], COLOURS[1], "#eeeeee", "#222222"


def write_picture(path: Path, found: Calibration) -> None:
    """Draws `found` into `path`, whole or not at all; its suffix is the format."""
    bars = min(len(found.fits), NAMED)
    with picture(path, (10.5, max(4.6, 1.4 + 0.19 * bars))) as figure:
        image, errors = figure.subplots(1, 2, width_ratios=(2, 1))
        _image(image, found)
        _errors(errors, found)
        (fx, fy), (sx, sy) = found.camera.focal, found.sd[:2]
        title = f"fx {fx:.1f} ± {sx:.1f} px, fy {fy:.1f} ± {sy:.1f} px; {len(found.fits)} views, RMS {found.rms:.2f} px"
        figure.suptitle(title, x=0.01, ha="left", fontsize=11, fontweight="bold")


def _image(axes: Axes, found: Calibration) -> None:
    """Draws the corners with magnified residuals; the image's parts without a corner are grey."""
    camera = found.camera
    corners = np.vstack([fit.view.corners for fit in found.fits])
    residuals = np.vstack([fit.residuals for fit in found.fits])
    bad = np.concatenate([np.full(len(fit.residuals), fit.bad) for fit in found.fits])
    across, down = camera.width / GRID[0], camera.height / GRID[1]
    for i, j in np.argwhere(~coverage(corners, (camera.width, camera.height))):
        axes.add_patch(Rectangle((i * across - 0.5, j * down - 0.5), across, down, color=_EMPTY, linewidth=0, zorder=0))
    large = _round(float(np.percentile(np.hypot(*residuals.T), 95)))
    magnified = _round(ARROW * camera.width / large)
    for marked, colour in ((bad, _BAD), (~bad, _GOOD)):
        (u, v), (du, dv) = corners[marked].T, magnified * residuals[marked].T
        axes.plot(u, v, ".", color=colour, markersize=3.5, markeredgewidth=0)
        axes.quiver(
            *(u, v, du, dv), angles="xy", scale_units="xy", scale=1, color=colour, width=0.0022, headwidth=4, zorder=3
        )
    length = magnified * large
    start, below = camera.width - 0.5 - length, camera.height * 1.06
    axes.annotate(
        "",
        (start + length, below),
        (start, below),
        arrowprops={"arrowstyle": "->", "color": _INK, "shrinkA": 0, "shrinkB": 0},
        annotation_clip=False,
    )
    label = f"arrows: seen minus expected, {magnified:,.0f} times larger; this one is {large:g} px"
    axes.text(start - 0.01 * camera.width, below, label, ha="right", va="center", fontsize=8.5)
    axes.set_xlim(-0.5, camera.width - 0.5)
    axes.set_ylim(camera.height - 0.5, -0.5)
    axes.set_aspect("equal")
    axes.spines[["top", "right"]].set_visible(True)
    axes.xaxis.tick_top()
    axes.tick_params(length=2, labelsize=8)
    axes.set_title(f"Corners seen in {100 * found.coverage:.0f} % of the image; grey: none yet, hold the board there")


def _errors(axes: Axes, found: Calibration) -> None:
    errors = [fit.error for fit in found.fits]
    rows = np.arange(len(errors))
    axes.barh(rows, errors, 0.7, color=[_BAD if fit.bad else _GOOD for fit in found.fits])
    axes.axvline(found.rms, color=_INK, linewidth=0.9, linestyle=(0, (4, 2)))
    axes.text(found.rms, 1.0, " RMS of all", transform=axes.get_xaxis_transform(), va="bottom", fontsize=8.5)
    if len(errors) <= NAMED:
        axes.set_yticks(rows, [short(fit.view.name) for fit in found.fits])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(errors) - 0.4, -0.6)
    axes.set_xlim(0, 1.15 * max(errors))
    axes.set_xlabel("error of a view's corners, px RMS")
    axes.spines["left"].set_visible(False)
    bad = sum(fit.bad for fit in found.fits)
    axes.set_title(f"Error by view{f'; {bad} far from the others' if bad else ''}", pad=18)


def _round(value: float) -> float:
    """Rounds `value` down to 1, 2 or 5 times a power of ten; 1 where it is 0."""
    if not value > 0:
        return 1.0
    decade = 10.0 ** np.floor(np.log10(value))
    return float(max(step * decade for step in (1, 2, 5) if step * decade <= value * (1 + 1e-9)))
