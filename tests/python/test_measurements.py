"""Profiles, correlations, the pressure tensor and forces on walls: in files, in live simulations and in figures."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest

import haff
from haff import analysis, figures, theory
from haff.errors import FileError, MissingDataError, NotApplicableError

FLUID = {
    "title": "fluid",
    "seed": 4,
    "domain": {"packing_fraction": 0.3},
    "species": [{"name": "grain", "count": 500, "radius": 0.5, "mass": 1.0}],
    "initial": {"positions": "lattice", "temperature": 1.0},
    "contact": {"restitution": 1.0},
    "run": {"until": 150.0},
    "output": {"frames": 15.0, "observables": 0.5},
    "measure": {
        "stress": True,
        "msd": True,
        "vacf": True,
        "stress_correlation": True,
        "interval": 0.02,
        "profiles": [
            {"axis": "z", "bins": 12, "interval": 5.0},
            {"axis": "xy", "bins": [4, 5], "interval": 25.0},
        ],
    },
}


@pytest.fixture(scope="module")
def fluid(tmp_path_factory):
    path = tmp_path_factory.mktemp("measured") / "fluid.h5"
    haff.run(FLUID, file=path)
    with haff.open(path) as run:
        yield run


def test_coefficients_of_transport_agree_with_each_other_and_with_theory(fluid):
    diffusion, viscosity = analysis.self_diffusion(fluid), analysis.shear_viscosity(fluid)
    # Speedy's fit is good to about 2 %, and the run adds as much.
    expected = float(theory.diffusion_speedy(theory.number_density(0.3, 1.0), 1.0))
    assert diffusion.einstein == pytest.approx(expected, rel=0.04)
    both = np.hypot(diffusion.einstein_error, diffusion.green_kubo_error)
    assert abs(diffusion.einstein - diffusion.green_kubo) < 4 * both
    enskog = float(theory.enskog_viscosity(theory.number_density(0.3, 1.0), 1.0))
    for value, error in (
        (viscosity.einstein, viscosity.einstein_error),
        (viscosity.green_kubo, viscosity.green_kubo_error),
    ):
        assert abs(value - enskog) < 4 * np.hypot(error, 0.02 * enskog), viscosity
        assert error < 0.25 * enskog


def test_pressure_tensor_has_the_trace_of_the_pressure_and_its_parts_add_up(fluid):
    table = fluid.observables.iloc[1:]
    trace = sum(table[f"pressure_tensor_{a}{a}"] for a in "xyz") / 3
    np.testing.assert_allclose(trace, table["pressure"], rtol=1e-12)
    parts = table["pressure_tensor_kinetic_xz"] + table["pressure_tensor_collisional_xz"]
    np.testing.assert_allclose(parts, table["pressure_tensor_xz"], rtol=1e-12, atol=1e-14)
    assert table["pressure_tensor_kinetic_xx"].mean() == pytest.approx(500 / fluid.box.volume, rel=0.01)
    data = fluid.to_xarray()
    assert data["pressure_tensor"].dims == ("time", "row", "column")
    assert data["pressure_tensor"].attrs["units"] == "energy/length^3"


def test_profiles_have_units_and_sum_to_the_number_of_particles(fluid):
    profile = fluid.profiles["z"]
    assert dict(profile.sizes) == {"time": 30, "z": 12, "component": 3, "row": 3, "column": 3}
    assert profile["density"].attrs["units"] == "1/length^3" and profile["z"].attrs["units"] == "length"
    cell = fluid.box.volume / 12
    np.testing.assert_allclose(profile["density"].sum("z") * cell, 500, rtol=1e-12)
    grid = fluid.profiles["xy"]
    assert grid["pressure"].dims == ("time", "x", "y", "row", "column")
    np.testing.assert_allclose(grid["y"], (np.arange(5) + 0.5) * fluid.box.size[1] / 5)
    np.testing.assert_allclose(grid["density"].sum(("x", "y")) * fluid.box.volume / 20, 500, rtol=1e-12)
    assert "profiles" in fluid and "profiles     xy, z" in repr(fluid)


def test_a_live_simulation_measures_what_a_file_records(fluid):
    live = haff.Simulation(FLUID)
    rows = []
    for time in (7.0, 80.0, 150.0):
        live.advance(time)
        rows.append(live.take_profiles()["z"])
    assert [len(part["time"]) for part in rows] == [1, 15, 14]
    np.testing.assert_array_equal(rows[1]["pressure"], fluid.profiles["z"]["pressure"][1:16])
    for name, recorded in fluid.correlations.items():
        assert live.correlations[name].identical(recorded), name


@pytest.mark.long
def test_means_of_profiles_have_errors(fluid):
    rows = fluid.profiles["z"].isel(time=slice(6, None))
    found = haff.analysis.profile_means(fluid, "z", start=float(fluid.profiles["z"]["time"][5]))
    assert set(found.data_vars) == {*rows.data_vars, *(f"{name}_error" for name in rows.data_vars)}
    assert found["temperature"].attrs == rows["temperature"].attrs and "time" not in found.coords
    for cell in range(rows.sizes["z"]):
        series = rows["pressure"].sel(row="z", column="z").isel(z=cell).to_numpy()
        expected = haff.analysis.mean(series)
        assert found["pressure"].sel(row="z", column="z").isel(z=cell) == expected.mean
        assert found["pressure_error"].sel(row="z", column="z").isel(z=cell) == expected.error > 0
    few = haff.analysis.profile_means(fluid, "z", start=float(fluid.profiles["z"]["time"][-4]))
    assert np.isnan(few["density_error"]).all() and np.isfinite(few["density"]).all()
    for wrong, told in (
        ({"axes": "y"}, "must be one of xy, z"),
        ({}, "axes: must be one"),
        ({"axes": "z", "start": 1e9}, "ends later"),
    ):
        with pytest.raises(haff.ArgumentError, match=told):
            haff.analysis.profile_means(fluid, **wrong)


@pytest.mark.long
def test_a_run_in_two_parts_writes_the_same_profiles_and_correlations(fluid, command, tmp_path):
    path = tmp_path / "parts.h5"
    haff.save_scene(FLUID, tmp_path / "fluid.toml")
    first = command("run", tmp_path / "fluid.toml", "-o", path, "--set", 'run.wall_time="0.1s"', "--quiet", "--json")
    assert json.loads(first.stdout)["stopped"] == "wall_time"
    for _ in range(100):
        rest = command("run", "--resume", path, "--quiet", "--json")
        if json.loads(rest.stdout)["stopped"] == "until":
            break
    with haff.open(path) as whole:
        for name in ("z", "xy"):
            assert whole.profiles[name].identical(fluid.profiles[name]), name
        for name in fluid.correlations:
            assert whole.correlations[name].identical(fluid.correlations[name]), name


def test_forces_on_walls_are_columns_by_wall_and_axis():
    scene = {
        "domain": {"size": [8.0, 8.0, 8.0], "boundary": ["periodic", "periodic", "wall"], "gravity": [0, 0, -1.0]},
        "species": [{"name": "grain", "count": 100, "radius": 0.5, "mass": 1.0}],
        "initial": {"positions": "lattice", "temperature": 1.0},
        "contact": {"restitution": 1.0},
        "run": {"until": 200.0},
        "measure": {"wall_forces": True},
    }
    live = haff.Simulation(scene)
    live.advance(20.0)
    before = live.sample()
    live.advance(200.0)
    after = live.sample()
    assert after["wall_force"].shape == (2, 3) and after["wall_heat_flow"].shape == (2,)
    # The walls balance the weight and the change of momentum.
    force = after["wall_force"].sum(axis=0)[2]
    gained = (after["momentum"] - before["momentum"])[2] / 180.0
    assert force == pytest.approx(-100.0 - gained, abs=1e-9)
    np.testing.assert_array_equal(after["wall_heat_flow"], 0.0)


def test_wall_forces_of_a_file_are_named_after_the_walls(tmp_path):
    path = tmp_path / "hot.h5"
    haff.run("configs/hot_wall.toml", file=path, run__until=5.0)
    with haff.open(path) as run:
        assert run.wall_names == ["z-", "z+"]
        assert {"wall_force_z-_z", "wall_heat_flow_z+"} <= set(run.observables)
        assert run.to_xarray()["wall_force"].dims == ("time", "wall", "axis")


@pytest.mark.long
def test_figures_of_measurements_are_drawn(fluid, tmp_path):
    results = figures.save_all(fluid, ["profiles", "msd", "stress"], tmp_path)
    for result in results:
        assert result.path is not None, result
        assert result.path.stat().st_size > 10_000


@pytest.mark.long
def test_figures_of_maps_are_drawn(tmp_path):
    path = tmp_path / "map.h5"
    measure = {"profiles": [{"axis": "xz", "bins": [6, 8], "interval": 1.0}]}
    haff.run({**FLUID, "measure": measure}, file=path, run__until=5.0)
    with haff.open(path) as run:
        assert figures.draw(run, "profiles").axes
        with pytest.raises(MissingDataError, match="no correlations"):
            figures.draw(run, "msd")


def test_files_without_measurements_name_the_keys_that_they_lack(command):
    with command.run("cooling", run__collisions_per_particle=1.0, species__0__count=100).open() as run:
        assert "profiles" not in run and "correlations" not in run
        with pytest.raises(MissingDataError, match=r"measure\.profiles"):
            _ = run.profiles
        with pytest.raises(MissingDataError, match=r"measure\.msd"):
            _ = run.correlations


@pytest.mark.parametrize(
    ("place", "change", "message"),
    [
        ("profiles/q", lambda f: f.move("profiles/z", "profiles/q"), "must be named by axes"),
        ("correlations/odd", lambda f: f.move("correlations/msd", "correlations/odd"), "must be one of msd"),
        ("profiles/z/density/value", lambda f: f.__delitem__("profiles/z/density/value"), "profiles/z/density/value"),
        ("correlations/msd/lag", lambda f: f["correlations/msd/lag"].__setitem__(3, -1.0), "at least the one before"),
        ("profiles/z/position", lambda f: f["profiles/z/position/value"].__setitem__(0, np.inf), "a number of up to"),
    ],
)
def test_damaged_measurements_are_refused(fluid, tmp_path, place, change, message):
    path = tmp_path / "damaged.h5"
    path.write_bytes(fluid.path.read_bytes())
    with h5py.File(path, "r+") as file:
        change(file)
    with haff.open(path) as run, pytest.raises((FileError, MissingDataError), match=message):
        _ = run.profiles, run.correlations


@pytest.mark.long
def test_structure_factor_of_a_fluid_is_that_of_percus_and_yevick(fluid):
    frames = analysis.drawn_frames(fluid, 10)
    k, found = analysis.structure_factor(frames, 12.0, 24)

    def percus_yevick(q: np.ndarray, phi: float) -> np.ndarray:
        # M. S. Wertheim, Phys. Rev. Lett. 10, 321 (1963): the direct correlation function is a cubic.
        a = (1 + 2 * phi) ** 2 / (1 - phi) ** 4
        b = -6 * phi * (1 + phi / 2) ** 2 / (1 - phi) ** 4
        x = np.linspace(1e-6, 1, 4001)
        direct = -(a + b * x + 0.5 * phi * a * x**3)
        integral = np.trapezoid(direct * x * np.sin(np.outer(q, x)) / q[:, None], x, axis=1)
        return 1 / (1 - 24 * phi * integral)

    # Ten frames of 500 particles, some fifty waves a bin.
    np.testing.assert_allclose(found, percus_yevick(k, 0.3), atol=0.15)
    with pytest.raises(NotApplicableError, match="k_max"):
        analysis.structure_factor(frames, 0.1, 4)


def test_clusters_are_counted_across_periodic_faces_only(fluid):
    frame = fluid.frames[0]
    spacing = frame.box.size[0] / 8
    assert analysis.cluster_sizes(frame, 0.99 * spacing)[0] < 500
    assert analysis.cluster_sizes(frame, 1.01 * spacing).sum() == 500
    line = {
        "domain": {"size": [10.0, 5.0, 5.0], "boundary": ["wall", "periodic", "periodic"]},
        "particle": [{"position": [x, 2.5, 2.5], "radius": 0.5, "mass": 1.0} for x in (0.6, 1.7, 9.4)],
        "run": {"until": 1.0},
    }
    live = haff.Simulation(line)

    class Still:
        position, box, file = live.positions, live.box, fluid

    assert list(analysis.cluster_sizes(Still, 1.2)) == [2, 1]


def test_velocities_of_an_elastic_fluid_have_maxwells_distribution(fluid):
    frames = analysis.drawn_frames(fluid, 10)
    x, density = analysis.velocity_histogram(frames, bins=21, reach=2.5)
    expected = np.exp(-(x**2)) / np.sqrt(np.pi)
    width = x[1] - x[0]
    error = np.sqrt(expected / (width * 15_000))
    assert np.sum(((density - expected) / error) ** 2) < 21 + 4 * np.sqrt(42)
