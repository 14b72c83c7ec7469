"""Walls of the box that move along themselves: Couette flow with a pressure, closed forms, what is refused."""

import copy

import numpy as np
import pytest

import haff

Q = 0.4  # I/(m R²) of a sphere


def box(**more):
    return {
        "schema": 1,
        "domain": {"size": [4.0, 4.0, 4.0], "boundary": ["periodic", "wall", "periodic"]},
        **more,
    }


def test_a_rough_contact_is_with_the_moving_surface(tmp_path):
    speed, beta = 3.0, 0.5
    scene = box(
        wall=[{"name": "y+", "velocity": [speed, 0.0, 0.0]}],
        contact={"restitution": 0.8, "tangential_restitution": beta},
        particle=[{"position": [1.0, 3.0, 1.0], "velocity": [1.0, 1.0, 0.0], "radius": 0.5, "mass": 2.0}],
        run={"until": 0.6},
    )
    haff.run(scene, file=tmp_path / "ball.h5")
    with haff.open(tmp_path / "ball.h5") as run:
        velocity, spin = run.frames[-1].velocity[0], run.frames[-1].angular_velocity[0]
        # The slip of the surface of the ball over the wall, 1 − 3, is reversed by β.
        change = (1 + beta) * Q / (1 + Q) * (speed - 1.0)
        assert velocity == pytest.approx([1.0 + change, -0.8, 0.0], abs=1e-14)
        # Its contact is above its centre: Δω = (R n × J)/I.
        assert spin == pytest.approx([0.0, 0.0, -change / (Q * 0.5)], abs=1e-14)
        work = run.observables["wall_work"].iloc[-1]
        assert work == pytest.approx(2.0 * change * speed, rel=1e-14)
        assert abs(run.observables["ledger_residual"].iloc[-1]) < 1e-15


COUETTE = box(
    seed=5,
    domain={"size": [8.0, 10.0, 8.0], "boundary": ["periodic", "wall", "periodic"]},
    species=[{"name": "grain", "count": 120, "radius": 0.5, "mass": 1.0}],
    initial={"positions": "lattice", "temperature": 1.0},
    contact={"restitution": 1.0},
    wall=[
        {"name": "y-", "temperature": 1.0, "velocity": [-1.0, 0.0, 0.0]},
        {"name": "y+", "temperature": 1.0, "velocity": [1.0, 0.0, 0.0]},
    ],
    measure={"stress": True, "wall_forces": True, "profiles": [{"axis": "y", "bins": 10, "interval": 50.0}]},
    run={"until": 500.0},
    output={"observables": 5.0, "frames": 50.0},
)


@pytest.fixture(scope="module")
def couette(tmp_path_factory):
    path = tmp_path_factory.mktemp("couette") / "couette.h5"
    haff.run(COUETTE, file=path)
    with haff.open(path) as run:
        yield run


def test_walls_that_move_drive_a_flow_and_the_box_has_a_pressure(couette):
    flow = couette.profiles["y"]["velocity"].isel(time=slice(1, None), component=0)
    mean = flow.mean("time").to_numpy()
    error = flow.std("time", ddof=1).to_numpy() / np.sqrt(flow.sizes["time"])
    # Antisymmetric about the middle, and increasing.
    assert np.all(np.abs(mean + mean[::-1]) < 4 * np.hypot(error, error[::-1]))
    assert np.all(np.diff(mean) > -4 * np.hypot(error[1:], error[:-1])) and mean[-1] > 0.3 > -0.3 > mean[0]
    table = couette.observables.iloc[1:]
    assert np.isfinite(table["pressure"]).all() and np.isfinite(couette.means.loc["pressure", "error"])
    # Walls give work by shear, and take it as heat.
    assert table["wall_work"].iloc[-1] > 0 > table["wall_heat"].iloc[-1]
    assert np.abs(table["ledger_residual"]).max() < 1e-13


def test_the_force_along_a_wall_is_the_shear_stress(couette):
    table = couette.observables.iloc[10:]
    area = 8.0 * 8.0
    stress, error = couette.means.loc["pressure_tensor_xy", ["mean", "error"]]
    forces = [name for name in table if name.startswith("wall_force") and name.endswith("_x") and "y+" in name]
    assert len(forces) == 1, list(table)
    drag, drag_error = couette.means.loc[forces[0], ["mean", "error"]]
    assert abs(drag / area - stress) < 4 * np.hypot(drag_error / area, error)


def test_the_same_flow_between_planes_has_the_same_trajectory():
    planes = copy.deepcopy(COUETTE)
    planes["domain"]["boundary"] = ["periodic", "open", "periodic"]
    planes["measure"] = {}
    planes["initial"] = {"positions": "lattice", "temperature": 1.0}
    walls = haff.Simulation(COUETTE | {"measure": {}, "output": {}})
    planes["wall"] = [
        {"name": "low", "plane": {"point": [0.0, 0.0, 0.0], "normal": [0.0, 1.0, 0.0]}, "velocity": [-1.0, 0.0, 0.0]},
        {"name": "high", "plane": {"point": [0.0, 10.0, 0.0], "normal": [0.0, -1.0, 0.0]}, "velocity": [1.0, 0.0, 0.0]},
    ]
    rough = {"restitution": 0.9, "tangential_restitution": 0.5}
    particles = [
        {"position": p.tolist(), "velocity": v.tolist(), "radius": 0.5, "mass": 1.0}
        for p, v in zip(walls.positions, walls.velocities)
    ]
    ends = []
    for scene in (COUETTE, planes):
        made = {key: scene[key] for key in ("schema", "domain", "wall")} | {
            "particle": particles, "contact": rough, "run": {"until": 5.0},
        }  # fmt: skip
        made["wall"] = [{key: value for key, value in wall.items() if key != "temperature"} for wall in made["wall"]]
        simulation = haff.Simulation(made)
        simulation.advance(5.0)
        ends.append((simulation.velocities, simulation.counters["wall_collisions"]))
    assert ends[0][1] == ends[1][1] > 20
    assert np.abs(ends[0][0] - ends[1][0]).max() < 1e-8


def test_a_resumed_run_can_stop_or_turn_the_walls(tmp_path):
    short = COUETTE | {"run": {"until": 5.0}, "measure": {}, "output": {"observables": 0.5}}
    haff.run(short, file=tmp_path / "a.h5")
    for velocity in ([0.0, 0.0, 0.0], [0.0, 0.0, 2.0]):
        to = tmp_path / f"{velocity[2]}.h5"
        changed = {"wall__y+__velocity": velocity, "wall__y-__velocity": [0.0, 0.0, 0.0]}
        haff.resume(tmp_path / "a.h5", file=to, run__until=10.0, **changed)
        with haff.open(to) as run:
            work = run.observables["wall_work"]
            assert np.abs(run.observables["ledger_residual"]).max() < 1e-13
            assert (work.iloc[-1] == work.iloc[0]) == (velocity[2] == 0.0)


@pytest.mark.parametrize(
    ("wall", "message"),
    [
        ({"velocity": [0.0, 1.0, 0.0]}, r"wall.0.velocity = \[0.0, 1.0, 0.0\]: must be along the wall"),
        ({"velocity": [1.0, 0.0, 0.0], "rotation": {"rate": 1.0}}, "contradicts wall.0.rotation"),
        (
            {"velocity": [1.0, 0.0, 0.0], "motion": {"kind": "sine", "amplitude": 0.1, "frequency": 1.0}},
            "contradicts wall.0.motion",
        ),
        ({"velocity": [1.0, 0.0, 0.0], "reference_time": 1.0}, "is for planes"),
        ({"velocity": [1.0, 0.0]}, "must have three numbers"),
    ],
)
def test_wrong_velocities_are_refused(wall, message):
    with pytest.raises(haff.SceneError, match=message):
        haff.validate(COUETTE | {"wall": [{"name": "y+", **wall}]})


def test_a_compressed_box_refuses_velocities_of_walls_whose_axis_changes():
    scene = copy.deepcopy(COUETTE)
    scene["domain"]["compression"] = {"rates": [0.0, 0.01, 0.0]}
    scene["run"] = {"until": 5.0}
    with pytest.raises(haff.SceneError, match="does not work for a wall of an axis whose edge changes"):
        haff.validate(scene)
