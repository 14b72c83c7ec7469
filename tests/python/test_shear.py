"""Sheared boxes: their frames, exports, restarts and rheology, against formulas that sum over images one by one."""

from __future__ import annotations

import itertools
import json
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

import haff
import synthetic
from haff import analysis, figures
from haff.errors import FileError, MissingDataError, NotApplicableError, SceneError
from haff.files import foreign
from haff.scenes import recorded_state
from validation import audit

AXES = [(f, g) for f in range(3) for g in range(3) if f != g]


def scene(flow="x", gradient="y", rate=0.9, d=3, **more):
    return {
        "title": "sheared",
        "seed": 5,
        "dimension": d,
        "domain": {
            "packing_fraction": 0.42 if d == 3 else 0.6,
            "shear": {"flow": flow, "gradient": gradient, "rate": rate},
        },
        "species": [{"name": "grain", "count": 343 if d == 3 else 196, "radius": 0.5, "mass": 2.0}],
        "initial": {"positions": "lattice", "temperature": 1.0},
        "contact": {"restitution": 0.9},
        "measure": {"stress": True},
        "run": {"until": 6.0},
        "output": {"frames": 0.05, "observables": 0.05, "events": True},
        **more,
    }


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("sheared")


@pytest.fixture(scope="module")
def dense(folder):
    """Flow along x, gradient along y: the order that every format holds."""
    haff.run(scene(), file=folder / "dense.h5")
    with haff.open(folder / "dense.h5") as run:
        yield run


@pytest.fixture(scope="module")
def turned(folder):
    """Flow along z, gradient along x: the matrix of edge vectors is an upper triangle."""
    haff.run(scene("z", "x", -0.6), file=folder / "turned.h5", run__until=2.0)
    with haff.open(folder / "turned.h5") as run:
        yield run


@pytest.fixture(scope="module")
def disks(folder):
    haff.run(scene("y", "x", 0.7, d=2), file=folder / "disks.h5", run__until=3.0)
    with haff.open(folder / "disks.h5") as run:
        yield run


def images(edges, d=3):
    """Vectors of all images next to the box."""
    return np.array(list(itertools.product(*[(-1, 0, 1)] * d, *[[0]] * (3 - d)))) @ edges


def distances(position, edges, d=3):
    """[N, N] distances of the nearest images, found one by one; infinite on the diagonal."""
    apart = position[None] - position[:, None]
    found = np.min([np.linalg.norm(apart + shift, axis=2) for shift in images(edges, d)], axis=0)
    np.fill_diagonal(found, np.inf)
    return found


# --- frames ------------------------------------------------------------------------------------------


def test_edge_vectors_follow_the_flow_of_the_upper_image(dense, turned, disks):
    for run, (flow, gradient, rate) in ((dense, (0, 1, 0.9)), (turned, (2, 0, -0.6)), (disks, (1, 0, 0.7))):
        assert run.shear == haff.Shear(flow, gradient, rate)
        length, height = run.box.size[flow], run.box.size[gradient]
        for frame in run.frames:
            edges = np.diag(run.box.size)
            turns = rate * height * frame.time / length
            edges[gradient, flow] = (turns - round(turns)) * length
            found = frame.box.edges.copy()
            assert abs(found[gradient, flow]) <= length / 2
            # At half an edge rounding decides on which side.
            found[gradient, flow] += round((edges - found)[gradient, flow] / length) * length
            # Rounding of the turns and of the time.
            np.testing.assert_allclose(found, edges, rtol=0, atol=1e-13 * length)
            assert frame.box.volume == run.box.volume
        seen = np.array([frame.box.displacement[2] for frame in run.frames])
        assert np.ptp(seen) > 0.9 * length, "the displacement has passed half an edge"
    assert "shear        flow along x, gradient along y, rate 0.9" in repr(dense)
    assert "y edge displaced along x" in repr(dense.frames[3].box)


def test_unwrapped_positions_are_continuous_and_move_with_the_velocity(dense, turned, disks):
    for run in (dense, turned, disks):
        flow, gradient, rate = run.shear
        frames, log = run.frames, run.events.to_pandas(["time", "i", "j"])
        time, unwrapped = frames.time, frames.array("unwrapped")
        velocity, image = frames.array("velocity"), frames.array("image")
        # A row of images that is k edges higher moves faster by k times the rate times the edge.
        velocity[..., flow] += image[..., gradient] * rate * run.box.size[gradient]
        jumps = crossed = 0
        for k in range(len(frames) - 1):
            np.testing.assert_array_equal(unwrapped[k], frames[k].unwrapped)
            during = log[(log["time"] > time[k]) & (log["time"] <= time[k + 1])]
            free = np.ones(len(run), bool)
            free[np.concatenate([during["i"], during["j"]]).astype(int)] = False
            way = velocity[k, free] * (time[k + 1] - time[k])
            # Rounding of coordinates of up to a few edges.
            np.testing.assert_allclose(unwrapped[k + 1, free] - unwrapped[k, free], way, rtol=0, atol=1e-12)
            reduced = abs(np.diff([frame.box.displacement[2] for frame in frames[k : k + 2]])[0])
            jumps += bool(reduced > 0.5 * run.box.size[flow] and np.any(image[k, free, gradient] != 0))
            crossed += np.sum(image[k + 1, free, gradient] != image[k, free, gradient])
        assert jumps > 0 and crossed > 5, "the test has seen what it is about"


@pytest.mark.long
def test_no_particles_are_nearer_than_a_diameter_across_the_sliding_faces(dense, turned, disks):
    for run in (dense, turned, disks):
        d, ignored = run.dimension, 0.0
        for frame in run.frames[::12]:
            near = distances(frame.position, frame.box.edges, d)
            assert near.min() >= 1 - 1e-12
            assert analysis.max_overlap(frame).depth <= 1e-12
            ignored = max(ignored, 1 - distances(frame.position, np.diag(run.box.size), d).min())
        assert ignored > 0.05, "without the displacement particles would overlap"
        r, g = analysis.radial_distribution(run.frames[10::10], 2.0, 40)
        # freud has single precision: a pair in contact may be in the bin below.
        assert np.all(g[r < 1 - 0.05] == 0) and g[np.searchsorted(r, 1.0)] > 1.5


class Placed:
    """A substitute for a frame: random places in a sheared box."""

    def __init__(self, rng, flow, gradient, d=3, n=60, size=(9.0, 7.0, 8.0), radius=None):
        self.file = SimpleNamespace(path="here")
        size = np.array([*size[:d], *[1.0] * (3 - d)])
        self.position = rng.random((n, 3)) * size * (np.arange(3) < d)
        self.radius = np.full(n, 0.5) if radius is None else radius
        self.mass = np.ones(n)
        displacement = gradient, flow, rng.uniform(-0.5, 0.5) * size[flow]
        self.box = haff.Box(size, ("periodic",) * 3, d, displacement)


@pytest.mark.parametrize(("flow", "gradient"), AXES)
def test_pairs_across_displaced_faces_are_those_of_all_images(flow, gradient):
    rng = np.random.default_rng(10 * flow + gradient)
    for size in ((9.0, 7.0, 8.0), (2.5, 2.2, 2.4)):
        for _ in range(20):
            frame = Placed(rng, flow, gradient, n=25, size=size, radius=rng.uniform(0.2, 0.5, 25))
            near = distances(frame.position, frame.box.edges)
            contact = frame.radius[:, None] + frame.radius
            depth = (contact - near) / contact
            found = analysis.max_overlap(frame)
            if depth.max() > 0:
                assert found.depth == pytest.approx(depth.max(), abs=1e-12)
                assert depth[found.pair] == pytest.approx(depth.max(), abs=1e-12)
            else:
                assert found.depth <= 0
            apart = frame.box.nearest(frame.position[None] - frame.position[:, None])
            close = near < 0.5 * min(size)
            np.testing.assert_allclose(np.linalg.norm(apart, axis=2)[close], near[close], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("flow", "gradient", "d"), [*((*axes, 3) for axes in AXES), (0, 1, 2), (1, 0, 2)])
def test_freud_is_given_the_displaced_box_of_each_frame(flow, gradient, d):
    rng = np.random.default_rng(100 * d + 10 * flow + gradient)
    frames = [Placed(rng, flow, gradient, d) for _ in range(3)]
    near = [distances(frame.position, frame.box.edges, d) for frame in frames]
    r, g = analysis.radial_distribution(frames, 3.0, 6)
    counts = np.mean([np.histogram(one, np.linspace(0, 3, 7))[0] for one in near], axis=0)
    shell = np.diff(np.linspace(0, 3, 7) ** d) * (np.pi if d == 2 else 4 / 3 * np.pi)
    # freud divides by N instead of N - 1; a pair at the limit of a bin may be in the other one by single precision.
    np.testing.assert_allclose(g, counts / (60 * 60 / frames[0].box.volume * shell), rtol=0.01)
    np.testing.assert_allclose(r, np.arange(0.25, 3, 0.5), rtol=1e-6)
    for frame, one in zip(frames, near):
        linked = one < 1.1
        groups = np.arange(60)
        for _ in range(60):
            groups = np.min(np.where(linked | np.eye(60, dtype=bool), groups, 60), axis=1)
        assert list(analysis.cluster_sizes(frame, 1.1)) == sorted(np.unique(groups, return_counts=True)[1])[::-1]


@pytest.mark.parametrize(("flow", "gradient"), AXES)
def test_structure_factor_has_the_waves_of_the_displaced_box(flow, gradient):
    frame = Placed(np.random.default_rng(7), flow, gradient)
    k, found = analysis.structure_factor([frame], 2.0, 5)
    index = np.array([m for m in itertools.product(range(-6, 7), repeat=3) if any(m)])
    waves = 2 * np.pi * index @ np.linalg.inv(frame.box.edges).T
    values = np.abs(np.exp(1j * frame.position @ waves.T).sum(axis=0)) ** 2 / 60
    length = np.linalg.norm(waves, axis=1)
    width = k[1] - k[0]
    for at, value in zip(k, found):
        inside = np.abs(length - at) < width / 2
        assert value == pytest.approx(values[inside].mean(), rel=1e-12)


def test_a_range_that_the_displaced_box_is_too_narrow_for_is_refused():
    frame = Placed(np.random.default_rng(1), 0, 1)
    frame.box = haff.Box([8.0, 8.0, 8.0], ("periodic",) * 3, 3, (1, 0, 4.0))
    assert frame.box.widths == pytest.approx([8 / np.hypot(1, 0.5), 8, 8])
    for what in (lambda: analysis.radial_distribution([frame], 3.6, 4), lambda: analysis.cluster_sizes(frame, 3.6)):
        with pytest.raises(NotApplicableError, match="box is too small"):
            what()


def test_velocities_relative_to_the_flow_give_energy_and_temperature(dense, turned, disks):
    for run in (dense, turned, disks):
        table = run.observables.set_index("time")
        for frame in run.frames[::20]:
            assert analysis.kinetic_energy(frame) == pytest.approx(table["kinetic_energy"][frame.time], rel=1e-12)
            assert analysis.temperature(frame) == pytest.approx(table["temperature"][frame.time], rel=1e-12)
            assert analysis.sonine_a2(frame) == pytest.approx(table["sonine_a2"][frame.time], abs=1e-12)


# --- damage ------------------------------------------------------------------------------------------

EDGES = "particles/all/box/edges/value"


def _edges(row, column, value):
    return lambda file: file[EDGES].__setitem__((3, row, column), value)


def _replaced(change):
    def action(file):
        values = change(file[EDGES][:])
        del file[EDGES]
        file[EDGES] = values

    return action


def _boundary(*names):
    return lambda file: file["particles/all/box"].attrs.__setitem__("boundary", np.array(names, "S8"))


def _scene(old, new):
    def action(file):
        text = file["parameters/scene"].asstr()[()]
        assert old in text
        del file["parameters/scene"]
        file["parameters/scene"] = text.replace(old, new)

    return action


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_edges(1, 0, np.nan), r"value\[3, 1, 0\] = nan: must be at most half of the edge along the flow"),
        (_edges(1, 0, 5.0), r"\[3, 1, 0\] = 5.0: must be at most half of the edge"),
        (_edges(1, 0, -5.0), r"\[3, 1, 0\] = -5.0: must be at most half of the edge"),
        (_edges(0, 1, 0.5), r"\[3, 0, 1\] = 0.5: must be 0: only the y edge is displaced, along x"),
        (_edges(2, 1, np.nan), r"\[3, 2, 1\] = nan: must be 0"),
        (_edges(2, 2, 7.0), r"\[3, 2, 2\] = 7.0: must be that of the first frame"),
        (_edges(0, 0, -1.0), r"\[3, 0, 0\] = -1.0: must be in"),
        (_replaced(lambda x: np.diagonal(x, axis1=1, axis2=2)), "has edge lengths; a sheared box needs edge vectors"),
        (_replaced(lambda x: x[:, :2]), r"has shape \(121, 2, 3\); must be \(any, 3, 3\)"),
        (_replaced(lambda x: x.astype(int)), "must hold real numbers"),
        (_scene('gradient = "y"', 'gradient = "q"'), "domain.shear.gradient = 'q': must be x, y or z"),
        (_scene('gradient = "y"', 'gradient = "x"'), "must be another axis than the flow"),
        (_scene("rate = 0.9", "rate = nan"), "domain.shear.rate = nan: must be a number"),
        (_scene("rate = 0.9", ""), "domain.shear.rate is missing"),
        (_boundary("periodic", "none", "periodic"), "must be periodic along all axes of a sheared box"),
    ],
)
def test_invalid_boxes_are_refused_with_the_place(dense, tmp_path, change, message):
    path = tmp_path / "damaged.h5"
    path.write_bytes(dense.path.read_bytes())
    with h5py.File(path, "r+") as file:
        change(file)
    with haff.open(path) as run, pytest.raises(FileError, match=message):
        _ = run.box, run.frames[3].unwrapped


def test_displaced_edges_without_shear_in_the_scene_are_refused(dense, tmp_path):
    path = tmp_path / "plain.h5"
    path.write_bytes(dense.path.read_bytes())
    with h5py.File(path, "r+") as file:
        text = file["parameters/scene"].asstr()[()]
        start = text.index("[domain.shear]") if "[domain.shear]" in text else text.index("shear =")
        end = text.index("\n", start) if text[start] == "s" else text.index("\n[", start + 1)
        del file["parameters/scene"]
        file["parameters/scene"] = text[:start] + text[end:]
        file[EDGES][0, 1, 0] = 0.25
    with haff.open(path) as run, pytest.raises(FileError, match=r"a box without domain\.shear in the scene"):
        _ = run.box
    with h5py.File(path, "r+") as file:
        file[EDGES][0, 1, 0] = 0.0
    with haff.open(path) as run:
        assert run.shear is None and run.box.displacement is None and run.frames[3].box is run.box


def test_frames_end_where_the_edge_vectors_end(dense, tmp_path):
    path = tmp_path / "cut.h5"
    path.write_bytes(dense.path.read_bytes())
    synthetic.truncate(path, EDGES, 40)
    with haff.open(path) as run:
        assert len(run.frames) == 40
        np.testing.assert_array_equal(run.frames[-1].unwrapped, dense.frames[39].unwrapped)


def test_a_run_without_frames_has_the_box_and_its_shear(tmp_path):
    haff.run(scene(), file=tmp_path / "a.h5", run__until=0.2, output__frames=False)
    with haff.open(tmp_path / "a.h5") as run:
        assert "frames" not in run and run.shear.rate == 0.9 and run.box.fully_periodic
        assert "pressure_tensor_yx" in run.observables


# --- exports -----------------------------------------------------------------------------------------


@pytest.mark.long
def test_extxyz_has_the_lattice_of_each_frame(dense, turned, disks, tmp_path):
    ase = pytest.importorskip("ase.io")
    for run in (dense, turned, disks):
        run.export(tmp_path / "a.extxyz", frames="::7", overwrite=True)
        read = ase.read(tmp_path / "a.extxyz", index=":", format="extxyz")
        d = run.dimension
        for frame, atoms in zip(run.frames[::7], read):
            np.testing.assert_array_equal(atoms.cell[:d, :d], frame.box.edges[:d, :d])
            np.testing.assert_array_equal(atoms.positions, frame.position)
            np.testing.assert_array_equal(atoms.arrays["velo"], frame.velocity)
        near = atoms.get_all_distances(mic=True)
        np.fill_diagonal(near, np.inf)
        assert near.min() >= 1 - 1e-12, "as ASE sees it"
        np.testing.assert_allclose(
            atoms.positions + atoms.arrays["image"] @ frame.box.edges, frame.unwrapped, atol=1e-12
        )


def test_gsd_has_leaning_boxes_with_all_particles_in_them(dense, tmp_path):
    hoomd, freud = pytest.importorskip("gsd.hoomd"), pytest.importorskip("freud")
    dense.export(tmp_path / "a.gsd")
    rows = []
    with hoomd.open(str(tmp_path / "a.gsd"), "r") as trajectory:
        assert len(trajectory) == len(dense.frames)
        for frame, read in zip(dense.frames, trajectory):
            size, tilts = read.configuration.box[:3], read.configuration.box[3:]
            np.testing.assert_allclose(tilts, [frame.box.edges[1, 0] / frame.box.size[1], 0, 0], atol=1e-7)
            edges = np.diag(size).astype(float)
            edges[1, 0] = tilts[0] * size[1]
            particles = read.particles
            fractions = particles.position @ np.linalg.inv(edges)
            assert np.all(np.abs(fractions) <= 0.5 + 1e-6)
            # Single precision of coordinates of up to ten, times images.
            unwrapped = particles.position + particles.image @ edges + read.log["box_center"]
            np.testing.assert_allclose(unwrapped, frame.unwrapped, rtol=0, atol=2e-5)
            np.testing.assert_allclose(particles.velocity, frame.velocity, atol=1e-5)
            rows.append(unwrapped)
        cell = freud.box.Box(*size, *tilts)
        near = freud.locality.AABBQuery(cell, particles.position)
        pairs = near.query(particles.position, {"r_max": 1.2, "exclude_ii": True}).toNeighborList()
        assert len(pairs) > 343 and pairs.distances.min() > 1 - 1e-5, "as freud sees it"
    assert np.abs(np.diff(rows, axis=0)).max() < 1.0


def test_gsd_moves_what_rounds_up_to_the_upper_face_with_its_image(tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd")
    position = [[1.0, 10 - 1e-9, 5.0], [10 - 1e-9, 3.0, 2.0]]
    velocity = [[10.0, 0.0, 0.0], [3.0, 0.0, 0.0]]
    path = synthetic.sheared_flights(tmp_path / "a.h5", position, velocity, [0.0], rate=1.0, offset=2.0)
    with haff.open(path) as run:
        run.export(tmp_path / "a.gsd")
        with hoomd.open(str(tmp_path / "a.gsd"), "r") as trajectory:
            read = trajectory[0]
        edges = np.array([[10.0, 0, 0], [2.0, 10, 0], [0, 0, 10]])
        moved = read.particles.position + read.particles.image @ edges + 5.0
        np.testing.assert_allclose(moved, run.frames[0].unwrapped, atol=2e-6)
        assert read.particles.position[0, 1] == -5.0 and list(read.particles.image[:, 1]) == [1, 0]
        # At the lower face the flow is slower by the rate times the edge.
        np.testing.assert_allclose(read.particles.velocity[:, 0], [0.0, 3.0], atol=1e-6)


@pytest.mark.parametrize("name", ["turned", "disks"])
def test_boxes_that_a_format_cannot_hold_are_refused(name, request, tmp_path):
    run = request.getfixturevalue(name)
    pytest.importorskip("gsd.hoomd")
    with pytest.raises(NotApplicableError, match=r"gsd cannot hold the box: its x edge leans along [yz]"):
        run.export(tmp_path / "a.gsd")
    assert not list(tmp_path.iterdir())
    pytest.importorskip("MDAnalysis")
    with pytest.raises(NotApplicableError, match="MDAnalysis cannot hold the box"):
        run.to_mdanalysis()


@pytest.mark.long
def test_vtkhdf_has_the_edge_vectors_of_each_step(dense, disks, tmp_path):
    for run in (dense, disks):
        run.export(tmp_path / "a.vtkhdf", frames="::10", overwrite=True)
        with h5py.File(tmp_path / "a.vtkhdf") as file:
            root, d = file["VTKHDF"], run.dimension
            for k, frame in enumerate(run.frames[::10]):
                start = root["Steps/FieldDataOffsets/box_edges"][k]
                assert list(root["Steps/FieldDataSizes/box_edges"][k]) == [3, 3]
                edges = root["FieldData/box_edges"][start : start + 3]
                np.testing.assert_array_equal(edges[:d, :d], frame.box.edges[:d, :d])
                np.testing.assert_array_equal(np.diag(edges), root["FieldData/box_size"][0])
    vtk = pytest.importorskip("vtk", reason="no vtk: pip install 'haff[validation]'")
    from vtk.util.numpy_support import vtk_to_numpy

    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(tmp_path / "a.vtkhdf"))
    reader.UpdateInformation()
    for k, frame in enumerate(disks.frames[::10]):
        reader.SetStep(k)
        reader.Update()
        edges = vtk_to_numpy(reader.GetOutput().GetFieldData().GetArray("box_edges"))
        np.testing.assert_array_equal(edges[:2, :2], frame.box.edges[:2, :2])


@pytest.mark.long
def test_mdanalysis_has_the_angles_of_each_frame(dense):
    pytest.importorskip("MDAnalysis")
    from MDAnalysis.lib.distances import self_distance_array

    universe = dense.to_mdanalysis()
    angles = set()
    for k in range(0, len(dense.frames), 15):
        step, frame = universe.trajectory[k], dense.frames[k]
        # MDAnalysis has single precision, of angles in degrees.
        np.testing.assert_allclose(step.triclinic_dimensions, frame.box.edges, atol=1e-5)
        near = self_distance_array(universe.atoms.positions, box=step.dimensions)
        assert near.min() > 1 - 1e-5
        expected = distances(frame.position, frame.box.edges)[np.triu_indices(len(dense), 1)]
        close = expected < 3.0
        np.testing.assert_allclose(near[close], expected[close], atol=1e-5)
        angles.add(round(float(step.dimensions[5]), 1))
    assert len(angles) > 4


def test_tables_of_unwrapped_frames_are_those_of_the_displaced_box(dense, tmp_path):
    import pandas as pd

    dense.export(tmp_path / "a.csv", table="frames", frames="100:102", unwrapped=True)
    table = pd.read_csv(tmp_path / "a.csv")
    # pandas' own reading of numbers is good to an ulp.
    expected = dense.frames[100:102].array("unwrapped").reshape(-1, 3)
    np.testing.assert_allclose(table[["x", "y", "z"]], expected, rtol=1e-15)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["snapshot", "structure", "velocity", "energy", "stress", "temperature"])
def test_figures_of_sheared_runs_are_drawn(dense, disks, kind):
    for run in (dense, disks) if kind != "velocity" else (dense,):
        assert figures.draw(run, kind).axes


# --- states to start from -------------------------------------------------------------------------------


def start(path, index, **domain):
    found = scene()
    found["domain"] = {"shear": {"flow": "x", "gradient": "y", "rate": 0.9}, **domain}
    found["initial"] = {"positions": {"file": str(path), "index": index}}
    return found


@pytest.mark.long
@pytest.mark.parametrize(("ending", "precision"), [("h5", 0.0), ("extxyz", 0.0), ("gsd", 1e-6)])
def test_a_run_goes_on_from_a_displaced_frame(dense, tmp_path, ending, precision):
    index = 77
    frame = dense.frames[index]
    path = dense.path
    if ending != "h5":
        pytest.importorskip("gsd.hoomd") if ending == "gsd" else None
        path = dense.export(tmp_path / f"a.{ending}")
    assert abs(frame.box.displacement[2]) > 0.5
    live = haff.Simulation(start(path, index))
    np.testing.assert_allclose(live.box.edges, frame.box.edges, rtol=0, atol=10 * precision + 1e-14)
    np.testing.assert_allclose(live.positions, frame.position, rtol=0, atol=20 * precision)
    np.testing.assert_allclose(live.velocities, frame.velocity, rtol=0, atol=20 * precision)
    # Until rounding has grown by collisions the trajectory is that of the run itself.
    live.advance(0.1)
    later = dense.frames[index + 2]
    apart = later.box.nearest(live.positions - later.position)
    np.testing.assert_allclose(apart, 0.0, atol=1e-3 if precision else 1e-10)
    np.testing.assert_allclose(live.box.edges, later.box.edges, atol=10 * precision + 1e-13)


@pytest.mark.long
@pytest.mark.parametrize("ending", ["h5", "extxyz", "gsd"])
def test_displaced_states_need_the_same_shear_in_the_scene(dense, tmp_path, command, ending):
    path = dense.path
    if ending != "h5":
        pytest.importorskip("gsd.hoomd") if ending == "gsd" else None
        path = dense.export(tmp_path / f"a.{ending}", frames="77")
    index = 77 if ending == "h5" else 0
    plain = start(path, index)
    del plain["domain"]
    for found, message in (
        (plain, "the scene needs domain.shear"),
        (start(path, index, shear={"flow": "z", "gradient": "y", "rate": 1.0}), "sheared along other axes"),
    ):
        with pytest.raises(SceneError, match=message):
            haff.Simulation(found)
        haff.save_scene(found, tmp_path / "scene.toml")
        refused = command("check", tmp_path / "scene.toml", check=False)
        assert refused.returncode == 2 and message in refused.stderr
    haff.save_scene(start(path, index), tmp_path / "scene.toml")
    command("run", tmp_path / "scene.toml", "-o", tmp_path / "on.h5", "--set", "run.until=0.1", "--quiet")
    with haff.open(tmp_path / "on.h5") as run:
        first, last = run.frames[0].box.displacement[2], run.frames[-1].box.displacement[2]
        assert first == pytest.approx(dense.frames[77].box.displacement[2], abs=1e-5)
        assert run.scene["domain"]["shear"]["offset"] == first
        slid = (last - first - 0.9 * run.box.size[1] * 0.1) / run.box.size[0]
        assert slid == pytest.approx(round(slid), abs=1e-12)


def test_states_have_the_edge_vectors_of_their_frame(dense, turned, fluid_file):
    np.testing.assert_array_equal(recorded_state(turned.path, 9)["edges"], turned.frames[9].box.edges)
    assert recorded_state(fluid_file)["edges"] is None
    assert foreign.read(_csv(dense), 0).edges is None


def _csv(run):
    path = run.path.with_suffix(".csv")
    return run.export(path, table="frames", frames="3", overwrite=True)


@pytest.fixture(scope="module")
def fluid_file(folder):
    haff.run(scene() | {"domain": {"packing_fraction": 0.1}}, file=folder / "fluid.h5", run__until=0.1)
    return folder / "fluid.h5"


def test_a_foreign_state_tells_the_command_its_edge_vectors(turned, tmp_path, capfdbinary):
    path = turned.export(tmp_path / "a.extxyz", frames="9")
    assert foreign.main(str(path), 0) == 0
    header = json.loads(capfdbinary.readouterr().out.split(b"\n", 1)[0])
    assert header["edges"] == turned.frames[9].box.edges.tolist()


def test_a_live_simulation_has_the_box_of_the_present(dense):
    live = haff.Simulation(scene())
    assert live.shear == dense.shear
    # At t = 5 the displacement is half an edge but for rounding.
    for frame in dense.frames[::10]:
        live.advance(frame.time)
        np.testing.assert_allclose(live.box.edges, frame.box.edges, rtol=0, atol=1e-14)
        np.testing.assert_allclose(live.unwrapped, frame.unwrapped, rtol=0, atol=1e-13)


def test_images_of_a_live_simulation_are_counted_from_its_box_at_half_an_edge():
    # In a cube at rate 1 the displacement is half an edge at every odd multiple of one half.
    cube = scene(rate=1.0)
    live, before = haff.Simulation(cube), None
    for k in range(1, 12):
        live.advance(0.25 * k)
        size = live.box.size[0]
        if k % 2 == 0 and k % 4:
            assert abs(live.box.displacement[2]) == pytest.approx(size / 2, rel=1e-12)
        if before is not None:
            # No particle moves by half an edge relative to the flow of its place.
            away = live.unwrapped - before
            away[:, 0] -= 0.25 * live.unwrapped[:, 1]
            assert np.abs(away).max() < size / 2
        before = live.unwrapped


# --- stresses and balances ----------------------------------------------------------------------------


def test_work_of_the_shear_is_that_of_the_shear_stress(dense, turned, disks):
    for run in (dense, turned, disks):
        found, rate, volume = analysis.rheology(run), run.shear.rate, run.box.volume
        table = run.observables
        length = np.diff(table["time"])
        # W = −γ̇ V ∫ P_gf dt = γ̇² V ∫ η dt; the tensor is a mean in each interval, so that this is exact.
        work = np.cumsum(rate**2 * volume * found.viscosity * length)
        given = table["shear_work"].to_numpy()
        np.testing.assert_allclose(work, given[1:], rtol=0, atol=1e-11 * np.abs(given).max())
        assert given[-1] > 0 and found.mean_viscosity.mean > 0


def test_normal_stress_differences_are_those_of_the_tensor(dense, turned, disks):
    for run, (f, g, v) in ((dense, "xyz"), (turned, "zxy"), (disks, "yxz")):
        found, table = analysis.rheology(run), run.observables.iloc[1:]
        first = table[f"pressure_tensor_{g}{g}"] - table[f"pressure_tensor_{f}{f}"]
        np.testing.assert_array_equal(found.first_difference, first)
        np.testing.assert_array_equal(found.time, table["time"])
        late = table["time"] > found.start + 0.02
        assert found.start == pytest.approx(table["time"].iloc[-1] / 2)
        assert found.mean_first_difference.mean == pytest.approx(first[late].mean(), rel=0.05)
        assert 0 < found.mean_viscosity.error < 0.2 * found.mean_viscosity.mean
        if run.dimension == 3:
            second = table[f"pressure_tensor_{v}{v}"] - table[f"pressure_tensor_{g}{g}"]
            np.testing.assert_array_equal(found.second_difference, second)
        else:
            assert np.isnan(found.second_difference).all() and np.isnan(found.mean_second_difference.mean)


def test_a_dilute_sheared_gas_has_more_energy_along_the_flow(tmp_path):
    # P_xx > P_yy, so N1 < 0: the work of the shear goes into the velocities along the flow.
    gas = scene(rate=1.0, contact={"restitution": 0.7})
    gas["domain"]["packing_fraction"] = 0.1
    haff.run(gas, file=tmp_path / "a.h5", run__until=30.0, output__frames=False, output__events=False)
    with haff.open(tmp_path / "a.h5") as run:
        late = analysis.rheology(run, start=10.0)
    assert late.mean_first_difference.mean < -5 * late.mean_first_difference.error
    assert late.mean_viscosity.mean > 5 * late.mean_viscosity.error > 0


def test_rheology_is_refused_where_there_is_none(dense, fluid_file, tmp_path):
    with haff.open(fluid_file) as run, pytest.raises(NotApplicableError, match="no shear"):
        analysis.rheology(run)
    with pytest.raises(NotApplicableError, match="fewer than eight samples"):
        analysis.rheology(dense, start=5.9)
    with pytest.raises(NotApplicableError, match=r"analysis\.rheology"):
        analysis.shear_viscosity(dense)
    with pytest.raises(NotApplicableError, match="Haff's law needs a gas at rest"):
        analysis.cooling_law(dense)
    haff.run(scene(measure={}), file=tmp_path / "a.h5", run__until=0.2)
    with haff.open(tmp_path / "a.h5") as run, pytest.raises(MissingDataError, match=r"measure\.stress"):
        analysis.rheology(run)


@pytest.mark.long
def test_diffusion_is_that_across_the_flow(tmp_path):
    followed = scene(measure={"msd": True, "vacf": True, "interval": 0.05})
    haff.run(followed, file=tmp_path / "a.h5", run__until=12.0, output__events=False)
    with haff.open(tmp_path / "a.h5") as run:
        msd = run.correlations["msd"]
        found = analysis.self_diffusion(run, 1.0, 4.0)
        inside = (msd["lag"] >= 1.0) & (msd["lag"] <= 4.0)
        slope = np.polyfit(msd["lag"][inside], msd["value"][inside], 1, w=1 / msd["error"][inside])[0]
        # Two axes are across the flow: 2 · 2 D.
        assert found.einstein == pytest.approx(slope / 4, rel=1e-9)


def test_momentum_relative_to_the_flow_changes_by_the_external_impulse(dense, turned):
    for run in (dense, turned):
        table = run.observables
        for axis in "xyz":
            kept = table[f"momentum_{axis}"] - table[f"external_impulse_{axis}"]
            assert np.ptp(kept) < 1e-10 * len(run)
        for frame in run.frames[::25]:
            row = table[table["time"] == frame.time].iloc[0]
            own = (run.mass[:, None] * frame.peculiar_velocity).sum(axis=0)
            np.testing.assert_allclose(own, [row[f"momentum_{axis}"] for axis in "xyz"], atol=1e-10)


@pytest.mark.long
@pytest.mark.physics
@pytest.mark.parametrize("name", ["dense", "turned", "disks"])
def test_sheared_runs_pass_the_audit(name, request):
    run = request.getfixturevalue(name)
    findings = audit.audit(run) + audit.audit_without_events(run)
    assert not [str(finding) for finding in findings if not finding.passed]
    assert any(finding.name.startswith("edge vectors") for finding in findings)


@pytest.mark.long
@pytest.mark.physics
def test_rough_mixtures_in_shear_pass_the_audit(tmp_path):
    rough = scene("y", "z", 0.8, contact={"restitution": 0.8, "tangential_restitution": 0.4, "friction": 0.3})
    rough["species"][0]["radius"] = {"uniform": [0.4, 0.5]}
    rough["domain"]["packing_fraction"] = 0.3
    haff.run(rough, file=tmp_path / "rough.h5", run__until=2.0)
    with haff.open(tmp_path / "rough.h5") as run:
        findings = audit.audit(run)
        assert not [str(finding) for finding in findings if not finding.passed]
        assert any(finding.name.startswith("tangential impulse") for finding in findings)


@pytest.mark.long
@pytest.mark.physics
@pytest.mark.parametrize(
    ("change", "finding"),
    [
        ({"rate": 0.9 * (1 + 1e-9)}, "energy, relative"),
        ({"rate": 0.9 * (1 + 1e-9)}, "place of an event"),
        ({"rate": 0.9 * (1 + 1e-9)}, "edge vectors"),
        ({"offset": 1e-9}, "place of an event"),
        ({"offset": 0.2}, "overlap"),
    ],
)
def test_audit_detects_another_shear(dense, change, finding, monkeypatch):
    given = dense.scene | {"domain": dense.scene["domain"] | {"shear": dense.scene["domain"]["shear"] | change}}
    monkeypatch.setitem(dense.__dict__, "scene", given)
    broken = [one.name for one in audit.audit(dense) if not one.passed]
    assert any(name.startswith(finding) for name in broken), broken
