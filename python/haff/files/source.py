"""The bytes of a file as HDF5 reads them, and a check of the heaps that hold its texts.

HDF5 (up to 2.2) does not return from reading a heap with free space of size 0. Texts, and everything of a file that a
run is writing, are therefore read through :class:`Source`: HDF5 gets each part of the file from it, so that no heap is
read that has not been checked, whatever refers to it.
"""

from __future__ import annotations

import atexit
import os
from pathlib import Path

import h5py

__all__ = ["Source", "read_at"]

_HEAP = b"GCOL\x01\x00\x00\x00"
"""Beginning of a global heap: signature, version and reserved bytes."""
_HEAD = 16
"""Bytes of the head of a heap, and of an object in it."""


class Source:
    """An open file, to be given to :class:`h5py.File`: HDF5 then calls it for each part that it reads."""

    def __init__(self, descriptor: int, path: Path) -> None:
        self.descriptor = descriptor
        """Closed with this object, which lives as long as HDF5 has the file open."""
        self._path, self._at = path, 0

    def __del__(self) -> None:
        os.close(self.descriptor)

    def __repr__(self) -> str:
        """What h5py takes as the name of the file."""
        return str(self._path)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        # The position of the descriptor itself would be shared with child processes.
        self._at = offset if whence == os.SEEK_SET else os.fstat(self.descriptor).st_size + offset
        return self._at

    def tell(self) -> int:
        return self._at

    def read(self, size: int) -> bytes:
        """A part of the file, for completeness: h5py calls :meth:`readinto`."""
        part = bytearray(size)
        self.readinto(part)
        return bytes(part)

    def readinto(self, buffer: bytearray | memoryview) -> int:
        """Fills a buffer, with zeros behind the end of the file, as HDF5 expects."""
        memory = memoryview(buffer).cast("B")
        found = read_at(self.descriptor, self._at, memory)
        memory[found:] = bytes(len(memory) - found)
        if bytes(memory[: len(_HEAP)]) == _HEAP:
            self._check_heap(self._at, bytes(memory[:_HEAD]))
        self._at += len(memory)
        return len(memory)

    def _check_heap(self, start: int, head: bytes) -> None:
        """Raises an error unless each object of the heap at ``start`` ends where the next one begins."""
        size = int.from_bytes(head[8:], "little")
        if size > os.fstat(self.descriptor).st_size - start:
            raise ValueError(f"the heap of texts at {start} declares {size:,} bytes, more than the file holds")
        heap = bytearray(size)
        read_at(self.descriptor, start, memoryview(heap))
        at = _HEAD
        while at + _HEAD <= size:
            length = int.from_bytes(heap[at + 8 : at + _HEAD], "little")
            # Object 0 is the free space: its size includes its head. Others are padded to 8 bytes.
            whole = length if heap[at : at + 2] == b"\0\0" else _HEAD + -(-length // 8) * 8
            if whole < _HEAD or at + whole > size:
                raise ValueError(f"the heap of texts at {start} is damaged")
            at += whole


def read_at(descriptor: int, start: int, memory: memoryview) -> int:
    """Fills ``memory`` from a place in a file, up to its end; returns the number of bytes."""
    found = 0
    while found < len(memory):
        if hasattr(os, "preadv"):
            more = os.preadv(descriptor, [memory[found:]], start + found)
        else:
            os.lseek(descriptor, start + found, os.SEEK_SET)
            part = os.read(descriptor, len(memory) - found)
            more = len(part)
            memory[found : found + more] = part
        if more == 0:
            break
        found += more
    return found


def _close_all() -> None:
    """HDF5 closes its files after Python has ended, when it can no longer call :class:`Source`."""
    for file in h5py.h5f.get_obj_ids(h5py.h5f.OBJ_ALL, h5py.h5f.OBJ_FILE):
        if file.get_access_plist().get_driver() == h5py.h5fd.fileobj_driver:
            h5py.File(file).close()


atexit.register(_close_all)
