"""Runs made by the command ``haff``, called from Python."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any

from .. import reader
from ..common import arguments
from ..common.compiled import compiled
from ..common.notebook import table
from ..common.output import replacing
from ..common.temporary import TemporaryFolder
from ..common.words import warn
from ..errors import FileError, SimulationError
from ..scenes import ProposedName, Scene, explained, scene_path, settings, source
from ..scenes.keywords import dotted
from .call import call, failure

__all__ = ["Result", "resume", "run"]


@dataclass(frozen=True)
class Result:
    """A run: its totals, and its file if it wrote one.

    Every total of ``haff run --json`` is in :attr:`report`; those of the stable interface are attributes. A temporary
    file is removed with the result and its :attr:`file`, or when Python ends; :meth:`save` keeps a copy.
    """

    report: Mapping[str, Any] = field(repr=False)
    """All totals, by name."""
    path: Path | None
    """The output file; ``None`` if nothing was written."""
    folder: TemporaryFolder | None = field(default=None, repr=False, compare=False)
    """The folder of a temporary file; ``None`` if the file was named."""
    particles: int = field(init=False)
    """Number of particles."""
    collisions: int = field(init=False)
    """Collisions between particles."""
    wall_collisions: int = field(init=False)
    """Collisions with walls."""
    events: int = field(init=False)
    """Collisions of both kinds."""
    simulated_time: float = field(init=False)
    """Simulated time at the end [time]."""
    wall_seconds: float = field(init=False)
    """How long the run took [s]."""
    collisions_per_second: float = field(init=False)
    """Collisions between particles per second."""
    ledger_residual: float = field(init=False)
    """What is missing in the balance of energies, relative to its largest term."""
    max_overlap: float = field(init=False)
    """Deepest overlap of any two close particles in any frame [contact distances]."""
    peak_memory_bytes: int = field(init=False)
    """Largest resident memory [bytes]."""
    threads: int = field(init=False)
    """Threads used."""
    seed: int = field(init=False)
    """Seed of all random numbers."""
    version: str = field(init=False)
    """Version and git revision of the command."""
    trajectory_version: int = field(init=False)
    """Raised when a scene gives other bits than before."""
    state_hash: str = field(init=False)
    """Hash of every particle's final position, velocity and image."""
    stopped: str = field(init=False)
    """Why the run ended: ``until``, ``collisions``, ``wall_time``, ``rest``, …

    Of growth: ``packing_fraction``, ``reduced_pressure``.
    """

    def __post_init__(self) -> None:
        for name, about in self.__dataclass_fields__.items():
            if not about.init:
                object.__setattr__(self, name, self.report[name])

    def _repr_html_(self) -> str:
        """A table for notebooks."""
        rows = [
            ("file", "none" if self.path is None else self.path),
            ("stopped by", self.stopped),
            ("simulated time", f"{self.simulated_time:g}"),
            ("particles", f"{self.particles:,}"),
            ("collisions", f"{self.collisions:,}"),
            ("wall collisions", f"{self.wall_collisions:,}"),
            ("run time [s]", _shown(self.wall_seconds, ".3g")),
            ("collisions per second", _shown(self.collisions_per_second, ",.0f")),
            ("ledger residual", _shown(self.ledger_residual, ".2g")),
            ("largest overlap", _shown(self.max_overlap, ".2g")),
            ("state hash", self.state_hash),
        ]
        return table("Run", rows)

    def __getitem__(self, name: str) -> Any:
        """A total by its name in the report."""
        return self.report[name]

    @cached_property
    def file(self) -> reader.File:
        """The output file, open for reading; see :func:`haff.open`. :class:`FileError` if nothing was written."""
        file = reader.open(self._written())
        # The folder lasts as long as the file is used.
        vars(file)["folder"] = self.folder
        return file

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Copy the output file, such as a temporary one, and return the path of the copy.

        Raises :class:`ArgumentError` if ``path`` exists and ``overwrite`` is false, :class:`FileError` if it cannot be
        written, or nothing was written.
        """
        source, path = self._written(), arguments.file("path", path)
        with replacing(path, source=source, overwrite=overwrite) as part:
            shutil.copyfile(source, part)
        return path

    def _written(self) -> Path:
        if self.path is None:
            raise FileError("the run wrote no file: name one by file=… or output.file of the scene")
        return self.path

    def close(self) -> None:
        """Close the file, if it was opened."""
        if "file" in self.__dict__:
            self.file.close()

    def __enter__(self) -> Result:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _shown(number: float | None, form: str) -> str:
    """A number; JSON has none for NaN and infinities."""
    return "unknown" if number is None else format(number, form)


def run(
    scene: Scene,
    /,
    *,
    file: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    progress: bool = False,
    **overrides: Any,
) -> Result:
    """Run a scene to its end by the command ``haff``, and return its totals and its file.

    Parameters
    ----------
    scene
        A dict with the keys of a scene file, or the path of one.
    file
        Output file, instead of the scene's ``output.file``. Relative paths count from the current directory. If neither
        names a file, none is written. A :func:`template` names none: its results are in a temporary file, which
        :meth:`Result.save` keeps.
    overwrite
        Replace the output file if there is one.
    threads
        Default: all processors. No result depends on it.
    progress
        Show the progress bar and the closing lines on standard error.
    overrides
        Keys of the scene, two underscores for the dot: ``contact__restitution=0.8, run__until=50``.

    Raises
    ------
    SceneError
        The scene is invalid; ``error.problems`` lists all errors.
    SimulationError
        The simulation cannot continue; ``error.result`` has what was recorded before.
    FileError
        A file cannot be read or written, or exists already.
    KeyboardInterrupt
        Ctrl-C; the run has ended with a checkpoint, and :func:`resume` continues it.

    Examples
    --------
    >>> import haff
    >>> gas = {
    ...     "schema": 1,
    ...     "domain": {"packing_fraction": 0.1},
    ...     "species": [{"name": "grain", "count": 500, "radius": 0.5, "mass": 1.0}],
    ...     "run": {"until": 10.0},
    ... }
    >>> cooled = haff.run(gas, contact__restitution=0.8)
    >>> cooled.particles, cooled.stopped, cooled.max_overlap < 1e-12
    (500, 'until', True)
    >>> with haff.run(gas, file="gas.h5", contact__restitution=0.8) as run:
    ...     print(run.file.observables["temperature"].iloc[-1] < 1.0)
    True
    """
    written = arguments.file("file", file) if file is not None else None
    options = [f"--set={setting}" for setting in settings(overrides)]
    if arguments.flag("overwrite", overwrite):
        options.append("--overwrite")
    path = None if isinstance(scene, Mapping) else scene_path(scene)
    folder = None
    if written is None and (name := _proposed(scene, overrides)):
        folder = TemporaryFolder()
        written = folder.path / name
    if written is not None:
        options.append(f"--output={written}")
    if path is not None:
        return _run([*options, "--", os.fspath(path)], threads, progress, (scene, overrides))
    with tempfile.TemporaryDirectory(prefix="haff-") as place:
        path = Path(place) / "scene.toml"
        path.write_text(source(scene, {})["text"], encoding="utf-8")
        return _run([*options, "--", os.fspath(path)], threads, progress, (scene, overrides), folder)


def _proposed(scene: Scene, overrides: Mapping[str, Any]) -> str | None:
    """The name of the output file if only a template proposes it."""
    if not isinstance(scene, Mapping) or {"output", "output.file"} & set(dotted(overrides)):
        return None
    output = scene.get("output")
    name = output.get("file") if isinstance(output, Mapping) else None
    return name if isinstance(name, ProposedName) else None


def resume(
    path: str | os.PathLike[str],
    *,
    file: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    progress: bool = False,
    **overrides: Any,
) -> Result:
    """Continue a run from the last checkpoint in its file, to its original end, or with changed keys in a new file.

    Without ``file``, the run continues in its own file: the result equals that of an uninterrupted run, bit by bit, and
    a complete file is not changed.

    Parameters
    ----------
    path
        The file of the run.
    file
        A new file, which begins at the checkpoint; the first one is not changed. The run may be complete.
    overwrite
        Replace the new file if there is one.
    threads, progress
        As for :func:`run`.
    overrides
        Keys of the scene that change from now on, two underscores for the dot: ``run__until=200``,
        ``wall__floor__motion__frequency=0.301``. They need ``file``. Walls go on from where they are; see
        :meth:`haff.Simulation.set`.

    Raises
    ------
    SceneError, SimulationError, FileError, KeyboardInterrupt
        As :func:`run`.

    Examples
    --------
    >>> import haff
    >>> first = haff.run(haff.template("cooling"), species__0__count=500, run__until=5.0, file="first.h5")
    >>> longer = haff.resume("first.h5", file="longer.h5", run__until=10.0)
    >>> longer["resumed_from"], longer.simulated_time
    (5.0, 10.0)
    """
    words = [f"--resume={arguments.file('path', path)}", *(f"--set={setting}" for setting in settings(overrides))]
    if file is not None:
        words.append(f"--output={arguments.file('file', file)}")
    if arguments.flag("overwrite", overwrite):
        words.append("--overwrite")
    return _run(words, threads, progress, None)


def _run(
    words: Sequence[str],
    threads: int | None,
    progress: bool,
    scene: tuple[Scene, Mapping[str, Any]] | None,
    folder: TemporaryFolder | None = None,
) -> Result:
    options = ["run", "--json"]
    if threads is not None:
        options.append(f"--threads={arguments.count('threads', threads, 1, 1024)}")
    if not arguments.flag("progress", progress):
        options.append("--quiet")
    done = call([*options, *words], show=progress)
    report = json.loads(done.stdout) if done.stdout.strip() else {}
    if done.returncode == 0:
        path = report["file"]
        # With progress the command has shown them.
        if not progress:
            warn(report.get("warnings", ()), stacklevel=4)
        return Result(report, None if path is None else Path(path), folder)
    if done.returncode == 2 and scene is not None:
        # The same errors, each with its place.
        with explained(*scene, ("file", "overwrite", "threads", "progress")):
            compiled().validate(source(*scene))
    error = failure(done, report.get("error"))
    if isinstance(error, SimulationError) and report.get("file"):
        error.result = Result(report, Path(report["file"]), folder)
    raise error
