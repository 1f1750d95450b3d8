"""The plan of a sweep: reads `--vary`, expands ranges, and forms their product."""

import hashlib
import itertools
import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

from sph import config as configuration
from sph.errors import ConfigError

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_RANGE = re.compile(rf"({_NUMBER}):({_NUMBER}):(x|\+|-)([\d.].*)", re.ASCII | re.DOTALL)
RANGE_FORM = "FIRST:LAST:xFACTOR, FIRST:LAST:+STEP or FIRST:LAST:-STEP"

# A last value within this fraction of a step counts, as 2 does in 1:2:x1.414214.
ROUNDING = Decimal("1e-6")
DIGITS = 12  # of a value of a geometric range: as many as powers of a rounded factor can claim
MOST_VALUES = 10_000  # of one key: more are probably a typing error
MOST_POINTS = 100_000  # directories in one directory, and configurations in memory

# File systems take 255 bytes; a name must also be readable in a table.
LONGEST_NAME = 100


@dataclass(frozen=True)
class Point:
    """One run: the name of its directory, and `key=value` for each key that is varied."""

    name: str
    settings: tuple[str, ...]


@dataclass(frozen=True)
class Plan:
    """The settings that all points share, the values of each varied key, and the points."""

    overrides: tuple[str, ...]
    varied: dict[str, list[str]]
    points: tuple[Point, ...]

    @classmethod
    def of(cls, varies: Sequence[str], overrides: Sequence[str] = ()) -> "Plan":
        """The product of `key=a,b,c` texts, the last key running fastest. Raises ConfigError."""
        varied: dict[str, list[str]] = {}
        for text in varies:
            key, values = _varied(text)
            if key in varied:
                raise ConfigError(f"--vary {text}: {key} is varied already; give all its values")
            varied[key] = values
        if (points := math.prod(map(len, varied.values()))) > MOST_POINTS:
            raise ConfigError(f"--vary: {points:,} points; expected at most {MOST_POINTS:,}")
        _refuse_set_and_varied(overrides, varied)
        return cls(tuple(overrides), varied, _points(varied))

    def resolved(self, config: Path) -> dict[str, configuration.Config]:
        """The valid configuration of every point, by its name.

        Raises FileError for `config`, and ConfigError with all that is wrong with any point.
        """
        found: dict[str, configuration.Config] = {}
        wrong: dict[str, list[str]] = {}
        for point in self.points:
            try:
                overrides = (*self.overrides, *point.settings)
                found[point.name] = configuration.load(config, overrides)
            except ConfigError as error:
                for line in _as_varied(str(error), point).splitlines():
                    wrong.setdefault(line, []).append(point.name)
        if wrong:
            raise ConfigError("\n".join(self._told(*item) for item in wrong.items()))
        if self.varied:
            _refuse_twins(found)
        return found

    def _told(self, line: str, names: list[str]) -> str:
        """An error and, unless all points have it, the points that do."""
        if len(names) == len(self.points) or "--vary" in line:
            return line
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        return f"{line} (at {names[0]}{more})"


def _varied(text: str) -> tuple[str, list[str]]:
    name, equals, values = text.partition("=")
    key = _key(name)
    if not equals or "." not in key or not all(key.split(".")):
        raise ConfigError(f"--vary {text}: expected TABLE.KEY=VALUE,VALUE,…")
    found = [value for part in split(values) for value in expand(part)]
    if not all(found):
        raise ConfigError(f"--vary {text}: a value is empty; expected VALUE,VALUE,…")
    twice = [value for value, count in Counter(found).items() if count > 1]
    if twice:
        raise ConfigError(f"--vary {text}: {twice[0]} is given twice")
    return key, found


def _key(text: str) -> str:
    """A key as it is written without blanks."""
    return ".".join(step.strip() for step in text.split("."))


def _refuse_set_and_varied(overrides: Sequence[str], varied: dict[str, list[str]]) -> None:
    """Raise ConfigError where a value of --vary would replace what --set gives."""
    for override in overrides:
        key = _key(override.partition("=")[0])
        for other in varied:
            if f"{key}.".startswith(f"{other}."):
                raise ConfigError(f"--set {override}: {other} is varied; give its values there")


def _as_varied(message: str, point: Point) -> str:
    """An error in the words of `--vary`, where it comes from a value of it."""
    for setting in point.settings:
        message = message.replace(f"--set {setting}:", f"--vary {setting}:")
    return message


def _refuse_twins(found: dict[str, configuration.Config]) -> None:
    """Raise ConfigError where two points are one configuration, as 0.5 and 0.50 are."""
    names: dict[str, str] = {}
    for name, config in found.items():
        twin = names.setdefault(config.to_toml(), name)
        if twin != name:
            raise ConfigError(f"--vary: {twin} and {name} are the same configuration")


# --- values -----------------------------------------------------------------------------------


def split(text: str) -> list[str]:
    """Parts of `text` between commas that stand in no bracket, brace or quotation."""
    parts, depth, quote = [""], 0, ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        else:
            depth += (letter in "[{") - (letter in "]}")
        if letter == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts]


def expand(text: str) -> list[str]:
    """The values of a range, as TOML, or `text` itself where it is none. Raises ConfigError."""
    form = _RANGE.fullmatch(text)
    if not form:
        return [text]
    if not re.fullmatch(_NUMBER, form[4], re.ASCII):
        raise ConfigError(f"{text}: {form[4]} is not a number; expected {RANGE_FORM}")
    first, last, by = (_number(text, form[part]) for part in (1, 2, 4))
    if form[3] == "x":
        values = _geometric(text, first, last, by)
    else:
        values = _arithmetic(text, first, last, -by if form[3] == "-" else by)
    # A whole number stays one if the range begins with one.
    is_whole = form[1].lstrip("+-").isdecimal() and all(
        one == one.to_integral_value() for one in values
    )
    return [str(int(value)) if is_whole else repr(float(value)) for value in values]


def _number(text: str, number: str) -> Decimal:
    """Decimal, so that 0.05 + 5 x 0.05 is 0.3. Raises ConfigError for what no float64 can be."""
    rounded, nothing = float(number), not re.search(r"[1-9]", re.split("[eE]", number)[0])
    if math.isinf(rounded) or (rounded == 0.0 and not nothing):
        raise ConfigError(f"{text}: {number} is beyond the range of float64 numbers")
    return Decimal(number) if rounded else Decimal(0)


def _geometric(text: str, first: Decimal, last: Decimal, factor: Decimal) -> list[Decimal]:
    if min(first, last, factor) <= 0 or factor == 1:
        raise ConfigError(f"{text}: expected a factor other than 1, and ends above 0")
    steps = _steps(text, (last.ln() - first.ln()) / factor.ln())
    return [Decimal(f"{first * factor**k:.{DIGITS}g}") for k in range(steps + 1)]


def _arithmetic(text: str, first: Decimal, last: Decimal, step: Decimal) -> list[Decimal]:
    if step == 0:
        raise ConfigError(f"{text}: expected a step other than 0")
    return [first + k * step for k in range(_steps(text, (last - first) / step) + 1)]


def _steps(text: str, ratio: Decimal) -> int:
    """Whole steps from the first to the last value."""
    if ratio < -ROUNDING:
        raise ConfigError(f"{text}: steps lead away from the last value; expected {RANGE_FORM}")
    if ratio > MOST_VALUES - 1:
        raise ConfigError(f"{text}: more than {MOST_VALUES:,} values")
    return math.floor(ratio + ROUNDING)


# --- names ------------------------------------------------------------------------------------


def _points(varied: dict[str, list[str]]) -> tuple[Point, ...]:
    products = itertools.product(*([f"{key}={value}" for value in varied[key]] for key in varied))
    settings = list(products)
    plain = [_name(one) for one in settings]
    count = Counter(name.casefold() for name in plain)
    names = [
        _unique(name, one) if count[name.casefold()] > 1 else name
        for name, one in zip(plain, settings, strict=True)
    ]
    return tuple(Point(*pair) for pair in zip(names, settings, strict=True))


def _name(settings: tuple[str, ...]) -> str:
    """A readable name that is safe on every file system, e.g. problem.n=100,physics.alpha=2.0."""
    if not settings:
        return "run"
    text = ",".join(re.sub(r"[\s\"'{}\[\]]+", "", one) for one in settings)
    name = re.sub(r"[^\w.,=+-]+", "_", text, flags=re.ASCII)
    return name if len(name) <= LONGEST_NAME else _unique(name, settings)


def _unique(name: str, settings: tuple[str, ...]) -> str:
    """`name`, shortened, with a hash of what it stands for."""
    digest = hashlib.sha256("\n".join(settings).encode(errors="surrogatepass")).hexdigest()[:8]
    return f"{name[: LONGEST_NAME - 9]}-{digest}"
