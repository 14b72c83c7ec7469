"""`haff.run` and scenes from Python: results, files and errors of the command, Ctrl-C."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import haff
from conftest import CONFIGS
from patience import HANGS

GAS = {
    "schema": 1,
    "title": "made in Python",
    "seed": 3,
    "domain": {"packing_fraction": 0.2},
    "species": [{"name": "grain", "count": 200, "radius": 0.5, "mass": 1.0}],
    "contact": {"restitution": 0.9},
    "run": {"until": 2.0},
}


def test_run_from_dict_file_and_command_is_the_same(tmp_path, command):
    path = haff.save_scene(GAS, tmp_path / "gas.toml")
    assert haff.load_scene(path) == GAS
    reference = command.run(path, output=False)
    for scene in (GAS, path, str(path)):
        result = haff.run(scene)
        assert result.path is None and result.report["title"] == "made in Python"
        assert result.state_hash == reference.report["state_hash"]
        assert result["collisions"] == result.collisions == reference.report["collisions"]
    with pytest.raises(haff.FileError, match="file="):
        _ = result.file


def test_output_file_is_written_and_opened(tmp_path):
    with haff.run(GAS, file=tmp_path / "gas.h5", output__frames=0.5, threads=1) as result:
        assert result.path == tmp_path / "gas.h5" and result.threads == 1
        assert len(result.file.frames) == 5
        assert result.file.title == "made in Python"
        assert result.file.observables["collisions"].iloc[-1] == result.collisions
    with pytest.raises(haff.FileError, match="overwrite"):
        haff.run(GAS, file=tmp_path / "gas.h5")
    again = haff.run(GAS, file=tmp_path / "gas.h5", overwrite=True, contact__restitution=0.5)
    assert again.state_hash != result.state_hash
    assert haff.resume(again.path).state_hash == again.state_hash, "a complete run is left as it is"


def test_overrides_of_every_kind_are_applied(tmp_path):
    values = {
        "contact__restitution": {"model": "cutoff", "restitution": np.float64(0.8), "speed": 0.1},
        "domain__gravity": np.zeros(3),
        "species__grain__count": np.int64(50),
        "title": 'say "Ψ" \\ twice',
        "output__file": False,
    }
    expected = GAS["run"]
    resolved = haff.validate(GAS, **values)
    assert resolved["species"][0]["count"] == 50 and resolved["run"]["until"] == expected["until"]
    assert resolved["title"] == values["title"]
    assert resolved["contact"]["restitution"]["model"] == "cutoff"
    assert haff.run(GAS, **values).particles == 50
    for value in (None, object(), {1: 2}, 2**64):
        with pytest.raises(TypeError, match=r"^contact\.tc"):
            haff.run(GAS, contact__tc=value)
    with pytest.raises(TypeError, match=r"species\.0\.mass"):
        haff.save_scene(GAS | {"species": [{"mass": None}]}, tmp_path / "never.toml")


@pytest.mark.long
def test_every_scene_is_unchanged_by_a_round_trip_through_python(tmp_path):
    for path in sorted(CONFIGS.glob("**/*.toml")):
        if "invalid" in path.parts:
            continue
        scene = haff.load_scene(path)
        assert haff.validate(scene) == haff.validate(path) | {"title": haff.validate(scene)["title"]}
        assert haff.load_scene(haff.save_scene(scene, tmp_path / path.name)) == scene


def test_templates_run_and_agree_with_the_schema():
    assert "cooling" in haff.templates()
    for name in haff.templates():
        assert haff.validate(haff.template(name))["schema"] == 1
    with pytest.raises(KeyError, match="did you mean cooling"):
        haff.template("coolin")
    with pytest.raises(KeyError, match=r"haff\.templates\(\) has their names"):
        haff.template("frobnicate")
    with pytest.raises(haff.FileError, match="haff init drum > drum"):
        haff.run("drum")
    with pytest.raises(haff.FileError, match=r"haff\.template\(\"drum\"\) is a shipped scene of this name"):
        haff.validate("drum")
    assert "contact" in haff.schema()["properties"]


def test_errors_are_those_of_the_command_with_positions(tmp_path):
    path = haff.save_scene(GAS | {"contact": {"restitution": 1.2}, "frobnicate": 1}, tmp_path / "broken.toml")
    with pytest.raises(haff.SceneError) as caught:
        haff.run(path, run__until=-1)
    assert {problem.key for problem in caught.value.problems} == {"contact.restitution", "frobnicate", "run.until"}
    assert f"{path}:" in str(caught.value)
    with pytest.raises(haff.SceneError, match=r"scene: contact\.restitution = 1\.2"):
        haff.run(GAS | {"contact": {"restitution": 1.2}})
    with pytest.raises(haff.FileError, match="no_such"):
        haff.run(tmp_path / "no_such.toml")
    with pytest.raises(haff.FileError, match="no_such"):
        haff.resume(tmp_path / "no_such.h5")


@pytest.mark.long
def test_ctrl_c_ends_a_run_with_a_checkpoint(tmp_path):
    # Elastic, so that it does not slow down: a few seconds of work.
    gas = GAS | {"contact": {"restitution": 1.0}, "run": {"until": 3000.0}}
    program = f"""
import signal
import haff
# Tests that run in the background would inherit that it is ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
try:
    haff.run({gas!r}, file={os.fspath(tmp_path / "long.h5")!r}, output__frames=False)
except KeyboardInterrupt:
    print("interrupted")
"""
    told, path = "", tmp_path / "long.h5"
    while told == "":
        # On a busy machine the run may have ended before it is interrupted: then it is made again.
        path.unlink(missing_ok=True)
        process = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
        while not path.exists() and process.poll() is None:
            time.sleep(0.001)
        process.send_signal(signal.SIGINT)
        told = process.communicate(timeout=HANGS)[0]
        assert told or process.returncode == 0
    assert told == "interrupted\n"
    resumed = haff.resume(path)
    assert 0 <= resumed["resumed_from"] < resumed.simulated_time == 3000
    assert resumed.state_hash == haff.run(gas).state_hash
