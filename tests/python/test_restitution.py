"""`haff.restitution_from`: e with its error from runs and noisy tables; errors of invalid input."""

import numpy as np
import pandas as pd
import pytest
from uncertainties import ufloat

import haff
from haff import mechanics

E, H, G = 0.83, 1.7, 9.81
ARGUMENT = haff.ArgumentError
REPEATS = 100


def noisy(kind, noise, rng):
    """Simulated measurements of an experiment, and their true e."""
    k = np.arange(7)
    if kind == "heights":
        return {"height": mechanics.bounce_height(k, H, E) + noise * rng.standard_normal(7)}
    if kind == "times":
        return {"time": mechanics.bounce_time(k, H, E, G) + noise * rng.standard_normal(7)}
    alpha = np.linspace(0.6, 1.2, 7)
    beta = mechanics.pendulum_rise(alpha, E, 2.0, 3.0)
    return {"alpha": alpha + noise * rng.standard_normal(7), "beta": beta + noise * rng.standard_normal(7)}


def masses(kind):
    return (2.0, 3.0) if kind == "angles" else None


@pytest.mark.parametrize("kind", ["heights", "times", "angles"])
@pytest.mark.parametrize("given", [True, False])
def test_standard_errors_agree_with_the_scatter_of_repeated_experiments(kind, given):
    """z is normal for a given error, and Student's for one estimated from the scatter: mean and variance are known."""
    rng, noise = np.random.default_rng(11), 2e-3
    z = []
    for _ in range(REPEATS):
        found = haff.restitution_from(noisy(kind, noise, rng), error=noise if given else None, masses=masses(kind))
        z.append(found.z(E))
    # Degrees of freedom of the scatter; Student's variance is ν/(ν − 2), its kurtosis excess 6/(ν − 4).
    free = {"heights": 5, "times": 4, "angles": 6}[kind]
    square = np.mean(np.square(z)) if given else np.mean(np.minimum(np.square(z), 25))
    assert abs(np.mean(z)) * np.sqrt(REPEATS / square) < 4, f"z has mean {np.mean(z):.3f}"
    if given:
        assert abs(square - 1) < 4 * np.sqrt(2 / REPEATS), f"variance of z: {square:.3f}, expected 1"
    else:
        from scipy.stats import t

        inside = np.mean(np.abs(z) < t.ppf(0.84, free))
        assert abs(inside - 0.68) < 4 * np.sqrt(0.68 * 0.32 / REPEATS), f"{inside:.2f} within what holds 0.68"


@pytest.mark.parametrize("kind", ["heights", "times", "angles"])
def test_exact_numbers_give_e_to_rounding(kind):
    for e in [0.2, 0.5, 0.97, 1.0]:
        k = np.arange(5)
        table = {
            "heights": {"height": mechanics.bounce_height(k, H, e)},
            "times": {"time": mechanics.bounce_time(k, H, e, G)},
            "angles": {"alpha": [0.4, 0.9], "beta": mechanics.pendulum_rise([0.4, 0.9], e, 2.0, 3.0)},
        }[kind]
        found = haff.restitution_from(table, masses=masses(kind))
        assert found.mean == pytest.approx(e, rel=1e-12)
        assert found.error < 1e-12


def test_missing_bounces_keep_their_numbers():
    height = mechanics.bounce_height(np.arange(6), H, E)
    height[[1, 2]] = np.nan
    assert haff.restitution_from({"height": height}).mean == pytest.approx(E, rel=1e-12)
    time = mechanics.bounce_time(np.arange(6), H, E, G)
    time[3] = np.nan
    assert haff.restitution_from({"time": time}).mean == pytest.approx(E, rel=1e-10)


def test_error_of_masses_is_common_to_all_experiments():
    alpha = np.full(100, 0.8)
    table = {"alpha": alpha, "beta": mechanics.pendulum_rise(alpha, E, 2.0, 3.0)}
    exact = haff.restitution_from(table, error=(1e-3, 2e-3), masses=(2.0, 3.0))
    rough = haff.restitution_from(table, error=(1e-3, 2e-3), masses=(ufloat(2.0, 0.02), 3.0))
    # e + 1 = (1 + m_B/m_A) √…: de/dm_A = −(1 + e) m_B/(m_A (m_A + m_B)), the same in every experiment.
    common = (1 + E) * 3.0 / (2.0 * 5.0) * 0.02
    assert rough.error == pytest.approx(np.hypot(exact.error, common), rel=1e-6)
    scattered = haff.restitution_from(table, masses=(ufloat(2.0, 0.02), 3.0))
    assert scattered.error == pytest.approx(common, rel=1e-6)


def test_experiments_are_weighted_by_their_errors():
    table = pd.DataFrame({"alpha": [0.8, 0.8], "beta": mechanics.pendulum_rise(0.8, np.array([0.8, 0.5]))})
    table["alpha_error"], table["beta_error"] = [1e-3, 1e-1], [1e-3, 1e-1]
    # Errors of e differ by a factor near 100, weights by 10⁴.
    assert haff.restitution_from(table).mean == pytest.approx(0.8, abs=2e-4)
    assert np.isnan(haff.restitution_from({"alpha": [0.8], "beta": [0.7]}).error)


def test_csv_files_are_tables(tmp_path):
    path = tmp_path / "drop.csv"
    path.write_text("# a table tennis ball\nheight, height_error\n1.0, 0.01\n0.64, 0.01\n0.41, 0.01\n")
    given = haff.restitution_from({"height": [1.0, 0.64, 0.41]}, error=0.01)
    assert haff.restitution_from(path) == pytest.approx(given)


@pytest.mark.parametrize(
    ("source", "options", "error", "message"),
    [
        ({"hight": [1, 2]}, {}, haff.MissingDataError, "columns hight; needed: height, or time, or alpha and beta"),
        ({"height": [1, 2]}, {"kind": "times"}, haff.MissingDataError, "no column time; there are height"),
        ({"height": [1.0]}, {}, haff.NotApplicableError, "1 heights; e follows from 2 or more"),
        ({"height": [1.0, -0.1]}, {}, haff.NotApplicableError, "height = -0.1 must be positive"),
        ({"height": [1.0, "high"]}, {}, haff.NotApplicableError, "height = 'high' in row 2 must be a number"),
        ({"time": [0.0, 1.0, 0.5]}, {}, haff.NotApplicableError, "time = 0.5 must be later than the impact before, 1"),
        ({"alpha": [0.5], "beta": [0.0]}, {}, haff.NotApplicableError, "beta = 0 must be an angle up to π"),
        ({"alpha": [60.0], "beta": [50.0]}, {}, haff.NotApplicableError, "alpha = 60 must be an angle up to π"),
        (
            {"height": [1, 0.5], "height_error": [0.1, 0]},
            {},
            haff.NotApplicableError,
            "height_error = 0 must be positive",
        ),
        ({"height": [1, 0.5], "time": [1]}, {}, haff.NotApplicableError, "same length"),
        ({"height": [1, 0.5]}, {"error": -1}, ARGUMENT, "error = -1 must be positive"),
        ({"height": [1, 0.5]}, {"error": (1, 2)}, ARGUMENT, "must be one number for each of height"),
        (
            {"height": [1, 0.5]},
            {"kind": "speeds"},
            ARGUMENT,
            "kind = 'speeds': must be one of heights, times, angles",
        ),
        ({"alpha": [0.5], "beta": [0.4]}, {"masses": (1, -1)}, ARGUMENT, "must be two positive numbers"),
        ("missing.csv", {}, haff.FileError, "missing.csv: no such file"),
        ("missing.h5", {}, haff.FileError, "missing.h5: no such file"),
    ],
)
def test_error_of_unusable_input_names_it(source, options, error, message):
    with pytest.raises(error, match=message.replace("(", r"\(")):
        haff.restitution_from(source, **options)


@pytest.mark.physics
@pytest.mark.parametrize("e", [0.35, 0.8, 0.95])
def test_restitution_from_a_bouncing_ball_is_that_of_the_scene(command, e):
    done = command.run("textbook/bouncing_ball", wall__0__restitution=e)
    for kind in ("heights", "times"):
        found = haff.restitution_from(done.path, kind)
        assert found.mean == pytest.approx(e, rel=1e-10), kind
        assert found.error < 1e-10
    with pytest.raises(haff.NotApplicableError, match="no two pendulums meet"):
        haff.restitution_from(done.path, "angles")


@pytest.mark.physics
@pytest.mark.parametrize(
    ("scene", "e", "sizes"),
    [("pendulums", 0.0, (1, 1)), ("pendulums", 0.8, (1, 1)), ("pendulums_unequal", 0.45, (2, 3))],
)
def test_restitution_from_pendulums_is_that_of_the_scene(command, scene, e, sizes):
    done = command.run(f"textbook/{scene}", contact__restitution=e)
    assert haff.restitution_from(done.path).mean == pytest.approx(e, abs=1e-10)
    with done.open() as run:
        assert haff.restitution_from(run, "angles", masses=sizes).mean == pytest.approx(e, abs=1e-10)
        with pytest.raises(haff.NotApplicableError, match="nothing bounces on a wall"):
            haff.restitution_from(run, "times")


@pytest.mark.physics
def test_run_without_frames_or_events_is_an_error(command):
    done = command.run("textbook/bouncing_ball", output__events=False)
    with pytest.raises(haff.MissingDataError, match="no event log"):
        haff.restitution_from(done.path)
    done = command.run("textbook/bouncing_ball", output__frames=False)
    assert haff.restitution_from(done.path, "times").mean == pytest.approx(0.8, rel=1e-10)
    with pytest.raises(haff.MissingDataError, match="no frames"):
        haff.restitution_from(done.path, "heights")
