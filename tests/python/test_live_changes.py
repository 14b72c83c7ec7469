"""Live simulations whose state is changed: arrays, particles added and removed, and functions called on the way."""

from __future__ import annotations

import numpy as np
import pytest

import haff
from conftest import CONFIGS

GAS = {
    "seed": 6,
    "domain": {"packing_fraction": 0.1},
    "species": [{"name": "grain", "count": 200, "radius": 0.5, "mass": 1.0}],
    "initial": {"positions": "lattice", "temperature": 1.0},
    "contact": {"restitution": 0.9},
    "run": {"until": 10.0},
}


def test_assigned_velocities_are_those_of_the_next_instant():
    gas = haff.Simulation(GAS, events=True)
    gas.advance(1.0)
    wanted = 2 * gas.velocities
    positions = gas.positions
    gas.velocities = wanted
    np.testing.assert_array_equal(gas.velocities, wanted)
    np.testing.assert_array_equal(gas.positions, positions)
    assert gas.time == 1.0
    sample = gas.sample()
    assert sample["change_work"] == pytest.approx(0.5 * (wanted**2).sum() * 0.75, rel=1e-12)
    assert abs(sample["ledger_residual"]) < 1e-13
    gas.advance(2.0)
    events = gas.take_events()
    assert list(events["time"][events["kind"] == "change"]) == [1.0]
    assert abs(gas.sample()["ledger_residual"]) < 1e-12


def test_a_run_that_is_not_changed_has_no_work_of_changes():
    gas = haff.Simulation(GAS)
    gas.advance(0.5)
    assert "change_work" not in gas.sample()


def test_a_single_vector_is_given_to_all_particles():
    gas = haff.Simulation(GAS)
    gas.velocities = [0.0, 0.0, 1.0]
    np.testing.assert_array_equal(gas.velocities, np.tile([0.0, 0.0, 1.0], (200, 1)))
    with pytest.raises(ValueError, match="shape"):
        gas.velocities = np.zeros((3, 2))
    with pytest.raises(ValueError, match=r"velocities\[0, 0\] = NaN: must be a finite number"):
        gas.velocities = np.nan


def test_moved_particles_are_wrapped_and_counted_by_their_images():
    gas = haff.Simulation(GAS)
    gas.advance(0.2)
    before = gas.unwrapped
    gas.positions = gas.unwrapped + gas.box.size[0]
    np.testing.assert_allclose(gas.unwrapped, before + gas.box.size[0], rtol=1e-12)
    assert (gas.positions < gas.box.size).all()
    with pytest.raises(ValueError, match="would overlap"):
        gas.positions = 1.0
    np.testing.assert_allclose(gas.unwrapped, before + gas.box.size[0], rtol=1e-12)


def test_particles_are_added_and_removed():
    scene = GAS | {"domain": {"size": [20.0, 20.0, 20.0], "boundary": ["wall"] * 3, "gravity": [0.0, 0.0, -1.0]}}
    gas = haff.Simulation(scene)
    gas.remove(gas.positions[:, 2] > 10.0)
    left = len(gas)
    assert 0 < left < 200 and (gas.positions[:, 2] <= 10.0).all()
    rows = gas.add([[x, 10.0, 18.0] for x in (3.0, 6.0, 9.0)], [0.0, 1.0, 0.0], radius=1.0, mass=[1.0, 2.0, 3.0])
    assert list(rows) == [left, left + 1, left + 2] and len(gas) == left + 3
    np.testing.assert_array_equal(gas.masses[-3:], [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(gas.radii[-3:], 1.0)
    assert gas.species.shape == gas.masses.shape == gas.radii.shape
    gas.advance(5.0)
    assert abs(gas.sample()["ledger_residual"]) < 1e-12
    gas.remove(-1)
    assert len(gas) == left + 2 and gas.masses[-1] == 2.0
    with pytest.raises(ValueError, match="would overlap with"):
        gas.add(gas.positions[0], radius=0.5, mass=1.0)
    with pytest.raises(ValueError, match="must be one of grain"):
        gas.add([1.0, 1.0, 1.0], species="sand")
    with pytest.raises(ValueError, match="radius: must be given"):
        gas.add([1.0, 1.0, 1.0])
    with pytest.raises(ValueError, match=r"rows = 500: must be rows, whole numbers from -\d+ to \d+, or a mask"):
        gas.remove(500)


def test_functions_are_called_at_times_and_every_so_many_collisions():
    gas = haff.Simulation(GAS)
    times, totals = [], []
    gas.every(0.25, lambda simulation: times.append(simulation.time))
    gas.every_collisions(100, lambda simulation: totals.append(simulation.collisions))
    assert gas.advance(1.1) == "until"
    assert times == [0.25, 0.5, 0.75, 1.0]
    assert totals == list(range(100, gas.collisions + 1, 100))
    assert gas.advance(1.25) == "until" and times[-1] == 1.25


def test_a_function_can_stop_the_run_and_change_the_state():
    gas = haff.Simulation(GAS)

    def thermostat(simulation):
        simulation.velocities = simulation.velocities / np.sqrt(simulation.sample()["temperature"])

    gas.every(0.5, thermostat)
    gas.every_collisions(1500, lambda simulation: True)
    assert gas.run() == "call"
    assert gas.collisions == 1500 and 0.7 < gas.sample()["temperature"] <= 1.0
    assert abs(gas.sample()["ledger_residual"]) < 1e-12
    with pytest.raises(ValueError, match="interval"):
        gas.every(0.0, thermostat)
    with pytest.raises(ValueError, match="count"):
        gas.every_collisions(0, thermostat)


def test_functions_are_called_where_nothing_moves():
    floor = {"boundary": ["periodic", "periodic", "wall"], "size": [4.0, 4.0, 20.0], "gravity": [0.0, 0.0, -1.0]}
    at_rest = {
        "schema": 1,
        "domain": floor,
        "particle": [{"position": [x, x, 0.3], "radius": 0.3, "mass": 1.0} for x in (1.0, 3.0)],
        "contact": {"restitution": 0.5, "rest_speed": 0.05},
        "run": {"until": 10.0},
    }
    heap = haff.Simulation(at_rest)
    assert heap.advance(5.0) == "rest"
    times = []

    def drop(simulation):
        times.append(simulation.time)
        simulation.add([2.0, 2.0, 10.0 + len(simulation)])

    heap.every(2.0, drop)
    start = heap.time
    assert heap.advance(7.0) == "until" and heap.time == 7.0
    assert times == [2.0 * k for k in range(1, 4) if 2.0 * k > start] and len(heap) == 2 + len(times)
    # Without a bound of time it would wait for ever.
    still = haff.Simulation(at_rest)
    still.every(1.0, lambda simulation: None)
    assert still.advance(np.inf, collisions=10) == "rest"


def test_a_changed_run_is_reproducible():
    def run(threads):
        gas = haff.Simulation(GAS, threads=threads)

        def kick(simulation):
            rng = np.random.default_rng(int(1000 * simulation.time))
            simulation.velocities = simulation.velocities + rng.normal(size=(len(simulation), 3))
            simulation.remove(0)

        gas.every(1.0, kick)
        gas.run()
        return gas.state_hash, len(gas)

    assert run(1) == run(2) == run(1) and run(1)[1] == 190


def test_scenes_with_joints_cannot_be_changed():
    pendulum = haff.Simulation(CONFIGS / "textbook/pendulums.toml")
    with pytest.raises(ValueError, match="pendulums, springs, rods or sticking contacts"):
        pendulum.velocities = 1.0
