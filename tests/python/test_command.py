"""The installed `haff` command: determinism, figures, other programs that read its files."""

import json
import shutil
import subprocess

import numpy as np
import pytest

from conftest import CONFIGS

pytestmark = pytest.mark.physics

SMALL = {"species__0__count": 1000, "run__until": 50.0}
SILENT = SMALL | {"output__file": False, "output__events": False}


@pytest.mark.long
def test_trajectory_is_independent_of_threads_and_search(command):
    runs = {
        "1 thread": command.run("cooling", output=False, **SILENT),
        "2 threads": command.run("cooling", output=False, threads=2, **SILENT),
        "cells": command.run("cooling", output=False, engine__neighbors="cells", **SILENT),
        "all pairs": command.run("cooling", output=False, engine__neighbors="all_pairs", **SILENT),
        "portable": command.run("cooling", output=False, engine__simd="portable", **SILENT),
        "with output": command.run("cooling", **SMALL),
    }
    hashes = {name: run.report["state_hash"] for name, run in runs.items()}
    assert len(set(hashes.values())) == 1, hashes
    assert len({run.report["collisions"] for run in runs.values()}) == 1
    other = command.run("cooling", output=False, seed=8, **SILENT)
    assert other.report["state_hash"] != hashes["1 thread"]


def test_json_report_has_every_documented_field(command):
    report = command.run("cooling", **SMALL).report
    fields = """particles collisions wall_collisions events simulated_time wall_seconds collisions_per_second
        ledger_residual max_overlap peak_memory_bytes threads seed version trajectory_version state_hash stopped"""
    assert set(fields.split()) <= set(report)
    assert report["particles"] == 1000 and report["seed"] == 7


def test_existing_output_is_not_overwritten(command):
    done = command.run("cooling", **SMALL)
    before = done.path.read_bytes()
    result = command("run", CONFIGS / "cooling.toml", "-o", done.path, "--quiet", check=False)
    assert result.returncode in (2, 4) and "--overwrite" in result.stderr, result.stderr
    assert done.path.read_bytes() == before


@pytest.mark.long
def test_plot_subcommand_draws_figures(command, tmp_path):
    done = command.run("cooling", **SMALL)
    result = command("plot", done.path, "-o", tmp_path)
    drawn = {p.stem.split("-")[-1] for p in tmp_path.iterdir()}
    assert drawn == {"temperature", "energy", "velocity", "structure", "means", "snapshot", "losses"}, result.stderr
    failed = command("plot", tmp_path / "none.h5", check=False)
    assert failed.returncode == 4 and failed.stderr.count("\n") == 1, failed.stderr


@pytest.mark.long
@pytest.mark.parametrize("scene", ["breakshot", "textbook/bouncing_ball", "textbook/oblique_pair"])
def test_plot_draws_trajectories_of_few_bodies(command, tmp_path, scene):
    command("plot", command.run(scene).path, "-o", tmp_path)
    assert any("trajectories" in p.name for p in tmp_path.iterdir())


@pytest.mark.parametrize("scene", ["breakshot", "textbook/bouncing_ball"])
def test_flights_from_the_event_log_end_at_the_next_frame(command, scene):
    from haff.figures.trajectories import flights

    with command.run(scene).open() as run:
        position, time = run.frames.array("unwrapped"), run.frames.time
        for body, path in enumerate(flights(run)):
            for k in range(1, len(time)):
                arrived = path.position[np.flatnonzero(path.time <= time[k])[-1]]
                before = path.position[np.searchsorted(path.time, time[k], side="left")]
                gap = min(np.linalg.norm(arrived - position[k, body]), np.linalg.norm(before - position[k, body]))
                assert gap < 1e-9, f"body {body} at t = {time[k]}: off by {gap:.1e}"


def test_mdanalysis_reads_the_file(command):
    MDAnalysis = pytest.importorskip("MDAnalysis")
    done = command.run("cooling", **SMALL)
    with done.open() as run:
        universe = run.to_mdanalysis()
        bare = MDAnalysis.Universe.empty(1000, velocities=True)
        # Nothing is converted: the file names the units that MDAnalysis has, too.
        bare.load_new(str(done.path), format="H5MD")
        assert bare.trajectory.units["length"] == "Angstrom" and bare.trajectory.units["time"] == "ps"
        assert np.allclose(bare.trajectory[-1].positions, run.frames[-1].position, atol=1e-5)
        assert np.allclose(bare.trajectory[-1].velocities, run.frames[-1].velocity, atol=1e-5)
        assert bare.trajectory[-1].time == run.frames.time[-1]
        assert len(bare.trajectory) == len(universe.trajectory) == len(run.frames)
        for step, frame in zip(universe.trajectory, run.frames):
            assert np.allclose(step.positions, frame.position, atol=1e-5)
            assert np.allclose(step.velocities, frame.velocity, atol=1e-5)
            assert np.allclose(step.dimensions[:3], run.box.size, rtol=1e-6)
            assert step.time == frame.time
            # MDAnalysis assigns samples to frames by row, not by time.
            assert step.data["temperature"] == run.observables["temperature"][step.frame]


def test_pyh5md_reads_the_file(command):
    pyh5md = pytest.importorskip("pyh5md")
    done = command.run("cooling", **SMALL)
    with pyh5md.File(str(done.path), "r") as file, done.open() as run:
        atoms = file.particles_group("all")
        position = pyh5md.element(atoms, "position")
        velocity = pyh5md.element(atoms, "velocity")
        assert position.value.shape == (len(run.frames), 1000, 3)
        assert np.array_equal(position.value[-1], run.frames[-1].position)
        assert np.array_equal(velocity.value[-1], run.frames[-1].velocity)
        assert np.array_equal(position.time[:], run.frames.time)
        temperature = pyh5md.element(file.observables, "temperature") if hasattr(file, "observables") else None
        if temperature is not None:
            assert np.array_equal(temperature.value[:], run.observables["temperature"])


@pytest.mark.skipif(shutil.which("h5dump") is None, reason="no h5dump on this machine")
def test_h5dump_reads_the_file(command):
    done = command.run("cooling", **SMALL)
    for arguments in (["-H"], ["-d", "/observables/temperature/value"], ["-d", "/events/kind", "-c", "5"]):
        result = subprocess.run(["h5dump", *arguments, str(done.path)], capture_output=True, text=True, check=False)
        assert result.returncode == 0 and "error" not in result.stderr.lower(), result.stderr
    assert "collision" in result.stdout


def test_info_and_check_agree_on_the_scene(command):
    done = command.run("cooling", **SMALL)
    information = command("info", done.path)
    assert "Cooling granular gas" in information.stdout + information.stderr
    checked = command("check", CONFIGS / "cooling.toml")
    assert "32" in checked.stdout + checked.stderr
    assert json.loads(command("schema").stdout)["properties"]["domain"]
