"""Boxes that are compressed, and particles that grow: what files and Python say of them, and what theory says."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

import haff
from haff import analysis, theory
from haff.analysis.pressures import _Rows
from haff.errors import FileError

pytestmark = pytest.mark.physics

DOMAINS = {
    "periodic": {"packing_fraction": 0.1, "compression": {"rate": 0.05}},
    "rates": {"packing_fraction": 0.1, "compression": {"rates": [0.08, -0.05, 0.02]}},
    "mixed": {
        "size": [12.0, 12.0, 14.0],
        "boundary": ["periodic", "wall", "periodic"],
        "compression": {"rates": [0.05, 0.04, -0.03]},
    },
    "walls": {"size": [12.0, 12.0, 14.0], "boundary": ["wall"] * 3, "compression": {"rate": 0.03}},
    "disks": {"packing_fraction": 0.2, "compression": {"rates": [0.04, -0.02]}},
    "growth": {"packing_fraction": 0.1},
}


def scene(name):
    """A gas in one of the boxes."""
    found = {
        "schema": 1,
        "seed": 1,
        "dimension": 2 if name == "disks" else 3,
        "domain": DOMAINS[name],
        "species": [{"name": "grain", "count": 200, "radius": 0.5, "mass": 1.0}],
        "initial": {"positions": "random", "temperature": 1.0},
        "contact": {"restitution": 0.95},
        "run": {"until": 4.0},
        "output": {"frames": 0.5, "observables": 0.5},
    }
    if name == "growth":
        found |= {"contact": {"restitution": 1.0}, "growth": {"rate": 0.05, "temperature": 1.0}}
    return found


@pytest.fixture(scope="module", params=DOMAINS)
def compressed(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("compressed") / "run.h5"
    haff.run(scene(request.param), file=path, threads=1)
    with haff.open(path) as run:
        yield request.param, run


def test_edges_of_frames_are_those_of_the_rates(compressed):
    name, run = compressed
    wanted = DOMAINS[name].get("compression", {"rate": 0.05})
    rates = np.zeros(3)
    rates[: run.dimension] = wanted.get("rates", wanted.get("rate"))
    np.testing.assert_allclose(run.compression, rates, rtol=1e-15)
    for frame in run.frames:
        np.testing.assert_allclose(frame.box.size, run.box.size * (1 - rates * frame.time), rtol=1e-12)
        assert (frame.position[:, : run.dimension] <= frame.box.size[: run.dimension] * (1 + 1e-12)).all()


def test_temperature_is_that_of_peculiar_velocities(compressed):
    _, run = compressed
    samples, d = run.samples, run.dimension
    # Where particles grow there are more rows than frames.
    rows = np.searchsorted(samples["time"], run.frames.time)
    np.testing.assert_array_equal(samples["time"][rows], run.frames.time)
    for row, frame in zip(rows, run.frames):
        found = np.sum(frame.mass[:, None] * frame.thermal_velocity**2) / (d * len(run))
        assert found == pytest.approx(samples["temperature"][row], rel=1e-12)
        assert analysis.temperature(frame) == pytest.approx(found, rel=1e-12)


def test_only_periodic_axes_have_a_flow(compressed):
    _, run = compressed
    frame = run.frames[-1]
    flow = frame.velocity - frame.peculiar_velocity
    moving = run.compression != 0
    along = run.box.periodic & moving
    assert (flow[:, ~along] == 0).all()
    expected = -run.compression / (1 - run.compression * frame.time) * frame.position
    np.testing.assert_allclose(flow[:, along], expected[:, along], atol=1e-14)


def test_live_simulation_has_the_box_of_the_file(compressed):
    name, run = compressed
    live = haff.Simulation(scene(name), threads=1)
    live.advance(run.frames[-1].time)
    np.testing.assert_allclose(live.box.size, run.frames[-1].box.size, rtol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rates = [0.04, -0.02]", "rates = [0.04, -0.02]\n[growth]\nrate = 1e30", "box has no volume"),
        ("dimension = 2", "dimension = 3", r"domain.compression.rates = \[0.04, -0.02\]: must be 3 numbers"),
    ],
)
def test_scenes_that_no_run_has_had_are_refused(tmp_path, old, new, message):
    path = tmp_path / "damaged.h5"
    haff.run(scene("disks"), file=path, threads=1)
    with h5py.File(path, "r+") as file:
        text = file["parameters/scene"][()].decode()
        assert old in text
        del file["parameters/scene"]
        file["parameters/scene"] = text.replace(old, new)
        if "3" in new:
            file["parameters/dimension"][()] = 3
    with haff.open(path) as run, pytest.raises(FileError, match=message):
        _ = run.frames[-1].peculiar_velocity


@pytest.mark.parametrize(("rate", "interval", "accuracy"), [(0.003, 0.01, 0.01), (0.03, 1e-3, 0.01), (0.1, 3e-4, 0.05)])
def test_pressure_between_distant_rows_is_that_of_close_ones(tmp_path, rate, interval, accuracy):
    given = scene("growth") | {"run": {}}
    given["domain"] = {"packing_fraction": 0.4}
    given["growth"] = {"rate": rate, "temperature": 1.0, "until_reduced_pressure": 1e4}
    given["output"] = {"frames": 1e3, "observables": interval}
    haff.run(given, file=tmp_path / "run.h5", threads=1)
    with haff.open(tmp_path / "run.h5") as run:
        fine = _Rows(run)
        _, rows = np.unique(fine.collisions // (5 * len(run)), return_index=True)
        expected = fine.means(rows)
        # The same run with rows after every ten collisions of a particle only.
        coarse = _Rows(run)
        steps = np.diff(fine.time)
        products = np.add.reduceat((fine.pressure * fine.volume)[1 : rows[-1] + 1] * steps[: rows[-1]], rows[:-1])
        for name in ("time", "temperature", "volume", "collisions", "packing_fraction"):
            setattr(coarse, name, getattr(fine, name)[rows])
        coarse.pressure = np.array([np.nan, *(products / np.diff(coarse.time) / coarse.volume[1:])])
        error = coarse.means(np.arange(len(rows))) / expected - 1
        assert np.sqrt(np.mean(error**2)) < accuracy, f"{error}"
        # The mean of the temperatures of both rows is worse.
        between = (coarse.temperature[1:] + coarse.temperature[:-1]) / 2
        simple = coarse.pressure[1:] * coarse.volume[1:] / (len(run) * between) / expected - 1
        assert np.mean(error**2) < 0.5 * np.mean(simple**2)
        found = analysis.reduced_pressures(run)
        np.testing.assert_allclose(found.value, expected, rtol=1e-12)
        assert found.value[-1] == pytest.approx(analysis.reduced_pressure(run.frames[-1]), rel=0.3)


def test_gas_under_a_piston_is_heated_as_in_a_reversible_compression(command):
    with command.run("compression").open() as run:
        T, phi, volume = (run.samples[name] for name in ("temperature", "packing_fraction", "box_volume"))
        edge = volume / np.prod(run.box.size[1:])
        # Centers are between planes that are one diameter less apart than the walls.
        compressibility = theory.compressibility(phi * edge / (edge - 1))
        exponent = np.sum((compressibility[1:] + compressibility[:-1]) / 2 * np.diff(np.log(edge - 1)))
        expected = float(np.exp(-2 / 3 * exponent))
        assert T[-1] == pytest.approx(expected, rel=0.005), f"{T[-1]}, reversible {expected}"
        assert run.samples["wall_work"][-1] == pytest.approx(1.5 * len(run) * (T[-1] - T[0]), rel=1e-9)
        assert run.frames[-1].box.size[0] == pytest.approx(run.box.size[0] / 2, rel=1e-12)


@pytest.mark.long
def test_elongation_has_the_viscosity_of_enskog(command):
    ratios = []
    for seed in range(4):
        with command.run("elongation", seed=seed, output__frames=False).open() as run:
            rows, gamma = run.observables.iloc[20:], run.compression
            rates = -gamma / (1 - gamma * rows["time"].to_numpy()[:, None])
            density = rows["packing_fraction"] / (np.pi / 6)
            viscosity = theory.enskog_viscosity(density, 1.0, rows["temperature"])
            difference = rows["pressure_tensor_yy"] - rows["pressure_tensor_xx"]
            ratios.append(difference.sum() / np.sum(2 * viscosity * (rates[:, 0] - rates[:, 1])))
    error = np.std(ratios, ddof=1) / 2
    # Enskog's viscosity is right to 3 % here.
    assert abs(np.mean(ratios) - 1) < 0.03 + 3 * max(error, 0.02), f"{ratios}"
