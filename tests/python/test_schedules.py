"""Records by numbers of collisions: when they are taken, also after a resume, and what is refused."""

import json

import numpy as np
import pytest

import haff
from conftest import CONFIGS
from validation.runs import toml

GAS = {
    "schema": 1,
    "seed": 3,
    "domain": {"packing_fraction": 0.2},
    "species": [{"name": "grain", "count": 101, "radius": 0.5, "mass": 1.0}],
    "initial": {"temperature": 1.0},
    "contact": {"restitution": 0.9},
    "run": {"collisions_per_particle": 21.0},
    "output": {"frames": {"collisions_per_particle": 4.0}, "observables": {"collisions_per_particle": 1.0}},
}
EACH = 202  # 4 · 101/2 collisions


def test_frames_and_rows_are_at_multiples_of_the_number(tmp_path):
    haff.run(GAS, file=tmp_path / "gas.h5")
    with haff.open(tmp_path / "gas.h5") as run:
        last = 1061  # 21 · 101/2, rounded up
        assert [frame.step for frame in run.frames] == [*range(0, last, EACH), last]
        # 101/2 is rounded up. Each frame has a row of its own time, too.
        rows = sorted({*range(0, last, 51), last, *range(0, last, EACH)})
        assert list(run.observables["collisions"]) == rows
        at_frames = run.observables["time"][[rows.index(frame.step) for frame in run.frames]]
        assert np.array_equal(at_frames, run.frames.time)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("search", ["cells", "windows", "all_pairs"])
def test_records_are_the_same_in_every_search(tmp_path, search, threads):
    many = GAS | {"engine": {"neighbors": search}}
    haff.run(GAS, file=tmp_path / "a.h5", threads=1)
    haff.run(many, file=tmp_path / "b.h5", threads=threads)
    with haff.open(tmp_path / "a.h5") as a, haff.open(tmp_path / "b.h5") as b:
        assert np.array_equal(a.frames.time, b.frames.time)
        assert np.array_equal(a.frames.array("position"), b.frames.array("position"))


def test_a_resumed_run_has_the_records_of_an_uninterrupted_one(tmp_path):
    whole, part, rest = (tmp_path / f"{name}.h5" for name in ("whole", "part", "rest"))
    haff.run(GAS, file=whole)
    with haff.open(whole) as run:
        times, steps = run.frames.time, [frame.step for frame in run.frames]
        between = 0.5 * (times[2] + times[3])
    haff.run(GAS, file=part, run__until=float(between))
    haff.resume(part, file=rest, run__until=1e6)
    with haff.open(rest) as run:
        assert [frame.step for frame in run.frames][1:] == steps[3:]
        assert np.array_equal(run.frames.time[1:], times[3:])


def test_a_record_is_taken_after_all_events_of_its_instant(tmp_path):
    # Two pairs collide at t = 1, one pair at t = 2.
    scene = {
        "schema": 1,
        "dimension": 2,
        "domain": {"boundary": ["open", "open"]},
        "particle": [
            {"position": [x, y], "velocity": [v, 0.0], "radius": 0.5, "mass": 1.0}
            for y in (0.0, 5.0)
            for x, v in ((0.0, 1.0), (3.0, -1.0))
        ]
        + [{"position": [0.0, 10.0], "velocity": [1.0, 0.0], "radius": 0.5, "mass": 1.0}]
        + [{"position": [5.0, 10.0], "velocity": [-1.0, 0.0], "radius": 0.5, "mass": 1.0}],
        "run": {"until": 3.0},
        "output": {"frames": {"collisions_per_particle": 1 / 3}},
    }
    haff.run(scene, file=tmp_path / "pairs.h5")
    with haff.open(tmp_path / "pairs.h5") as run:
        assert list(run.frames.time) == [0.0, 1.0, 2.0, 3.0]
        assert [frame.step for frame in run.frames] == [0, 2, 3, 3]
        assert np.array_equal(run.frames[1].velocity[:, 0], [-1, 1, -1, 1, 1, -1])


@pytest.mark.parametrize(
    ("schedule", "message"),
    [
        ({"collisions_per_particle": 0.0}, "frames.collisions_per_particle = 0.0: must be a positive finite number"),
        ({"collisions_per_particle": -1.0}, "must be a positive finite number"),
        ({"collisions_per_particle": 1.0, "log": [1.0, 2.0]}, "contradicts log: give one of the two"),
        ({}, "must have log = .* or collisions_per_particle = C"),
        ({"collisions_per_particle": 1e40}, "makes more than 9e15 collisions"),
        ({"collisions": 4}, "collisions = 4: unknown key"),
        (True, r"a number, \{ log = \[first, factor\] \}, \{ collisions_per_particle = … \} or false"),
    ],
)
def test_wrong_schedules_are_refused(schedule, message):
    with pytest.raises(haff.SceneError, match=message):
        haff.validate(GAS | {"output": {"frames": schedule}})


def test_one_particle_alone_has_no_records_by_collisions():
    ball = {
        "schema": 1,
        "domain": {"boundary": ["open", "open", "open"]},
        "particle": [{"position": [0.0, 0.0, 0.0], "radius": 0.5, "mass": 1.0}],
        "run": {"until": 1.0},
        "output": {"observables": {"collisions_per_particle": 1.0}},
    }
    with pytest.raises(haff.SceneError, match="one particle alone never collides"):
        haff.validate(ball)


@pytest.mark.long
@pytest.mark.parametrize(
    ("scene", "settings"),
    [
        ("cooling", {"species__0__count": 2000, "run__until": 2000.0, "output__events": True}),
        ("cooling", {"species__0__count": 2000, "run__until": 1e6, "run__collisions": 20000, "output__events": True}),
        ("fluid", {"run__until": 100.0}),
        ("mixture", {"run__until": 400.0, "measure__msd": True, "measure__vacf": True, "measure__interval": 0.1}),
        ("disks", {}),
        ("hot_wall", {}),
        ("added_speed", {}),
        ("textbook/bouncing_ball", {}),
    ],
)
def test_the_size_that_check_says_is_that_of_the_file(command, scene, settings):
    sets = [item for key, value in settings.items() for item in ("--set", f"{key.replace('__', '.')}={toml(value)}")]
    said = json.loads(command("check", CONFIGS / f"{scene}.toml", "--json", *sets).stdout)["file_bytes"]
    found = command.run(scene, **settings).path.stat().st_size
    assert 0.75 < said / found < 1.35, f"{said} bytes said, {found} written"
    if found > 2e6:
        assert 0.85 < said / found < 1.15, f"{said} bytes said, {found} written"


def test_one_body_among_obstacles_is_no_single_particle(command, tmp_path):
    """Its collision rate is not known for another reason."""
    pins = [{"position": [2.0 * x, 2.0 * y], "radius": 0.2, "mass": float("inf")} for x in range(30) for y in range(30)]
    ball = {"position": [1.0, 1.0], "velocity": [1.0, 0.3], "radius": 0.1, "mass": 1.0}
    scene = {
        "schema": 1,
        "dimension": 2,
        "domain": {"size": [60.0, 60.0], "boundary": ["periodic", "periodic"]},
        "particle": [*pins, ball],
        "run": {"until": 1.0},
    }
    path = tmp_path / "lorentz.toml"
    haff.save_scene(scene, path)
    said = json.loads(command("check", path, "--json").stdout)
    assert said["particles"] == 901 and "infinite mass" in said["collision_rate_unknown"]
    assert "a single particle" not in command("check", path).stdout
