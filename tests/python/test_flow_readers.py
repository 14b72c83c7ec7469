"""Readers of runs in which particles come and go, or change from outside: tables, paths and analyses."""

import inspect
import json
import warnings

import h5py
import numpy as np
import pytest

import haff
from haff import analysis
from haff.figures import movie, snapshot, trajectories

# Four disks in a box, others that come in at the top, and a corner at which they leave.
RAIN = {
    "seed": 3,
    "dimension": 2,
    "domain": {"size": [12.0, 20.0], "boundary": ["wall", "wall"], "gravity": [0.0, -1.0]},
    "species": [
        {"name": "a", "count": 4, "radius": {"uniform": [0.3, 0.5]}, "density": 1.0, "temperature": 1.0},
        {"name": "b", "count": 0, "radius": 0.4, "mass": 1.0},
    ],
    "contact": {"restitution": 0.9},
    "inlet": [
        {
            "species": "a",
            "box": [[1.0, 14.0], [11.0, 18.0]],
            "velocity": [0.0, -1.0],
            "temperature": 0.5,
            "rate": 1.0,
            "count": 6,
        },
        {"species": "b", "box": [[1.0, 14.0], [11.0, 18.0]], "rate": 0.5, "count": 4},
    ],
    "outlet": [{"box": [[0.0, 0.0], [4.0, 2.0]]}],
    "run": {"until": 20.0},
    "output": {"frames": 0.5, "observables": 0.25, "events": True},
}


def close(table, log):
    """Speeds of approach by the velocities of a table are those of the log, or unknown."""
    axes = [name[-1] for name in table if name.startswith("first_before_")]
    normal = log[[f"normal_{axis}" for axis in axes]].to_numpy()
    first, second = (table[[f"{who}_before_{axis}" for axis in axes]].to_numpy() for who in ("first", "second"))
    approach = np.sum((first - second) * normal, axis=1)
    known = np.isfinite(approach)
    assert np.allclose(approach[known], log["approach_speed"][known], rtol=1e-9, atol=1e-12)
    return known.mean()


def impacts_of(run):
    log = run.events.to_pandas()
    return analysis.impacts(run), log[log["kind"].isin(["collision", "wall", "stick"])].reset_index()


def test_impacts_are_those_of_the_particles_that_are_there(tmp_path):
    with haff.run(RAIN, file=tmp_path / "rain.h5").file as run:
        absent = len(run) - min(len(frame.position) for frame in run.frames)
        assert absent > 3
        assert close(*impacts_of(run)) > 0.7
        assert len(haff.plot(run, "trajectories").axes) == 2


@pytest.mark.parametrize("keys", [{}, {"contact": {"tangential_restitution": 0.5, "restitution": 0.9}}])
def test_runs_with_inlets_refuse_changes(keys, tmp_path):
    """They panicked: particles were counted by their places in the file."""
    haff.run(RAIN | keys, file=tmp_path / "a.h5").close()
    for change in ({"contact__restitution": 0.7}, {"domain__gravity": [0.0, -2.0]}):
        with pytest.raises(haff.HaffError, match="cannot change in a run with inlets or outlets"):
            haff.resume(tmp_path / "a.h5", file=tmp_path / "b.h5", run__until=30.0, **change)
    with haff.Simulation(RAIN | keys) as live:
        live.advance(until=5.0)
        with pytest.raises(ValueError, match="cannot change in a run with inlets or outlets"):
            live.set(contact__restitution=0.7)
        live.advance(until=6.0)


def test_species_of_inlets_have_profiles(tmp_path):
    measure = {"profiles": [{"axis": "y", "bins": 4, "interval": 2.0, "species": "each"}]}
    with haff.run(RAIN | {"measure": measure}, file=tmp_path / "a.h5").file as run:
        profile = run.profiles["y"]
        assert list(profile["species"].values) == ["a", "b"]
        assert np.allclose(profile["species_density"].sum("species"), profile["density"], atol=1e-12)
        assert profile["species_density"].sel(species="b").max() > 0


@pytest.mark.parametrize("boundary", ["periodic", "open"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_runs_that_begin_empty_have_figures_and_exports(dimension, boundary, tmp_path):
    box = [[1.0] * dimension, [9.0] * dimension]
    scene = {
        "dimension": dimension,
        "domain": {"size": [10.0] * dimension, "boundary": [boundary] * dimension},
        "species": [{"name": "drop", "count": 0, "radius": 0.3, "mass": 1.0}],
        "inlet": [{"species": "drop", "box": box, "temperature": 1.0, "rate": 2.0, "count": 20}],
        "outlet": [{"box": [[0.0] * dimension, [2.0] * dimension]}],
        "run": {"until": 10.0},
        "output": {"frames": 0.5, "observables": 0.5, "events": True},
    }
    with haff.run(scene, file=tmp_path / "a.h5").file as run:
        assert len(run.frames[0].position) == 0 and len(run.frames[-1].position) > 0
        run.export(tmp_path / "a.extxyz")
        assert haff.plot(run, "snapshot").axes
        empty = run.frames[:1]
        assert movie.save(run, tmp_path / "a.gif", frames=0).exists()
        assert len(empty[0].to_freud()[1]) == 0 and len(empty[0].to_pandas()) == 0
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            snapshot.draw(run, 0)
        assert analysis.cluster_history(run)["largest"].iloc[0] == 0
        with pytest.raises(haff.NotApplicableError, match="no particle is there at t = 0"):
            analysis.clusters(run.frames[0])
        assert analysis.velocity_histogram(run)[1].sum() > 0
        haff.view(run, tmp_path / "a.html")
    outside = {"box": [[11.0] + [0.0] * (dimension - 1), [12.0] + [2.0] * (dimension - 1)]}
    if boundary == "periodic":
        with pytest.raises(haff.SceneError, match="must reach into the box along x, from 0 to 10"):
            haff.validate(scene | {"outlet": [outside]})


def test_an_inlet_has_room_for_its_smallest_particle():
    """Walls at y = 0 and 20; the smallest radius of species a is 0.3, that of b 0.4."""
    for species, low, fits in (("a", 19.7, False), ("a", 19.69, True), ("b", 19.6, False), ("b", 19.59, True)):
        inlet = {"species": species, "box": [[1.0, low], [11.0, 20.0]], "rate": 1.0, "count": 4}
        scene = RAIN | {"inlet": [inlet]}
        if fits:
            haff.validate(scene)
            continue
        with pytest.raises(
            haff.SceneError, match=r"must have places for centers of particles of radius 0\.[34]: along y"
        ):
            haff.validate(scene)
    # A wall that oscillates leaves room at times.
    moving = {"name": "y+", "motion": {"kind": "sine", "amplitude": 1.0, "frequency": 1.0}}
    haff.validate(RAIN | {"inlet": [inlet | {"box": [[1.0, 19.8], [11.0, 20.0]]}], "wall": [moving]})
    refill = {"refill": True, "box": [[0.0, 14.0], [0.3, 18.0]]}
    with pytest.raises(haff.SceneError, match=r"of radius 0\.3: along x between 0\.3 and 11\.7"):
        haff.validate(RAIN | {"inlet": [RAIN["inlet"][1], refill]})


def test_exports_have_the_particles_of_each_frame_by_their_ids(tmp_path):
    with haff.run(RAIN, file=tmp_path / "a.h5").file as run:
        assert any(len(frame.id) and frame.id[-1] >= len(frame.id) for frame in run.frames)
        for name in ("a.extxyz", "a.vtkhdf", "a.gsd"):
            run.export(tmp_path / name)
        lines = (tmp_path / "a.extxyz").read_text().splitlines()
        gsd = pytest.importorskip("gsd.hoomd").open(tmp_path / "a.gsd")
        with h5py.File(tmp_path / "a.vtkhdf") as vtk, gsd:
            root = vtk["VTKHDF"]
            counts, starts = root["NumberOfPoints"][:], root["Steps/PointDataOffsets/id"][:]
            for k, frame in enumerate(run.frames):
                count, ids = len(frame.id), frame.id.tolist()
                head, rows, lines = lines[1], lines[2 : 2 + count], lines[2 + count :]
                column = head.partition("Properties=")[2].split()[0].split(":")
                # Names, types and numbers of columns, by threes.
                place = sum(int(column[n + 2]) for n in range(0, column.index("id"), 3))
                assert [int(row.split()[place]) for row in rows] == ids
                assert root["PointData/id"][starts[k] : starts[k] + counts[k]].tolist() == ids
                assert gsd[k].log["particles/id"].tolist() == ids


def test_all_analyses_check_what_they_are_given():
    """One of them took a frame for a file, and ended with an AttributeError."""
    functions = [getattr(analysis, name) for name in analysis.__all__]
    taking = [
        function
        for function in filter(inspect.isfunction, functions)
        if any("Record" in kind or "Frame" in kind for kind in map(str, function.__annotations__.values()))
    ]
    assert len(taking) > 30
    assert [function.__name__ for function in taking if not hasattr(function, "__wrapped__")] == []


TOUCHING = {
    "domain": {"size": [8.0, 8.0, 8.0], "boundary": ["wall", "wall", "wall"]},
    "particle": [
        {"position": [3.0, 4.0, 4.0], "velocity": [1.0, 0.0, 0.0], "radius": 0.5, "mass": 1.0},
        {"position": [4.0, 4.0, 4.0], "radius": 0.5, "mass": 1.0},
    ],
    "contact": {"restitution": 0.5},
    "run": {"until": 20.0},
    "output": {"frames": 10.0, "events": True},
}


def test_impacts_at_the_start_come_after_the_first_frame(tmp_path):
    with haff.run(TOUCHING, file=tmp_path / "a.h5").file as run:
        table, log = impacts_of(run)
        assert log["time"][0] == 0 and run.frames[0].velocity[0, 0] == 1.0
        assert close(table, log) == 1.0
        assert table["second_after_x"][0] == pytest.approx(0.75)
        for path in trajectories.flights(run):
            assert path.position[:, 0].min() > 0.5 - 1e-9 and path.position[:, 0].max() < 7.5 + 1e-9


def test_changes_from_outside_are_not_flown_over(tmp_path):
    scene = TOUCHING | {"contact": {"restitution": 1.0}}
    with haff.Simulation(scene, file=tmp_path / "a.h5") as live:
        live.advance(until=2.0)
        live.velocities = [[2.0, 1.0, 0.0], [-1.0, 0.5, 0.3]]
        live.advance(until=12.0)
        live.set(domain__gravity=[0.0, 0.0, -3.0])
        live.advance(until=20.0)
    with haff.open(tmp_path / "a.h5") as run:
        known = close(*impacts_of(run))
        assert 0 < known < 1
        assert json.loads(run.stored.text("parameters/summary"))["stopped"] == "closed"
        for path in trajectories.flights(run):
            assert np.abs(path.position - 4.0).max() < 6.0


def test_spins_after_thermal_walls_are_unknown(tmp_path):
    scene = {
        "seed": 3,
        "domain": {"size": [6.0, 6.0, 6.0], "boundary": ["wall", "wall", "wall"]},
        "particle": [{"position": [3.0, 3.0, 3.0], "velocity": [0.3, 0.2, -1.0], "radius": 0.5, "mass": 1.0}],
        "contact": {"tangential_restitution": 0.5},
        "wall": [{"name": "z-", "temperature": 1.0}],
        "run": {"until": 10.0},
        "output": {"frames": 1.0, "events": True},
    }
    with haff.run(scene, file=tmp_path / "a.h5").file as run:
        table = run.impacts()
        thermal = (table["second"] == "z-").to_numpy()
        spins = table[["first_spin_after_x", "first_spin_after_y", "first_spin_after_z"]].to_numpy()
        assert thermal.any() and np.isnan(spins[thermal]).all() and np.isfinite(spins[~thermal]).any()
        times, _ = trajectories._spins(run, trajectories.flights(run)[0], 0)
        assert np.isin(table["time"][~thermal], times).all() and not np.isin(table["time"][thermal], times).any()
