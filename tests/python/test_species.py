"""Measurements and analyses by species."""

from __future__ import annotations

import numpy as np
import pytest

import haff
from haff import analysis, figures
from haff.errors import ArgumentError, MissingDataError, NotApplicableError, SceneError

SCENE = {
    "seed": 4,
    "domain": {"size": [10.0, 10.0, 12.0], "boundary": ["periodic", "periodic", "wall"]},
    "species": [
        {"name": "grain", "count": 200, "radius": 0.4, "mass": 1.0, "region": {"box": [[0, 0, 0], [10, 10, 6]]}},
        {"name": "dust", "count": 100, "radius": 0.3, "mass": 0.4, "region": {"box": [[0, 0, 6], [10, 10, 12]]}},
        {"name": "pin", "count": 1, "radius": 0.5, "mass": float("inf")},
    ],
    "initial": {"temperature": 1.0},
    "contact": {"restitution": 0.95},
    "drive": [{"kind": "andersen", "temperature": 1.0, "rate": 0.05}],
    "measure": {
        "profiles": [
            {"axis": "z", "bins": 6, "interval": 1.0, "species": "each"},
            {"axis": "xz", "bins": [2, 3], "interval": 2.0, "species": ["dust"]},
        ],
        "pair_collisions": True,
        "msd": {"species": ["dust", "grain"]},
        "vacf": True,
        "interval": 0.1,
    },
    "run": {"until": 30.0},
    "output": {"frames": 1.0, "observables": 0.5},
}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("species") / "run.h5"
    haff.run(SCENE, file=path)
    with haff.open(path) as file:
        yield file


def test_profiles_have_fields_of_species_that_add_up(run):
    profile = run.profiles["z"]
    assert list(profile.species.to_numpy()) == ["grain", "dust"]
    assert profile.species_pressure.dims == ("time", "species", "z", "row", "column")
    assert profile.species_density.attrs["units"] == "1/length^3"
    for field in ("density", "mass_density", "pressure"):
        total = profile[f"species_{field}"].sum("species")
        assert np.allclose(total, profile[field], rtol=1e-12, atol=1e-13)
    energy = (profile.species_density * profile.species_temperature).fillna(0).sum("species")
    assert np.allclose(energy, (profile.density * profile.temperature).fillna(0), rtol=1e-11)
    assert list(run.profiles["xz"].species.to_numpy()) == ["dust"]


def test_displacements_have_a_curve_for_each_species(run):
    msd = run.correlations["msd"]
    assert msd.value.dims == ("lag", "species")
    assert list(msd.species.to_numpy()) == ["dust", "grain"]
    # Lighter grains are faster.
    first = msd.value[0]
    assert float(first.sel(species="dust")) > 1.5 * float(first.sel(species="grain"))
    assert run.correlations["vacf"].value.dims == ("lag",)
    with pytest.raises(ArgumentError, match="name one by species=…: dust, grain"):
        analysis.self_diffusion(run)
    with pytest.raises(ArgumentError, match="has curves of dust, grain"):
        analysis.self_diffusion(run, species="pin")


def test_a_live_simulation_has_the_same(run):
    simulation = haff.Simulation(SCENE)
    simulation.advance(30.0)
    profile, msd = simulation.take_profiles()["z"], simulation.correlations["msd"]
    assert profile.equals(run.profiles["z"])
    assert msd.equals(run.correlations["msd"])


def test_rates_of_pairs_of_species(run):
    table, dataset = run.observables.iloc[1:], run.to_xarray()
    rate = dataset.pair_collision_rate
    assert rate.dims == ("time", "species", "partner") and rate.attrs["units"] == "1/time"
    between = table["pair_collision_rate_grain_dust"]
    assert np.array_equal(between, table["pair_collision_rate_dust_grain"])
    names = ["grain", "dust", "pin"]
    pairs = [f"pair_collision_rate_{a}_{b}" for k, a in enumerate(names) for b in names[k:]]
    assert np.allclose(table[pairs].sum(axis=1), table["collision_rate"])
    ended = table["pair_collision_rate_dust_dust"] * 2 + between + table["pair_collision_rate_dust_pin"]
    assert np.allclose(table["species_mean_free_time_dust"], 100 / ended)
    assert np.isnan(table["species_mean_free_time_pin"]).all()


def test_species_mix(run):
    found = analysis.mixing(run, "dust", "z")
    assert found.concentration.shape == (30, 6)
    # At first the dust is in the upper half; then the species mix.
    assert found.index[0] < 0.35 < 0.8 < found.index[-1]
    assert np.allclose(found.mean, 1 / 3, atol=0.02)
    other = analysis.mixing(run, "grain")
    assert np.allclose(other.index, found.index)
    with pytest.raises(ArgumentError, match="several profiles"):
        analysis.mixing(run, "dust")
    with pytest.raises(MissingDataError, match="no profile has fields of"):
        analysis.mixing(run, "pin")


def test_analyses_of_frames_take_a_species_by_name_or_index(run):
    frame = run.frames[-1]
    T = run.observables.iloc[-1]
    assert analysis.temperature(frame, "dust") == analysis.temperature(frame, 1)
    assert analysis.temperature(frame, "dust") == pytest.approx(T["species_temperature_dust"], rel=1e-12)
    velocity = analysis.scaled_velocities(frame, "dust")
    assert velocity.shape == (100, 3)
    assert np.mean(velocity**2) == pytest.approx(0.5)
    centers, density = analysis.velocity_histogram([frame], bins=21, species="grain")
    assert np.sum(density) * (centers[1] - centers[0]) == pytest.approx(1.0)
    layers = [analysis.height_profile(run.frames[5:], 6, species=name) for name in ("grain", "dust")]
    both = analysis.height_profile(run.frames[5:], 6)
    assert np.array_equal(layers[0].count + layers[1].count, both.count)
    with pytest.raises(ArgumentError, match="no species has this name; there are grain, dust, pin"):
        analysis.temperature(frame, "sand")
    with pytest.raises(NotApplicableError, match="no body of finite mass"):
        analysis.scaled_velocities(frame, "pin")


def test_partial_structure_factors_add_up(tmp_path):
    scene = {
        "domain": {"size": [8.0, 8.0, 8.0]},
        "species": [
            {"name": "a", "count": 60, "radius": 0.4, "mass": 1.0},
            {"name": "b", "count": 40, "radius": 0.5, "mass": 1.0},
        ],
        "initial": {"positions": "random", "temperature": 1.0},
        "run": {"until": 5.0},
        "output": {"frames": 5.0},
    }
    haff.run(scene, file=tmp_path / "mixture.h5")
    with haff.open(tmp_path / "mixture.h5") as run:
        frame = run.frames[-1]
        options = {"k_max": 6.0, "bins": 12, "most_waves": 50}
        total = analysis.static_structure([frame], **options)
        aa, bb = (analysis.static_structure([frame], **options, species=name) for name in ("a", "b"))
        ab = analysis.static_structure([frame], **options, species=("a", "b"))
        # Σ √(x_a x_b) S_ab, Ashcroft and Langreth.
        added = 0.6 * aa.value + 0.4 * bb.value + 2 * np.sqrt(0.24) * ab.value
        assert np.allclose(added, total.value, rtol=1e-4, atol=1e-4)
        same = analysis.static_structure([frame], **options, species=("a", 0))
        assert np.array_equal(same.value, aa.value)


def test_figures_have_a_curve_for_each_species(run):
    profile = figures.draw(run, "profiles")
    labels = [text.get_text() for text in profile.axes[0].get_legend().get_texts()]
    assert labels == ["all", "grain", "dust"]
    msd = figures.draw(run, "msd")
    assert {"dust", "grain"} <= {text.get_text() for text in msd.axes[0].get_legend().get_texts()}


@pytest.mark.parametrize(
    ("measure", "message"),
    [
        ({"msd": {"species": ["sand"]}}, 'no species is named "sand"'),
        ({"msd": {"species": ["pin"]}}, "has no particles that move"),
        ({"msd": {"species": ["dust", "dust"]}}, "is there twice"),
        ({"msd": {"species": []}}, "must name at least one species"),
        ({"msd": {"species": "all"}}, 'must be "each", or a list with names of species'),
        ({"msd": {}}, "names of species"),
        ({"profiles": [{"axis": "z", "bins": 3, "interval": 1.0, "species": ["sand"]}]}, "no species is named"),
    ],
)
def test_species_that_are_not_there_are_refused(measure, message, tmp_path):
    given = measure | {"interval": 0.1} if "msd" in measure else measure
    with pytest.raises(SceneError, match=message):
        haff.run(SCENE | {"measure": given}, file=tmp_path / "x.h5")
