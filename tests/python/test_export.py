"""`haff export`: every format is read back by its target programs."""

import io
import json
import re

import numpy as np
import pandas as pd
import pytest

import haff
import synthetic
from haff.command.main import _FORMATS, _TABLES, main
from haff.export import FORMATS, TABLES
from haff.files import selection

TRAJECTORIES = [name for name, format in FORMATS.items() if format.trajectory]


@pytest.fixture(scope="session")
def mixed(tmp_path_factory):
    """Two sizes, a fixed body, one axis of each kind, particles at the lower face and just below the upper one."""
    size = np.array([4.0, 6.0, 5.0])
    start = np.array([[0.0, 1.0, 2.0], [4.0 - 1e-9, 3.0, -3.0], [2.0, 5.0, 7.0]])
    velocity = np.array([[0.1, 0.2, -0.3], [1.0, -0.5, 0.25], [0.0, 0.0, 0.0]])
    times = np.array([0.0, 0.5, 1.5])
    unwrapped = start + times[:, None, None] * velocity
    image = np.zeros(unwrapped.shape, np.int32)
    image[..., 0] = np.floor(unwrapped[..., 0] / size[0])
    path = tmp_path_factory.mktemp("mixed") / "mixed.h5"
    return synthetic.write(
        path,
        scene=f"""schema = 1
title = 'Mixed "bodies"'
[domain]
size = {size.tolist()}
boundary = ["periodic", "wall", "open"]
[[species]]
name = "small grain"
[[species]]
name = "large"
[[particle]]
name = "plate"
""",
        size=size,
        boundary=["periodic", "none", "none"],
        mass=[1.0, 2.5, np.inf],
        radius=[0.25, 0.4, 0.5],
        species=[0, 1, 2],
        frames={
            "time": times,
            "step": np.array([0, 3, 3]),
            "position": unwrapped - image * size,
            "velocity": np.tile(velocity, (3, 1, 1)),
            "image": image,
        },
    )


# Along the open axis z: from −3 − 0.4 at t = 0 to 7 + 0.5.
ORIGIN, EDGES = [0.0, 0.0, -3.4], [4.0, 6.0, 10.9]


def exported(path, tmp_path, to, *arguments):
    target = tmp_path / f"out.{to}"
    assert main(["export", str(path), "--to", to, "-o", str(target), *arguments]) == 0
    assert [p.name for p in tmp_path.iterdir()] == [target.name], "nothing is left beside"
    return target


def test_gsd_has_centered_boxes_in_single_precision(mixed, tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd")
    with haff.open(mixed) as run, hoomd.open(str(exported(mixed, tmp_path, "gsd")), "r") as trajectory:
        assert len(trajectory) == 3
        for frame, read in zip(run.frames, trajectory):
            center, particles = read.log["box_center"], read.particles
            assert np.allclose(center, np.add(ORIGIN, np.divide(EDGES, 2)), rtol=0, atol=1e-12)
            assert np.allclose(read.configuration.box, [*EDGES, 0, 0, 0], rtol=1e-7)
            assert read.configuration.dimensions == 3 and read.configuration.step == frame.step
            assert read.log["time"] == frame.time
            half = read.configuration.box[:3] / 2
            assert np.all(particles.position >= -half) and np.all(particles.position[:, 0] < half[0])
            # Coordinates that round up to the upper face in single precision go to the lower face of the next image.
            unwrapped = particles.position + particles.image * [4.0, 0.0, 0.0] + center
            assert np.allclose(unwrapped, frame.unwrapped, rtol=0, atol=1e-6)
            assert np.allclose(particles.velocity, frame.velocity, rtol=1e-7)
            assert [particles.types[k] for k in particles.typeid] == run.species_names
            assert np.allclose(particles.diameter, 2 * run.radius)
            assert np.array_equal(particles.mass, run.mass.astype(np.float32))
        assert trajectory[0].particles.image[1, 0] == 1 and trajectory[0].particles.position[1, 0] == -2.0


def test_gsd_of_disks_is_two_dimensional(files, tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd")
    with haff.open(files["disks"]) as run, hoomd.open(str(exported(files["disks"], tmp_path, "gsd")), "r") as read:
        assert read[0].configuration.dimensions == 2 and read[0].configuration.box[2] == 0
        assert np.all(read[-1].particles.position[:, 2] == 0)
        assert np.allclose(read[0].configuration.box[:2], run.box.size[:2])


def test_extxyz_keeps_every_bit(mixed, tmp_path):
    ase = pytest.importorskip("ase.io")
    read = ase.read(exported(mixed, tmp_path, "extxyz"), index=":", format="extxyz")
    with haff.open(mixed) as run:
        assert len(read) == len(run.frames)
        for frame, atoms in zip(run.frames, read):
            assert np.array_equal(atoms.positions, frame.position)
            assert np.array_equal(atoms.arrays["velo"], frame.velocity)
            assert np.array_equal(atoms.arrays["image"], frame.image)
            assert np.array_equal(atoms.arrays["radius"], run.radius) and np.array_equal(atoms.arrays["mass"], run.mass)
            assert list(atoms.arrays["type"]) == ["small_grain", "large", "plate"]
            assert list(atoms.arrays["id"]) == [0, 1, 2]
            assert np.allclose(atoms.cell, np.diag(EDGES)) and list(atoms.pbc) == [True, False, False]
            assert np.allclose(atoms.info["Origin"], ORIGIN)
            assert atoms.info["Time"] == frame.time and atoms.info["Step"] == frame.step
            assert atoms.info["Title"] == "Mixed 'bodies'"


def test_unwrapped_positions_do_not_jump(mixed, tmp_path):
    ase = pytest.importorskip("ase.io")
    read = ase.read(exported(mixed, tmp_path, "extxyz", "--unwrapped", "--frames", "::2"), index=":", format="extxyz")
    with haff.open(mixed) as run:
        assert np.array_equal(read[1].positions, run.frames[2].unwrapped)
        assert read[1].positions[1, 0] == pytest.approx(5.5)


@pytest.mark.parametrize("name", ["mixed", "disks", "ball"])
def test_vtk_reads_every_step(name, files, mixed, tmp_path):
    vtk = pytest.importorskip("vtk", reason="no vtk: pip install 'haff[validation]'")
    from vtk.util.numpy_support import vtk_to_numpy

    path = mixed if name == "mixed" else files[name]
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(exported(path, tmp_path, "vtkhdf")))
    reader.UpdateInformation()
    with haff.open(path) as run:
        assert reader.GetNumberOfSteps() == len(run.frames)
        for k, frame in enumerate(run.frames):
            reader.SetStep(k)
            reader.Update()
            data = reader.GetOutput()
            assert data.GetNumberOfVerts() == len(run) and reader.GetTimeValue() == frame.time
            point = lambda name, data=data: vtk_to_numpy(data.GetPointData().GetArray(name))  # noqa: E731
            field = lambda name, data=data: vtk_to_numpy(data.GetFieldData().GetArray(name))[0]  # noqa: E731
            assert np.array_equal(vtk_to_numpy(data.GetPoints().GetData()), frame.position)
            assert np.array_equal(point("velocity"), frame.velocity) and np.array_equal(point("image"), frame.image)
            assert np.array_equal(point("radius"), run.radius) and np.array_equal(point("mass"), run.mass)
            assert np.array_equal(point("species"), run.species) and np.array_equal(point("id"), np.arange(len(run)))
            names = data.GetFieldData().GetAbstractArray("species_names")
            assert [names.GetValue(i) for i in range(names.GetNumberOfValues())] == run.species_names
            if name == "mixed":
                assert np.allclose(field("box_origin"), ORIGIN) and np.allclose(field("box_size"), EDGES)
                assert list(field("periodic")) == [1, 0, 0]


@pytest.mark.parametrize("to", ["gsd", "extxyz"])
def test_ovito_reads_sizes_species_and_box(to, mixed, files, tmp_path, monkeypatch):
    monkeypatch.setenv("OVITO_GUI_MODE", "0")
    reader = pytest.importorskip("ovito.io", reason="no ovito: pip install 'haff[validation]'")
    pipeline = reader.import_file(str(exported(mixed, tmp_path, to)))
    assert pipeline.source.num_frames == 3
    data = pipeline.compute(2)
    particles = data.particles
    with haff.open(mixed) as run:
        frame = run.frames[2]
        shift = data.attributes["box_center"] if to == "gsd" else 0.0
        assert np.allclose(particles.positions + shift, frame.position, atol=1e-6)
        assert np.allclose(particles["Velocity"], frame.velocity) and np.allclose(particles["Radius"], run.radius)
        types = {t.id: t.name for t in particles.particle_types.types}
        names = [n.replace(" ", "_") if to == "extxyz" else n for n in run.species_names]
        assert [types[k] for k in particles.particle_types[...]] == names
        assert np.allclose(data.cell[:, :3], np.diag(EDGES), rtol=1e-6)
        assert np.allclose(data.cell[:, 3] + shift, ORIGIN, atol=1e-6)
        assert data.cell.pbc == ((True, True, True) if to == "gsd" else (True, False, False))
    (tmp_path / f"out.{to}").unlink()
    # Diameters that are all 1 are omitted in a GSD file; the shape of the species has them.
    gas = reader.import_file(str(exported(files["cooling"], tmp_path, to))).compute(0)
    radius = gas.particles["Radius"][0] if "Radius" in gas.particles else gas.particles.particle_types.types[0].radius
    assert radius == pytest.approx(0.5)


def _exactly(path):
    """A table with each number as Python reads it, to the last bit; pandas' own default depends on its version."""
    text = pd.read_csv(path, dtype=str)
    return text.apply(
        lambda column: pd.to_numeric(column.map(float)) if column.name not in ("kind", "species") else column
    )


@pytest.mark.parametrize("to", ["csv", "parquet"])
def test_tables_read_back_equal(to, files, tmp_path):
    if to == "parquet":
        pytest.importorskip("pyarrow")
    read = {"csv": _exactly, "parquet": pd.read_parquet}[to]
    for table in TABLES:
        target = exported(files["ball"], tmp_path, to, "--table", table)
        data = read(target)
        target.unlink()
        with haff.open(files["ball"]) as run:
            if table == "observables":
                pd.testing.assert_frame_equal(data, run.observables, check_dtype=to == "parquet", check_exact=True)
            elif table == "events":
                expected = run.events.to_pandas().reset_index(drop=True)
                if to == "csv":
                    expected["kind"] = expected["kind"].astype(data["kind"].dtype)
                pd.testing.assert_frame_equal(data, expected, check_dtype=to == "parquet", check_exact=True)
            else:
                assert np.array_equal(data[["x", "y", "z"]], run.frames.array("position")[:, 0])
                assert np.array_equal(data[["vx", "vy", "vz"]], run.frames.array("velocity")[:, 0])
                assert np.array_equal(data["time"], run.frames.time) and set(data["species"]) == {"ball"}
                assert set(data["radius"]) == {0.5} and set(data["mass"]) == {1.0}


def test_tables_written_in_chunks_equal_whole_tables(files, tmp_path, monkeypatch):
    from haff.export import tables

    whole = {}
    for rows in (10**9, 7):
        monkeypatch.setattr(tables, "ROWS", rows)
        for table in ("frames", "events"):
            for to in ("csv", "parquet"):
                target = exported(files["ball"], tmp_path, to, "--table", table)
                data = pd.read_csv(target) if to == "csv" else pd.read_parquet(target)
                target.unlink()
                pd.testing.assert_frame_equal(data, whole.setdefault((to, table), data))


def test_parquet_metadata_has_scene_and_box(mixed, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    metadata = parquet.read_schema(exported(mixed, tmp_path, "parquet", "--table", "frames")).metadata
    assert 'name = "plate"' in metadata[b"haff.scene"].decode()
    assert json.loads(metadata[b"haff.box"])["boundary"] == ["periodic", "wall", "open"]


@pytest.mark.parametrize(
    ("text", "rows"),
    [("::3", [0, 3, 6]), ("2:5", [2, 3, 4]), ("-2:", [6, 7]), ("3", [3]), ("-1", [7]), ("-3", [5]), (":100:7", [0, 7])],
)
def test_frames_are_selected_by_python_slices(files, text, rows):
    with haff.open(files["cooling"]) as run:
        assert [frame.index for frame in selection.choose(run, text)] == rows


@pytest.mark.parametrize("text", ["", "a", "1:2:3:4", "::0", "::-1", "-", "1.5", "1,2"])
def test_empty_or_invalid_frame_selections_are_refused(files, text):
    with haff.open(files["cooling"]) as run, pytest.raises(haff.ArgumentError, match="must be START:STOP:STEP"):
        selection.choose(run, text)


def test_python_export_chooses_the_format_by_suffix(files, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with haff.open(files["ball"]) as run:
        assert run.export("ball.extxyz", frames=slice(0, 2)).stat().st_size > 0
        assert str(run.export(to="csv", table="events")) == "ball-events.csv"
    assert len(pd.read_csv("ball-events.csv")) == 41


def test_failed_export_is_one_line_and_changes_no_file(files, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "kept.csv").write_text("mine")
    ball = str(files["ball"])
    cases = [
        (["export", ball, "--to", "csv", "-o", "kept.csv"], 2, "exists; --overwrite"),
        (["export", ball, "--to", "csv", "-o", ball, "--overwrite"], 2, "is the file that is read"),
        (["export", ball, "-o", "a.xyz"], 2, "must be one of gsd"),
        (["export", ball, "--to", "gsd", "--table", "events"], 2, "events go to csv or parquet"),
        (["export", ball, "--to", "gsd", "--unwrapped"], 2, "images beside them"),
        (["export", ball, "--to", "csv", "--frames", "::2"], 2, "applies to frames, not to observables"),
        (["export", ball, "--to", "extxyz", "--frames", "90:"], 2, "none of the 25 frames"),
        (["export", str(files["quiet"]), "--to", "csv", "--table", "events"], 2, "no event log"),
        (["export", ball, "--to", "csv", "-o", "no/such/a.csv"], 4, "no such directory"),
        (["export", ball, "--to", "csv", "-o", "."], 4, "is a directory"),
        (["export", "none.h5", "--to", "csv"], 4, "no such file"),
    ]
    for arguments, status, message in cases:
        assert main(arguments) == status, arguments
        err = capsys.readouterr().err
        assert message in err and err.count("\n") == 1 and err.startswith("haff: error: "), err
    assert [p.name for p in tmp_path.iterdir()] == ["kept.csv"]
    assert (tmp_path / "kept.csv").read_text() == "mine"
    assert len(haff.open(ball).frames) == 25


def test_error_of_a_missing_library_names_the_extra(files, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "gsd", None)
    monkeypatch.delitem(__import__("sys").modules, "gsd.hoomd", raising=False)
    assert main(["export", str(files["ball"]), "--to", "gsd", "-o", str(tmp_path / "a.gsd")]) == 4
    assert re.search(r"needs the Python package gsd.*haff\[export\]", capsys.readouterr().err)
    assert not list(tmp_path.iterdir())


def test_help_lists_all_formats_and_tables():
    assert tuple(FORMATS) == _FORMATS and TABLES == _TABLES


@pytest.mark.parametrize("name", ["plot", "export", "view"])
def test_every_command_has_examples_in_help_and_manual(name, capsys, command):
    with pytest.raises(SystemExit):
        main([name, "--help"])
    examples = [line for line in capsys.readouterr().out.split("examples:")[1].splitlines() if f"haff {name} " in line]
    help_text = command("help", name).stdout
    assert examples and all(line in help_text for line in examples)


@pytest.mark.long
def test_command_passes_export_on_to_python(command, files, tmp_path):
    result = command("export", files["ball"], "--to", "csv", "-o", tmp_path / "ball.csv")
    assert result.stdout.strip() == str(tmp_path / "ball.csv")
    assert len(pd.read_csv(io.StringIO((tmp_path / "ball.csv").read_text()))) == 25
    assert "haff export" in command("export", "--help").stdout
    assert command("export", files["ball"], "--to", "csv", "--frames", "x", check=False).returncode == 2
