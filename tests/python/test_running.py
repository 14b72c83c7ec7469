"""Files of runs in progress are read up to the last flush; and a collapsed gas goes on with a contact duration."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import haff
from conftest import ROOT, executable

GAS = ROOT / "tests" / "gas.toml"


@pytest.fixture
def running(tmp_path) -> Iterator[Path]:
    """The file of a run that goes on during the test, with four frames at least."""
    path = tmp_path / "running.h5"
    # Elastic, so that the run has the same speed for all its time: some hundred frames a second.
    sets = ("contact.restitution=1", "run.until=1e7", "output.frames=2.0", "output.events=false")
    words = [word for item in sets for word in ("--set", item)]
    process = subprocess.Popen([executable(), "run", GAS, "-o", path, "-q", "--threads", "1", *words])
    try:
        until = time.monotonic() + 150
        while not path.exists() or len(haff.open(path).frames) < 4:
            assert time.monotonic() < until and process.poll() is None
            time.sleep(0.05)
        yield path
        assert process.poll() is None, f"exit status {process.returncode}: the run is disturbed by its readers"
    finally:
        process.kill()
        process.wait()
    with haff.open(path) as file:
        assert not file.running


def test_python_reads_a_running_file_up_to_the_last_flush(running):
    lengths = []
    for _ in range(10):
        with haff.open(running) as file:
            assert file.running
            frames = file.frames
            times = frames.time
            assert np.isfinite(times).all() and np.all(np.diff(times) > 0)
            position = frames[-1].position
            assert position.shape == (500, 3) and np.all((position >= 0) & (position <= file.box.size))
            assert len(file.observables) >= len(frames)
            lengths.append(len(frames))
        time.sleep(0.25)
    assert lengths == sorted(lengths) and lengths[-1] > lengths[0], "the file grows"


@pytest.mark.parametrize(
    "arguments",
    [
        ("plot", "--kind", "snapshot", "-o", "figures"),
        ("plot", "--kind", "energy", "-o", "figures"),
        ("export", "--to", "extxyz", "-o", "gas.extxyz"),
        ("view", "-o", "gas.html"),
    ],
    ids=lambda arguments: "-".join(arguments[:3:2]),
)
def test_commands_work_on_a_running_file(running, arguments, command):
    name, *others, output = arguments
    target = running.parent / output
    command(name, running, *others, target)
    made = list(target.glob("*.png")) if target.is_dir() else [target]
    assert made and all(path.stat().st_size > 1000 for path in made)


def test_info_says_that_a_run_is_running(running, command):
    text = command("info", running).stdout
    assert "running: another process is writing the file" in text and "--resume" not in text
    report = json.loads(command("info", running, "--json").stdout)
    assert (report["running"], report["resumable"], report["finished"]) == (True, False, False)


def test_collapsed_gas_goes_on_with_the_contact_duration_that_the_error_names(tmp_path, command):
    path = tmp_path / "collapsed.h5"
    sets = {
        "species.0.count": 1000,
        "domain.packing_fraction": 0.3,
        "initial.positions": '"random"',
        "contact.restitution": 0.3,
        "run.until": 125,
    }
    words = [word for key, value in sets.items() for word in ("--set", f"{key}={value}")]
    done = command("run", ROOT / "configs" / "disks.toml", *words, "-o", path, "--json", check=False)
    report = json.loads(done.stdout)
    assert (done.returncode, report["stopped"]) == (3, "collapse")
    assert done.stderr.startswith("warning: the box, 51.17 long, exceeds the critical length")
    for _ in range(2):
        again = command("run", "--resume", path, "--json", check=False)
        resumed = json.loads(again.stdout)
        kept = ("stopped", "simulated_time", "error", "state_hash", "collisions")
        assert again.returncode == 3 and [resumed[key] for key in kept] == [report[key] for key in kept]
    assert "contact.tc = 1e-5" in report["error"] and "--set contact.tc=1e-5 -o NEW.h5" in done.stderr
    on = tmp_path / "on.h5"
    last = json.loads(command("run", "--resume", path, "--set", "contact.tc=1e-5", "-o", on, "--json", "-q").stdout)
    assert last["stopped"] == "until" and last["resumed_from"] == report["simulated_time"] < 125
    assert abs(last["ledger_residual"]) < 1e-13
    with haff.open(on) as file:
        assert file.frames.time[0] == report["simulated_time"] and file.frames.time[-1] == 125
