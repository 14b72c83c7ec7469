"""haff: read, check and draw the output of the event-driven hard-sphere simulator ``haff``.

>>> import haff
>>> run = haff.open("cooling.h5")                    # doctest: +SKIP
>>> run.observables[["time", "temperature"]]         # doctest: +SKIP
>>> run.frames[-1].velocity                          # doctest: +SKIP
>>> run.events[:1000]                                # doctest: +SKIP

The closed forms to compare with stand in :mod:`haff.theory` (gases) and :mod:`haff.mechanics` (impact, pendulums,
springs, rods); :func:`restitution_from` recovers e from what was seen. Checks and statistics on top of freud, SciPy
and MDAnalysis stand in :mod:`haff.analysis`, the figures of ``haff plot`` in :mod:`haff.figures`.
"""

from importlib.metadata import PackageNotFoundError, version

from . import analysis, mechanics, theory
from .errors import ArgumentError, FileError, HaffError, MissingDataError, MissingPackageError, NotApplicableError
from .events import Events
from .frames import Box, Frame, Frames
from .reader import File, open
from .restitution import restitution_from
from .viewer import view

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
    "mechanics",
    "open",
    "restitution_from",
    "theory",
    "view",
]
