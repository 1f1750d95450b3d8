"""The density of a run, drawn by each program itself, for check_readers.py.

In 3-D: on the plane through the middle of the box. In 1-D, where these programs have no pictures:
dots at the positions that each program sees.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import check_readers_open as opened
import matplotlib.pyplot as plt
import numpy as np
from check_readers_open import Files, Reader
from matplotlib.figure import Figure

from sph.analysis import figures
from sph.analysis.figures.style import save_png
from sph.analysis.figures.view import View

PIXELS = 400
COLOURS = "viridis"
ROW = 3  # panels in a row of the picture of all programs


def draw(files: Files, readers: Sequence[Reader], directory: Path) -> Iterator[Path]:
    """Draw with each program, and all pictures side by side; yield the files."""
    directory.mkdir(parents=True, exist_ok=True)
    pictures = {}
    if files.state.particles.dimension > 1:
        pictures["sph plot"] = directory / "sph.png"
        figures.draw([files.checkpoint], directory / "sph.png", View(field="density"))
        yield directory / "sph.png"
    for reader in readers:
        path = pictures[reader.name] = directory / f"{reader.name.lower()}.png"
        if files.state.particles.dimension == 1:
            dots(files, reader, path)
        else:
            PICTURES[reader.name](files, path)
        yield path
    yield side_by_side(pictures, directory / "readers.png")


def side_by_side(pictures: dict[str, Path], path: Path) -> Path:
    """Write all pictures in rows of three, each under the name of its program."""
    figure = Figure((3.2 * ROW, 2.8 * -(-len(pictures) // ROW)), layout="constrained")
    panels = figure.subplots(-(-len(pictures) // ROW), ROW, squeeze=False).ravel()
    for panel in panels:
        panel.set_axis_off()
    for panel, (name, one) in zip(panels, pictures.items(), strict=False):
        panel.imshow(cropped(plt.imread(one)), interpolation="antialiased")
        panel.set_title(name, fontsize=11)
    return save_png(figure, path, dpi=110)


def cropped(image: np.ndarray) -> np.ndarray:
    """Return the image without white margins."""
    inked = (image[..., :3] < 0.99).any(axis=2)
    (rows,), (columns,) = np.nonzero(inked.any(axis=1)), np.nonzero(inked.any(axis=0))
    return image[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def dots(files: Files, reader: Reader, path: Path) -> None:
    seen = reader.see(files)
    figure = Figure((4.0, 4.0), layout="constrained")
    panel = figure.subplots()
    panel.plot(seen["position"][:, 0], seen["density"], ".", ms=2)
    panel.set(xlabel="x", ylabel="density")
    figure.savefig(path, dpi=100)


def save(figure, path: Path) -> None:
    figure.savefig(path, dpi=100, bbox_inches="tight")
    plt.close(figure)


def scale(files: Files, units: str = "code") -> tuple[float, float]:
    """Return the ends of the scale of colours: the range of the density."""
    density = files.state.particles.density
    factor = files.state.config.units.factor(-3, 1, 0) if units == "cgs" else 1.0
    return float(density.min()) * factor, float(density.max()) * factor


# --- one program each -------------------------------------------------------------------------


def by_yt(files: Files, path: Path) -> None:
    import yt

    data = opened.open_in_yt(files)
    width = [(float(side), "cm") for side in opened.box(files)[:2]]
    plot = yt.SlicePlot(data, "z", ("gas", "density"), width=width, buff_size=(PIXELS, PIXELS),
                        center=data.arr(opened.box(files) / 2, "cm"))  # fmt: skip
    plot.set_log(("gas", "density"), False)
    plot.set_cmap(("gas", "density"), COLOURS)
    plot.set_zlim(("gas", "density"), *scale(files, "cgs"))
    plot.set_figure_size(5)
    plot.set_font_size(14)
    plot.save(str(path))


def by_pynbody(files: Files, path: Path) -> None:
    import pynbody

    gas = pynbody.load(str(files.checkpoint)).gas
    gas["pos"] -= gas["pos"].units.ratio("cm") ** -1 * opened.box(files) / 2
    side = float(opened.box(files)[:2].max() / gas["pos"].units.ratio("cm"))
    figure, panel = plt.subplots(figsize=(5, 4))
    # in 2-D the mean along z of a layer, in which a slice would depend on its thickness
    pynbody.plot.sph.image(
        gas, qty="rho", width=side, resolution=PIXELS, log=False, cmap=COLOURS, axes=panel,
        **dict(zip(("vmin", "vmax"), scale(files), strict=True)),
        weight=files.state.particles.dimension == 2, units=gas["rho"].units,
    )  # fmt: skip
    save(figure, path)


def by_swiftsimio(files: Files, path: Path) -> None:
    import swiftsimio
    from swiftsimio.visualisation.projection import project_gas
    from swiftsimio.visualisation.slice import slice_gas

    data = swiftsimio.load(str(files.checkpoint))
    if files.state.particles.dimension == 2:
        image = project_gas(data, resolution=PIXELS, project="masses", periodic=is_periodic(files))
    else:
        image = slice_gas(
            data, resolution=PIXELS, z_slice=data.metadata.boxsize[2] / 2, project="masses",
            periodic=is_periodic(files),
        )  # fmt: skip
    sides = opened.box(files)[:2]
    figure, panel = plt.subplots(figsize=(5, 4))
    shown = panel.imshow(
        np.asarray(image).T, origin="lower", cmap=COLOURS, extent=(0, sides[0], 0, sides[1]),
        **dict(zip(("vmin", "vmax"), scale(files), strict=True)),
    )  # fmt: skip
    figure.colorbar(shown, ax=panel, label=f"density [{image.units}]")
    save(figure, path)


def is_periodic(files: Files) -> bool:
    return set(files.state.config.problem.boundaries) == {"periodic"}


def by_pyvista(files: Files, path: Path) -> None:
    import pyvista

    *_, (grid, _) = opened.grids(files.grid)
    if files.state.particles.dimension == 3:
        middle = np.abs(grid.points[:, 2] - grid.center[2])
        grid = grid.extract_cells(middle < np.median(grid["h"]))
    plotter = pyvista.Plotter(off_screen=True, window_size=(600, 440))
    plotter.add_mesh(
        grid, scalars="density", cmap=COLOURS, clim=scale(files), point_size=6.0,
        scalar_bar_args={"vertical": True, "color": "black", "n_labels": 4, "height": 0.8,
                         "position_x": 0.87, "position_y": 0.1},
    )  # fmt: skip
    plotter.background_color = "white"
    plotter.view_xy()
    plotter.camera.tight(padding=0.05, adjust_render_window=False)
    plotter.screenshot(str(path))
    plotter.close()


def by_sarracen(files: Files, path: Path) -> None:
    import sarracen

    table = sarracen.read_csv(str(files.table))
    figure, panel = plt.subplots(figsize=(5, 4))
    plane = {"xsec": table["z"].median()} if "z" in table else {}
    table.render("density", ax=panel, cmap=COLOURS, x_pixels=PIXELS, **plane,
                 **dict(zip(("vmin", "vmax"), scale(files), strict=True)))  # fmt: skip
    save(figure, path)


PICTURES = {
    "yt": by_yt,
    "pynbody": by_pynbody,
    "swiftsimio": by_swiftsimio,
    "ParaView": by_pyvista,
    "sarracen": by_sarracen,
}
