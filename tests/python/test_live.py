"""Simulations inside Python: the same trajectory as the command's, snapshots, interruption, errors."""

import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import haff
from conftest import CONFIGS
from patience import HANGS

GAS = {
    "schema": 1,
    "seed": 3,
    "domain": {"packing_fraction": 0.2},
    "species": [{"name": "grain", "count": 500, "radius": 0.5, "mass": 1.0}],
    "contact": {"restitution": 0.9},
    "run": {"until": 5.0},
}


def test_state_is_that_of_the_command_for_any_step_length(command):
    silent = {"output__file": False, "output__events": False}
    reference = command.run("cooling", output=False, species__0__count=500, run__until=5.0, **silent)
    scene = CONFIGS / "cooling.toml"
    for stops in ([5.0], np.linspace(0.0, 5.0, 37)):
        live = haff.Simulation(scene, species__0__count=500, run__until=5.0)
        for stop in stops:
            assert live.advance(until=stop) == "until"
            assert live.time == stop
        assert live.state_hash == reference.report["state_hash"]
        assert live.collisions == reference.report["collisions"]
    by_collisions = haff.Simulation(scene, species__0__count=500, run__until=5.0, threads=1)
    while by_collisions.time < 5.0:
        by_collisions.step(collisions=97, until=5.0)
    assert by_collisions.state_hash == reference.report["state_hash"]
    whole = haff.Simulation(scene, species__0__count=500, run__until=5.0)
    assert whole.run() == "until"
    assert whole.state_hash == reference.report["state_hash"]


def test_step_makes_the_exact_number_of_collisions():
    gas = haff.Simulation(GAS)
    for total in (1, 2, 12):
        assert gas.step(total - gas.collisions) == "collisions"
        assert gas.collisions == total


def test_snapshots_are_read_only_and_do_not_change():
    gas = haff.Simulation(GAS)
    before = gas.positions
    assert gas.positions is before, "one snapshot per instant"
    assert before.shape == gas.velocities.shape == gas.images.shape == (500, 3)
    assert (before.dtype, gas.images.dtype) == (np.float64, np.int32)
    assert not before.flags.owndata or before.base is None
    with pytest.raises(ValueError, match="read-only"):
        before[0, 0] = 1.0
    copy = before.copy()
    gas.advance(until=1.0)
    np.testing.assert_array_equal(before, copy)
    assert not np.array_equal(gas.positions, copy)
    size = gas.box.size
    assert ((gas.positions >= 0) & (gas.positions < size)).all()
    np.testing.assert_allclose(gas.unwrapped - gas.images * size, gas.positions, atol=1e-12)


def test_energy_and_momentum_of_snapshots_balance():
    gas = haff.Simulation(GAS, events=True)
    first = gas.sample()
    assert first["temperature"] == pytest.approx(1.0, rel=1e-12)
    gas.advance(until=2.0)
    events, sample = gas.take_events(), gas.sample()
    assert len(events) == gas.collisions == sample["collisions"] > 500
    assert (events["kind"] == "collision").all() and events["time"].is_monotonic_increasing
    assert events["energy_loss"].sum() == pytest.approx(sample["dissipated_energy"], rel=1e-12)
    kinetic = 0.5 * np.sum(gas.masses * np.sum(gas.velocities**2, axis=1))
    # Sums of 500 terms in a different order.
    assert kinetic == pytest.approx(sample["kinetic_energy"], rel=1e-13)
    assert first["kinetic_energy"] - kinetic == pytest.approx(sample["dissipated_energy"], rel=1e-12)
    assert abs(sample["ledger_residual"]) < 1e-13 and gas.max_overlap < 1e-12
    assert len(gas.take_events()) == 0
    with pytest.raises(ValueError, match="events=True"):
        haff.Simulation(GAS).take_events()


def test_columns_are_those_of_files(command):
    run = command.run("gravity_box", species__0__count=50, run__until=0.5, output__events=True)
    live = haff.Simulation(CONFIGS / "gravity_box.toml", species__0__count=50, run__until=0.5, events=True)
    with run.open() as file:
        live.advance(until=0.5)
        events = live.take_events()
        np.testing.assert_array_equal(events.columns, file.events[:1].columns)
        recorded = file.events.to_pandas()
        for name in recorded:
            np.testing.assert_array_equal(np.asarray(events[name]), np.asarray(recorded[name]), err_msg=name)
        np.testing.assert_array_equal(live.positions, file.frames[-1].position)
        np.testing.assert_array_equal(live.velocities, file.frames[-1].velocity)
        flat = {k: v for k, v in live.sample().items() if np.ndim(v) == 0}
        assert set(flat) <= set(file.observables), "scalars bear the names of files"
        assert live.species_names == file.species_names
        assert live.box.boundary == file.box.boundary


def test_rest_energy_is_a_column_where_grains_may_rest(command):
    overrides = {"species__0__count": 50, "run__until": 0.5, "contact__rest_speed": 0.01}
    live = haff.Simulation(CONFIGS / "gravity_box.toml", **overrides)
    assert live.sample()["rest_energy"] == 0.0
    with command.run("gravity_box", **overrides).open() as file:
        assert "rest_energy" in file.observables


def test_linkages_run_from_python(command):
    pendulums = haff.Simulation(CONFIGS / "textbook" / "pendulums.toml")
    assert pendulums.run() in ("until", "collisions", "rest")
    assert abs(pendulums.sample()["ledger_residual"]) < 1e-12
    spring = haff.Simulation(CONFIGS / "textbook" / "spring_impact.toml")
    with command.run("textbook/spring_impact").open() as file:
        scalars = {name for name, value in spring.sample().items() if np.ndim(value) == 0}
        assert {"spring_energy", "gravity_energy"} <= scalars <= set(file.observables)


def test_scene_can_start_from_a_file(command):
    run = command.run("cooling", species__0__count=500, run__until=2.0)
    live = haff.Simulation(CONFIGS / "cooling.toml", species__0__count=500, initial={"positions": {"file": run.path}})
    with run.open() as file:
        np.testing.assert_array_equal(live.positions, file.frames[-1].position)
        np.testing.assert_array_equal(live.velocities, file.frames[-1].velocity)
    with pytest.raises(haff.HaffError, match="no_such"):
        haff.Simulation(CONFIGS / "cooling.toml", initial={"positions": {"file": "no_such.h5"}})


def test_keys_change_when_the_file_of_the_start_is_gone(tmp_path):
    scene = GAS | {"output": {"file": str(tmp_path / "start.h5"), "frames": 1.0}}
    start = haff.run(scene).path
    live = haff.Simulation(GAS, initial={"positions": {"file": start}})
    start.unlink()
    live.advance(1.0)
    live.set(contact__restitution=0.5)
    live.advance(2.0)
    assert "restitution = 0.5" in live.scene_text
    assert live.sample()["ledger_residual"] == pytest.approx(0.0, abs=1e-12)


def test_advance_returns_rest_when_nothing_moves():
    nothing = {"schema": 1, "domain": {"size": [5, 5, 5]}, "run": {"until": 1.0}}
    nothing["particle"] = [{"position": [2.5, 2.5, 2.5], "radius": 0.5, "mass": 1.0}]
    assert haff.Simulation(nothing).advance(until=1.0) == "rest"


def test_other_threads_run_and_read_while_it_advances():
    gas = haff.Simulation(GAS, species__0__count=2000, contact__restitution=1.0)
    seen, done = [], threading.Event()

    def look():
        while not done.is_set():
            seen.append((gas.time, len(gas.positions)))
            time.sleep(0.001)

    watcher = threading.Thread(target=look)
    watcher.start()
    try:
        # On a busy machine the second thread may be late.
        for leg in range(2000):
            gas.advance(until=20.0 * (leg + 1))
            during_step = [t for t, _ in seen if 20.0 * leg < t < 20.0 * (leg + 1)]
            if during_step:
                break
    finally:
        done.set()
        watcher.join(timeout=HANGS)
    assert not watcher.is_alive() and {count for _, count in seen} == {2000}
    assert during_step and gas.time == 20.0 * (leg + 1)


def test_ctrl_c_stops_between_events_and_the_run_can_continue():
    program = f"""
import haff, signal, threading, time
# A background process that starts the tests can pass on that SIGINT is ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
gas = haff.Simulation({GAS!r}, contact__restitution=1.0, species__0__count=2000)
def tell():
    while gas.time == 0:
        time.sleep(0.001)
    print("on", flush=True)
threading.Thread(target=tell, daemon=True).start()
try:
    gas.advance(until=1e9)
except KeyboardInterrupt:
    reached = gas.time
    assert 0 < reached < 1e9
    gas.advance(until=reached + 1.0)
    assert gas.max_overlap < 1e-12
    print("went on")
"""
    process = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "on\n"
    process.send_signal(signal.SIGINT)
    try:
        out, _ = process.communicate(timeout=HANGS)
    finally:
        process.kill()
    assert (process.returncode, out) == (0, "went on\n")


def test_errors_have_position_and_message(tmp_path):
    with pytest.raises(haff.SceneError) as caught:
        haff.Simulation(GAS, contact__restitution=1.2, species__0__radius=-1)
    texts = [str(problem) for problem in caught.value.problems]
    assert "contact.restitution=1.2: must be in [0, 1]" in texts and len(texts) == 2, texts
    broken = GAS | {"contact": {"restitution": 1.2}}
    with pytest.raises(haff.SceneError, match=r"^scene: contact\.restitution = 1\.2: must be in \[0, 1\]$"):
        haff.Simulation(broken)
    path = haff.save_scene(broken, tmp_path / "broken.toml")
    with pytest.raises(haff.SceneError) as caught:
        haff.Simulation(path)
    (problem,) = caught.value.problems
    line = 1 + path.read_text().splitlines().index("restitution = 1.2")
    assert (problem.file, problem.line, problem.key) == (str(path), line, "contact.restitution")
    assert str(problem).startswith(f"{path}:{line}: ")
    with pytest.raises(haff.FileError, match="no_such"):
        haff.Simulation(tmp_path / "no_such.toml")
    with pytest.raises(haff.SceneError, match=r"engine\.neighbors"):
        haff.Simulation(CONFIGS / "gravity_box.toml", engine__neighbors="windows")
    gas = haff.Simulation(GAS)
    gas.advance(until=1.0)
    for until in (0.5, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="until = "):
            gas.advance(until=until)
    for threads in (0, 100_000):
        with pytest.raises(ValueError, match="threads = "):
            haff.Simulation(GAS, threads=threads)


def test_collapse_error_names_the_remedies():
    stack = {
        "schema": 1,
        "domain": {"boundary": ["open", "open", "open"], "gravity": [0, 0, -1]},
        "wall": [{"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "particle": [{"position": [0, 0, z], "radius": 0.5, "mass": 1.0} for z in (1.0, 2.5)],
        "contact": {"restitution": 0.3},
        "run": {"until": 100.0},
    }
    for going in (haff.run, lambda scene: haff.Simulation(scene).run()):
        with pytest.raises(haff.SimulationError, match=r"(?s)collapse.*particle.*contact\.tc"):
            going(stack)


def test_a_run_that_ends_with_an_error_keeps_its_temporary_file(tmp_path):
    """Of a template no file is named; what happened before a collapse is in ``error.result``."""
    scene = haff.template("galton_board")
    scene["contact"] = {"restitution": 0.2}
    with pytest.raises(haff.SimulationError, match="collapse") as caught:
        haff.run(scene)
    result = caught.value.result
    assert result.stopped == "collapse" and 0 < result.simulated_time < 130
    assert result.file.frames[-1].time == result.simulated_time
    assert result.save(tmp_path / "kept.h5").stat().st_size > 0
