"""Laws of contact that add speed or draw their coefficient, and drives that turn grains, by z-scores."""

from __future__ import annotations

import numpy as np
import pytest

from haff import analysis, theory
from validation import dsmc

pytestmark = pytest.mark.physics

ETA = 0.01
"""Packing fraction. Correlated velocities change figures of the Boltzmann equation by about this part."""


@pytest.mark.long
@pytest.mark.parametrize("e", [0.7, 0.85, 0.95])
def test_a_gas_whose_contacts_add_speed_has_the_temperature_of_the_boltzmann_equation(command, e):
    delta, count = 0.1, 2000
    T, error, a2, a2_error = dsmc.ADDED[3, e]
    rate = float(theory.collision_frequency(theory.number_density(ETA, 1.0), 1.0, T * delta**2))
    settle = 10 / (1 - e)
    found = command.run(
        "added_speed",
        dimension=3,
        domain__packing_fraction=ETA,
        contact__restitution=e,
        contact__added_speed=delta,
        species__disk__count=count,
        initial__positions="lattice",
        initial__temperature=T * delta**2,
        run__until=(settle + 120) / rate,
        output__observables=0.5 / rate,
        output__frames=False,
    )
    with found.open() as run:
        late = run.observables[run.observables["time"] > settle / rate]
        temperature, sonine = (analysis.mean(late[name]) for name in ("temperature", "sonine_a2"))
        assert run.observables["ledger_residual"].abs().max() < 1e-12
    # T of N particles has d(N − 1) degrees of freedom.
    expected = T * delta**2 * (1 - 1 / count)
    allowed = np.hypot(error * delta**2, ETA * (1 - e**2) * expected)
    z = (temperature.mean - expected) / np.hypot(temperature.error, allowed)
    assert abs(z) < 4, f"T = {temperature.mean:.5f} ± {temperature.error:.2g}, {expected:.5f}: z = {z:.1f}"
    z = (sonine.mean - a2) / np.hypot(sonine.error, np.hypot(a2_error, 0.002))
    assert abs(z) < 4, f"a₂ = {sonine.mean:.4f} ± {sonine.error:.2g}, {a2:.4f}: z = {z:.1f}"
    assert float(theory.added_speed_temperature(delta, e)) == pytest.approx(T * delta**2, rel=0.02)


@pytest.mark.long
@pytest.mark.parametrize("case", [(0.9, 0.0), (0.8, 0.5), (0.7, -0.5)])
def test_a_rough_gas_whose_spins_are_heated_has_the_temperatures_of_the_boltzmann_equation(command, case):
    (e, beta), count = case, 2000
    density, chi = float(theory.number_density(ETA, 1.0)), float(theory.contact_value(ETA))
    unit, _ = dsmc.maxwellian_heated(e, beta, density=density, chi=chi)
    T, error, ratio, ratio_error = dsmc.HEATED_SPINS[case]
    interval = dsmc.HEATING_STEP / dsmc.collision_rate(1.0, density, chi, 3)
    found = command.run(
        "rough_cooling",
        domain__packing_fraction=ETA,
        species__grain__count=count,
        contact__restitution=e,
        contact__tangential_restitution=beta,
        initial__temperature=T,
        initial__rotational_temperature=T * ratio,
        drive=[{"kind": "white_noise", "strength": unit**-1.5, "interval": interval, "rotational": True}],
        run__collisions_per_particle=200,
        output__observables=10 * interval,
        output__frames=False,
    )
    with found.open() as run:
        table = run.observables
        late = table[2 * table["collisions"] / count > 40]
        temperature = analysis.mean(late["temperature"])
        rotation = analysis.mean(late["rotational_temperature"] / late["temperature"])
    doubt = 1.6 * ETA * (1 - e**2)
    expected = T * (1 - 1 / count) ** (2 / 3)
    z = (temperature.mean - expected) / np.hypot(temperature.error, np.hypot(error, doubt * T))
    assert abs(z) < 4, f"T = {temperature.mean:.4f} ± {temperature.error:.2g}, {expected:.4f}: z = {z:.1f}"
    z = (rotation.mean - ratio) / np.hypot(rotation.error, np.hypot(ratio_error, doubt * ratio))
    assert abs(z) < 4, f"T_rot/T = {rotation.mean:.4f} ± {rotation.error:.2g}, {ratio:.4f}: z = {z:.1f}"


def test_a_gas_with_a_random_coefficient_cools_by_the_mean_of_its_square(command):
    (low, high), count = (0.7, 0.9), 2000
    found = command.run(
        "cooling",
        domain__packing_fraction=ETA,
        species__grain__count=count,
        contact__restitution={"model": "random", "uniform": [low, high]},
        run__collisions_per_particle=20,
        output__observables=0.2,
        output__frames=False,
        output__events=True,
    )
    with found.open() as run:
        events = run.events[:]
        lost = events["energy_loss"] / (0.25 * events["approach_speed"] ** 2)
    # ⟨1 − e²⟩ and the variance of 1 − e² of the uniform distribution.
    second, fourth = (high**3 - low**3) / (3 * (high - low)), (high**5 - low**5) / (5 * (high - low))
    z = (lost.mean() - (1 - second)) / np.sqrt((fourth - second**2) / len(lost))
    assert abs(z) < 4, f"⟨1 − e²⟩ = {lost.mean():.5f}, {1 - second:.5f}: z = {z:.1f}"
