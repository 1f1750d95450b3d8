"""How pictures look: type, colours, symbols. Colours are told apart by the colour-blind too."""

import io
import math
import re
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import matplotlib
import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from PIL import Image

from sph.output.files import replacing
from sph.quantity import exponents

DPI = 180

SYMBOLS = {
    "density": r"$\rho$",
    "column_density": r"$\Sigma$",
    "velocity": r"$v$",
    "v_r": r"$v_r$",
    "v_phi": r"$v_\phi$",
    "pressure": r"$P$",
    "internal_energy": r"$u$",
    "stress": r"$-\sigma_{xx}$",
    "speed": r"$|\mathbf{v}|$",
    "plastic_strain": r"$\varepsilon_p$",
    "von_mises": r"$\sigma_{\mathrm{vM}}$",
}
TITLES = {
    "v_r": "radial velocity", "v_phi": "rotation velocity", "plastic_strain": "plastic strain",
    "von_mises": "von Mises stress", "internal_energy": "specific internal energy",
    "stress": "axial stress", "column_density": "column density",
}  # fmt: skip
AXES = {"x": "$x$", "r": "distance from the centre $r$"}
# Perceptually uniform, one a field, so that a reader does not take one for another.
MAPS = {
    "density": "viridis", "pressure": "inferno", "internal_energy": "bone", "speed": "cividis",
    "plastic_strain": "magma", "von_mises": "plasma", "column_density": "YlGnBu_r",
}  # fmt: skip
VACUUM = "0.85"
LONGEST_LABEL = 27  # letters in a line beside the lowest panels, those of histories
# Commands of mathematics: of fonts and braces, which take no width, and of one letter.
WIDTHLESS, LETTER = re.compile(r"\\math[a-z]+|[${}^_]"), re.compile(r"\\([a-zA-Z]+|,)")
MOST_DECADES = 4

# Okabe & Ito (2008), the dark ones first.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
EXACT = "black"

SETTINGS: dict[Any, Any] = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 11,
    "axes.labelsize": 12,
    "axes.titlesize": 12,
    "figure.titlesize": 13,
    "legend.fontsize": 10,
    "legend.frameon": False,
    "legend.handlelength": 1.5,
    "axes.linewidth": 0.8,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "lines.linewidth": 1.2,
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.use_mathtext": True,
    "figure.constrained_layout.h_pad": 0.07,
    "pdf.fonttype": 42,  # letters stay letters, as journals ask
    "svg.fonttype": "path",
}


# Units that have a symbol of their own.
UNITS = {
    "M_sun": r"M_\odot", "R_sun": r"R_\odot", "M_earth": r"M_\oplus", "R_earth": r"R_\oplus",
    "M_jup": r"M_{\mathrm{J}}", "um": r"\mu\mathrm{m}",
}  # fmt: skip


def labelled(label: str, unit: str, units) -> str:
    """A label with its unit in brackets, if the run has physical units.

    unit: as quantities state it, such as "mass length^-D"; units: the table [units].
    """
    symbol = unit_symbol(unit, units)
    return f"{label} [{symbol}]" if symbol else label


def unit_symbol(unit: str, units) -> str:
    """The symbol of a unit, as mathematics; empty without physical units. See `labelled`."""
    powers = exponents(unit)
    if not units.are_given or not powers or not any(powers):
        return ""
    factors = [
        UNITS.get(name, rf"\mathrm{{{name}}}".replace(" ", r"\ "))
        + (f"^{{{power}}}" if power != 1 else "")
        for name, power in units.factors(*powers)
    ]
    product = r"\,".join(factors)
    return f"${product}$"


def in_two_lines(label: str) -> str:
    """A label for a vertical axis: its unit is on a second line where one line is too long."""
    return label.replace(" [$", "\n[$") if letters(label) > LONGEST_LABEL else label


def letters(label: str) -> int:
    """Letters that are seen, roughly: a command of mathematics shows as one or none."""
    return len(LETTER.sub(" ", WIDTHLESS.sub("", label)))


@contextmanager
def paper(dpi: int | None = None):
    """The settings of all pictures, within the block. dpi: of files, by default DPI."""
    with matplotlib.rc_context(SETTINGS | ({"savefig.dpi": dpi} if dpi else {})):
        yield


def new_figure(
    width: float,
    height: float,
    layout: Literal["constrained", "compressed"] = "constrained",
) -> Figure:
    """An empty figure of that size in inches, which belongs to no window."""
    return Figure(figsize=(width, height), dpi=DPI, layout=layout)


def save_png(figure: Figure, path: Path, colours: int = 256, **settings) -> Path:
    """Write a picture of lines on white; returns its path. Raises FileError.

    At most 256 `colours` make a third of the bytes. settings: of `Figure.savefig`.
    """
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", **settings)
    with replacing(path) as unfinished, Image.open(drawn) as image:
        image.convert("RGB").quantize(colours, dither=Image.Dither.NONE).save(
            unfinished, format="png", optimize=True
        )
    return path


def colours(count: int) -> list:
    """For things without an order."""
    return list(PALETTE[:count]) if count <= len(PALETTE) else sequence(count)


def sequence(count: int) -> list:
    """For things in order, such as times, from dark to light."""
    ramp = matplotlib.colormaps["viridis"]
    return [ramp(0.9 * i / max(count - 1, 1)) for i in range(count)]


def scale(values) -> Normalize:
    """For a map: logarithmic where positive values span three decades, at most MOST_DECADES, or
    where a peak of more than 10 times the median would press all the rest into one colour.
    """
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return Normalize(0.0, 1.0)
    low, high = float(finite.min()), float(finite.max())
    if low > 0.0 and (high > 1000.0 * low or high > 10.0 * float(np.median(finite))):
        return LogNorm(lowest_of_log(low, high), high)
    return linear(low, high)


def linear(low: float, high: float) -> Normalize:
    """A linear scale for values from `low` to `high`."""
    if high - low <= 1e-6 * abs(high):  # uniform gas: do not magnify round-off
        margin = 0.1 * abs(high) or 1.0
        return Normalize(low - margin, high + margin)
    return Normalize(low, high)


def lowest_of_log(low: float, high: float) -> float:
    """The lower end of a logarithmic scale for values from `low` to `high`."""
    return max(low, high / 10.0**MOST_DECADES)


def label(name: str) -> str:
    """Name and symbol of a field, for an axis."""
    return f"{TITLES.get(name, name)} {SYMBOLS[name]}"


def number(value: float) -> str:
    """Three digits for a label, e.g. 0.00488 or 3.1 x 10^-5."""
    if value == 0.0 or 1e-3 <= abs(value) < 1e4 or not math.isfinite(value):
        return f"{value:.3g}"
    mantissa, exponent = f"{value:.2e}".split("e")
    return rf"${mantissa}\times10^{{{int(exponent)}}}$"


def shortest(value: float) -> str:
    """Up to four digits, e.g. 0.3 or 1.243 x 10^-5."""
    mantissa, _, exponent = f"{value:.4g}".partition("e")
    return rf"${mantissa}\times10^{{{int(exponent)}}}$" if exponent else mantissa


def plain(text: str) -> str:
    """A name shown as it is, where Matplotlib would read mathematics into it."""
    return text.replace("$", r"\$")
