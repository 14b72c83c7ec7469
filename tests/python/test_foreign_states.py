"""Scenes that start from files of other programs: GSD, extended XYZ and CSV, in the command and in live simulations."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import haff
from haff.errors import FileError, SceneError
from haff.files import foreign


def scene(file, **more):
    return {
        "species": [{"name": "grain", "count": 200, "radius": {"uniform": [0.3, 0.5]}, "density": 1.0}],
        "initial": {"positions": {"file": str(file), **more}},
        "contact": {"restitution": 0.9},
        "run": {"until": 2.0},
    }


@pytest.fixture(scope="module")
def gas(tmp_path_factory):
    folder = tmp_path_factory.mktemp("states")
    start = scene("") | {
        "domain": {"packing_fraction": 0.1},
        "initial": {"temperature": 1.0},
        "output": {"frames": 0.5},
    }
    haff.run(start, file=folder / "gas.h5", seed=2)
    with haff.open(folder / "gas.h5") as run:
        for ending in ("gsd", "xyz", "csv"):
            options = {"to": "extxyz"} if ending == "xyz" else {"table": "frames"} if ending == "csv" else {}
            run.export(folder / f"gas.{ending}", **options)
        yield run


@pytest.mark.parametrize(("ending", "precision"), [("gsd", 1e-6), ("xyz", 0.0), ("csv", 0.0)])
@pytest.mark.parametrize("index", [-1, 0, 2])
def test_a_scene_starts_from_a_frame_of_another_programs_file(gas, ending, precision, index):
    frame = gas.frames[index]
    settings = {"domain": {"size": list(frame.box.size)}} if ending == "csv" else {}
    live = haff.Simulation(scene(gas.path.with_suffix(f".{ending}"), index=index) | settings)
    np.testing.assert_allclose(live.positions, frame.position, atol=precision * frame.box.size[0])
    np.testing.assert_allclose(live.velocities, frame.velocity, atol=10 * precision)
    np.testing.assert_allclose(live.radii, gas.radius, rtol=precision)
    np.testing.assert_allclose(live.box.size, frame.box.size, rtol=precision)


def test_the_command_reads_the_same_state_as_python(gas, command, tmp_path):
    start = scene(gas.path.with_suffix(".xyz"), index=1)
    haff.save_scene(start, tmp_path / "from_xyz.toml")
    command("run", tmp_path / "from_xyz.toml", "-o", tmp_path / "out.h5", "--quiet")
    live = haff.Simulation(start)
    with haff.open(tmp_path / "out.h5") as run:
        np.testing.assert_array_equal(run.frames[0].position, live.positions)
        live.advance(2.0)
        np.testing.assert_array_equal(run.frames[-1].position, live.positions)
    # A complete run is not started again, whether its first state is still there or not.
    command("run", "--resume", tmp_path / "out.h5", "--quiet")


def test_a_frame_of_an_output_file_is_chosen_by_its_index(gas):
    live = haff.Simulation(scene(gas.path, index=1))
    np.testing.assert_array_equal(live.velocities, gas.frames[1].velocity)
    with pytest.raises(FileError, match="there is no frame 77"):
        haff.Simulation(scene(gas.path, index=77))


def test_the_command_refuses_a_frame_that_a_file_lacks(gas, command, tmp_path):
    for ending in ("h5", "xyz"):
        haff.save_scene(scene(gas.path.with_suffix(f".{ending}"), index=77), tmp_path / "scene.toml")
        found = command("check", tmp_path / "scene.toml", check=False)
        assert found.returncode == 4 and "frame" in found.stderr, found.stderr


def test_velocities_that_a_file_lacks_are_drawn_from_a_temperature(gas, tmp_path):
    table = pd.DataFrame(gas.frames[0].position, columns=list("xyz")).assign(diameter=2 * gas.radius)
    table.to_csv(tmp_path / "places.csv", index=False)
    box = {"domain": {"size": list(gas.box.size)}}
    with pytest.raises(SceneError, match=r"no velocities: give initial\.temperature"):
        haff.Simulation(scene(tmp_path / "places.csv") | box)
    warm = scene(tmp_path / "places.csv") | box
    warm["initial"]["temperature"] = 2.0
    assert haff.Simulation(warm).sample()["temperature"] == pytest.approx(2.0)
    with pytest.raises(SceneError, match=r"no box: give domain\.size"):
        haff.Simulation(warm | {"domain": {}})


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "x,y,z\n1,2,3\n", "lacks radii: its columns are x, y, z; one must be radius"),
        ("b.csv", "radius\n1\n", "lacks positions"),
        ("c.csv", "", "cannot be read"),
        ("d.csv", "x,y,z,radius\n1,2,inf,1\n", "has a position that is not finite"),
        ("a.xyz", "1\nProperties=pos:R:3\n1 2 3\n", "lacks radii: its properties are pos; one must be radius:R:1"),
        ("b.xyz", "1\nsome comment\nHe 1 2 3\n", "is not extended XYZ"),
        ("c.xyz", "2\nProperties=pos:R:3\n1 2 3\n", "frame 0 ends early"),
        ("d.xyz", "two\n", "is not XYZ"),
        (
            "e.xyz",
            '1\nLattice="1 nan 0 0 1 0 0 0 1" Properties=pos:R:3:radius:R:1\n1 2 3 1\n',
            "edges that are not finite",
        ),
        ("a.gsd", "no gsd", "cannot be read"),
    ],
)
def test_files_that_no_scene_can_start_from_are_refused_with_what_they_lack(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(FileError, match=message):
        foreign.read(tmp_path / name)
    with pytest.raises(FileError, match=message):
        haff.Simulation(scene(tmp_path / name))


def test_a_tilted_box_needs_a_sheared_scene(tmp_path):
    path = tmp_path / "tilted.xyz"
    path.write_text('1\nLattice="9 0 0 2 9 0 0 0 9" Properties=pos:R:3:velo:R:3:radius:R:1\n1 2 3 0 0 0 0.4\n')
    np.testing.assert_array_equal(foreign.read(path).edges, [[9, 0, 0], [2, 9, 0], [0, 0, 9]])
    one = scene(path) | {"species": [{"name": "grain", "count": 1, "radius": 0.4, "mass": 1.0}]}
    with pytest.raises(SceneError, match=r"the box of the file is sheared: the scene needs domain\.shear"):
        haff.Simulation(one)
    shear = {"flow": "x", "gradient": "y", "rate": 1.0}
    assert haff.Simulation(one | {"domain": {"shear": shear}}).box.edges[1, 0] == 2.0


def test_a_gsd_file_without_diameters_is_refused(tmp_path):
    gsd = pytest.importorskip("gsd.hoomd")
    with gsd.open(str(tmp_path / "points.gsd"), "w") as file:
        frame = gsd.Frame()
        frame.particles.N, frame.particles.position = 1, [[0, 0, 0]]
        frame.configuration.box = [5, 5, 5, 0, 0, 0]
        file.append(frame)
    with pytest.raises(FileError, match="lacks radii: it has neither particles/diameter nor spheres in type_shapes"):
        foreign.read(tmp_path / "points.gsd")


def test_a_missing_file_is_named():
    with pytest.raises(FileError, match=r"nowhere\.gsd: there is no such file"):
        foreign.read("nowhere.gsd")


DUMP = """ITEM: TIMESTEP
0
ITEM: NUMBER OF ATOMS
2
ITEM: BOX BOUNDS pp pp ff
0 5
0 5
0 6
ITEM: ATOMS id type x y z vx vy vz radius mass
1 1 1 1 1 0 0 1 0.5 2
2 1 3 3 3 0 1 0 0.5 2
"""
DATA = """grains

2 atoms
1 atom types
0 5 xlo xhi
0 5 ylo yhi
0 6 zlo zhi

Atoms # sphere

1 1 1.0 2.0 1 1 1
2 1 1.0 2.0 3 3 3

Velocities

1 0 0 1 0 0 0
2 0 1 0 0 0 0
"""
XML = """<DynamOconfig version="1.5.0"><Simulation><SimulationSize x="10" y="8" z="12"/><BC Type="PBC"/>
<Interactions><Interaction Type="HardSphere" Diameter="1" Elasticity="1" Name="Bulk"/></Interactions></Simulation>
<ParticleData><Pt ID="0"><P x="1" y="0" z="0"/><V x="0" y="0" z="1"/></Pt></ParticleData></DynamOconfig>"""
MERCURY = """2 0 0 0 0 5 5 6
1 1 1 0 0 1 0.5 0 0 0 0 0 0 0
3 3 3 0 1 0 0.5 0 0 0 0 0 0 0
"""


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "text"), [("a.lammpstrj", DUMP), ("a.data", DATA), ("a.xml", XML), ("b.data", MERCURY)]
)
def test_changed_files_of_other_programs_are_read_or_refused(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    assert len(foreign.read(path).radius) == (1 if name == "a.xml" else 2)
    random = np.random.default_rng(3)
    refused = 0
    for _ in range(400):
        damaged = bytearray(text.encode())
        for _ in range(random.integers(1, 4)):
            at = random.integers(len(damaged))
            match random.integers(3):
                case 0:
                    damaged[at] = random.integers(1, 256)
                case 1:
                    del damaged[at : at + random.integers(1, 30)]
                case _:
                    damaged[at:at] = damaged[: random.integers(1, 20)]
            if not damaged:
                break
        path.write_bytes(bytes(damaged))
        try:
            state = foreign.read(path)
            assert np.isfinite(state.position).all() and np.isfinite(state.radius).all()
        except FileError as error:
            refused += str(path) in str(error)
    assert refused > 100
