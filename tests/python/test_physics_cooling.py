"""The scene configs/cooling.toml: Haff's law, the velocity distribution, and the energy balance."""

import math

import numpy as np
import pytest

import haff
from haff import analysis, theory
from test_physics_equilibrium import describe

pytestmark = pytest.mark.physics

# Enskog's theory assumes molecular chaos, which is 0.3 % off at e = 0.9 in a dilute gas.
CHAOS = 3e-3


@pytest.fixture(scope="module")
def run(command):
    with command.run("cooling").open() as file:
        yield file


def homogeneous(run: haff.File) -> np.ndarray:
    """Samples from 5 to 50 collisions per particle: a₂ is stationary, and vortices have not grown yet.

    The box is a little wider than the critical length, so the homogeneous state becomes unstable later.
    """
    per_particle = 2 * run.observables["collisions"].to_numpy() / len(run)
    return (per_particle > 5) & (per_particle < 50)


def test_temperature_falls_at_haffs_rate(run):
    # √(T₀/T) = 1 + t/τ: its slope over blocks of equally many collisions, nearly independent of each other.
    law, table = analysis.cooling_law(run), run.observables[homogeneous(run)]
    per_particle = 2 * table["collisions"].to_numpy() / len(run)
    cuts = np.searchsorted(per_particle, np.linspace(per_particle[0], per_particle[-1], 17))
    cuts = np.minimum(cuts, len(table) - 1)
    t, y = table["time"].to_numpy()[cuts], np.sqrt(law.T0 / table["temperature"].to_numpy()[cuts])
    rates = np.diff(y) / np.diff(t)
    rate = analysis.Estimate(float(rates.mean()), float(rates.std(ddof=1) / math.sqrt(len(rates))))
    z = rate.z(1 / law.tau, CHAOS / law.tau)
    assert abs(z) < 3.5, describe("1/τ", rate, 1 / law.tau, z)
    assert rate.error * law.tau < 3e-3, f"the error {rate.error * law.tau:.1e} is too large to tell"


def test_temperature_follows_haffs_law(run):
    # From the first stationary sample on: the initial state (lattice, a₂ = 0) shifts the law in time by a fraction of a
    # collision per particle.
    law, table = analysis.cooling_law(run), run.observables[homogeneous(run)]
    t, T = table["time"].to_numpy(), table["temperature"].to_numpy()
    ratio = T / theory.haff_temperature(t - t[0], T[0], law.tau * math.sqrt(law.T0 / T[0]))
    # An error ε of the rate grows to 2ε in T; fluctuations of the rate are three standard errors of 0.2 %.
    bound = 2 * (CHAOS + 3 * 2e-3)
    assert np.all(np.abs(ratio - 1) < bound), f"T/T_Haff = {ratio.min():.4f} … {ratio.max():.4f}, bound {bound}"


def test_sonine_coefficient_is_that_of_van_noije_and_ernst(run):
    # One sample of N particles scatters by about √(8/15N); samples one collision apart are nearly independent.
    table = run.observables[homogeneous(run)]
    counts = table["collisions"].to_numpy()
    chosen = np.unique(np.searchsorted(counts, np.arange(counts[0], counts[-1], len(run))))
    found = analysis.block_average(table["sonine_a2"].to_numpy()[chosen], 10)
    expected = float(theory.sonine_a2(0.9, 3))
    z = found.z(expected, 3e-4)  # next order in the Sonine expansion
    assert abs(z) < 4, describe("a₂", found, expected, z)


def test_sonine_coefficient_of_the_frames_is_that_of_the_observables(run):
    table = run.observables.set_index("time")["sonine_a2"]
    for frame in run.frames:
        assert analysis.sonine_a2(frame) == pytest.approx(table.loc[frame.time], abs=1e-12)


def test_event_losses_sum_to_the_dissipated_energy(run):
    total, reported = math.fsum(run.events["energy_loss"]), run.observables["dissipated_energy"].iloc[-1]
    assert total == pytest.approx(reported, rel=1e-12)
    carnot = math.fsum(run.events["carnot_energy"])
    assert carnot == pytest.approx(run.observables["carnot_energy"].iloc[-1], rel=1e-12)
    assert total == pytest.approx(carnot * 0.1 / 1.9, rel=1e-12), "Carnot: ΔT = E'_c (1 − e)/(1 + e)"


def test_every_event_obeys_the_law_of_impact(run):
    log = run.events[:200_000]
    v, mu, e = log["approach_speed"], 0.5, 0.9
    assert np.all(v > 0) and np.all(np.diff(run.events["time"]) >= 0) and np.all(log["i"] < log["j"])
    assert np.allclose(log["impulse"], (1 + e) * mu * v, rtol=1e-14)
    assert np.allclose(log["energy_loss"], 0.5 * mu * v**2 * (1 - e**2), rtol=1e-13)
    assert np.allclose(log["carnot_energy"], log["impulse"] ** 2 / (2 * mu), rtol=1e-13)
    assert np.allclose(np.linalg.norm(log[["normal_x", "normal_y", "normal_z"]], axis=1), 1, atol=1e-14)


def test_ledger_balances(run):
    assert run.observables["ledger_residual"].abs().max() <= 1e-12


def test_ledger_balances_when_recomputed_from_the_frames(run):
    table = run.observables.set_index("time")
    start = analysis.kinetic_energy(run.frames[0])
    for frame in run.frames:
        kinetic = analysis.kinetic_energy(frame)
        assert kinetic == pytest.approx(table.loc[frame.time, "kinetic_energy"], rel=1e-12)
        assert abs(kinetic + table.loc[frame.time, "dissipated_energy"] - start) <= 1e-12 * start


def test_temperature_is_that_of_the_frames(run):
    table = run.observables.set_index("time")["temperature"]
    for frame in run.frames:
        assert analysis.temperature(frame) == pytest.approx(table.loc[frame.time], rel=1e-12)


def test_momentum_stays_zero(run):
    table = run.observables
    scale = np.sqrt(table["kinetic_energy"].iloc[0] * 2 * len(run))
    assert np.abs(table[["momentum_x", "momentum_y", "momentum_z"]].to_numpy()).max() < 1e-12 * scale


@pytest.mark.long
def test_no_two_particles_overlap(run):
    worst = max((analysis.max_overlap(frame) for frame in run.frames), key=lambda o: o.depth)
    assert worst.depth <= 1e-12, f"particles {worst.pair} overlap by {worst.depth:.1e}"


def test_report_agrees_with_the_file(command, run):
    report, last = command.run("cooling").report, run.observables.iloc[-1]
    assert report["particles"] == len(run) == 32_000
    assert report["collisions"] == last["collisions"] == len(run.events) == run.frames[-1].step
    assert report["wall_collisions"] == 0 and report["events"] == report["collisions"]
    assert report["simulated_time"] == last["time"] == run.frames[-1].time == 400
    assert report["stopped"] == "until" and report["max_overlap"] <= 1e-12 and abs(report["ledger_residual"]) <= 1e-12


def test_positions_stay_in_the_box_and_images_count_the_crossings(run):
    frames = run.frames
    assert np.all(frames[-1].position >= 0) and np.all(frames[-1].position < run.box.size)
    # No particle flies farther than the fastest particle of the start allows.
    drift = np.linalg.norm(frames[1].unwrapped - frames[0].unwrapped, axis=1)
    assert drift.max() < frames[1].time * 8 and np.any(frames[-1].image != 0)
