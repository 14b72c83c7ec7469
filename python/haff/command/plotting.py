"""Figures of files that are open, or of paths."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from .. import figures
from ..reader import File, source_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot"]


def plot(
    source: File | str | os.PathLike[str],
    kind: str,
    output: str | os.PathLike[str] | None = None,
    *,
    overwrite: bool = False,
    title: bool = True,
    **options: object,
) -> Figure:
    """Draws one standard figure of a file, which notebooks show; writes it if ``output`` is given.

    Parameters
    ----------
    source
        An open file, or a path.
    kind
        ``"temperature"``, ``"energy"``, ``"velocity"``, ``"snapshot"``, …: a key of :data:`haff.figures.KINDS`.
    output
        The picture to write, ``.png``, ``.pdf`` or ``.svg``; by default none.
    overwrite
        Whether an existing picture is replaced.
    title
        Whether the figure has its title and the line of facts below it.
    options
        ``index``: the frame of a figure of frames (:data:`haff.figures.OF_FRAMES`). Figures of one frame are by default
        of the last, others of several.

    Raises
    ------
    ArgumentError
        There is no such figure or format; the picture exists.
    NotApplicableError, MissingDataError
        The figure does not apply to this file, or the data that it needs were not recorded.
    FileError
        The file cannot be read, or the picture not be written.

    Examples
    --------
    >>> import haff
    >>> figure = haff.plot("gas.h5", "temperature")                       # doctest: +SKIP
    >>> haff.plot("gas.h5", "snapshot", "last.pdf", index=-1)             # doctest: +SKIP
    """
    opened = source_of(source)
    if isinstance(opened, File):
        return figures.plot(opened, kind, output, overwrite=overwrite, title=title, **options)
    figures.check_picture(output, overwrite)
    with File(opened) as file:
        return figures.plot(file, kind, output, overwrite=overwrite, title=title, **options)
