"""Files have the permissions that the umask gives, whatever library writes them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import haff
import synthetic
from haff.common.output import replacing
from haff.export import FORMATS
from haff.figures import movie, save_all


@pytest.fixture(params=[0o022, 0o007, 0o077], ids=oct)
def mode(request) -> int:
    """The permissions of a new file, with one of several umasks."""
    before = os.umask(request.param)
    yield 0o666 & ~request.param
    os.umask(before)


def modes(folder: Path) -> dict[str, str]:
    return {path.name: oct(path.stat().st_mode & 0o777) for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def gas(tmp_path) -> Path:
    return synthetic.cooling_gas(tmp_path / "gas.h5", n=250, frames=4, samples=10, collisions=200)


@pytest.mark.long
def test_exports_figures_pages_and_copies_have_the_mode_of_the_umask(gas, tmp_path, mode):
    pytest.importorskip("gsd")
    pytest.importorskip("pyarrow")
    written = tmp_path / "written"
    written.mkdir()
    with haff.open(gas) as file:
        for to, form in FORMATS.items():
            file.export(written / f"gas{form.suffix}", to=to)
        movie.save(file, written / "gas.gif", frames=":2")
        save_all(file, ["snapshot"], written)
        save_all(file, ["snapshot"], written, "pdf")
    haff.view(gas, written / "gas.html")
    haff.save_scene({"schema": 1}, written / "gas.toml")
    found = modes(written)
    assert len(found) == 10 and set(found.values()) == {oct(mode)}, found


def test_replaced_files_have_it_too(gas, tmp_path, mode):
    kept = tmp_path / "kept.gsd"
    kept.touch()
    kept.chmod(0o600)
    pytest.importorskip("gsd")
    with haff.open(gas) as file:
        file.export(kept, overwrite=True)
    assert modes(tmp_path)["kept.gsd"] == oct(mode)


def test_a_writer_that_makes_a_file_of_its_own_has_no_say(tmp_path, mode):
    path = tmp_path / "x.bin"
    with replacing(path) as part:
        part.unlink()
        os.close(os.open(part, os.O_CREAT | os.O_WRONLY, 0o400))
    assert oct(path.stat().st_mode & 0o777) == oct(mode)
    assert [entry.name for entry in tmp_path.iterdir()] == ["x.bin"]


def test_runs_and_sweeps_have_it_too(tmp_path, mode):
    scene = haff.template("cooling")
    small = {"species__0__count": 50, "run__until": 0.5}
    result = haff.run(scene, **small)
    result.save(tmp_path / "copy.h5")
    haff.run(scene, file=tmp_path / "run.h5", **small)
    haff.sweep(scene, {"species.0.count": [50], "run.until": [0.5]}, output=tmp_path / "study")
    found = modes(tmp_path)
    assert len(found) == 5 and set(found.values()) == {oct(mode)}, found
