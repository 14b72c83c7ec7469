"""Runs the `haff` command for the parts: many independent runs side by side, each on one thread."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import haff

ROOT = Path(__file__).resolve().parents[2]
SCENES = ROOT / "configs" / "validation"

Settings = Mapping[str, Any]
"""What to `--set`: dotted keys of the scene and their values."""

Analysis = Callable[[haff.File, dict[str, Any]], Any]
"""Evaluates the file of a finished run and its `--json` report; a function at the top of a module."""


def executable(given: Path | None = None) -> Path:
    """The command under test: the one given, $HAFF, the one installed beside this Python, or the one on PATH."""
    beside = Path(sys.executable).parent / "haff"
    found = given or os.environ.get("HAFF") or (beside if beside.exists() else shutil.which("haff"))
    if not found or not Path(found).exists():
        raise RuntimeError("no haff command: run `pip install .` first, or set HAFF to the binary")
    return Path(found).resolve()


def toml(value: Any) -> str:
    """A value as TOML, for `--set`."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml(v) for v in value) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {toml(v)}" for k, v in value.items()) + " }"
    return json.dumps(value) if isinstance(value, str) else repr(value)


def run(binary: Path, scene: Path, settings: Settings, output: Path) -> dict[str, Any]:
    """One run on one thread, its output in a file; the report of `--json`. A run that fails is an error."""
    command = [str(binary), "run", str(scene), "--json", "--quiet", "--threads", "1", "-o", str(output), "--overwrite"]
    for key, value in settings.items():
        command += ["--set", f"{key}={toml(value)}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}\nexit {done.returncode}\n{done.stderr}")
    return json.loads(done.stdout)


def run_and_analyse(binary: Path, scene: Path, settings: Settings, analyse: Analysis) -> tuple[Any, dict[str, Any]]:
    """One run: analysed, its file removed."""
    with tempfile.TemporaryDirectory(prefix="haff-validate-") as directory:
        output = Path(directory) / "run.h5"
        report = run(binary, scene, settings, output)
        with haff.open(output) as file:
            return analyse(file, report), report


@dataclass
class Context:
    """Services for a part: the command, the number of simultaneous runs, and the effort."""

    binary: Path
    jobs: int
    quick: bool = False
    collisions: int = 0
    """Collisions of all runs so far."""
    worst_overlap: float = 0.0
    """Deepest overlap that any run has reported [contact distances]."""
    worst_residual: float = 0.0
    """Largest ledger residual that any run has reported."""
    label: str = ""
    _pool: ProcessPoolExecutor | None = field(default=None, repr=False)

    def effort(self, full: int, quick: int) -> int:
        """``full``, or ``quick`` with `--quick`."""
        return quick if self.quick else full

    def seeds(self, full: int = 8) -> range:
        """Seeds of independent runs: at least 8, so that their scatter gives the error; 8 with `--quick`."""
        return range(1, self.effort(max(full, 8), 8) + 1)

    def each(self, scene: str | Path, settings: Sequence[Settings], analyse: Analysis) -> list[Any]:
        """Runs a scene (its name in configs/validation/, or path) with each of the settings; the analyses in order."""
        path = scene if isinstance(scene, Path) else SCENES / f"{scene}.toml"
        return self.map(run_and_analyse, [(self.binary, path, s, analyse) for s in settings], self._account)

    def map(
        self, work: Callable[..., Any], arguments: Sequence[tuple], done: Callable[[Any], Any] | None = None
    ) -> list:
        """``work(*arguments)`` for each, in processes side by side; results in the order of the arguments."""
        if self._pool is None:
            self._pool = ProcessPoolExecutor(self.jobs)
        started = time.monotonic()
        futures = {self._pool.submit(work, *a): k for k, a in enumerate(arguments)}
        results: list[Any] = [None] * len(futures)
        for count, future in enumerate(as_completed(futures), 1):
            result = future.result()
            results[futures[future]] = done(result) if done else result
            if sys.stderr.isatty() or count == len(futures):
                print(
                    f"\r{self.label}: {count}/{len(futures)} runs, {time.monotonic() - started:.0f} s",
                    end="\n" if count == len(futures) else "",
                    file=sys.stderr,
                    flush=True,
                )
        return results

    def _account(self, result: tuple[Any, dict[str, Any]]) -> Any:
        analysed, report = result
        self.collisions += report["events"]
        self.worst_overlap = max(self.worst_overlap, report["max_overlap"])
        self.worst_residual = max(self.worst_residual, abs(report["ledger_residual"]))
        return analysed

    def close(self) -> None:
        """Ends the processes."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None
