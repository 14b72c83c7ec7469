"""The command ``haff`` that belongs to this package: its path, and how it is called."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sysconfig
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import FileError, HaffError, SceneError, SceneProblem, SimulationError

__all__ = ["executable"]


def executable() -> str:
    """Path of the command: ``$HAFF``, the one installed beside this package, or the first on the path."""
    if chosen := os.environ.get("HAFF"):
        return chosen
    name = "haff" + (sysconfig.get_config_var("EXE") or "")
    package = Path(__file__).resolve().parent
    folders = [sysconfig.get_path("scripts")]
    # Installed for one user, or by `pip install --target`.
    folders.append(sysconfig.get_path("scripts", sysconfig.get_preferred_scheme("user")))
    folders.append(str(package.parent / "bin"))
    for folder in folders:
        if folder and (Path(folder) / name).is_file():
            return str(Path(folder) / name)
    if found := shutil.which("haff"):
        return found
    raise HaffError("no command haff: pip install . at the repository's root, or set HAFF to the binary")


def call(arguments: Sequence[str | os.PathLike[str]], *, show: bool = False) -> subprocess.CompletedProcess[str]:
    """Runs the command, and on Ctrl-C lets it end cleanly, with a checkpoint, before KeyboardInterrupt goes on.

    If this process ends in any other way, also by SIGTERM or SIGKILL, the command ends as by SIGTERM. ``show`` passes
    its messages on to this process's standard error.
    """
    with (
        _open_until_this_process_ends() as pipe,
        subprocess.Popen(
            [executable(), *map(os.fspath, arguments)],
            stdin=pipe,
            stdout=subprocess.PIPE,
            stderr=None if show else subprocess.PIPE,
            encoding="utf-8",
            # Names of files need not be UTF-8.
            errors="surrogateescape",
            env={**os.environ, "HAFF_ENDS_WITH_STDIN": "1", "HAFF_WORDS": "python"},
            # A process group of its own: Ctrl-C in a terminal reaches it once, from here. A second SIGINT kills it.
            start_new_session=True,
        ) as process,
    ):
        try:
            out, err = process.communicate()
        except BaseException:
            process.send_signal(signal.SIGINT)
            process.communicate()
            raise
    return subprocess.CompletedProcess(process.args, process.returncode, out, err or "")


_held: set[int] = set()
"""The ends of pipes that this process holds open for the commands that it runs."""


@contextmanager
def _open_until_this_process_ends() -> Iterator[int]:
    """The reading end of a pipe that has its end of file when the block ends, or this process, however that happens."""
    reading, writing = os.pipe()
    _held.add(writing)
    try:
        yield reading
    finally:
        os.close(reading)
        _held.discard(writing)
        os.close(writing)


def _release() -> None:
    """In a forked process: it must not hold the pipes of its parent open."""
    for writing in _held:
        os.close(writing)
    _held.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_release)


def failure(done: subprocess.CompletedProcess[str], about: str | None = None) -> HaffError:
    """The exception for a failed call; ``about`` is the message if the command has stated none."""
    told = _stated(done.stdout)
    if problems := told.get("problems"):
        problems = [SceneProblem.of(problem) for problem in problems]
    if done.returncode == 2:
        lines = _lines(told.get("error") or done.stderr or about or "the arguments are not valid")
        return SceneError(problems or [SceneProblem(line, message=line) for line in lines])
    lines = _lines(told.get("error") or done.stderr or about or f"haff: exit status {done.returncode}")
    return {3: SimulationError, 4: FileError}.get(done.returncode, HaffError)(lines)


def is_failure(told: Mapping[str, Any]) -> bool:
    """Whether the JSON of a command says why there is no result."""
    return "problems" in told


def _stated(printed: str) -> Mapping[str, Any]:
    """The failure that a command has printed as JSON; empty if it has not."""
    try:
        told = json.loads(printed)
    except ValueError:
        return {}
    return told if isinstance(told, dict) and is_failure(told) else {}


def _lines(message: str) -> tuple[str, ...]:
    return tuple(line.removeprefix("error: ") for line in message.splitlines() if line.strip())
