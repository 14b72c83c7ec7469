"""Inlets and outlets: files, exports and pages of runs in which grains come and go, and what scenes cannot have."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest

import haff
from haff.export import export
from pages import in_node, page_of

DUCT = {
    "seed": 3,
    "domain": {"size": [12.0, 5.0, 5.0], "boundary": ["wall", "periodic", "wall"]},
    "species": [
        {"name": "stone", "count": 20, "radius": 0.5, "mass": 1.0, "temperature": 1.0},
        {"name": "dust", "count": 0, "radius": {"uniform": [0.2, 0.3]}, "density": 1.0},
    ],
    "contact": {"restitution": 0.9},
    "inlet": [
        {
            "species": "dust",
            "box": [[0.5, 0.0, 0.5], [3.0, 5.0, 4.5]],
            "velocity": [1.0, 0.0, 0.0],
            "temperature": 0.05,
            "rate": 6.0,
            "count": 80,
        },
        {"species": "stone", "box": [[0.5, 0.0, 0.5], [4.0, 5.0, 4.5]], "temperature": 1.0, "refill": True},
    ],
    "outlet": [{"box": [[10.0, 0.0, 0.0], [12.0, 5.0, 5.0]]}],
    "run": {"until": 30.0},
    "output": {"frames": 1.0, "observables": 1.0, "events": True},
}


@pytest.fixture(scope="module")
def duct(tmp_path_factory):
    return haff.run(DUCT, file=tmp_path_factory.mktemp("flow") / "duct.h5").path


def test_a_frame_has_the_particles_that_are_there(duct):
    with haff.open(duct) as run:
        assert (len(run), run.flows) == (100, True)
        table = run.observables
        present = run.frames.present
        assert present.shape == (31, 100)
        counts = table["particles"].to_numpy()
        assert np.array_equal(present.sum(axis=1), counts)
        assert np.array_equal(counts, 20 + table["particles_in"] - table["particles_out"])
        position = run.frames.array("position")
        assert np.array_equal(np.isfinite(position).all(axis=2), present)
        for k in (0, 10, 30):
            frame = run.frames[k]
            assert np.array_equal(frame.id, np.flatnonzero(present[k]))
            assert frame.position.shape == frame.velocity.shape == (len(frame.id), 3)
            assert np.array_equal(frame.position, position[k][frame.id])
            assert np.array_equal(frame.radius, run.radius[frame.id])
            assert np.array_equal(frame.species, run.species[frame.id])
            assert len(frame.to_pandas()) == len(frame.id) and (frame.to_pandas()["id"] == frame.id).all()
        # All stones come back, no dust does.
        assert (run.species[:20] == 0).all() and (run.species[20:] == 1).all()
        dust = present[:, 20:].astype(int)
        assert (np.abs(np.diff(dust, axis=0)).sum(axis=0) <= 2).all()
        assert len(np.unique(run.radius[20:])) == 80


def test_balances_close(duct):
    with haff.open(duct) as run:
        table = run.observables
        assert (table["ledger_residual"].abs() < 1e-13).all()
        for axis in "xyz":
            momentum = table[f"momentum_{axis}"] - table[f"external_impulse_{axis}"]
            assert np.abs(momentum - momentum[0]).max() < 1e-12 * (1 + table[f"external_impulse_{axis}"].abs().max())
        assert (table[["inlet_energy", "outlet_energy"]].iloc[-1] > 0).all()
        rate = table["discharge_rate"].to_numpy()[1:]
        assert np.allclose(rate, np.diff(table["particles_out"]) / np.diff(table["time"]), rtol=1e-12)


def test_events_name_who_comes_and_goes(duct):
    with haff.open(duct) as run:
        log = run.events.to_pandas()
        there = run.frames.present
        times = run.frames.time
        for k in (5, 20, 30):
            before = log[log["time"] <= times[k]]
            count = 20 * np.ones(1, int) + (before["kind"] == "enter").sum() - (before["kind"] == "leave").sum()
            assert count == there[k].sum()
        entered = log["i"][log["kind"] == "enter"]
        assert sorted(entered[entered >= 20]) == list(range(20, 20 + len(entered[entered >= 20])))


@pytest.mark.parametrize("form", ["gsd", "extxyz", "vtkhdf", "csv"])
def test_exports_leave_out_who_is_not_there(duct, form, tmp_path):
    with haff.open(duct) as run:
        counts = run.frames.present.sum(axis=1)
        table = {"table": "frames"} if form == "csv" else {}
        path = export(run, tmp_path / f"duct.{form}", **table)
    if form == "gsd":
        gsd = pytest.importorskip("gsd.hoomd")
        with gsd.open(str(path)) as trajectory:
            assert [frame.particles.N for frame in trajectory] == counts.tolist()
    elif form == "extxyz":
        ase = pytest.importorskip("ase.io")
        frames = ase.read(path, index=":")
        assert [len(frame) for frame in frames] == counts.tolist()
        assert all(np.isfinite(frame.positions).all() for frame in frames)
    elif form == "csv":
        import pandas as pd

        table = pd.read_csv(path)
        assert table.groupby("frame").size().tolist() == counts.tolist() and not table.isna().any().any()
    else:
        with h5py.File(path) as hdf:
            root = hdf["VTKHDF"]
            assert root["NumberOfPoints"][:].tolist() == counts.tolist()
            assert len(root["Points"]) == len(root["PointData/radius"]) == counts.sum()
            assert np.isfinite(root["Points"][:]).all()
            assert root["Steps/PartOffsets"][:].tolist() == list(range(len(counts)))


def test_vtk_reads_each_step(duct, tmp_path):
    vtk = pytest.importorskip("vtkmodules.vtkIOHDF")
    with haff.open(duct) as run:
        path = export(run, tmp_path / "duct.vtkhdf")
        frames = [(len(frame.id), frame.position, frame.id) for frame in run.frames]
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(path))
    from vtkmodules.util.numpy_support import vtk_to_numpy

    for k in (0, 7, 30):
        reader.UpdateInformation()
        reader.SetStep(k)
        reader.Update()
        found = reader.GetOutputDataObject(0)
        count, position, ids = frames[k]
        assert found.GetNumberOfPoints() == count and found.GetNumberOfVerts() == count, k
        assert np.array_equal(vtk_to_numpy(found.GetPoints().GetData()), position)
        assert np.array_equal(vtk_to_numpy(found.GetPointData().GetArray("id")), ids)


def test_a_scene_starts_from_those_that_are_there(duct, tmp_path):
    with haff.open(duct) as run:
        frame = run.frames[-1]
        counts, position, radius = np.bincount(frame.species).tolist(), frame.position, frame.radius
    scene = {
        "domain": DUCT["domain"],
        "species": [{**one, "count": count} for one, count in zip(DUCT["species"], counts)],
        "initial": {"positions": {"file": str(duct)}},
        "run": {"until": 1.0},
    }
    start = haff.Simulation(scene)
    assert np.array_equal(start.positions, position) and np.array_equal(start.radii, radius)


@pytest.mark.long
@pytest.mark.parametrize("change", [{}, {"dimension": 2}])
def test_one_trajectory(change, tmp_path, command):
    scene = {**DUCT, **change, "output": {"frames": 5.0}}
    if change:
        flat = json.loads(json.dumps(scene), parse_float=float)
        flat["domain"] = {"size": [12.0, 5.0], "boundary": ["wall", "periodic"], "gravity": [0.1, 0.0]}
        for place in [*flat["inlet"], *flat["outlet"]]:
            place["box"] = [corner[:2] for corner in place["box"]]
        flat["inlet"][0]["velocity"] = [1.0, 0.0]
        scene = flat
    hashes = set()
    for neighbors, threads in (("auto", 1), ("cells", 1), ("windows", 2), ("lists", 2)):
        path = tmp_path / f"{neighbors}.h5"
        run = haff.run({**scene, "engine": {"neighbors": neighbors}}, file=path, threads=threads)
        hashes.add(run.report["state_hash"])
    # Ended earlier, and gone on from there.
    haff.run({**scene, "run": {"until": 11.0}}, file=tmp_path / "first.h5")
    arguments = ["--resume", tmp_path / "first.h5", "--set", "run.until=30.0", "-o", tmp_path / "second.h5"]
    hashes.add(json.loads(command("run", *arguments, "--json", "--quiet").stdout)["state_hash"])
    assert len(hashes) == 1, hashes


def test_live_simulations_have_all_rows(duct):
    simulation = haff.Simulation(DUCT)
    simulation.run()
    with haff.open(duct) as run:
        last = run.frames.array("position")[-1]
    assert np.array_equal(simulation.positions, last, equal_nan=True)
    with pytest.raises(haff.HaffError, match="inlets or outlets"):
        simulation.velocities = np.zeros((100, 3))


REFUSED = {
    "no count": ({"inlet": [{"species": "dust", "box": [[1, 1, 1], [2, 2, 2]], "rate": 1.0}]}, "how many particles"),
    "rate and refill": (
        {"inlet": [{"species": "dust", "box": [[1, 1, 1], [2, 2, 2]], "rate": 1.0, "count": 3, "refill": True}]},
        "not both",
    ),
    "neither": ({"inlet": [{"box": [[1, 1, 1], [2, 2, 2]]}]}, "give rate"),
    "unknown species": (
        {"inlet": [{"species": "sand", "box": [[1, 1, 1], [2, 2, 2]], "rate": 1.0, "count": 3}]},
        "no species is named",
    ),
    "outside": (
        {"inlet": [{"species": "dust", "box": [[1, 1, 1], [20, 2, 2]], "rate": 1.0, "count": 3}]},
        "within the box along x",
    ),
    "upside down": ({"outlet": [{"box": [[1, 1, 1], [2, 0, 2]]}]}, "upper corner above"),
    "no box": ({"outlet": [{}]}, "a lower and an upper corner"),
    "interval": ({"outlet": [{"box": [[1, 1, 1], [2, 2, 2]], "interval": 0}]}, "positive"),
    "refill without outlet": (
        {"inlet": [{"box": [[1, 1, 1], [2, 2, 2]], "refill": True}], "outlet": []},
        "no \\[\\[outlet",
    ),
    "msd": ({"measure": {"msd": True}}, "does not work with measure.msd"),
    "shear": (
        {"domain": {"size": [12, 5, 5], "shear": {"flow": "x", "gradient": "y", "rate": 0.1}}},
        "does not work with domain.shear",
    ),
    "drive": ({"drive": [{"kind": "rescale", "temperature": 1.0, "interval": 1.0}]}, "does not work with a drive"),
    "empty species": (
        {"inlet": [], "species": [{"name": "dust", "count": 0, "radius": 0.2, "density": 1.0}]},
        "there is no other particle, and no",
    ),
    "too many": (
        {"inlet": [{"species": "dust", "box": [[1, 1, 1], [2, 2, 2]], "rate": 1.0, "count": 10**12}]},
        "too many particles",
    ),
    "count of nothing": (
        {"inlet": [{"species": "dust", "box": [[1, 1, 1], [2, 2, 2]], "rate": 1.0, "count": 0}]},
        "1 or more",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_scenes_cannot_have(name):
    change, why = REFUSED[name]
    with pytest.raises(haff.SceneError, match=why):
        haff.Simulation({**DUCT, **change})


def test_a_page_hides_who_is_not_there(duct, tmp_path):
    page = page_of(duct, tmp_path)
    with haff.open(duct) as run:
        present = run.frames.present
    assert page.header["frames"]["unit"] is None, "positions as numbers that have a NaN"
    position, velocity, _ = page.frames()
    assert np.array_equal(np.isfinite(position).all(axis=2), present)
    assert np.array_equal(np.isfinite(velocity).all(axis=2), present)
    assert np.isfinite(page.header["frames"]["speed"]).all()


def test_a_page_draws_who_leaves_up_to_the_next_frame(tmp_path):
    # In free flight from the last frame that it has; who comes in is drawn from its first frame on.
    program = """
      const [a, u, none] = [[1, 2, 3], [0.5, 0, 0], [NaN, NaN, NaN]];
      const paths = ["line", "kink"].map((flight) => place(flight, a, none, u, none, [0, 0, -1], null, 0.5, 1));
      console.log(JSON.stringify(paths));
    """
    for path in in_node(tmp_path, ["flight.js"], program):
        assert path == pytest.approx([1.25, 2.0, 2.875])
