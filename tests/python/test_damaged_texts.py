"""Texts of damaged files give errors: HDF5 itself does not return from reading some damaged heaps."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from conftest import ROOT
from haff.files.source import Source

GAS = ROOT / "tests" / "gas.toml"
HEAP = re.compile(rb"GCOL\x01\0\0\0")
# Everything that reads texts, of datasets and of attributes.
READ = """
import resource, sys
# Processor time, which does not depend on other processes.
resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
import haff
from haff import errors
told = []
with haff.open(sys.argv[1]) as run:
    reads = {
        "scene": lambda: run.scene, "title": lambda: run.title, "parameters": lambda: run.parameters,
        "names": lambda: run.species_names, "walls": lambda: run.wall_names,
        "labels": lambda: run.stored.attribute("observables/temperature", "unit"),
    }
    for name, read in reads.items():
        try:
            read()
        except errors.FileError as error:
            told.append(f"{name}: {error}")
    if "--mdanalysis" in sys.argv:
        try:
            run.to_mdanalysis()
        except errors.FileError as error:
            told.append(f"mdanalysis: {error}")
print("\\n".join(told))
"""


def objects(data: bytes, heap: int) -> list[tuple[int, int]]:
    """Places of the objects of a heap, and their numbers: 0 is the free space."""
    size, at, found = int.from_bytes(data[heap + 8 : heap + 16], "little"), heap + 16, []
    while at + 16 <= heap + size:
        number, length = (int.from_bytes(data[start : start + n], "little") for start, n in ((at, 2), (at + 8, 8)))
        found.append((at, number))
        at += length if number == 0 else 16 + -(-length // 8) * 8
    return found


@pytest.fixture(scope="module")
def whole(command) -> bytes:
    return command.run(GAS, run__until=2.0).path.read_bytes()


def read(path: Path, *options: str) -> str:
    done = subprocess.run([sys.executable, "-c", READ, path, *options], capture_output=True, text=True)
    assert done.returncode == 0, f"{done.returncode}: {done.stderr[-500:]}"
    return done.stdout


@pytest.mark.long
@pytest.mark.parametrize("size", [0, 8, 1 << 62], ids=["zero", "less than its head", "more than the file"])
def test_a_damaged_heap_is_an_error_for_each_text_in_it(size, whole, tmp_path, command):
    heaps = [match.start() for match in HEAP.finditer(whole)]
    assert heaps
    path = tmp_path / "damaged.h5"
    for heap in heaps:
        free = [at for at, number in objects(whole, heap) if number == 0]
        if not free:
            continue
        data = bytearray(whole)
        data[free[0] + 8 : free[0] + 16] = size.to_bytes(8, "little")
        path.write_bytes(data)
        told = read(path)
        assert "damaged.h5: " in told and f"the heap of texts at {heap}" in told, told
        assert command("view", path, "-o", tmp_path / "page.html", "--overwrite", check=False).returncode == 4
        assert command("info", path, check=False).returncode in (0, 4)


@pytest.mark.long
def test_other_readers_of_a_file_are_not_given_damaged_texts(whole, tmp_path):
    pytest.importorskip("MDAnalysis", reason="no MDAnalysis")
    path, data = tmp_path / "damaged.h5", bytearray(whole)
    for heap in (match.start() for match in HEAP.finditer(whole)):
        for at, number in objects(whole, heap):
            if number == 0:
                data[at + 8 : at + 16] = bytes(8)
    path.write_bytes(data)
    assert "mdanalysis: " in read(path, "--mdanalysis")


def test_whole_files_are_read_without_errors(whole, tmp_path):
    path = tmp_path / "whole.h5"
    path.write_bytes(whole)
    assert read(path).strip() == ""


def test_text_that_is_not_utf8_is_an_error_of_the_command(whole, tmp_path, command):
    path = tmp_path / "damaged.h5"
    at = whole.index(b"[domain]")
    path.write_bytes(whole[: at + 1] + b"\xad" + whole[at + 2 :])
    for arguments in (("info", path), ("run", "--resume", path), ("run", "--resume", path, "-o", tmp_path / "new.h5")):
        refused = command(*arguments, check=False)
        assert refused.returncode == 4, refused.stderr
        assert "parameters/scene is not UTF-8 text" in refused.stderr, refused.stderr


def test_parts_of_a_file_are_read_up_to_its_end(tmp_path):
    import os

    path = tmp_path / "bytes"
    path.write_bytes(b"0123456789")
    source = Source(os.open(path, os.O_RDONLY), path)
    assert source.seek(0, os.SEEK_END) == source.tell() == 10
    source.seek(6)
    assert source.read(8) == b"6789\0\0\0\0" and str(source) == str(path)
