"""Pistons: what files and pages have of them, how runs go on with another load, and what scenes cannot have."""

from __future__ import annotations

import json
import warnings

import h5py
import numpy as np
import pytest

import haff
from haff.files import pistons
from pages import in_node, page_of

PRESS = {
    "seed": 4,
    "domain": {"size": [6.0, 6.0, 20.0], "boundary": ["periodic", "periodic", "open"], "gravity": [0.0, 0.0, -0.5]},
    "species": [{"name": "grain", "count": 40, "radius": 0.4, "mass": 1.0, "temperature": 1.0}],
    "contact": {"restitution": 0.95},
    "wall": [
        {"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}, "restitution": 1.0},
        {
            "name": "lid",
            "plane": {"point": [0, 0, 20], "normal": [0, 0, -2]},
            "mass": 15.0,
            "force": 4.0,
            "velocity": [0, 0, -0.5],
        },
    ],
    "run": {"until": 20.0},
    "output": {"frames": 1.0, "observables": 0.25, "events": True},
}


@pytest.fixture(scope="module")
def press(tmp_path_factory):
    return haff.run(PRESS, file=tmp_path_factory.mktemp("pistons") / "press.h5").path


def test_a_file_has_pistons_with_its_frames_and_samples(press):
    with haff.open(press) as run:
        assert run.pistons == ["lid"]
        position, velocity = run.frames.array("piston_position"), run.frames.array("piston_velocity")
        assert position.shape == velocity.shape == (21, 1, 3)
        assert np.array_equal(position[0, 0], [0, 0, 20]) and np.array_equal(velocity[0, 0], [0, 0, -0.5])
        frame = run.frames[7]
        assert np.array_equal(frame.piston_position, position[7]) and np.array_equal(frame.piston_velocity, velocity[7])
        table = run.observables
        assert np.array_equal(table["piston_position_lid_z"].to_numpy()[::4], position[:, 0, 2])
        assert np.array_equal(table["piston_velocity_lid_z"].to_numpy()[::4], velocity[:, 0, 2])
        # Its energy, the work of its load and its weight, and the balance of all.
        energy = 0.5 * 15.0 * (table["piston_velocity_lid_z"] ** 2)
        assert np.allclose(table["piston_energy"], energy, rtol=1e-13, atol=0)
        fallen = 20.0 - table["piston_position_lid_z"]
        assert np.allclose(table["load_work"], (4.0 + 15.0 * 0.5) * fallen, rtol=1e-12, atol=1e-12)
        total = (
            table["kinetic_energy"] + table["potential_energy"] + table["piston_energy"] + table["dissipated_energy"]
        )
        assert np.allclose(total - total[0], table["load_work"], rtol=0, atol=1e-10)
        assert (table["ledger_residual"].abs() < 1e-13).all() and (table["wall_work"] == 0).all()
        # No grain is beyond it.
        top = run.frames.array("position")[..., 2].max(axis=1) + 0.4
        assert (top <= position[:, 0, 2] + 1e-9).all()
        assert run.to_xarray()["piston_position"].dims == ("time", "piston", "axis")


def test_impulses_of_the_log_are_what_moves_it(press):
    with haff.open(press) as run:
        log = run.events.to_pandas()
        hits = log[(log["kind"] == "wall") & (log["j"] == run.wall_names.index("lid"))]
        assert len(hits) > 50
        end = run.frames[-1]
        gained = 15.0 * (end.piston_velocity[0, 2] + 0.5)
        by_load = -(4.0 + 15.0 * 0.5) * end.time
        by_grains = (hits["impulse"] * hits["normal_z"]).sum()
        assert gained == pytest.approx(by_load + by_grains, rel=1e-11)
        # Between the frames the path follows from the log: to the next frame, and to grains that touch it.
        path = pistons.path(run, run.scene["wall"][1])
        assert len(path.time) == len(hits) + len(run.frames)
        for _, hit in hits.iterrows():
            assert 20.0 - path.at(hit["time"]) == pytest.approx(hit["position_z"], abs=1e-9)


def test_a_path_without_a_log_is_that_of_the_frames(tmp_path):
    scene = {**PRESS, "output": {"frames": 1.0}}
    with haff.run(scene, file=tmp_path / "plain.h5").file as run:
        path = pistons.path(run, run.scene["wall"][1])
        assert np.array_equal(path.time, run.frames.time)
        heights = [20.0 - path.at(float(time)) for time in path.time]
        assert np.allclose(heights, run.frames.array("piston_position")[:, 0, 2], rtol=1e-15)


def test_a_page_moves_it_by_the_same_path(press, tmp_path):
    page = page_of(press, tmp_path)
    (wall,) = [wall for wall in page.header["walls"] if wall["name"] == "lid"]
    times = np.linspace(0.0, 20.0, 77)
    program = f"""
      const wall = header.walls.find((one) => one.name === "lid");
      const at = {times.tolist()}.map((time) => moved(wall, time).map((way, k) => wall.point[k] + way));
      console.log(JSON.stringify(at));
    """
    drawn = np.array(in_node(tmp_path, ["surroundings.js"], program, page.header))
    with haff.open(press) as run:
        path = pistons.path(run, run.scene["wall"][1])
        low, high = np.array(page.header["shown"])[:, 2]
    assert np.allclose(drawn[:, 2], [20.0 - path.at(time) for time in times], rtol=0, atol=1e-9)
    assert (drawn[:, :2] == 0).all()
    # The region has all of its way.
    assert low <= drawn[:, 2].min() and high == pytest.approx(20.0)
    assert low < wall["point"][2] < high


def test_a_run_goes_on_with_another_load_from_where_the_piston_is(tmp_path, command):
    haff.run({**PRESS, "run": {"until": 8.0}}, file=tmp_path / "first.h5")
    whole = haff.run(PRESS, file=tmp_path / "whole.h5").report["state_hash"]
    resume = ["run", "--resume", tmp_path / "first.h5", "--set", "run.until=20.0", "--json", "--quiet"]
    assert json.loads(command(*resume, "-o", tmp_path / "same.h5").stdout)["state_hash"] == whole
    changed = ["--set", "wall.lid.force=-30.0", "--set", "wall.lid.mass=5.0", "-o", tmp_path / "other.h5"]
    command(*resume, *changed)
    with haff.open(tmp_path / "first.h5") as first, haff.open(tmp_path / "other.h5") as other:
        last, start = first.frames[-1], other.frames[0]
        assert np.allclose(start.piston_position, last.piston_position, rtol=1e-14)
        assert np.allclose(start.piston_velocity, last.piston_velocity, rtol=1e-13)
        table = other.observables
        assert (table["ledger_residual"].abs() < 1e-12).all()
        # The work so far stays; the kinetic energy of the mass that is gone is a change from outside.
        before = first.observables.iloc[-1]
        assert table["load_work"][0] == pytest.approx(before["load_work"], rel=1e-12)
        gone = 0.5 * 10.0 * last.piston_velocity[0, 2] ** 2
        assert table["change_work"][0] == pytest.approx(-gone, rel=1e-9)
        # The load pulls now.
        assert other.frames[-1].piston_position[0, 2] > last.piston_position[0, 2] + 1.0
    # A place and a velocity that are set are a jump.
    jump = ["--set", "wall.lid.plane.point=[0,0,25]", "--set", "wall.lid.velocity=[0,0,1.5]"]
    command(*resume, *jump, "-o", tmp_path / "jump.h5")
    with haff.open(tmp_path / "jump.h5") as run:
        assert np.array_equal(run.frames[0].piston_position, [[0, 0, 25]])
        assert np.array_equal(run.frames[0].piston_velocity, [[0, 0, 1.5]])


def test_a_piston_is_put_where_it_was_at_the_start(tmp_path):
    """Values that are those of the scene act too: they were taken for no change."""
    first = tmp_path / "first.h5"
    haff.run(PRESS | {"output": {"frames": 1.0, "observables": 1.0}}, file=first, run__until=10.0).close()
    with haff.open(first) as run:
        here, speed = run.frames[-1].piston_position[0, 2], run.frames[-1].piston_velocity[0, 2]
    assert 0 < here < 19 and abs(speed + 0.5) > 1e-3
    for key, value, place, velocity in (
        ("velocity", [0, 0, -0.5], here, -0.5),
        ("velocity", [0, 0, 0], here, 0.0),
        ("plane__point", [0, 0, 20], 20.0, speed),
    ):
        change = {f"wall__lid__{key}": value}
        for again in range(2):
            name = tmp_path / f"{again}.h5"
            with haff.resume(first, file=name, run__until=20.0, overwrite=True, **change).file as run:
                frame = run.frames[0]
                assert frame.piston_position[0, 2] == pytest.approx(place, rel=1e-15)
                assert frame.piston_velocity[0, 2] == pytest.approx(velocity, rel=1e-14, abs=1e-15)
                assert run.observables["ledger_residual"].abs().max() < 1e-12
            with haff.Simulation(PRESS) as live:
                live.advance(until=10.0)
                for _ in range(1 + again):
                    live.set(**change)
                assert live.sample()["piston_position"][0, 2] == pytest.approx(place, rel=1e-14)


def test_live_simulations_have_pistons(press):
    simulation = haff.Simulation(PRESS)
    simulation.run()
    found = simulation.sample()
    with haff.open(press) as run:
        assert np.array_equal(found["piston_position"], run.frames[-1].piston_position)
    simulation.velocities = simulation.velocities
    again = simulation.sample()
    assert np.allclose(again["piston_position"], found["piston_position"], rtol=1e-14)
    assert np.allclose(again["piston_velocity"], found["piston_velocity"], rtol=1e-13)
    simulation.set(wall__lid__force=-30.0)
    simulation.advance(30.0)
    changed = simulation.sample()
    assert changed["piston_position"][0, 2] > found["piston_position"][0, 2] + 1.0
    assert abs(changed["ledger_residual"]) < 1e-12


def lid(**change):
    floor, press = PRESS["wall"]
    return {"wall": [floor, {key: value for key, value in {**press, **change}.items() if value is not None}]}


REFUSED = {
    "mass 0": (lid(mass=0.0), "positive"),
    "mass infinite": (lid(mass=float("inf")), "finite"),
    "load nan": (lid(force=float("nan")), "finite"),
    "load without mass": (lid(mass=None), "give its mass"),
    "velocity across": (lid(velocity=[1, 0, 0]), "along the normal"),
    "oscillation": (lid(velocity=None, motion={"kind": "sine", "amplitude": 1.0, "frequency": 1.0}), "impacts alone"),
    "rotation": (lid(velocity=None, rotation={"rate": 1.0}), "impacts alone"),
    "thermal": (lid(temperature=1.0), "impacts alone"),
    "hole": (
        lid(plane={"point": [0, 0, 20], "normal": [0, 0, -1], "hole": {"center": [3, 3, 20], "radius": 1}}),
        "impacts alone",
    ),
    "sphere": ({"wall": [{"name": "ball", "sphere": {"center": [3, 3, 5], "radius": 1}, "mass": 1.0}]}, "only a plane"),
    "rectangle": (lid(plane={"point": [0, 0, 20], "normal": [0, 0, -1], "extent": [2, 2]}), "only a plane"),
    "rest_speed": ({"contact": {"rest_speed": 0.1}}, "rest_speed"),
    "shear": (
        {"domain": {"size": [6, 6, 20], "shear": {"flow": "x", "gradient": "y", "rate": 0.1}}},
        "walls",
    ),
    "windows": ({"engine": {"neighbors": "windows"}}, "there is a piston"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_scenes_cannot_have(name):
    change, why = REFUSED[name]
    with pytest.raises(haff.HaffError, match=why):
        haff.Simulation({**PRESS, **change})


def test_a_wall_of_the_box_is_no_piston():
    box = {"size": [6.0, 6.0, 20.0], "boundary": ["periodic", "periodic", "wall"]}
    with pytest.raises(haff.SceneError, match="only a plane"):
        haff.Simulation({**PRESS, "domain": box, "wall": [{"name": "z+", "mass": 3.0}]})


def test_damaged_pistons_are_named(press, tmp_path):
    for place, value, why in [
        ("parameters/pistons", [7], "in \\[0, 2\\)"),
        ("particles/all/pistons/position/value", np.nan, "must be a number"),
    ]:
        path = tmp_path / "damaged.h5"
        path.write_bytes(press.read_bytes())
        with h5py.File(path, "r+") as file:
            file[place][...] = value
        with haff.open(path) as run, pytest.raises(haff.FileError, match=why):
            run.frames.array("piston_position")


@pytest.mark.parametrize(
    ("change", "warns"),
    [
        ({}, True),
        ({"contact": {"restitution": 0.9, "tc": 1e-5}}, False),
        ({"contact": {"restitution": 1.0}}, False),
        ({"drive": [{"kind": "white_noise", "strength": 0.1, "interval": 0.1}]}, False),
    ],
)
def test_hops_without_end_under_a_piston_are_told(change, warns):
    walls = [dict(wall) | {"restitution": 1.0} for wall in PRESS["wall"]]
    domain = PRESS["domain"] | {"gravity": [0.0, 0.0, 0.0]}
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        haff.Simulation(PRESS | {"domain": domain, "wall": walls} | change).close()
    assert any("the wall lid has the restitution 1 and presses grains" in str(one.message) for one in found) == warns
