"""Files of runs in progress are read up to the last flush; and a collapsed gas goes on with a contact duration."""

from __future__ import annotations

import json
import multiprocessing
import os
import struct
import subprocess
import time
import zlib
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import haff
from conftest import ROOT, executable
from haff.files.handshake import Count

GAS = ROOT / "tests" / "gas.toml"


@pytest.fixture
def running(tmp_path) -> Iterator[Path]:
    """The file of a run that goes on during the test, with four frames at least."""
    path = tmp_path / "running.h5"
    # Elastic, so that the run has the same speed for all its time: some hundred frames a second.
    sets = ("contact.restitution=1", "run.until=1e7", "output.frames=2.0", "measure.vacf=true", "measure.interval=0.5")
    profiles = 'measure.profiles=[{axis="z",bins=10,interval=2.0}]'
    words = [word for item in (*sets, profiles) for word in ("--set", item)]
    process = subprocess.Popen([executable(), "run", GAS, "-o", path, "-q", "--threads", "1", *words])
    try:
        while not path.exists() or frames_of(path) < 4:
            assert process.poll() is None
            time.sleep(0.01)
        yield path
        assert process.poll() is None, f"exit status {process.returncode}: the run is disturbed by its readers"
    finally:
        process.kill()
        process.wait()
    with haff.open(path) as file:
        assert not file.running


def frames_of(path: Path) -> int:
    with haff.open(path) as file:
        return len(file.frames)


def wait_for_more_than(frames: int, path: Path) -> None:
    """Waits for frames of a run that goes on, however slow it is: they must come with its next flushes."""
    flushed = flushes(path)
    while frames_of(path) <= frames:
        assert flushes(path) < flushed + 100, f"{frames} frames, and no other is read"
        time.sleep(0.01)


def flushes(path: Path) -> int:
    """Beginnings and ends of flushes so far."""
    with path.open("rb") as file:
        count = Count.of(file.fileno())
    assert count is not None, "the file has no counter"
    return count.flushes


def check_and_sum(path: Path, until: int) -> dict[str, int]:
    """Reads parts of a file again and again, up to ``until`` times; checksums of the first rows of each."""
    sums: dict[str, int] = {}
    for _ in range(until):
        with haff.open(path) as file:
            assert file.running
            found = {
                "frames": file.frames[3].position,
                "times": file.frames.time[:4],
                "samples": file.samples["temperature"][:4],
                "events": file.events[:1000].to_numpy(),
                "profiles": file.profiles["z"].density.values[:3],
            }
            for times in (file.frames.time, file.samples["time"], file.profiles["z"].time.values):
                assert np.isfinite(times).all() and np.all(np.diff(times) > 0)
            last = file.frames[-1].position
            assert last.shape == (500, 3) and np.all((last >= 0) & (last <= file.box.size))
            assert len(file.samples["time"]) >= len(file.frames)
            assert np.isfinite(file.correlations["vacf"].value).all()
        for name, values in found.items():
            assert sums.setdefault(name, crc(values)) == crc(values), name
    return sums


def crc(values: np.ndarray) -> int:
    return zlib.crc32(np.array2string(values).encode() if values.dtype == object else values.tobytes())


@pytest.mark.long
def test_readers_of_a_running_file_read_one_state_each(running):
    """A short form of benches/running.py."""
    lengths = [frames_of(running)]
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        results = [pool.submit(check_and_sum, running, 20) for _ in range(2)]
        assert results[0].result() == results[1].result()
    wait_for_more_than(lengths[0], running)


def test_a_file_that_is_open_does_not_hide_what_the_run_writes(running):
    with haff.open(running) as first:
        known = len(first.frames)
        wait_for_more_than(known, running)
        assert len(first.frames) == known
        np.testing.assert_array_equal(first.frames[known - 1].time, first.frames.time[-1])


@pytest.mark.long
def test_a_reader_that_is_stopped_does_not_stop_the_run(running):
    fcntl = pytest.importorskip("fcntl")
    with running.open("rb") as stopped:
        lock = struct.pack("hhqqi4x", fcntl.F_RDLCK, os.SEEK_SET, 1 << 62, 1, 0)
        while True:
            try:
                fcntl.fcntl(stopped, getattr(fcntl, "F_OFD_SETLK", fcntl.F_SETLK), lock)
            except BlockingIOError:  # The run is writing.
                time.sleep(0.001)
            else:
                break
        for _ in range(3):
            wait_for_more_than(frames_of(running), running)


@pytest.mark.long
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


@pytest.mark.long
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
