"""Results of templates are in temporary files: nothing is left in the working directory unless it is asked for."""

from __future__ import annotations

import copy
import gc
import os
import subprocess
import sys
import tempfile

import pytest

import haff
from haff.common.temporary import TemporaryFolder

SHORT = {"run__until": 0.5}


@pytest.fixture
def empty(tmp_path, monkeypatch):
    """An empty working directory, beside one for temporary files."""
    folder = tmp_path / "here"
    folder.mkdir()
    (tmp_path / "temporary").mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    return folder


@pytest.mark.parametrize("name", ["cooling", "disks", "breakshot", "bouncing_ball"])
def test_run_of_a_template_leaves_nothing(name, empty, tmp_path):
    result = haff.run(haff.template(name), run__until=0.02)
    assert len(result.file.frames) > 0 and result.path.name == f"{name}.h5"
    assert list(empty.iterdir()) == []
    assert [path.parent.parent for path in (tmp_path / "temporary").glob("*/*")] == [tmp_path / "temporary"]
    result.close()
    del result
    gc.collect()
    assert list((tmp_path / "temporary").iterdir()) == []


@pytest.mark.long
def test_temporary_file_lives_as_long_as_result_or_file(empty):
    result = haff.run(haff.template("cooling"), species__0__count=100, **SHORT)
    path, file = result.path, result.file
    del result
    gc.collect()
    assert path.exists() and len(file.observables) > 0
    frames = file.frames
    del file
    gc.collect()
    assert path.exists() and frames[-1].position.shape == (100, 3)
    del frames
    gc.collect()
    assert not path.parent.exists()


def test_result_is_saved_to_a_path(empty):
    result = haff.run(haff.template("cooling"), species__0__count=100, **SHORT)
    assert result.save("kept.h5").name == "kept.h5"
    with haff.open("kept.h5") as kept:
        assert len(kept) == 100
    with pytest.raises(haff.ArgumentError, match=r"kept\.h5: exists; overwrite=True replaces it"):
        result.save("kept.h5")
    result.save("kept.h5", overwrite=True)
    with pytest.raises(haff.ArgumentError, match="is the file that is read"):
        result.save(result.path, overwrite=True)
    with pytest.raises(haff.FileError, match=r"file=…"):
        haff.run(haff.template("cooling"), output={"file": False}, species__0__count=100, **SHORT).save("none.h5")
    assert [path.name for path in empty.iterdir()] == ["kept.h5"]


@pytest.mark.long
def test_named_files_are_kept_where_they_are_named(empty):
    scene = haff.template("cooling")
    scene["species"][0]["count"] = 100
    assert haff.run(scene, file="a.h5", **SHORT).path.name == "a.h5"
    haff.run(scene, output__file="b.h5", **SHORT)
    haff.run(scene, **{"output.file": "c.h5"}, **SHORT)
    haff.run(scene, output={"file": "d.h5"}, **SHORT)
    haff.run(scene | {"output": {"file": "e.h5", "frames": 0.5}}, **SHORT)
    # A file of a scene is named there, also if it began as a template.
    haff.run(haff.save_scene(scene, "cooling.toml"), **SHORT)
    haff.run(haff.load_scene("cooling.toml"), overwrite=True, **SHORT)
    gc.collect()
    assert sorted(os.listdir()) == ["a.h5", "b.h5", "c.h5", "cooling.h5", "cooling.toml", "d.h5", "e.h5"]


def test_copies_of_a_template_are_templates(empty):
    scene = copy.deepcopy(haff.template("cooling")) | {"seed": 3}
    assert scene["output"]["file"] == "cooling.h5"
    assert haff.run(scene, species__0__count=100, **SHORT).path.parent.parent != empty
    assert list(empty.iterdir()) == []


def test_failed_runs_leave_nothing(empty, tmp_path):
    with pytest.raises(haff.SceneError):
        haff.run(haff.template("cooling"), contact__restitution=1.5)
    gc.collect()
    assert list((tmp_path / "temporary").iterdir()) == []


def test_folder_is_removed_when_python_ends_but_not_by_a_fork(tmp_path):
    program = """
import os
from haff.common.temporary import TemporaryFolder
folder = TemporaryFolder()
if os.fork() == 0:
    del folder
    os._exit(0)
os.wait()
print(folder.path, folder.path.is_dir())
"""
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    path, existed = done.stdout.split()
    assert existed == "True" and path.startswith(str(tmp_path)) and list(tmp_path.iterdir()) == []


def test_folder_of_results_is_private():
    folder = TemporaryFolder()
    assert folder.path.stat().st_mode & 0o077 == 0
