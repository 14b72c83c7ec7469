"""Lazy reader of the HDF5 (H5MD 1.1) files that ``haff run`` writes.

Data are read on first use. A file that is still growing, or whose run was killed, is read up to
the last frame, sample and event that is complete: where columns differ in length, the common length counts.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .common import arguments
from .errors import ArgumentError
from .files.recording import Recording
from .text import quoted

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["File", "open", "source_of"]


def open(path: str | os.PathLike[str], *, locking: bool | None = None) -> File:
    """Open an output file for reading.

    Parameters
    ----------
    path
        The HDF5 file.
    locking
        Whether to hold HDF5's file lock. Default: yes, unless a run is writing the file: then what has been flushed
        is read, and :attr:`File.running` is true.

    Raises
    ------
    FileError
        The file is missing, unreadable, not HDF5 or not of ``haff``. Later
        accesses raise it, too, if a dataset is damaged, has another type or shape than specified, declares
        more than the file can hold, is a link to another file, or holds a number that no run can have written.

    Examples
    --------
    >>> import haff
    >>> with haff.open("cooling.h5") as run:                          # doctest: +SKIP
    ...     run.observables.plot(x="time", y="temperature", loglog=True)
    ...     for frame in run.frames[::10]:
    ...         print(frame.time, frame.velocity.std(axis=0))
    """
    return File(path, locking=locking)


class File(Recording):
    """An output file of ``haff run``; see :func:`haff.open`.

    Use it as a context manager, or call :meth:`close`. The underlying :class:`h5py.File` is :attr:`hdf`.
    """

    def export(self, output: str | os.PathLike[str] | None = None, **options: Any) -> Path:
        """Writes a file for other programs: GSD, extended XYZ, VTKHDF, CSV or Parquet; returns its path.

        ``options``: ``to``, ``frames``, ``table``, ``unwrapped`` and ``overwrite`` of :func:`haff.export.export`.

        Examples
        --------
        >>> run.export("gas.gsd", frames="::10")                        # doctest: +SKIP
        >>> run.export("events.parquet", table="events")                # doctest: +SKIP
        """
        from .export import export

        return export(self, output, **options)

    def impacts(self, most: int = 10_000) -> pd.DataFrame:
        """The impacts of a run of few bodies as a table; see :func:`haff.analysis.impacts`."""
        from .analysis import impacts

        return impacts(self, most)

    def plot(
        self, kind: str, output: str | os.PathLike[str] | None = None, *, overwrite: bool = False, **options: Any
    ) -> Figure:
        """Draws one standard figure, which notebooks show; writes it if ``output`` is given. See :func:`haff.plot`.

        Examples
        --------
        >>> run.plot("temperature")                                     # doctest: +SKIP
        >>> run.plot("snapshot", "first.pdf", index=0)                  # doctest: +SKIP
        """
        from .figures import plot

        return plot(self, kind, output, overwrite=overwrite, **options)


def source_of(source: object) -> File | Path:
    """The argument ``source`` of a function that takes an open file, or a path. Raises :class:`ArgumentError`."""
    if isinstance(source, File):
        return source
    if not isinstance(source, (str, bytes, os.PathLike)):
        raise ArgumentError(f"source = {quoted(source)}: must be an open haff.File, or the path of one")
    return arguments.file("source", source)
