"""Killed, stopped and failed runs: files open, flushed data are kept, resumed runs equal uninterrupted ones."""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from conftest import ROOT, executable
from patience import HANGS

GAS = ROOT / "tests" / "gas.toml"
# Rows every half time unit, a checkpoint every time unit: a kill at any time is close to a write.
DENSE = ("output.frames=0.5", "output.observables=0.25", "output.checkpoint=1.0")


def haff(*arguments, **options) -> subprocess.CompletedProcess:
    return subprocess.run(
        [executable(), *map(str, arguments)], capture_output=True, text=True, timeout=HANGS, **options
    )


def run(path: Path, until: float, *sets: str, threads: int = 1) -> dict:
    done = haff("run", GAS, "-o", path, *settings(until, *sets), "--threads", threads, "--json", "-q")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def settings(until: float, *sets: str) -> list[str]:
    return [word for item in (f"run.until={until}", *DENSE, *sets) for word in ("--set", item)]


def resume(path: Path, threads: int = 1) -> dict:
    done = haff("run", "--resume", path, "--threads", threads, "--json", "-q")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def contents(path: Path) -> dict[str, np.ndarray]:
    """All datasets of a run, up to the last row with a time."""
    found = {}
    with h5py.File(path) as file:
        rows = {}
        for clock in ("particles/all/position/time", "observables/momentum/time", "events/time"):
            times = file[clock][:]
            known = np.flatnonzero(~np.isnan(times))
            rows[clock.rsplit("/", 2)[0].split("/")[0]] = known[-1] + 1 if len(known) else 0

        def take(name, item):
            part = name.split("/")[0]
            if isinstance(item, h5py.Dataset) and part in rows:
                fixed = item.ndim and item.maxshape[0] is not None
                found[name] = item[()] if fixed or not item.ndim else item[: rows[part]]

        file.visititems(take)
        # Datasets with several names are visited once.
        found["box time"] = file["particles/all/box/edges/time"][: rows["particles"]]
    return found


def assert_same(found: dict[str, np.ndarray], whole: dict[str, np.ndarray], about: str) -> None:
    assert found.keys() == whole.keys()
    for name, expected in whole.items():
        np.testing.assert_array_equal(found[name], expected, err_msg=f"{name} {about}", strict=True)


@pytest.mark.long
def test_resumed_file_equals_that_of_an_uninterrupted_run(tmp_path):
    """For all datasets and any number of threads; with windows, in blocks, with lists, and in a box with gravity."""
    cases = {
        "gas": [],
        "blocks": ['engine.neighbors="windows"', "engine.blocks=2", "species.0.count=3000"],
        "lists": ['engine.neighbors="lists"'],
        "lists, blocks": ['engine.neighbors="lists"', "engine.blocks=2", "species.0.count=3000"],
        "box": ["domain.gravity=[0.0, 0.0, -0.1]", 'domain.boundary=["periodic", "wall", "wall"]'],
    }
    for name, sets in cases.items():
        whole = run(tmp_path / f"{name}.h5", 40, *sets, threads=1)
        part = tmp_path / f"{name}-part.h5"
        legs = 0
        # A quarter of the run time, or less if the machine was busier when that was measured.
        for share in (0.25, 0.05, 0.01):
            part.unlink(missing_ok=True)
            leg = f"run.wall_time={share * whole['wall_seconds']:.6f}"
            done = haff("run", GAS, "-o", part, *settings(40, leg, *sets), "--threads", 2, "--json", "-q")
            report = json.loads(done.stdout)
            if report["stopped"] == "wall_time":
                break
        while report["stopped"] == "wall_time" and legs < 300:
            before = report["simulated_time"]
            report = resume(part, threads=1 + legs % 4)
            assert report["resumed_from"] == before
            legs += 1
        assert legs > 0, "the run must be longer than its wall time"
        for key in (
            "state_hash",
            "collisions",
            "events",
            "simulated_time",
            "dissipated_energy",
            "stopped",
            "max_overlap",
        ):
            assert report[key] == whole[key], f"{name}: {key}"
        assert (whole["blocks"]["first"] > 0) == ("blocks" in name), whole["blocks"]
        assert_same(contents(part), contents(tmp_path / f"{name}.h5"), f"of {name} after {legs} legs")
        # A complete file is left as it is.
        before = part.read_bytes()
        again = resume(part)
        # A run counts the events of its own blocks.
        assert again == report | {"resumed_from": report["simulated_time"], "blocks": again["blocks"]}
        assert part.read_bytes() == before


def rows_on_disk(path: Path) -> int:
    """Number of complete frames in a file that is being written; 0 if there is no file yet."""
    try:
        with h5py.File(path, locking=False) as file:
            return int(np.count_nonzero(~np.isnan(file["particles/all/position/time"][:])))
    except OSError:
        return 0


@pytest.mark.long
def test_run_killed_at_any_instant_loses_no_flushed_data(tmp_path):
    """SIGKILL at seeded instants; HAFF_KILLS=200 for the long form (about two minutes)."""
    until = 60
    started = time.perf_counter()
    whole_report = run(tmp_path / "whole.h5", until)
    takes = time.perf_counter() - started
    whole = contents(tmp_path / "whole.h5")
    kills = int(os.environ.get("HAFF_KILLS", 0))
    draw = random.Random(20)
    checked = unborn = complete = from_start = later = 0
    # As many as it takes: a busy machine may take longer, or shorter, than it did for the whole run.
    while later < max(6, kills // 3) or checked < kills:
        path = tmp_path / f"{checked}.h5"
        with subprocess.Popen(
            [executable(), "run", GAS, "-o", path, *settings(until), "-q", "--threads", "1"]
        ) as process:
            # From its start to a little beyond its end.
            time.sleep(draw.uniform(0, 1.05 * takes))
            flushed = rows_on_disk(path) if checked % 3 == 0 else 0
            process.kill()
        checked += 1
        if not path.exists():
            # Killed before its first checkpoint was complete: then there is no file.
            unborn += 1
            takes *= 1.1
            continue
        about = f"after kill {checked}"
        part = contents(path)
        frames = len(part["particles/all/position/value"])
        assert frames >= flushed, about
        for name, expected in whole.items():
            rows = part[name]
            if rows.shape != expected.shape:
                expected = expected[: len(rows)]
            np.testing.assert_array_equal(rows, expected, err_msg=f"{name} {about}", strict=True)
        info = json.loads(haff("info", path, "--json").stdout)
        assert info["resumable"] or info["finished"], about
        if info["finished"]:
            complete += 1
            takes *= 0.9
        report = resume(path, threads=1 + checked % 2)
        assert report["state_hash"] == whole_report["state_hash"], about
        assert_same(contents(path), whole, about)
        if not info["finished"]:
            # Resumed from its last checkpoint: a time unit apart, and flushed with all earlier records.
            assert report["resumed_from"] == info["checkpoint_time"], about
            assert report["resumed_from"] >= part["box time"][-1] - 1.0, about
            from_start += report["resumed_from"] == 0
            later += report["resumed_from"] > 0
            takes *= 1.1 if report["resumed_from"] == 0 else 1.0
        path.unlink()
    print(
        f"{checked} kills: {unborn} before there was a file, {from_start} in the first time unit, {complete} too late"
    )


@pytest.mark.long
def test_run_without_checkpoint_interval_writes_checkpoints_by_wall_time(tmp_path):
    """The simulated time of an inelastic gas up to a number of collisions cannot be predicted."""
    path = tmp_path / "long.h5"
    scene = tmp_path / "long.toml"
    scene.write_text(
        GAS.read_text().replace("until = 20.0", "collisions = 1_000_000_000").replace("checkpoint = 4.0", "")
    )
    with subprocess.Popen([executable(), "run", scene, "-o", path, "-q", "--set", "output.events=false"]) as process:
        found = 0.0
        while not found and process.poll() is None:
            time.sleep(0.05)
            if path.exists():
                info = haff("info", path, "--json")
                found = json.loads(info.stdout)["checkpoint_time"] if info.returncode == 0 else 0.0
        process.kill()
    assert found > 0
    assert json.loads(haff("info", path, "--json").stdout)["checkpoint_time"] >= found


def test_output_of_another_trajectory_version_is_not_resumed(tmp_path):
    path = tmp_path / "old.h5"
    run(path, 4, "run.wall_time=0.001")
    with h5py.File(path, "r+") as file:
        assert "summary" in file["parameters"]
        file["parameters/trajectory_version"][...] = 999
    before = path.read_bytes()
    refused = haff("run", "--resume", path)
    assert refused.returncode == 4 and refused.stderr.count("\n") == 1, refused.stderr
    assert "old.h5" in refused.stderr and "trajectory version 999" in refused.stderr
    assert path.read_bytes() == before


def test_files_that_cannot_be_resumed_are_refused_and_not_changed(tmp_path):
    good = tmp_path / "good.h5"
    run(good, 4, "run.wall_time=0.001")
    whole = good.read_bytes()
    half = len(whole) // 2
    broken = {
        "truncated.h5": (whole[:half], f"is truncated: {half} of its {len(whole)} bytes are there"),
        "text.h5": (b"schema = 1\n", "is not an HDF5 file"),
        "empty.h5": (b"", "is not an HDF5 file"),
    }
    for name, (content, why) in broken.items():
        (tmp_path / name).write_bytes(content)
        refused = haff("run", "--resume", tmp_path / name)
        assert refused.returncode == 4 and name in refused.stderr and why in refused.stderr, refused.stderr
        assert (tmp_path / name).read_bytes() == content
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["x"] = 1
    refused = haff("run", "--resume", tmp_path / "foreign.h5")
    assert refused.returncode == 4 and "not one written by haff" in refused.stderr, refused.stderr
    with h5py.File(good, "r+") as file:
        for slot in file["checkpoint"]:
            if "header" in file["checkpoint"][slot]:
                file["checkpoint"][slot]["header"][-1] += 1
    before = good.read_bytes()
    refused = haff("run", "--resume", good)
    assert refused.returncode == 4 and "no valid checkpoint" in refused.stderr, refused.stderr
    assert good.read_bytes() == before


def test_run_ends_when_its_file_is_removed(tmp_path):
    path = tmp_path / "gone.h5"
    command = [executable(), "run", GAS, "-o", path, *settings(100_000), "-q"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        wait_for(path)
        path.unlink()
        _, errors = process.communicate(timeout=HANGS)
    assert process.returncode == 4, errors
    assert "gone.h5" in errors and "removed or replaced" in errors
    assert not path.exists()


def test_read_only_folder_is_an_error(tmp_path):
    folder = tmp_path / "closed"
    folder.mkdir()
    run(tmp_path / "part.h5", 4, "run.wall_time=0.001")
    shutil.copy(tmp_path / "part.h5", folder / "part.h5")
    (folder / "part.h5").chmod(0o444)
    folder.chmod(0o555)
    user = {}
    if os.geteuid() == 0:
        # The superuser may write everywhere, so another user tries.
        for parent in (tmp_path, *tmp_path.parents[:2]):
            parent.chmod(parent.stat().st_mode | 0o055)
        user = {"user": 65534, "group": 65534, "extra_groups": []}
    try:
        tried = haff("--version", **user)
    except PermissionError:
        pytest.skip("no other user may run the command here")
    assert tried.returncode == 0
    for arguments in (["run", GAS, "-o", folder / "new.h5"], ["run", "--resume", folder / "part.h5"]):
        refused = haff(*arguments, "-q", **user)
        assert refused.returncode == 4 and "Permission denied" in refused.stderr, refused.stderr
        assert Path(arguments[-1]).name in refused.stderr
    assert [path.name for path in folder.iterdir()] == ["part.h5"]


def wait_for(path: Path) -> None:
    deadline = time.monotonic() + HANGS
    while not path.exists():
        assert time.monotonic() < deadline, f"{path} never came"
        time.sleep(0.01)
