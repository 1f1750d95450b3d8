"""Exports read back: CSV with all digits, and VTKHDF with the structure of its specification."""

import csv

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from test_figures import drawable, state_of, write_run

from sph import config, kernels
from sph.analysis.export import fields, tables
from sph.analysis.figures.profile import profile
from sph.cli import main
from sph.output import checkpoint
from sph.scene import Scene
from sph.state import State

# The structure that "VTKHDF file format" asks of an unstructured grid with time steps.
OF_GRID = {
    "NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds", "Points", "Connectivity",
    "Offsets", "Types", "PointData", "CellData", "Steps",
    "FieldData",
}  # fmt: skip
OF_STEPS = {
    "Values", "PartOffsets", "NumberOfParts", "PointOffsets", "CellOffsets",
    "ConnectivityIdOffsets", "PointDataOffsets", "FieldDataOffsets", "FieldDataSizes",
}  # fmt: skip


def invoked(*arguments):
    return CliRunner().invoke(main, ["export", *map(str, arguments)])


def read(path):
    """The columns of a CSV file."""
    with open(path, newline="") as file:
        names, *rows = csv.reader(file)
    columns = zip(names, zip(*rows, strict=True), strict=True)
    return {name: np.array(column, float) for name, column in columns}


@pytest.fixture
def tube(tmp_path):
    return write_run(tmp_path / "tube", [state_of("shock_tube", time=t) for t in (0.0, 0.1, 0.2)])


@pytest.fixture
def shear(tmp_path):
    """A periodic box in 2-D, with particles out of order and some beyond the box."""
    states = [state_of("kelvin_helmholtz", time=t) for t in (0.0, 0.5)]
    for state in states:
        particles = state.checkpoint.particles
        particles.id[:] = particles.id[::-1].copy()
        particles.position[0, 0] = state.problem.box[0, 0] - 0.01
    return write_run(tmp_path / "shear", states)


@pytest.fixture
def rings():
    """A solid in 2-D with a stress in each component."""
    made = config.from_text('[problem]\nname = "rubber_rings"\nn = 300\n')
    scene = Scene(made)
    particles = State.at_start(scene.fields, *scene.initial_state().particles)
    particles.support[:] = 0.1
    particles.density[:] = 1.0
    particles.initial_support[:] = 0.1
    random = np.random.default_rng(3)
    stress = random.normal(size=particles.deviatoric_stress.shape)
    particles.deviatoric_stress[:] = stress + stress.swapaxes(0, 1)
    return drawable(particles, made, 0.0).checkpoint


def test_particles_are_written_with_all_digits_in_order_of_ids(shear):
    assert invoked(shear.path, "--csv").exit_code == 0
    found = read(shear.path / "export" / "particles_000001.csv")
    state = checkpoint.read(shear.checkpoint_path(1))
    order = np.argsort(state.particles.id)
    assert [*found][:6] == ["id", "x", "y", "mass", "vx", "vy"]
    assert np.array_equal(found["id"], np.arange(1, order.size + 1))
    for name in ("mass", "density", "internal_energy"):
        assert np.array_equal(found[name], getattr(state.particles, name)[order]), name
    assert np.array_equal(found["pressure"], state.pressure[order])
    assert np.array_equal(found["vy"], state.particles.velocity[1, order])
    ratio = kernels.support_ratio(state.config.physics.kernel_model(), 2)
    assert np.array_equal(found["h"], state.particles.support[order] / ratio)


def test_positions_are_those_of_the_run_inside_its_periodic_box(shear):
    state = checkpoint.read(shear.checkpoint_path(1))
    place, (low, high) = fields.position(state), state.config.problem.box.T
    assert np.all((place >= low) & (place <= high))
    moved = place - state.particles.position.T[np.argsort(state.particles.id)]
    wraps = np.abs(moved / (high - low))
    # whole boxes, but for round-off of adding the corner
    assert np.abs(wraps - wraps.round()).max() < 1e-15 * 10
    assert wraps.max() > 0.5


def test_problem_without_profile_has_particles_only(shear):
    done = invoked(shear.path, "--csv")
    names = {path.name for path in (shear.path / "export").iterdir()}
    assert names == {"particles_000001.csv", "times.csv", "columns.csv"}
    assert done.stdout.count("wrote") == 3


def test_profile_holds_exact_solution_at_particles(tube):
    assert invoked(tube.path, "--csv", "--time", 0.1).exit_code == 0
    found = read(tube.path / "export" / "profile_000001.csv")
    assert np.all(np.diff(found["x"]) > 0.0)
    for name in ("density", "velocity"):  # the exact solution is laid on the particles
        assert np.abs(found[name] - found[f"{name}_exact"]).max() < 1e-14, name
    assert found["density"].max() > found["density"].min()


def test_profile_without_exact_solution_has_no_exact_columns():
    state = state_of(
        "shock_tube", 'physics.heating={ name = "relaxation", energy = 1.0, time = 1.0 }'
    )
    assert not any("exact" in name for name in tables.profile(state.checkpoint))


def test_profile_of_round_problem_is_over_the_radius():
    found = tables.profile(state_of("point_explosion", "problem.dimension=2").checkpoint)
    assert next(iter(found)) == "r"
    assert np.abs(found["v_phi"]).max() < 1e-12  # the exact velocity is radial
    assert found["v_r"].max() > 0.1
    assert "velocity" not in found  # one name for each quantity


def test_profile_of_rotating_gas_has_both_components_of_the_velocity():
    found = tables.profile(state_of("gresho").checkpoint)
    for name in ("v_r", "v_phi"):
        assert np.abs(found[name] - found[f"{name}_exact"]).max() < 1e-14, name
    assert found["v_phi"].max() > 0.9


@pytest.mark.parametrize("problem", ["gresho", "yee"])
def test_export_and_figures_of_moving_vortex_have_one_centre(problem):
    """At a time when the vortex has left the box through its upper right corner."""
    state = state_of(problem, "problem.velocity=[3.0, 2.0]", time=1.75)
    found, drawn = tables.profile(state.checkpoint), profile(state)
    order = np.argsort(drawn.coordinate, kind="stable")
    shown = drawn.coordinate.size  # figures leave out the corners of the box
    assert 0.7 * found["r"].size < shown < found["r"].size
    assert np.array_equal(found["r"][:shown], drawn.coordinate[order])
    for name in ("v_r", "v_phi", "density"):
        assert np.array_equal(found[name][:shown], drawn.fields[name][order]), name
    # the state is the exact one: a rotation about the centre; 4 roundings of a speed of 4
    assert np.abs(found["v_r"]).max() < 4 * 4 * 2.3e-16
    assert found["v_phi"].max() > 0.7


def text_table(path):
    with open(path, newline="") as file:
        return [*csv.reader(file)]


def test_columns_and_times_of_tables_are_written(tube):
    invoked(tube.path, "--csv", "--all")
    header, *times = text_table(tube.path / "export" / "times.csv")
    assert header == ["number", "time"]
    assert times == [["000000", "0.0"], ["000001", "0.1"], ["000002", "0.2"]]
    header, *rows = text_table(tube.path / "export" / "columns.csv")
    assert header == ["column", "unit", "meaning"]
    described = {name: (unit, meaning) for name, unit, meaning in rows}
    assert len(described) == len(rows)
    for table in ("particles", "profile"):
        names = text_table(tube.path / "export" / f"{table}_000002.csv")[0]
        assert {*names} <= {*described}, table
    assert described["density"] == ("mass length^-3", "Density, per D-dimensional volume")
    assert described["velocity_exact"][1].endswith(", exact solution")


def test_exports_have_physical_units(tmp_path):
    units = ("units.length=pc", "units.mass=M_sun", "units.time=Myr")
    state = state_of("shock_tube", *units)
    run = write_run(tmp_path / "tube", [state])
    assert invoked(run.path, "--csv", "--vtk").exit_code == 0
    rows = text_table(run.path / "export" / "columns.csv")
    assert {row[0]: row[1] for row in rows}["density"] == "M_sun pc^-3"
    with h5py.File(run.path / "export" / "particles_000000.vtkhdf") as file:
        assert file["VTKHDF/PointData/internal_energy"].attrs["Unit"] == "pc^2 Myr^-2"
        told = {name: one.asstr()[:].tolist() for name, one in file["VTKHDF/FieldData"].items()}
        assert told["unit of internal_energy"] == ["pc^2 Myr^-2"]
        assert (told["unit of Points"], told["unit of time"]) == (["pc"], ["Myr"])
    # the numbers are those of the run
    found = read(run.path / "export" / "particles_000000.csv")
    particles = state.checkpoint.particles
    assert np.array_equal(found["mass"], particles.mass[np.argsort(particles.id)])


def test_vtk_file_has_structure_of_its_specification(shear):
    assert invoked(shear.path, "--vtk", "--all").exit_code == 0
    states = [checkpoint.read(path) for path in shear.checkpoints()]
    n = states[0].particles.number
    with h5py.File(shear.path / "export" / "particles.vtkhdf") as file:
        root, steps = file["VTKHDF"], file["VTKHDF/Steps"]
        assert {*root} == OF_GRID
        assert {*steps} == OF_STEPS
        assert root.attrs["Version"].tolist() == [2, 0]
        assert root.attrs["Type"] == b"UnstructuredGrid"
        assert root.attrs.get_id("Type").dtype.kind == "S"  # of fixed length, as VTK asks
        assert steps.attrs["NSteps"] == 2
        assert steps["Values"][:].tolist() == [0.0, 0.5]
        for name in ("NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds"):
            assert root[name][:].tolist() == [n, n], name
        for name in ("PointOffsets", "CellOffsets", "ConnectivityIdOffsets"):
            assert steps[name][:].tolist() == [0, n], name
        assert steps["PartOffsets"][:].tolist() == [0, 1]
        assert steps["NumberOfParts"][:].tolist() == [1, 1]
        assert root["Points"].shape == (2 * n, 3)
        assert root["Connectivity"][:].tolist() == [*range(n)] * 2
        assert root["Offsets"][:].tolist() == [*range(n + 1)] * 2  # one more in each part
        assert np.all(root["Types"][:] == 1)
        assert root["Types"].dtype == np.uint8
        data = root["PointData"]
        assert {*data} == {*steps["PointDataOffsets"]}
        assert all(len(data[name]) == 2 * n for name in data)
        units = root["FieldData"]
        assert {*units} == {*steps["FieldDataOffsets"]} == {*steps["FieldDataSizes"]}
        for name, unit in units.items():
            assert unit.shape == (1,), name
            # VTK ends with an error at strings in UTF-8
            assert h5py.check_string_dtype(unit.dtype).encoding == "ascii"
            assert steps["FieldDataOffsets"][name][:].tolist() == [0, 0]
            assert steps["FieldDataSizes"][name][:].tolist() == [[1, 1]] * 2
        last = states[1].particles
        order = np.argsort(last.id)
        assert np.array_equal(data["velocity"][n:, :2], last.velocity.T[order])
        assert np.all(data["velocity"][:, 2] == 0.0)
        assert np.array_equal(data["density"][n:], last.density[order])
        assert np.array_equal(root["Points"][n:, :2], fields.position(states[1]))


def test_tensors_have_nine_components(rings, tmp_path):
    checkpoint.write(tmp_path / "rings.h5", rings)
    assert invoked(tmp_path / "rings.h5", "--vtk", "--csv").exit_code == 0
    order = np.argsort(rings.particles.id)
    stress = {one.name: a for one, a in rings.scene.formulation.derived(rings.particles)}
    stress = stress["StressTensors"][..., order]
    with h5py.File(tmp_path / "particles_rings.vtkhdf") as file:
        found = file["VTKHDF/PointData/stress"][:]
    assert np.array_equal(found, stress.reshape(9, -1).T)
    table = read(tmp_path / "particles_rings.csv")
    assert np.array_equal(table["stress_xy"], stress[0, 1])
    assert np.array_equal(table["stress_zz"], stress[2, 2])


def test_checkpoints_nearest_to_times_are_chosen(tube):
    invoked(
        tube.path,
        "--vtk",
        "--csv",
        "--time",
        0.04,
        "--time",
        0.17,
        "--time",
        9,
        "-o",
        tube.path / "x",
    )
    names = {path.name for path in (tube.path / "x").iterdir()}
    assert {one for one in names if "particles" in one} == {
        "particles_000000.csv", "particles_000002.csv", "particles.vtkhdf"
    }  # fmt: skip
    with h5py.File(tube.path / "x" / "particles.vtkhdf") as file:
        assert file["VTKHDF/Steps/Values"][:].tolist() == [0.0, 0.2]


def test_last_checkpoint_is_the_default(tube):
    done = invoked(tube.path, "--vtk")
    assert done.stdout == f"wrote {tube.path / 'export' / 'particles_000002.vtkhdf'}\n"


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ((), 2, "no format is given"),
        (("--csv", "--all", "--time", 0.1), 2, "exclude each other"),
    ],
)
def test_wrong_choices_are_refused(tube, arguments, code, words):
    done = invoked(tube.path, *arguments)
    assert (done.exit_code, words in done.stderr) == (code, True)
    assert not (tube.path / "export").exists()


def test_times_of_one_checkpoint_and_missing_files_are_refused(tube, tmp_path):
    one = invoked(tube.checkpoint_path(0), "--csv", "--all")
    assert (one.exit_code, "is one checkpoint" in one.stderr) == (2, True)
    assert invoked(tmp_path / "nothing", "--csv").exit_code == 4
    assert invoked(tmp_path, "--csv").exit_code == 4
    for path in tube.checkpoints():
        path.unlink()
    empty = invoked(tube.path, "--csv")
    assert (empty.exit_code, "nothing to export" in empty.stderr) == (4, True)
