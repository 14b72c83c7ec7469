"""Pistons: a gas at constant load has the pressure of the load, and the volume of its equation of state."""

import numpy as np
import pytest

from haff import analysis, theory

pytestmark = pytest.mark.physics


def test_a_gas_under_a_piston_has_the_pressure_of_its_load(command):
    with command.run("piston", run__until=1500.0).open() as run:
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
