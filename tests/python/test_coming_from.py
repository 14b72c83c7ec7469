"""Formulas and scenes of docs/howto/coming-from.md; contacts of the other programs are integrated numerically."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import haff
from conftest import ROOT

PAGE = (ROOT / "docs" / "howto" / "coming-from.md").read_text()
SCENES = dict(re.findall(r'```toml title="(\S+)"\n(.*?)```', PAGE, flags=re.DOTALL))


def functions() -> dict:
    """The functions that the page defines."""
    names = {"np": np}
    for code in re.findall(r"^def .*?(?=\n\n\n)", PAGE, flags=re.DOTALL | re.MULTILINE):
        exec(code, names)
    return names


def contact(stiffness: float, damping: float, mass: float) -> tuple[float, float]:
    """Duration and coefficient of restitution of a contact with m δ'' = −k δ − γ δ', integrated numerically."""

    def released(time, state):
        return state[0]

    released.terminal, released.direction = True, -1
    span = 4 * np.pi * np.sqrt(mass / stiffness)
    options = {"events": released, "rtol": 1e-12, "atol": 1e-16, "method": "DOP853", "max_step": span / 400}
    run = solve_ivp(
        lambda time, state: [state[1], -(stiffness * state[0] + damping * state[1]) / mass],
        (0, span),
        [0, 1],
        **options,
    )
    # The contact begins at δ = 0, which is no release.
    time, state = next((t, y) for t, y in zip(run.t_events[0], run.y_events[0]) if t > 0)
    return time, -state[1]


@pytest.mark.parametrize("effective_mass", [0.5, 1.0], ids=["grains", "wall"])
def test_restitution_of_lammps_is_that_of_its_equation_of_motion(effective_mass):
    stiffness, damping = 2e5, 42.39786
    assert f"gran/hooke {stiffness:.1f} 0.0 {damping} 0.0 0.0 0" in PAGE
    closed = functions()["gran_hooke"](stiffness, damping, effective_mass)
    # The force of damping is m_eff γ_n v. The integration has an error of 1e-10.
    np.testing.assert_allclose(contact(stiffness, effective_mass * damping, effective_mass), closed, rtol=1e-9)
    if effective_mass == 0.5:
        scene = SCENES["from_lammps.toml"]
        assert closed[1] == pytest.approx(float(re.search(r"\nrestitution = (\S+)", scene)[1]), abs=1e-7)


@pytest.mark.parametrize("share", [0.5, 1.0], ids=["grains", "wall"])
def test_restitution_of_mercurydpm_is_that_of_its_equation_of_motion(share):
    mass, time, e = 2000 * 4 / 3 * np.pi * 0.05**3, 0.005, 0.8
    assert f"setCollisionTimeAndRestitutionCoefficient({time}, {e}, steel" in PAGE
    closed = functions()["linear_viscoelastic"](time, e, mass, share * mass)
    dashpot = -mass * np.log(e) / time
    spring = mass / 2 * ((np.pi / time) ** 2 + (dashpot / mass) ** 2)
    np.testing.assert_allclose(contact(spring, dashpot, share * mass), closed, rtol=1e-9)
    key = "wall_restitution" if share == 1 else "restitution"
    assert closed[1] == pytest.approx(float(re.search(rf"\n{key} = (\S+)", SCENES["from_mercury.toml"])[1]), rel=1e-12)


def test_translated_ball_rests_at_the_time_of_the_closed_form(tmp_path):
    e = float(re.search(r"wall_restitution = (\S+)", SCENES["from_mercury.toml"])[1])
    result = run("from_mercury.toml", tmp_path)
    expected = np.sqrt(2 * 1.0 / 9.81) * (1 + e) / (1 - e)
    assert result["stopped"] == "rest" and result.simulated_time == pytest.approx(expected, rel=1e-12)


def run(name: str, folder) -> haff.Result:
    path = folder / name
    path.write_text(SCENES[name])
    return haff.run(path, file=folder / f"{path.stem}.h5")


@pytest.mark.physics
def test_translated_fluid_of_hoomd_has_the_pressure_of_theory(tmp_path):
    with run("from_hoomd.toml", tmp_path).file as file:
        table, density = file.observables[20:], len(file) / file.box.volume
        theory = haff.theory.periodic_compressibility(0.3, len(file), equation="klm")
    compressibility = (table["pressure"] / (density * table["temperature"])).to_numpy()
    # Blocks of ten times are independent: pressures decorrelate within a mean free time, 0.1.
    blocks = [block.mean() for block in np.array_split(compressibility, 8)]
    z = (np.mean(blocks) - theory) / (np.std(blocks, ddof=1) / np.sqrt(len(blocks)))
    assert abs(z) < 4, z


@pytest.mark.physics
def test_translated_fluid_of_dynamo_has_the_mean_free_time_of_enskog(tmp_path):
    result = run("from_dynamo.toml", tmp_path)
    assert (result["stopped"], result.collisions, result["particles"]) == ("collisions", 1_000_000, 1372)
    with result.file as file:
        first, last = file.observables.iloc[20], file.observables.iloc[-1]
    free = len(file) / 2 * (last["time"] - first["time"]) / (last["collisions"] - first["collisions"])
    contact_value = haff.theory.periodic_contact_value(np.pi / 12, len(file), equation="klm")
    theory = haff.theory.mean_free_time(n=0.5, sigma=1.0, g0=contact_value) / haff.theory.periodic_rate_factor(1372)
    # 10⁶ collisions, whose number scatters less than that of independent events: 0.1 %.
    assert free == pytest.approx(theory, rel=4e-3)


@pytest.mark.physics
def test_translated_gas_of_lammps_cools_by_haffs_law_at_first(tmp_path):
    with run("from_lammps.toml", tmp_path).file as file:
        table, density = file.observables, len(file) / file.box.volume
    contact_value = haff.theory.contact_value(density * np.pi / 6)
    frequency = haff.theory.collision_frequency(n=density, sigma=1.0, g0=contact_value)
    law = haff.theory.haff_temperature(table["time"], 1.0, haff.theory.haff_time(0.9, frequency))
    early = table["temperature"] > 0.5
    # One gas of 800 grains: its temperature scatters by √(2/(3 N)) = 3 %.
    assert early.sum() > 5 and np.abs(table["temperature"] / law - 1)[early].max() < 0.1
