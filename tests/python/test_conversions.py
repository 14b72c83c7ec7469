"""Frames as objects of freud, pandas and MDAnalysis, against the frames themselves."""

from __future__ import annotations

import pickle
import sys

import numpy as np
import pytest

import haff
from haff.errors import ArgumentError, MissingPackageError
from test_structure import nearest

FLUID = {
    "seed": 3,
    "domain": {"packing_fraction": 0.1},
    "species": [{"name": "grain", "count": 108, "radius": 0.5, "mass": 1.0}],
    "initial": {"positions": "lattice", "temperature": 1.0},
    "measure": {"msd": True, "interval": 0.5},
    "run": {"until": 20.0},
    "output": {"frames": 0.5, "observables": 0.5},
}
MIXTURE = {
    "seed": 1,
    "dimension": 2,
    "domain": {"size": [12.0, 9.0], "boundary": ["periodic", "wall"], "gravity": [0, -1]},
    "species": [
        {"name": "small", "count": 20, "radius": 0.3, "mass": 1.0},
        {"name": "large", "count": 5, "radius": 0.6, "mass": 4.0},
    ],
    "initial": {"positions": "random", "temperature": 1.0},
    "contact": {"restitution": 0.9, "tangential_restitution": 0.3},
    "run": {"until": 3.0},
    "output": {"frames": 1.0},
}


def sheared(flow, gradient, d=3):
    shear = {"flow": flow, "gradient": gradient, "rate": 0.7}
    return FLUID | {"dimension": d, "domain": {"packing_fraction": 0.1, "shear": shear}, "measure": {}}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder, scenes = tmp_path_factory.mktemp("converted"), {"fluid": FLUID, "mixture": MIXTURE}
    scenes |= {"sheared": sheared("x", "y"), "turned": sheared("z", "x"), "disks": sheared("y", "x", 2)}
    opened = {}
    for name, scene in scenes.items():
        haff.run(scene, file=folder / f"{name}.h5")
        opened[name] = haff.open(folder / f"{name}.h5")
    yield opened
    for run in opened.values():
        run.close()


# --- freud -------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("name", ["fluid", "mixture", "sheared", "turned", "disks"])
def test_freud_finds_the_pairs_of_the_frame(runs, name):
    freud, seen = pytest.importorskip("freud"), 0
    for frame in runs[name].frames[::2]:
        box, points = frame.to_freud()
        d = frame.box.dimension
        assert box.dimensions == d and points.shape == (len(frame.mass), 3)
        if frame.box.fully_periodic:
            assert box.volume == pytest.approx(frame.box.volume, rel=1e-6)
        if d == 2:
            assert np.all(points[:, 2] == 0)
        query = freud.locality.AABBQuery(box, points)
        found = query.query(points, {"r_max": 1.6, "exclude_ii": True}).toNeighborList()
        expected = nearest(frame)
        near = np.full(expected.shape, np.inf)
        near[found.query_point_indices, found.point_indices] = found.distances
        sure = np.abs(expected - 1.6) > 1e-4
        # Single precision.
        assert np.allclose(near[sure], np.where(expected < 1.6, expected, np.inf)[sure], rtol=0, atol=2e-5)
        seen += np.isfinite(near).sum()
    assert seen > 20


def test_freud_finds_no_pairs_across_walls_and_open_axes(runs, files):
    freud = pytest.importorskip("freud")
    frame = runs["mixture"].frames[-1]
    box, points = frame.to_freud()
    assert list(box.L) == [12.0, 18.0, 0.0]
    # As far as freud goes in this box: further than from one wall to the middle.
    found = freud.locality.AABBQuery(box, points).query(points, {"r_max": 5.9, "exclude_ii": True}).toNeighborList()
    assert len(found.distances) == np.sum(nearest(frame) < 5.9)
    with haff.open(files["ball"]) as run:
        for frame in run.frames:
            box, points = frame.to_freud()
            assert np.all(np.abs(points[:, :2]) <= np.array(box.L)[:2] / 4 * (1 + 1e-6)), "particles are in the middle"


def test_missing_freud_is_named(runs, monkeypatch):
    monkeypatch.setitem(sys.modules, "freud", None)
    with pytest.raises(MissingPackageError, match="needs the Python package freud: pip install freud-analysis"):
        runs["fluid"].frames[0].to_freud()


# --- pandas ------------------------------------------------------------------------------------------------


def test_table_of_a_frame_has_its_columns(runs):
    run = runs["mixture"]
    frame = run.frames[2]
    table = frame.to_pandas()
    vectors = ["x y z", "vx vy vz", "image_x image_y image_z"]
    vectors += ["angular_velocity_x angular_velocity_y angular_velocity_z"]
    assert list(table.columns) == ["id", "species", *" ".join(vectors).split(), "radius", "mass"]
    arrays = (frame.position, frame.velocity, frame.image, frame.angular_velocity)
    for names, values in zip(vectors, arrays):
        assert np.array_equal(table[names.split()].to_numpy(), values)
    assert list(table["species"]) == ["small"] * 20 + ["large"] * 5 and list(table["id"]) == list(range(25))
    assert table.groupby("species", observed=True)["mass"].sum().to_dict() == {"small": 20.0, "large": 20.0}
    assert table.attrs == {"frame": 2, "time": 2.0, "step": frame.step}
    assert "angular_velocity_x" not in runs["fluid"].frames[0].to_pandas()


@pytest.mark.parametrize("name", ["fluid", "turned"])
def test_table_of_a_frame_has_unwrapped_positions(runs, name):
    frame = runs[name].frames[-1]
    table = frame.to_pandas(unwrapped=True)
    assert np.array_equal(table[["x", "y", "z"]].to_numpy(), frame.unwrapped)
    assert np.any(frame.unwrapped != frame.position)


# --- MDAnalysis --------------------------------------------------------------------------------------------


def test_mean_square_displacement_of_mdanalysis_is_that_of_the_run(runs):
    pytest.importorskip("MDAnalysis")
    from MDAnalysis.analysis.msd import EinsteinMSD

    run = runs["fluid"]
    place = run.frames.array("unwrapped")
    assert np.abs(run.frames.array("image")).max() > 0, "particles have crossed the faces"
    expected = [np.mean(np.sum((place[k:] - place[: len(place) - k]) ** 2, axis=2)) for k in range(len(place))]
    found = EinsteinMSD(run.to_mdanalysis(unwrapped=True), select="all", fft=False).run().results.timeseries
    # Single precision, of positions of up to some edges.
    assert np.allclose(found, expected, rtol=1e-5, atol=1e-5)
    # The run's own: up to 16 intervals from all states, as here.
    msd = run.correlations["msd"]
    for lag, value in zip(msd["lag"].to_numpy()[:16], msd["value"].to_numpy()[:16]):
        assert found[round(lag / 0.5)] == pytest.approx(value, rel=1e-5, abs=1e-9)
    wrapped = EinsteinMSD(run.to_mdanalysis(), select="all", fft=False).run().results.timeseries
    assert wrapped[-1] < 0.8 * expected[-1], "positions in the box jump"


def test_unwrapped_universe_of_a_sheared_run_is_that_of_its_frames(runs):
    pytest.importorskip("MDAnalysis")
    run = runs["sheared"]
    universe = run.to_mdanalysis(unwrapped=True)
    for step, frame in zip(universe.trajectory[::7], run.frames[::7]):
        assert np.allclose(step.positions, frame.unwrapped, rtol=1e-6, atol=1e-5)
        assert step.time == pytest.approx(frame.time)


def test_unwrapped_universe_outlives_the_file_and_goes_to_other_processes(runs):
    pytest.importorskip("MDAnalysis")
    with haff.open(runs["fluid"].path) as run:
        universe = run.to_mdanalysis(unwrapped=True)
    universe.trajectory[-1]
    expected = runs["fluid"].frames[-1].unwrapped
    assert np.allclose(universe.atoms.positions, expected, atol=1e-4)
    again = pickle.loads(pickle.dumps(universe))
    again.trajectory[-1]
    assert np.allclose(again.atoms.positions, expected, atol=1e-4)
    again.trajectory[-2]
    assert np.allclose(again.atoms.positions, runs["fluid"].frames[-2].unwrapped, atol=1e-4)


@pytest.mark.parametrize("value", ["yes", 1, None])
def test_unwrapped_that_is_neither_true_nor_false_is_refused(runs, value):
    for what in (runs["fluid"].to_mdanalysis, runs["fluid"].frames[0].to_pandas):
        with pytest.raises(ArgumentError, match=r"unwrapped = .*: must be True or False"):
            what(unwrapped=value)
