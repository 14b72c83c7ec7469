"""Invalid files are refused with the file, the path in it, the value, and the allowed values."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

import haff
import synthetic
from haff import analysis
from haff.command.main import main

pytestmark = pytest.mark.usefixtures("bounded")

FRAME = "particles/all/position/value"
Change = Callable[[h5py.File], None]


@pytest.fixture
def path(tmp_path) -> Path:
    return synthetic.cooling_gas(tmp_path / "gas.h5", n=50, frames=4, samples=10, collisions=200)


def put(path: str, value: object, at: object = ...) -> Change:
    def change(file: h5py.File) -> None:
        file[path][at] = value

    return change


def instead(path: str, **options) -> Change:
    """Replaces the dataset at a path."""

    def change(file: h5py.File) -> None:
        del file[path]
        file.create_dataset(path, **options)

    return change


def link(path: str, target: object) -> Change:
    def change(file: h5py.File) -> None:
        del file[path]
        file[path] = target

    return change


def group(path: str) -> Change:
    def change(file: h5py.File) -> None:
        del file[path]
        file.create_group(path)

    return change


def scene(line: str) -> Change:
    def change(file: h5py.File) -> None:
        text = file["parameters/scene"][()].decode()
        del file["parameters/scene"]
        key = line.split("=")[0]
        file["parameters/scene"] = re.sub(rf"(?m)^{key}=.*$", line, text)

    return change


def boundary(value: object) -> Change:
    def change(file: h5py.File) -> None:
        file["particles/all/box"].attrs["boundary"] = value

    return change


def virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout(shape=(50,), dtype="f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", shape=(50,))
    del file["particles/all/mass"]
    file.create_virtual_dataset("particles/all/mass", layout)


def frames(file: haff.File) -> object:
    return [frame.position for frame in file.frames]


def table(file: haff.File) -> object:
    return file.observables


def log(file: haff.File) -> object:
    return file.events.to_pandas()


HUGE = 1 << 34
REFUSED: list[tuple[Change, Callable[[haff.File], object], str]] = [
    # Declared sizes.
    (lambda f: f["events/impulse"].resize(HUGE, axis=0), log, r"events/impulse: declares shape \(17179869184,\)"),
    (
        instead(FRAME, shape=(HUGE, 50, 3), dtype="f8"),
        frames,
        r"position/value: declares shape \(17179869184, 50, 3\), .* bytes; 0 are stored",
    ),
    (
        instead("particles/all/mass", shape=(HUGE,), dtype="f8", chunks=(1 << 20,), compression="gzip"),
        len,
        "mass: declares .* the file of .* bytes cannot hold them",
    ),
    (
        instead("particles/all/species", data=np.full(50, 1 << 31)),
        lambda f: f.species_names,
        r"species\[0\] = 2147483648",
    ),
    # Shapes, types and paths.
    (
        instead("particles/all/radius", data=np.ones(49)),
        lambda f: f.radius,
        "radius: has 49 rows; .* each of 50 particles",
    ),
    (
        instead(FRAME, data=np.zeros((4, 49, 3))),
        frames,
        r"position/value: has shape \(4, 49, 3\); must be \(any, 50, 3\)",
    ),
    (instead("particles/all/mass", data=np.ones(50, "c16")), len, "mass: holds complex128; must hold real numbers"),
    (instead("particles/all/mass", data=b"text"), len, "mass: holds object; must hold real numbers"),
    (instead("particles/all/mass", data=h5py.Empty("f8")), len, "mass: has shape None"),
    (instead("events/kind", data=np.zeros(200, "u1")), log, "events/kind: holds uint8; must hold an enum"),
    (instead("observables", data=1.0), table, "observables: is no group"),
    (group("particles/all/mass"), len, "particles/all/mass: is a group; must be a dataset"),
    (lambda f: f.__delitem__("particles/all/position/step"), frames, "position/step: is missing"),
    (lambda f: f.__delitem__("particles/all/box"), lambda f: f.box, "box/edges: is missing"),
    # Links to other files.
    (link("particles/all/mass", h5py.ExternalLink("other.h5", "x")), len, "mass: is a link to another file"),
    (link("particles/all/mass", h5py.SoftLink("/nowhere")), len, "mass: is a link to nothing"),
    (link("particles/all/mass", h5py.SoftLink("/particles/all/mass")), len, "mass: is a link"),
    (virtual, len, "mass: is stored in another file"),
    (
        instead("particles/all/mass", shape=(50,), dtype="f8", external=[("/dev/zero", 0, 400)]),
        len,
        "mass: is stored in another file",
    ),
    # Values.
    (put(FRAME, np.nan, (2, 7, 1)), frames, r"position/value\[2, 7, 1\] = nan: must be a number"),
    (put(FRAME, 1e9, (2, 7, 1)), frames, r"position/value\[2, 7, 1\] = 1000000000.0: must be in the box"),
    (
        put("particles/all/velocity/value", np.inf, (1, 0, 0)),
        lambda f: f.frames.array("velocity"),
        r"\[1, 0, 0\] = inf",
    ),
    (
        put("particles/all/position/time", -1.0, 2),
        lambda f: f.frames.time,
        r"time\[2\] = -1.0: must be at least the one",
    ),
    (put("particles/all/position/step", -1, 3), lambda f: f.frames[3].step, r"step\[3\] = -1: must be 0 or more"),
    (put("particles/all/radius", 0.0, 5), lambda f: f.radius, r"radius\[5\] = 0.0: must be in"),
    (put("particles/all/mass", -np.inf, 5), lambda f: f.mass, r"mass\[5\] = -inf: must be in"),
    (put("particles/all/box/edges/value", 0.0), lambda f: f.box, r"edges/value\[0, 0\] = 0.0: must be in"),
    (boundary([b"none"] * 4), lambda f: f.box, "box@boundary: is .* must be up to 3 of periodic, none"),
    (boundary(5), lambda f: f.box, "box@boundary: is .*; must be a list of texts"),
    (put("events/i", 50, 9), log, r"events/i\[9\] = 50: must be in \[0, 50\)"),
    (put("events/j", 50, 9), log, r"events/j\[9\] = 50: must be in \[0, 50\)"),
    (put("events/kind", 7, 9), log, r"events/kind\[9\] = 7: must be one of"),
    (put("events/energy_loss", np.nan, 9), log, r"events/energy_loss\[9\] = nan"),
    (put("events/time", 1e9, 9), log, r"events/time\[10\] = .*: must be at least the one before"),
    (
        put("observables/kinetic_energy/value", np.inf, 3),
        table,
        r"kinetic_energy/value\[3\] = inf: must be a finite number",
    ),
    (put("observables/kinetic_energy/time", np.inf, 3), table, r"/time\[3\] = inf: must be a number of up to"),
    (
        instead("observables/temperature/time", data=np.arange(13.0)),
        table,
        "temperature/time: is not that of observables/",
    ),
    (instead("parameters/dimension", data=4), lambda f: f.dimension, "dimension: is 4; must be 2 or 3"),
    (instead("parameters/seed", data="x"), lambda f: f.summary, "seed: is 'x'; must be a whole number"),
    # Text.
    (instead("parameters/scene", data=b"\xff\xfe"), lambda f: f.scene, "parameters/scene: is not UTF-8 text"),
    (instead("parameters/scene", data=5), lambda f: f.scene, "parameters/scene: .* must be text"),
    (instead("parameters/scene", data="a = " + "[" * 9000), lambda f: f.scene, "parameters/scene: is not valid TOML"),
    (scene("title = 5"), lambda f: f.title, "scene: title = 5: must be text"),
    (
        scene('restitution = "hard"'),
        analysis.cooling_law,
        r"contact.restitution = 'hard': must be a number in \[0, 1\]",
    ),
]


@pytest.mark.parametrize(("change", "read", "message"), REFUSED)
def test_data_that_no_run_can_have_written_are_refused_with_their_path(path, change, read, message):
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(haff.FileError, match=message) as error, haff.open(path) as file:
        read(file)
    assert str(error.value).startswith(f"{path}: ") and "\n" not in str(error.value)


def test_equivalent_storage_of_a_valid_file_is_read(path):
    """Another byte order, another filter, a link within the file, chunks missing after a kill."""
    with h5py.File(path, "r+") as file:
        mass = file["particles/all/mass"][:]
        instead("particles/all/mass", data=mass.astype(">f8"), compression="lzf")(file)
        link("particles/all/radius", h5py.SoftLink("/other/radius"))(file)
        file["other/radius"] = np.full(50, 0.25)
        time = file["events/time"][:]
        del file["events/time"]
        file.create_dataset("events/time", data=time, chunks=(64,), maxshape=(None,)).resize(600, axis=0)
    with haff.open(path) as file:
        assert file.mass.dtype == np.dtype("f8") and np.array_equal(file.mass, mass)
        assert np.all(file.radius == 0.25)
        assert len(file.events.to_pandas()) == 200


def test_closed_file_is_an_error(path):
    file = haff.open(path)
    file.close()
    with pytest.raises(haff.FileError, match="is closed"):
        _ = file.frames
    assert "closed" in repr(file)


def test_repr_of_a_damaged_file_has_the_error(path):
    with h5py.File(path, "r+") as file:
        put("particles/all/radius", -1.0, 5)(file)
        del file["particles/all/box"]
    with haff.open(path) as file:
        assert "damaged" in repr(file) and "box/edges: is missing" in repr(file)


@pytest.mark.parametrize("command", ["plot", "export --to csv", "view", "plot --movie out.gif"])
@pytest.mark.parametrize("kind", ["missing", "folder", "text", "empty", "cut", "foreign", "nan", "pipe"])
def test_commands_end_with_one_line_and_exit_status_4(path, command, kind, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "in.h5"
    if kind == "folder":
        file.mkdir()
    elif kind == "text":
        file.write_text("no HDF5")
    elif kind == "empty":
        file.touch()
    elif kind == "cut":
        file.write_bytes(path.read_bytes()[:-5000])
    elif kind == "foreign":
        with h5py.File(file, "w") as other:
            other["x"] = 1
    elif kind == "nan":
        with h5py.File(path, "r+") as gas:
            put(FRAME, np.nan)(gas)
            put("observables/kinetic_energy/value", np.nan)(gas)
        path.rename(file)
    elif kind == "pipe":
        pytest.importorskip("posix").mkfifo(file)
    words = command.split()
    assert main([words[0], "in.h5", *words[1:]]) == 4
    out, err = capsys.readouterr()
    assert not out and re.fullmatch(r"haff: error: in\.h5: [^\n]+\n", err), err
    assert not (tmp_path / "out.gif").exists()


@pytest.mark.parametrize(
    "content", [b"", b"\xff\xfe,\n", b"height\n\0\x01\n", b'"', b"a,b\n1,2,3,4\n1\n", b"height\n" + b"9" * 5000]
)
@pytest.mark.parametrize("suffix", ["csv", "json", "h5"])
def test_tables_and_manifests_are_read_or_refused(content, suffix, tmp_path):
    path = tmp_path / f"manifest.{suffix}"
    path.write_bytes(content)
    with pytest.raises(haff.FileError, match=f"^{re.escape(str(path))}: not an HDF5 file$"):
        haff.open(path)
    with pytest.raises(haff.HaffError, match=re.escape(str(path))) as error:
        haff.restitution_from(path)
    assert "\n" not in str(error.value)


def test_error_of_a_series_missing_in_a_sweep_file_names_it(path):
    from haff.command.study import _series

    rows = [{"index": 0, "file": str(path), "status": "complete"}]
    assert list(_series(rows, ["temperature"])) == ["temperature"]
    with pytest.raises(haff.MissingDataError, match=r"gas\.h5: no observable 'entropy'; there are step, .*temperature"):
        _series(rows, ["temperature", "entropy"])


def test_sweep_scene_that_is_not_text_differs_from_the_given_one(tmp_path):
    pytest.importorskip("haff._engine")
    (tmp_path / "scene.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(haff.FileError, match=r"scene\.toml belongs to another sweep"):
        haff.sweep({"schema": 1}, {"contact.restitution": [0.9]}, output=tmp_path)
