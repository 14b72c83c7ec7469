"""Studies of many runs: :func:`sweep` runs a scene for every combination of values, here or on a Dask cluster.

Each run is a ``haff sweep … --index I`` of its own, so a study can be begun here and gone on with by the command, by
Snakemake or by a job array, in the same folder.
"""

from __future__ import annotations

import itertools
import json
import os
import shutil
import subprocess
import sys
import time
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import FileError, HaffError

if TYPE_CHECKING:
    import xarray

__all__ = ["sweep"]

# Totals that are text; all others are numbers.
_TEXTS = ("status", "stopped", "state_hash", "file", "error")
_NUMBERS = (
    "index particles collisions wall_collisions events rests simulated_time kinetic_energy potential_energy "
    "dissipated_energy carnot_energy wall_work ledger_residual max_overlap wall_seconds"
).split()


def sweep(
    scene: str | os.PathLike[str] | Mapping[str, Any],
    values: Mapping[str, Iterable[Any]] | None = None,
    *,
    seeds: int | None = None,
    output: str | os.PathLike[str],
    series: Sequence[str] = (),
    cluster: Any = None,
    jobs: int | None = None,
    threads: int | None = None,
    retries: int = 3,
) -> xarray.Dataset:
    """Runs a scene for every combination of values and returns the totals of all runs.

    What is complete in the folder `output` is left alone, what was stopped goes on from its checkpoint. A run that
    fails does not stop the others: its ``status`` is ``"failed"``, its ``error`` tells why, and a warning counts them.

    >>> study = haff.sweep("cooling.toml", {"contact.restitution": [0.8, 0.9]}, seeds=4, output="study")
    ...                                                                         # doctest: +SKIP
    >>> study["dissipated_energy"].mean("seed")                                  # doctest: +SKIP

    Args:
        scene: Scene file, or the scene itself as a mapping; then it is saved as ``scene.toml`` in `output`.
        values: Dotted keys of the scene and the values that each takes.
        seeds: Runs of each combination, with seeds derived by a hash from the scene's seed, the parameters and the
            number of the run; by default one, with the scene's own seed.
        output: Folder of the files and of ``manifest.json``.
        series: Columns of :attr:`haff.File.observables` to read from each file, as variables ``NAME_series`` over
            ``time``.
        cluster: Where to run: ``None`` for this machine, by ``haff sweep``; ``"local"`` for a Dask ``LocalCluster``;
            or any Dask cluster or client, such as a ``dask_jobqueue.SLURMCluster``. Its workers need this package and
            the folder.
        jobs: Runs at a time on this machine (default: as many as there are cores).
        threads: Threads of each run (default: 1 on a cluster, else the cores that are left over).
        retries: How often a run is tried again on a cluster when its file could not be written, or it was killed.

    Returns:
        Dataset with a dimension for each key, and ``seed`` (number of the run, from 0). Variables: totals as in the
        report of ``haff run``, ``state_hash``, ``status``, ``file``, and ``run_seed``.

    Raises:
        HaffError: The scene or the values are invalid.
        FileError: A file cannot be read or written, or `output` holds another sweep.
    """
    values = {key: _several(key, several) for key, several in (values or {}).items()}
    folder = Path(output)
    arguments = ["sweep", str(_scene_file(scene, folder)), "-o", str(folder)]
    for key, several in values.items():
        arguments += ["--set", f"{key}={','.join(map(_toml, several))}"]
    if seeds is not None:
        arguments += ["--seeds", str(seeds)]
    if cluster is None:
        options = [f"--{name}={n}" for name, n in (("jobs", jobs), ("threads", threads)) if n is not None]
        rows = _call([*arguments, *options])["runs"]
    else:
        count = _call([*arguments, "--list"])["members"]
        with _client(cluster, threads or 1) as client:
            task = [*arguments, f"--threads={threads or 1}"]
            futures = client.map(
                _member, [[*task, f"--index={k}"] for k in range(count)], cwd=os.getcwd(), pure=False, retries=retries
            )
            rows = client.gather(futures)
        # The folder's manifest takes note of what the cluster has done.
        _call([*arguments, "--list"])
    failed = [row for row in rows if row["status"] == "failed"]
    if failed:
        first = failed[0]
        message = f"{len(failed)} of {len(rows)} runs failed; run {first['index']}: {first['error']}"
        warnings.warn(message, RuntimeWarning, stacklevel=2)
    return _dataset(rows, values, seeds, folder, series)


def _several(key: str, values: Iterable[Any]) -> list[Any]:
    if isinstance(values, (str, Mapping)) or not isinstance(values, Iterable):
        raise HaffError(f"{key}: needs a list of values, not {values!r}")
    return list(values)


def _scene_file(scene: str | os.PathLike[str] | Mapping[str, Any], folder: Path) -> Path:
    if not isinstance(scene, Mapping):
        return Path(scene)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "scene.toml"
    path.write_text("".join(f"{key} = {_toml(value)}\n" for key, value in scene.items()))
    return path


def _toml(value: Any) -> str:
    """A value as TOML on one line."""
    if isinstance(value, np.generic) or isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, (str, os.PathLike)):
        return json.dumps(os.fspath(value))
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{json.dumps(key)} = {_toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, Iterable):
        return "[" + ", ".join(map(_toml, value)) + "]"
    raise HaffError(f"{value!r} has no counterpart in a scene file: numbers, text, booleans, lists and mappings have")


def _executable() -> str:
    """The command: $HAFF, the one installed beside this Python, or the one on PATH."""
    beside = Path(sys.executable).parent / "haff"
    found = os.environ.get("HAFF") or (str(beside) if beside.exists() else None) or shutil.which("haff")
    if not found:
        raise HaffError("no haff command: install the package, or set HAFF to the command's path")
    return found


def _call(arguments: Sequence[str], cwd: str | None = None) -> dict[str, Any]:
    """Runs the command and returns its JSON; an exit status is an error only if there is none."""
    command = [_executable(), *arguments, "--json", "--quiet"]
    done = subprocess.run(command, cwd=cwd, capture_output=True, stdin=subprocess.DEVNULL, text=True)
    if done.returncode == 130:
        raise KeyboardInterrupt
    if not done.stdout:
        message = done.stderr.strip().removeprefix("error: ") or f"{command[0]} ended with status {done.returncode}"
        raise HaffError(message) if done.returncode == 2 else FileError(message)
    return json.loads(done.stdout)


def _member(arguments: list[str], cwd: str) -> dict[str, Any]:
    """Runs one member on a worker of a cluster.

    A worker that is killed can leave its run going on: then its file is waited for.
    """
    for pause in itertools.chain((0.1, 0.2, 0.5, 1, 2), itertools.repeat(5)):
        row = _call(arguments, cwd)
        if row["status"] != "running":
            break
        time.sleep(pause)
    if row["status"] == "failed" and row.get("exit") == 4:
        raise FileError(row["error"])
    if row.get("stopped") == "signal":
        raise FileError(f"run {row['index']} was stopped by a signal")
    return row


def _client(cluster: Any, threads: int):
    """A Dask client as a context; what was handed in stays open."""
    import contextlib

    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise HaffError("cluster= needs Dask: pip install 'haff[sweep]'") from error
    if isinstance(cluster, Client):
        return contextlib.nullcontext(cluster)
    if cluster != "local":
        return Client(cluster)

    @contextlib.contextmanager
    def local():
        workers = max(1, (os.cpu_count() or 1) // threads)
        with (
            LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as here,
            Client(here) as client,
        ):
            yield client

    return local()


def _dataset(
    rows: Sequence[Mapping[str, Any]],
    values: Mapping[str, list[Any]],
    seeds: int | None,
    folder: Path,
    series: Sequence[str],
) -> xarray.Dataset:
    try:
        import xarray
    except ImportError as error:
        raise HaffError("haff.sweep needs xarray: pip install 'haff[sweep]'") from error
    coordinates = {key: _coordinate(several) for key, several in values.items()}
    if "seed" not in coordinates or seeds is not None:
        # A seed among the values is then a single one, which the others are derived from.
        coordinates.pop("seed", None)
        coordinates["seed"] = np.arange(seeds or 1)
    shape = tuple(map(len, coordinates.values()))
    dimensions = tuple(coordinates)
    # The order of the command: the first key slowest, derived seeds fastest.
    rows = sorted(rows, key=lambda row: row["index"])
    variables: dict[str, Any] = {}
    for name in _NUMBERS:
        found = [row.get(name) for row in rows]
        whole = all(isinstance(value, int) for value in found)
        numbers = found if whole else [np.nan if value is None else value for value in found]
        variables[name] = (dimensions, np.array(numbers, dtype=np.int64 if whole else float).reshape(shape))
    for name in _TEXTS:
        variables[name] = (
            dimensions,
            np.array([str(row.get(name) or "") for row in rows], dtype=object).reshape(shape),
        )
    run_seeds = np.array([row["seed"] if row["seed"] is not None else -1 for row in rows], dtype=np.int64)
    variables["run_seed"] = (dimensions, run_seeds.reshape(shape))
    dataset = xarray.Dataset(variables, coordinates)
    for name, array in _series(rows, folder, series).items():
        dataset[f"{name}_series"] = ((*dimensions, "time"), array.to_numpy().T.reshape((*shape, len(array))))
        dataset = dataset.assign_coords(time=array.index.to_numpy())
    dataset.attrs["folder"] = str(folder)
    return dataset


def _coordinate(several: list[Any]) -> Any:
    """Numbers and text as they are, everything else as TOML."""
    plain = all(isinstance(value, (int, float, str, np.generic)) for value in several)
    return several if plain else [_toml(value) for value in several]


def _series(rows: Sequence[Mapping[str, Any]], folder: Path, names: Sequence[str]) -> dict[str, Any]:
    """For each name a table with a row for each time of any run and a column for each run."""
    if not names:
        return {}
    import pandas

    from .reader import open

    tables = {}
    for row in rows:
        path = folder / row["file"]
        if row["status"] == "complete":
            with open(path) as file:
                tables[row["index"]] = file.observables.set_index("time")[list(names)]
    columns = [row["index"] for row in rows]
    return {
        name: pandas.concat({k: table[name] for k, table in tables.items()}, axis=1)
        .sort_index()
        .reindex(columns=columns)
        for name in names
    }
