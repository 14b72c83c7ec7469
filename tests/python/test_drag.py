"""Drag from the scene to the file: paths, contacts, the balance of energies, and runs that go on."""

import numpy as np
import pytest

import haff
from haff import analysis, theory
from validation import dsmc

TAU = 3.0
MOTION = {"kind": "sine", "amplitude": 0.1, "frequency": 1.0}


def ball(**more):
    scene = {
        "schema": 1,
        "domain": {"size": [10.0, 1.0, 1.0], "boundary": ["wall", "open", "open"]},
        "particle": [
            {"name": "ball", "position": [2.0, 0.0, 0.0], "velocity": [4.0, 0.5, 0.0], "radius": 0.5, "mass": 2.0}
        ],
        "contact": {"restitution": 0.8},
        "drive": [{"kind": "drag", "time": TAU}],
        "run": {"until": 12.0},
        "output": {"observables": 0.5, "frames": 0.25, "events": True},
    }
    return scene | more


def test_a_ball_in_a_viscous_gas_has_the_path_and_the_contact_of_the_closed_form(tmp_path):
    with haff.run(ball(), file=tmp_path / "ball.h5").file as run:
        events = run.events[:]
        (contact,) = events["time"]
        assert contact == pytest.approx(-TAU * np.log1p(-(9.5 - 2.0) / (4.0 * TAU)), rel=1e-14)
        speed = 4.0 * np.exp(-contact / TAU)
        assert events["approach_speed"][0] == pytest.approx(speed, rel=1e-13)
        for frame in run.frames:
            if frame.time < contact:
                path = 4.0 * TAU * -np.expm1(-frame.time / TAU)
                assert frame.position[0, 0] == pytest.approx(2.0 + path, rel=1e-13)
            else:
                path = 0.8 * speed * TAU * -np.expm1(-(frame.time - contact) / TAU)
                assert frame.position[0, 0] == pytest.approx(9.5 - path, rel=1e-13)
            assert frame.position[0, 1] == pytest.approx(0.5 * TAU * -np.expm1(-frame.time / TAU), abs=1e-13)
        table = run.observables
        total = table["kinetic_energy"] + table["dissipated_energy"] + table["drag_loss"]
        assert np.allclose(total, total[0], rtol=1e-14)
        assert (table["ledger_residual"].abs() < 1e-14).all()


def test_velocities_of_a_live_simulation_with_a_drag_are_those_of_the_time():
    live = haff.Simulation(ball(contact={"restitution": 1.0}))
    live.advance(1.0)
    assert np.allclose(live.velocities, np.exp(-1 / TAU) * np.array([[4.0, 0.5, 0.0]]), rtol=1e-14)
    live.velocities = [[0.0, 1.0, 0.0]]
    start = live.positions.copy()
    live.advance(60.0 * TAU)
    assert np.allclose(live.positions - start, [[0.0, TAU, 0.0]], rtol=0, atol=1e-13)
    for key, value in (("domain__gravity", [0.0, -1.0, 0.0]), ("wall", [{"name": "x-", "motion": MOTION}])):
        with pytest.raises(haff.SceneError, match="a drag does not work with"):
            live.set(**{key: value})


@pytest.mark.long
@pytest.mark.physics
@pytest.mark.parametrize("e", [0.7, 0.85, 0.95])
def test_a_suspension_has_the_temperature_of_the_boltzmann_equation(command, e):
    eta, count, damping, kicks = 0.01, 2000, 5.0, 50.0
    n, chi = float(theory.number_density(eta, 1.0)), float(theory.contact_value(eta))
    rate = float(theory.collision_frequency(n, 1.0, 1.0, g0=chi))
    tau = damping / rate
    found = command.run(
        "suspension",
        domain__packing_fraction=eta,
        contact__restitution=e,
        species__grain__count=count,
        drive=[
            {"kind": "drag", "time": tau},
            {"kind": "white_noise", "strength": 2.0 / tau, "rate": kicks / tau},
        ],
        run__until=60 * tau,
        output__observables=0.1 * tau,
        output__frames=False,
    )
    with found.open() as run:
        late = run.observables[run.observables["time"] > 8 * tau]
        temperature, sonine = (analysis.mean(late[name]) for name in ("temperature", "sonine_a2"))
        assert run.observables["ledger_residual"].abs().max() < 1e-12
    T, error, a2, a2_error = dsmc.SUSPENSION[e]
    allowed = np.hypot(error, eta * (1 - e**2) * T)
    z = (temperature.mean - T) / np.hypot(temperature.error, allowed)
    assert abs(z) < 4, f"T = {temperature.mean:.5f} ± {temperature.error:.2g}, {T:.5f}: z = {z:.1f}"
    z = (sonine.mean - a2) / np.hypot(sonine.error, np.hypot(a2_error, 0.002))
    assert abs(z) < 4, f"a₂ = {sonine.mean:.4f} ± {sonine.error:.2g}, {a2:.4f}: z = {z:.1f}"
    expected = theory.suspension_temperature(2.0 / tau, tau, e, n, 1.0, g0=chi)
    assert float(expected) == pytest.approx(T, rel=0.01)
