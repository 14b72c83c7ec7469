"""haff: event-driven hard spheres, run from Python; their output read, checked and drawn.

>>> import haff
>>> gas = haff.template("cooling")                            # a scene is a dict, or the path of a TOML file
>>> result = haff.run(gas, file="gas.h5", run__until=20)      # doctest: +SKIP
>>> result.file.observables[["time", "temperature"]]          # doctest: +SKIP
>>> run = haff.open("gas.h5")                                 # doctest: +SKIP
>>> run.frames[-1].velocity                                   # doctest: +SKIP
>>> run.events[:1000]                                         # doctest: +SKIP
>>> live = haff.Simulation(gas)                               # doctest: +SKIP
>>> live.advance(until=1.0); live.positions                   # doctest: +SKIP

The closed forms to compare with stand in :mod:`haff.theory` (gases) and :mod:`haff.mechanics` (impact, pendulums,
springs, rods); :func:`restitution_from` recovers e from what was seen. Checks and statistics on top of freud, SciPy
and MDAnalysis stand in :mod:`haff.analysis`, the figures of ``haff plot`` in :mod:`haff.figures`.

Studies of many runs, here or on a cluster, are made by :func:`haff.sweep`.
"""

from importlib.metadata import PackageNotFoundError, version

from . import analysis, mechanics, theory
from .errors import (
    ArgumentError,
    FileError,
    HaffError,
    MissingDataError,
    MissingPackageError,
    NotApplicableError,
    SceneError,
    SceneProblem,
    SimulationError,
)
from .events import Events
from .frames import Box, Frame, Frames, Shear
from .reader import File, open
from .restitution import restitution_from
from .runs import Result, resume, run
from .scenes import load_scene, save_scene, schema, template, templates, validate
from .simulation import Simulation
from .sweep import sweep
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
    "Result",
    "SceneError",
    "SceneProblem",
    "Shear",
    "Simulation",
    "SimulationError",
    "analysis",
    "load_scene",
    "mechanics",
    "open",
    "restitution_from",
    "resume",
    "run",
    "save_scene",
    "schema",
    "sweep",
    "template",
    "templates",
    "theory",
    "validate",
    "view",
]
