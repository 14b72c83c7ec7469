"""haff: read, check and draw the output of the event-driven hard-sphere simulator ``haff``.

>>> import haff
>>> run = haff.open("cooling.h5")                    # doctest: +SKIP
>>> run.observables[["time", "temperature"]]         # doctest: +SKIP
>>> run.frames[-1].velocity                          # doctest: +SKIP
>>> run.events[:1000]                                # doctest: +SKIP

The closed forms to compare with stand in :mod:`haff.theory`, checks and statistics on top of freud, SciPy and
MDAnalysis in :mod:`haff.analysis`, the figures of ``haff plot`` in :mod:`haff.figures`.
"""

from importlib.metadata import PackageNotFoundError, version

from . import analysis, theory
from .errors import ArgumentError, FileError, HaffError, MissingDataError, MissingPackageError, NotApplicableError
from .events import Events
from .frames import Box, Frame, Frames
from .reader import File, open

try:
    __version__ = version("haff")
except PackageNotFoundError:  # used from the source tree, not installed
    __version__ = "0+source"

__all__ = [
    "ArgumentError",
    "Box",
    "Events",
    "File",
    "FileError",
    "Frame",
    "Frames",
    "HaffError",
    "MissingDataError",
    "MissingPackageError",
    "NotApplicableError",
    "analysis",
    "open",
    "theory",
]
