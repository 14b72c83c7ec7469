"""Live simulations that are recorded: the file of `haff run`, particles that are added and removed, what is refused."""

import json
import os

import numpy as np
import pytest

import haff
from haff import figures
from pages import page_of

GAS = {
    "schema": 1,
    "seed": 7,
    "domain": {"packing_fraction": 0.1},
    "species": [{"name": "grain", "count": 60, "radius": 0.5, "mass": 1.0}],
    "initial": {"temperature": 1.0},
    "contact": {"restitution": 0.9},
    "run": {"until": 10.0},
    "output": {"frames": 1.0, "observables": 0.25, "events": True},
}

# A small Galton board: pins, a floor with rest, and balls that fall one after the other.
BOARD = {
    "schema": 1,
    "dimension": 2,
    "domain": {"size": [6.0, 9.0], "boundary": ["wall", "wall"], "gravity": [0.0, -10.0]},
    "species": [{"name": "ball", "count": 0, "radius": 0.1, "mass": 1.0}],
    "particle": [
        {"name": f"pin {row} {k}", "position": [3 + k - row / 2 + 0.01, 3.0 + row], "radius": 0.1, "mass": float("inf")}
        for row in range(3)
        for k in range(row + 1)
    ],
    "contact": {"restitution": 0.5},
    "run": {"until": 6.0},
    "output": {"frames": 0.05, "observables": 0.05, "events": True},
}


def report(run):
    return json.loads(run.stored.text("parameters/summary"))


def stream(file, **more):
    """Five balls, one in each half unit of time."""
    with haff.Simulation(BOARD, file=file, room=5, **more) as board:
        for k in range(5):
            board.add([3 + 0.02 * (k - 2), 8.0, 0.0], species="ball", radius=0.1, mass=1.0)
            board.advance(until=0.5 * (k + 1))
        board.advance(until=6.0)
    return board


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    path = tmp_path_factory.mktemp("board") / "board.h5"
    stream(path)
    return path


def test_the_file_is_that_of_a_run(tmp_path):
    done = haff.run(GAS, file=tmp_path / "run.h5")
    with haff.Simulation(GAS, file=tmp_path / "live.h5") as live:
        for until in (2.5, 2.6, 7.0):
            live.advance(until=until)
        live.run()
    assert live.state_hash == done.state_hash
    with haff.open(tmp_path / "run.h5") as run, haff.open(tmp_path / "live.h5") as mine:
        assert np.array_equal(run.frames.time, mine.frames.time)
        for name in ("position", "velocity", "image"):
            assert np.array_equal(run.frames.array(name), mine.frames.array(name))
        assert run.events.to_pandas().equals(mine.events.to_pandas())
        table = mine.observables[run.observables.columns]
        assert table.equals(run.observables)
        assert report(mine)["state_hash"] == done.state_hash and mine.title == run.title


def test_frames_have_the_balls_that_are_there(board):
    with haff.open(board) as run:
        pins = 6
        assert len(run) == pins + 5
        numbers = [len(frame.position) for frame in run.frames]
        # A ball is added at the time of a frame that is written already.
        assert numbers == [pins + min(5, int(np.ceil(time / 0.5 - 1e-9))) for time in run.frames.time]
        assert list(run.observables["particles"]) == numbers
        falling = run.frames.array("position")[:, pins, 1]
        assert np.isnan(falling[0]) and falling[1] == pytest.approx(8.0 - 5 * 0.05**2)
        assert np.all(run.radius == 0.1) and np.all(np.isinf(run.mass[:pins])) and np.all(run.mass[pins:] == 1.0)
        last = run.frames[-1]
        assert np.all(last.position[:, 1] > 0.1 - 1e-9) and len(last.position) == pins + 5


@pytest.mark.long
def test_readers_figures_pages_and_exports_take_the_file(board, tmp_path):
    page = page_of(board, tmp_path)
    assert page.header["count"] == 11 and len(page.header["frames"]["time"]) == 121
    with haff.open(board) as run:
        figures.save_all(run, ["snapshot", "energy", "losses", "means"], tmp_path)
        assert (tmp_path / "board-snapshot.png").stat().st_size > 5000
        run.export(tmp_path / "board.extxyz")
    assert (tmp_path / "board.extxyz").read_text().split("\n", 1)[0] == "6"


def test_events_name_the_rows_of_the_file(tmp_path):
    scene = BOARD | {"particle": BOARD["particle"][:1]}
    with haff.Simulation(scene, file=tmp_path / "a.h5", room=3, events=True) as live:
        first, second = live.add([[4.0, 1.0, 0.0], [5.0, 4.0, 0.0]], species="ball", radius=0.1, mass=[1.0, 2.0])
        live.advance(until=0.5)
        live.remove([first])
        third = live.add([2.0, 2.0, 0.0], species="ball", radius=0.2, mass=3.0)
        assert (first, second, third) == (1, 2, 2)
        live.advance(until=2.0)
        log = live.take_events()
    with haff.open(tmp_path / "a.h5") as run:
        assert list(run.mass[1:]) == [1.0, 2.0, 3.0] and list(run.radius[1:]) == [0.1, 0.1, 0.2]
        mine = run.events.to_pandas()
        hits = mine[mine["kind"] == "wall"]
        assert len(log[log["kind"] == "wall"]) == len(hits)
        # The ball of row 1 in the file is gone after t = 0.5, that of row 3 has row 2 in the simulation.
        assert set(hits["i"][hits["time"] > 0.5]) == {2, 3} and set(hits["i"][hits["time"] < 0.5]) == {1}
        times = run.frames.time
        there = np.isfinite(run.frames.array("position")[..., 0])
        assert np.array_equal(there[:, 1], (times > 0) & (times <= 0.5)) and np.array_equal(there[:, 3], times > 0.5)
        assert list(run.observables[["particles_in", "particles_out"]].iloc[-1]) == [3, 1]


def test_changes_are_events_of_the_file_also_if_python_takes_them(tmp_path):
    with haff.Simulation(GAS, file=tmp_path / "a.h5", events=True) as live:
        live.advance(until=1.0)
        live.velocities = 0.5 * live.velocities
        live.set(contact__restitution=0.5)
        assert list(live.take_events()["kind"])[-2:] == ["change", "change"]
        live.advance(until=2.0)
        later = live.take_events()
    with haff.open(tmp_path / "a.h5") as run:
        kinds = list(run.events.to_pandas()["kind"])
        assert kinds.count("change") == 2 and len(kinds) > kinds.index("change") + 2
        assert len(later) == len(kinds) - kinds.index("change") - 2


def test_info_counts_places_that_were_taken(tmp_path, command):
    """Not those that are kept for particles which have not come."""
    path, pins = tmp_path / "a.h5", len(BOARD["particle"])
    with haff.Simulation(BOARD, file=path, room=50) as live:
        for added in range(2):
            live.add([3.0, 8.0 - added, 0.0], species="ball", radius=0.1, mass=1.0)
    last = json.loads(command("info", path, "--json").stdout)
    assert last["particles"] == pins + 2
    assert dict(last["species"])["ball"] == 2 and sum(count for _, count in last["species"]) == pins + 2


def test_a_file_without_room_takes_no_particle(tmp_path):
    with haff.Simulation(BOARD, file=tmp_path / "a.h5", room=1) as live:
        live.add([3.0, 8.0, 0.0], species="ball", radius=0.1, mass=1.0)
        with pytest.raises(haff.ArgumentError, match=r"1 more particles, but .*a\.h5 has room for 0"):
            live.add([4.0, 8.0, 0.0], species="ball", radius=0.1, mass=1.0)
        assert len(live) == 7
        live.advance(until=1.0)
    with haff.open(tmp_path / "a.h5") as run:
        assert len(run.frames[-1].position) == 7


def test_records_by_collisions(tmp_path):
    output = {"frames": {"collisions_per_particle": 2.0}, "observables": 1.0}
    haff.run(GAS | {"output": output}, file=tmp_path / "run.h5")
    with haff.Simulation(GAS | {"output": output}, file=tmp_path / "live.h5") as live:
        live.advance(until=0.7)
        live.run()
    with haff.open(tmp_path / "run.h5") as run, haff.open(tmp_path / "live.h5") as mine:
        assert np.array_equal(run.frames.time, mine.frames.time) and len(run.frames) > 3


def test_a_closed_simulation_goes_on_without_its_file(tmp_path):
    live = haff.Simulation(GAS, file=tmp_path / "a.h5")
    live.advance(until=2.0)
    live.close()
    live.close()
    live.advance(until=4.0)
    assert live.time == 4.0
    with haff.open(tmp_path / "a.h5") as run:
        assert run.frames.time[-1] == 2.0 and report(run)["stopped"] == "closed"


def test_a_simulation_that_is_not_closed_leaves_a_file(tmp_path):
    live = haff.Simulation(GAS, file=tmp_path / "a.h5")
    live.advance(until=5.0)
    del live
    with haff.open(tmp_path / "a.h5") as run:
        assert run.frames.time[-1] == 5.0


def test_files_that_exist_are_kept(tmp_path):
    path = tmp_path / "a.h5"
    path.write_text("mine")
    with pytest.raises(haff.ArgumentError, match="exists; overwrite=True replaces it"):
        haff.Simulation(GAS, file=path)
    assert path.read_text() == "mine"
    with haff.Simulation(GAS, file=path, overwrite=True) as live:
        live.advance(until=1.0)
    with haff.open(path) as run:
        assert len(run.frames) == 2


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"room": 3}, haff.ArgumentError, "room and overwrite are for a simulation with a file"),
        ({"overwrite": True}, haff.ArgumentError, "are for a simulation with a file"),
        ({"file": 3}, haff.ArgumentError, "file = 3"),
        ({"file": "a.h5", "room": -1}, haff.ArgumentError, "room = -1"),
        ({"file": "none/a.h5"}, haff.FileError, "none/a.h5"),
    ],
)
def test_wrong_arguments_are_refused(tmp_path, monkeypatch, arguments, error, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error, match=message):
        haff.Simulation(GAS, **arguments)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_copy_of_the_process_does_not_write(tmp_path):
    live = haff.Simulation(GAS, file=tmp_path / "a.h5")
    live.advance(until=2.0)
    child = os.fork()
    if child == 0:
        live.advance(until=9.0)
        live.close()
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
    live.advance(until=5.0)
    live.close()
    with haff.open(tmp_path / "a.h5") as run:
        assert list(run.frames.time) == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
