"""Simulations and runs across processes: forked copies, pickles, and runs whose Python is killed."""

from __future__ import annotations

import copy
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import haff
from patience import HANGS

GAS = {
    "schema": 1,
    "seed": 3,
    "domain": {"packing_fraction": 0.2},
    "species": [{"name": "grain", "count": 200, "radius": 0.5, "mass": 1.0}],
    "contact": {"restitution": 1.0},
    "run": {"until": 2.0},
}
forks = pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
# Large enough that the threads share work: 65,536 particles and more.
CROWD = GAS | {"species": [GAS["species"][0] | {"count": 70_000}]}


def in_a_fork(function, timeout=HANGS):
    """What a function returns in a forked process; fails if that does not end."""
    ours, theirs = multiprocessing.get_context("fork").Pipe()

    def call():
        try:
            theirs.send(function())
        except BaseException as error:
            theirs.send(error)

    process = multiprocessing.get_context("fork").Process(target=call)
    process.start()
    try:
        assert ours.poll(timeout), f"the forked process has not answered within {timeout} s"
        return ours.recv()
    finally:
        process.kill()
        process.join()


@forks
@pytest.mark.parametrize("threads", [None, 1, 2])
def test_a_simulation_goes_on_in_a_forked_process(threads):
    gas = haff.Simulation(CROWD, threads=threads)
    gas.step(100)

    def go_on():
        gas.step(100)
        others = [haff.Simulation(CROWD, threads=2), haff.Simulation(CROWD)]
        for other in others:
            other.step(200)
        return [simulation.state_hash for simulation in (gas, *others)], gas.threads

    found = in_a_fork(go_on)
    gas.step(100)
    assert found == ([gas.state_hash] * 3, gas.threads)
    # Also in the copy of a copy.
    assert in_a_fork(lambda: in_a_fork(go_on)[0][1]) == found[0][1]


@forks
def test_a_fork_waits_for_the_events_that_another_thread_takes():
    gas = haff.Simulation(CROWD, threads=2)
    advancing = threading.Thread(target=gas.step, args=(200_000,))
    advancing.start()
    try:
        while gas.collisions == 0:
            time.sleep(0.001)

        def go_on():
            before = gas.collisions
            gas.step(10)
            return gas.collisions - before, np.isfinite(gas.positions).all()

        assert in_a_fork(go_on) == (10, True)
    finally:
        advancing.join()
    assert gas.collisions == 200_000
    reference = haff.Simulation(CROWD)
    reference.step(200_000)
    assert gas.state_hash == reference.state_hash


@forks
def test_runs_and_studies_work_in_a_forked_process(tmp_path):
    reference = haff.run(GAS).state_hash
    assert in_a_fork(lambda: haff.run(GAS).state_hash) == reference
    study = in_a_fork(lambda: haff.sweep(GAS, {"contact.restitution": [1.0, 0.9]}, output=tmp_path / "study"))
    assert study["state_hash"].values[0, 0] == reference
    message = str(in_a_fork(lambda: haff.run(GAS, contact__restitution=2)))
    assert "contact.restitution=2: must be in [0, 1]" in message


def test_a_simulation_says_that_it_cannot_be_copied():
    gas = haff.Simulation(GAS)
    for make in (pickle.dumps, copy.copy, copy.deepcopy):
        with pytest.raises(TypeError, match="a Simulation cannot be pickled or copied: make another one"):
            make(gas)


def test_files_and_frames_go_to_other_processes(tmp_path):
    """Pickled, they are opened again; in a forked process they are read as they are."""
    haff.run(GAS, file=tmp_path / "gas.h5", output__frames=0.5, output__events=True)
    with haff.open(tmp_path / "gas.h5") as run:
        expected = run.frames[2].position
        for thing, read in [
            (run, lambda run: run.frames[2].position),
            (run.frames[1:], lambda frames: frames[1].position),
            (run.frames[2], lambda frame: frame.position),
        ]:
            np.testing.assert_array_equal(read(pickle.loads(pickle.dumps(thing))), expected)
        assert len(pickle.loads(pickle.dumps(run.events))) == len(run.events)
        assert repr(pickle.loads(pickle.dumps(run.box))) == repr(run.box)
        if hasattr(os, "fork"):
            np.testing.assert_array_equal(in_a_fork(lambda: run.frames[2].position), expected)


@pytest.mark.parametrize("kill", [signal.SIGTERM, signal.SIGKILL])
@pytest.mark.parametrize("where", ["main thread", "beside a fork"])
def test_a_run_ends_with_a_checkpoint_when_its_python_is_killed(tmp_path, kill, where):
    """Elastic, so that it does not slow down: it would go on for hours."""
    path = tmp_path / "long.h5"
    gas = GAS | {"run": {"until": 1e7}, "output": {"frames": False, "observables": 1.0}}
    call = f"haff.run({gas!r}, file={os.fspath(path)!r}, threads=1)"
    if where == "main thread":
        program = f"import haff\n{call}"
    else:
        program = f"""
import os, threading, time, haff
threading.Thread(target=lambda: {call}).start()
while not os.path.exists({os.fspath(path)!r}):
    time.sleep(0.01)
# A process that lives on, and has copies of all that was open.
if os.fork() == 0:
    parent = os.getppid()
    while os.getppid() == parent:
        time.sleep(0.1)
    time.sleep(10)
    os._exit(0)
time.sleep(3600)
"""
    process = subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.DEVNULL)
    try:
        wait_for(lambda: path.exists() and is_running(path))
        process.send_signal(kill)
        assert process.wait(HANGS) == -kill
        wait_for(lambda: not is_running(path))
    finally:
        process.kill()
    with haff.open(path) as file:
        reached = file.observables["time"].iloc[-1]
    # The run has ended as by SIGTERM: with a checkpoint and a sample at its end, so that nothing is lost.
    found = report(path)
    assert (found["summary"]["stopped"], found["resumable"]) == ("signal", True)
    assert found["checkpoint_time"] == reached > 0


def is_running(path):
    try:
        with haff.open(path) as file:
            return file.running
    except haff.FileError:
        return True


def report(path):
    """What the command says of a file."""
    import json

    from haff.command.call import executable

    told = subprocess.run([executable(), "info", "--json", path], capture_output=True, text=True, check=True)
    return json.loads(told.stdout)


def wait_for(condition, seconds=HANGS):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"not within {seconds} s"
        time.sleep(0.02)
