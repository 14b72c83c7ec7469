"""Conduction of heat between two thermal walls, from the profile and the heat of the walls."""

import numpy as np
import pytest

import haff
from conftest import CONFIGS
from haff import analysis, theory

SETTINGS = {
    "species__atom__radius": 0.5,
    "species__atom__count": 1600,
    "measure__wall_forces": True,
    "measure__profiles": [{"axis": "x", "bins": 40, "interval": 50.0, "samples": 50}],
    "wall__x+__accommodation": 1.0,
    "run__until": 2000.0,
    "output__frames": 1000.0,
}


@pytest.mark.long
@pytest.mark.physics
def test_the_conductivity_of_a_moderately_dense_gas_is_enskogs(tmp_path):
    with haff.run(CONFIGS / "thermal_walls.toml", file=tmp_path / "run.h5", **SETTINGS) as run:
        found = analysis.heat_conduction(run.file)
    expected = theory.thermal_conductivity(found.density, 1.0, found.temperature)
    # λ ∝ √T varies by 40 % over the profile, so that its mean is that of the middle to a percent.
    assert abs(found.conductivity.z(expected, 0.01 * expected)) < 4
    assert found.conductivity.error < 0.1 * expected
    # The jumps of a dilute gas are longer, by about n σ³ = 0.1 of them; half of that is not known.
    for jump, density in ((found.hot_jump, found.hot_density), (found.cold_jump, found.cold_density)):
        dilute = theory.temperature_jump(density, 1.0)
        assert abs(jump.z(0.9 * dilute, 0.05 * dilute)) < 4
    assert found.hot_density < found.density < found.cold_density
    assert found.temperature == pytest.approx(1.5, abs=0.1)


def conducting(path, n_rows, noise):
    """A run in whose profile T^(3/2) is linear between 2 and 1 at distances of 3 and 2 behind the walls."""
    extent, radius = 40.0, 0.5
    x = np.arange(0.5, extent)
    low, high = radius - 3.0, extent - radius + 2.0
    T = (2**1.5 + (1 - 2**1.5) * (x - low) / (high - low)) ** (2 / 3)
    import xarray

    rng = np.random.default_rng(4)
    rows = T * (1 + noise * rng.normal(size=(n_rows, len(x))))
    time = np.arange(1.0, n_rows + 1)
    profile = xarray.Dataset(
        {"temperature": (("time", "x"), rows), "density": (("time", "x"), np.tile(0.15 / T, (n_rows, 1)))},
        {"time": time, "x": x},
    )
    from types import SimpleNamespace

    walls = [{"name": "x-", "temperature": 2.0}, {"name": "x+", "temperature": 1.0}]
    box = SimpleNamespace(
        size=np.array([extent, 20.0, 20.0]), volume=extent * 400.0, boundary=("wall", *["periodic"] * 2)
    )
    samples = {"time": time, "wall_heat_flow_x-": np.full(n_rows, 8.0), "wall_heat_flow_x+": np.full(n_rows, -8.0)}
    return SimpleNamespace(
        path=path, scene={"wall": walls}, box=box, samples=samples, profiles={"x": profile}, dimension=3,
        radius=np.full(10, radius), mass=np.ones(10),
    )  # fmt: skip


def test_a_known_profile_gives_its_gradient_and_jumps():
    from haff.analysis import conduction

    run = conducting("run.h5", 200, 1e-3)
    found = conduction.heat_conduction.__wrapped__(run)
    assert found.flux == pytest.approx((0.02, 0.0), abs=1e-12)
    slope = (2**1.5 - 1) / 44.0
    middle = (2**1.5 - slope * 22.5) ** (2 / 3)
    gradient = slope / (1.5 * np.sqrt(middle))
    assert found.temperature == pytest.approx(middle, rel=1e-3)
    assert abs(found.gradient.z(gradient)) < 4 and found.gradient.error < 0.01 * gradient
    assert found.conductivity.mean == pytest.approx(0.02 / found.gradient.mean)
    # T − T_wall over the slope where centers touch the wall.
    for jump, wall, T32 in ((found.hot_jump, 2.0, 2**1.5 - slope * 3.0), (found.cold_jump, 1.0, 1 + slope * 2.0)):
        T = T32 ** (2 / 3)
        assert abs(jump.z(abs(T - wall) / (slope / (1.5 * np.sqrt(T))))) < 4 and jump.error < 0.5
    assert found.density == pytest.approx(0.15 / middle, rel=0.02)


def test_what_is_missing_is_said(files, tmp_path):
    with haff.open(files["cooling"]) as run, pytest.raises(haff.NotApplicableError, match="no two opposite walls"):
        analysis.heat_conduction(run)
    scene = CONFIGS / "thermal_walls.toml"
    with haff.run(scene, file=tmp_path / "a.h5", run__until=1.0) as run:
        with pytest.raises(haff.MissingDataError, match="no profile"):
            analysis.heat_conduction(run.file)
        with pytest.raises(haff.ArgumentError, match=r"margin = 0\.5: must be"):
            analysis.heat_conduction(run.file, margin=0.5)
    profiles = [{"axis": "x", "bins": 40, "interval": 0.1, "samples": 2}]
    with haff.run(scene, file=tmp_path / "b.h5", run__until=1.0, measure__profiles=profiles) as run:
        with pytest.raises(haff.MissingDataError, match="no heat of walls"):
            analysis.heat_conduction(run.file)
