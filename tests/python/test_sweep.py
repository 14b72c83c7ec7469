"""Studies: the same runs by `haff sweep`, by Dask and by Snakemake, also when workers are killed in the middle."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray

import haff
from conftest import ROOT, executable
from patience import HANGS

GAS = ROOT / "tests" / "gas.toml"
WORKFLOW = ROOT / "workflows" / "snakemake"
# Long enough to be killed during the run; a checkpoint every few milliseconds.
LONG = {"contact.restitution": [0.99, 1.0], "run.until": [500.0], "output.checkpoint": [5.0], "output.frames": [50.0]}


@pytest.fixture(autouse=True)
def _command(monkeypatch):
    monkeypatch.setenv("HAFF", str(executable()))


@pytest.fixture(scope="module")
def serial(tmp_path_factory) -> xarray.Dataset:
    """The study, one run after the other."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HAFF", str(executable()))
        return haff.sweep(GAS, LONG, seeds=2, output=tmp_path_factory.mktemp("serial"), jobs=1, threads=1)


def runs_of(folder: Path) -> list[tuple[int, int]]:
    """Processes of `haff` that write into a folder, and the members they run."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            words = (entry / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        line = b" ".join(words).decode(errors="replace")
        index = re.search(r"--index[= ](\d+)", line)
        if words[0].endswith(b"/haff") and str(folder).encode() in words and index:
            found.append((int(entry.name), int(index[1])))
    return found


def in_the_middle(path: Path) -> bool:
    """Whether the run of a file has a checkpoint and is not complete."""
    info = subprocess.run([executable(), "info", path, "--json"], capture_output=True, text=True)
    state = json.loads(info.stdout) if info.returncode == 0 else {"checkpoint_time": 0.0, "finished": False}
    return state["checkpoint_time"] > 0 and not state["finished"]


@contextlib.contextmanager
def one_killed_in_the_middle(folder: Path, *, also_parent: bool) -> Iterator[None]:
    """Kills a run once its file has a checkpoint, and before it, optionally, the process that started it."""
    killed: list[int] = []
    over = threading.Event()

    def attempt(process: int, index: int) -> bool:
        # Stopped, so that it neither ends nor writes while its file is read.
        os.kill(process, signal.SIGSTOP)
        if in_the_middle(folder / f"run-{index:04}.h5"):
            if also_parent:
                parent = int(Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[1])
                os.kill(parent, signal.SIGKILL)
            os.kill(process, signal.SIGKILL)
            return True
        os.kill(process, signal.SIGCONT)
        return False

    def watch():
        while not over.wait(0.02):
            for process, index in runs_of(folder):
                try:
                    if attempt(process, index):
                        killed.append(index)
                        return
                except (OSError, IndexError):
                    continue

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
    assert killed, "no run was in the middle long enough to be killed"


def test_dataset_has_a_dimension_for_each_key_and_the_totals_of_each_run(serial, tmp_path):
    assert dict(serial["status"].sizes) == {
        "restitution": 2, "until": 1, "checkpoint": 1, "frames": 1, "seed": 2,
    }  # fmt: skip
    assert (serial["status"] == "complete").all()
    one = serial.sel(restitution=0.99, seed=1).squeeze()
    sets = [f"{key}={values[0]}" for key, values in LONG.items()] + [f"seed={int(one['run_seed'])}"]
    command = [executable(), "run", GAS, "-o", tmp_path / "one.h5", "--json", "-q"]
    command += [word for item in sets for word in ("--set", item)]
    report = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    assert report["state_hash"] == one["state_hash"].item()
    assert report["collisions"] == one["collisions"].item()
    assert report["dissipated_energy"] == one["dissipated_energy"].item()
    # The less elastic gas has dissipated more energy.
    assert (serial["dissipated_energy"].diff("restitution") < 0).all()
    assert len(np.unique(serial["run_seed"])) == 4


def test_dataset_includes_requested_series(tmp_path):
    study = haff.sweep(
        GAS,
        {"run.until": [2.0, 3.0], "species.grain.count": np.array([200, 300])},
        output=tmp_path,
        series=["temperature"],
    )
    series = study["temperature_series"].squeeze("seed")
    assert series.dims == ("until", "count", "time")
    with haff.open(tmp_path / "run-0003.h5") as file:
        table = file.observables
    np.testing.assert_array_equal(series[1, 1], table["temperature"])
    np.testing.assert_array_equal(series["time"], table["time"])
    assert np.isnan(series[0, 0, -1]) and series[0, 0, 0] == pytest.approx(1.0)


def temperature(run: haff.File) -> float:
    return run.samples["temperature"][-1]


@pytest.mark.long
def test_files_are_measured_with_errors_and_a_study_opens_without_its_values(tmp_path):
    values = {"contact.restitution": [0.8, 0.9], "domain.boundary": [["periodic"] * 3, ["wall"] * 3]}
    study = haff.sweep(GAS, values, seeds=3, output=tmp_path, measure=temperature, run__until=2.0, title="a study")
    assert study["temperature"].dims == ("restitution", "boundary", "seed") and study["temperature_mean"].ndim == 2
    first = study["temperature"].values[1, 0]
    for found, path in zip(first, study["file"].values[1, 0]):
        assert Path(path).is_absolute()
        with haff.open(path) as run:
            assert found == temperature(run) and run.title == "a study"
    assert study["temperature_mean"].values[1, 0] == pytest.approx(first.mean(), rel=1e-12)
    assert study["temperature_error"].values[1, 0] == pytest.approx(first.std(ddof=1) / 3**0.5, rel=1e-12)
    assert study["until"].item() == 2.0 and study["until"].attrs["key"] == "run.until"

    opened = haff.open_study(tmp_path, measure=temperature)
    xarray.testing.assert_identical(opened, study)
    # What is not complete is left out.
    Path(study["file"].values[0, 0, 1]).unlink()
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    manifest["runs"][1] |= {"status": "missing"}
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    opened = haff.open_study(tmp_path, measure=lambda run: {"atoms": len(run), "t": temperature(run)}, dims="keys")
    assert opened["atoms"].dims == ("contact.restitution", "domain.boundary", "seed")
    assert np.isnan(opened["atoms"].values).sum() == 1 and np.isfinite(opened["t_mean"]).all()
    assert opened["t_error"].values[0, 0] == pytest.approx(np.ptp(study["temperature"].values[0, 0, ::2]) / 2)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "is not a manifest of haff sweep"),
        ("[]", "is not a manifest of this version"),
        ('{"manifest": 2}', "is not a manifest of this version"),
        ('{"manifest": 1, "runs": [], "set": ["a=1"], "seeds": 1}', "not those of its values"),
        ('{"manifest": 1, "runs": [{"parameters": {"a": 1}}], "set": ["a=1"], "seeds": 2}', "not those of its values"),
        ('{"manifest": 1, "runs": [{"parameters": 5}], "set": ["a=1"], "seeds": 1}', "not those of its values"),
    ],
)
def test_a_damaged_study_is_an_error(tmp_path, text, told):
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(haff.FileError, match=told):
        haff.open_study(tmp_path)


def test_a_measure_that_is_no_number_or_takes_a_name_is_refused(tmp_path):
    haff.sweep(GAS, {"run.until": [1.0]}, output=tmp_path)
    for measure, told in [
        (lambda run: "hot", "measure gives 'hot' for .*run-0000.h5: must be a number"),
        (lambda run: {"a b": 1.0}, "whose keys are names"),
        (lambda run: {"collisions": 1.0}, "'collisions': another variable"),
    ]:
        with pytest.raises(haff.ArgumentError, match=told):
            haff.open_study(tmp_path, measure=measure)
    with pytest.raises(haff.ArgumentError, match=r"run\.until: is among the values"):
        haff.sweep(GAS, {"run.until": [1.0]}, output=tmp_path, run__until=2.0)


def test_scene_can_be_a_mapping_and_failures_are_reported(tmp_path):
    import tomllib

    scene = tomllib.loads(GAS.read_text())
    with pytest.warns(RuntimeWarning, match=r"1 of 2 runs failed; run 1: .*must be in \[0, 1\]"):
        study = haff.sweep(scene, {"contact.restitution": [0.9, 1.2], "run.until": [1.0]}, output=tmp_path / "a")
    assert study["status"].values.ravel().tolist() == ["complete", "failed"]
    assert np.isnan(study["collisions"].values.ravel()[1])
    with pytest.raises(haff.SceneError, match="did you mean `restitution`"):
        haff.sweep(scene, {"contact.restitutoin": [0.9]}, output=tmp_path / "b")
    with pytest.raises(haff.ArgumentError, match="needs a list of values"):
        haff.sweep(scene, {"contact.restitution": 0.9}, output=tmp_path / "b")
    with pytest.raises(haff.FileError, match="belongs to another sweep"):
        haff.sweep(scene, {"contact.restitution": [0.9]}, output=tmp_path / "a")
    with pytest.raises(haff.FileError, match="belongs to another sweep"):
        haff.sweep(scene | {"seed": 4}, {"contact.restitution": [0.9, 1.2], "run.until": [1.0]}, output=tmp_path / "a")
    with pytest.raises(haff.FileError, match="none"):
        haff.sweep(tmp_path / "none.toml", seeds=2, output=tmp_path / "b")


@pytest.mark.long
def test_local_cluster_continues_a_study_of_the_command(tmp_path):
    pytest.importorskip("distributed")
    study = {"contact.restitution": [0.8, 0.9], "run.until": [2]}
    command = [executable(), "sweep", GAS, "--set=contact.restitution=0.8,0.9", "--set=run.until=2", "--seeds=2"]
    subprocess.run([*command, "-o", tmp_path, "--index=1", "-q"], check=True)
    before = (tmp_path / "run-0001.h5").stat().st_mtime_ns
    found = haff.sweep(GAS, study, seeds=2, output=tmp_path, cluster="local", threads=2)
    assert (found["status"] == "complete").all()
    assert (tmp_path / "run-0001.h5").stat().st_mtime_ns == before
    # All runs are complete.
    xarray.testing.assert_identical(found, haff.sweep(GAS, study, seeds=2, output=tmp_path))


@pytest.mark.long
def test_dask_result_equals_the_serial_one_after_a_worker_is_killed(serial, tmp_path):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
        one_killed_in_the_middle(tmp_path, also_parent=True),
    ):
        study = haff.sweep(GAS, LONG, seeds=2, output=tmp_path, cluster=client)
    xarray.testing.assert_equal(study["state_hash"], serial["state_hash"])
    for name in ("collisions", "dissipated_energy", "simulated_time", "status", "run_seed"):
        xarray.testing.assert_equal(study[name], serial[name])
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert {row["status"] for row in manifest["runs"]} == {"complete"}
    assert any(row.get("resumed_from", 0) > 0 for row in manifest["runs"]), "a killed run is resumed from a checkpoint"


@pytest.mark.long
def test_snakemake_result_equals_the_serial_one_after_a_run_is_killed(serial, tmp_path):
    pytest.importorskip("snakemake")
    config = {
        "haff": str(executable()),
        "scene": str(GAS),
        "folder": str(tmp_path / "study"),
        "set": LONG,
        "seeds": 2,
        "threads": 1,
    }
    (tmp_path / "config.json").write_text(json.dumps(config))
    command = [sys.executable, "-m", "snakemake", "--snakefile", WORKFLOW / "Snakefile", "--directory", tmp_path]
    command += ["--configfile", tmp_path / "config.json", "--profile", WORKFLOW / "profiles" / "local"]
    with one_killed_in_the_middle(tmp_path / "study", also_parent=False):
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=HANGS)
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "study" / "summary.json").read_text())
    assert summary["complete"] == 4
    assert [row["state_hash"] for row in summary["runs"]] == serial["state_hash"].values.ravel().tolist()
    assert any(row.get("resumed_from", 0) > 0 for row in summary["runs"]), "a killed run is resumed from a checkpoint"


def test_snakemake_accepts_the_slurm_profile(tmp_path):
    pytest.importorskip("snakemake_executor_plugin_slurm")
    config = {
        "haff": str(executable()),
        "scene": str(GAS),
        "folder": "study",
        "set": {"seed": [1, 2]},
        "seeds": 0,
        "threads": 1,
    }
    (tmp_path / "config.json").write_text(json.dumps(config))
    command = [sys.executable, "-m", "snakemake", "--snakefile", WORKFLOW / "Snakefile", "--directory", tmp_path, "-n"]
    command += ["--configfile", tmp_path / "config.json", "--profile", WORKFLOW / "profiles" / "slurm"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=HANGS)
    assert done.returncode == 0, done.stderr
    assert "summary" in done.stdout + done.stderr
