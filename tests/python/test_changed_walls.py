"""Runs that go on with changed keys: they act from now on, walls go on from where they are, and every reader of the new
file finds them there."""

from __future__ import annotations

import json
import signal
import subprocess
import time

import numpy as np
import pytest

import haff
from pages import in_node, page_of
from validation.runs import executable

# Spheres between a floor and a piston that is lowered.
PISTON = {
    "schema": 1,
    "seed": 2,
    "domain": {"size": [6.0, 6.0, 24.0], "boundary": ["periodic", "periodic", "open"]},
    "species": [{"name": "s", "count": 60, "radius": 0.25, "mass": 1.0}],
    "initial": {"positions": "random", "temperature": 1.0},
    "run": {"until": 60.0},
    "output": {"frames": 2.0, "observables": 2.0, "events": True},
    "wall": [
        {"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},
        {"name": "piston", "plane": {"point": [0, 0, 24], "normal": [0, 0, -1]}, "velocity": [0, 0, -0.2]},
    ],
}
# A vibrated floor.
SHAKER = {
    "schema": 1,
    "seed": 1,
    "domain": {"size": [6.0, 6.0, 60.0], "boundary": ["periodic", "periodic", "open"], "gravity": [0, 0, -1]},
    "species": [{"name": "g", "count": 36, "radius": 0.5, "mass": 1.0}],
    "initial": {"positions": "random", "temperature": 1.0},
    "contact": {"restitution": 0.9},
    "run": {"until": 20.3},
    "output": {"frames": 1.0, "observables": 1.0, "events": True},
    "wall": [
        {
            "name": "floor",
            "plane": {"point": [0, 0, 1], "normal": [0, 0, 1]},
            "motion": {"kind": "sine", "amplitude": 1.0, "frequency": 0.3},
        }
    ],
}
# A box whose walls oscillate.
BOX = {
    "schema": 1,
    "seed": 3,
    "dimension": 2,
    "domain": {"size": [12.0, 12.0], "boundary": ["wall", "wall"]},
    "species": [{"name": "d", "count": 40, "radius": 0.4, "mass": 1.0}],
    "initial": {"positions": "random", "temperature": 1.0},
    "contact": {"restitution": 0.9},
    "run": {"until": 10.2},
    "output": {"frames": 0.5, "observables": 0.5, "events": True},
    "wall": [
        {"name": "x-", "motion": {"kind": "sine", "amplitude": 0.2, "frequency": 1.0, "phase": 2.0}},
        {"name": "y+", "motion": {"kind": "triangle", "amplitude": 0.3, "frequency": 0.7}},
    ],
}
BALL = {
    "schema": 1,
    "domain": {"boundary": ["open"] * 3},
    "particle": [{"name": "ball", "position": [0, 0, 1], "velocity": [0, 0, 1], "radius": 0.2, "mass": 1.0}],
    "run": {"until": 5.0},
    "output": {"frames": 1.0},
    "wall": [{"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
}


def wave(motion, at):
    """The shift of an oscillation at times, from the keys of the scene."""
    cycles = motion["frequency"] * at + motion.get("phase", 0.0) / (2 * np.pi)
    if motion["kind"] == "sine":
        return motion["amplitude"] * np.sin(2 * np.pi * cycles)
    return motion["amplitude"] * (1 - np.abs(4 * ((cycles + 0.25) % 1) - 2))


def walls(run):
    """Normal of each wall of a file, and its place along the normal as a function of time, from the recorded scene."""
    found = []
    entries = run.scene.get("wall", [])
    for axis in range(run.dimension):
        if run.box.boundary[axis] == "wall":
            for side, name in ((0, "-"), (1, "+")):
                own = next((w for w in entries if w["name"] == "xyz"[axis] + name and "plane" not in w), {})
                normal = np.eye(3)[axis] * (1 - 2 * side)
                found.append((normal, -side * run.box.size[axis] + own.get("displacement", 0.0), 0.0, own))
    for own in entries:
        if "plane" in own:
            three = lambda given: np.array([*given, 0.0, 0.0, 0.0][:3], float)  # noqa: E731
            normal = three(own["plane"]["normal"]) / np.linalg.norm(own["plane"]["normal"])
            speed = three(own.get("velocity", ())) @ normal
            found.append((normal, three(own["plane"]["point"]) @ normal, speed, own))

    def place(at, offset, speed, own):
        shift = wave(own["motion"], at) if "motion" in own else 0.0
        return offset + speed * (at - own.get("reference_time", 0.0)) + shift

    return [(n, lambda at, o=o, v=v, own=own: place(np.asarray(at), o, v, own)) for n, o, v, own in found]


def check_walls(path):
    """Grains are on the inside of all walls in all frames, and touch them at their contacts."""
    with haff.open(path) as run:
        position = run.frames.array("position")
        contacts = 0
        table = run.events.to_pandas() if "events" in run else None
        for index, (normal, place) in enumerate(walls(run)):
            gap = position @ normal - place(run.frames.time)[:, None] - run.radius
            # A frame is taken at its time to a tick of the clock; coordinates up to 60 are rounded to 1e-14.
            assert gap.min() > -1e-12, f"wall {index}: {gap.min()}"
            if table is None:
                continue
            own = table[(table["kind"] == "wall") & (table["j"] == index)]
            points = own[[f"position_{axis}" for axis in "xyz"]].to_numpy()
            off = points @ normal - place(own["time"].to_numpy())
            contacts += len(own)
            assert np.abs(off).max(initial=0.0) < 1e-12, f"wall {index}: contacts off by {np.abs(off).max()}"
        residual = np.abs(run.samples["ledger_residual"])
        assert residual.max() < 1e-12, residual.max()
        return contacts


def scene_of(path):
    with haff.open(path) as run:
        return {wall["name"]: wall for wall in run.scene["wall"]}


def on(path, new, until, **keys):
    """A part of a chain; checks the file."""
    result = haff.resume(path, file=new, run__until=until, threads=1, **keys)
    assert result.max_overlap < 1e-12
    check_walls(new)
    return result


@pytest.mark.long
def test_a_stopped_piston_stays_and_a_reversed_one_starts_there(tmp_path):
    first, held, up = (tmp_path / name for name in ("first.h5", "held.h5", "up.h5"))
    haff.run(PISTON, file=first, threads=1)
    assert check_walls(first) > 100
    work = on(first, held, 80.0, wall__piston__velocity=[0, 0, 0])["wall_work"]
    assert scene_of(held)["piston"]["plane"]["point"] == [0.0, 0.0, 12.0]
    with haff.open(held) as run:
        height = run.frames.array("position")[..., 2]
        assert height.max() <= 12 - 0.25 + 1e-12 and height.max() > 10
        assert np.ptp(run.samples["wall_work"]) == 0 and run.samples["wall_work"][-1] == work > 0
    on(held, up, 90.0, wall__piston__velocity=[0, 0, 0.5])
    piston = scene_of(up)["piston"]
    assert (piston["plane"]["point"], piston["reference_time"]) == ([0.0, 0.0, 12.0], 80.0)
    # With other keys it goes on as it is, and the velocity it has already changes nothing.
    same = on(up, tmp_path / "a.h5", 95.0)
    for k, keys in enumerate(({"wall__piston__velocity": [0, 0, 0.5]}, {"title": "again"})):
        found = on(up, tmp_path / f"b{k}.h5", 95.0, **keys)
        assert found.state_hash == same.state_hash
        assert scene_of(tmp_path / f"b{k}.h5")["piston"] == piston


def test_a_frequency_is_raised_in_steps_with_a_continuous_phase(tmp_path):
    path, end = tmp_path / "0.h5", 20.3
    haff.run(SHAKER, file=path, threads=1)
    cycles, frequency = 0.3 * end, 0.3
    for step in range(1, 6):
        frequency, end, new = frequency + 0.013, end + 7.7, tmp_path / f"{step}.h5"
        on(path, new, end, wall__floor__motion__frequency=frequency)
        floor = scene_of(new)["floor"]
        assert floor["plane"]["point"] == [0.0, 0.0, 1.0], "the mean position stays"
        phase = 2 * np.pi * frequency * (end - 7.7) + floor["motion"]["phase"]
        assert np.exp(1j * phase) == pytest.approx(np.exp(2j * np.pi * cycles), abs=1e-13)
        cycles, path = cycles + 7.7 * frequency, new


def test_an_amplitude_acts_from_the_present_phase_about_a_displaced_mean_position(tmp_path):
    first, new, back = (tmp_path / name for name in ("first.h5", "new.h5", "back.h5"))
    haff.run(SHAKER, file=first, threads=1)
    on(first, new, 30.0, wall__floor__motion__amplitude=1.2)
    shift = np.sin(2 * np.pi * 0.3 * 20.3)
    floor = scene_of(new)["floor"]
    assert floor["plane"]["point"][2] == pytest.approx(1 - 0.2 * shift, abs=1e-14)
    assert floor["motion"] == {"kind": "sine", "amplitude": 1.2, "frequency": 0.3, "phase": 0.0}
    # The mean position is a key: set together with the amplitude it stays, and the wall jumps if there is room.
    with pytest.raises(haff.SceneError, match='would overlap with wall "floor"'):
        haff.resume(new, file=back, run__until=35.0, wall__floor__plane__point=[0, 0, 9.0])
    assert not back.exists()
    on(new, back, 35.0, wall__floor__plane__point=[0, 0, -3.0], wall__floor__motion__amplitude=0.5)
    assert scene_of(back)["floor"]["plane"]["point"] == [0.0, 0.0, -3.0]


def test_walls_start_and_stop_to_oscillate(tmp_path):
    first, still, moved, again = (tmp_path / f"{k}.h5" for k in range(4))
    haff.run(SHAKER, file=first, threads=1)
    on(first, still, 25.1, wall__floor__velocity=[0, 0, 0])
    stopped = scene_of(still)["floor"]
    assert "motion" not in stopped
    at = stopped["plane"]["point"][2]
    assert at == pytest.approx(1 + np.sin(2 * np.pi * 0.3 * 20.3), abs=1e-14)
    on(still, moved, 31.7, wall__floor__motion={"kind": "triangle", "amplitude": 0.4, "frequency": 0.9})
    floor = scene_of(moved)["floor"]
    assert floor["plane"]["point"][2] == at and "velocity" not in floor
    assert wave(floor["motion"], 25.1) == pytest.approx(0, abs=1e-14)
    assert wave(floor["motion"], 25.1 + 0.25 / 0.9) == pytest.approx(0.4, abs=1e-14)
    # A phase is a key, too: at its word, about the mean position.
    on(moved, again, 33.0, wall__floor__motion__phase=0.5, wall__floor__plane__point=[0, 0, -1])
    assert scene_of(again)["floor"]["motion"]["phase"] == 0.5


def test_walls_of_the_box_are_displaced_and_stop(tmp_path):
    first, louder, stopped, sine = (tmp_path / f"{k}.h5" for k in range(4))
    haff.run(BOX, file=first, threads=1)
    assert check_walls(first) > 50
    motion = {wall["name"]: wall["motion"] for wall in BOX["wall"]}
    on(first, louder, 14.9, **{"wall__x-__motion__amplitude": 0.35, "wall__y+__motion__frequency": 0.9})
    found = scene_of(louder)
    assert found["x-"]["displacement"] == pytest.approx(-0.15 / 0.2 * wave(motion["x-"], 10.2), abs=1e-14)
    assert "displacement" not in found["y+"]
    on(louder, stopped, 20.0, **{"wall__y+__velocity": [0, 0]})
    found = scene_of(stopped)
    assert set(found["y+"]) == {"name", "displacement"}
    cycles = 0.7 * 10.2 + 0.9 * 4.7
    shift = 0.3 * (1 - abs(4 * ((cycles + 0.25) % 1) - 2))
    assert found["y+"]["displacement"] == pytest.approx(shift, abs=1e-13)
    on(stopped, sine, 25.0, **{"wall__y+__motion": {"kind": "sine", "amplitude": 0.1, "frequency": 2.0}})
    assert scene_of(sine)["y+"]["displacement"] == found["y+"]["displacement"]


def test_checks_look_at_the_present_not_at_the_start(tmp_path):
    first = tmp_path / "first.h5"
    haff.run(BALL, file=first)
    # The ball is at z = 6 by now.
    raised = haff.resume(first, file=tmp_path / "raised.h5", run__until=10.0, wall__floor__plane__point=[0, 0, 3])
    assert raised.collisions == 0 and raised.simulated_time == 10.0
    # The scene of the new file has a ball that starts behind the floor; it is resumed all the same.
    again = haff.resume(tmp_path / "raised.h5", file=tmp_path / "again.h5", run__until=12.0)
    assert again.simulated_time == 12.0
    with pytest.raises(haff.SceneError, match=r'particle 0 would overlap with wall "floor" by 1\.0e0 radii'):
        haff.resume(first, file=tmp_path / "no.h5", run__until=10.0, wall__floor__plane__point=[0, 0, 6])
    # An oscillation through a body that is fixed is refused as at the start.
    fixed = BALL | {"particle": [*BALL["particle"], {"position": [5, 0, 1], "radius": 0.2, "mass": float("inf")}]}
    haff.run(fixed, file=tmp_path / "fixed.h5")
    shaken = {"kind": "sine", "amplitude": 0.9, "frequency": 1.0}
    with pytest.raises(haff.SceneError, match="would sweep through the fixed particle 1"):
        haff.resume(tmp_path / "fixed.h5", file=tmp_path / "no.h5", run__until=9.0, wall__floor__motion=shaken)
    assert not (tmp_path / "no.h5").exists()


def chain(random, name):
    """Random keys of one change of a wall."""
    a, f = float(random.uniform(0.05, 0.4)), float(random.uniform(0.2, 1.0))
    return [
        {f"wall__{name}__motion__frequency": f},
        {f"wall__{name}__motion__amplitude": a},
        {f"wall__{name}__motion__frequency": f, f"wall__{name}__motion__amplitude": a},
        {f"wall__{name}__motion__kind": ["sine", "triangle"][random.integers(2)]},
        {f"wall__{name}__restitution": float(random.uniform(0.8, 1.0))},
        {f"wall__{name}__velocity": [0, 0] if len(name) == 2 else [0, 0, float(random.uniform(-0.05, 0.02))]},
        {f"wall__{name}__motion": {"kind": "sine", "amplitude": a, "frequency": f}},
    ][random.integers(7)]


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6))
def test_random_chains_of_changes_are_right_in_every_file_and_the_same_live(seed, tmp_path):
    scene, name = [(SHAKER, "floor"), (BOX, "x-"), (PISTON, "piston")][seed % 3]
    random = np.random.default_rng(seed)
    path, end = tmp_path / "0.h5", scene["run"]["until"]
    haff.run(scene, file=path, threads=1)
    live = haff.Simulation(scene)
    live.advance(end)
    for step in range(1, 6):
        keys = chain(random, name)
        motion = scene_of(path)[name].get("motion")
        if motion is None and any("motion__" in key for key in keys):
            continue
        new, end = tmp_path / f"{step}.h5", end + float(random.uniform(1.0, 4.0))
        result = on(path, new, end, **keys)
        live.set(**keys)
        live.advance(end)
        assert live.state_hash == result.state_hash, (step, keys)
        with haff.open(new) as run:
            recorded = list(run.scene["wall"])
        assert haff.scenes.tomllib.loads(live.scene_text)["wall"] == recorded
        path = new
    assert abs(live.sample()["ledger_residual"]) < 1e-12


def test_a_changed_run_that_is_killed_goes_on_with_its_walls(tmp_path):
    first, killed = tmp_path / "first.h5", tmp_path / "killed.h5"
    haff.run(SHAKER, file=first, threads=1)
    keys = {"wall__floor__motion__frequency": 0.4, "wall__floor__motion__amplitude": 0.7}
    sets = [f"--set={key.replace('__', '.')}={value}" for key, value in keys.items()]
    more = ["--set=run.until=1e7", "--set=output.checkpoint=5.0", "--set=output.events=false", "-o", killed, "-q"]
    process = subprocess.Popen([executable(), "run", "--resume", first, *sets, *more])
    while True:
        found = subprocess.run([executable(), "info", killed, "--json"], capture_output=True, text=True)
        if found.returncode == 0 and (json.loads(found.stdout)["checkpoint_time"] or 0) > 30:
            break
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    with haff.open(killed) as run:
        reached = float(run.frames.time[-1])
    end = reached + 10.0
    after = on(killed, tmp_path / "after.h5", end)
    whole = haff.resume(first, file=tmp_path / "whole.h5", run__until=end, threads=1, **keys)
    assert after.state_hash == whole.state_hash


def test_the_terms_of_earlier_parts_and_of_the_change_are_in_the_new_file(tmp_path):
    first, light = tmp_path / "first.h5", tmp_path / "light.h5"
    haff.run(SHAKER, file=first, threads=1)
    on(first, light, 30.0, domain__gravity=[0, 0, -0.5])
    with haff.open(light) as run:
        table = run.samples
        energy = table["kinetic_energy"] + table["potential_energy"] + table["dissipated_energy"]
        given = table["wall_work"] + table["change_work"]
        start = energy - given
        assert table["change_work"][0] < 0
        assert np.ptp(start) < 1e-11 * np.abs(energy).max(), "the balance of the file closes"
        figure = run.plot("energy")
        top = figure.axes[0]
        supply = next(line for line in top.lines if "E_0" in line.get_label()).get_ydata()
        stacked = energy - table["dissipated_energy"][0] - min(0.0, float(table["potential_energy"].min()))
        np.testing.assert_allclose(supply, stacked, rtol=1e-9)


@pytest.mark.parametrize("scene", [PISTON, SHAKER, BOX], ids=["piston", "shaker", "box"])
def test_pages_show_the_walls_where_they_are(scene, tmp_path):
    first, new = tmp_path / "first.h5", tmp_path / "new.h5"
    haff.run(scene, file=first, threads=1)
    keys = {
        24.0: {"wall__piston__velocity": [0, 0, 0.1]},
        60.0: {"wall__floor__motion__amplitude": 0.8, "wall__floor__motion__frequency": 0.35},
        12.0: {"wall__x-__motion__amplitude": 0.3},
    }[scene["domain"]["size"][-1]]
    on(first, new, scene["run"]["until"] + 5.0, **keys)
    header = page_of(new, tmp_path).header
    with haff.open(new) as run:
        when = run.frames.time
        expected = walls(run)
    box = [{"point": [0, 0, 0], "normal": n.tolist(), "velocity": [0, 0, 0]} for n, _ in expected]
    for k, name in enumerate(["x-", "x+", "y-", "y+"] if scene is BOX else []):
        box[k]["point"] = [12.0 * (name == "x+"), 12.0 * (name == "y+"), 0.0]
        box[k] |= {"motion": header["motions"].get(name), "displacement": header["displacements"].get(name)}
    drawn = header["walls"] or box
    program = f"""
        const at = {json.dumps(when.tolist())};
        console.log(JSON.stringify({json.dumps(drawn)}.map((wall) => at.map((t) => moved(wall, t)))));
    """
    shifts = in_node(tmp_path, ["surroundings.js"], program, header)
    assert len(shifts) == len(expected)
    for wall, shift, (normal, place) in zip(drawn, shifts, expected):
        np.testing.assert_allclose((np.array(wall["point"]) + shift) @ normal, place(when), atol=1e-12)
    if scene is PISTON:
        # The piston is drawn within the room of the particles and itself.
        assert header["walls"][1]["point"][2] == pytest.approx(12.0, abs=1e-12)


def test_only_keys_of_what_may_change_are_changed(tmp_path):
    first = tmp_path / "first.h5"
    haff.run(BALL, file=first)
    live = haff.Simulation(BALL)
    live.advance(1.0)
    before = (live.state_hash, live.scene_text)
    for keys, why in (
        ({"species__0__count": 3}, "cannot change in a run that goes on"),
        ({"seed": 3}, "cannot change in a run that goes on"),
        ({"wall__floor__restitution": 1.5}, r"must be in \[0, 1\]"),
        ({"wall__floor__velocitty": [0, 0, 1]}, "unknown key; did you mean"),
        ({"wall__floor__displacement": 0.5}, "is for walls of domain.boundary"),
        ({"wall__floor__reference_time": 0.5}, "is for walls with a velocity"),
    ):
        with pytest.raises(haff.SceneError, match=why) as error:
            haff.resume(first, file=tmp_path / "no.h5", run__until=9.0, **keys)
        assert "--set" not in str(error.value)
        with pytest.raises(haff.SceneError, match=why) as error:
            live.set(**keys)
        assert str(error.value).startswith(f"{next(iter(keys)).replace('__', '.')}=")
    with pytest.raises(haff.SceneError, match=r"contact, domain\.gravity, wall"):
        live.set(run__until=9.0)
    with pytest.raises(ValueError, match='would overlap with wall "floor"'):
        live.set(wall__floor__plane__point=[0, 0, 2.1])
    assert (live.state_hash, live.scene_text) == before
    with pytest.raises(haff.SceneError, match=r"name a new file for it \(file=…\)"):
        haff.resume(first, run__until=9.0)
    live.set()
    assert live.state_hash == before[0]
    live.set(domain__gravity=[0, 0, -2], contact__restitution=0.5)
    assert live.gravity.tolist() == [0, 0, -2] and live.sample()["change_work"] == pytest.approx(2 * 2.0)


def test_a_live_simulation_changes_its_walls_after_its_particles(tmp_path):
    live = haff.Simulation(PISTON, events=True)
    live.advance(20.0)
    live.remove(np.arange(10))
    live.set(wall__piston__velocity=[0, 0, 0], wall__floor__temperature=2.0)
    assert live.wall_names == ["floor", "piston"] and len(live) == 50
    live.advance(40.0)
    assert live.positions[:, 2].max() <= 20 - 0.25 + 1e-12
    sample = live.sample()
    assert sample["wall_heat"] != 0 and abs(sample["ledger_residual"]) < 1e-12
    table = live.take_events()
    assert list(table["time"][table["kind"] == "change"]) == [20.0, 20.0]
    assert {"impulse_vector_x", "impulse_vector_y"} <= set(table.columns)
