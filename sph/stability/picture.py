"""A search as a picture: error and energy drift against the key, and where the default is."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from sph.analysis.figures import style
from sph.output.files import replacing
from sph.stability.command import Found

# of the keys that are searched
SYMBOLS = {"physics.C": "$C$", "physics.eta": r"$\eta$"}
# verdict: marker, colour
LOOKS = {
    "stable": ("o", style.PALETTE[2]),
    "beyond": ("s", style.PALETTE[4]),
    "failed": ("X", style.PALETTE[1]),
}
DEFAULT, LIMIT = "0.6", "black"
# The highest of a logarithmic axis: beyond this a value says no more than that it blew up.
MOST = 1e6
FEW_DECADES = 1.5  # up to which an axis has plain numbers, more than one a decade


def draw(found: Found, path: Path) -> Path:
    """Write the picture. Raises FileError."""
    with style.paper(), replacing(path) as unfinished:
        figure(found).savefig(unfinished, format=path.suffix[1:])
    return path


def figure(found: Found) -> Figure:
    """Two logarithmic panels; a run that has no number stands at the upper end."""
    picture = style.new_figure(8.0, 3.6)
    upper, lower = picture.subplots(1, 2)
    _panel(upper, found, [trial.error for trial in found.trials], 1.0)
    upper.set_ylabel("largest error / its limit")
    _number(upper.yaxis, np.array(upper.get_ylim()))
    _panel(lower, found, [trial.drift for trial in found.trials], found.judge.drift)
    lower.set_ylabel("largest energy drift")
    picture.suptitle(f"{style.plain(found.config)}, {style.plain(found.scheme)}")
    seen = {trial.verdict for trial in found.trials}
    marks = [
        Line2D([], [], marker=marker, color=colour, linestyle="none", label=verdict)
        for verdict, (marker, colour) in LOOKS.items()
        if verdict in seen
    ]
    lines = [
        Line2D([], [], color=LIMIT, linestyle=":", label="limit"),
        Line2D([], [], color=DEFAULT, linewidth=3, alpha=0.5, label="configuration"),
    ]
    picture.legend(handles=[*marks, *lines], loc="outside lower center", ncols=5)
    return picture


def _panel(panel, found: Found, values, limit: float) -> None:
    values = np.array(values, dtype=float)
    keys = np.array([trial.value for trial in found.trials])
    has = np.isfinite(values) & (values < MOST * limit)
    shown = [limit, *values[has & (values > 0.0)]]
    low, top = 0.5 * min(shown), 3.0 * max(shown)
    heights = np.where(has, np.maximum(values, low), top)
    panel.plot(keys[has], heights[has], color="0.8", zorder=1)
    for verdict, (marker, colour) in LOOKS.items():
        those = np.array([trial.verdict == verdict for trial in found.trials])
        panel.scatter(keys[those], heights[those], marker=marker, color=colour, s=40, zorder=3)
    panel.axhline(limit, color=LIMIT, linestyle=":", zorder=2)
    panel.axvline(found.default, color=DEFAULT, linewidth=3, alpha=0.5, zorder=0)
    panel.set(xscale="log", yscale="log", xlabel=SYMBOLS[found.key], ylim=(low, 1.5 * top))
    _number(panel.xaxis, keys)


def _number(axis, values: np.ndarray) -> None:
    """Plain numbers on an axis that is too short for powers of ten."""
    decades = np.log10(values.max() / values.min())
    if decades > FEW_DECADES:
        return
    subs = (1.0, 2.0, 5.0) if decades > 0.8 else (1.0, 1.4, 2.0, 3.0, 4.0, 5.0, 7.0)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
