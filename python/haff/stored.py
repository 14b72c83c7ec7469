"""Checked access to the datasets of a file. All reading goes through this module.

A file may be damaged, cut, or made by another program. Before a dataset is read, its type and shape are compared with
those expected, and the declared size with the size of the file; errors of HDF5 are raised as
:class:`FileError`.
"""

from __future__ import annotations

import math
import os
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np

from .column import Column
from .errors import FileError, RunningFileError
from .layout import Array
from .opening import require_file
from .text import brief

T = TypeVar("T")

DEFLATE_MOST = 1032
"""Bytes that one deflated byte stands for, at most."""
ATTRIBUTE_MOST = 1 << 16
"""Bytes of an attribute, at most."""
_PAUSES = (0.02, 0.05, 0.1, 0.2)
"""Times after which a file that is being flushed is tried again [s]."""
LINKS_MOST = 8
"""Soft links that are followed from one place."""
_KINDS = {"f": "real numbers", "iu": "integers", "fiu": "numbers"}
# Filters of HDF5 by number: deflate, shuffle, fletcher32, szip, lzf.
_FILTERS = {1: True, 2: False, 3: False, 4: True, 32000: True}


def _opened(path: Path, locking: bool | None) -> tuple[h5py.File, bool]:
    """The file, and whether a simulation is writing it: then it is opened without a lock."""
    if locking is not None:
        return h5py.File(path, "r", locking=locking), _is_being_written(path)
    try:
        return h5py.File(path, "r"), False
    except BlockingIOError:
        running = True
    except OSError as error:
        # This process has the file open without a lock.
        if "locking flag" not in str(error):
            raise
        running = _is_being_written(path)
    for pause in _PAUSES:
        try:
            return h5py.File(path, "r", locking=False), running
        except OSError:
            # A flush changes the file in several steps.
            time.sleep(pause)
    return h5py.File(path, "r", locking=False), running


def _is_being_written(path: Path) -> bool:
    """Whether a process holds the lock of a writer on the file; false where the system has no such locks."""
    try:
        import fcntl

        with open(path, "rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except (ImportError, OSError):
        return False
    return False


def _again(method: Callable[..., T]) -> Callable[..., T]:
    """A read that is done again after opening the file again, if the run that writes it has changed it meanwhile.

    HDF5 keeps the index of a file in memory as it was when it read it. Rows are only added, so those known before
    are the same afterwards.
    """

    @wraps(method)
    def patient(self: Stored, *arguments: Any, **keywords: Any) -> T:
        if not self.running or self._patient:
            return method(self, *arguments, **keywords)
        self._patient = True
        try:
            for pause in _PAUSES:
                try:
                    return method(self, *arguments, **keywords)
                except RunningFileError:
                    time.sleep(pause)
                    self._reopen()
            return method(self, *arguments, **keywords)
        finally:
            self._patient = False

    return patient


class Stored:
    """An HDF5 file, opened for reading."""

    def __init__(self, path: Path, locking: bool | None = None) -> None:
        self.path = path
        self._found: dict[str, h5py.Group | h5py.Dataset] = {}
        self._columns: dict[str, Column] = {}
        self._locking, self._patient = locking, False
        try:
            require_file(path)
            self.hdf, self.running = _opened(path, locking)
        except FileError:
            raise
        except (FileNotFoundError, NotADirectoryError):
            raise FileError(f"{path}: no such file") from None
        except BlockingIOError:
            raise FileError(
                f"{path}: in use by a running simulation, which is writing it just now; try again"
            ) from None
        except PermissionError:
            raise FileError(f"{path}: permission denied") from None
        except Exception as error:
            raise FileError(f"{path}: {_damage(path, error)}") from error

    @property
    def size(self) -> int:
        """Size of the file [bytes], which may still grow."""
        return os.fstat(self.hdf.id.get_vfd_handle()).st_size

    def close(self) -> None:
        self.hdf.close()

    def _reopen(self) -> None:
        self.hdf.close()
        self._found.clear()
        self.hdf, _ = _opened(self.path, self._locking)

    @_again
    def read(self, place: str, key: int | slice) -> Array:
        """Rows of the dataset at a path."""
        data = self._dataset(place)
        with self.reading(place):
            return np.asarray(data[key])

    def wrong(self, place: str, what: str) -> FileError:
        """The error for an invalid dataset, group or attribute."""
        return FileError(f"{self.path}: {brief(place)}: {what}")

    @contextmanager
    def reading(self, place: str) -> Iterator[None]:
        """Turns exceptions of h5py into :class:`FileError`: a damaged file can raise almost any exception."""
        if not self.hdf:
            raise FileError(f"{self.path}: is closed")
        try:
            yield
        except FileError:
            raise
        except MemoryError as error:
            raise self.wrong(place, "does not fit into memory") from error
        except Exception as error:
            if self.running:
                raise RunningFileError(
                    f"{self.path}: {brief(place)}: the run has written the file since it was opened; open it again"
                ) from error
            raise self.wrong(place, f"cannot read: {reason(error)}") from error

    # --- contents -----------------------------------------------------------------------------

    @_again
    def find(self, place: str, followed: int = 0) -> h5py.Group | h5py.Dataset | None:
        """The object at a path; ``None`` if there is none. Links to other files are refused."""
        if place in self._found and self.hdf:
            return self._found[place]
        node: Any = self.hdf
        names = place.strip("/").split("/")
        with self.reading(place):
            for depth, name in enumerate(names):
                if not isinstance(node, h5py.Group):
                    raise self.wrong("/".join(names[:depth]), "is no group")
                links, raw = node.id.links, name.encode("utf-8", "surrogateescape")
                if not links.exists(raw):
                    return None
                kind = links.get_info(raw).type
                if kind == h5py.h5l.TYPE_SOFT and followed < LINKS_MOST:
                    target = links.get_val(raw).decode("utf-8", "surrogateescape")
                    start = "" if target.startswith("/") else "/".join(names[:depth]) + "/"
                    found = self.find("/".join([start + target, *names[depth + 1 :]]), followed + 1)
                    if found is None:
                        raise self.wrong("/".join(names[: depth + 1]), f"is a link to nothing ({brief(target)})")
                    return found
                if kind != h5py.h5l.TYPE_HARD:
                    raise self.wrong(
                        "/".join(names[: depth + 1]), "is a link to another file, or to another link without end"
                    )
                node = node[name]
        if not isinstance(node, (h5py.Group, h5py.Dataset)):
            raise self.wrong(place, "is neither a group nor a dataset")
        self._found[place] = node
        return node

    def is_group(self, place: str) -> bool:
        """Whether there is a group at a path."""
        return isinstance(self.find(place), h5py.Group)

    @_again
    def members(self, place: str) -> list[str]:
        """Names in a group; empty if it does not exist."""
        group = self.find(place)
        if group is None:
            return []
        if not isinstance(group, h5py.Group):
            raise self.wrong(place, "is no group")
        with self.reading(place):
            return list(group)

    @_again
    def attributes(self, place: str) -> list[str]:
        """Names of the attributes of a group or dataset; empty if it does not exist."""
        node = self.find(place)
        with self.reading(place):
            return [] if node is None else list(node.attrs)

    # --- values ----------------------------------------------------------------------------------------

    @_again
    def column(self, place: str, shape: tuple[int | None, ...], kinds: str = "fiu") -> Column:
        """A dataset of numbers; ``None`` in ``shape`` is any length, ``kinds`` those of NumPy.

        Its data are read on access.
        """
        key = f"{place} {shape} {kinds}"
        if key not in self._columns:
            data = self._dataset(place)
            with self.reading(place):
                found, dtype = data.shape, data.dtype
            enum = h5py.check_enum_dtype(dtype) is not None
            if dtype.kind not in kinds or dtype.itemsize > 8 or (enum and "f" in kinds):
                raise self.wrong(place, f"holds {brief(dtype)}; must hold {_KINDS[kinds]} of up to 8 bytes")
            if found is None or len(found) != len(shape) or any(w not in (None, s) for s, w in zip(found, shape)):
                allowed = ", ".join("any" if size is None else str(size) for size in shape)
                raise self.wrong(place, f"has shape {found}; must be ({allowed})")
            self._columns[key] = Column(self, place, data, self._rows(place, data))
        return self._columns[key]

    @_again
    def rank(self, place: str) -> int:
        """Number of axes of a dataset."""
        data = self._dataset(place)
        with self.reading(place):
            return len(data.shape or ())

    @_again
    def value(self, place: str) -> Any:
        """Number, text or array of either, as a dataset or an attribute of its group; ``None`` if it is neither."""
        group, _, name = place.rpartition("/")
        if self.find(group) is None:
            return None
        if self.find(place) is not None:
            data = self._dataset(place)
            self._plain(place, data.dtype, data.shape)
            self._rows(place, data, whole=True)
            with self.reading(place):
                return self._decoded(place, data[()])
        return self.attribute(group, name)

    @_again
    def attribute(self, place: str, name: str) -> Any:
        """Number, text or array of either; ``None`` if there is no such attribute."""
        node, full = self.find(place), f"{place}@{name}"
        if node is None:
            return None
        with self.reading(full):
            if name not in node.attrs:
                return None
            about = node.attrs.get_id(name)
            declared = math.prod(about.shape or ()) * about.get_type().get_size()
            if declared > min(ATTRIBUTE_MOST, self.size):
                raise self.wrong(full, f"declares {declared:,} bytes; an attribute has up to {ATTRIBUTE_MOST:,}")
            self._plain(full, about.dtype, about.shape)
            return self._decoded(full, node.attrs[name])

    def integer(self, place: str) -> int | None:
        """A whole number; ``None`` if it is not there."""
        value = self.value(place)
        if value is None:
            return None
        if not isinstance(value, (int, np.integer)) or isinstance(value, bool):
            raise self.wrong(place, f"is {brief(repr(value))}; must be a whole number")
        return int(value)

    def text(self, place: str) -> str | None:
        """Text; ``None`` if it is not there."""
        value = self.value(place)
        if not isinstance(value, (str, type(None))):
            raise self.wrong(place, f"is {brief(repr(value))}; must be text")
        return value

    def texts(self, place: str) -> list[str] | None:
        """A list of texts; ``None`` if it is not there."""
        return self.listed(place, self.value(place))

    def listed(self, place: str, value: Any) -> list[str] | None:
        """``value`` as a list of texts, of which one may stand alone."""
        if value is None:
            return None
        several: list[Any] = [value] if isinstance(value, str) else list(np.atleast_1d(value))
        if not all(isinstance(one, str) for one in several):
            raise self.wrong(place, f"is {brief(repr(value))}; must be a list of texts")
        return several

    # --- checks of a dataset ---------------------------------------------------------------------------

    def _dataset(self, place: str) -> h5py.Dataset:
        data = self.find(place)
        if data is None:
            raise self.wrong(place, "is missing")
        if not isinstance(data, h5py.Dataset):
            raise self.wrong(place, "is a group; must be a dataset")
        return data

    def _plain(self, place: str, dtype: np.dtype, shape: tuple[int, ...] | None) -> None:
        if (dtype.kind not in "fiub" and h5py.check_string_dtype(dtype) is None) or shape is None or len(shape) > 2:
            raise self.wrong(place, f"holds {brief(dtype)} of shape {shape}; must be numbers or text")

    def _decoded(self, place: str, value: Any) -> Any:
        if isinstance(value, bytes):
            try:
                return value.decode("utf-8")
            except UnicodeDecodeError:
                raise self.wrong(place, "is not UTF-8 text") from None
        if isinstance(value, np.ndarray):
            if value.dtype.kind in "SO":
                texts = [self._decoded(place, one) for one in value.ravel().tolist()]
                return np.array(texts, object).reshape(value.shape)
            return value.astype(value.dtype.newbyteorder("="), copy=False)
        return value

    def _rows(self, place: str, data: h5py.Dataset, whole: bool = False) -> int:
        """Rows that are stored. Raises :class:`FileError` if the file cannot hold what the dataset declares.

        A flush cut short by a kill may leave rows without a chunk at the end: these do not count.
        """
        with self.reading(place):
            shape: tuple[int, ...] = data.shape or ()
            plan, size = data.id.get_create_plist(), data.id.get_type().get_size()
            if plan.get_layout() == h5py.h5d.VIRTUAL or plan.get_external_count():
                raise self.wrong(place, "is stored in another file")
            declared, stored = math.prod(shape) * size, data.id.get_storage_size()
            needs = f"declares shape {shape}, {declared:,} bytes"
            if stored > self.size:
                raise self.wrong(place, f"claims {stored:,} bytes of a file of {self.size:,}")
            if plan.get_layout() != h5py.h5d.CHUNKED:
                if declared > stored:
                    raise self.wrong(place, f"{needs}; {stored:,} are stored")
                return shape[0] if shape else 1
            filters = [plan.get_filter(k)[0] for k in range(plan.get_nfilters())]
            if foreign := [number for number in filters if number not in _FILTERS]:
                raise self.wrong(
                    place, f"is packed by HDF5 filter {foreign[0]}; known are {', '.join(map(str, _FILTERS))}"
                )
            expands = DEFLATE_MOST if any(_FILTERS[number] for number in filters) else 1
            if declared > expands * self.size:
                raise self.wrong(place, f"{needs}; the file of {self.size:,} bytes cannot hold them")
            chunk, chunks = plan.get_chunk(), data.id.get_num_chunks()
            if chunks * math.prod(chunk) * size > expands * stored:
                raise self.wrong(place, f"has {chunks:,} chunks of shape {chunk}; {stored:,} bytes are stored")
            grid = [-(-length // part) for length, part in zip(shape, chunk)]
            rows: int = shape[0]
            if chunks >= math.prod(grid):
                return rows
            if whole:
                raise self.wrong(place, f"{needs}; only {chunks:,} of its chunks are stored")
            return min(rows, chunks // max(1, math.prod(grid[1:])) * chunk[0])


def _damage(path: Path, error: Exception) -> str:
    """Why a file cannot be opened, in plain words."""
    try:
        known = h5py.is_hdf5(path)
    except Exception:
        known = False
    if not known:
        return "not an HDF5 file"
    if cut := re.search(r"truncated file: eof = (\d+),.* stored_eof = (\d+)", str(error)):
        return f"truncated: {cut[1]} of its {cut[2]} bytes are there"
    return f"damaged HDF5 file ({reason(error)})"


def reason(error: BaseException) -> str:
    """Why an operation of HDF5 failed: the system's error message, or else the first line of the exception."""
    if number := getattr(error, "errno", None):
        return os.strerror(number)
    told = str(error.args[0]) if error.args else ""
    if system := re.search(r"error message = '([^']+)'", told):
        return brief(system[1])
    return brief(told.splitlines()[0] if told else type(error).__name__)
