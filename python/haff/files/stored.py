"""Checked access to the datasets of a file. All reading goes through this module.

A file may be damaged, cut, or made by another program. Before a dataset is read, its type and shape are compared with
those expected, and the declared size with the size of the file; errors of HDF5 are raised as
:class:`FileError`.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np

from ..errors import FileError, RunningFileError
from ..text import brief
from .column import Column
from .handshake import Count, Reading, is_being_written, one_state
from .index import load
from .layout import Array
from .regular import require_file
from .source import Source

Node = TypeVar("Node", h5py.Group, h5py.Dataset)

DEFLATE_MOST = 1032
"""Bytes that one deflated byte stands for, at most."""
ATTRIBUTE_MOST = 1 << 16
"""Bytes of an attribute, at most."""
_REPLACED = "correlations"
"""Group of groups whose datasets a run replaces; all others only get more rows."""
LINKS_MOST = 8
"""Soft links that are followed from one place."""
_KINDS = {"f": "real numbers", "iu": "integers", "fiu": "numbers"}
# Filters of HDF5 by number: deflate, shuffle, fletcher32, szip, lzf.
_FILTERS = {1: True, 2: False, 3: False, 4: True, 32000: True}


def _opened(path: Path, locking: bool | None) -> h5py.File | None:
    """The file, which cannot change while it is open; ``None`` if a simulation is writing it."""
    if locking is False and is_being_written(path):
        return None
    try:
        hdf = h5py.File(path, "r", locking=locking)
    except BlockingIOError:
        if locking:
            raise
        return None
    except OSError as error:
        # This process has the file open with other locking.
        if locking is not None or "locking flag" not in str(error):
            raise
        return None if is_being_written(path) else h5py.File(path, "r", locking=False)
    count = Count.of(hdf.id.get_vfd_handle())
    # Where HDF5 locks nothing, because it was told so or cannot, only the counter says that a run has not ended.
    if count is not None and count.flushes > 0 and is_being_written(path) is not False:
        hdf.close()
        return None
    return hdf


class Stored:
    """An HDF5 file, opened for reading.

    Of a file that a run is writing it is one state, that when it was opened: all of the index is read then, and kept.
    What HDF5 reads later are rows, which a run does not change.
    """

    def __init__(self, path: Path, locking: bool | None = None) -> None:
        self.path = path
        self._found: dict[str, h5py.Group | h5py.Dataset] = {}
        self._columns: dict[str, Column] = {}
        self._replaced: dict[str, Array] = {}
        self._source: Source | None = None
        self._count: Count | None = None
        self.hdf: h5py.File
        self.running = False
        """Whether a run was writing the file when it was opened."""
        try:
            require_file(path)
            hdf = _opened(path, locking)
            if hdf is None:
                one_state(path, self._load, lambda _: self.close())
            else:
                self.hdf = hdf
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

    def _load(self, reading: Reading) -> None:
        """Opens the file while a run is writing it, and reads all of its index."""
        self.running, self._count = True, reading.count
        self._source = Source(os.dup(reading.descriptor), self.path)
        self.hdf = self._checked = h5py.File(self._source, "r")
        try:
            # What cannot be read now raises its error again when it is wanted.
            for place, attribute in load(self.hdf):
                with suppress(FileError):
                    if attribute is None:
                        self.value(place)
                    else:
                        self.attribute(place, attribute)
            with suppress(FileError):
                self._read_replaced()
        except BaseException:
            self.close()
            raise

    def _read_replaced(self) -> None:
        for kind in self.members(_REPLACED):
            for part in self.members(f"{_REPLACED}/{kind}"):
                place = f"{_REPLACED}/{kind}/{part}"
                data = self._dataset(place)
                self._rows(place, data)
                with self.reading(place):
                    self._replaced[place] = data[()]

    @property
    def size(self) -> int:
        """Size of the file [bytes], which may still grow."""
        return os.fstat(self._descriptor).st_size

    @property
    def _descriptor(self) -> int:
        return self.hdf.id.get_vfd_handle() if self._source is None or not self.running else self._source.descriptor

    def close(self) -> None:
        for kept in (self._found, self._columns, self._replaced):
            kept.clear()
        for name in ("_checked", "hdf"):
            if name in self.__dict__:
                self.__dict__[name].close()

    def read(self, place: str, key: int | slice) -> Array:
        """Rows of the dataset at a path."""
        data = self._dataset(place)
        with self.reading(place):
            values = self._replaced[place][key] if place in self._replaced else np.asarray(data[key])
        self._require_rows_kept()
        return values

    def _require_rows_kept(self) -> None:
        if self.running and self._count is not None:
            now = Count.of(self._descriptor)
            if now is None or now.resumptions != self._count.resumptions:
                raise RunningFileError(f"{self.path}: its run has been resumed since it was opened; open it again")

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
            self._require_rows_kept()
            raise self.wrong(place, f"cannot read: {reason(error)}") from error

    # --- contents -----------------------------------------------------------------------------

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

    def members(self, place: str) -> list[str]:
        """Names in a group; empty if it does not exist."""
        group = self.find(place)
        if group is None:
            return []
        if not isinstance(group, h5py.Group):
            raise self.wrong(place, "is no group")
        with self.reading(place):
            return list(group)

    def attributes(self, place: str) -> list[str]:
        """Names of the attributes of a group or dataset; empty if it does not exist."""
        node = self.find(place)
        with self.reading(place):
            return [] if node is None else list(node.attrs)

    # --- values ----------------------------------------------------------------------------------------

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

    def rank(self, place: str) -> int:
        """Number of axes of a dataset."""
        data = self._dataset(place)
        with self.reading(place):
            return len(data.shape or ())

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
                values = self._through_checks(data, data.dtype)[()]
            return self._decoded(place, values)
        return self.attribute(group, name)

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
            return self._decoded(full, self._through_checks(node, about.dtype).attrs[name])

    def _through_checks(self, node: Node, dtype: np.dtype) -> Node:
        """The same group or dataset, for reading ``dtype``: texts of any length are in heaps, which need checks."""
        text = h5py.check_string_dtype(dtype)
        if text is None or text.length is not None or self.running:
            return node
        return self._checked[node.name]

    @cached_property
    def _checked(self) -> h5py.File:
        """The file as read through :class:`Source`."""
        return h5py.File(Source(os.dup(self._descriptor), self.path), "r")

    def require_attributes(self, *places: str) -> None:
        """Raises :class:`FileError` if an attribute of these groups, or of what is in them, cannot be read."""
        pending, known = list(places), set()
        while pending:
            place = pending.pop()
            node = self.find(place)
            # A damaged group may be in itself.
            if node is None or node.id in known:
                continue
            known.add(node.id)
            for name in self.attributes(place):
                self.attribute(place, name)
            if isinstance(node, h5py.Group):
                pending += [f"{place}/{member}" for member in self.members(place)]

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
