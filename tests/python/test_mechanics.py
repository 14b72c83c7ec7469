"""Closed forms of `haff.mechanics` against the conservation laws and against integration of the equations of motion."""

import doctest

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from haff import mechanics, restitution


@pytest.mark.parametrize("module", [mechanics, restitution])
def test_docstring_examples(module):
    result = doctest.testmod(module)
    assert result.attempted > 0 and result.failed == 0


@pytest.mark.parametrize("e", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("m2", [0.3, 5.0, np.inf])
def test_impact_conserves_momentum_and_loses_the_stated_energy(e, m2):
    m1, w1, w2 = 2.0, np.array([1.0, -2.0, 0.5]), np.array([-0.5, 0.3, 0.1]) if np.isfinite(m2) else np.zeros(3)
    n = np.array([0.2, -1.0, 0.4])
    after = mechanics.impact(m1, m2, w1, w2, n, e)
    unit = n / np.linalg.norm(n)
    v, w = after.velocity_1, after.velocity_2
    assert (v - w) @ unit == pytest.approx(-e * (w1 - w2) @ unit, abs=1e-14)
    assert np.allclose(np.cross(v - w1, n), 0, atol=1e-15)
    heavy = m2 if np.isfinite(m2) else 0.0
    if heavy:
        assert np.allclose(m1 * (v - w1) + m2 * (w - w2), 0, atol=1e-14)
    lost = 0.5 * m1 * (w1 @ w1 - v @ v) + 0.5 * heavy * (w2 @ w2 - w @ w)
    assert after.energy_loss == pytest.approx(lost, abs=1e-14)
    carnot = 0.5 * m1 * (w1 - v) @ (w1 - v) + 0.5 * heavy * (w2 - w) @ (w2 - w)
    assert after.carnot_energy == pytest.approx(carnot, rel=1e-14)
    assert after.energy_loss == pytest.approx(carnot * (1 - e) / (1 + e), abs=1e-14)


def test_plastic_loss_share_is_small_for_a_hammer_and_near_one_for_an_anvil():
    assert mechanics.plastic_loss_share(0.5, 0.005) == pytest.approx(1 / 101, rel=1e-14)
    assert mechanics.plastic_loss_share(50, 1000) == pytest.approx(1 / 1.05, rel=1e-14)
    lost = mechanics.impact(50, 1000, [6.0], [0.0], [1.0], 0.0).energy_loss
    assert mechanics.plastic_loss_share(50, 1000) == pytest.approx(lost / 900, rel=1e-14)


@pytest.mark.parametrize("e", [0.0, 0.3, 0.8, 1.0])
def test_bounce_series_sums_to_rest_time_and_path(e):
    H, g, fall = 1.3, 9.81, np.sqrt(2 * 1.3 / 9.81)
    # From one bounce to the next, by hand.
    times, speed = [fall], e * g * fall
    for _ in range(9):
        times.append(times[-1] + 2 * speed / g)
        speed *= e
    k = np.arange(10)
    assert mechanics.bounce_time(k, H, e, g) == pytest.approx(times, rel=1e-14)
    for start, end, height in zip(times, times[1:], mechanics.bounce_height(k[1:], H, e)):
        assert mechanics.bounce_position((start + end) / 2, H, e, g) == pytest.approx(height, abs=1e-14)
        assert mechanics.bounce_position(end, H, e, g) == pytest.approx(0, abs=1e-14)
    assert mechanics.bounce_position(0.5 * fall, H, e, g) == pytest.approx(0.75 * H, rel=1e-14)
    if e < 1:
        many = np.arange(400)
        assert mechanics.rest_time(H, e, g) == pytest.approx(mechanics.bounce_time(400, H, e, g), rel=1e-14)
        path = H + 2 * mechanics.bounce_height(many[1:], H, e).sum()
        assert mechanics.bounce_path(H, e) == pytest.approx(path, rel=1e-13)
        assert mechanics.bounce_position(mechanics.rest_time(H, e, g) * (1 + 1e-12), H, e, g) == 0
    else:
        assert mechanics.rest_time(H, e, g) == mechanics.bounce_path(H, e) == np.inf


def integrated(f, start, times):
    """Solution of y' = f(t, y) to about 1e-12."""
    return solve_ivp(f, (0, times[-1]), start, "DOP853", times, rtol=1e-13, atol=1e-14).y


@pytest.mark.parametrize("alpha", [-0.1, 1.0, 3.0])
def test_swing_solves_the_pendulum_equation(alpha):
    length, g = 0.7, 1.6
    times = np.linspace(0, 5, 41)
    expected = integrated(lambda t, y: [y[1], -g / length * np.sin(y[0])], [alpha, 0.0], times)[0]
    assert np.allclose(mechanics.swing(times, alpha, length, g), expected, rtol=0, atol=1e-10)
    assert mechanics.swing(mechanics.quarter_period(alpha, length, g), alpha, length, g) == pytest.approx(0, abs=1e-14)


def test_restitution_from_angles_is_the_inverse_of_the_rise():
    e, alpha = np.meshgrid([0.0, 0.3, 1.0], [1e-4, 0.5, 1.4])
    for m1, m2 in [(1.0, 1.0), (2.0, 3.0), (0.5, 4.0)]:
        beta = mechanics.pendulum_rise(alpha, e, m1, m2)
        assert np.allclose(mechanics.pendulum_restitution(alpha, beta, m1, m2), e, rtol=0, atol=1e-14)
        # In the form of the chapter.
        expected = 1 - ((1 + e) * m1 / (m1 + m2)) ** 2 * (1 - np.cos(alpha))
        assert np.allclose(np.cos(beta), expected, rtol=0, atol=1e-15)
    assert np.isnan(mechanics.pendulum_rise(3.0, 1.0, 5.0, 0.1)), "goes over the top"
    assert mechanics.pendulum_rise(np.pi / 3, 0.8) == pytest.approx(np.radians(53.49), abs=1e-4)


def test_spring_compression_agrees_with_integration():
    m, v, k = 0.4, 3.0, 70.0
    found = mechanics.spring_impact(m, v, k)
    together = np.linspace(0, found.contact_time, 21)
    # x2, x3 and their velocities: first 1 and 2 as one body, then 2 alone.
    force = lambda y: k * (y[0] - y[1])  # noqa: E731
    y = integrated(lambda t, y: [y[2], y[3], -force(y) / (2 * m), force(y) / m], [0, 0, v / 2, 0], together)
    assert np.allclose(y[0] - y[1], mechanics.spring_compression(together, m, v, k), rtol=0, atol=1e-11)
    assert np.max(y[0] - y[1]) == pytest.approx(found.largest_compression, rel=1e-10)
    assert y[2, -1] == pytest.approx(found.speed_1, rel=1e-10)
    apart = np.linspace(0, 3 * np.pi / np.sqrt(2 * k / m), 31)
    z = integrated(lambda t, y: [y[2], y[3], -force(y) / m, force(y) / m], y[:, -1], apart)
    later = mechanics.spring_compression(found.contact_time + apart, m, v, k)
    assert np.allclose(z[0] - z[1], later, rtol=0, atol=1e-11)
    assert np.mean(z[2:], axis=0) == pytest.approx(np.full(31, found.speed_center), rel=1e-10)
    assert 0.5 * m * np.min(z[2]) ** 2 == pytest.approx(found.smallest_energy_2, rel=1e-10)
    assert 0.5 * m * np.max(z[3]) ** 2 == pytest.approx(found.largest_energy_3, rel=1e-10)


@pytest.mark.parametrize("theta", [0.0, 0.4, 1.3, np.pi / 2])
def test_rod_impacts_conserve_momentum_angular_momentum_and_energy(theta):
    m, v, length = 1.7, 3.0, 2.2
    arm = length * np.sin(theta)
    # About the struck end: zero before; then the far end's momentum times its arm.
    stuck = mechanics.rod_stick(m, v, length, theta)
    assert 3 * m * stuck.speed == pytest.approx(m * v, rel=1e-15)
    # The far end is 2l/3 from the center of all three, which is arm/3 off the line of flight.
    spin = 2 / 3 * m * length**2 * stuck.angular_velocity
    assert spin == pytest.approx(m * v * arm / 3, abs=1e-15 * m * v * length)
    assert stuck.energy_loss > 0
    for e in (0.0, 0.6, 1.0):
        hit = mechanics.rod_impact(m, v, length, theta, e)
        assert m * hit.speed + 2 * m * hit.center_speed == pytest.approx(m * v, rel=1e-14)
        assert m * length**2 / 2 * hit.angular_velocity == pytest.approx(2 * m * hit.center_speed * arm / 2, abs=1e-14)
        end = hit.center_speed + hit.angular_velocity * arm / 2
        assert end - hit.speed == pytest.approx(e * v, abs=1e-14)
        left = m * hit.speed**2 / 2 + m * hit.center_speed**2 + m * (length * hit.angular_velocity) ** 2 / 4
        assert hit.energy_loss == pytest.approx(m * v**2 / 2 - left, abs=1e-13)
    assert mechanics.rod_impact(m, v, length, theta).center_speed == pytest.approx(
        2 * v / (3 + np.sin(theta) ** 2), rel=1e-14
    )
