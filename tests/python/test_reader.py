"""The lazy reader, on files whose content is known."""

import h5py
import numpy as np
import pandas as pd
import pytest

import haff
import synthetic
from haff import figures
from haff.analysis import experiment


def test_open_returns_the_written_data(files):
    with haff.open(files["cooling"]) as run:
        assert len(run) == 2000
        assert run.dimension == 3 and run.box.fully_periodic
        assert run.box.volume == pytest.approx(2000 / (0.3 / np.pi), rel=1e-12)
        assert run.species_names == ["grain"]
        assert run.scene["contact"]["restitution"] == 0.9
        assert run.summary["packing_fraction"] == pytest.approx(0.05, rel=1e-12)
        assert run.summary["ledger_residual"] < 1e-14
        assert np.array_equal(run.mass, np.ones(2000)) and np.array_equal(run.radius, np.full(2000, 0.5))


def test_frames_behave_as_a_sequence(files):
    with haff.open(files["cooling"]) as run:
        frames = run.frames
        assert len(frames) == 8 and frames[0].time == 0 and frames[-1].time == frames.time[-1]
        assert [f.index for f in frames[1:7:2]] == [1, 3, 5]
        assert [f.index for f in frames[::-1]] == list(range(7, -1, -1))
        assert list(frames[::-3].time) == list(frames.time[::-3])
        assert frames[2:].array("velocity").shape == (6, 2000, 3)
        assert len(frames[5:5]) == 0 and frames[5:5].array("position").shape == (0, 2000, 3)
        assert np.array_equal(frames[::-1].array("velocity")[0], frames[-1].velocity)
        with pytest.raises(IndexError, match=r"frames\[8\]: there are 8, 0 to 7"):
            frames[8]
        frame = frames[3]
        assert np.allclose(frame.unwrapped - frame.position, frame.image * run.box.size)
        assert np.array_equal(frames.array("unwrapped")[3], frame.unwrapped)


def test_frames_are_read_lazily(files):
    with haff.open(files["cooling"]) as run:
        frame = run.frames[2]
        assert "position" not in vars(frame)
        assert frame.position is frame.position
        kept = frame.position
    assert kept.shape == (2000, 3)


def test_observables_are_a_data_frame_with_named_components(files):
    with haff.open(files["cooling"]) as run:
        table = run.observables
        assert list(table.columns[:2]) == ["time", "step"]
        for column in ("temperature", "momentum_x", "momentum_z", "species_temperature_grain", "sonine_a2"):
            assert column in table
        assert np.isnan(table["pressure"].iloc[0])
        law = haff.analysis.cooling_law(run)
        expected = haff.theory.haff_temperature(table["time"], 1.0, law.tau)
        assert np.allclose(table["temperature"], expected, rtol=1e-12)


def test_observables_go_to_xarray_with_whole_vectors(files):
    with haff.open(files["cooling"]) as run:
        data = run.to_xarray()
        assert data["momentum"].dims == ("time", "axis")
        assert data["species_temperature"].sel(species="grain").values[0] == 1.0
        assert list(data["axis"].values) == ["x", "y", "z"]


def test_events_are_read_in_chunks_with_categorical_kinds(files):
    with haff.open(files["cooling"]) as run:
        events = run.events
        assert len(events) == 20_000
        piece = events[10:15]
        assert isinstance(piece["kind"].dtype, pd.CategoricalDtype)
        assert set(piece["kind"]) == {"collision"} and "rest" in piece["kind"].cat.categories
        assert list(piece.index) == [10, 11, 12, 13, 14]
        whole = events.to_pandas(["time", "energy_loss"])
        assert list(whole.columns) == ["time", "energy_loss"]
        joined = pd.concat(list(events.chunks(size=7000)))
        assert len(joined) == 20_000 and joined["time"].equals(whole["time"])
        assert np.array_equal(events["energy_loss"], whole["energy_loss"])
        with pytest.raises(KeyError, match="events: no column 'speed'; the columns are time"):
            events["speed"]


def test_error_of_an_unrecorded_column_names_it(command):
    columns = {"columns": ["j", "energy_loss", "i"]}
    settings = {"output__events": columns, "run__until": 2.0, "species__0__count": 500}
    run, all_columns = command.run("cooling", **settings), command.run("cooling", **settings | {"output__events": True})
    with run.open() as some, all_columns.open() as every:
        assert some.events.columns == ["time", "i", "j", "energy_loss"]
        assert len(some.events) == len(every.events) > 100
        for name in some.events.columns:
            assert np.array_equal(some.events[name], every.events[name]), name
        assert list(some.events[:3].columns) == some.events.columns
        assert "columns time, i, j, energy_loss" in repr(some.events) and some.events.kinds == {}
        for ask in (lambda: some.events["normal"], lambda: some.events.to_pandas(["time", "kind"])):
            with pytest.raises(haff.MissingDataError, match="the scene asked for time, i, j, energy_loss"):
                ask()
        with pytest.raises(KeyError, match="events: no column 'speed'; the columns are time"):
            some.events["speed"]


def test_event_kinds_of_a_bouncing_ball(files):
    with haff.open(files["ball"]) as run:
        counts = run.events.to_pandas()["kind"].value_counts()
        assert counts["wall"] == 40 and counts["rest"] == 1 and counts["collision"] == 0


def test_error_of_unrecorded_output_names_the_remedy(files):
    with haff.open(files["quiet"]) as run:
        assert "frames" in run and "events" not in run
        with pytest.raises(haff.MissingDataError, match=r"output\.events = true"):
            _ = run.events


def test_repr_summarizes_the_file(files):
    run = haff.open(files["quiet"])
    text = repr(run)
    assert "500" in text and "not recorded" in text and "grain" in text
    run.close()
    assert "closed" in repr(run)


@pytest.mark.parametrize("name", ["particles/all/velocity/value", "particles/all/image/value"])
def test_killed_run_is_read_up_to_its_last_complete_frame(tmp_path, name):
    path = synthetic.cooling_gas(tmp_path / "killed.h5", n=50, frames=6, collisions=100)
    synthetic.truncate(path, name, 4)
    synthetic.truncate(path, "events/impulse", 60)
    with haff.open(path) as run:
        assert len(run.frames) == 4
        assert run.frames[-1].velocity.shape == (50, 3)
        assert len(run.events) == 60 and len(run.events.to_pandas()) == 60


def test_rows_without_a_time_do_not_count(tmp_path):
    """After a flush cut short by a kill the file has the data of some rows, but not their times."""
    path = synthetic.cooling_gas(tmp_path / "torn.h5", n=50, frames=6, collisions=100)
    with h5py.File(path, "r+") as f:
        for name, rows in [("particles/all/position/time", 2), ("events/time", 5), ("observables/temperature/time", 1)]:
            f[name][-rows:] = np.nan
        samples = f["observables/temperature/time"].shape[0]
    with haff.open(path) as run:
        assert len(run.frames) == 4 and len(run.events) == 95
        assert len(run.observables) == samples - 1 and run.observables["time"].notna().all()


def test_file_without_frames_opens(tmp_path):
    path = synthetic.cooling_gas(tmp_path / "start.h5", n=50, frames=6, collisions=10)
    for name in ("position", "velocity", "image"):
        synthetic.truncate(path, f"particles/all/{name}/value", 0)
    with haff.open(path) as run:
        assert len(run.frames) == 0 and repr(run.frames) == "<Frames: none>" and repr(run)


def test_errors_are_one_line_and_name_the_file(tmp_path):
    text = tmp_path / "text.h5"
    text.write_text("no HDF5 at all")
    other = tmp_path / "other.h5"
    with h5py.File(other, "w") as f:
        f["x"] = 1
    cut = tmp_path / "cut.h5"
    cut.write_bytes(other.read_bytes()[:1000])
    newer = synthetic.bouncing_ball(tmp_path / "newer.h5")
    with h5py.File(newer, "r+") as f:
        f["parameters/schema"] = 2
    for path, reason in [
        (newer, "has schema 2; this version of haff reads schema 1"),
        (cut, f"truncated: 1000 of its {other.stat().st_size} bytes are there"),
        (tmp_path / "missing.h5", "no such file"),
        (text, "not an HDF5 file"),
        (other, "not an output file of haff"),
        (tmp_path, "is a directory"),
    ]:
        with pytest.raises(haff.FileError, match=reason) as error:
            haff.open(path)
        assert path.name in str(error.value) and "\n" not in str(error.value)


@pytest.mark.long
def test_a_wall_of_the_box_with_properties_of_its_own_is_read(command, tmp_path):
    """An entry of ``[[wall]]`` that names a wall of the box has no shape."""
    with command.run("thermal_walls", run__until=20.0).open() as run:
        assert [wall["name"] for wall in run.scene["wall"]] == ["x-", "x+"]
        assert run.box.boundary == ("wall", "periodic", "periodic")
        assert experiment.count_walls(run) == 2
        assert experiment.plane(run, 1)[0][0] == 40.0
        assert experiment.wall_restitution(run, "atom", 1) == 1.0
        drawn = {result.kind: result.path for result in figures.save_all(run, ["snapshot", "energy"], tmp_path)}
        assert all(path.stat().st_size > 10_000 for path in drawn.values())
        haff.view(run, tmp_path / "gas.html")
