"""A study grows: with more values or seeds in the same folder, only the missing runs are made."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
import xarray

import haff
from conftest import executable

GAS = {
    "schema": 1,
    "seed": 3,
    "domain": {"packing_fraction": 0.2},
    "species": [{"name": "grain", "count": 60, "radius": 0.5, "mass": 1.0}],
    "run": {"until": 1.0},
    "output": {"frames": 0.5, "observables": 0.5},
}
SMALL = {"contact.restitution": [0.8, 0.9], "species.grain.count": [60]}
LARGE = {"contact.restitution": [0.7, 0.8, 0.85, 0.9], "species.grain.count": [60, 80]}


@pytest.fixture(autouse=True)
def _command(monkeypatch):
    monkeypatch.setenv("HAFF", str(executable()))


def contents(folder: Path) -> dict[str, tuple[int, bytes]]:
    """Time and content of each run's file."""
    return {path.name: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.glob("run-*.h5")}


def require_cells_are_their_files(study: xarray.Dataset, folder: Path, values: dict[str, list]) -> None:
    """Each cell is the run with the values of its coordinates, which are those asked for, in their order."""
    for key, several in values.items():
        name = key.rsplit(".", 1)[-1]
        assert study[name].to_numpy().tolist() == several and study[name].attrs["key"] == key
    assert (study["status"] == "complete").all()
    assert len(set(study["file"].to_numpy().ravel())) == study["file"].size
    for cell in study.stack(run=[*study["status"].dims]).transpose("run", ...)["run"].to_numpy():
        at = dict(zip(study["status"].dims, cell))
        one = study.sel(at)
        with haff.open(folder / one["file"].item()) as file:
            scene = file.scene
            assert scene["contact"]["restitution"] == at["restitution"]
            assert scene["species"][0]["count"] == at["count"] == one["particles"]
            assert scene["seed"] == one["run_seed"].item()
            assert file.observables["collisions"].iloc[-1] == one["collisions"].item()


def grown(folder: Path, **options) -> tuple[xarray.Dataset, xarray.Dataset]:
    """A study before and after it has grown in the folder."""
    before = haff.sweep(GAS, SMALL, seeds=2, output=folder)
    old = contents(folder)
    assert len(old) == 4
    after = haff.sweep(GAS, LARGE, seeds=3, output=folder, **options)
    new = contents(folder)
    assert len(new) == 4 * 2 * 3
    assert {name: new[name] for name in old} == old, "files of earlier runs are untouched"
    require_cells_are_their_files(after, folder, LARGE)
    common = after.sel(restitution=[0.8, 0.9], count=[60], seed=[0, 1])
    for name in ("state_hash", "run_seed", "file", "collisions"):
        xarray.testing.assert_equal(common[name], before[name])
    return before, after


@pytest.mark.long
def test_more_values_and_seeds_add_only_the_missing_runs(tmp_path):
    _, after = grown(tmp_path / "grown")
    # As if all had been asked for at once.
    whole = haff.sweep(GAS, LARGE, seeds=3, output=tmp_path / "whole")
    for name in ("state_hash", "run_seed", "collisions", "dissipated_energy"):
        xarray.testing.assert_equal(after[name], whole[name])
    # Nothing is left to do.
    old = contents(tmp_path / "grown")
    again = haff.sweep(GAS, LARGE, seeds=3, output=tmp_path / "grown")
    assert contents(tmp_path / "grown") == old
    xarray.testing.assert_identical(again, after)


@pytest.mark.long
def test_cluster_adds_only_the_missing_runs(tmp_path):
    pytest.importorskip("distributed")
    _, after = grown(tmp_path, cluster="local")
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert {row["status"] for row in manifest["runs"]} == {"complete"} and len(manifest["runs"]) == after["file"].size


def test_values_in_another_order_are_columns_in_that_order(tmp_path):
    haff.sweep(GAS, SMALL, output=tmp_path)
    old = contents(tmp_path)
    values = {"contact.restitution": [0.9, 0.7, 0.8], "species.grain.count": [60]}
    study = haff.sweep(GAS, values, output=tmp_path)
    assert {name: data for name, data in contents(tmp_path).items() if name in old} == old
    require_cells_are_their_files(study, tmp_path, values)


def test_seeds_alone_can_grow(tmp_path):
    first = haff.sweep(GAS, seeds=2, output=tmp_path)
    old = contents(tmp_path)
    study = haff.sweep(GAS, seeds=5, output=tmp_path)
    assert len(contents(tmp_path)) == 5 and {name: contents(tmp_path)[name] for name in old} == old
    assert study["state_hash"].to_numpy()[:2].tolist() == first["state_hash"].to_numpy().tolist()
    assert len(set(study["run_seed"].to_numpy())) == 5


def test_the_command_grows_a_study_of_python_and_the_other_way_round(tmp_path):
    haff.sweep(GAS, SMALL, output=tmp_path)
    old = contents(tmp_path)
    command = [executable(), "sweep", tmp_path / "scene.toml", "--set=contact.restitution=0.7,0.8,0.9"]
    command += ["--set=species.grain.count=60", "-o", tmp_path, "--json", "-q"]
    rows = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)["runs"]
    # In the order of the grid.
    assert [row["parameters"]["contact.restitution"] for row in rows] == [0.7, 0.8, 0.9]
    assert len(contents(tmp_path)) == 3 and {name: contents(tmp_path)[name] for name in old} == old
    values = {"contact.restitution": [0.7, 0.8, 0.85, 0.9], "species.grain.count": [60]}
    require_cells_are_their_files(haff.sweep(GAS, values, output=tmp_path), tmp_path, values)


@pytest.mark.parametrize(
    ("scene", "values"),
    [
        # Another fixed value, another key, a key less, another scene.
        (GAS, {"contact.restitution": [0.8, 0.9], "species.grain.count": [70]}),
        (GAS, {"contact.restitution": [0.8, 0.9], "species.grain.count": [60], "run.until": [1.0]}),
        (GAS, {"contact.restitution": [0.8, 0.9]}),
        (GAS | {"seed": 4}, SMALL),
    ],
)
def test_other_studies_are_refused_as_before(scene, values, tmp_path):
    haff.sweep(GAS, SMALL, output=tmp_path)
    old = contents(tmp_path)
    manifest = (tmp_path / "manifest.json").read_bytes()
    with pytest.raises(haff.FileError, match="belongs to another sweep"):
        haff.sweep(scene, values, output=tmp_path)
    assert contents(tmp_path) == old and (tmp_path / "manifest.json").read_bytes() == manifest
