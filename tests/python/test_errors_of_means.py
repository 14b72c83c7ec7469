"""Means of observables: stated errors against the scatter of independent runs, the figure, the table of a sweep."""

from __future__ import annotations

import numpy as np
import pytest

import haff
from haff import figures
from haff.errors import NotApplicableError

SEEDS = 200
GAS = {
    "domain": {"packing_fraction": 0.02},
    "species": [{"name": "grain", "count": 40, "radius": 0.5, "mass": 1.0}],
    "initial": {"positions": "random", "temperature": 1.0},
    "output": {"frames": False},
}
# A velocity is forgotten at the rate of the kicks, so that the autocorrelation of T is e^(−rate t): collisions keep T.
THERMOSTAT = GAS | {
    "drive": [{"kind": "andersen", "temperature": 1.0, "rate": 1.0}],
    "output": {"frames": False, "observables": 0.2},
    "run": {"until": 200.0},
}
# The temperature of a gas between thermal walls follows the heat that they give: slow, over many flights.
WALLS = GAS | {
    "domain": {"size": [10.0, 10.0, 10.0], "boundary": ["wall", "periodic", "periodic"]},
    "wall": [{"name": "x-", "temperature": 1.0}, {"name": "x+", "temperature": 1.0}],
    "output": {"frames": False, "observables": 2.0},
    "run": {"until": 2000.0},
}
# Pressures are means over the intervals of the samples: hardly correlated.
FLUID = GAS | {
    "domain": {"packing_fraction": 0.2},
    "initial": {"positions": "lattice", "temperature": 1.0},
    "output": {"frames": False, "observables": 1.0},
    "run": {"until": 200.0},
}


@pytest.mark.long
@pytest.mark.physics
@pytest.mark.parametrize(
    ("scene", "name"),
    [(THERMOSTAT, "temperature"), (WALLS, "temperature"), (FLUID, "pressure")],
    ids=["thermostat", "thermal walls", "fluid"],
)
def test_the_stated_error_is_the_scatter_of_independent_runs(scene, name, tmp_path):
    study = haff.sweep(scene | {"seed": 3}, {}, seeds=SEEDS, output=tmp_path)
    of = study.sel(observable=name)
    means, errors = of.observable_mean.to_numpy().ravel(), of.observable_error.to_numpy().ravel()
    scatter, stated = means.std(ddof=1), np.sqrt(np.mean(errors**2))
    # The scatter of 200 runs is known to 1/√400, 5 %.
    assert stated == pytest.approx(scatter, rel=0.1), f"stated {stated:.3g}, scatter {scatter:.3g}"
    assert of.observable_drifts.mean() < 0.03
    # Each mean beside that of all: z-scores have the variance 1.
    z = (means - means.mean()) / errors
    assert np.mean(np.abs(z) < 2) > 0.9, f"{np.mean(np.abs(z) < 2):.3f} within two errors"
    assert np.all(of.observable_start < 0.5 * scene["run"]["until"])


def test_what_is_computed_from_means_has_errors():
    noise = np.random.default_rng(3).normal(size=(2, 4000))
    a, b = (haff.analysis.mean(level + series) for level, series in zip((2.0, 5.0), noise))
    ratio = a.ufloat / b.ufloat
    expected = a.mean / b.mean * np.hypot(a.error / a.mean, b.error / b.mean)
    assert ratio.nominal_value == a.mean / b.mean and ratio.std_dev == pytest.approx(expected)
    whole = haff.analysis.block_average(noise[0]).ufloat
    assert (whole - whole).std_dev == 0


def test_a_run_that_drifts_is_called_so(tmp_path):
    cooling = GAS | {"contact": {"restitution": 0.8}, "run": {"until": 50.0}}
    cooling["output"] = {"frames": False, "observables": 0.5}
    study = haff.sweep(cooling, {}, seeds=2, output=tmp_path)
    assert bool(study.observable_drifts.sel(observable="temperature").all())


def test_means_of_a_sweep_are_those_of_its_files(tmp_path):
    scene = THERMOSTAT | {"run": {"until": 20.0}}
    study = haff.sweep(scene, {"drive.0.rate": [1.0, 2.0]}, seeds=2, output=tmp_path)
    again = haff.open_study(tmp_path)
    for row in np.ndindex(study.file.shape):
        with haff.open(study.file.to_numpy()[row]) as run:
            means = run.means
        for name in ("temperature", "pressure", "collision_rate"):
            for key in ("mean", "error", "start"):
                expected = means.loc[name, key]
                for one in (study, again):
                    assert float(one[f"observable_{key}"].sel(observable=name).to_numpy()[row]) == expected
    # Neither sums since the start nor the residual have a mean.
    names = set(study.observable.to_numpy())
    assert {"temperature", "sonine_a2"} <= names
    assert not names & {"dissipated_energy", "carnot_energy", "ledger_residual", "collisions", "drive_work"}


@pytest.mark.long
def test_the_figure_has_the_means_of_all_observables_that_vary(tmp_path):
    with haff.run(THERMOSTAT | {"run": {"until": 40.0}}, file=tmp_path / "gas.h5") as done:
        run = done.file
        figure = figures.draw(run, "means")
        titles = [axes.get_title(loc="right") for axes in figure.axes]
        labels = [axes.get_ylabel().split("\n")[0] for axes in figure.axes]
        at = labels.index("temperature")
        found = run.means.loc["temperature"]
        mean, error = (float(part) for part in titles[at].split("  ")[0].split(" ± "))
        assert mean == pytest.approx(found["mean"], abs=0.1 * found["error"])
        assert error == pytest.approx(found["error"], rel=0.1)
        assert "dissipated energy" not in labels
    with (
        haff.run(THERMOSTAT | {"run": {"until": 1.0}}, file=tmp_path / "short.h5") as done,
        pytest.raises(NotApplicableError, match="fewer than 16 samples"),
    ):
        figures.draw(done.file, "means")
