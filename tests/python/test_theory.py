"""The closed forms against values worked out by hand, limits and each other."""

import math

import numpy as np
import pytest
from scipy import integrate

from haff import theory


def test_contact_values_at_a_packing_fraction_computed_by_hand():
    # η = 0.2: (1 − 0.1)/0.8³ = 0.9/0.512; (1 − 0.0875)/0.8² = 0.9125/0.64
    assert theory.carnahan_starling(0.2) == pytest.approx(0.9 / 0.512, rel=1e-15)
    assert theory.henderson(0.2) == pytest.approx(0.9125 / 0.64, rel=1e-15)


@pytest.mark.parametrize(("d", "second", "third"), [(3, 4.0, 10.0), (2, 2.0, 3.1280177)])
def test_compressibility_has_the_known_virial_coefficients(d, second, third):
    # Z = 1 + B₂η + B₃η²: in 3D both exact; Henderson's B₃ is 3.125 against the exact 3.1280.
    eta = 1e-4
    z = float(theory.compressibility(eta, d=d))
    found = (z - 1 - second * eta) / eta**2
    assert found == pytest.approx(third, rel=2e-3), f"B₃ = {found}, literature {third}"


def test_klm_reproduces_the_first_virial_coefficients():
    # Virial coefficients of hard spheres in powers of η: 4, 10, 18.364768, 28.2245.
    eta = np.linspace(0.002, 0.02, 10)
    coefficients = np.polynomial.Polynomial.fit(eta, theory.kolafa_labik_malijevsky(eta), 6, domain=[]).convert().coef
    assert coefficients[:4] == pytest.approx([1, 4, 10, 18.364768], rel=1e-4)


def test_klm_and_carnahan_starling_agree_to_three_in_a_thousand():
    eta = np.linspace(0.01, 0.49, 50)
    ratio = theory.compressibility(eta) / theory.kolafa_labik_malijevsky(eta)
    assert np.all(np.abs(ratio - 1) < 3.5e-3)
    assert ratio[30] < 1, "Carnahan–Starling is low at mid density"


def test_klm_at_half_reduced_density_matches_the_published_pressure():
    # ρσ³ = 0.5, η = π/12: Z = 3.2696 by simulation (Kolafa, Labík, Malijevský 2004).
    assert theory.kolafa_labik_malijevsky(math.pi / 12) == pytest.approx(3.2696, abs=3e-3)


def test_collision_frequency_computed_by_hand():
    assert theory.collision_frequency(0.1, 1.0, 1.0, 1.0, 1.0) == pytest.approx(0.4 * math.sqrt(math.pi), rel=1e-15)
    assert theory.collision_frequency(0.1, 2.0, 4.0, 1.0, 1.5, d=2) == pytest.approx(
        2 * 0.1 * 2 * 1.5 * math.sqrt(4 * math.pi), rel=1e-15
    )
    assert theory.collision_frequency(1, 1, a2=0.16) == pytest.approx(0.99 * theory.collision_frequency(1, 1))


@pytest.mark.parametrize(("e", "a2"), [(0.6, 0.0239), (0.8, -0.0126), (0.9, -0.0146), (1.0, 0.0)])
def test_sonine_coefficient_of_van_noije_and_ernst(e, a2):
    assert theory.sonine_a2(e, 3) == pytest.approx(a2, abs=6e-5)


def test_heated_gas_balances_its_heating_by_hand():
    # Spheres of mass 2 at e = 0.5, number density 0.01: ω = 0.04 √(π T/2); 3 · 2 ξ₀² = 0.75 ω T (1 + 3 a₂/16).
    a2 = 16 * 0.5 * 0.5 / (73 + 168 - 36 - 52.5 + 3.75)
    assert theory.sonine_a2_heated(0.5, 3) == pytest.approx(a2, rel=1e-14)
    T = float(theory.heated_temperature(0.1, 0.5, 0.01, 1.0, 2.0))
    assert 0.75 * 0.04 * math.sqrt(math.pi * T / 2) * T * (1 + 3 * a2 / 16) == pytest.approx(0.6, rel=1e-14)
    # The formula of the impact integral: d √π ξ₀²/((1 − e²) Ω_d g₀ n σ^(d − 1)).
    disks = float(theory.heated_temperature(0.1, 0.8, 0.2, 1.5, 1.0, 1.3, d=2, a2=0))
    assert disks == pytest.approx((2 * math.sqrt(math.pi) * 0.1 / (0.36 * 2 * math.pi * 1.3 * 0.2 * 1.5)) ** (2 / 3))
    assert theory.heated_temperature(0.1, 1.0, 0.01, 1.0) == math.inf


def test_contacts_that_add_speed_balance_what_they_take():
    for e, delta, m in ((0.3, 0.2, 1.0), (0.9, 0.05, 3.0)):
        T = float(theory.added_speed_temperature(delta, e, m))
        # Rayleigh's distribution of the approach speeds of contacts.
        v = np.random.default_rng(5).rayleigh(math.sqrt(2 * T / m), 10**6)
        change = 0.25 * m * ((e * v + 2 * delta) ** 2 - v**2)
        assert abs(change.mean()) < 4 * change.std() / 1e3
    assert theory.added_speed_temperature(0.1, 1.0) == math.inf


def test_sonine_coefficient_vanishes_at_one_over_root_two():
    assert abs(theory.sonine_a2(math.sqrt(0.5), 2)) < 1e-16


def test_haff_rate_follows_from_the_mean_loss_per_collision():
    # (d/2) dT/dt = −(ω/2)(1 − e²)T at a₂ = 0, and dT/dt = −2T/τ at the start.
    for d in (2, 3):
        omega, e = 1.7, 0.8
        tau = float(theory.haff_time(e, omega, d, a2=0.0))
        assert -2 / tau == pytest.approx(-(omega / 2) * (1 - e**2) / (d / 2), rel=1e-14)


def test_haff_temperature_is_a_quarter_after_one_time_constant():
    assert theory.haff_temperature(3.0, 2.0, 3.0) == pytest.approx(0.5, rel=1e-15)
    assert theory.haff_temperature([0.0, 3.0], 2.0, 3.0).shape == (2,)


def test_elastic_gas_does_not_cool():
    assert theory.haff_time(1.0, 1.0) == math.inf
    assert theory.haff_temperature(1e9, 1.0, math.inf) == 1.0
    assert theory.critical_length(0.1, 1.0, 1.0) == math.inf


def test_critical_length_computed_by_hand():
    assert theory.critical_length(0.1, 1.0, 0.8) == pytest.approx(2.43 / 0.06, rel=1e-14)
    assert theory.critical_length(0.1, 1.0, 0.6, d=2) == pytest.approx(2 * math.sqrt(math.pi) / 0.08, rel=1e-14)


def test_sonine_density_has_norm_one_unchanged_temperature_and_its_a2():
    a2 = 0.08
    moment = lambda k: integrate.quad(lambda c: c**k * theory.sonine_component(c, a2), -12, 12)[0]  # noqa: E731
    assert moment(0) == pytest.approx(1, abs=1e-10)
    assert moment(2) == pytest.approx(0.5, abs=1e-10)
    assert moment(4) == pytest.approx(0.75 * (1 + a2), abs=1e-10)  # a₂ = ⟨c⁴⟩/(3⟨c²⟩²) − 1 in one dimension


@pytest.mark.parametrize("d", [2, 3])
def test_mixture_of_identical_species_is_the_pure_fluid(d):
    n, sigma, m, T = 0.3, 1.1, 2.0, 0.7
    eta = theory.packing_fraction(n, sigma, d)
    pure = theory.collision_frequency(n, sigma, T, m, theory.contact_value(eta, d), d)
    split = theory.mixture_rates([0.1, 0.2], [sigma, sigma], [m, m], T, d)
    assert np.sum(split.per_particle, axis=1) == pytest.approx([pure, pure], rel=1e-13)
    assert split.total == pytest.approx(n * pure / 2, rel=1e-13)


def test_both_closures_of_a_mixture_agree_with_the_pure_fluid_and_with_points():
    eta = 0.3
    n = theory.number_density(eta, 1.0)
    santos = theory.mixture_contact_values([n / 2, n / 2], [1.0, 1.0], 3, "santos")
    assert santos == pytest.approx(float(theory.contact_value(eta, 3, "klm")), rel=1e-13)
    # The contact value of a trace of points is 1/(1 − η); of a trace of huge spheres, that of the fluid at a wall.
    trace = theory.mixture_contact_values([n, 1e-12, 1e-30], [1.0, 1e-6, 1e6], 3, "santos")
    assert trace[0, 1] == pytest.approx(1 / (1 - eta), rel=1e-5)
    assert trace[0, 2] == pytest.approx(float(theory.kolafa_labik_malijevsky(eta)), rel=1e-5)
    assert theory.mixture_contact_values([n, 1e-12], [1.0, 1e-6])[0, 1] == pytest.approx(1 / (1 - eta), rel=1e-5)
    with pytest.raises(ValueError, match="santos"):
        theory.mixture_contact_values([n], [1.0], 2, "bmcsl")


def test_mixture_counts_every_pair_of_species_from_both_sides():
    rates = theory.mixture_rates([0.2, 0.05], [1.0, 1.6], [1.0, 4.0])
    n = np.array([0.2, 0.05])
    exchange = n[:, None] * rates.per_particle
    assert exchange == pytest.approx(exchange.T, rel=1e-14)
    assert rates.total == pytest.approx(np.triu(rates.per_volume).sum(), rel=1e-14)


def test_losses_of_a_maxwell_gas_are_exponential():
    # Mean of x = ΔT/[(1 − e²)T] is 1: the mean loss in Haff's rate.
    mean, _ = integrate.quad(lambda x: x * theory.loss_distribution(x), 0, np.inf)
    assert mean == pytest.approx(1, abs=1e-10)


def test_density_conversions_are_inverse():
    for d in (2, 3):
        assert theory.packing_fraction(theory.number_density(0.37, 1.3, d), 1.3, d) == pytest.approx(0.37, rel=1e-15)


def test_invalid_dimension_and_equation_are_refused():
    with pytest.raises(ValueError, match="d = 4: must be a whole number from 2 to 3"):
        theory.collision_frequency(1, 1, d=4)
    with pytest.raises(ValueError, match="klm"):
        theory.contact_value(0.1, 2, "klm")


def test_contact_value_in_a_frame_of_an_inelastic_gas():
    assert theory.contact_value_after_collision(2.0, 1.0) == 2.0
    assert theory.contact_value_after_collision(2.0, 0.5) == pytest.approx(3.0)


def test_disks_follow_the_virial_series_and_henderson():
    # To third order, exact: B₂ = 2η, B₃ = 3.128 η². Henderson is high by 0.14 % at η = 0.4 and by 0.5 % at 0.5.
    eta = 1e-3
    assert (float(theory.virial_disks(eta)) - 1 - 2 * eta) / eta**2 == pytest.approx(3.128, rel=2e-3)
    high = theory.compressibility([0.4, 0.5], d=2) / theory.virial_disks([0.4, 0.5]) - 1
    assert high == pytest.approx([1.4e-3, 4.6e-3], rel=0.05)
    assert theory.compressibility(0.5, d=2, equation="virial") == pytest.approx(
        float(theory.virial_disks(0.5)), rel=1e-14
    )
    # Luding's fit has the simulations' 8.306 at 1.4 times the area of closest packing (Erpenbeck and Luban 1985).
    assert theory.luding_disks(math.pi / math.sqrt(12) / 1.4) == pytest.approx(8.306, rel=5e-4)
    assert theory.luding_disks(0.4) == pytest.approx(float(theory.virial_disks(0.4)), rel=1e-3)
    assert theory.virial_disks(0.5, 4) == pytest.approx(float(theory.virial_disks(0.5)), abs=1.5e-4)


def test_crystal_and_fluid_have_the_pressure_of_coexistence():
    # Freezing at η = 0.492, melting at 0.543; Pσ³/T = 11.57 there (simulations scatter by 0.1).
    pressures = [6 * eta / np.pi * z for eta, z in ((0.492, theory.kolafa_labik_malijevsky(0.492)),
                                                   (0.543, theory.crystal_compressibility(0.543)))]  # fmt: skip
    assert pressures == pytest.approx([11.57, 11.57], abs=0.12)


@pytest.mark.parametrize(("d", "equation"), [(3, "klm"), (2, "virial")])
def test_few_particles_have_fewer_pairs(d, equation):
    # A dilute gas of N has N(N − 1) ordered pairs for N²; Z − 1 is unchanged, as relative speeds grow by N/(N − 1).
    eta = 1e-5
    assert theory.periodic_contact_value(eta, 50, d, equation) == pytest.approx(1 - 1 / 50, abs=1e-4)
    large = theory.compressibility(eta, 1.0, d, equation) - 1
    assert theory.periodic_compressibility(eta, 50, d, equation) - 1 == pytest.approx(large, rel=1e-4)
    # Lebowitz–Percus by hand at η = 0.3: S from Z and Z', then the second derivative of η²g₀.
    x, h = 0.3, 1e-3
    z = theory.compressibility(np.array([x - h, x, x + h]), 1.0, d, equation)
    compression = z[1] + x * (z[2] - z[0]) / (2 * h)
    eta = np.array([x - h, x, x + h])
    second = np.diff(eta**2 * theory.contact_value(eta, d, equation), 2)[0] / h**2
    expected = float(theory.contact_value(x, d, equation)) - second / (2 * 100 * compression)
    assert theory.periodic_contact_value(x, 100, d, equation) == pytest.approx(expected, rel=1e-4)
    assert theory.periodic_contact_value(x, 1e12, d, equation) == pytest.approx(
        float(theory.contact_value(x, d, equation))
    )


def test_collision_rate_of_two_particles_is_that_of_their_one_relative_velocity():
    # N = 2 in 3D: the relative speed is u = 2√(3T/m), always; n_pairs π σ² u = (1/V) π σ² u per particle.
    speed = 2 * math.sqrt(3.0)
    n, g = 2 / 1e6, 0.5
    rate = theory.collision_frequency(n, 1.0, 1.0, 1.0, g) * theory.periodic_rate_factor(2)
    assert rate == pytest.approx(math.pi * speed / 1e6, rel=1e-12)
    assert theory.periodic_rate_factor(1e9, 2) == pytest.approx(1, abs=1e-8)


def test_two_approximations_of_the_sonine_coefficient():
    assert theory.sonine_a2(0.5, 3) == pytest.approx(4 / 76.25)
    assert theory.sonine_a2(0.5, 3, "montanero-santos") == pytest.approx(4 / 80.25)
    # Both are exact to first order in 1 − e.
    e = 1 - 1e-7
    assert theory.sonine_a2(e, 2) == pytest.approx(float(theory.sonine_a2(e, 2, "montanero-santos")), rel=1e-5)
    with pytest.raises(ValueError, match="montanero-santos"):
        theory.sonine_a2(0.5, 3, "exact")


def test_cooling_curve_of_a_constant_restitution_is_haffs():
    t = np.array([0.0, 1.0, 10.0, 1e3])
    for d in (2, 3):
        curve = theory.cooling_curve(t, 2.0, 1.3, lambda v: 0.8, m=3.0, d=d)
        assert curve == pytest.approx(theory.haff_temperature(t, 2.0, theory.haff_time(0.8, 1.3, d, a2=0.0)), rel=1e-8)


def test_viscoelastic_gas_cools_with_the_power_five_thirds_at_late_times():
    # d ln T/d ln t tends to −5/3 as δ ∝ T^(1/10) vanishes; the deviation shrinks with the coefficient.
    slopes = []
    for coefficient in (1e-3, 1e-5):
        t = np.array([1e8, 1.1e8]) / coefficient
        T = theory.cooling_curve(t, 1.0, 1.0, lambda v: theory.viscoelastic_restitution_pade(v, coefficient))  # noqa: B023
        slopes.append(math.log(T[1] / T[0]) / math.log(1.1))
    assert slopes[1] == pytest.approx(-5 / 3, abs=1e-4) and abs(slopes[1] + 5 / 3) < abs(slopes[0] + 5 / 3)


def test_viscoelastic_restitution_starts_as_its_series():
    v = np.array([0.5, 2.0])
    series = theory.viscoelastic_restitution(v, 1e-4)
    assert theory.viscoelastic_restitution_pade(v, 1e-4) == pytest.approx(series, abs=1e-9)


def test_identical_species_cool_at_haffs_rate():
    n, e = [0.01, 0.03], 0.8
    omega = theory.collision_frequency(0.04, 1.0, 0.7, 2.0, 1.0)
    rates = theory.mixture_cooling_rates(n, [1.0, 1.0], [2.0, 2.0], e, 0.7, g=1.0)
    # dT/dt = −2T/τ at the start of Haff's law.
    assert rates == pytest.approx([2 / float(theory.haff_time(e, omega, 3, 0.0))] * 2, rel=1e-13)


def test_elastic_mixture_exchanges_energy_without_losing_any():
    n, T = np.array([0.01, 0.03]), np.array([2.0, 0.5])
    rates = theory.mixture_cooling_rates(n, [1.0, 2.0], [1.0, 7.0], 1.0, T)
    assert np.sum(n * T * rates) == pytest.approx(0, abs=1e-15) and rates[0] > 0 > rates[1]
    assert theory.granular_temperatures(n, [1.0, 2.0], [1.0, 7.0], 1.0) == pytest.approx([1, 1], abs=1e-9)


def test_heavy_grains_of_a_cooling_mixture_are_hotter():
    n = np.array([0.01, 0.02])
    T = theory.granular_temperatures(n, [1.0, 1.5], [1.0, 10.0], 0.8)
    assert T[1] > 1.5 * T[0] and np.sum(n * T) == pytest.approx(np.sum(n))
    rates = theory.mixture_cooling_rates(n, [1.0, 1.5], [1.0, 10.0], 0.8, T)
    assert rates[0] == pytest.approx(rates[1], rel=1e-9)


def test_transport_coefficients_of_a_dilute_gas():
    # D = 1.019 · (3/8)√(T/πm)/(nσ²), η = 1.016 · (5/16)√(mT/π)/σ² (Chapman and Cowling).
    n = 1e-9
    assert theory.enskog_diffusion(n, 2.0, 3.0, 5.0) * n == pytest.approx(
        1.018954 * 3 / 8 * math.sqrt(3 / (5 * math.pi)) / 4, rel=1e-7
    )
    assert theory.enskog_viscosity(n, 2.0, 3.0, 5.0) == pytest.approx(
        1.016034 * 5 / 16 * math.sqrt(15 / math.pi) / 4, rel=1e-7
    )


def test_enskogs_viscosity_is_that_of_chapman_and_cowling():
    # (5/16)√(mT/π)σ⁻² {[1 + (2/5)y]²/g + (48/25π) y²/g} with y = (2/3)πnσ³g, first approximation.
    n, g = 0.5, float(theory.contact_value(math.pi / 12, 3, "klm"))
    y = 2 / 3 * math.pi * n * g
    first = 5 / 16 / math.sqrt(math.pi) * ((1 + 0.4 * y) ** 2 + 48 / (25 * math.pi) * y**2) / g
    assert theory.enskog_viscosity(n, 1.0) == pytest.approx(first, rel=0.016)


def test_fits_of_the_diffusion_coefficient_agree_after_the_finite_size_correction():
    # Speedy's is that of 500 spheres, Ruckenstein and Liu's that of infinitely many: 11 % more at nσ³ = 0.5.
    for n in (0.5, 0.7):
        box = theory.diffusion_finite_size(theory.enskog_viscosity(n, 1.0), (500 / n) ** (1 / 3))
        infinite = float(theory.diffusion_ruckenstein_liu(n, 1.0))
        assert float(theory.diffusion_speedy(n, 1.0)) + float(box) == pytest.approx(infinite, rel=0.015)
        assert infinite > 1.2 * theory.enskog_diffusion(n, 1.0)


def test_a_tracer_like_the_others_has_their_coefficient_of_self_diffusion():
    n, sigma, T, m = 0.1, 1.3, 2.0, 0.7
    found = theory.enskog_tracer_diffusion(n, sigma, sigma, m, m, T)
    g0 = theory.contact_value(float(theory.packing_fraction(n, sigma)))
    whole = theory.enskog_diffusion(n, sigma, T, m, g0)
    # The second approximation of Sonine's expansion, 1/(1 − 1/59), beside all of them.
    assert float(found / whole) == pytest.approx(59 / 58 / 1.018954, rel=1e-12)
    # Of two sizes the contact value is that of a mixture with next to no tracers.
    g = theory.mixture_contact_values([n, 1e-12], [sigma, 3.0])[0, 1]
    of_both = [theory.enskog_tracer_diffusion(n, sigma, 3.0, m, 9.0, T, g=value) for value in (None, g)]
    assert float(of_both[0]) == pytest.approx(float(of_both[1]), rel=1e-9)
    # A heavy tracer has Einstein's friction of independent impacts, T/D = (8/3) n σ₁₂² √(2πμT).
    heavy = theory.enskog_tracer_diffusion(n, sigma, 3.0, m, 1e6, T, g=1.0)
    friction = 8 / 3 * n * ((sigma + 3.0) / 2) ** 2 * math.sqrt(2 * math.pi * m * T)
    assert float(heavy) == pytest.approx(T / friction, rel=1e-5)
