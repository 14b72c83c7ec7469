"""Pistons: a gas at constant load has the pressure of the load, and the volume of its equation of state."""

import numpy as np
import pytest

import haff
from haff import analysis, theory

pytestmark = pytest.mark.physics


@pytest.mark.long
def test_a_gas_under_a_piston_has_the_pressure_of_its_load(command):
    # Its heat takes hundreds of times to come from the floor: with the drive, blocks of the averages are independent.
    drive = [{"kind": "andersen", "temperature": 1.0, "rate": 0.2}]
    with command.run("piston", run__until=1500.0, drive=drive).open() as run:
        table = run.observables[100:]
        floor, lid = (table[f"wall_force_{name}_z"].to_numpy() for name in ("floor", "lid"))
        height, energy = table["piston_position_lid_z"].to_numpy(), table["piston_energy"].to_numpy()
        position, velocity = (run.frames[100:].array(name) for name in ("position", "velocity"))
    # At rest on average, it is pushed by the gas as much as by its load, and so is the floor.
    for force, expected in ((floor, -32.0), (lid, 32.0)):
        found = analysis.block_average(force, 30)
        z = (found.mean - expected) / found.error
        assert abs(z) < 3.5 and found.error < 0.5, f"{found}, expected {expected}: z = {z:.1f}"
    # It has the energy of one degree of freedom at the temperature of the floor.
    found = analysis.block_average(energy, 30)
    assert abs(found.mean - 0.5) < 3.5 * found.error < 0.2, str(found)
    # Away from floor and lid, the density is that of the equation of state at the pressure F/A.
    low, high = 6.0, 18.0
    assert height.min() > high + 2.0
    inside = (position[..., 2] > low) & (position[..., 2] < high)
    number = inside.sum(axis=1) / (64.0 * (high - low))
    temperature = (np.where(inside[..., None], velocity**2, 0.0).sum(axis=(1, 2)) / inside.sum(axis=1)) / 3
    n, t = (analysis.block_average(series, 30) for series in (number, temperature))
    assert abs(t.mean - 1.0) < 3.5 * t.error < 0.03, str(t)
    pressure = lambda number: number * theory.compressibility(number * np.pi / 6)  # noqa: E731
    error = (pressure(n.mean + n.error) - pressure(n.mean - n.error)) / 2
    z = (pressure(n.mean) - 0.5) / error
    assert abs(z) < 3.5 and error < 0.01, f"pressure {pressure(n.mean)} ± {error}, expected 0.5: z = {z:.1f}"


@pytest.mark.long
def test_a_piston_that_presses_a_grain_on_a_wall_keeps_its_energy():
    """Two and a half million hops, each of which rounded the place of the piston in the same direction."""
    scene = {
        "domain": {"size": [6.0, 6.0, 6.0], "boundary": ["wall", "wall", "wall"]},
        "particle": [{"position": [3.0, 3.0, 1.0], "velocity": [0.1, 0.0, 0.0], "radius": 0.5, "mass": 1.0}],
        "contact": {"restitution": 0.9},
        "wall": [
            {
                "name": "p",
                "plane": {"point": [0, 0, 3], "normal": [0, 0, -1]},
                "mass": 20.0,
                "force": 20.0,
                "restitution": 0.7,
            }
        ],
        "run": {"until": 12.0},
    }
    with haff.Simulation(scene) as live:
        live.run()
        assert live.sample()["wall_collisions"] > 2_000_000
        assert abs(live.sample()["ledger_residual"]) < 1e-12


@pytest.mark.long
def test_two_gases_beside_a_piston_come_to_one_temperature_and_one_pressure(tmp_path):
    """A light piston between as many hot spheres as cold ones: it ends in the middle, and passes heat on."""
    gas = {"count": 100, "radius": 0.4, "mass": 1.0}
    regions = {"hot": [[0, 0, 0], [9.5, 8, 8]], "cold": [[10.5, 0, 0], [40, 8, 8]]}
    scene = {
        "seed": 2,
        "domain": {"size": [40.0, 8.0, 8.0], "boundary": ["wall", "periodic", "periodic"]},
        "species": [
            {**gas, "name": name, "temperature": 3.0 if name == "hot" else 1.0, "region": {"box": box}}
            for name, box in regions.items()
        ],
        "wall": [
            {"name": "piston", "plane": {"point": [10, 0, 0], "normal": [1, 0, 0], "two-sided": True}, "mass": 1.0}
        ],
        "run": {"until": 6000.0},
        "output": {"frames": 2000.0, "observables": 2.0},
    }
    with haff.run(scene, file=tmp_path / "gases.h5").file as run:
        table = run.observables[100:]
        x, piston = run.frames[-1].position[:, 0], run.frames[-1].piston_position[0, 0]
    # Each gas has stayed on its side.
    assert (x[:100] < piston - 0.4 + 1e-9).all() and (x[100:] > piston + 0.4 - 1e-9).all()
    difference = table["species_temperature_hot"] - table["species_temperature_cold"]
    # E = 3/2 N T + T/2 in all.
    temperature = 600.0 / (1.5 * 200 + 0.5)
    for name, series, expected, largest in (
        ("position", table["piston_position_piston_x"], 20.0, 0.2),
        ("difference of temperatures", difference, 0.0, 0.05),
        ("energy of the piston", table["piston_energy"], temperature / 2, 0.05),
    ):
        found = analysis.block_average(series.to_numpy(), 15)
        z = (found.mean - expected) / found.error
        assert abs(z) < 3.5 and found.error < largest, f"{name}: {found}, expected {expected}: z = {z:.1f}"
    assert (table["ledger_residual"].abs() < 1e-12).all() and (table["load_work"] == 0).all()
