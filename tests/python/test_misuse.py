"""Wrong arguments for every public function: each is refused by an error that names it, and nothing hangs or changes.

The table is in `misuses`. What a scene refuses, a live simulation refuses.
"""

from __future__ import annotations

import faulthandler
import os
import re
import shutil
import warnings
from collections import Counter
from functools import partial

import numpy as np
import pytest

import haff
import misuses

PATIENCE = 300
"""A call that takes longer has hung [s]; all of them together take a minute."""


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """All calls, in a folder of their own, which is the working directory."""
    folder, before = tmp_path_factory.mktemp("misuse"), os.getcwd()
    haff.save_scene(misuses.GAS, folder / "gas.toml")
    measured = misuses.GAS | {
        "measure": {
            "msd": True,
            "vacf": True,
            "interval": 0.1,
            "profiles": [{"axis": "z", "bins": 2, "interval": 0.5, "species": "each"}],
        },
        "output": {"frames": 0.25, "observables": 0.1, "events": True},
    }
    haff.run(measured, file=folder / "run.h5")
    # One to be opened by the calls: HDF5 opens a file in one way only.
    shutil.copyfile(folder / "run.h5", folder / "done.h5")
    os.chdir(folder)
    calls = misuses.Table()
    with haff.open(folder / "run.h5") as run:
        misuses.simulation(calls)
        misuses.runs(calls, folder, folder / "done.h5")
        misuses.reading(calls, run, folder)
        misuses.of_frames(calls, run)
        misuses.of_packings(calls, run)
        misuses.closed_forms(calls)
        yield calls
    os.chdir(before)


def called(call, /, **changed):
    """The outcome of a call with some arguments changed: the value returned or the error raised."""
    faulthandler.dump_traceback_later(PATIENCE, exit=True)
    try:
        with warnings.catch_warnings():
            # NumPy warns of what it leaves out.
            warnings.simplefilter("error")
            return call.function(**{**call.good, **changed})
    except BaseException as error:
        return error
    finally:
        faulthandler.cancel_dump_traceback_later()


@pytest.mark.long
def test_every_call_works_with_the_arguments_that_are_not_varied(table):
    failed = {call.name: called(call) for call in table.calls}
    allowed = (haff.NotApplicableError, haff.MissingDataError)
    failed = {name: found for name, found in failed.items() if isinstance(found, BaseException)}
    assert not {name: found for name, found in failed.items() if not isinstance(found, allowed)}


@pytest.mark.long
def test_every_wrong_argument_is_refused_by_an_error_that_names_it(table):
    faults, count = [], Counter()
    for name, call, parameter, value in table:
        found = called(call, **{parameter: value})
        told = str(found)
        count[call.name.partition(".")[0]] += 1
        if not isinstance(found, BaseException):
            faults.append(f"{name}: accepted")
        elif not isinstance(found, haff.HaffError) and "has no form in TOML" not in told:
            faults.append(f"{name}: {type(found).__name__}: {told[:200]}")
        elif not re.search(call.told.get(parameter, rf"\b{parameter}\b"), told):
            faults.append(f"{name}: does not name it: {told[:200]}")
        elif len(told) > 500 or any(ord(c) < 32 for c in told):
            faults.append(f"{name}: {len(told)} characters: {told[:200]!r}")
    assert not faults, f"{len(faults)} of {count.total()}:\n" + "\n".join(faults[:50])
    assert count.total() > 8000, count


def test_a_refused_change_leaves_the_simulation_as_it_was(table):
    gas = haff.Simulation(misuses.GAS, threads=1)
    gas.advance(0.2)
    before, frame = gas.state_hash, gas.sample()
    for name, call, parameter, value in table:
        if not call.name.startswith("set ") and call.name not in ("add", "remove", "advance", "step"):
            continue
        if call.name.startswith("set "):
            method, arguments = setattr, (gas, parameter, value)
        else:
            method, arguments = partial(getattr(gas, call.name), **{**call.good, parameter: value}), ()
        with pytest.raises(haff.HaffError):
            method(*arguments)
        assert (gas.state_hash, len(gas), gas.time) == (before, 60, 0.2), name
    assert gas.sample()["kinetic_energy"] == frame["kinetic_energy"]
    gas.advance(0.5)
    assert abs(gas.sample()["ledger_residual"]) < 1e-13


REFUSED = [
    # What is written of the scene, what is asked of a simulation with it, and what both errors say.
    (
        {"velocity": [0.0, 1e200, 0.0]},
        {"velocities": [0.0, 1e200, 0.0]},
        "must be a finite number, at most 1e50 in size",
    ),
    (
        {"velocity": [0.0, 0.0, np.inf]},
        {"velocities": [0.0, 0.0, np.inf]},
        "must be a finite number, at most 1e50 in size",
    ),
    ({"position": [1e60, 1.0, 1.0]}, {"positions": [1e60, 1.0, 1.0]}, "must be a finite number, at most 1e50 in size"),
    ({"angular_velocity": [0.0, 1e200, 0.0]}, {"angular_velocities": [0.0, 1e200, 0.0]}, "at most 1e50 in size"),
    ({"radius": 1e-30}, {"radius": 1e-30}, r"must be at least 2\.3e-12: coordinates up to 10 are rounded"),
    ({"radius": 0.0}, {"radius": 0.0}, "must be a positive finite number"),
    ({"radius": 1e60}, {"radius": 1e60}, "must be between 1e-50 and 1e50"),
    ({"mass": -1.0}, {"mass": -1.0}, "must be a positive number, or inf for a fixed or driven body"),
    ({"mass": 1e60}, {"mass": 1e60}, "must be between 1e-50 and 1e50, or inf for a fixed or driven body"),
]


@pytest.mark.parametrize(("of_scene", "of_change", "message"), REFUSED)
def test_what_a_scene_refuses_a_simulation_refuses_in_the_same_words(of_scene, of_change, message):
    body = {"position": [5.0, 5.0, 5.0], "radius": 0.5, "mass": 1.0, "name": "ball"}
    scene = {"domain": {"size": [10.0] * 3}, "contact": {"tangential_restitution": 0.5}, "run": {"until": 1.0}}
    with pytest.raises(haff.SceneError, match=message):
        haff.Simulation(scene | {"particle": [body | of_scene]})
    live = haff.Simulation(scene | {"particle": [body]})
    with pytest.raises(haff.ArgumentError, match=message):
        live.add(**({"positions": [1.0, 1.0, 1.0]} | of_change))
    name, value = next(iter(of_change.items()))
    if name not in ("radius", "mass"):
        with pytest.raises(haff.ArgumentError, match=message):
            setattr(live, name, value)


def test_positions_so_far_away_that_their_images_cannot_be_counted_are_refused():
    gas = haff.Simulation(misuses.GAS | {"domain": {"size": [8.0] * 3}})
    with pytest.raises(haff.ArgumentError, match=r"positions\[0, 0\] = 6\.87195e10: must be at most 1\.7.*e10 in size"):
        gas.positions = gas.positions + 8 * 2.0**33
    gas.positions = gas.positions + 8 * 2.0**20
    assert gas.images.min() == 2**20


def test_particles_whose_displacements_are_measured_are_not_moved():
    followed = haff.Simulation(misuses.GAS | {"measure": {"msd": True, "interval": 0.1}})
    followed.velocities = 2 * followed.velocities
    with pytest.raises(haff.ArgumentError, match=r"mean square displacement \(measure\.msd\) follows the particles"):
        followed.positions = followed.positions


def test_attributes_that_would_have_no_effect_are_not_set(table):
    gas = haff.Simulation(misuses.GAS)
    for thing, name, message in [
        (gas.box, "size", r"Box\.size: cannot be changed: a run keeps the box of its scene \(domain\)"),
        (gas, "box", "box: cannot be changed; positions, velocities"),
        (gas, "gravity", "gravity: cannot be changed"),
        (gas, "velocites", "has no such attribute; did you mean velocities?"),
    ]:
        with pytest.raises(AttributeError, match=message):
            setattr(thing, name, 1.0)
    with pytest.raises(ValueError, match="read-only"):
        gas.box.size[0] = 5.0
    with haff.open("run.h5") as run:
        for thing, name in [
            (run, "mass"),
            (run, "frames"),
            (run.frames[0], "position"),
            (run.events, "columns"),
            (run, "x"),
        ]:
            with pytest.raises(AttributeError, match=rf"{name}: cannot be changed: what is recorded is only read"):
                setattr(thing, name, 1.0)


def test_files_whose_names_begin_with_a_dash_are_written_and_continued(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    haff.save_scene(misuses.GAS, "-gas.toml")
    for scene in (misuses.GAS, "-gas.toml"):
        run = haff.run(scene, file="-x.h5", overwrite=True)
        assert haff.resume("-x.h5").state_hash == run.state_hash
