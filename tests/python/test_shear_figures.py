"""Uniform shear flow: its theory against exact values, and the figures of sheared runs."""

import numpy as np
import pytest
from matplotlib.colors import same_color
from scipy import optimize, special

import haff
from haff import analysis, figures, theory
from haff.command.main import main
from haff.figures import snapshot
from haff.figures.style import RED
from haff.theory import shear
from test_figures import require_texts_apart

# Boltzmann's equation by direct Monte Carlo: a*, and P_xx, P_yy, P_zz, P_xy over the pressure. Standard errors are
# below 4e-4.
EXACT = {
    0.7: (0.66825, 1.42836, 0.76306, 0.80857, -0.50422),
    0.9: (0.36423, 1.15497, 0.91267, 0.93236, -0.33171),
}
# Relative errors that the docstrings state, and their last digit.
MODEL = {0.7: (-0.056, 0.004, 0.026, -0.032, 0.002), 0.9: (-0.015, 0.003, 0.009, -0.013, -0.002)}


def components(tensor):
    return np.stack([tensor[..., 0, 0], tensor[..., 1, 1], tensor[..., 2, 2], tensor[..., 0, 1]], axis=-1)


@pytest.mark.parametrize("e", EXACT)
def test_model_of_a_dilute_gas_has_the_stated_errors(e):
    flow = theory.uniform_shear_model(e)
    seen = np.array([flow.reduced_rate, *components(flow.pressure_tensor)])
    # Rounded to a tenth of a percent, and the noise of the exact values.
    assert np.abs(seen / EXACT[e] - 1 - MODEL[e]).max() < 0.5e-3 + 6e-4


def test_model_of_a_dilute_gas_by_hand_and_at_its_limits():
    # e = 0.9: ν = 1.9 · 2.1/4, ζ = 5 · 0.19/12.
    nu, zeta = 0.9975, 0.95 / 12
    flow = theory.uniform_shear_model(0.9)
    assert flow.reduced_rate == pytest.approx(0.359, abs=5e-4)
    assert flow.reduced_rate**2 == pytest.approx(3 * zeta * nu**2 / (2 * (nu - zeta)), rel=1e-14)
    assert flow.pressure_tensor[1, 1] == pytest.approx(0.921, abs=5e-4)
    # The work of the shear is what collisions take, -γ̇ P_xy = (3/2) ζ ν₀ p.
    e = np.array([0.2, 0.5, 0.8])
    flow = theory.uniform_shear_model(e)
    P = flow.pressure_tensor
    assert -flow.reduced_rate * P[:, 0, 1] == pytest.approx(1.5 * 5 * (1 - e**2) / 12, rel=1e-13)
    assert np.trace(P, axis1=1, axis2=2) == pytest.approx([3, 3, 3], rel=1e-14) and P.shape == (3, 3, 3)
    elastic = theory.uniform_shear_model(1.0)
    assert elastic.reduced_rate == 0 and np.array_equal(elastic.pressure_tensor, np.eye(3))


def test_temperature_of_a_dilute_gas_grows_with_the_square_of_the_rate():
    T = theory.uniform_shear_temperature([0.1, 0.2], 0.9, 0.01, 2.0, 3.0)
    assert T[1] == pytest.approx(4 * T[0], rel=1e-14)
    # By the definition of the reduced rate, with ν₀ = (16/5) √π n σ² √(T/m).
    rate = 16 / 5 * np.sqrt(np.pi) * 0.01 * 4 * np.sqrt(T[0] / 3)
    assert 0.1 / rate == pytest.approx(theory.uniform_shear_model(0.9).reduced_rate, rel=1e-14)
    assert theory.uniform_shear_temperature(0.1, 1.0, 0.01, 1.0) == np.inf


@pytest.mark.parametrize(("e", "T", "P_xy", "p"), [(0.9, 1.2985, -0.5838, 2.1035), (0.7, 0.3524, -0.2631, 0.5644)])
def test_enskogs_flow_has_the_values_of_an_independent_solution(e, T, P_xy, p):
    """At n σ³ = ½; by a program without NumPy, with Newton's method."""
    flow = theory.uniform_shear_enskog(e, np.pi / 12)
    assert [flow.temperature, flow.pressure_tensor[0, 1], flow.pressure] == pytest.approx([T, P_xy, p], abs=6e-5)
    assert flow.viscosity == -flow.pressure_tensor[0, 1]
    if e == 0.9:
        assert flow.mean_free_time == pytest.approx(0.11337, abs=6e-6)


@pytest.mark.long
def test_enskogs_flow_balances_work_and_losses():
    """-γ̇ P_xy is the mean loss of a collision, m(1 - e²)⟨w³⟩/(4⟨w⟩) of Gaussian approach speeds, times their rate."""
    e, phi = np.array([0.5, 0.8, 0.95]), np.array([0.02, 0.2, 0.4])
    flow = theory.uniform_shear_enskog(e, phi)
    rng = np.random.default_rng(2)
    for k in range(3):
        n, g = float(theory.number_density(phi[k], 1.0)), float(theory.contact_value(phi[k]))
        directions = rng.normal(size=(1_000_000, 3))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        spread = np.sqrt(2 * np.einsum("qi,ij,qj->q", directions, flow.velocity_covariance[k], directions))
        w = np.maximum(-directions[:, 0] * directions[:, 1] + spread * rng.normal(size=len(spread)), 0)
        # Each pair counts for both of its spheres. Noise of a million samples: about 0.3 %.
        assert 4 * np.pi * n * g * w.mean() * flow.mean_free_time[k] == pytest.approx(1, rel=6e-3)
        lost = 4 * np.pi * n**2 * g / 2 * (1 - e[k] ** 2) / 4 * np.mean(w**3)
        assert flow.viscosity[k] == pytest.approx(lost, rel=1.5e-2)


@pytest.mark.parametrize(("e", "rate", "stress"), [(0.9, 0.0024, 0.003), (0.7, 0.0175, 0.005)])
def test_enskogs_flow_of_a_dilute_gas_is_near_that_of_boltzmann(e, rate, stress):
    flow = theory.uniform_shear_enskog(e, 1e-6)
    nu = 16 / 5 * np.sqrt(np.pi) * float(theory.number_density(1e-6, 1.0)) * np.sqrt(flow.temperature)
    exact = EXACT[e]
    assert 1 / nu / exact[0] - 1 == pytest.approx(-rate, abs=6e-4)
    assert np.abs(components(flow.pressure_tensor) / flow.pressure / exact[1:] - 1).max() < stress


def test_enskogs_flow_of_a_nearly_elastic_fluid_has_its_viscosity():
    """The first approximation of Chapman and Cowling, which is that of a Gaussian; the difference is of order 1 - e."""
    for phi in (0.01, 0.2, 0.4):
        flow = theory.uniform_shear_enskog(0.9999, phi)
        n, g = float(theory.number_density(phi, 1.0)), float(theory.contact_value(phi))
        y = 2 / 3 * np.pi * n * g
        first = 5 / 16 / np.sqrt(np.pi) * ((1 + 0.4 * y) ** 2 + 48 / (25 * np.pi) * y**2) / g
        assert flow.viscosity == pytest.approx(first * np.sqrt(flow.temperature), rel=1e-3)
        assert flow.pressure == pytest.approx(n * flow.temperature * theory.compressibility(phi), rel=1e-3)


@pytest.mark.long
def test_enskogs_flow_is_the_one_of_scipys_solver(monkeypatch):
    e, phi = np.array([0.0, 0.5, 0.9, 0.99, 0.9999])[:, None], np.array([1e-6, 0.1, 0.48])
    own = theory.uniform_shear_enskog(e, phi)

    def zero(off, start):
        found = optimize.root(off, start, tol=1e-12)
        assert found.success, found.message
        return found.x

    monkeypatch.setattr(shear, "_zero", zero)
    monkeypatch.setattr(shear, "_normal", special.ndtr)
    # Heating and cooling nearly cancel at e = 0.9999: the state is known to about 1e-16/(1 - e²).
    for mine, other in zip(own, theory.uniform_shear_enskog(e, phi)):
        assert np.allclose(mine, other, rtol=1e-10, atol=1e-10 * np.abs(other).max())


@pytest.mark.parametrize(
    ("e", "phi", "reason"), [(1.0, 0.1, "no steady state"), (0.9, 0.5, "fluid"), (0.9, 0, "fluid")]
)
def test_flow_without_steady_state_or_of_no_fluid_is_refused(e, phi, reason):
    with pytest.raises(ValueError, match=reason):
        theory.uniform_shear_enskog(e, phi)


# --- figures -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A sheared gas of 300 spheres, and its scene."""
    scene = {
        "schema": 1,
        "domain": {"packing_fraction": 0.1, "shear": {"flow": "z", "gradient": "x", "rate": -0.5}},
        "species": [{"name": "grain", "count": 300, "radius": 1.0, "mass": 2.0}],
        "initial": {"positions": "lattice", "temperature": 10.0},
        "contact": {"restitution": 0.8},
        "measure": {"stress": True, "profiles": [{"axis": "x", "bins": 10, "interval": 5.0, "samples": 20}]},
        "run": {"until": 60.0},
        "output": {"frames": 1.0, "observables": 0.5, "events": True},
        "seed": 1,
    }
    path = tmp_path_factory.mktemp("shear") / "sheared.h5"
    haff.run(scene, file=path)
    return path, scene


@pytest.mark.long
def test_default_draws_the_figures_of_a_sheared_run(run, tmp_path, capsys):
    assert main(["plot", str(run[0]), "-o", str(tmp_path)]) == 0
    drawn = {path.stem.removeprefix("sheared-") for path in tmp_path.iterdir()}
    assert drawn == {
        "temperature", "energy", "velocity", "structure", "profiles", "stress", "shear", "means", "snapshot", "losses"
    }, capsys.readouterr().err  # fmt: skip


def test_shear_figure_shows_the_run_and_the_theory_in_the_units_of_the_scene(run):
    with haff.open(run[0]) as file:
        figure = figures.draw(file, "shear")
        temperature, viscosity, normal, velocity = figure.axes
        flow, seen = theory.uniform_shear_enskog(0.8, 0.1), analysis.rheology(file)
        level = {}
        for name, axes in (("T", temperature), ("eta", viscosity)):
            (line,) = [line for line in axes.lines if line.get_label().startswith("Enskog")]
            assert same_color(line.get_color(), RED)
            level[name] = line.get_ydata()[0]
        # m (σ γ̇)² = 2 and m |γ̇|/σ = ½.
        assert level == {"T": pytest.approx(2 * flow.temperature), "eta": pytest.approx(0.5 * flow.viscosity)}
        # 300 spheres fluctuate by some percent, and the theory is some percent low.
        table = file.observables
        late = table[table["time"] > 30]
        assert late["temperature"].mean() == pytest.approx(level["T"], rel=0.15)
        assert seen.mean_viscosity.mean == pytest.approx(level["eta"], rel=0.15)
        # Strain is |γ̇| t, and curves are those of the file.
        strain, values = temperature.lines[0].get_data()
        assert np.array_equal(strain, 0.5 * table["time"]) and np.array_equal(values, table["temperature"])
        assert np.array_equal(viscosity.lines[0].get_ydata(), seen.viscosity)
        # Normal stresses are those along the flow, the gradient, and the third axis.
        labels = [line.get_label() for line in normal.lines if not line.get_label().startswith("_")]
        assert labels == ["$P_{zz}$", "$P_{xx}$", "$P_{yy}$"]
        levels = [line.get_ydata()[0] for line in normal.lines if line.get_linestyle() == "--"]
        assert levels == pytest.approx(list(np.diag(flow.pressure_tensor) / flow.pressure))
        drawn = np.stack([line.get_ydata() for line in normal.lines if line.get_label().startswith("$")])
        stresses = table[[f"pressure_tensor_{a}{a}" for a in "zxy"]].to_numpy().T[:, -drawn.shape[1] :]
        assert drawn == pytest.approx(stresses / stresses.mean(axis=0))
        # A mean of 60 samples has a noise of 0.014, and the theory is off by up to 0.018 here.
        assert drawn[:, 60:].mean(axis=1) == pytest.approx(levels, abs=0.06)
        # The profile: u_z = γ̇ x.
        ends, ramp = velocity.lines[0].get_data()
        assert ramp == pytest.approx(-0.5 * ends) and ends[1] == pytest.approx(file.box.size[0])
        place, u = velocity.lines[1].get_data()
        # Two percent of the flow at the upper end, where the thermal speed over √(20 · 300/10 · 6) is less.
        assert u == pytest.approx(-0.5 * place, abs=0.02 * 0.5 * file.box.size[0])


@pytest.mark.long
@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({"contact__restitution": 1.0}, "needs inelastic contacts"),
        (
            {"contact__restitution": {"model": "viscoelastic", "coefficient": 0.05}},
            "one constant coefficient of restitution",
        ),
        ({"contact__tangential_restitution": 0.5}, "needs smooth contacts"),
        ({"dimension": 2, "domain__shear": {"flow": "y", "gradient": "x", "rate": 0.5}}, "needs spheres"),
    ],
)
def test_shear_figure_without_theory_says_why(run, settings, why, tmp_path):
    measure = {"stress": True}
    haff.run(run[1], file=tmp_path / "other.h5", measure=measure, run__until=8.0, species__0__count=100, **settings)
    with haff.open(tmp_path / "other.h5") as file:
        figure = figures.draw(file, "shear")
        assert len(figure.axes) == 3, "no panel without a profile"
        texts = [text.get_text() for axes in figure.axes for text in axes.texts]
        assert len(texts) == 1 and texts[0].startswith("no theory drawn: ") and why in texts[0]
        assert not [line for axes in figure.axes for line in axes.lines if line.get_label().startswith("Enskog")]


def test_shear_figure_needs_shear_and_stresses(run, files, tmp_path, capsys):
    assert main(["plot", str(files["cooling"]), "--kind", "shear", "-o", str(tmp_path)]) == 2
    assert "skipped shear: no shear (set domain.shear in the scene)" in capsys.readouterr().err
    haff.run(run[1], file=tmp_path / "bare.h5", measure={}, run__until=1.0)
    assert main(["plot", str(tmp_path / "bare.h5"), "--kind", "shear", "-o", str(tmp_path)]) == 2
    assert "skipped shear: no pressure tensor (set measure.stress in the scene)" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.parametrize("kind", ["shear", "velocity"])
def test_no_text_of_a_sheared_run_is_cut_off_or_covers_other_text(run, kind, monkeypatch):
    require_texts_apart(run[0], kind, monkeypatch)


def test_velocities_of_a_sheared_run_are_relative_to_the_flow(run):
    """By lab velocities, which the flow spreads over twelve units, the density at 0 would be a third of Maxwell's."""
    with haff.open(run[0]) as file:
        figure = figures.draw(file, "velocity")
        below = figure.axes[1]
        points = below.containers[0][0].get_xydata()
        # Between unequal temperatures of the components and the noise of 12,000 velocities.
        assert np.abs(points[points[:, 0] < 1, 1] - 1).max() < 0.08
        (note,) = [text.get_text() for text in below.texts if "green" in text.get_text()]
        assert "normal densities" in note and "relative to the flow" in below.get_xlabel()
        bars = [axes.get_ylabel() for axes in snapshot.draw(file, pixels=50).axes[1:]]
        assert len(bars) == 1 and "relative to the flow" in bars[0]


def test_energy_figure_of_a_sheared_run_has_the_work_of_the_shear(run):
    with haff.open(run[0]) as file:
        figure, table = figures.draw(file, "energy"), file.observables
        supply = figure.axes[0].lines[0]
        assert "work of shear" in supply.get_label()
        total = table["kinetic_energy"].iloc[0] + table["shear_work"].to_numpy()
        assert supply.get_ydata() == pytest.approx(total, rel=1e-12)
        upper = max(path.vertices[:, 1].max() for c in figure.axes[0].collections for path in c.get_paths())
        assert upper == pytest.approx(total.max(), rel=1e-9), "the layers fill the supply"


def test_losses_of_a_sheared_run_are_not_compared_with_those_of_a_cooling_gas(run):
    with haff.open(run[0]) as file:
        assert len(figures.draw(file, "losses").axes) == 1
