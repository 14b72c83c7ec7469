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

Studies of many runs, here or on a cluster, are made by :func:`haff.sweep`, dense packings by :func:`haff.pack`.
"""

from __future__ import annotations

from importlib import import_module, util
from typing import TYPE_CHECKING, Any

# Names are imported on first use: NumPy, h5py, pandas and Matplotlib together take a second to load, and few programs
# need all of them. Type checkers and editors read the imports below, Python the table `_HOME`; a test compares them.
if TYPE_CHECKING:
    from . import analysis, mechanics, theory
    from .command.packings import pack
    from .command.plotting import plot
    from .command.runs import Result, resume, run
    from .command.study import open_study
    from .command.sweeps import sweep
    from .errors import (
        ArgumentError,
        FileError,
        HaffError,
        MissingDataError,
        MissingPackageError,
        NotApplicableError,
        OutOfRangeError,
        SceneError,
        SceneProblem,
        SimulationError,
        UnknownNameError,
    )
    from .files.box import Box, Shear
    from .files.events import Events
    from .files.frames import Frame, Frames
    from .live.simulation import Simulation
    from .packing import Packing, open_packing
    from .reader import File, open
    from .restitution import restitution_from
    from .scenes import load_scene, save_scene, schema, template, templates, validate
    from .viewer import view

    __version__: str

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
    "OutOfRangeError",
    "Packing",
    "Result",
    "SceneError",
    "SceneProblem",
    "Shear",
    "Simulation",
    "SimulationError",
    "UnknownNameError",
    "analysis",
    "load_scene",
    "mechanics",
    "open",
    "open_packing",
    "open_study",
    "pack",
    "plot",
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

_HOME = {
    "errors": (
        "ArgumentError",
        "FileError",
        "HaffError",
        "MissingDataError",
        "MissingPackageError",
        "NotApplicableError",
        "OutOfRangeError",
        "SceneError",
        "SceneProblem",
        "SimulationError",
        "UnknownNameError",
    ),
    "files.events": ("Events",),
    "files.box": ("Box", "Shear"),
    "files.frames": ("Frame", "Frames"),
    "command.packings": ("pack",),
    "command.plotting": ("plot",),
    "packing": ("Packing", "open_packing"),
    "reader": ("File", "open"),
    "restitution": ("restitution_from",),
    "command.runs": ("Result", "resume", "run"),
    "scenes": ("load_scene", "save_scene", "schema", "template", "templates", "validate"),
    "live.simulation": ("Simulation",),
    "command.study": ("open_study",),
    "command.sweeps": ("sweep",),
    "viewer": ("view",),
}
"""Module of each name of :data:`__all__` that is not a module itself."""
_MODULE = {name: module for module, names in _HOME.items() for name in names}


def __getattr__(name: str) -> Any:
    """A public name, or a module of this package, imported now (PEP 562)."""
    if name in _MODULE:
        value = getattr(import_module(f".{_MODULE[name]}", __name__), name)
    elif name == "__version__":
        value = _version()
    elif not name.startswith("_") and util.find_spec(f"{__name__}.{name}") is not None:
        value = import_module(f".{name}", __name__)
    else:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__all__", "__doc__", "__file__", "__name__", "__path__", "__version__"])


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("haff")
    except PackageNotFoundError:  # used from the source tree, not installed
        return "0+source"
