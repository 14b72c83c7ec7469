"""The reader's part of the handshake with a run that writes the file; the writer's is crates/record/src/handshake.rs.

A flush rewrites the index of a file in place. A counter at a fixed place of the file is odd meanwhile: what was read
while it was not the same even number is discarded and read again. A lock on one byte, which readers share, lets them
finish before a flush begins; without it (other systems than Linux, some network file systems) the counter is enough.
A flush that waits for readers says so beside the counter, and no other reader begins.
"""

from __future__ import annotations

import os
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, TypeVar

from ..errors import RunningFileError
from .source import read_at

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

__all__ = ["WAITS", "Count", "Reading", "is_being_written", "one_state"]

T = TypeVar("T")

WAITS = 10.0
"""Longest time for which a reader waits and tries again [s]."""
_PAUSE = 0.001
"""Time between two attempts [s]."""
_ADDRESS, _MARK = 4096, b"haff flush count"
"""Where the counter is, and what stands before it."""
_BYTE = 1 << 62
"""The byte that is locked: behind the end of every file."""


class Count(NamedTuple):
    """The counter of a file."""

    flushes: int
    """Beginnings and ends of changes; 0 in a file that was closed."""
    resumptions: int
    """How often the run was resumed: that may have dropped rows and used their space again."""
    waiting: int
    """1 while a change waits for readers."""

    @staticmethod
    def of(descriptor: int) -> Count | None:
        """The counter of an open file; ``None`` in files of versions that have none."""
        found = bytearray(40)
        read_at(descriptor, _ADDRESS, memoryview(found))
        return Count(*struct.unpack("<QQQ", found[16:])) if found.startswith(_MARK) else None

    @property
    def is_changing(self) -> bool:
        """Whether the file is being changed, or about to be."""
        return self.flushes % 2 == 1 or self.waiting > 0


class Reading:
    """An attempt to read one state of a file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
        """The open file, closed at the end of the attempt."""
        _lock(self.descriptor, "F_RDLCK")
        self.count = Count.of(self.descriptor)
        """The counter at the beginning."""

    @property
    def may_begin(self) -> bool:
        """Whether the file is not being changed. A run that was killed during a change has left its numbers."""
        return self.count is None or not self.count.is_changing or is_being_written(self._path) is False

    @property
    def is_consistent(self) -> bool:
        """Whether what has been read since is one state of the file that is at the path."""
        now = Count.of(self.descriptor)
        same = now == self.count or (now and self.count and now[:2] == self.count[:2])
        return bool(same) and os.path.samestat(os.stat(self._path), os.fstat(self.descriptor))

    def close(self) -> None:
        # Copies of the descriptor would keep the lock.
        _lock(self.descriptor, "F_UNLCK")
        os.close(self.descriptor)


def one_state(path: Path, read: Callable[[Reading], T], discard: Callable[[T], None]) -> T:
    """What ``read`` returns, or raises, when it has read one state of a file; ``discard`` closes results of others.

    Raises :class:`RunningFileError` if the file is being changed for ``WAITS`` seconds, or in every attempt meanwhile.
    """
    until = time.monotonic() + WAITS
    while True:
        reading, patient = Reading(path), time.monotonic() < until
        try:
            if reading.may_begin:
                try:
                    result = read(reading)
                except Exception:
                    # Nothing says that a version without a counter is flushing.
                    unknown = reading.count is None and patient and is_being_written(path)
                    if reading.is_consistent and not unknown:
                        raise
                else:
                    if reading.is_consistent:
                        return result
                    discard(result)
        finally:
            reading.close()
        if not patient:
            raise RunningFileError(
                f"{path}: the run that is writing it has changed it whenever it was read, for {WAITS:g} s; try again"
            )
        time.sleep(_PAUSE)


def _lock(descriptor: int, kind: str) -> None:
    """Takes or gives back the lock, if the system has such locks and no run is changing the file."""
    if sys.platform == "linux" and sys.maxsize > 1 << 32:
        # struct flock: type, start of the range from the beginning of the file, length, process.
        wanted = struct.pack("hhqqi4x", getattr(fcntl, kind), os.SEEK_SET, _BYTE, 1, 0)
        try:
            fcntl.fcntl(descriptor, fcntl.F_OFD_SETLK, wanted)
        except OSError:
            pass


def is_being_written(path: Path) -> bool | None:
    """Whether a process holds the lock of a writer on a file; ``None`` if the system or file system has no locks."""
    try:
        with open(path, "rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except (AttributeError, OSError):
        return None
    return False
