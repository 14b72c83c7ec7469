"""Studies of many runs: :func:`sweep` runs a scene for every combination of values, here or on a Dask cluster.

Each run is one call of ``haff sweep … --index I``, so a study can be started here and continued by the command, by
Snakemake or by a job array, in the same folder.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import time
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..common import arguments
from ..common.compiled import compiled
from ..common.output import library
from ..common.words import warn
from ..errors import ArgumentError, FileError
from ..scenes import Scene, briefly, scene_path, scene_text, settings
from ..scenes.keywords import dotted
from ..text import escaped, quoted
from .call import call, failure, is_failure
from .study import Measure, Table

if TYPE_CHECKING:
    import xarray

__all__ = ["sweep"]


def sweep(
    scene: Scene,
    values: Mapping[str, Iterable[Any]] | None = None,
    *,
    seeds: int | None = None,
    output: str | os.PathLike[str],
    series: Sequence[str] = (),
    cluster: Any = None,
    jobs: int | None = None,
    threads: int | None = None,
    retries: int = 3,
    dims: str = "names",
    measure: Measure | None = None,
    **overrides: Any,
) -> xarray.Dataset:
    """Run a scene for every combination of values, and return the totals of all runs.

    Complete runs in the folder are kept, stopped ones continue from their checkpoints, and with more values or seeds
    than before only the missing ones are made. A run that fails does not stop the others: its ``status`` is
    ``"failed"``, its ``error`` is the reason, and a warning counts them.

    Parameters
    ----------
    scene
        A dict with the keys of a scene file, or the path of one. A dict is saved as ``scene.toml`` in the folder.
    values
        Dotted keys of the scene, and the values that each takes.
    seeds
        Runs of each combination, with seeds derived by a hash from the scene's seed, the parameters and the number of
        the run. Default: one, with the scene's own seed.
    output
        Folder of the files and of ``manifest.json``.
    series
        Columns of :attr:`haff.File.observables` to read from each file, as variables ``NAME_series`` over ``time``.
    cluster
        Where to run. Default: on this machine, by ``haff sweep``; ``"local"``: a Dask ``LocalCluster``; or any Dask
        cluster or client, such as a ``dask_jobqueue.SLURMCluster``, whose workers have this package and the folder.
    jobs
        Runs at a time on this machine. Default: as many as there are cores.
    threads
        Threads of each run. Default: 1 on a cluster, else the cores that are left over.
    retries
        How often a run is tried again on a cluster when its file could not be written, or it was killed.
    dims
        What dimensions are called: ``"names"`` (default), such as ``restitution``, which need no quotes:
        ``study.sel(restitution=0.8)``; or ``"keys"``, such as ``contact.restitution``. A name is the last part of the
        key, or more of it where other keys end so or the name is taken: ``species.grain.count`` and
        ``species.ball.count`` become ``grain_count`` and ``ball_count``. The attribute ``key`` of the coordinate is
        the key.
    measure
        A function of an open file (:class:`haff.File`) that returns a number, or a dict of numbers. They become
        variables, called as the function or the keys of the dict, NaN where a run is not complete; ``NAME_mean`` and
        ``NAME_error`` are the mean over the seeds and its standard error, NaN for a single seed.
    overrides
        Keys of the scene with one value, two underscores for the dot: ``run__until=50``. They are coordinates
        without a dimension.

    Returns
    -------
    xarray.Dataset
        A dimension for each key, and ``seed``, the number of the run from 0. Variables are the totals of
        :attr:`Result.report`, ``status``, ``error``, ``file`` (an absolute path) and ``run_seed``. Along a further
        dimension ``observable`` there are the means of each run over its stationary part, as :attr:`haff.File.means`
        has them: ``observable_mean``, ``observable_error`` (standard error), ``observable_start`` (the time from which
        on the run is stationary) and ``observable_drifts``. :func:`open_study` opens the same again.

    Raises
    ------
    SceneError
        The scene or the values are invalid.
    FileError
        A file cannot be read or written, or the folder holds another sweep.
    ArgumentError
        An argument is not one of those allowed.

    Examples
    --------
    >>> import haff
    >>> gas = haff.template("cooling")
    >>> values = {"contact.restitution": [0.8, 0.9]}
    >>> study = haff.sweep(gas, values, seeds=4, output="study")                                # doctest: +SKIP
    >>> study.dissipated_energy.sel(restitution=0.8).mean("seed")                               # doctest: +SKIP
    >>> study.observable_mean.sel(observable="temperature")                                     # doctest: +SKIP
    >>> def temperature(run):                                                                   # doctest: +SKIP
    ...     return run.samples["temperature"][-1]
    >>> study = haff.sweep(gas, values, seeds=4, output="study", measure=temperature)           # doctest: +SKIP
    >>> study.temperature_mean, study.temperature_error                                         # doctest: +SKIP
    """
    retries = arguments.count("retries", retries, 0)
    numbers = {"seeds": (seeds, 1_000_000), "jobs": (jobs, 1024), "threads": (threads, 1024)}
    for name, (given, most) in numbers.items():
        if given is not None:
            arguments.count(name, given, 1, most)
    if values is not None and not (isinstance(values, Mapping) and all(isinstance(key, str) for key in values)):
        raise ArgumentError(f"values = {quoted(values)}: must be a dict, keys of the scene and lists of their values")
    values = {key: _several(key, several) for key, several in (values or {}).items()}
    # Workers may have another working directory.
    folder = arguments.file("output", output).absolute()
    fixed = dotted(overrides)
    if both := sorted(set(fixed) & set(values)):
        raise ArgumentError(f"{both[0]}: is among the values, and has a value of its own")
    table = Table(folder, dims, series, measure)
    with briefly():
        sets = [f"--set={key}={','.join(compiled().value(value, key) for value in values[key])}" for key in values]
    sets += [f"--set={setting}" for setting in settings(overrides)]
    words = ["sweep", str(_scene_file(scene, folder)), "-o", str(folder), *sets]
    if seeds is not None:
        words.append(f"--seeds={seeds}")
    if cluster is None:
        options = [f"--{name}={n}" for name, n in (("jobs", jobs), ("threads", threads)) if n is not None]
        rows = _call([*words, *options])["runs"]
    else:
        # In the order of the grid, whatever their numbers.
        members = [row["index"] for row in _call([*words, "--list"])["runs"]]
        with _client(cluster, threads or 1) as client:
            task = [*words, f"--threads={threads or 1}"]
            futures = client.map(_member, [[*task, f"--index={k}"] for k in members], pure=False, retries=retries)
            rows = client.gather(futures)
        # Updates the folder's manifest with the runs made by the cluster.
        _call([*words, "--list"])
    failed = [row for row in rows if row["status"] == "failed"]
    if failed:
        first = failed[0]
        reason = "; ".join(map(escaped, first["error"].splitlines()))
        message = f"{len(failed)} of {len(rows)} runs failed; run {first['index']}: {reason}"
        warnings.warn(message, RuntimeWarning, stacklevel=2)
    warned = [row for row in rows if row.get("warnings")]
    if warned:
        first = warned[0]
        text = f"{len(warned)} of {len(rows)} runs have warnings; run {first['index']}: {first['warnings'][0]}"
        warn([text], stacklevel=3)
    return table.of(rows, values, fixed, seeds)


def _several(key: str, values: Iterable[Any]) -> list[Any]:
    listed = isinstance(values, Iterable) and not isinstance(values, (str, bytes, Mapping))
    try:
        found = list(values) if listed else []
    except TypeError:
        # A number as an array without dimensions.
        found = []
    if not found:
        raise ArgumentError(f"{key}: needs a list of values, not {quoted(values)}")
    return found


def _scene_file(scene: Scene, folder: Path) -> Path:
    if not isinstance(scene, Mapping):
        return scene_path(scene).absolute()
    text = scene_text(scene)
    path = folder / "scene.toml"
    if path.exists():
        if not _is_text(path, text):
            raise FileError(f"{path} belongs to another sweep: take another folder")
        return path
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def _is_text(path: Path, text: str) -> bool:
    """Whether a file holds exactly this text."""
    try:
        return path.read_bytes().replace(b"\r\n", b"\n") == text.encode()
    except OSError as error:
        raise FileError(f"{path}: {error.strerror or error}") from None


def _call(words: Sequence[str]) -> dict[str, Any]:
    """The command's JSON. Its exit status is that of its worst run, so only a call without JSON is an error."""
    done = call([*words, "--json", "--quiet"])
    if done.returncode == 130:
        raise KeyboardInterrupt
    found = json.loads(done.stdout) if done.stdout else {}
    if not found or is_failure(found):
        raise failure(done)
    return found


def _member(words: list[str]) -> dict[str, Any]:
    """Runs one member on a worker of a cluster.

    The run of a killed worker may continue: then this waits for its end.
    """
    for pause in itertools.chain((0.1, 0.2, 0.5, 1, 2), itertools.repeat(5)):
        row = _call(words)
        if row["status"] != "running":
            break
        time.sleep(pause)
    if row["status"] == "failed" and row.get("exit") == 4:
        raise FileError(tuple(row["error"].splitlines()))
    if row.get("stopped") == "signal":
        raise FileError(f"run {row['index']} was stopped by a signal")
    return row


def _client(cluster: Any, threads: int):
    """A Dask client as a context manager; a client or cluster passed in stays open."""
    distributed = library("distributed", "sweep")
    if isinstance(cluster, distributed.Client):
        return contextlib.nullcontext(cluster)
    if cluster != "local":
        return distributed.Client(cluster)

    @contextlib.contextmanager
    def local():
        at_a_time = max(1, (os.cpu_count() or 1) // threads)
        # Each run is a process of its own, and worker processes would import the caller's script again.
        with (
            distributed.LocalCluster(
                n_workers=1, threads_per_worker=at_a_time, processes=False, dashboard_address=None
            ) as here,
            distributed.Client(here) as client,
        ):
            yield client

    return local()
