"""The handshake with a run that writes the file: what is read is one state, also if it changes meanwhile."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

import haff
from conftest import ROOT
from haff.errors import FileError, RunningFileError
from haff.files import handshake
from haff.files.handshake import Count
from haff.files.stored import Stored

fcntl = pytest.importorskip("fcntl")
PLACE = 4096
GAS = ROOT / "tests" / "gas.toml"


class Writer:
    """Holds a file as a run does, and changes what the run tells its readers."""

    def __init__(self, path: Path) -> None:
        self.file = path.open("r+b")
        fcntl.flock(self.file, fcntl.LOCK_EX)

    def tell(self, flushes: int, resumptions: int = 0, waiting: int = 0) -> None:
        os.pwrite(self.file.fileno(), struct.pack("<QQQ", flushes, resumptions, waiting), PLACE + 16)

    def is_read_under_lock(self) -> bool:
        lock = struct.pack("hhqqi4x", fcntl.F_WRLCK, os.SEEK_SET, 1 << 62, 1, 0)
        found = fcntl.fcntl(self.file, fcntl.F_OFD_GETLK, lock)
        return struct.unpack("hhqqi4x", found)[0] == fcntl.F_RDLCK


@pytest.fixture
def finished(tmp_path, command) -> Path:
    """A file with everything that a run can record of a gas."""
    profiles = [{"axis": "z", "bins": 10, "interval": 2.0}]
    measure = {"measure__profiles": profiles, "measure__vacf": True, "measure__interval": 0.5}
    path = tmp_path / "gas.h5"
    path.write_bytes(command.run(GAS, run__until=12.0, **measure).path.read_bytes())
    return path


@pytest.fixture
def writer(finished) -> Iterator[Writer]:
    writer = Writer(finished)
    writer.tell(8)
    yield writer
    writer.file.close()


def everything(file: haff.File) -> dict[str, np.ndarray]:
    """All that the readers of a file return."""
    found = {f"samples {name}": values for name, values in file.samples.items()}
    found |= {f"frames {name}": file.frames.array(name) for name in ("position", "velocity", "unwrapped")}
    found |= {f"events {name}": file.events[name] for name in file.events.columns}
    found |= {f"profile {name}": values.values for name, values in file.profiles["z"].items()}
    found |= {f"correlation {name}": values.values for name, values in file.correlations["vacf"].items()}
    found |= {"text": np.array([file.scene_text, file.title, *file.species_names, repr(file.parameters)])}
    found |= {"particles": np.array([file.mass, file.radius, file.species])}
    return found


def overwrite_index(path: Path) -> int:
    """Overwrites all of a file but rows that a run does not replace; returns the number of bytes."""
    kept = []

    def note(name: str, node: h5py.Group | h5py.Dataset) -> None:
        if isinstance(node, h5py.Dataset) and not name.startswith("correlations/"):
            if node.chunks:
                chunks = [node.id.get_chunk_info(k) for k in range(node.id.get_num_chunks())]
                kept.extend((chunk.byte_offset, chunk.size) for chunk in chunks)
            elif node.id.get_offset() is not None:
                kept.append((node.id.get_offset(), node.id.get_storage_size()))

    with h5py.File(path, locking=False) as hdf:
        hdf.visititems(note)
    at = changed = 0
    with path.open("r+b") as file:
        for start, size in [*sorted(kept), (path.stat().st_size, 0)]:
            os.pwrite(file.fileno(), b"\xff" * max(0, start - at), at)
            changed += max(0, start - at)
            at = max(at, start + size)
    return changed


def test_nothing_but_rows_is_read_after_a_running_file_has_been_opened(finished, writer):
    with haff.open(finished) as file:
        assert file.running
        expected = everything(file)
    with haff.open(finished) as file:
        # All that a run rewrites, and more.
        assert overwrite_index(finished) > 50_000
        found = everything(file)
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)
    with pytest.raises(FileError):
        haff.open(finished, locking=False)


def test_a_file_is_not_opened_while_it_is_changed(finished, writer, monkeypatch):
    monkeypatch.setattr(handshake, "WAITS", 0.05)
    for told in ({"flushes": 9}, {"flushes": 8, "waiting": 1}):
        writer.tell(**told)
        with pytest.raises(RunningFileError, match="try again"):
            haff.open(finished)
    monkeypatch.setattr(handshake, "WAITS", 600)
    opened: list[bool] = []

    def read() -> None:
        with haff.open(finished) as file:
            opened.append(file.running)

    reader = threading.Thread(target=read)
    reader.start()
    assert not opened, "the file is being changed"
    writer.tell(10)
    reader.join()
    assert opened == [True]


def test_what_was_read_during_a_change_is_read_again(finished, writer, monkeypatch):
    load, under_lock = Stored._load, []

    def change_once(stored: Stored, reading: handshake.Reading) -> None:
        under_lock.append(writer.is_read_under_lock())
        load(stored, reading)
        if len(under_lock) == 1:
            writer.tell(10)

    monkeypatch.setattr(Stored, "_load", change_once)
    with haff.open(finished) as file:
        assert file.stored._count == Count(10, 0, 0)
        assert not writer.is_read_under_lock(), "the lock is for opening only"
    assert under_lock == [True, True]


def test_a_run_that_was_killed_during_a_change_does_not_delay_readers(finished, writer):
    writer.tell(9, waiting=1)
    writer.file.close()
    with haff.open(finished) as file:
        assert not file.running and len(file.frames) == 13


def test_rows_are_not_read_after_the_run_was_resumed(finished, writer):
    with haff.open(finished) as file:
        position = file.frames[0].position
        writer.tell(12)
        np.testing.assert_array_equal(file.frames[0].position, position)
        # The run drops rows, and uses their space again.
        writer.tell(14, resumptions=1)
        with pytest.raises(RunningFileError, match="has been resumed since it was opened; open it again"):
            file.frames[0]


@pytest.mark.long
def test_a_process_that_exits_with_an_open_running_file_ends_normally(finished, writer):
    program = f"import haff; run = haff.open({str(finished)!r}); frames = run.frames; print(run.running)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "True\n"), done.stderr
