"""Steady states of driven gases: white noise, and a bed on a vibrating floor."""

import math

import numpy as np
import pytest

from haff import analysis, theory
from validation import boltzmann

pytestmark = pytest.mark.physics


@pytest.mark.long
def test_heated_gas_has_the_temperature_of_kinetic_theory(command):
    # φ = 0.01: correlated velocities change the rates by some 0.5 %.
    eta, e, count = 0.01, 0.8, 1000
    n = theory.number_density(eta, 1.0)
    g0 = theory.contact_value(eta)
    rate = float(theory.collision_frequency(n, 1.0, g0=g0))
    strength = (1 - e**2) / 3 * rate
    found = command.run(
        "heated_gas",
        domain__packing_fraction=eta,
        contact__restitution=e,
        drive__0__strength=strength,
        drive__0__rate=boltzmann.KICKS * rate,
        species__grain__count=count,
        run__until=120 / rate,
        output__observables=0.5 / rate,
    )
    with found.open() as run:
        late = run.observables[40:]
        temperature = analysis.block_average(late["temperature"].to_numpy(), 10)
        a2 = analysis.block_average(late["sonine_a2"].to_numpy(), 10)
    T, _, expected_a2, _ = boltzmann.HEATED[3, e]
    expected = T * (1 - 1 / count) ** (5 / 3)
    assert abs(temperature.z(expected, 0.005)) < 4, f"T = {temperature.mean:.4f} ± {temperature.error:.2g}"
    assert abs(a2.z(expected_a2, 0.001)) < 4, f"a₂ = {a2.mean:.4f} ± {a2.error:.2g}"
    assert float(theory.heated_temperature(strength, e, n, 1.0, g0=g0)) == pytest.approx(T, rel=0.005)


@pytest.mark.long
def test_bed_on_a_vibrating_floor_rises_as_the_power_three_halves(command):
    speeds, rises = [], []
    for frequency in (6.0, 12.0, 24.0, 48.0):
        found = command.run("vibrated_bed", wall__0__motion__frequency=frequency, run__until=250, output__frames=False)
        with found.open() as run:
            late = run.observables[100:]
            assert run.observables["ledger_residual"].abs().max() < 1e-12
            rises.append(late["potential_energy"].mean() / len(run) - 0.5 * len(run) * math.sqrt(3) / 40)
            speeds.append(2 * math.pi * 0.05 * frequency)
    # Luding, Herrmann and Blumen fit 3/2 between the exponents of a block, 1, and of a dilute gas, 2.
    exponent = np.polyfit(np.log(speeds), np.log(rises), 1)[0]
    assert exponent == pytest.approx(1.5, abs=0.15), f"exponent {exponent:.2f}"


@pytest.mark.long
def test_a_vibrated_layer_has_a_standing_wave_of_two_periods(command):
    with command.run("vibrated_layer").open() as run:
        frames = run.frames[-160:]
        counts = np.array([np.bincount((frame.position[:, 0] / 2).astype(int), minlength=60) for frame in frames])
        assert run.observables["ledger_residual"].abs().max() < 1e-12
    waves = np.fft.rfft(counts - counts.mean(axis=1, keepdims=True), axis=1)
    power = (np.abs(waves[:, 1:20]) ** 2).mean(axis=0)
    amplitude = waves[:, 1 + power.argmax()]

    def correlation(later):
        return (amplitude[:-later] * amplitude[later:].conj()).real.mean() / (np.abs(amplitude) ** 2).mean()

    # Without order the waves share the power; with the period of the plate the first correlation would be positive.
    assert power.max() > 5 * np.median(power)
    assert correlation(4) < -0.9 and correlation(8) > 0.9


@pytest.mark.long
def test_a_cluster_floats_on_a_gas_above_a_strongly_vibrating_floor(command):
    with command.run("leidenfrost", output__frames=False).open() as run:
        late = run.profiles["y"].sel(time=slice(300, None)).mean("time")
    density, temperature = late["density"].to_numpy(), late["temperature"].to_numpy()
    cluster = density.argmax()
    assert density[0] < 0.2 * density[cluster] and late["y"][cluster] > 15
    assert temperature[0] > 50 * temperature[cluster]


@pytest.mark.long
def test_a_large_grain_rises_in_a_shaken_bed(command):
    with command.run("brazil_nut").open() as run:
        heights = np.array([frame.position[:, 1] for frame in run.frames])
        large = run.species == run.species_names.index("nut")
    above = heights[:, large].mean(axis=1) - heights[:, ~large].mean(axis=1)
    # Of four seeds three rise by more than 3.4 until the end, and the fourth by 2.6.
    assert above[20:80].mean() < -2 and above[200:].mean() > above[20:80].mean() + 2


@pytest.mark.long
def test_grains_collect_in_one_chamber_if_the_floor_gives_little_energy(command):
    def fuller(frequency):
        with command.run("maxwell_demon", wall__0__motion__frequency=frequency).open() as run:
            left = np.array([(frame.position[:, 0] < 20).mean() for frame in run.frames[100:]])
            assert run.observables["ledger_residual"].abs().max() < 1e-12
        return max(left.mean(), 1 - left.mean())

    # Eggers' theory has one state below a critical dissipation, two above.
    assert fuller(8.0) > 0.8
    assert fuller(40.0) < 0.55
