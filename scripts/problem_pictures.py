"""Draw docs/images/problems/: a picture for the page of each problem, of its shipped configuration.

    python scripts/problem_pictures.py                 all problems: a quarter of an hour
    python scripts/problem_pictures.py noh yee         these
    python scripts/write_problems.py                   and then the pages

Problems in the table PICTURES of write_problems.py have other pictures. Runs that are in the
directory of runs already are not repeated.
"""

import argparse
from pathlib import Path

from PIL import Image
from write_problems import PICTURES

import sph
from sph import registry
from sph.analysis import figures

ROOT = Path(__file__).parents[1]
TARGET = ROOT / "docs" / "images" / "problems"
CHOICE = ("profiles", "evolution", "slice", "map")  # the first of these that `sph plot` draws
SHORTER = {"evrard": {"problem.n": 20000}}
WIDTH, COLOURS = 1000, 256  # pixels; a palette makes small files


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="problems; default: all")
    parser.add_argument("--runs", type=Path, default=Path("runs/pictures"), metavar="DIR",
                        help="directory of the runs; default: runs/pictures")  # fmt: skip
    given = parser.parse_args()
    every = [name for name in registry.names("sph.problems") if name not in PICTURES]
    for name in given.names or every:
        draw(name, given.runs / name)
        print(f"wrote {TARGET / name}.png")


def draw(name: str, run: Path) -> None:
    """Write the picture of a problem; run: directory of its run, which may be there already."""
    if not run.exists():
        sph.run(ROOT / "configs" / f"{name}.toml", SHORTER.get(name, {}), output=run)
    drawn = {path.stem: path for path in figures.draw([run])}
    picture = Image.open(next(drawn[one] for one in CHOICE if one in drawn)).convert("RGB")
    picture.thumbnail((WIDTH, 2 * WIDTH))
    TARGET.mkdir(parents=True, exist_ok=True)
    picture.quantize(COLOURS).save(TARGET / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
