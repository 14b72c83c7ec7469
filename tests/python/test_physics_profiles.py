"""Profiles measured by the engine: an atmosphere against hydrostatics, and a granular gas at a hot wall."""

import numpy as np
import pytest

from haff import analysis, theory

pytestmark = pytest.mark.physics


def mean_and_error(rows: np.ndarray, blocks: int = 10) -> tuple[np.ndarray, np.ndarray]:
    """Mean over the first axis, with its standard error from blocks."""
    length = len(rows) // blocks
    means = rows[-blocks * length :].reshape(blocks, length, *rows.shape[1:]).mean(axis=1)
    return means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(blocks)


@pytest.fixture(scope="module")
def atmosphere(command, tmp_path_factory):
    path = tmp_path_factory.mktemp("atmosphere") / "atmosphere.toml"
    path.write_text(
        """
        seed = 3
        [domain]
        size = [10.0, 10.0, 60.0]
        boundary = ["periodic", "periodic", "wall"]
        gravity = [0.0, 0.0, -0.1]
        [[species]]
        name = "grain"
        count = 500
        radius = 0.5
        mass = 1.0
        [initial]
        positions = "random"
        temperature = 1.0
        [contact]
        restitution = 1.0
        [run]
        until = 3000.0
        [output]
        frames = false
        observables = 1.0
        [measure]
        wall_forces = true
        profiles = [{ axis = "z", bins = 30, interval = 10.0, samples = 20 }]
        """
    )
    with command.run(path).open() as run:
        yield run


def test_errors_of_cells_are_those_of_blocks(atmosphere):
    rows = atmosphere.profiles["z"].isel(time=slice(50, None))
    found = analysis.profile_means(atmosphere, "z", start=500.0)
    _, blocks = mean_and_error(rows["density"].to_numpy(), 20)
    # An error of 20 blocks is known to 16 %, the mean of 15 independent ones to 4 %; that of profile_means no better.
    whole = slice(1, 16)
    ratio = (found["density_error"].to_numpy()[whole] / blocks[whole]).mean()
    assert 0.8 < ratio < 1.25, ratio


def test_pressure_of_an_atmosphere_carries_the_weight_above(atmosphere):
    profile = atmosphere.profiles["z"].isel(time=slice(50, None))
    pressure = profile["pressure"].sel(row="z", column="z").to_numpy()
    density = profile["density"].to_numpy()
    # Between the centers of two cells the mean density is that of both: the curvature adds (h/H)²/12 = 0.1 %.
    weight = 0.1 * 2.0 * 0.5 * (density[:, 1:] + density[:, :-1])
    balance, error = mean_and_error(pressure[:, :-1] - pressure[:, 1:] - weight)
    # Cells at the walls are partly empty: the first whole one is the second.
    z = balance[1:-2] / np.hypot(error[1:-2], 0.002 * weight.mean(axis=0)[1:-2])
    assert np.abs(z).max() < 4.5 and np.sum(z**2) < len(z) + 4 * np.sqrt(2 * len(z)), z


def test_pressure_of_an_atmosphere_is_that_of_the_equation_of_state(atmosphere):
    profile = atmosphere.profiles["z"].isel(time=slice(50, None))
    trace = sum(profile["pressure"].sel(row=axis, column=axis) for axis in "xyz").to_numpy() / 3
    density, temperature = profile["density"].to_numpy(), profile["temperature"].to_numpy()
    n, T = density.mean(axis=0)[1:20], np.nanmean(temperature, axis=0)[1:20]
    found, error = mean_and_error(trace)
    expected = n * T * theory.kolafa_labik_malijevsky(np.pi / 6 * n)
    # Fluctuations of n and T in small cells are correlated: 1 %.
    z = (found[1:20] - expected) / np.hypot(error[1:20], 0.01 * expected)
    assert np.abs(z).max() < 4, z


def test_floor_of_an_atmosphere_carries_its_weight(atmosphere):
    table = atmosphere.observables[100:]
    force, error = mean_and_error((table["wall_force_z-_z"] + table["wall_force_z+_z"]).to_numpy())
    assert abs(force + 50.0) < 4 * error + 1e-9


def test_pressure_is_uniform_between_a_hot_and_a_cold_wall_and_collisions_take_the_heat(command):
    with command.run("hot_wall", run__until=600.0, output__frames=False).open() as run:
        profile = run.profiles["z"].isel(time=slice(8, None))
        table = run.observables[160:]
        area = run.box.size[0] * run.box.size[1]
    pressure, error = mean_and_error(profile["pressure"].sel(row="z", column="z").to_numpy()[:, 1:-1], 11)
    mean = pressure.mean()
    assert np.all(np.abs(pressure - mean) < 4.5 * error + 0.02 * mean), pressure / mean
    for wall, sign in (("z-", -1), ("z+", 1)):
        force, uncertain = mean_and_error(table[f"wall_force_{wall}_z"].to_numpy())
        assert abs(sign * force / area - mean) < 4 * np.hypot(uncertain / area, error.max()) + 0.02 * mean
    density = profile["density"].mean("time").to_numpy()
    temperature = profile["temperature"].mean("time").to_numpy()
    assert density[-2] > 4 * density[1] and temperature[0] > 5 * temperature[-1] and temperature[0] < 1.0
    # In the steady state the hot wall gives what collisions take.
    lost = np.diff(table["dissipated_energy"]).mean()
    heat, uncertain = mean_and_error(table["wall_heat_flow_z-"].to_numpy())
    assert abs(heat - lost) < 4 * np.hypot(uncertain, 0.02 * lost)


@pytest.mark.long
def test_heat_between_plates_is_that_of_the_conductivity_with_jumps_at_the_walls(command):
    # Kn = 0.06: without the jumps the flow would be a quarter larger.
    n, width, edge, hot, cold = 0.02, 200.0, 22.0, 2.0, 0.5
    count = round(n * width * edge**2)
    found = command.run(
        "thermal_walls",
        domain__size=[width + 1.0, edge, edge],
        species__atom__count=count,
        species__atom__radius=0.5,
        initial__temperature=1.1,
        wall=[{"name": "x-", "temperature": hot}, {"name": "x+", "temperature": cold}],
        run__until=100_000.0,
        output__observables=500.0,
        output__frames=False,
        measure__wall_forces=True,
    )
    with found.open() as run:
        table = run.observables[20:]
    heat, error = mean_and_error(0.5 * (table["wall_heat_flow_x-"] - table["wall_heat_flow_x+"]).to_numpy(), 12)
    expected = float(theory.heat_flux(hot, cold, width, n, 1.0)) * edge**2
    # Of second order in Kn, and the density: 2 %.
    z = (heat - expected) / np.hypot(error, 0.02 * expected)
    assert abs(z) < 4, f"{heat:.4f} ± {error:.2g}, expected {expected:.4f}: z = {z:.1f}"
    assert error < 0.03 * heat
