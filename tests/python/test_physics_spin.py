"""Scenes of rough grains: a cooling gas, a ball that slides and rolls, a superball; and a gas of many sizes."""

import numpy as np
import pytest

from haff import analysis, theory
from validation import dsmc

pytestmark = pytest.mark.physics


@pytest.mark.long
@pytest.mark.parametrize(("e", "beta"), [(0.9, 0.0), (0.7, -0.5)])
def test_rough_cooling_has_the_ratio_of_temperatures_of_the_boltzmann_equation(command, e, beta):
    # φ = 0.005: correlated velocities shift the ratio by less than the error.
    found = command.run(
        "rough_cooling",
        domain__packing_fraction=0.005,
        contact__restitution=e,
        contact__tangential_restitution=beta,
        initial__rotational_temperature=1.0,
        run__collisions_per_particle=160,
        output__observables={"log": [0.1, 1.01]},
        output__frames=False,
    )
    with found.open() as run:
        table = run.observables
        assert table["ledger_residual"].abs().max() < 1e-12
        # Equal numbers of collisions between values: the gas forgets within some ten of them for each particle.
        count = table["collisions"].to_numpy()
        levels = np.arange(60, 160, 0.5) * len(run) / 2
        rows = table.iloc[np.searchsorted(count, levels).clip(max=len(table) - 1)]
        ratio = analysis.block_average((rows["rotational_temperature"] / rows["temperature"]).to_numpy(), 10)
    expected, error = dsmc.COOLING[e, beta]
    z = (ratio.mean - expected) / np.hypot(ratio.error, error)
    assert abs(z) < 4, f"T_rot/T = {ratio.mean:.4f} ± {ratio.error:.2g}, expected {expected:.4f} ± {error:.2g}"
    # The Maxwellian approximation is 5 % too high at the first, 12 % at the second.
    assert 0.85 < ratio.mean / float(theory.rough_temperature_ratio(e, beta)) < 1


def test_a_sliding_ball_rolls_at_five_sevenths_of_its_speed(command):
    with command.run("rolling").open() as run:
        (slide,) = run.events.to_pandas().query("kind == 'slide'").itertuples()
        assert slide.time == pytest.approx(2 * 7 / (7 * 0.3 * 9.81), rel=1e-14)
        assert slide.energy_loss == pytest.approx(14, rel=1e-14)
        for frame in run.frames:
            sliding = min(frame.time, slide.time)
            speed = 7 - 0.3 * 9.81 * sliding
            place = 7 * sliding - 0.15 * 9.81 * sliding**2 + speed * (frame.time - sliding)
            assert frame.velocity[0] == pytest.approx([speed, 0, 0], abs=1e-13)
            assert frame.position[0] == pytest.approx([place, 0, 0.5], abs=1e-13)
        assert 0.5 * frame.angular_velocity[0, 1] == pytest.approx(5, rel=1e-14)
        assert run.observables["ledger_residual"].abs().max() < 1e-14


def test_a_ball_with_backspin_rolls_back(command):
    with command.run("rolling", particle__ball__angular_velocity=[0, -60, 0], run__until=4).open() as run:
        # v' = v − 2/7 (v + R ω)
        assert run.frames[-1].velocity[0, 0] == pytest.approx(7 - 37 * 2 / 7, rel=1e-13)


def test_a_superball_comes_back(command):
    with command.run("bouncing_superball").open() as run:
        times = np.array([frame.time for frame in run.frames])
        speeds = np.array([frame.velocity[0, 0] for frame in run.frames])
        bounce = np.floor(times + 0.5).astype(int)
        inside = np.abs(times + 0.5 - bounce) > 0.01
        expected = np.where(bounce % 2 == 0, 2, 6 / 7)
        assert speeds[inside] == pytest.approx(expected[inside], rel=1e-13)
        assert run.observables["dissipated_energy"].iloc[-1] == 0
        assert run.observables["ledger_residual"].abs().max() < 1e-14


def test_a_gas_of_many_sizes_has_the_stated_radii_and_unequal_temperatures(command):
    with command.run("polydisperse").open() as run:
        fine, coarse = (run.radius[run.species == k] for k in (0, 1))
        z = (fine.mean() - 0.3) / (0.06 / np.sqrt(len(fine)))
        assert abs(z) < 4, f"mean radius of the fine grains {fine.mean():.4f}, z = {z:.1f}"
        # ∫ R R^(−3.5) / ∫ R^(−3.5) from 0.5 to 1.
        mean = (2.5 / 1.5) * (0.5**-1.5 - 1) / (0.5**-2.5 - 1)
        square = (2.5 / 0.5) * (0.5**-0.5 - 1) / (0.5**-2.5 - 1)
        z = (coarse.mean() - mean) / np.sqrt((square - mean**2) / len(coarse))
        assert abs(z) < 4, f"mean radius of the coarse grains {coarse.mean():.4f}, z = {z:.1f}"
        assert run.mass == pytest.approx(4 / 3 * np.pi * run.radius**3, rel=1e-12)
        last = run.observables.iloc[-1]
        assert last["species_temperature_coarse"] > 1.1 * last["species_temperature_fine"]
        assert abs(last["ledger_residual"]) < 1e-12


def test_sizes_from_a_table_need_no_file_to_resume(command, tmp_path):
    sizes = tmp_path / "sizes.csv"
    sizes.write_text("radius, weight\n0.3, 3\n0.5, 1\n")
    radius = {"table": str(sizes)}
    scene = {"domain__packing_fraction": 0.05, "species__fine__radius": radius, "run__collisions_per_particle": 2}
    found = command.run("polydisperse", output__checkpoint=0.2, **scene)
    with found.open() as run:
        fine = run.radius[run.species == 0]
        assert set(fine) == {0.3, 0.5}
        z = ((fine == 0.3).mean() - 0.75) / np.sqrt(0.1875 / len(fine))
        assert abs(z) < 4, f"z = {z:.1f}"
        assert "sizes.csv" not in run.scene_text
