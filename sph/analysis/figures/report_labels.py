"""Words and numbers on the pictures of a report."""

import re

from sph.analysis.report.compare import Series

SYMBOLS = {"alpha": r"$\alpha$", "eta": r"$\eta$", "gamma": r"$\gamma$", "C": "$C$", "n": "$N$"}


def short(label: str) -> str:
    """A label with symbols for keys that have one: alpha = 1.0 is α = 1.0.

    A range to switch in, {min = 0.1, max = 2.0}, is 0.1 to 2.0, and further keys follow it.
    """
    label = re.sub(r"\{\s*min = ([^,}]+), max = ([^,}]+?)\s*(,[^}]*)?\}", _range, label)
    found = re.sub(r"(^|, )(\w+)(?= = )", lambda key: key[1] + SYMBOLS.get(key[2], key[2]), label)
    return found.replace("_", " ")


def value_alone(label: str) -> str:
    """A label of one key without its name, where the panel has that: grad_h of scheme = grad_h.

    Keys with a symbol keep it.
    """
    name, _, value = label.partition(" = ")
    return value if " = " not in value and name not in SYMBOLS else label


def tick(value: float, _position=None) -> str:
    """0.05, 300 or 1.5 x 10^-5."""
    if 1e-3 <= value < 1e4:
        return f"{value:g}"
    mantissa, exponent = f"{value:.1e}".split("e")
    mantissa = mantissa.removesuffix(".0")
    power = f"10^{{{int(exponent)}}}"
    return f"${power}$" if mantissa == "1" else rf"${mantissa}\times {power}$"


def power(line: Series) -> str:
    if line.has_fixed_costs:
        return "fixed costs dominate"
    return "" if line.exponent is None else rf"error $\propto$ cost$^{{{line.exponent:.2f}}}$"


def order(line: Series) -> str:
    return "" if line.order is None else f"order {line.order:.2f}"


def _range(found: re.Match) -> str:
    rest = re.sub(r'switch = |"', "", found[3] or "").strip(" ,")
    return f"{found[1]} to {found[2]}" + (f" ({rest})" if rest else "")
