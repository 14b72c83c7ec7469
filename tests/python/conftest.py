"""Fixtures: synthetic files, and the `haff` command with a cache of finished runs."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import pytest

import haff
from pages import browser, show  # noqa: F401 (fixtures)
from patience import HANGS
from validation.runs import ROOT, executable, toml

matplotlib.use("Agg")

CONFIGS = ROOT / "configs"


@dataclass
class Run:
    """A finished run: its `--json` object and, if it wrote one, its file."""

    report: dict[str, Any]
    path: Path | None

    def open(self) -> haff.File:
        assert self.path is not None
        return haff.open(self.path)


class Command:
    """Runs the `haff` command; equal runs are made once a session."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.done: dict[tuple, Run] = {}

    def __call__(
        self, *arguments: str | Path, check: bool = True, cwd: Path | None = None
    ) -> subprocess.CompletedProcess:
        command = [str(executable()), *map(str, arguments)]
        result = subprocess.run(
            command, capture_output=True, text=True, timeout=HANGS, stdin=subprocess.DEVNULL, cwd=cwd
        )
        if check:
            assert result.returncode == 0, f"{' '.join(command)}\nexit {result.returncode}\n{result.stderr}"
        return result

    def run(self, scene: str | Path, *, threads: int = 1, output: bool = True, **settings: Any) -> Run:
        """`haff run`; settings as `contact__restitution=0.8`. Scenes by their name in configs/ or by path."""
        path = scene if isinstance(scene, Path) else CONFIGS / f"{scene}.toml"
        sets = [f"{key.replace('__', '.')}={toml(value)}" for key, value in settings.items()]
        key = (str(path), threads, output, *sorted(sets))
        if key not in self.done:
            target = self.directory / f"run-{len(self.done)}.h5"
            arguments: list[str | Path] = ["run", path, "--json", "--quiet", "--threads", str(threads)]
            for item in sets:
                arguments += ["--set", item]
            if output:
                arguments += ["-o", target]
            result = self(*arguments)
            self.done[key] = Run(json.loads(result.stdout), target if output else None)
        return self.done[key]


@pytest.fixture(scope="session")
def command(tmp_path_factory: pytest.TempPathFactory) -> Command:
    return Command(tmp_path_factory.mktemp("runs"))


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Synthetic files by name."""
    import synthetic

    directory = tmp_path_factory.mktemp("synthetic")
    return {
        "cooling": synthetic.cooling_gas(directory / "cooling.h5"),
        "disks": synthetic.cooling_gas(directory / "disks.h5", n=900, eta=0.2, d=2),
        "elastic": synthetic.cooling_gas(directory / "elastic.h5", e=1.0, eta=0.2, frames=4),
        "quiet": synthetic.cooling_gas(directory / "quiet.h5", n=500, events=False, frames=4),
        "ball": synthetic.bouncing_ball(directory / "ball.h5"),
        "rough": synthetic.cooling_gas(directory / "rough.h5", beta=0.5),
        "rough_disks": synthetic.cooling_gas(directory / "rough_disks.h5", n=900, eta=0.2, d=2, beta=-0.3),
        "impacts": synthetic.rough_impacts(directory / "impacts.h5"),
        "sliding": synthetic.sliding_ball(directory / "sliding.h5"),
    }


@pytest.fixture(scope="module")
def bounded() -> Iterator[None]:
    """Limits the memory to 3 GiB beyond the present use: an error must not exhaust the memory of the machine."""
    resource = pytest.importorskip("resource", reason="memory can be limited on Unix only")
    status = Path("/proc/self/statm")
    if not status.exists():
        pytest.skip("the size of this process is not known")
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    size = int(status.read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + (3 << 30), hard))
    yield
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
