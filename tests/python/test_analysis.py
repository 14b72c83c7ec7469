"""Overlaps, energies and statistics against values computed independently."""

import json
import subprocess

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import haff
import synthetic
from haff import Box, analysis
from validation.runs import executable


class Particles:
    """A substitute for a frame."""

    def __init__(self, position, radius, size, boundary=("periodic",) * 3, mass=None, dimension=3):
        self.position = np.asarray(position, float)
        self.radius = np.asarray(radius, float)
        self.mass = np.ones(len(self.radius)) if mass is None else np.asarray(mass, float)
        self.box = Box(size, boundary, dimension)

    @property
    def peculiar_velocity(self):
        return self.velocity


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 40), st.sampled_from(["ppp", "ppn", "nnn"]), st.booleans())
def test_max_overlap_equals_that_of_all_pairs(seed, n, axes, wide):
    rng = np.random.default_rng(seed)
    size = np.array([10.0, 9.0, 11.0]) if wide else np.array([2.0, 2.2, 1.9])
    radius = rng.uniform(0.1, 0.9, n)
    boundary = [{"p": "periodic", "n": "none"}[a] for a in axes]
    frame = Particles(rng.random((n, 3)) * size, radius, size, boundary)
    gap = frame.position[:, None] - frame.position[None, :]
    periodic = frame.box.periodic
    gap[..., periodic] -= np.round(gap[..., periodic] / size[periodic]) * size[periodic]
    contact = radius[:, None] + radius[None, :]
    depth = (contact - np.linalg.norm(gap, axis=-1)) / contact
    np.fill_diagonal(depth, -np.inf)
    found = analysis.max_overlap(frame)
    if depth.max() > 0:
        assert found.depth == pytest.approx(depth.max(), abs=1e-12)
        assert depth[found.pair] == pytest.approx(depth.max(), abs=1e-12)
    else:
        assert found.depth <= 0


def test_overlap_is_found_across_a_periodic_face_and_not_across_a_wall():
    position = [[0.1, 5, 5], [9.5, 5, 5]]
    periodic = analysis.max_overlap(Particles(position, [0.5, 0.5], [10, 10, 10]))
    assert periodic.depth == pytest.approx(0.4, abs=1e-12) and periodic.pair == (0, 1)
    walls = analysis.max_overlap(Particles(position, [0.5, 0.5], [10, 10, 10], ("none",) * 3))
    assert walls.depth < 0


def test_overlap_of_fixed_bodies_is_ignored():
    position = [[1, 1, 1], [1.2, 1, 1], [5, 5, 5]]
    frame = Particles(position, [0.5] * 3, [10, 10, 10], mass=[np.inf, np.inf, 1])
    assert analysis.max_overlap(frame).depth < 0


def test_velocity_distribution_of_fixed_bodies_is_not_applicable():
    frame = Particles([[1, 1, 1], [5, 5, 5]], [0.5] * 2, [10, 10, 10], mass=[np.inf, np.inf])
    for what in (analysis.scaled_velocities, analysis.sonine_a2):
        with pytest.raises(haff.NotApplicableError, match="no body of finite mass"):
            what(frame)
    assert np.isnan(analysis.temperature(frame))


def test_kinetic_energy_overflow_is_an_error():
    frame = Particles([[1, 1, 1], [5, 5, 5]], [0.5] * 2, [10, 10, 10], mass=[1e100, 1e100])
    frame.velocity = np.full((2, 3), 1e100)
    assert analysis.kinetic_energy(frame) == pytest.approx(3e300)
    frame.velocity *= 1e4
    with pytest.raises(haff.NotApplicableError, match="too large"):
        analysis.kinetic_energy(frame)


def test_kinetic_energy_and_temperature_of_frames_are_those_of_the_samples(files):
    with haff.open(files["cooling"]) as run:
        table = run.observables.set_index("time")
        for frame in run.frames:
            T = table.loc[frame.time, "temperature"]
            assert analysis.temperature(frame) == pytest.approx(T, rel=1e-12)
            assert analysis.temperature(frame, species=0) == pytest.approx(T, rel=1e-12)
            assert analysis.kinetic_energy(frame) == pytest.approx(table.loc[frame.time, "kinetic_energy"], rel=1e-12)


@pytest.mark.parametrize(("name", "d"), [("cooling", 3), ("disks", 2)])
def test_sonine_coefficient_of_the_frames_is_that_of_the_velocities_drawn(files, name, d):
    with haff.open(files[name]) as run:
        found = [analysis.sonine_a2(f) for f in run.frames[1:]]
    mean, error = np.mean(found), np.std(found, ddof=1) / np.sqrt(len(found))
    expected = float(haff.theory.sonine_a2(0.9, d))
    assert abs(mean - expected) < 4 * error, f"a₂ = {mean:.4f} ± {error:.4f}, theory {expected:.4f}"


def test_block_average_error_is_that_of_the_means_of_blocks():
    """Means 1, 2, 4 and 9 of four blocks: 4 with the error √(38/3)/√4; a remainder at the start is left out."""
    series = [100.0, 0.0, 2.0, 1.0, 3.0, 4.0, 4.0, 8.0, 10.0]
    found = analysis.block_average(series, 4)
    assert found.mean == 4.0
    assert found.error == pytest.approx(np.sqrt(38 / 3) / 2, rel=1e-15)
    weighted = analysis.block_average(series, 4, weights=[1.0, 3.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    assert weighted.mean == pytest.approx((0.5 + 2 + 4 + 9) / 4, rel=1e-15)


def test_block_average_error_includes_correlations():
    rng = np.random.default_rng(5)
    white, series = rng.normal(size=200_000), np.zeros(200_000)
    for k in range(1, len(series)):
        series[k] = 0.98 * series[k - 1] + white[k]
    naive = series.std() / np.sqrt(len(series))
    found = analysis.block_average(series, 20)
    # Exact error of the mean of this process: σ_white/((1 − 0.98)√n) = 9.95 times the naive one.
    exact = 1 / 0.02 / np.sqrt(len(series))
    assert 0.5 < found.error / exact < 1.7 and found.error > 5 * naive
    assert abs(found.z(0.0)) < 4
    with pytest.raises(ValueError, match="too few"):
        analysis.block_average([1.0, 2.0], 20)


def test_means_leave_out_the_start_and_say_what_drifts():
    rng = np.random.default_rng(6)
    white, series = rng.normal(size=20_000), np.zeros(20_000)
    for k in range(1, len(series)):
        series[k] = 0.95 * series[k - 1] + white[k]
    found = analysis.mean(series)
    # Exact error of the mean of this process.
    exact = 20 / np.sqrt(len(series))
    assert found.error == pytest.approx(exact, rel=0.2) and abs(found.z(0.0)) < 4
    assert found.independent == pytest.approx(len(series) / 39, rel=0.4) and not found.drifts
    relaxing = np.concatenate([[np.nan], series + 200 * np.exp(-np.arange(20_000) / 300)])
    found = analysis.mean(relaxing)
    assert 1000 < found.start < 5000 and abs(found.z(0.0)) < 4 and not found.drifts
    assert analysis.mean(series + 1e-3 * np.arange(20_000)).drifts
    assert np.isnan(analysis.mean([1.0, 2.0]).error)
    for wrong in ([], [np.nan], [1.0, np.inf], [[1.0, 2.0]]):
        with pytest.raises(haff.errors.ArgumentError, match="must be one series of finite numbers"):
            analysis.mean(wrong)


def test_means_of_a_run_have_errors_and_names(tmp_path):
    scene = {
        "seed": 2,
        "domain": {"packing_fraction": 0.1},
        "species": [{"name": "atom", "count": 200, "radius": 0.5, "mass": 1.0, "temperature": 1.0}],
        "contact": {"restitution": 1.0},
        "run": {"until": 40.1},
        "output": {"observables": 0.2, "frames": False},
    }
    with haff.run(scene, file=tmp_path / "gas.h5").file as run:
        means = run.means
        assert set(means.index) == set(run.observables.columns) - {"time", "step"}
        pressure = means.loc["pressure"]
        # The first value is NaN, and the last interval is shorter than the others.
        expected = analysis.mean(run.samples["pressure"][1:-1])
        assert pressure["mean"] == pytest.approx(expected.mean, rel=1e-12)
        assert pressure["error"] == pytest.approx(expected.error, rel=1e-9)
        assert pressure["start"] == pytest.approx(run.samples["time"][1 + expected.start] - 0.2, abs=1e-9)
        # The momentum is zero, so the pressure is that of N − 1 particles.
        ideal = 199 / run.box.volume * means.loc["temperature", "mean"]
        z = float(haff.theory.compressibility(0.1)) * ideal
        assert abs(pressure["mean"] - z) < 4 * pressure["error"] and not pressure["drifts"]
        done = subprocess.run([executable(), "info", run.path, "--json"], capture_output=True, text=True, check=True)
        report = json.loads(done.stdout)["means"]
        for name in ("pressure", "temperature", "collision_rate", "mean_free_time", "sonine_a2"):
            assert report[name] == means.loc[name].to_dict(), name
        assert means.loc["kinetic_energy", "error"] < 1e-12 and means.loc["collisions", "drifts"]
    # Samples at the times of frames, too, and times in a geometric series.
    for output in ({"observables": 0.2, "frames": 0.31}, {"observables": {"log": [0.1, 1.02]}, "frames": False}):
        with haff.run({**scene, "output": output}, file=tmp_path / f"{len(output)}.h5", overwrite=True).file as run:
            other = run.means.loc["pressure"]
            assert abs(other["mean"] - z) < 4 * other["error"], output
            assert other["error"] < 3 * pressure["error"], output


def test_pair_distribution_of_an_ideal_gas_is_one(tmp_path):
    rng = np.random.default_rng(2)
    n, side = 4000, 20.0
    path = synthetic.write(
        tmp_path / "ideal.h5",
        scene="[domain]\nsize = [20.0, 20.0, 20.0]\n",
        size=[side] * 3,
        boundary=["periodic"] * 3,
        mass=np.ones(n),
        radius=np.full(n, 0.5),
        species=np.zeros(n),
        frames={
            "time": np.arange(3.0),
            "step": np.arange(3),
            "position": rng.random((3, n, 3)) * side,
            "velocity": rng.normal(size=(3, n, 3)),
            "image": np.zeros((3, n, 3), np.int32),
        },
    )
    with haff.open(path) as run:
        r, g = analysis.radial_distribution(run.frames, 5.0, 25)
        shell = 4 * np.pi * r**2 * 0.2 * n / side**3 * n * 3 / 2
        z = (g - 1) * np.sqrt(shell)
        assert np.all(np.abs(z[shell > 20]) < 5) and abs(np.mean(z)) < 1, f"z = {z}"
        with pytest.raises(haff.NotApplicableError, match="too small"):
            analysis.radial_distribution(run.frames, 10.0, 25)


def test_cooling_law_error_gives_the_reason_where_it_does_not_apply(files):
    with haff.open(files["ball"]) as run, pytest.raises(haff.NotApplicableError, match="periodic"):
        analysis.cooling_law(run)


def test_cooling_law_of_a_mixture_tends_to_that_of_one_species(files, tmp_path):
    with haff.open(files["cooling"]) as run:
        pure = analysis.cooling_law(run)
        nearly = haff.open(files["cooling"])
        vars(nearly)["radius"] = run.radius * np.where(np.arange(len(run)) % 2, 1 + 1e-9, 1.0)
        mixed = analysis.cooling_law(nearly)
        nearly.close()
    assert pure.monodisperse and not mixed.monodisperse
    assert mixed.omega0 == pytest.approx(pure.omega0, rel=1e-7)
    assert mixed.tau == pytest.approx(pure.tau * (1 + 3 * pure.a2 / 16), rel=1e-7)


def test_mdanalysis_universe_has_trajectory_masses_and_radii(files):
    pytest.importorskip("MDAnalysis")
    with haff.open(files["cooling"]) as run:
        universe = run.to_mdanalysis()
        assert len(universe.trajectory) == len(run.frames)
        for step, frame in zip(universe.trajectory[2:5], run.frames[2:5]):
            assert np.allclose(universe.atoms.positions, frame.position, atol=1e-4)
            assert np.allclose(step.velocities, frame.velocity, atol=1e-5)
            assert np.allclose(step.dimensions[:3], run.box.size, rtol=1e-6)
            assert step.time == pytest.approx(frame.time)
        assert set(universe.atoms.types) == {"grain"} and np.all(universe.atoms.radii == 0.5)
