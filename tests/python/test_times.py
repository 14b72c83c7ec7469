"""Frames and rows of observables have different times, however a run ends."""

from __future__ import annotations

import json

import numpy as np
import pytest

import haff
from conftest import ROOT

COLLAPSING = {
    "species.0.count": 1000,
    "domain.packing_fraction": 0.3,
    "initial.positions": '"random"',
    "contact.restitution": 0.3,
    "run.until": 125,
}


def collapsed(command, path, **sets):
    """The report of a gas that collapses, and the times of its frames and rows."""
    words = [word for key, value in (COLLAPSING | sets).items() for word in ("--set", f"{key}={value}")]
    done = command("run", ROOT / "configs" / "disks.toml", *words, "-o", path, "--json", "-q", check=False)
    report = json.loads(done.stdout)
    assert (done.returncode, report["stopped"]) == (3, "collapse")
    with haff.open(path) as run:
        return report, run.frames.time if "frames" in run else None, run.samples["time"]


@pytest.mark.long
@pytest.mark.parametrize("due", ["frames", "observables"])
def test_a_collapse_at_the_time_of_a_record_does_not_repeat_it(due, tmp_path, command):
    report, *_ = collapsed(command, tmp_path / "first.h5")
    # The clock of a collapse no longer advances: collisions follow a record at the same time.
    time = repr(report["simulated_time"])
    sets = {"output.frames": time, "output.observables": time}
    if due == "observables":
        sets["output.frames"] = 1000
    again, frames, samples = collapsed(command, tmp_path / "again.h5", **sets)
    assert again["state_hash"] == report["state_hash"] and again["simulated_time"] == report["simulated_time"]
    assert frames[-1] == samples[-1] == report["simulated_time"]
    assert np.all(np.diff(frames) > 0) and np.all(np.diff(samples) > 0), (frames, samples)
    command("run", "--resume", tmp_path / "again.h5", "-q", check=False)
    with haff.open(tmp_path / "again.h5") as run:
        np.testing.assert_array_equal(run.frames.time, frames)
        np.testing.assert_array_equal(run.samples["time"], samples)
