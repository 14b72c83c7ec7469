"""The cooling figure of a gas that clusters: the fit of τ ends where Haff's law does; the ratio is never negative."""

import h5py
import numpy as np
import pytest

import haff
from haff import analysis, figures, theory
from haff.figures import cooling


def clustering(path, source, at: float, power: float = 1.0):
    """A gas by Haff's law up to the time ``at`` τ, whose T falls more slowly by (t/at)^power from there on."""
    path.write_bytes(source.read_bytes())
    with haff.open(path) as run:
        tau = analysis.cooling_law(run).tau
    with h5py.File(path, "r+") as file:
        time, values = (file[f"observables/temperature/{name}"][:] for name in ("time", "value"))
        file["observables/temperature/value"][:] = values * np.maximum(1.0, time / (at * tau)) ** power
    return path, tau


@pytest.mark.long
@pytest.mark.parametrize("at", [2.0, 8.0])
def test_tau_is_fitted_up_to_the_end_of_the_law(files, tmp_path, at):
    path, tau = clustering(tmp_path / "gas.h5", files["cooling"], at)
    with haff.open(path) as run:
        fit = cooling.fitted(run, analysis.cooling_law(run))
        time = run.samples["time"]
        figure = figures.draw(run, "temperature")
    assert not fit.complete
    # T is off by the factor t/(at τ), up to the tolerance at the last sample of the fit.
    allowed = 1 + cooling.DEVIATION + np.sqrt(2 / (3 * 2000))
    assert fit.until == time[time <= allowed * at * tau][-1]
    # The samples at which T is off by less than that pull τ up by up to half of it.
    assert tau * (1 - 1e-9) < fit.tau < tau * (1 + 0.5 * cooling.DEVIATION)
    top = figure.axes[0].get_legend()
    told = " ".join(text.get_text() for text in [*top.get_texts(), top.get_title()])
    assert f"up to $t$ = {fit.until:.3g}" in told and "off the law by more than 10 %" in told


@pytest.mark.long
def test_ratio_is_on_a_logarithmic_axis_that_shows_all_of_it(files, tmp_path):
    path, _ = clustering(tmp_path / "gas.h5", files["cooling"], 0.5, 2.0)
    with haff.open(path) as run:
        below = figures.draw(run, "temperature").axes[1]
    ratio = below.lines[-1].get_ydata()
    low, high = below.get_ylim()
    assert below.get_yscale() == "log" and ratio.max() > 1000
    # Neither cut nor shown in a corner of the axis.
    assert 0 < low < min(1.0, ratio.min()) and ratio.max() < high
    assert np.log(ratio.max()) > 0.7 * np.log(high / low)
    ticks = [tick.get_text() for tick in below.get_yticklabels()]
    assert "1" in ticks and all(float(tick) > 0 for tick in ticks if tick)


@pytest.mark.long
def test_gas_by_the_law_is_fitted_to_its_end_and_nothing_is_shaded(files):
    with haff.open(files["cooling"]) as run:
        law = analysis.cooling_law(run)
        fit = cooling.fitted(run, law)
        figure = figures.draw(run, "temperature")
        end = run.samples["time"][-1]
    assert fit.complete and fit.until == end and fit.tau == pytest.approx(law.tau, rel=1e-9)
    legend = figure.axes[0].get_legend()
    assert not any("up to" in text.get_text() for text in legend.get_texts())
    assert "shaded" not in legend.get_title().get_text()


def test_delay_of_a_lattice_does_not_change_tau(files, tmp_path):
    """T = T₀ (1 + (t − δ)/τ)⁻²: the same slope."""
    path = tmp_path / "gas.h5"
    path.write_bytes(files["cooling"].read_bytes())
    with haff.open(path) as run:
        law = analysis.cooling_law(run)
    with h5py.File(path, "r+") as file:
        time = file["observables/temperature/time"][:]
        delayed = np.maximum(time - 0.02 * law.tau, 0.0)
        file["observables/temperature/value"][:] = theory.haff_temperature(delayed, law.T0, law.tau)
    with haff.open(path) as run:
        assert cooling.fitted(run, law).tau == pytest.approx(law.tau, rel=1e-9)


@pytest.mark.long
def test_too_few_samples_have_no_fit(files, tmp_path):
    path, _ = clustering(tmp_path / "gas.h5", files["cooling"], 1e-9)
    with haff.open(path) as run:
        assert cooling.fitted(run, analysis.cooling_law(run)) is None
        labels = [text.get_text() for text in figures.draw(run, "temperature").axes[0].get_legend().get_texts()]
    assert "simulation" in labels
